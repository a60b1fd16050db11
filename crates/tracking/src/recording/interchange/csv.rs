//! Pose tables with a line of column names.
//!
//! | column | content |
//! |---|---|
//! | `time_s` | time, s from any origin; must not decrease |
//! | `x_mm`, `y_mm`, `z_mm` | centre of the transducer's face |
//! | `qw`, `qx`, `qy`, `qz` | unit quaternion that rotates the probe's axes to the scene's |
//! | `status` | optional: `ok` or empty, or `invalid` for a row without a pose, whose numbers are ignored |
//! | `event` | optional: name of an event at that time |
//!
//! [`table`](insonify_core::pose::table) defines how lines, names and units are read. Here, names of lengths and times
//! need a unit; `x_m` and `time_ms` are read as well. A row has no pose if all its numbers are empty, NaN or zero:
//! trackers write such rows while their tool is out of view.

use std::io::BufRead;
use std::path::Path;

use insonify_core::pose::csv::pose_position;
use insonify_core::pose::table::{Column, Layout, Position, Reader, TableFault, finite, quote};

use super::{InterchangeError, LinePosition, Lines, TrackedRow};

const KNOWN: &str =
    "time_s, x_mm, y_mm, z_mm, qw, qx, qy, qz, and optionally status, event (other units: x_cm, x_m, time_ms)";

/// Reads the rows of a table; errors name it `path`.
///
/// # Errors
/// A column that is missing, unknown, ambiguous, repeated or without a unit; a row with the wrong number of fields; a
/// field that is not a number; numbers that are not a pose.
pub fn read(source: impl BufRead, path: &Path) -> Result<Vec<TrackedRow>, InterchangeError> {
    let mut lines = Lines::new(source, path);
    let mut reader = Reader::new(None);
    let mut columns: Option<Columns> = None;
    let mut rows = Vec::new();
    while let Some((position, line)) = lines.next_line()? {
        let failed = |fault: TableFault| position.error(path, fault.to_string());
        let row = reader.line(line).map_err(failed)?;
        if columns.is_none() && !reader.columns().is_empty() {
            columns = Some(Columns::of(reader.columns()).map_err(failed)?);
        }
        if let (Some(row), Some(columns)) = (row, &columns) {
            rows.push(columns.row(&row, position).map_err(failed)?);
        }
    }
    if columns.is_none() {
        return Err(InterchangeError::file(path, format!("it has no head line; the columns are {KNOWN}")));
    }
    Ok(rows)
}

/// Indices of a table's columns.
struct Columns {
    layout: Layout,
    position: Position,
    /// Column of the time: index, name, and seconds per unit.
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

    fn row(&self, row: &[String], position: LinePosition) -> Result<TrackedRow, TableFault> {
        let (at, name, unit_s) = &self.time;
        let time_s = unit_s * finite(name, row.get(*at).map_or("", String::as_str))?;
        let pose = self.layout.pose(&self.position, row)?;
        let event = self.layout.event.and_then(|at| row.get(at)).filter(|name| !name.is_empty()).cloned();
        Ok(TrackedRow { time_s, pose, event, position })
    }
}
