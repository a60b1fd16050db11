//! Classes of the segments of a label map, found in a class table.

use std::collections::BTreeMap;
use std::fmt;

use insonify_core::names::{counted, printable};

use super::{Class, ClassTable};
use crate::segmentation::measure::Measure;
use crate::segmentation::volume::{LabelMap, Segment};

/// A segment that has voxels, and its class.
#[derive(Debug, Clone, PartialEq)]
pub struct MappedSegment {
    /// Index of the segment in the label map.
    pub segment: usize,
    /// Index of the segment's layer in the label map.
    pub layer: usize,
    /// Label in that layer.
    pub value: u16,
    /// Name in the file; the class's name for segments without one.
    pub name: String,
    /// Colour in the file, sRGB.
    pub colour: Option<[u8; 3]>,
    /// Class of the segment.
    pub class: Class,
    /// Number of voxels.
    pub voxels: u64,
}

/// A segment that has voxels, but no class.
#[derive(Debug, Clone, PartialEq)]
pub struct Unmapped {
    /// Name in the file, if it has one.
    pub name: Option<String>,
    /// Index of the segment's layer in the label map.
    pub layer: usize,
    /// Label in that layer.
    pub value: u16,
    /// Number of voxels.
    pub voxels: u64,
    /// Names of known classes that are most similar to the segment's.
    pub nearest: Vec<String>,
}

impl fmt::Display for Unmapped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let voxels = counted(usize::try_from(self.voxels).unwrap_or(usize::MAX), "voxel");
        match &self.name {
            Some(name) => write!(f, "`{name}` (label {}, {voxels}) is no known class", self.value)?,
            None => write!(f, "label {} ({voxels}) has neither a name nor a class", self.value)?,
        }
        if self.nearest.is_empty() {
            return Ok(());
        }
        let names: Vec<String> = self.nearest.iter().map(|name| format!("`{name}`")).collect();
        write!(f, " (did you mean {}?)", names.join(", "))
    }
}

impl ClassTable {
    /// Segments with voxels, in the order of the map: a list of segments with a class, including ignored classes, and a
    /// list of segments without a class. `measures` are the measures of `map`.
    pub fn map(
        &self,
        map: &LabelMap,
        measures: &BTreeMap<(usize, u16), Measure>,
    ) -> (Vec<MappedSegment>, Vec<Unmapped>) {
        let (mut mapped, mut unmapped) = (Vec::new(), Vec::new());
        for (index, segment) in map.segments.iter().enumerate() {
            let &Segment { layer, value, colour, .. } = segment;
            let Some(&Measure { voxels, .. }) = measures.get(&(layer, value)) else { continue };
            if let Some(class) = self.class_of(segment) {
                let name = segment.name.as_deref().map_or(class.name.clone(), |name| printable(name).into_owned());
                mapped.push(MappedSegment { segment: index, layer, value, name, colour, class: class.clone(), voxels });
                continue;
            }
            let of_name = segment.name.as_deref().map(|name| self.nearest(name)).unwrap_or_default();
            let nearest = match (&segment.terminology, of_name.is_empty()) {
                (Some(terms), true) => self.nearest(terms),
                _ => of_name,
            };
            let name = segment.name.as_deref().map(|name| printable(name).into_owned());
            unmapped.push(Unmapped { name, layer, value, voxels, nearest });
        }
        (mapped, unmapped)
    }

