//! Columns of a table, found by their meaning.

use glam::DVec3;

use super::{Column, Frame, Meaning, TableFault, finite, is_absent, number, quote};
use crate::pose::Pose;
use crate::suggest::did_you_mean;

/// Known column names from which errors suggest the nearest one.
const SUGGESTED: [&str; 24] = [
    "x_mm", "y_mm", "z_mm", "x", "y", "z", "tx", "ty", "tz", "qw", "qx", "qy", "qz", "r", "a", "s", "l", "p", "name",
    "label", "time_s", "status", "event", "defined",
];

/// Columns of one position.
#[derive(Debug, Clone, PartialEq)]
pub struct Position {
    /// Frame of the coordinates.
    pub(crate) frame: Frame,
    /// For each axis: index and name of its column, and millimetres per unit, negative for a reversed axis.
    axes: [(usize, String, f64); 3],
    /// A column of the position whose name has no unit; `None` if all have one.
    pub without_unit: Option<String>,
}

/// Columns of a table by their meaning. Columns are given by their indices; `None` for those that the table lacks.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Layout {
    /// Columns of the position in the table's own frame or along the patient's axes.
    pub(crate) own: Option<Position>,
    /// Columns of the position in the tracker's frame.
    pub(crate) tracker: Option<Position>,
    /// Columns of the quaternion's components w, x, y, z, each with its name.
    pub(crate) quaternion: Option<[(usize, String); 4]>,
    /// Column of the time: index, name, and seconds per unit (`None` if the name has no unit).
    pub time: Option<(usize, String, Option<f64>)>,
    /// Column of the row's name.
    pub(crate) name: Option<usize>,
    /// Column of the status, which tells whether a row has a pose.
    pub(crate) status: Option<usize>,
    /// Column of the event's name.
    pub event: Option<usize>,
    /// Column that tells whether a row has a position.
    pub(crate) defined: Option<usize>,
}

/// Parses the number in a field; takes the column's name and the field.
type Parse = fn(&str, &str) -> Result<f64, TableFault>;

impl Layout {
    /// Finds the meaning of `columns`; `known` lists the column names of this kind of table, for errors.
    ///
    /// # Errors
    /// A column that is unknown, ambiguous or duplicate; an incomplete position or quaternion; a position of which only
    /// some columns have a unit.
    pub fn of(columns: &[Column], known: &'static str) -> Result<Self, TableFault> {
        let mut found = Self::default();
        for (index, Column { name, meaning }) in columns.iter().enumerate() {
            if let Some(other) = columns[..index].iter().find(|other| is_same(other.meaning, *meaning)) {
                let other = if other.name == *name {
                    String::new()
                } else {
                    format!(": {} means the same", quote(&other.name))
                };
                return Err(TableFault::Twice { name: quote(name), other });
            }
            match *meaning {
                Meaning::Unknown => {
                    let suggestion = did_you_mean(name, SUGGESTED);
                    return Err(TableFault::Unknown { name: quote(name), suggestion, known });
                }
                Meaning::Ambiguous(reason) => return Err(refused(name, reason)),
                Meaning::Time { unit_s } => found.time = Some((index, name.clone(), unit_s)),
                Meaning::Name => found.name = Some(index),
                Meaning::Status => found.status = Some(index),
                Meaning::Event => found.event = Some(index),
                Meaning::Defined => found.defined = Some(index),
                Meaning::Length { .. } | Meaning::Quaternion(_) | Meaning::Unused => {}
            }
        }
        let own = position(columns, Frame::Own, known)?;
        let patient = position(columns, Frame::Patient, known).map_err(|fault| match (&fault, &own) {
            (TableFault::Missing { .. }, Some(own)) => stray(columns, own),
            _ => fault,
        })?;
        let tracker = position(columns, Frame::Tracker, known)?;
        if let (Some(own), Some(patient)) = (&own, &patient) {
            let reason = format!("the table has {}, too; give the points in one frame", quote(&own.axes[0].1));
            return Err(refused(&patient.axes[0].1, &reason));
        }
        (found.own, found.tracker) = (own.or(patient), tracker);
        found.quaternion = quaternion(columns, known)?;
        Ok(found)
    }

