//! Conversion between the maps of a frame and the tensors of a model.

use std::ops::Range;
use std::path::Path;

use rayon::prelude::*;

use super::manifest::{Affine, Encoding, Manifest, SegmentationManifest};
use super::tensor_values::{Element, Planes, Values};
use super::{Channel, GeneratorError, Input};

/// Number of rows in a parallel task. ONNX Runtime's threads are idle meanwhile.
const BAND: usize = 64;

/// Size of a field of view (frame, or beam grid) and of the padded tensor planes around it. The field of view is
/// centred; an odd pixel of padding is at the right or below.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Geometry {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) padded_width: usize,
    pub(super) padded_height: usize,
}

impl Geometry {
    pub(super) fn new(width: u32, height: u32, multiple: u32) -> Self {
        let up = |n: u32| n.next_multiple_of(multiple) as usize;
        Self { width: width as usize, height: height as usize, padded_width: up(width), padded_height: up(height) }
    }

    /// Number of pixels in the field of view.
    pub(super) fn pixels(&self) -> usize {
        self.width * self.height
    }

    fn padded_pixels(&self) -> usize {
        self.padded_width * self.padded_height
    }

    /// Number of padding columns to the left.
    fn left(&self) -> usize {
        (self.padded_width - self.width) / 2
    }

    /// Index of the field of view's first value in a padded plane.
    pub(super) fn first(&self) -> usize {
        self.above() + self.left()
    }

    /// Number of values in a padded plane before the rows of the field of view.
    fn above(&self) -> usize {
        (self.padded_height - self.height) / 2 * self.padded_width
    }

    /// Number of values in the padded plane's rows that hold the field of view, including the padding left and right.
    fn within(&self) -> usize {
        self.height * self.padded_width
    }
}

/// Name of the class for the area outside the sector.
const OUTSIDE: &str = "outside";

/// Class index of each tissue number.
#[derive(Debug, Clone)]
pub(super) struct ClassMap {
    class: [u8; 256],
    greatest: usize,
    /// Class index of the area outside the sector.
    outside: u8,
}

impl ClassMap {
    /// Map of each class index to itself, for a parity pair, which holds classes instead of tissues.
    pub(super) fn identity(manifest: &SegmentationManifest) -> Self {
        let outside = manifest.class_of(OUTSIDE).unwrap_or_default() as u8;
        Self { class: std::array::from_fn(|i| i as u8), greatest: manifest.classes.len().saturating_sub(1), outside }
    }

    /// Class indices of a station's tissues. Number 0 is the outside, number i + 1 is `tissues[i]`.
    pub(super) fn of_tissues(
        manifest: &SegmentationManifest,
        tissues: &[String],
        model: &Path,
    ) -> Result<Self, GeneratorError> {
        let mut class = [0; 256];
        let names = std::iter::once(OUTSIDE).chain(tissues.iter().map(String::as_str));
        for (slot, name) in class.iter_mut().zip(names) {
            let found = manifest
                .class_of(name)
                .ok_or_else(|| GeneratorError::UnknownTissue { path: model.to_owned(), tissue: name.to_owned() })?;
            *slot = found as u8;
        }
        Ok(Self { class, greatest: tissues.len(), outside: class[0] })
    }
}

/// Fills the input tensor with the maps of a frame. As in training, padding equals pixels outside the sector: level,
/// mask and attenuation 0, class `outside`.
pub(super) fn fill(
    manifest: &Manifest,
    classes: Option<&ClassMap>,
    input: &Input,
    geometry: &Geometry,
    tensor: Planes<'_>,
) -> Result<(), GeneratorError> {
    match tensor {
        Planes::Floats(tensor) => fill_with(manifest, classes, input, geometry, tensor),
        Planes::Bytes(tensor) => fill_with(manifest, classes, input, geometry, tensor),
    }
}

