//! Segments that a file names, one for each label of a layer.

use std::collections::HashMap;

use insonify_core::names::printable;

use super::{Segment, VolumeFault};

/// Segments, in the order in which the file first names their labels.
#[derive(Debug, Default)]
pub(super) struct LabelNames {
    segments: Vec<Segment>,
    /// Index in `segments` for each pair of layer and label.
    index_of: HashMap<(usize, u16), usize>,
}

impl LabelNames {
    /// Adds a segment. Of several segments with the same layer and label, the first segment with a name is kept.
    ///
    /// # Errors
    /// A label with two different names.
    pub(super) fn add(&mut self, segment: Segment) -> Result<(), VolumeFault> {
        let index = *self.index_of.entry((segment.layer, segment.value)).or_insert(self.segments.len());
        let Some(first) = self.segments.get_mut(index) else {
            self.segments.push(segment);
            return Ok(());
        };
        match (&first.name, &segment.name) {
            (Some(a), Some(b)) if a != b => {
                let (label, layer, a, b) = (segment.value, segment.layer, printable(a), printable(b));
                let reason = format!("label {label} of layer {layer} is called `{a}` and `{b}`; delete the wrong name");
                return Err(VolumeFault::Header(reason));
            }
            (None, Some(_)) => *first = segment,
            _ => {}
        }
        Ok(())
    }

    pub(super) fn segments(self) -> Vec<Segment> {
        self.segments
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn added(named: &[(usize, u16, Option<&str>)]) -> Result<Vec<(usize, u16, Option<String>)>, VolumeFault> {
        let mut names = LabelNames::default();
        for &(layer, value, name) in named {
            let name = name.map(str::to_owned);
            names.add(Segment { layer, value, name, colour: None, terminology: None })?;
        }
        Ok(names.segments().into_iter().map(|s| (s.layer, s.value, s.name)).collect())
    }

    #[test]
    fn a_label_has_one_name() {
        let owned = |name: &str| Some(name.to_owned());
        let found = added(&[
            (0, 2, None),
            (0, 1, Some("liver")),
            (1, 1, Some("spleen")),
            (0, 1, Some("liver")),
            (0, 1, None),
            (0, 2, Some("aorta")),
        ]);
        assert_eq!(found.unwrap(), [(0, 2, owned("aorta")), (0, 1, owned("liver")), (1, 1, owned("spleen"))]);
        let error = added(&[(3, 7, Some("liver")), (3, 7, Some("spl\u{1b}een"))]).unwrap_err().to_string();
        assert_eq!(error, "header: label 7 of layer 3 is called `liver` and `spl een`; delete the wrong name");
    }
}
