//! Pose tables: comma-separated values with a header line.
//!
//! | column | content |
//! |---|---|
//! | `time_s` | time, s from any origin; must not decrease |
//! | `x_mm`, `y_mm`, `z_mm` | centre of the transducer's face |
//! | `qw`, `qx`, `qy`, `qz` | unit quaternion that turns probe axes into the scene's |
//! | `status` | optional: `ok` or empty, or `invalid` for a row without a pose, whose numbers are ignored |
//! | `event` | optional: name of an event at that time |
//!
//! Columns may be in any order. Numbers have a decimal point. Empty lines and `#` comments are skipped; quotes are not
//! supported.

use std::io::BufRead;
use std::path::Path;

use super::{InterchangeError, Lines, Place, TrackedRow, finite, quote};
use crate::pose::Pose;
use crate::suggest::did_you_mean;

const TIME: &str = "time_s";
const POSE: [&str; 7] = ["x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"];
const OPTIONAL: [&str; 2] = ["status", "event"];

/// Reads the rows of a table; errors name it `path`.
///
/// # Errors
/// A missing, unknown or repeated column; a row with the wrong number of fields; a field that is not a number; numbers
/// that are not a pose.
pub fn read(source: impl BufRead, path: &Path) -> Result<Vec<TrackedRow>, InterchangeError> {
    let mut lines = Lines::new(source, path);
    let mut columns: Option<Columns> = None;
    let mut rows = Vec::new();
    while let Some((place, line)) = lines.next_line()? {
        let line = line.strip_prefix('\u{feff}').filter(|_| place.line == 1).unwrap_or(line);
        if line.trim().is_empty() || line.starts_with('#') {
            continue;
        }
        let row = match &columns {
            None => {
                columns = Some(Columns::of(line).map_err(|reason| place.error(path, reason))?);
                continue;
            }
            Some(columns) => columns.row(line, place),
        };
        rows.push(row.map_err(|reason| place.error(path, reason))?);
    }
    if columns.is_none() {
        return Err(InterchangeError::file(path, format!("it has no head line; the columns are {}", known())));
    }
    Ok(rows)
}

/// Index of each column.
struct Columns {
    count: usize,
    time: usize,
    pose: [usize; 7],
    status: Option<usize>,
    event: Option<usize>,
}

impl Columns {
    fn of(head: &str) -> Result<Self, String> {
        let names: Vec<_> = head.split(',').map(str::trim).collect();
        let all = || [TIME].into_iter().chain(POSE).chain(OPTIONAL);
        for (i, name) in names.iter().enumerate() {
            if !all().any(|known| known == *name) {
                let suggestion = did_you_mean(name, all());
                return Err(format!("unknown column {}{suggestion}; the columns are {}", quote(name), known()));
            }
            if names[..i].contains(name) {
                return Err(format!("column `{name}` is there twice"));
            }
        }
        let find = |name: &str| names.iter().position(|found| *found == name);
        let need =
            |name: &str| find(name).ok_or_else(|| format!("column `{name}` is missing; the columns are {}", known()));
        let mut pose = [0; 7];
        for (slot, name) in pose.iter_mut().zip(POSE) {
            *slot = need(name)?;
        }
        Ok(Self { count: names.len(), time: need(TIME)?, pose, status: find("status"), event: find("event") })
    }

    fn row(&self, line: &str, place: Place) -> Result<TrackedRow, String> {
        let fields: Vec<_> = line.split(',').map(str::trim).collect();
        if fields.len() != self.count {
            return Err(format!("{} fields; the head has {}", fields.len(), self.count));
        }
        let number = |name: &str, at: usize| {
            finite(fields[at]).ok_or_else(|| format!("`{name}` is {}; it must be a decimal number", quote(fields[at])))
        };
        let time_s = number(TIME, self.time)?;
        let pose = match self.status.map_or("", |at| fields[at]) {
            "" | "ok" | "OK" => {
                let mut components = [0.0; 7];
                for ((component, name), at) in components.iter_mut().zip(POSE).zip(self.pose) {
                    *component = number(name, at)?;
                }
                Some(Pose::from_components(components).map_err(|error| error.to_string())?)
            }
            "invalid" | "INVALID" => None,
            other => return Err(format!("`status` is {}; it must be ok, invalid or empty", quote(other))),
        };
        let event = self.event.map(|at| fields[at]).filter(|name| !name.is_empty()).map(str::to_owned);
        Ok(TrackedRow { time_s, pose, event, place })
    }
}

fn known() -> String {
    format!("{TIME}, {}, and optionally {}", POSE.join(", "), OPTIONAL.join(", "))
}