    /// Class of a segment: by its name, else by its coded terms, else by its number. The number of a segment with a
    /// name counts only if a mapping such as `7=liver` names the number.
    pub fn class_of(&self, segment: &Segment) -> Option<&Class> {
        let by_text = |text: &Option<String>| text.as_deref().and_then(|text| self.named(text));
        let named = by_text(&segment.name).or_else(|| by_text(&segment.terminology));
        match &segment.name {
            Some(_) => named.or_else(|| self.numbered_by_user(segment.value)),
            None => named.or_else(|| self.numbered(segment.value)),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::super::Role;
    use super::*;
    use crate::segmentation::measure::measure;

    fn segment(value: u16, name: Option<&str>, terminology: Option<&str>) -> Segment {
        let owned = |text: Option<&str>| text.map(str::to_owned);
        Segment { layer: 0, value, name: owned(name), colour: Some([1, 2, 3]), terminology: owned(terminology) }
    }

    fn map(segments: Vec<Segment>, labels: Vec<u16>) -> LabelMap {
        let size = [labels.len(), 1, 1];
        LabelMap {
            path: "a.nii".into(),
            size,
            lps_from_voxel: DAffine3::IDENTITY,
            layers: vec![labels],
            segments,
            remarks: Vec::new(),
        }
    }

    /// Classes of the segments of a map.
    fn of_map(table: &ClassTable, map: &LabelMap) -> (Vec<MappedSegment>, Vec<Unmapped>) {
        table.map(map, &measure(map))
    }

    fn names(mapped: &[MappedSegment]) -> Vec<(&str, &str, u64)> {
        mapped.iter().map(|m| (m.name.as_str(), m.class.name.as_str(), m.voxels)).collect()
    }

    #[test]
    fn names_win_over_numbers_and_terms_over_nothing() {
        let table = ClassTable::builtin("total-v2").unwrap();
        let segments = vec![
            segment(1, Some("Right Kidney"), Some("Liver")),
            segment(2, Some("Segment_2"), Some("Kidney, Left")),
            segment(3, Some("Segment_3"), None),
            segment(5, None, None),
            segment(900, None, None),
            segment(6, Some("stomach"), None),
        ];
        let (mapped, unmapped) = of_map(&table, &map(segments, vec![0, 1, 1, 2, 3, 5, 5, 5, 900]));
        let expected = [("Right Kidney", "kidney_right", 2), ("Segment_2", "kidney_left", 1), ("liver", "liver", 3)];
        assert_eq!(names(&mapped), expected);
        assert_eq!((mapped[1].segment, mapped[1].colour), (1, Some([1, 2, 3])));
        let found: Vec<_> = unmapped.iter().map(|u| (u.name.as_deref(), u.value, u.voxels)).collect();
        assert_eq!(found, [(Some("Segment_3"), 3, 1), (None, 900, 1)]);
        assert_eq!(unmapped[1].to_string(), "label 900 (1 voxel) has neither a name nor a class");
    }

    #[test]
    fn unknown_names_come_with_the_nearest_known_ones() {
        let table = ClassTable::builtin("total-v2").unwrap();
        let (mapped, unmapped) = of_map(&table, &map(vec![segment(4, Some("spleeen"), None)], vec![4; 1200]));
        assert_eq!(mapped, []);
        let says = unmapped[0].to_string();
        assert!(
            says.starts_with("`spleeen` (label 4, 1,200 voxels) is no known class (did you mean `spleen`"),
            "{says}"
        );
    }

    #[test]
    fn mappings_reach_names_and_numbers() {
        let mut table = ClassTable::builtin("total-v2").unwrap();
        for mapping in ["Segment_3=spleen", "4=vessel_wall", "liver=ignore", "5 = Left Kidney"] {
            table.add(mapping).unwrap();
        }
        let segments = vec![
            segment(3, Some("segment 3"), None),
            segment(4, Some("Segment_4"), None),
            segment(1, Some("liver"), None),
            segment(5, None, None),
        ];
        let (mapped, unmapped) = of_map(&table, &map(segments, vec![1, 3, 4, 5]));
        assert_eq!(unmapped, []);
        let found: Vec<_> = mapped.iter().map(|m| (m.class.name.as_str(), m.class.tissue.as_deref())).collect();
        let tissue = Some;
        let expected = [
            ("Segment_3", tissue("spleen")),
            ("vessel_wall", tissue("vessel_wall")),
            ("liver", None),
            ("kidney_left", tissue("renal_cortex")),
        ];
        assert_eq!(found, expected);
        assert_eq!(mapped[2].class.role, Role::Ignore);
    }
}
