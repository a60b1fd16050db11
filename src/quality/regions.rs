//! Mean levels in regions of an image: in each tissue, and behind bone.

use serde::{Deserialize, Serialize};

use crate::transducer::{Probe, ScanGeometry};

/// Smallest distance behind a tissue (deeper on the same scanline) at which a pixel counts as behind it, mm. The pulse
/// and the blur of its echo are shorter.
pub const BEHIND_MM: f64 = 2.0;
/// Words in the names of tissues whose shadows are measured.
pub(crate) const BONES: [&str; 3] = ["bone", "calvaria", "skull"];

/// Whether a tissue with this name is bone.
pub(crate) fn is_bone(tissue: &str) -> bool {
    BONES.iter().any(|bone| tissue.contains(bone))
}

/// Sums over the pixels of a region, in one image or several.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct RegionSum {
    pixels: u64,
    image: u64,
    reference: u64,
    absolute: u64,
}

/// Difference between an image and its reference in a region.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RegionError {
    /// Number of pixels, over all images.
    pub pixels: u64,
    /// Mean grey level of the image.
    pub grey: f64,
    /// Mean grey level of the reference.
    pub reference_grey: f64,
    /// Mean of the image's level minus the reference's level, grey levels.
    pub difference: f64,
    /// Mean magnitude of that difference per pixel, grey levels. It is never 0 for images with different speckle.
    pub absolute_difference: f64,
}

impl RegionSum {
    /// Adds a pixel.
    pub(crate) fn add(&mut self, image: u8, reference: u8) {
        self.pixels += 1;
        self.image += u64::from(image);
        self.reference += u64::from(reference);
        self.absolute += u64::from(image.abs_diff(reference));
    }

    /// Number of pixels so far.
    pub(crate) fn pixels(&self) -> u64 {
        self.pixels
    }

    /// Means over the pixels; `None` without pixels.
    pub(crate) fn error(&self) -> Option<RegionError> {
        let mean = |sum: u64| sum as f64 / self.pixels as f64;
        let (grey, reference_grey) = (mean(self.image), mean(self.reference));
        (self.pixels > 0).then(|| RegionError {
            pixels: self.pixels,
            grey,
            reference_grey,
            difference: grey - reference_grey,
            absolute_difference: mean(self.absolute),
        })
    }
}

/// Scanline and depth of every pixel in a sector's image.
#[derive(Debug, Clone, PartialEq)]
pub struct Scanlines {
    lines: usize,
    /// Scanline, and depth in mm, of each pixel [height × width]; `None` outside the sector.
    positions: Vec<Option<(u16, f32)>>,
}

impl Scanlines {
    /// Scanlines of `probe` in an image of `width` × `height` pixels.
    pub fn new(probe: &Probe, width: u32, height: u32) -> Self {
        let geometry = ScanGeometry::fit(probe, width, height);
        let lines = (probe.scanlines as usize).clamp(1, usize::from(u16::MAX));
        let position = |column, row| {
            let (fraction, depth) = geometry.beam_at(column, row)?;
            let line = ((fraction * lines as f64) as usize).min(lines - 1);
            Some((line as u16, depth as f32))
        };
        let positions = (0..height).flat_map(|row| (0..width).map(move |column| position(column, row))).collect();
        Self { lines, positions }
    }

