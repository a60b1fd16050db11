//! Mapping from the axes of a SpaceMouse puck to the probe's axes.

use std::fmt;
use std::str::FromStr;

use glam::DVec3;
use insonify_core::pose::Reading;
use thiserror::Error;

use super::Record;

const NAMES: [&str; 6] = ["x", "y", "z", "rx", "ry", "rz"];

/// Source axis and sign of each output axis x, y, z, rx, ry, rz, for example `x, -z, y, rx, -rz, ry`. Translations map
/// to translations and rotations to rotations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisMap {
    /// Index of the device axis (0..6) and ±1.
    axes: [(usize, f64); 6],
}

/// A text that is not an axis map.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error(
    "`{text}` is no axis map: expected three of x, y, z, then three of rx, ry, rz, each once, with a `-` to reverse its sign"
)]
pub struct AxisMapError {
    /// Text given.
    pub text: String,
}

impl Default for AxisMap {
    /// The axes of the device, unchanged.
    fn default() -> Self {
        Self { axes: [(0, 1.0), (1, 1.0), (2, 1.0), (3, 1.0), (4, 1.0), (5, 1.0)] }
    }
}

impl AxisMap {
    /// The record with its rates on the mapped axes. Records of other kinds are returned unchanged.
    pub fn apply(&self, mut record: Record) -> Record {
        if let Reading::Rates { translation, rotation } = &mut record.reading {
            let [x, y, z] = translation.to_array();
            let [rx, ry, rz] = rotation.to_array();
            let device = [x, y, z, rx, ry, rz];
            let axis = |i: usize| device[self.axes[i].0] * self.axes[i].1;
            *translation = DVec3::new(axis(0), axis(1), axis(2));
            *rotation = DVec3::new(axis(3), axis(4), axis(5));
        }
        record
    }
}

impl FromStr for AxisMap {
    type Err = AxisMapError;

    fn from_str(text: &str) -> Result<Self, AxisMapError> {
        let error = || AxisMapError { text: text.to_owned() };
        let mut axes = [(0, 0.0); 6];
        let mut used = [false; 6];
        let mut words = text.split(',').map(str::trim);
        for (i, axis) in axes.iter_mut().enumerate() {
            let word = words.next().ok_or_else(error)?;
            let (name, sign) = word.strip_prefix('-').map_or((word, 1.0), |name| (name, -1.0));
            let from = NAMES.iter().position(|n| *n == name.trim()).ok_or_else(error)?;
            // A translation mapped to a rotation, or an axis used twice, is a mistake.
            if from / 3 != i / 3 || std::mem::replace(&mut used[from], true) {
                return Err(error());
            }
            *axis = (from, sign);
        }
        if words.next().is_some() { Err(error()) } else { Ok(Self { axes }) }
    }
}

impl fmt::Display for AxisMap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, (from, sign)) in self.axes.iter().enumerate() {
            let comma = if i == 0 { "" } else { ", " };
            write!(f, "{comma}{}{}", if *sign < 0.0 { "-" } else { "" }, NAMES[*from])?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_moved_and_signs_reversed() {
        let map: AxisMap = "x, -z, y, rx, -rz,ry".parse().unwrap();
        let rates = |translation, rotation| Record::new(0, Reading::Rates { translation, rotation });
        let found = map.apply(rates(DVec3::new(0.1, 0.2, 0.3), DVec3::new(0.4, 0.5, 0.6)));
        assert_eq!(found, rates(DVec3::new(0.1, -0.3, 0.2), DVec3::new(0.4, -0.6, 0.5)));
        assert_eq!(map.to_string().parse(), Ok(map));
        assert_eq!(AxisMap::default().to_string(), "x, y, z, rx, ry, rz");
    }

    #[test]
    fn texts_that_are_no_map_are_refused() {
        for text in ["", "x,y,z", "x,x,z,rx,ry,rz", "rx,y,z,x,ry,rz", "x,y,z,rx,ry,rz,x", "x,y,w,rx,ry,rz"] {
            assert!(text.parse::<AxisMap>().is_err(), "{text}");
        }
    }
}