    /// Whether the column `defined` says that a row has no position.
    pub(crate) fn is_undefined(&self, row: &[String]) -> bool {
        let field = self.defined.and_then(|at| row.get(at)).map(|field| field.to_ascii_lowercase());
        field.is_some_and(|field| ["0", "false", "no", "undefined"].contains(&field.as_str()))
    }

    /// Name of a row; `None` if its field is empty or the table has no names.
    pub(crate) fn name<'a>(&self, row: &'a [String]) -> Option<&'a str> {
        self.name.and_then(|at| row.get(at)).map(String::as_str).filter(|name| !name.is_empty())
    }

    /// Whether the row has a pose, by its `status`; true without such a column.
    fn has_pose(&self, row: &[String]) -> Result<bool, TableFault> {
        match self.status.map_or("", |at| field(row, at)) {
            "" | "ok" | "OK" => Ok(true),
            "invalid" | "INVALID" => Ok(false),
            other => Err(TableFault::Status { found: quote(other) }),
        }
    }

    /// Pose of a row, mm; `None` if its `status` says so, or if all its numbers are empty, NaN or 0. Trackers write
    /// such rows while they don't see their tool.
    ///
    /// # Errors
    /// An unknown status, a field that is not a number, an incomplete pose, or numbers that are not a pose.
    pub fn pose(&self, position: &Position, row: &[String]) -> Result<Option<Pose>, TableFault> {
        if !self.has_pose(row)? {
            return Ok(None);
        }
        let axes = position.axes.iter().map(|(at, name, _)| (name, field(row, *at)));
        let turns = self.quaternion.iter().flatten().map(|(at, name)| (name, field(row, *at)));
        let fields: Vec<(&String, &str)> = axes.chain(turns).collect();
        if fields.iter().all(|(_, field)| is_absent(field)) {
            return Ok(None);
        }
        if let Some((name, field)) = fields.iter().find(|(_, field)| is_absent(field)) {
            return Err(TableFault::Part { column: (*name).clone(), found: quote(field) });
        }
        let [x, y, z] = position.coordinates(row, number)?.to_array();
        let mut numbers = [x, y, z, 1.0, 0.0, 0.0, 0.0];
        for (component, (at, name)) in numbers[3..].iter_mut().zip(self.quaternion.iter().flatten()) {
            *component = number(name, field(row, *at))?;
        }
        if numbers.iter().all(|number| *number == 0.0) {
            return Ok(None);
        }
        Ok(Some(Pose::from_components(numbers)?))
    }
}

impl Position {
    /// Point in a row, mm; in LPS if the columns are along the patient's axes.
    ///
    /// # Errors
    /// A field that is not a finite number.
    pub(crate) fn point(&self, row: &[String]) -> Result<DVec3, TableFault> {
        self.coordinates(row, finite)
    }

    /// Coordinates in a row, mm. `parse` takes a column's name and its field.
    fn coordinates(&self, row: &[String], parse: Parse) -> Result<DVec3, TableFault> {
        let mut point = DVec3::ZERO;
        for (axis, (at, name, unit_mm)) in self.axes.iter().enumerate() {
            point[axis] = unit_mm * parse(name, field(row, *at))?;
        }
        Ok(point)
    }

    /// Names of the position's columns, joined by commas.
    pub(crate) fn names(&self) -> String {
        self.axes.each_ref().map(|(_, name, _)| name.as_str()).join(",")
    }

    /// Each axis of LPS in terms of the table's columns, for example `x = −r, y = −a, z = s`.
    pub(crate) fn turned(&self) -> String {
        let each = self
            .axes
            .iter()
            .zip(["x", "y", "z"])
            .map(|((_, name, unit), axis)| format!("{axis} = {}{name}", if *unit < 0.0 { "−" } else { "" }));
        each.collect::<Vec<_>>().join(", ")
    }
}

fn field(row: &[String], at: usize) -> &str {
    row.get(at).map_or("", String::as_str)
}

/// Refuses columns that this kind of table doesn't have; `reason` completes the error.
///
/// # Errors
/// The first column whose meaning `which` accepts.
pub fn refuse(columns: &[Column], which: impl Fn(Meaning) -> bool, reason: &str) -> Result<(), TableFault> {
    columns.iter().find(|column| which(column.meaning)).map_or(Ok(()), |column| Err(refused(&column.name, reason)))
}

