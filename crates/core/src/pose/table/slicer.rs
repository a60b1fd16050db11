//! Markups of 3D Slicer: coordinate systems, and `.mrk.json` files.

use glam::DVec3;
use serde::Deserialize;

use super::split::looks_numeric;
use super::{TableFault, quote};

/// Types of markups whose control points mark points of the body.
const TYPES: [&str; 5] = ["Fiducial", "Line", "Angle", "Curve", "ClosedCurve"];

/// Columns of a list (.fcsv). 3D Slicer reads and writes them in this order, whatever its line `# columns` says.
pub(super) const COLUMNS: [&str; 14] =
    ["id", "x", "y", "z", "ow", "ox", "oy", "oz", "vis", "sel", "lock", "label", "desc", "associatedNodeID"];

/// Whether `fields` are the two that 3D Slicer 5 appends after the named columns of a list. The first is the status of
/// the position (0 undefined, 1 shown before it is placed, 2 defined, 3 missing), the second a number.
pub(super) fn is_status(fields: &[String]) -> bool {
    let [status, number] = fields else { return false };
    ["0", "1", "2", "3"].contains(&status.as_str()) && looks_numeric(number)
}

/// Coordinate system of markups.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum System {
    /// x left, y posterior, z superior.
    Lps,
    /// x right, y anterior, z superior.
    Ras,
}

impl System {
    /// Coordinate system with the name or number `text`; `None` if unknown.
    pub(super) fn of(text: &str) -> Option<Self> {
        match text.to_ascii_uppercase().as_str() {
            "LPS" | "1" => Some(Self::Lps),
            "RAS" | "0" => Some(Self::Ras),
            _ => None,
        }
    }

