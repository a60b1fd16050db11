//! Points, landmarks and poses in text files: tables, and 3D Slicer's markups.
//!
//! [`table`](super::table) describes the columns. Without a line of column names, the columns are those of [`points`],
//! [`pairs`] and [`poses`], in that order. Errors name the line.

use std::rc::Rc;

use glam::DVec3;
use thiserror::Error;

use super::Pose;
use super::registration::PointPair;
use super::table::{
    Column, Frame, Headless, Layout, Meaning, Position, Reader, System, TableFault, markups, quote, refuse,
};

/// Errors in point and pose lists.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum CsvError {
    /// A malformed line, a fault of the columns, or numbers that are not a pose.
    #[error("line {line}: {source}")]
    Line {
        /// Line, from 1.
        line: usize,
        /// Fault of the line.
        source: TableFault,
    },
    /// No line contains numbers.
    #[error("there is no line with {expected}")]
    Empty {
        /// Expected content.
        expected: &'static str,
    },
    /// A list in which no row has a value.
    #[error("none of its {rows} rows has {what}")]
    Absent {
        /// Number of rows.
        rows: usize,
        /// Content that all rows lack, and how a row marks it as missing.
        what: &'static str,
    },
    /// An unsupported list of 3D Slicer.
    #[error("{reason}")]
    Markups {
        /// Fault and advice.
        reason: String,
    },
}

/// A named value.
#[derive(Debug, Clone, PartialEq)]
pub struct Named<T> {
    /// Name, or the row's number from 1.
    pub name: String,
    /// The value.
    pub value: T,
}

/// Values read from a file, and notes for the user.
#[derive(Debug, Clone, PartialEq)]
pub struct Listed<T> {
    /// The values.
    pub values: Vec<T>,
    /// Whether points are in LPS (x left, y posterior, z superior), because the file gives them along the patient's
    /// axes.
    pub in_lps: bool,
    /// Notes for the user on how the file was read, a sentence each.
    pub notes: Vec<String>,
}

const POINT: Headless = Headless {
    names: &["x", "y", "z", "name"],
    expected: "`x,y,z` and perhaps `,name` (mm); a line of column names tells other columns apart",
};
const PAIR: Headless = Headless {
    names: &["x", "y", "z", "tx", "ty", "tz", "name"],
    expected: "`x,y,z,tx,ty,tz` and perhaps `,name` (mm; first the scene's point, then the tracker's); a line of column names tells other columns apart",
};
const POSE: Headless = Headless {
    names: &["x", "y", "z", "qw", "qx", "qy", "qz"],
    expected: "`x,y,z,qw,qx,qy,qz` (mm and a unit quaternion); a line of column names tells other columns apart",
};

const POINT_COLUMNS: &str = "x,y,z (mm, or with a unit as x_m), or r,a,s or l,p,s of the patient's axes, and name";
const PAIR_COLUMNS: &str =
    "x,y,z of the scene (mm, or with a unit as x_m; or r,a,s or l,p,s), tx,ty,tz of the tracker (or tx_m), and name";
const POSE_COLUMNS: &str = "x,y,z (mm, or with a unit as x_m), qw,qx,qy,qz, and optionally time and status";

/// Content that rows without a position lack, for messages.
const NO_POSITION: &str = "a position: all are undefined, by the column `defined` or by 3D Slicer's status";
/// Content that rows without a pose lack, for messages.
const NO_POSE: &str = "a pose: all are empty, NaN or zero, or their `status` is invalid";

/// Parses points in the scene, mm, from a table or from a list of 3D Slicer (`.fcsv`, `.mrk.json`, exported `.csv`).
///
/// # Errors
/// A malformed line, a column that is not supported, or no point at all.
pub fn points(text: &str) -> Result<Listed<Named<DVec3>>, CsvError> {
    if is_json(text) {
        return of_markups(text);
    }
    let check = |layout: &Layout, columns: &[Column]| {
        only_points(columns)?;
        let reason = "a list of points has those of the scene only; `calibrate landmarks PAIRS` takes both";
        refuse(columns, |m| matches!(m, Meaning::Length { frame: Frame::Tracker, .. }), reason)?;
        layout.own.as_ref().map(drop).ok_or_else(|| missing("x", POINT_COLUMNS))
    };
    let mut list = List::new(text, POINT, POINT_COLUMNS, &check);
    while let Some((line, layout, row)) = list.next_row()? {
        let Some(position) = &layout.own else { continue };
        let name = list.name(&layout, &row);
        if list.is_left_out(&layout, &row) {
            list.left_out.push(name);
            continue;
        }
        let value = position.point(&row).map_err(|source| CsvError::Line { line, source })?;
        list.values.push(Named { name, value });
    }
    let system = list.system()?;
    list.values.iter_mut().for_each(|point| point.value = system.map_or(point.value, |s| s.to_lps(point.value)));
    list.finish(system, NO_POSITION)
}

