//! Pose tables with a line of column names.
//!
//! | column | content |
//! |---|---|
//! | `time_s` | time, s from any origin; must not decrease |
//! | `x_mm`, `y_mm`, `z_mm` | centre of the transducer's face |
//! | `qw`, `qx`, `qy`, `qz` | unit quaternion that turns probe axes into the scene's |
//! | `status` | optional: `ok` or empty, or `invalid` for a row without a pose, whose numbers are ignored |
//! | `event` | optional: name of an event at that time |
//!
//! [`table`](crate::pose::table) says how lines, names and units are read. Here the name of each length and time needs a
//! unit; `x_m` and `time_ms` are read as well. A row has no pose if all numbers of it are empty, NaN or zero: trackers
//! write that while they don't see their tool.

use std::io::BufRead;
use std::path::Path;

use super::{InterchangeError, Lines, Place, TrackedRow};
use crate::pose::Pose;
use crate::pose::csv::pose_position;
use crate::pose::table::{Column, Layout, PoseField, Position, Reader, TableFault, number, quote};

const KNOWN: &str =
    "time_s, x_mm, y_mm, z_mm, qw, qx, qy, qz, and optionally status, event (other units: x_cm, x_m, time_ms)";

/// Reads the rows of a table; errors name it `path`.
///
/// # Errors
/// A missing, unknown, ambiguous or repeated column, or one without its unit; a row with the wrong number of fields; a
/// field that is not a number; numbers that are not a pose.
pub fn read(source: impl BufRead, path: &Path) -> Result<Vec<TrackedRow>, InterchangeError> {
    let mut lines = Lines::new(source, path);
    let mut reader = Reader::new(None);
    let mut columns: Option<Columns> = None;
    let mut rows = Vec::new();
    while let Some((place, line)) = lines.next_line()? {
        let failed = |fault: TableFault| place.error(path, fault.to_string());
        let row = reader.line(line).map_err(failed)?;
        if columns.is_none() && !reader.columns().is_empty() {
            columns = Some(Columns::of(reader.columns()).map_err(failed)?);
        }
        if let (Some(row), Some(columns)) = (row, &columns) {
            rows.push(columns.row(&row, place).map_err(|reason| place.error(path, reason))?);
        }
    }
    if columns.is_none() {
        return Err(InterchangeError::file(path, format!("it has no head line; the columns are {KNOWN}")));
    }
    Ok(rows)
}

/// Columns of a table.
struct Columns {
    layout: Layout,
    position: Position,
    /// Index, name and seconds per unit.
    time: (usize, String, f64),
}

impl Columns {
    fn of(columns: &[Column]) -> Result<Self, TableFault> {
        let layout = Layout::of(columns, KNOWN)?;
        let without_unit = |name: &str, names: &str| TableFault::Refused {
            name: quote(name),
            reason: format!("it has no unit; name it {names}"),
        };
        let (at, name, unit_s) =
            layout.time.clone().ok_or_else(|| TableFault::Missing { name: "time_s".to_owned(), known: KNOWN })?;
        let position = pose_position(&layout, columns, KNOWN)?.clone();
        if let Some(name) = &position.without_unit {
            return Err(without_unit(name, &["mm", "cm", "m"].map(|unit| format!("{name}_{unit}")).join(", ")));
        }
        let unit_s = unit_s.ok_or_else(|| without_unit(&name, "time_s or time_ms"))?;
        Ok(Self { time: (at, name, unit_s), layout, position })
    }

    fn row(&self, row: &[String], place: Place) -> Result<TrackedRow, String> {
        let fault = |fault: TableFault| fault.to_string();
        let (at, name, unit_s) = &self.time;
        let time_s = unit_s * finite(name, row.get(*at).map_or("", String::as_str)).map_err(fault)?;
        let pose = if self.layout.has_pose(row).map_err(fault)? { self.pose(row)? } else { None };
        let event = self.layout.event.and_then(|at| row.get(at)).filter(|name| !name.is_empty()).cloned();
        Ok(TrackedRow { time_s, pose, event, place })
    }

    fn pose(&self, row: &[String]) -> Result<Option<Pose>, String> {
        let fault = match self.layout.pose(&self.position, row) {
            Ok(Ok(PoseField::Pose(pose))) => return Ok(Some(pose)),
            Ok(Ok(PoseField::Absent)) => return Ok(None),
            Ok(Err(error)) => error.to_string(),
            Err(fault) => fault.to_string(),
        };
        Err(self.layout.absent(&self.position, row).map_or(fault, |(name, field)| part(name, field)))
    }
}

/// Error for a pose of which only a part is there.
fn part(name: &str, field: &str) -> String {
    let found = quote(field);
    format!(
        "`{name}` is {found}, but other numbers of the pose are there; in a row without a pose all seven are empty or NaN, or `status` is invalid"
    )
}

/// Parses the finite number in a field of the column `name`.
fn finite(name: &str, field: &str) -> Result<f64, TableFault> {
    let found = number(name, field)?;
    if found.is_finite() {
        return Ok(found);
    }
    Err(TableFault::Number { column: name.to_owned(), found: quote(field), hint: String::new() })
}
