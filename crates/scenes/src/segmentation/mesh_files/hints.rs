//! Statements of a file about its axes and its unit.

use super::frame::{MeshAxes, Unit};

/// Axes and unit that a file states.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FileHints {
    /// Axes, if the file names them.
    pub axes: Option<MeshAxes>,
    /// Unit, if the file names it.
    pub unit: Option<Unit>,
    /// Text of the file that states the axes or the unit.
    pub said: Option<String>,
    /// Clause for a message if the file's statements about the axes contradict each other or are not understood.
    pub unclear_axes: Option<String>,
    /// Clause for a message if the file's statements about the unit contradict each other or are not understood.
    pub unclear_unit: Option<String>,
    /// Whether axes and unit are only the defaults of the file's format. Some programs ignore the defaults, so sizes
    /// and positions of organs are stronger evidence.
    pub of_format: bool,
}

/// Words that introduce a unit.
const UNIT_KEYS: [&str; 4] = ["file units", "units", "unit", "length unit"];

/// Statement of a file: a value, or text that is not understood.
enum Stated<T> {
    Known(T),
    /// Text that is not understood.
    Unknown(String),
}

impl FileHints {
    /// Takes statements on axes and unit from the text of a comment, a header or a field.
    pub(super) fn take(&mut self, text: &str) {
        let said = text.trim_matches(|c: char| c == '#' || c.is_whitespace() || c == '\0');
        let (axes, unit) = (axes_of(text), unit_of(text));
        if axes.is_none() && unit.is_none() {
            return;
        }
        let contradicted = || format!("the file says `{}` and `{said}`", self.said.as_deref().unwrap_or_default());
        match axes {
            Some(Stated::Known(axes)) if self.axes.is_some_and(|known| known != axes) => {
                self.unclear_axes = Some(contradicted());
            }
            Some(Stated::Known(axes)) => self.axes = Some(axes),
            Some(Stated::Unknown(space)) => {
                self.unclear_axes = Some(format!("the file says `{space}`, which is not read"))
            }
            None => {}
        }
        match unit {
            Some(Stated::Known(unit)) if self.unit.is_some_and(|known| known != unit) => {
                self.unclear_unit = Some(contradicted());
            }
            Some(Stated::Known(unit)) => self.unit = Some(unit),
            Some(Stated::Unknown(unit)) => {
                self.unclear_unit = Some(format!("the file says `{said}`, and the unit `{unit}` is not read"));
            }
            None => {}
        }
        match &mut self.said {
            None => self.said = Some(said.to_owned()),
            Some(all) if !all.contains(said) => *all = format!("{all}; {said}"),
            Some(_) => {}
        }
    }
}

/// Axes that a text such as `3D Slicer output. SPACE=LPS` names.
fn axes_of(text: &str) -> Option<Stated<MeshAxes>> {
    let upper = text.to_uppercase();
    let after = upper.split("SPACE=").nth(1)?;
    let letters: String = after.chars().take_while(|c| c.is_alphanumeric()).collect();
    match letters.as_str() {
        "LPS" => Some(Stated::Known(MeshAxes::Lps)),
        "RAS" => Some(Stated::Known(MeshAxes::Ras)),
        // Another orientation, written as in NRRD: a letter from each of the pairs R/L, A/P and S/I.
        _ => {
            let pairs =
                ["LR", "PA", "SI"].iter().all(|pair| letters.chars().filter(|c| pair.contains(*c)).count() == 1);
            (pairs && letters.len() == 3).then(|| Stated::Unknown(format!("SPACE={letters}")))
        }
    }
}

/// Unit that a text such as `File units = centimeters` or `UNIT (mm)` names.
fn unit_of(text: &str) -> Option<Stated<Unit>> {
    let lower = text.to_lowercase();
    let after = UNIT_KEYS.iter().find_map(|key| Some(&lower[lower.find(key)? + key.len()..]))?;
    let is_stated = after.trim_start().starts_with([':', '=']);
    if !is_stated && !after.starts_with([' ', '\t', '(', '[']) {
        return None;
    }
    let word = after.split(|c: char| !c.is_alphabetic()).find(|word| !word.is_empty())?;
    match word {
        // Short units that are also ordinary words count only after `:` or `=`.
        "in" | "m" | "ft" if !is_stated => None,
        "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" => Some(Stated::Known(Unit::Mm)),
        "cm" | "centimeter" | "centimeters" | "centimetre" | "centimetres" => Some(Stated::Known(Unit::Cm)),
        "m" | "meter" | "meters" | "metre" | "metres" => Some(Stated::Known(Unit::M)),
        "in" | "inch" | "inches" => Some(Stated::Known(Unit::In)),
        "ft" | "foot" | "feet" | "yard" | "yards" | "dm" | "um" | "µm" | "μm" | "micron" | "microns" | "micrometer"
        | "micrometers" | "micrometre" | "micrometres" | "nm" | "km" => Some(Stated::Unknown(word.to_owned())),
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
        assert_eq!(hints.said.as_deref(), Some("3D Slicer output. SPACE=LPS; File units = centimeters"));
        assert_eq!((hints.unclear_axes, hints.unclear_unit), (None, None));
    }

    #[test]
    fn units_are_read_where_they_are_stated() {
        let unit = |text: &str| {
            let mut hints = FileHints::default();
            hints.take(text);
            (hints.unit, hints.unclear_unit.is_some())
        };
        for (text, expected) in [
            ("Units: mm", Some(Unit::Mm)),
            ("UNITS=mm", Some(Unit::Mm)),
            ("<model unit=\"inch\">", Some(Unit::In)),
            ("units = in", Some(Unit::In)),
            ("Unit (cm)", Some(Unit::Cm)),
            ("units mm", Some(Unit::Mm)),
            ("units: furlongs", None),
            ("the units in this file are mm", None),
            ("unit cube", None),
        ] {
            assert_eq!(unit(text), (expected, false), "{text}");
        }
        assert_eq!(unit("units: microns"), (None, true));
    }

    #[test]
    fn statements_that_contradict_each_other_are_unclear() {
        let both = |first: &str, second: &str| {
            let mut hints = FileHints::default();
            hints.take(first);
            hints.take(second);
            hints.unclear_axes.or(hints.unclear_unit)
        };
        assert_eq!(both("units: mm", "Units = cm").as_deref(), Some("the file says `units: mm` and `Units = cm`"));
        assert!(both("SPACE=LPS", "SPACE=RAS").is_some());
        assert_eq!(both("SPACE=LPS", "SPACE=LPS"), None);
        assert_eq!(both("SPACE=LAS", "").as_deref(), Some("the file says `SPACE=LAS`, which is not read"));
        assert_eq!(both("SPACE=LABEL", ""), None);
    }
}
