//! Check for mappings by the user that match nothing.

use std::path::Path;

use insonify_core::names::{listed, printable};
use insonify_core::suggest::did_you_mean;

use super::key::key;
use super::{ClassError, ClassTable, OrganInName, common_words, organ_in_name};
use crate::segmentation::volume::LabelMap;

/// Most names in a message.
const LISTED_MAX: usize = 8;

/// Segments of a map and names of files, to which mappings may refer.
#[derive(Debug, Clone, Copy)]
pub struct Mappable<'a> {
    /// Path of the file or folder, for messages.
    pub path: &'a Path,
    /// Label map with the segments.
    pub labels: &'a LabelMap,
    /// Names of mask files without their suffixes.
    pub stems: &'a [String],
    /// Whether the file itself states the label numbers. In a folder of masks, the reader assigns them.
    pub has_numbers: bool,
}

/// Refuses the first mapping `NAME=TARGET` whose name or number occurs nowhere. `table` has no mappings yet.
///
/// # Errors
/// A mapping of a name or number that belongs to no segment and no file, and is no target of another mapping.
pub fn check_mappings(maps: &[String], table: &ClassTable, of: &Mappable<'_>) -> Result<(), ClassError> {
    let sides = |map: &String| map.rsplit_once('=').map(|(name, target)| (name.trim().to_owned(), key(target)));
    let all: Vec<(String, String)> = maps.iter().filter_map(sides).collect();
    let unused = |(name, _): &&(String, String)| {
        let is_target = all.iter().any(|(other, target)| other != name && *target == key(name));
        !is_target && !of.has(name, table)
    };
    let Some((name, _)) = all.iter().find(unused) else { return Ok(()) };
    let known = of.known();
    let nearest = did_you_mean(name, known.iter().map(String::as_str));
    Err(ClassError::Unused {
        name: printable(name).into_owned(),
        path: of.path.to_owned(),
        nearest,
        known: listed(&known, LISTED_MAX, ", "),
    })
}

impl Mappable<'_> {
    fn has(&self, name: &str, table: &ClassTable) -> bool {
        let wanted = key(name);
        let is_wanted = |text: &Option<String>| text.as_deref().is_some_and(|text| key(text) == wanted);
        let segments = &self.labels.segments;
        if let Ok(value) = name.parse::<u16>()
            && self.has_numbers
            && segments.iter().any(|segment| segment.value == value)
        {
            return true;
        }
        if segments.iter().any(|segment| is_wanted(&segment.name) || is_wanted(&segment.terminology)) {
            return true;
        }
        // The name may be a part of a file's name, such as words that all files share.
        let within = |stem: &String| {
            let words = key(stem);
            wanted.split(' ').all(|word| words.split(' ').any(|other| other == word))
        };
        if self.stems.iter().any(within) {
            return true;
        }
        // The name may be an alias of a class that occurs under another name.
        let Some(class) = table.named(name) else { return false };
        let common = common_words(self.stems);
        let is_called = |stem: &String| match organ_in_name(stem, table, Some(&common)) {
            OrganInName::Is(organ) => organ == class.name,
            _ => false,
        };
        segments.iter().any(|segment| table.class_of(segment).is_some_and(|other| other.name == class.name))
            || self.stems.iter().any(is_called)
    }

    /// Names of the segments, or their numbers, and names of the files; each once.
    fn known(&self) -> Vec<String> {
        let segments = self.labels.segments.iter().map(|segment| match segment.name.as_ref() {
            Some(name) => printable(name).into_owned(),
            None => segment.value.to_string(),
        });
        let mut known: Vec<String> = Vec::new();
        for name in segments.chain(self.stems.iter().map(|stem| printable(stem).into_owned())) {
            if !known.contains(&name) {
                known.push(name);
            }
        }
        known
    }
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;
    use crate::segmentation::volume::Segment;

    fn checked(maps: &[&str], names: &[Option<&str>], stems: &[&str]) -> Result<(), String> {
        let segment = |(value, name): (u16, &Option<&str>)| Segment {
            layer: 0,
            value,
            name: name.map(str::to_owned),
            colour: None,
            terminology: None,
        };
        let labels = LabelMap {
            path: "a.nii".into(),
            size: [1; 3],
            lps_from_voxel: DAffine3::IDENTITY,
            layers: Vec::new(),
            segments: (1..).zip(names).map(segment).collect(),
            remarks: Vec::new(),
        };
        let [maps, stems] = [maps, stems].map(|all| all.iter().map(|text| (*text).to_owned()).collect::<Vec<String>>());
        let of = Mappable { path: &labels.path, labels: &labels, stems: &stems, has_numbers: stems.is_empty() };
        check_mappings(&maps, &ClassTable::builtin("total-v2").unwrap(), &of).map_err(|error| error.to_string())
    }

    #[test]
    fn mappings_of_names_numbers_and_files_that_are_there_are_taken() {
        let numbers = [None; 5];
        assert_eq!(checked(&["1=liver", "5=ignore"], &numbers, &[]), Ok(()));
        // The mappings name the classes of the numbers, by name or alias.
        assert_eq!(checked(&["liver=ignore", "Right Kidney=muscle"], &numbers, &[]), Ok(()));
        assert_eq!(checked(&["segment 1=liver"], &[Some("Segment_1")], &[]), Ok(()));
        assert_eq!(checked(&["mine=spleen", "Segment_1=mine"], &[Some("Segment_1")], &[]), Ok(()));
        let files = ["smith_spleeen", "smith_liver"];
        assert_eq!(checked(&["spleeen=spleen", "smith_liver=ignore"], &[Some("spleen")], &files), Ok(()));
    }

    #[test]
    fn mappings_that_match_nothing_are_refused_with_what_is_there() {
        let error = checked(&["1=liver", "999=spleen"], &[None, None], &[]).unwrap_err();
        assert_eq!(error, "--map: a.nii has no `999`; it has 1, 2");
        let error = checked(&["hepar=liver"], &[Some("Hepar_1"), Some("spleen")], &[]).unwrap_err();
        assert!(error.contains("a.nii has no `hepar` (did you mean `Hepar_1`?); it has Hepar_1, spleen"), "{error}");
        let error = checked(&["1=liver"], &[Some("spleen")], &["spleen", "live"]).unwrap_err();
        assert!(error.contains("has no `1`; it has spleen, live"), "{error}");
    }
}
