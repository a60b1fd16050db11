//! What a file says about its axes and its unit.

use super::frame::{MeshAxes, Unit};

/// Axes and unit as a file states them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FileHints {
    /// Axes, if the file names them.
    pub axes: Option<MeshAxes>,
    /// Unit, if the file names it.
    pub unit: Option<Unit>,
    /// Text of the file that says so.
    pub said: Option<String>,
    /// Whether axes and unit are those of the format, which not every program keeps to; sizes and places of organs count
    /// more.
    pub of_format: bool,
}

/// Words that introduce a unit.
const UNIT_KEYS: [&str; 4] = ["file units", "units", "unit", "length unit"];

impl FileHints {
    /// Reads axes and unit from a comment, a header or a field; the first statement counts.
    pub(super) fn take(&mut self, text: &str) {
        let upper = text.to_uppercase();
        let axes = [("SPACE=LPS", MeshAxes::Lps), ("SPACE=RAS", MeshAxes::Ras)];
        let axes = axes.into_iter().find(|(word, _)| upper.contains(word)).map(|(_, axes)| axes);
        let unit = unit_of(text);
        if axes.is_none() && unit.is_none() {
            return;
        }
        self.axes = self.axes.or(axes);
        self.unit = self.unit.or(unit);
        self.said
            .get_or_insert_with(|| text.trim_matches(|c: char| c == '#' || c.is_whitespace() || c == '\0').to_owned());
    }
}

/// Unit that a text such as `File units = centimeters` names.
fn unit_of(text: &str) -> Option<Unit> {
    let lower = text.to_lowercase();
    let after = UNIT_KEYS.iter().find_map(|key| {
        let rest = &lower[lower.find(key)? + key.len()..];
        rest.trim_start().strip_prefix([':', '='])
    })?;
    match after.split(|c: char| !c.is_alphabetic()).find(|word| !word.is_empty())? {
        "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" => Some(Unit::Mm),
        "cm" | "centimeter" | "centimeters" | "centimetre" | "centimetres" => Some(Unit::Cm),
        "m" | "meter" | "meters" | "metre" | "metres" => Some(Unit::M),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_of_slicer_and_comments_of_units_are_understood() {
        let mut hints = FileHints::default();
        hints.take("exported by a tool");
        assert_eq!(hints, FileHints::default());
        hints.take("3D Slicer output. SPACE=LPS");
        hints.take("# File units = centimeters");
        assert_eq!((hints.axes, hints.unit), (Some(MeshAxes::Lps), Some(Unit::Cm)));
        assert_eq!(hints.said.as_deref(), Some("3D Slicer output. SPACE=LPS"));
        assert_eq!(unit_of("Units: mm"), Some(Unit::Mm));
        assert_eq!(unit_of("units: furlongs"), None);
    }
}