fn refused(name: &str, reason: &str) -> TableFault {
    TableFault::Refused { name: quote(name), reason: reason.to_owned() }
}

/// Fault of a column with the name of one patient axis in a table that lacks the other two axes. `own` is a complete
/// position.
fn stray(columns: &[Column], own: &Position) -> TableFault {
    let of_patient = columns.iter().find(|c| matches!(c.meaning, Meaning::Length { frame: Frame::Patient, .. }));
    let name = of_patient.map_or("", |column| column.name.as_str());
    let reason = format!(
        "it is an axis of the patient, as in r,a,s or l,p,s, but the table has {}, too, and not all three of them; name a row's number `id`, its name `name`, its time `time_s`",
        quote(&own.axes[0].1)
    );
    refused(name, &reason)
}

/// Whether a table cannot have both columns, because they have the same meaning.
fn is_same(a: Meaning, b: Meaning) -> bool {
    match (a, b) {
        (Meaning::Unused | Meaning::Unknown | Meaning::Ambiguous(_), _) => false,
        (Meaning::Length { frame, axis, .. }, Meaning::Length { frame: other, axis: its, .. }) => {
            (frame, axis) == (other, its)
        }
        (Meaning::Time { .. }, Meaning::Time { .. }) => true,
        (a, b) => a == b,
    }
}

/// The three columns of a position in the frame `wanted`; `None` if the table has none of them.
fn position(columns: &[Column], wanted: Frame, known: &'static str) -> Result<Option<Position>, TableFault> {
    let mut axes: [Option<(usize, String, f64)>; 3] = [None, None, None];
    let mut any_mm = false;
    let (mut with_unit, mut without_unit): (Option<String>, Option<String>) = (None, None);
    for (index, Column { name, meaning }) in columns.iter().enumerate() {
        if let Meaning::Length { frame, axis, sign, unit_mm } = *meaning
            && frame == wanted
        {
            any_mm |= unit_mm == Some(1.0);
            let first = if unit_mm.is_some() { &mut with_unit } else { &mut without_unit };
            first.get_or_insert_with(|| name.clone());
            axes[axis] = Some((index, name.clone(), sign * unit_mm.unwrap_or(1.0)));
        }
    }
    if axes.iter().all(Option::is_none) {
        return Ok(None);
    }
    let names = match wanted {
        Frame::Own => ["x", "y", "z"],
        Frame::Patient => ["l", "p", "s"],
        Frame::Tracker => ["tx", "ty", "tz"],
    };
    let unit = if any_mm { "_mm" } else { "" };
    let missing = |axis: usize| TableFault::Missing { name: format!("{}{unit}", names[axis]), known };
    let [x, y, z] = axes;
    let axes = [x.ok_or_else(|| missing(0))?, y.ok_or_else(|| missing(1))?, z.ok_or_else(|| missing(2))?];
    if let (Some(with), Some(without)) = (&with_unit, &without_unit) {
        let reason = format!("it has no unit, but {} has one; give each of the three its unit", quote(with));
        return Err(refused(without, &reason));
    }
    Ok(Some(Position { frame: wanted, axes, without_unit }))
}

/// The four columns of a quaternion; `None` if the table has none of them.
fn quaternion(columns: &[Column], known: &'static str) -> Result<Option<[(usize, String); 4]>, TableFault> {
    let of = |component| {
        let at = columns.iter().position(|column| column.meaning == Meaning::Quaternion(component))?;
        Some((at, columns[at].name.clone()))
    };
    let found = [0, 1, 2, 3].map(of);
    if found.iter().all(Option::is_none) {
        return Ok(None);
    }
    let missing = |component: usize| {
        let name = ["qw", "qx", "qy", "qz"][component].to_owned();
        TableFault::Missing { name, known }
    };
    let [w, x, y, z] = found;
    Ok(Some([
        w.ok_or_else(|| missing(0))?,
        x.ok_or_else(|| missing(1))?,
        y.ok_or_else(|| missing(2))?,
        z.ok_or_else(|| missing(3))?,
    ]))
}
