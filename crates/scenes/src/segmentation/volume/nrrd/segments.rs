//! Segments of 3D Slicer's `.seg.nrrd` files, from the header's pairs `SegmentN_…`.

use std::collections::BTreeMap;

use super::super::label_names::LabelNames;
use super::super::nifti::byte;
use super::super::{Segment, VolumeFault};

/// Values of one segment's keys.
#[derive(Debug, Default)]
struct Keys {
    value: Option<u16>,
    layer: Option<usize>,
    name: Option<String>,
    colour: Option<[u8; 3]>,
    terminology: Option<String>,
}

impl Keys {
    /// Segment number `number` of the file. Early versions of 3D Slicer wrote neither labels nor layers: each segment
    /// had label 1 in a layer of its own. A label without a layer is in the first layer.
    fn segment(self, number: usize) -> Segment {
        let Self { value, layer, name, colour, terminology } = self;
        let layer = layer.unwrap_or(if value.is_some() { 0 } else { number });
        Segment { layer, value: value.unwrap_or(1), name, colour, terminology }
    }
}

/// Segments in the order of their numbers `N`.
///
/// # Errors
/// A layer or label that isn't a number or is out of range; a label with two names.
pub(super) fn segments(pairs: &[(String, String)]) -> Result<Vec<Segment>, VolumeFault> {
    let mut numbered: BTreeMap<usize, Keys> = BTreeMap::new();
    for (key, value) in pairs {
        let Some((number, field)) = key.strip_prefix("Segment").and_then(|rest| rest.split_once('_')) else { continue };
        let Ok(number) = number.parse::<usize>() else { continue };
        let segment = numbered.entry(number).or_default();
        let bad = |range: &str| VolumeFault::Header(format!("`{key}:={value}` must be a whole number {range}"));
        match field {
            "LabelValue" => {
                let label = value.trim().parse().ok().filter(|label| *label > 0);
                segment.value = Some(label.ok_or_else(|| bad("from 1 to 65535"))?);
            }
            "Layer" => segment.layer = Some(value.trim().parse().map_err(|_| bad("from 0 on"))?),
            "Name" => segment.name = Some(value.trim().to_owned()).filter(|name| !name.is_empty()),
            "Color" => segment.colour = colour(value),
            "Tags" => segment.terminology = terminology(value),
            _ => {}
        }
    }
    let mut names = LabelNames::default();
    for (number, keys) in numbered {
        names.add(keys.segment(number))?;
    }
    Ok(names.segments())
}

fn colour(value: &str) -> Option<[u8; 3]> {
    let channels: Option<Vec<f64>> = value.split_whitespace().map(|channel| channel.parse().ok()).collect();
    <[f64; 3]>::try_from(channels?).ok().map(|channels| channels.map(byte))
}

/// Meanings of the terms in the `TerminologyEntry` of a segment's tags: type, modifier, region and the region's
/// modifier.
fn terminology(tags: &str) -> Option<String> {
    let entry = tags.split('|').find_map(|tag| tag.trim().strip_prefix("TerminologyEntry:"))?;
    // Fields: context, category, type, modifier, context of the region, region, modifier of the region.
    let parts: Vec<&str> = entry.split('~').collect();
    let meaning = |part: usize| parts.get(part)?.split('^').nth(2).map(str::trim).filter(|meaning| !meaning.is_empty());
    let meanings: Vec<&str> = [2, 3, 5, 6].into_iter().filter_map(meaning).collect();
    (!meanings.is_empty()).then(|| meanings.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pairs(pairs: &[(&str, &str)]) -> Vec<(String, String)> {
        pairs.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect()
    }

    #[test]
    fn slicers_keys_become_segments_in_numeric_order() {
        let found = segments(&pairs(&[
            ("Segmentation_MasterRepresentation", "Binary labelmap"),
            ("Segment10_Name", "spleen"),
            ("Segment10_LabelValue", "7"),
            ("Segment10_Layer", "1"),
            ("Segment2_Color", "1 0.5 0"),
            ("Segment2_Name", "right kidney"),
            (
                "Segment2_Tags",
                "Segmentation.Status:inprogress|TerminologyEntry:list~SCT^123037004^Anatomical Structure\
                 ~SCT^64033007^Kidney~SCT^24028007^Right~Anatomic codes~^^~^^|",
            ),
            ("Segment2_LabelValue", "3"),
            ("Segment2_Layer", "0"),
        ]))
        .unwrap();
        let name = |name: &str| Some(name.to_owned());
        assert_eq!(
            found,
            [
                Segment {
                    layer: 0,
                    value: 3,
                    name: name("right kidney"),
                    colour: Some([255, 128, 0]),
                    terminology: name("Kidney, Right"),
                },
                Segment { layer: 1, value: 7, name: name("spleen"), colour: None, terminology: None },
            ]
        );
    }

    #[test]
    fn old_files_have_one_layer_for_each_segment() {
        let found = segments(&pairs(&[("Segment0_Name", "a"), ("Segment1_Name", "b")])).unwrap();
        assert_eq!(found.iter().map(|s| (s.layer, s.value)).collect::<Vec<_>>(), [(0, 1), (1, 1)]);
        let labelled = segments(&pairs(&[("Segment3_LabelValue", "5")])).unwrap();
        assert_eq!((labelled[0].layer, labelled[0].value), (0, 5));
    }

    #[test]
    fn two_names_of_one_label_are_refused() {
        let named = |second: &str| {
            segments(&pairs(&[
                ("Segment0_Name", "liver"),
                ("Segment0_LabelValue", "1"),
                ("Segment0_Layer", "0"),
                ("Segment1_Name", second),
                ("Segment1_LabelValue", "1"),
                ("Segment1_Layer", "0"),
            ]))
        };
        let error = named("spleen").unwrap_err().to_string();
        assert!(error.contains("label 1 of layer 0 is called `liver` and `spleen`"), "{error}");
        assert_eq!(named("liver").unwrap().len(), 1);
    }

    #[test]
    fn impossible_labels_are_refused_with_their_key() {
        for value in ["0", "65536", "x"] {
            let error = segments(&pairs(&[("Segment0_LabelValue", value)])).unwrap_err().to_string();
            assert!(error.contains(&format!("`Segment0_LabelValue:={value}`")), "{error}");
        }
    }
}