fn fill_with<E: Element>(
    manifest: &Manifest,
    classes: Option<&ClassMap>,
    input: &Input,
    geometry: &Geometry,
    tensor: &mut [E],
) -> Result<(), GeneratorError> {
    let mut planes = tensor.chunks_exact_mut(geometry.padded_pixels());
    for &channel in &manifest.input.channels {
        let affine = manifest.affine(channel).unwrap_or(Affine::new(1.0, 0.0));
        match (channel, &manifest.segmentation, classes) {
            (Channel::Segmentation, Some(segmentation), Some(classes)) => {
                let greatest = input.segmentation.iter().copied().max().unwrap_or(0);
                if usize::from(greatest) > classes.greatest {
                    return Err(GeneratorError::TissueNumber { number: greatest, greatest: classes.greatest });
                }
                let mut channel = |of: &dyn Fn(u8) -> u8| {
                    let values = classes.class.map(|class| E::of_class(of(class), affine));
                    let outside = E::of_class(of(classes.outside), affine);
                    plane(planes.next(), geometry, input.segmentation, outside, |n| values[usize::from(n)]);
                };
                match segmentation.encoding {
                    Encoding::Map => channel(&|class| class),
                    Encoding::Classes => (0..segmentation.classes.len())
                        .for_each(|wanted| channel(&|class| u8::from(usize::from(class) == wanted))),
                }
            }
            (Channel::Attenuation, ..) => {
                let (plane_of, values) = (planes.next(), input.attenuation);
                let outside = E::of_attenuation(0.0, affine);
                let root = |a: f32| a.max(0.0).sqrt();
                match affine.power {
                    0.25 => plane(plane_of, geometry, values, outside, |a| E::of_attenuation(root(root(a)), affine)),
                    0.5 => plane(plane_of, geometry, values, outside, |a| E::of_attenuation(root(a), affine)),
                    _ => plane(plane_of, geometry, values, outside, |a| E::of_attenuation(a, affine)),
                }
            }
            (Channel::Mask, ..) => {
                let [outside, inside] = [false, true].map(|inside| E::of_mask(inside, affine));
                plane(planes.next(), geometry, input.mask, outside, |m| if m > 0 { inside } else { outside });
            }
            // Not reached for segmentation: `Generator` makes a class map whenever the manifest has segmentation.
            (Channel::Image | Channel::Segmentation, ..) => {
                plane(planes.next(), geometry, input.image, E::of_level(0, affine), |x| E::of_level(x, affine));
            }
        }
    }
    Ok(())
}

/// Fills one channel of the tensor with the converted values of a map. The padding gets the value `outside`.
fn plane<T: Copy + Sync, E: Element>(
    plane: Option<&mut [E]>,
    geometry: &Geometry,
    source: &[T],
    outside: E,
    value: impl Fn(T) -> E + Sync,
) {
    let Some(plane) = plane else { return };
    let Geometry { width, padded_width, .. } = *geometry;
    let (above, rest) = plane.split_at_mut(geometry.above());
    let (within, below) = rest.split_at_mut(geometry.within());
    within.par_chunks_mut(BAND * padded_width).zip(source.par_chunks(BAND * width)).for_each(|(rows, source)| {
        for (row, source) in rows.chunks_exact_mut(padded_width).zip(source.chunks_exact(width)) {
            let (left, row) = row.split_at_mut(geometry.left());
            let (row, right) = row.split_at_mut(width);
            left.fill(outside);
            for (target, &x) in row.iter_mut().zip(source) {
                *target = value(x);
            }
            right.fill(outside);
        }
    });
    above.fill(outside);
    below.fill(outside);
}

/// The rows of a padded plane that hold the field of view, and its columns in each of these rows.
fn padded_rows<'a, T>(output: &'a [T], geometry: &Geometry) -> (&'a [T], Range<usize>) {
    let left = geometry.left();
    (&output[geometry.above()..geometry.above() + geometry.within()], left..left + geometry.width)
}

/// Rows of the output, without the padding.
fn rows<'a, T>(output: &'a [T], geometry: &Geometry) -> impl Iterator<Item = &'a [T]> {
    let (rows, columns) = padded_rows(output, geometry);
    rows.chunks_exact(geometry.padded_width).map(move |row| &row[columns.clone()])
}

