//! Points and poses as lines of comma-separated numbers.
//!
//! Empty lines, lines that begin with `#` and a first line of column names are skipped. Errors name the line.

use glam::DVec3;
use thiserror::Error;

use super::registration::PointPair;
use super::{Pose, PoseError};

/// Errors in point and pose lists.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum CsvError {
    /// A malformed line.
    #[error("line {line}: expected {expected}, found `{found}`")]
    Line {
        /// Line, from 1.
        line: usize,
        /// Expected content.
        expected: &'static str,
        /// The line's first 80 characters.
        found: String,
    },
    /// Numbers that are not a pose.
    #[error("line {line}: {source}")]
    Pose {
        /// Line, from 1.
        line: usize,
        /// Fault of the pose.
        source: PoseError,
    },
    /// No line contains numbers.
    #[error("there is no line with {expected}")]
    Empty {
        /// Expected content.
        expected: &'static str,
    },
}

/// A value with a name.
#[derive(Debug, Clone, PartialEq)]
pub struct Named<T> {
    /// Name, or the number from 1.
    pub name: String,
    /// The value.
    pub value: T,
}

const POINT: &str = "`x,y,z` and perhaps `,name` (mm)";
const PAIR: &str = "`x,y,z,tx,ty,tz` and perhaps `,name` (mm; first the scene's point, then the tracker's)";
const POSE: &str = "`x,y,z,qw,qx,qy,qz` (mm and a unit quaternion)";

/// Parses points from lines `x,y,z[,name]`, mm.
///
/// # Errors
/// A malformed line, or no point at all.
pub fn points(text: &str) -> Result<Vec<Named<DVec3>>, CsvError> {
    named(text, POINT, DVec3::from_array)
}

/// Parses landmarks from lines `x,y,z,tx,ty,tz[,name]`: the point in the scene, and as the tracker measures it, mm.
///
/// # Errors
/// A malformed line, or no pair at all.
pub fn pairs(text: &str) -> Result<Vec<Named<PointPair>>, CsvError> {
    named(text, PAIR, |[x, y, z, tx, ty, tz]: [f64; 6]| PointPair {
        scene_mm: DVec3::new(x, y, z),
        tracker_mm: DVec3::new(tx, ty, tz),
    })
}

/// Parses poses from lines `x,y,z,qw,qx,qy,qz`, mm and a unit quaternion.
///
/// # Errors
/// A malformed line, or no pose at all.
pub fn poses(text: &str) -> Result<Vec<Pose>, CsvError> {
    parsed(text, POSE, |line, content| match content.parse::<Pose>() {
        Err(PoseError::Syntax { .. }) => Ok(None),
        Err(source) => Err(CsvError::Pose { line, source }),
        Ok(pose) => Ok(Some(pose)),
    })
}

/// Parses values of `N` numbers each, with their optional names.
fn named<const N: usize, T>(
    text: &str,
    expected: &'static str,
    value: impl Fn([f64; N]) -> T,
) -> Result<Vec<Named<T>>, CsvError> {
    let mut number = 0;
    parsed(text, expected, |_, content| {
        number += 1;
        let fields: Vec<_> = content.splitn(N + 1, ',').map(str::trim).collect();
        let Some((numbers, name)) = fields.split_at_checked(N) else { return Ok(None) };
        let numbers: Option<Vec<f64>> = numbers.iter().map(|field| field.parse().ok()).collect();
        let name = name.first().map(|n| n.trim_matches('"').trim()).filter(|n| !n.is_empty());
        let name = name.map_or_else(|| number.to_string(), str::to_owned);
        Ok(numbers.and_then(|n| n.try_into().ok()).map(|numbers| Named { name, value: value(numbers) }))
    })
}

/// Calls `parse` with the number and content of each data line; `None` from it means a malformed line.
fn parsed<T>(
    text: &str,
    expected: &'static str,
    mut parse: impl FnMut(usize, &str) -> Result<Option<T>, CsvError>,
) -> Result<Vec<T>, CsvError> {
    let malformed = |line, content: &str| CsvError::Line { line, expected, found: content.chars().take(80).collect() };
    let values: Result<Vec<T>, _> =
        data_lines(text).map(|(line, content)| parse(line, content)?.ok_or_else(|| malformed(line, content))).collect();
    values.and_then(|values| if values.is_empty() { Err(CsvError::Empty { expected }) } else { Ok(values) })
}

/// Data lines with their numbers from 1.
fn data_lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let lines = text.lines().enumerate().map(|(i, line)| (i + 1, line.trim()));
    let mut is_first = true;
    lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#')).filter(move |(_, line)| {
        let is_head =
            std::mem::take(&mut is_first) && line.split(',').all(|field| field.trim().parse::<f64>().is_err());
        !is_head
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn pairs_have_names_or_numbers() {
        let text = "\u{feff}x,y,z,tx,ty,tz,name\r\n# belly\r\n1,2,3,4,5,6,\"navel\"\r\n\r\n-1.5, 2e1, 3,4,5,6\r\n7,8,9,1,2,3,left, upper\r\n";
        let found = pairs(text).unwrap();
        let names: Vec<_> = found.iter().map(|p| p.name.as_str()).collect();
        assert_eq!(names, ["navel", "2", "left, upper"]);
        assert_eq!(found[1].value.scene_mm, DVec3::new(-1.5, 20.0, 3.0));
        assert_eq!(found[0].value.tracker_mm, DVec3::new(4.0, 5.0, 6.0));
    }

    #[test]
    fn malformed_lines_are_named() {
        let error = |text| pairs(text).unwrap_err().to_string();
        assert_eq!(error("1,2,3,4,5,6\n1,2,3\n"), format!("line 2: expected {PAIR}, found `1,2,3`"));
        assert!(error("1,2,3,4,5,six").starts_with("line 1: expected `x,y,z,tx,ty,tz`"));
        assert!(error("x,y\nx,y\n").starts_with("line 2"), "one line of names only");
        assert!(error("# nothing\n\n").starts_with("there is no line with `x,y,z,tx,ty,tz`"));
        let error = |text| poses(text).unwrap_err().to_string();
        assert!(error("x,y,z,qw,qx,qy,qz\n1,2,3,2,0,0,0").starts_with("line 2: the pose's quaternion"));
        assert!(error("1,2,3").starts_with("line 1: expected `x,y,z,qw,qx,qy,qz`"));
        assert!(error("nan,2,3,1,0,0,0").contains("component `x` is NaN"));
        assert_eq!(poses("1,2,3,1,0,0,0\n").unwrap()[0].position_mm, DVec3::new(1.0, 2.0, 3.0));
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn no_text_panics(text in "([0-9.,-]{0,20}|\n|,|name|#|é|\"|nan|inf| ){0,30}") {
            let _ = (pairs(&text), poses(&text));
        }
    }
}
