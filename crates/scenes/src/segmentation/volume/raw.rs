//! Decoded volumes before their values are interpreted as labels or as an image.

use std::path::{Path, PathBuf};

use glam::DAffine3;

use super::samples::{BadLabel, Samples};
use super::{Image, LabelMap, Segment, VolumeFault};

/// A decoded file: placement of its grid, stored values, named segments.
#[derive(Debug, Clone)]
pub struct RawVolume {
    /// Number of voxels along i, j and k.
    pub(super) size: [usize; 3],
    /// Transform from voxel index to patient position (LPS), mm.
    pub(super) lps_from_voxel: DAffine3,
    /// Stored values of all layers.
    pub(super) samples: Samples,
    /// Number of layers, and position of the layers' axis among the axes of the data.
    pub(super) layers: Layers,
    /// Segments that the file names.
    pub(super) segments: Vec<Segment>,
    /// Assumptions and choices in reading.
    pub(super) remarks: Vec<String>,
}

/// Layers of a volume, which are counted by an axis of the data besides the three axes of space.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Layers {
    /// Number of layers.
    pub count: usize,
    /// Number of consecutive values of one layer: the product of the sizes of the faster axes.
    pub inner: usize,
}

impl Layers {
    /// A volume of one layer.
    pub(super) const ONE: Self = Self { count: 1, inner: 1 };
}

impl RawVolume {
    /// Label map of these voxels. Labels that occur but have no name in the file become segments without a name.
    ///
    /// # Errors
    /// Values that aren't whole numbers from 0 to 65535, and segments in layers that don't exist.
    pub fn into_labels(self, path: &Path) -> Result<LabelMap, VolumeFault> {
        let Self { size, lps_from_voxel, samples, layers, mut segments, remarks } = self;
        let labels = samples.labels().map_err(|(index, bad)| refused(index, bad, size, layers))?;
        drop(samples);
        let layers = split(labels, layers);
        if let Some(segment) = segments.iter().find(|segment| segment.layer >= layers.len()) {
            let name = segment.name.as_deref().unwrap_or("without name");
            let reason = format!("segment `{name}` is in layer {}, and the file has {}", segment.layer, layers.len());
            return Err(VolumeFault::Header(reason));
        }
        for (layer, labels) in layers.iter().enumerate() {
            for value in present(labels) {
                if !segments.iter().any(|segment| segment.layer == layer && segment.value == value) {
                    segments.push(Segment { layer, value, name: None, colour: None, terminology: None });
                }
            }
        }
        Ok(LabelMap { path: path.to_owned(), size, lps_from_voxel, layers, segments, remarks })
    }

    /// Image of these voxels.
    ///
    /// # Errors
    /// More than one layer.
    pub fn into_image(self, path: &Path) -> Result<Image, VolumeFault> {
        if self.layers.count != 1 {
            let what = format!("an image of {} values per voxel", self.layers.count);
            return Err(VolumeFault::Unsupported { what, remedy: "save one of them as a volume of three axes" });
        }
        let Self { size, lps_from_voxel, samples, remarks, .. } = self;
        let values = samples.values();
        Ok(Image { path: PathBuf::from(path), size, lps_from_voxel, values, stated: None, remarks })
    }
}

/// Non-zero labels that occur, ascending.
fn present(labels: &[u16]) -> impl Iterator<Item = u16> {
    let mut seen = vec![false; 1 << 16];
    for label in labels {
        seen[usize::from(*label)] = true;
    }
    (1..=u16::MAX).filter(move |value| seen[usize::from(*value)])
}

fn split(labels: Vec<u16>, Layers { count, inner }: Layers) -> Vec<Vec<u16>> {
    if count == 1 {
        return vec![labels];
    }
    let of_layer = |layer| labels.chunks(inner).skip(layer).step_by(count).flatten().copied().collect();
    (0..count).map(of_layer).collect()
}

fn refused(index: usize, bad: BadLabel, size: [usize; 3], Layers { count, inner }: Layers) -> VolumeFault {
    let index = index / (inner * count) * inner + index % inner;
    let voxel = [index % size[0], index / size[0] % size[1], index / size[0] / size[1]];
    match bad {
        BadLabel::Image(value) => VolumeFault::NotLabels { voxel, value },
        BadLabel::Range(value) => VolumeFault::LabelRange { voxel, value },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_come_apart_wherever_their_axis_is() {
        let first = split(vec![1, 10, 2, 20, 3, 30, 4, 40], Layers { count: 2, inner: 1 });
        assert_eq!(first, [[1, 2, 3, 4], [10, 20, 30, 40]]);
        let last = split(vec![1, 2, 3, 4, 10, 20, 30, 40], Layers { count: 2, inner: 4 });
        assert_eq!(last, first);
        let middle = split(vec![1, 2, 10, 20, 3, 4, 30, 40], Layers { count: 2, inner: 2 });
        assert_eq!(middle, first);
    }

    #[test]
    fn a_refused_value_is_placed_by_its_voxel() {
        let bad = || BadLabel::Range("-1".into());
        let fault = refused(2 * 5 + 1, bad(), [2, 2, 2], Layers { count: 2, inner: 1 });
        assert!(matches!(fault, VolumeFault::LabelRange { voxel: [1, 0, 1], .. }), "{fault}");
        let fault = refused(8 + 5, bad(), [2, 2, 2], Layers { count: 2, inner: 8 });
        assert!(matches!(fault, VolumeFault::LabelRange { voxel: [1, 0, 1], .. }), "{fault}");
    }
}