/// Row and column of the first non-finite value in the field of view, and the number of such values. `None` if all are
/// finite, as bytes always are.
pub(super) fn not_finite(output: Values<'_>, geometry: &Geometry) -> Option<(usize, usize, usize)> {
    let Values::Floats(output) = output else { return None };
    // Tests the exponent without a branch, for speed. Only broken models give non-finite values.
    const EXPONENT: u32 = 0x7f80_0000;
    let broken = |row: &[f32]| row.iter().fold(false, |any, v| any | (v.to_bits() & EXPONENT == EXPONENT));
    let (padded, columns) = padded_rows(output, geometry);
    let all = padded.par_chunks_exact(geometry.padded_width).with_min_len(BAND);
    let row = all.position_first(|row| broken(&row[columns.clone()]))?;
    let values = rows(output, geometry).nth(row)?;
    let column = values.iter().position(|v| !v.is_finite())?;
    let count = rows(output, geometry).flatten().filter(|v| !v.is_finite()).count();
    Some((row, column, count))
}

/// Writes the rounded grey levels of the output to `out`; 0 outside the mask.
pub(super) fn quantise(output: Values<'_>, affine: Affine, mask: &[u8], geometry: &Geometry, out: &mut Vec<u8>) {
    let (scale, offset) = (affine.scale * 255.0, affine.offset * 255.0);
    match output {
        // Adding 2^23 leaves the rounded value in the lowest bits. A cast would need a branch.
        Values::Floats(output) => masked(output, mask, geometry, out, |value| {
            ((value * scale + offset).clamp(0.0, 255.0) + 8_388_608.0).to_bits() as u8
        }),
        Values::Bytes(output) => masked(output, mask, geometry, out, |level| level),
    }
}

/// Writes the grey level of each pixel of the field of view to `out`; 0 outside the mask.
fn masked<T: Copy + Sync>(
    output: &[T],
    mask: &[u8],
    geometry: &Geometry,
    out: &mut Vec<u8>,
    level_of: impl Fn(T) -> u8 + Sync,
) {
    out.resize(geometry.pixels(), 0);
    let Geometry { width, padded_width, .. } = *geometry;
    let masks = mask.par_chunks(BAND * width);
    let (padded, columns) = padded_rows(output, geometry);
    let bands = out.par_chunks_mut(BAND * width).zip(masks).zip(padded.par_chunks(BAND * padded_width));
    bands.for_each(|((targets, masks), values)| {
        let targets = targets.chunks_exact_mut(width).zip(masks.chunks_exact(width));
        for (values, (target, mask)) in values.chunks_exact(padded_width).zip(targets) {
            for ((level, &value), &inside) in target.iter_mut().zip(&values[columns.clone()]).zip(mask) {
                let rounded = level_of(value);
                *level = if inside > 0 { rounded } else { 0 };
            }
        }
    });
}