/// Parses landmarks from a table. Each row has a point in the scene and the same point as measured by the tracker, mm.
///
/// # Errors
/// A malformed line, a column that is not supported, or no pair at all.
pub fn pairs(text: &str) -> Result<Listed<Named<PointPair>>, CsvError> {
    if is_json(text) {
        let reason = "3D Slicer's markups hold points of one frame; `calibrate landmarks --tracker STATION --points` touches \
                      them, and a table `x,y,z,tx,ty,tz,name` pairs them with the tracker's";
        return Err(CsvError::Markups { reason: reason.to_owned() });
    }
    let check = |layout: &Layout, columns: &[Column]| {
        only_points(columns)?;
        layout.own.as_ref().ok_or_else(|| missing("x", PAIR_COLUMNS))?;
        layout.tracker.as_ref().map(drop).ok_or_else(|| missing("tx", PAIR_COLUMNS))
    };
    let mut list = List::new(text, PAIR, PAIR_COLUMNS, &check);
    while let Some((line, layout, row)) = list.next_row()? {
        let (Some(scene), Some(tracker)) = (&layout.own, &layout.tracker) else { continue };
        let name = list.name(&layout, &row);
        if list.is_left_out(&layout, &row) {
            list.left_out.push(name);
            continue;
        }
        let pair = scene.point(&row).and_then(|scene_mm| Ok(PointPair { scene_mm, tracker_mm: tracker.point(&row)? }));
        list.values.push(Named { name, value: pair.map_err(|source| CsvError::Line { line, source })? });
    }
    let system = list.system()?;
    let turned = |point: DVec3| system.map_or(point, |system| system.to_lps(point));
    list.values.iter_mut().for_each(|pair| pair.value.scene_mm = turned(pair.value.scene_mm));
    list.finish(system, NO_POSITION)
}

/// Refuses columns that a table of points doesn't have.
fn only_points(columns: &[Column]) -> Result<(), TableFault> {
    let is_other = |m| matches!(m, Meaning::Quaternion(_) | Meaning::Status | Meaning::Event | Meaning::Time { .. });
    refuse(columns, is_other, "it doesn't belong to points")
}

/// Parses poses from a table: position in mm and unit quaternion. Rows without a pose are left out. In such a row, all
/// numbers are empty, NaN or zero, or the `status` is `invalid`.
///
/// # Errors
/// A malformed line, a column that is not supported, or no pose at all.
pub fn poses(text: &str) -> Result<Listed<Pose>, CsvError> {
    if is_json(text) {
        let reason = "3D Slicer's markups hold points, not poses; give a recording of `insonify record`, or a table \
                      `x,y,z,qw,qx,qy,qz`";
        return Err(CsvError::Markups { reason: reason.to_owned() });
    }
    let check = |layout: &Layout, columns: &[Column]| pose_position(layout, columns, POSE_COLUMNS).map(drop);
    let mut list = List::new(text, POSE, POSE_COLUMNS, &check);
    let mut absent = 0;
    while let Some((line, layout, row)) = list.next_row()? {
        let Some(position) = layout.own.as_ref().or(layout.tracker.as_ref()) else { continue };
        match layout.pose(position, &row).map_err(|source| CsvError::Line { line, source })? {
            Some(pose) => list.values.push(pose),
            None => absent += 1,
        }
    }
    let mut found = list.finish(None, NO_POSE)?;
    if absent > 0 {
        found.notes.push(format!("{absent} rows without a pose (empty, NaN, zero or `status` invalid) were left out"));
    }
    Ok(found)
}

/// Position columns of a table of poses. Errors list `known`, the column names of such tables.
///
/// # Errors
/// A column of the position or the quaternion is missing, or a column doesn't belong to poses.
pub fn pose_position<'a>(
    layout: &'a Layout,
    columns: &[Column],
    known: &'static str,
) -> Result<&'a Position, TableFault> {
    let of_patient = |m| matches!(m, Meaning::Length { frame: Frame::Patient, .. });
    refuse(
        columns,
        of_patient,
        "poses are in the tracker's or the scene's axes, not along the patient's; name its columns x_mm, y_mm and z_mm",
    )?;
    refuse(columns, |m| m == Meaning::Defined, "it belongs to points; `status` says which rows have a pose")?;
    if let (Some(own), Some(tracker)) = (&layout.own, &layout.tracker) {
        let reason = format!("the table has {}, too; a pose has one position", own.names());
        return Err(TableFault::Refused { name: quote(&tracker.names()), reason });
    }
    if layout.quaternion.is_none() {
        return Err(missing("qw", known));
    }
    layout.own.as_ref().or(layout.tracker.as_ref()).ok_or_else(|| missing("x_mm", known))
}

/// Function that checks the columns of a table.
type Check<'a> = &'a dyn Fn(&Layout, &[Column]) -> Result<(), TableFault>;

/// A row: its line number from 1, the layout of its columns, and its fields.
type Row = (usize, Rc<Layout>, Vec<String>);