    /// Name of the coordinate system.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Lps => "LPS",
            Self::Ras => "RAS",
        }
    }

    /// `point`, given in this coordinate system, in LPS.
    pub(crate) fn to_lps(self, point: DVec3) -> DVec3 {
        match self {
            Self::Lps => point,
            Self::Ras => DVec3::new(-point.x, -point.y, point.z),
        }
    }
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct File {
    markups: Vec<Markup>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Markup {
    #[serde(default, rename = "type")]
    kind: String,
    coordinate_system: Option<String>,
    #[serde(default)]
    coordinate_units: Units,
    #[serde(default)]
    control_points: Vec<ControlPoint>,
}

#[derive(Deserialize, Default)]
#[serde(untagged)]
enum Units {
    #[default]
    None,
    One(String),
    Each(Vec<String>),
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct ControlPoint {
    #[serde(default)]
    label: String,
    position: Option<[f64; 3]>,
    position_status: Option<String>,
}

/// A control point: its name and its position in LPS, mm; `None` if it has no position.
pub(crate) type Control = (String, Option<DVec3>);

/// Control points in the text of a `.mrk.json` file.
///
/// # Errors
/// Text that is not a markups file, several lists, markups that do not mark points of the body, another unit or
/// coordinate system, or a position that is not finite.
pub(crate) fn markups(text: &str) -> Result<Vec<Control>, String> {
    let File { markups } = serde_json::from_str(text)
        .map_err(|error| format!("it is no markups file of 3D Slicer (.mrk.json) and no table: {error}"))?;
    let mut filled = markups.into_iter().filter(|markup| !markup.control_points.is_empty());
    let markup = filled.next().ok_or("it holds no control point")?;
    if let Some(other) = filled.next() {
        let count = 2 + filled.count();
        let (first, second) = (markup.kind, other.kind);
        return Err(format!("it holds {count} markups ({first}, {second}); save the list of points alone"));
    }
    if !TYPES.contains(&markup.kind.as_str()) {
        let (kind, types) = (quote(&markup.kind), TYPES.join(", "));
        return Err(format!("it holds markups of type {kind}; points are read from {types}"));
    }
    let unit = match markup.coordinate_units {
        Units::None => "mm".to_owned(),
        Units::One(unit) => unit,
        Units::Each(units) if units.windows(2).all(|pair| pair[0] == pair[1]) => {
            units.into_iter().next().unwrap_or_default()
        }
        Units::Each(units) => units.join(", "),
    };
    let unit_mm = match unit.as_str() {
        "mm" => 1.0,
        "cm" => 10.0,
        "m" => 1000.0,
        "um" | "µm" => 1e-3,
        other => return Err(format!("its `coordinateUnits` are {}; mm, cm, m and um are read", quote(other))),
    };
    // By their schema, files without this key are in LPS.
    let name = markup.coordinate_system.as_deref().unwrap_or("LPS");
    let system = System::of(name).ok_or_else(|| TableFault::System { found: quote(name) }.to_string())?;
    let point = |(index, point): (usize, ControlPoint)| {
        let name = if point.label.trim().is_empty() { (index + 1).to_string() } else { point.label.trim().to_owned() };
        let is_there = point.position_status.as_deref().is_none_or(|status| status == "defined");
        let position = point.position.filter(|_| is_there).map(|p| unit_mm * system.to_lps(DVec3::from_array(p)));
        match position.filter(|p| !p.is_finite()) {
            Some(_) => Err(format!("the position of {} is not finite", quote(&name))),
            None => Ok((name, position)),
        }
    };
    markup.control_points.into_iter().enumerate().map(point).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(head: &str, points: &str) -> String {
        format!(
            "{{\"@schema\": \"s\", \"markups\": [{{\"type\": \"Fiducial\", {head} \"controlPoints\": [{points}]}}]}}"
        )
    }

    const POINTS: &str = "{\"id\": \"1\", \"label\": \"XIPHOID\", \"position\": [10.5, -98.25, 3.5], \"positionStatus\": \"defined\"}, \
         {\"label\": \"\", \"position\": [1, 2, 3]}, {\"label\": \"later\", \"position\": [0, 0, 0], \"positionStatus\": \"undefined\"}";

    #[test]
    fn control_points_are_read_in_lps() {
        let lps = markups(&file("\"coordinateSystem\": \"LPS\", \"coordinateUnits\": \"mm\",", POINTS)).unwrap();
        let xiphoid = ("XIPHOID".to_owned(), Some(DVec3::new(10.5, -98.25, 3.5)));
        assert_eq!(
            lps,
            [xiphoid.clone(), ("2".to_owned(), Some(DVec3::new(1.0, 2.0, 3.0))), ("later".to_owned(), None)]
        );
        let ras = markups(&file("\"coordinateSystem\": \"RAS\",", POINTS)).unwrap();
        assert_eq!(ras[0].1, Some(DVec3::new(-10.5, 98.25, 3.5)));
        assert_eq!(markups(&file("", POINTS)).unwrap()[0], xiphoid);
        let metres = markups(&file("\"coordinateUnits\": [\"m\", \"m\", \"m\"],", POINTS)).unwrap();
        assert_eq!(metres[0].1, Some(DVec3::new(10500.0, -98250.0, 3500.0)));
    }

    #[test]
    fn other_files_are_refused_with_the_reason() {
        let refused = |text: &str| markups(text).unwrap_err();
        assert!(refused("{}").contains("no markups file of 3D Slicer"));
        assert!(refused("{\"markups\": []}").contains("no control point"));
        assert!(refused(&file("\"coordinateSystem\": \"IJK\",", POINTS)).contains("coordinate system is `IJK`"));
        assert!(refused(&file("\"coordinateUnits\": \"pixel\",", POINTS)).contains("`coordinateUnits` are `pixel`"));
        assert!(refused(&file("", POINTS).replace("Fiducial", "ROI")).contains("of type `ROI`"));
        let one = file("", POINTS);
        let list = one.split_once("[").unwrap().1.strip_suffix("]}").unwrap();
        assert!(refused(&format!("{{\"markups\": [{list}, {list}]}}")).contains("2 markups"));
    }
}