/// Grey levels of the output, clipped to 0..=255; 0 outside the mask. They are not rounded, except by the model.
pub(super) fn levels(output: Values<'_>, affine: Affine, mask: &[u8], geometry: &Geometry) -> Vec<f32> {
    let level = |v: f32| ((v * affine.scale + affine.offset) * 255.0).clamp(0.0, 255.0);
    let inside = |(level, inside): (f32, &u8)| if *inside > 0 { level } else { 0.0 };
    match output {
        Values::Floats(output) => rows(output, geometry).flatten().map(|v| level(*v)).zip(mask).map(inside).collect(),
        Values::Bytes(output) => {
            rows(output, geometry).flatten().map(|v| f32::from(*v)).zip(mask).map(inside).collect()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn every_channel_is_padded_by_what_is_outside() {
        let affine = |scale: &str, offset: &str| format!("{{ scale = {scale}, offset = {offset} }}");
        let text = include_str!("../../tests/data/generators/weighted_maps.toml")
            .replace("classes = [\"outside\", \"amniotic_fluid\",", "classes = [\"amniotic_fluid\", \"outside\",")
            .replace(&affine("1.0", "0.0"), &affine("2.0", "-1.0"));
        for encoding in ["map", "classes"] {
            let manifest = Manifest::parse(&text.replace("\"map\"", &format!("\"{encoding}\""))).unwrap();
            let tissues = ["placenta", "skull"].map(str::to_owned);
            let segmentation = manifest.segmentation.as_ref().unwrap();
            let of_station = ClassMap::of_tissues(segmentation, &tissues, Path::new("")).unwrap();
            for (classes, number) in [(of_station, 0), (ClassMap::identity(segmentation), 1)] {
                // A frame entirely outside the sector equals its padding.
                let input = Input {
                    width: 3,
                    height: 2,
                    image: &[0; 6],
                    segmentation: &[number; 6],
                    attenuation: &[0.0; 6],
                    mask: &[0; 6],
                    scan: None,
                };
                let mut tensor = vec![f32::NAN; manifest.tensor_channels() * 16];
                fill(&manifest, Some(&classes), &input, &Geometry::new(3, 2, 4), Planes::Floats(&mut tensor)).unwrap();
                for plane in tensor.chunks_exact(16) {
                    assert!(plane.iter().all(|v| *v == plane[0]), "{encoding}: {plane:?}");
                }
                let ones = tensor.iter().filter(|v| **v == 1.0).count();
                assert_eq!(ones, 16, "{encoding}: the class `outside` alone is not -1: {tensor:?}");
            }
        }
    }

    #[test]
    fn a_field_of_view_lies_amid_what_is_outside() {
        // Padding of three columns (an odd number) and of two rows.
        let geometry = Geometry::new(1, 2, 4);
        let mut tensor = vec![f32::NAN; 16];
        plane(Some(&mut tensor), &geometry, &[1u8, 2], 9.0, f32::from);
        #[rustfmt::skip]
        assert_eq!(tensor, [9., 9., 9., 9.,  9., 1., 9., 9.,  9., 2., 9., 9.,  9., 9., 9., 9.]);
        let mut levels_out = Vec::new();
        let unit = Affine::new(1.0 / 255.0, 0.0);
        quantise(Values::Floats(&tensor), unit, &[255, 255], &geometry, &mut levels_out);
        assert_eq!(levels_out, [1, 2]);
        assert_eq!(levels(Values::Floats(&tensor), unit, &[255, 0], &geometry), [1.0, 0.0]);
        // Non-finite values outside the field of view are not shown, and are no error.
        let mut broken = tensor.clone();
        broken[4] = f32::NAN;
        broken[0] = f32::INFINITY;
        assert_eq!(not_finite(Values::Floats(&broken), &geometry), None);
        broken[9] = f32::NAN;
        assert_eq!(not_finite(Values::Floats(&broken), &geometry), Some((1, 0, 1)));
    }

    #[test]
    fn the_attenuation_may_be_a_root() {
        let text = include_str!("../../tests/data/generators/weighted_maps.toml");
        let values = [0.0, 1e-8, 6.25e-2, 1.0];
        for (power, expected) in [("1.0", values), ("0.5", [0.0, 1e-4, 0.25, 1.0]), ("0.25", [0.0, 1e-2, 0.5, 1.0])] {
            let from = "attenuation = { scale = 1.0, offset = 0.0 }";
            let text = text.replace(from, &format!("attenuation = {{ scale = 2.0, offset = 1.0, power = {power} }}"));
            let manifest = Manifest::parse(&text).unwrap();
            let at = manifest.input.channels.iter().position(|c| *c == Channel::Attenuation).unwrap();
            let input = Input {
                width: 4,
                height: 1,
                image: &[0; 4],
                segmentation: &[0; 4],
                attenuation: &values,
                mask: &[255; 4],
                scan: None,
            };
            let classes = ClassMap::identity(manifest.segmentation.as_ref().unwrap());
            let mut tensor = [0.0; 16];
            fill(&manifest, Some(&classes), &input, &Geometry::new(4, 1, 1), Planes::Floats(&mut tensor)).unwrap();
            for (got, expected) in tensor[4 * at..4 * at + 4].iter().zip(expected) {
                assert!((got - (2.0 * expected + 1.0)).abs() < 1e-6, "{power}: {got} {expected}");
            }
        }
    }

    #[test]
    fn levels_are_rounded_and_clipped_and_masked() {
        let geometry = Geometry::new(6, 1, 1);
        let output = [-0.1, 0.4 / 255.0, 0.6 / 255.0, 254.6 / 255.0, 7.0, 1.0];
        let mut out = vec![9; 20];
        let unit = Affine::new(1.0, 0.0);
        quantise(Values::Floats(&output), unit, &[255, 255, 255, 255, 255, 0], &geometry, &mut out);
        assert_eq!(out, [0, 0, 1, 255, 255, 0]);
    }

    #[test]
    fn bytes_are_filled_before_normalisation_and_read_as_levels() {
        let text = include_str!("../../tests/data/generators/weighted_maps.toml");
        let from = "attenuation = { scale = 1.0, offset = 0.0 }";
        let manifest =
            Manifest::parse(&text.replace(from, "attenuation = { scale = 2.0, offset = -1.0, power = 0.25 }"));
        let manifest = manifest.unwrap();
        let input = Input {
            width: 2,
            height: 1,
            image: &[7, 200],
            segmentation: &[3, 2],
            attenuation: &[0.0625, 1.0],
            mask: &[255, 0],
            scan: None,
        };
        let classes = ClassMap::identity(manifest.segmentation.as_ref().unwrap());
        let geometry = Geometry::new(2, 1, 4);
        let mut tensor = vec![99_u8; 4 * 16];
        fill(&manifest, Some(&classes), &input, &geometry, Planes::Bytes(&mut tensor)).unwrap();
        let of = |channel: Channel| match channel {
            Channel::Image => [7, 200],
            Channel::Mask => [255, 0],
            Channel::Segmentation => [3, 2],
            Channel::Attenuation => [128, 255],
        };
        for (plane, &channel) in tensor.chunks_exact(16).zip(&manifest.input.channels) {
            let mut expected = [0; 16];
            expected[5..7].copy_from_slice(&of(channel));
            assert_eq!(plane, expected, "{channel:?}: padding has the class `outside`, 0, as all else");
        }
        let mut out = Vec::new();
        let affine = Affine::new(3.0, -9.0);
        quantise(Values::Bytes(&tensor[..16]), affine, &[255, 0], &geometry, &mut out);
        assert_eq!(out, [tensor[5], 0], "the graph has rounded already");
        assert_eq!(levels(Values::Bytes(&tensor[..16]), affine, &[0, 255], &geometry), [0.0, f32::from(tensor[6])]);
        assert_eq!(not_finite(Values::Bytes(&tensor[..16]), &geometry), None);
    }

    #[test]
    fn values_that_are_not_finite_are_found_within_the_field_of_view_only() {
        let geometry = Geometry::new(3, 2, 4);
        let mut output = vec![0.0; 16];
        output[3] = f32::NAN;
        output[15] = f32::INFINITY;
        assert_eq!(not_finite(Values::Floats(&output), &geometry), None);
        // The field of view is in the second and third row.
        output[10] = f32::NEG_INFINITY;
        output[9] = f32::NAN;
        assert_eq!(not_finite(Values::Floats(&output), &geometry), Some((1, 1, 2)));
    }

    proptest! {
        #[test]
        fn every_level_comes_back_through_any_normalisation(scale in 0.1f32..10.0, offset in -5.0f32..5.0, x in 0u8..=255) {
            let there = f32::from(x) / 255.0 * scale + offset;
            let back = Affine::new(1.0 / scale, -offset / scale);
            let mut out = Vec::new();
            quantise(Values::Floats(&[there]), back, &[255], &Geometry::new(1, 1, 1), &mut out);
            prop_assert_eq!(out[0], x);
        }
    }
}