/// Reader of the rows of a text, with the values made from the rows so far.
struct List<'a, T> {
    lines: std::iter::Enumerate<std::str::Lines<'a>>,
    reader: Reader,
    known: &'static str,
    expected: &'static str,
    check: Check<'a>,
    layout: Option<Rc<Layout>>,
    /// Number of rows read so far.
    rows: usize,
    values: Vec<T>,
    /// Names of the rows left out because they have no position.
    left_out: Vec<String>,
}

impl<'a, T> List<'a, T> {
    fn new(text: &'a str, headless: Headless, known: &'static str, check: Check<'a>) -> Self {
        let (lines, expected) = (text.lines().enumerate(), headless.expected);
        let reader = Reader::new(Some(headless));
        Self { lines, reader, known, expected, check, layout: None, rows: 0, values: Vec::new(), left_out: Vec::new() }
    }

    /// The next row; `None` at the end of the text.
    fn next_row(&mut self) -> Result<Option<Row>, CsvError> {
        for (index, text) in self.lines.by_ref() {
            let at = |source| CsvError::Line { line: index + 1, source };
            let row = self.reader.line(text).map_err(at)?;
            let columns = self.reader.columns();
            if self.layout.is_none() && !columns.is_empty() {
                let layout = Layout::of(columns, self.known).map_err(at)?;
                (self.check)(&layout, columns).map_err(at)?;
                self.layout = Some(Rc::new(layout));
            }
            if let (Some(row), Some(layout)) = (row, &self.layout) {
                self.rows += 1;
                return Ok(Some((index + 1, layout.clone(), row)));
            }
        }
        Ok(None)
    }

    fn name(&self, layout: &Layout, row: &[String]) -> String {
        layout.name(row).map_or_else(|| self.rows.to_string(), str::to_owned)
    }

    /// Coordinate system of the points, as a comment states it; `None` if the columns themselves name their axes.
    fn system(&self) -> Result<Option<System>, CsvError> {
        let own = self.layout.as_ref().and_then(|layout| layout.own.as_ref());
        if own.is_some_and(|position| position.frame == Frame::Patient) {
            return Ok(None);
        }
        self.reader.system().map_err(|source| CsvError::Line { line: 1, source })
    }

    /// Whether a row of points has no position: its column `defined` says so, or its status is 0, 1 or 3 (2: defined).
    /// 3D Slicer appends the status after the named columns.
    fn is_left_out(&self, layout: &Layout, row: &[String]) -> bool {
        let status = row.get(self.reader.columns().len());
        layout.is_undefined(row) || status.is_some_and(|status| ["0", "1", "3"].contains(&status.as_str()))
    }

    /// All values, with notes. `system` is the coordinate system of a list of 3D Slicer. `what` names the missing
    /// content if no row has a value.
    fn finish(self, system: Option<System>, what: &'static str) -> Result<Listed<T>, CsvError> {
        if self.values.is_empty() {
            return Err(match self.rows {
                0 => CsvError::Empty { expected: self.expected },
                rows => CsvError::Absent { rows, what },
            });
        }
        let mut notes = Vec::new();
        let own = self.layout.as_ref().and_then(|layout| layout.own.as_ref());
        if let Some(position) = own.filter(|position| position.frame == Frame::Patient) {
            let (names, turned) = (position.names(), position.turned());
            notes.push(format!("its columns {names} are the patient's axes; the points are taken in LPS: {turned}"));
        }
        if system == Some(System::Ras) {
            notes.push("its coordinate system is RAS; the points are taken in LPS: x = −x, y = −y".to_owned());
        }
        notes.extend(left_out_note(&self.left_out));
        let in_lps = system.is_some() || own.is_some_and(|position| position.frame == Frame::Patient);
        Ok(Listed { values: self.values, in_lps, notes })
    }
}

fn missing(name: &str, known: &'static str) -> TableFault {
    TableFault::Missing { name: name.to_owned(), known }
}

fn is_json(text: &str) -> bool {
    text.trim_start_matches('\u{feff}').trim_start().starts_with('{')
}

fn of_markups(text: &str) -> Result<Listed<Named<DVec3>>, CsvError> {
    let text = text.trim_start_matches('\u{feff}');
    let (mut values, mut left_out) = (Vec::new(), Vec::new());
    for (name, position) in markups(text).map_err(|reason| CsvError::Markups { reason })? {
        match position {
            Some(value) => values.push(Named { name, value }),
            None => left_out.push(name),
        }
    }
    if values.is_empty() {
        return Err(CsvError::Markups { reason: "none of its control points has a position".to_owned() });
    }
    Ok(Listed { values, in_lps: true, notes: left_out_note(&left_out).into_iter().collect() })
}

/// Note that lists the points left out; `None` if there are none.
fn left_out_note(names: &[String]) -> Option<String> {
    (!names.is_empty()).then(|| format!("points without a position were left out: {}", names.join(", ")))
}

#[cfg(test)]
mod tests;