    /// Mask [height × width] of the pixels behind a tissue. `casts` selects the tissue's numbers in `segmentation`. A
    /// pixel is behind it if it is on the same scanline and more than [`BEHIND_MM`] deeper than the nearest pixel of
    /// the tissue. Pixels of the tissue itself and pixels outside the sector (number 0) are excluded. Scanlines are
    /// assumed straight.
    pub fn behind(&self, segmentation: &[u8], casts: impl Fn(u8) -> bool) -> Vec<bool> {
        let casts: [bool; 256] = std::array::from_fn(|number| casts(number as u8));
        let mut nearest = vec![f32::INFINITY; self.lines];
        for (position, &number) in self.positions.iter().zip(segmentation) {
            if let (&Some((line, depth)), true) = (position, casts[usize::from(number)]) {
                let nearest = &mut nearest[usize::from(line)];
                *nearest = nearest.min(depth);
            }
        }
        let behind = |(position, &number): (&Option<(u16, f32)>, &u8)| match position {
            Some((line, depth)) if number > 0 && !casts[usize::from(number)] => {
                *depth > nearest[usize::from(*line)] + BEHIND_MM as f32
            }
            _ => false,
        };
        self.positions.iter().zip(segmentation).map(behind).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transducer::{ProbeKind, Sector};

    #[test]
    fn sums_become_means() {
        let mut sum = RegionSum::default();
        assert_eq!(sum.error(), None);
        [(10, 20), (40, 20)].into_iter().for_each(|(a, b)| sum.add(a, b));
        let expected =
            RegionError { pixels: 2, grey: 25.0, reference_grey: 20.0, difference: 5.0, absolute_difference: 15.0 };
        assert_eq!(sum.error(), Some(expected));
    }

    #[test]
    fn bones_go_by_name() {
        let bones = ["bone_adult", "bone_fetal", "calvaria_fetal"];
        assert!(
            bones.iter().all(|name| is_bone(name)) && !["brain", "cartilage", "gallstone"].iter().any(|n| is_bone(n))
        );
    }

    #[test]
    fn pixels_behind_lie_deeper_on_the_same_scanline() {
        let probe = Probe { scanlines: 64, ..Probe::default() };
        let (width, height) = (347u32, 250u32);
        let sector = Sector::fit(&probe, width, height);
        let scanlines = Scanlines::new(&probe, width, height);
        let polar = |i: usize| Sector::polar(&probe, sector.pixel_centre_mm(i as u32 % width, i as u32 / width));
        // A plate at 60 to 64 mm depth, from 0.25 to 0.5 of the sector's lateral extent.
        let plate = |(fraction, depth): (f64, f64)| (0.25..0.5).contains(&fraction) && (60.0..64.0).contains(&depth);
        let pixels = (width * height) as usize;
        let number = |i: usize| polar(i).map_or(0, |p| if plate(p) { 2 } else { 1 });
        let segmentation: Vec<u8> = (0..pixels).map(number).collect();
        let behind = scanlines.behind(&segmentation, |n| n == 2);
        let mut counts = [0; 2];
        for (i, &behind) in behind.iter().enumerate() {
            let Some((fraction, depth)) = polar(i) else {
                assert!(!behind);
                continue;
            };
            let in_fan = (0.25..0.5).contains(&fraction);
            counts[usize::from(behind)] += 1;
            // The side of a pixel is 0.6 mm.
            if in_fan && depth > 65.0 {
                assert!(behind, "{fraction} {depth}");
            } else if !in_fan || depth < 61.0 || plate((fraction, depth)) {
                assert!(!behind, "{fraction} {depth}");
            }
        }
        assert!(counts[1] > 1000 && counts[0] > counts[1], "{counts:?}");
        assert!(!scanlines.behind(&segmentation, |_| false).contains(&true));
    }

    #[test]
    fn a_linear_probe_has_columns() {
        let probe = Probe { kind: ProbeKind::Linear { width_mm: 40.0 }, scanlines: 40, ..Probe::default() };
        let scanlines = Scanlines::new(&probe, 40, 150);
        let segmentation: Vec<u8> = (0..40 * 150).map(|i| if i == 20 * 40 + 7 { 9 } else { 1 }).collect();
        let behind = scanlines.behind(&segmentation, |n| n == 9);
        let found: Vec<usize> = (0..40 * 150).filter(|&i| behind[i]).collect();
        assert!(found.iter().all(|i| i % 40 == 7) && found[0] / 40 == 23 && found.len() == 127, "{:?}", found.first());
    }
}
