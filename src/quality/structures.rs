//! Missed structures: tissues that stand out from their surroundings in the reference, but not in the image.

use serde::{Deserialize, Serialize};

use super::QualityError;
use super::error::check_sizes;
use super::pixel_counts::PixelCounts;

/// Width of the bands on both sides of a border, pixels. In the paper's image, 8 pixels are 1.3 mm, a few speckles.
pub const BAND: usize = 8;
/// Side of the tiles in which the contrast of a border is measured, pixels.
pub(crate) const TILE: usize = 64;
/// Smallest number of pixels in each band of a tile.
const PIXELS_MIN: u32 = 64;
/// Smallest contrast at which a border of the reference counts, grey levels.
pub const CONTRAST_MIN: f64 = 6.0;

/// Structure errors in one tissue.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ClassStructure {
    /// Number of the tissue in the segmentation, from 1.
    pub class: u8,
    /// Number of pixels of the tissue.
    pub pixels: usize,
    /// Mean grey level of the image minus mean grey level of the reference, both within the tissue.
    pub grey_difference: f64,
    /// Contrast of the tissue's borders in the reference, mean over tiles, grey levels; `None` if no border stands
    /// out.
    pub contrast: Option<f64>,
    /// Share of that contrast which the image has lost, from 0 (none) to 1 (all).
    pub contrast_lost: Option<f64>,
}

/// Structure errors of every tissue in `segmentation` [height × width], in the order of their numbers. Number 0 is
/// outside the sector, and does not count as a neighbour.
///
/// Contrast is the mean level inside a border minus the mean level outside, both within [`BAND`] pixels of it. Levels
/// are log-compressed, so up to a factor this is the contrast in dB of Smith et al. 1983 (IEEE Trans. Sonics
/// Ultrason. 30). It is measured in each tile, so bright and dark parts of one border don't cancel. A tile with
/// contrast c in the reference and c′ in the image loses max(0, min(|c|, |c| − c′·sign c)). The share lost is Σ lost
/// / Σ |c| over tiles with |c| at least [`CONTRAST_MIN`]. A higher contrast than the reference's loses nothing; an
/// opposite contrast loses everything.
///
/// # Errors
/// The maps have different sizes.
pub fn structures(
    image: &[u8],
    reference: &[u8],
    segmentation: &[u8],
    size: [usize; 2],
) -> Result<Vec<ClassStructure>, QualityError> {
    check_sizes(size, &[("image", image), ("reference", reference), ("segmentation", segmentation)])?;
    let mut counts = [0usize; 256];
    let mut differences = [0i64; 256];
    for ((&a, &b), &class) in image.iter().zip(reference).zip(segmentation) {
        counts[usize::from(class)] += 1;
        differences[usize::from(class)] += i64::from(a) - i64::from(b);
    }
    let present = (1..=255u8).filter(|&class| counts[usize::from(class)] > 0);
    let mut counts_of_class = PixelCounts::new(size);
    let class = |class: u8| {
        let pixels = counts[usize::from(class)];
        counts_of_class.count(segmentation, |label| label == class);
        let tiles = tiles([image, reference, segmentation], size, class, &counts_of_class);
        let (mut sum, mut lost, mut number) = (0.0, 0.0, 0u32);
        for [found, expected] in tiles.iter().filter_map(Tile::contrasts) {
            if expected.abs() >= CONTRAST_MIN {
                sum += expected.abs();
                lost += (expected.abs() - found * expected.signum()).clamp(0.0, expected.abs());
                number += 1;
            }
        }
        ClassStructure {
            class,
            pixels,
            grey_difference: differences[usize::from(class)] as f64 / pixels as f64,
            contrast: (number > 0).then(|| sum / f64::from(number)),
            contrast_lost: (number > 0).then(|| lost / sum),
        }
    };
    Ok(present.map(class).collect())
}

/// Share of contrast lost over all tissues, each weighted by its contrast; `None` if no border stands out.
pub(crate) fn contrast_lost(classes: &[ClassStructure]) -> Option<f64> {
    let (mut sum, mut lost) = (0.0, 0.0);
    for (contrast, share) in classes.iter().filter_map(|c| c.contrast.zip(c.contrast_lost)) {
        sum += contrast;
        lost += contrast * share;
    }
    (sum > 0.0).then(|| lost / sum)
}

/// Pixel counts and level sums in the two bands of a tile (inside, outside), for image and reference.
#[derive(Clone, Copy, Default)]
struct Tile {
    pixels: [u32; 2],
    sums: [[u32; 2]; 2],
}

impl Tile {
    /// Contrasts in image and reference; `None` if a band has too few pixels.
    fn contrasts(&self) -> Option<[f64; 2]> {
        let enough = self.pixels.iter().all(|&n| n >= PIXELS_MIN);
        let mean = |sums: [u32; 2], side: usize| f64::from(sums[side]) / f64::from(self.pixels[side]);
        enough.then(|| self.sums.map(|sums| mean(sums, 0) - mean(sums, 1)))
    }
}

fn tiles(
    [image, reference, segmentation]: [&[u8]; 3],
    [width, height]: [usize; 2],
    class: u8,
    of_class: &PixelCounts,
) -> Vec<Tile> {
    let across = width.div_ceil(TILE);
    let mut tiles = vec![Tile::default(); across * height.div_ceil(TILE)];
    let about = |position: usize, limit: usize| position.saturating_sub(BAND)..(position + BAND + 1).min(limit);
    for row in 0..height {
        for column in 0..width {
            let index = row * width + column;
            let label = segmentation[index];
            if label == 0 {
                continue;
            }
            let (columns, rows) = (about(column, width), about(row, height));
            let all = (columns.len() * rows.len()) as u32;
            let of_class = of_class.within(columns, rows);
            let (side, in_band) = if label == class { (0, of_class < all) } else { (1, of_class > 0) };
            if in_band {
                let tile = &mut tiles[row / TILE * across + column / TILE];
                tile.pixels[side] += 1;
                tile.sums[0][side] += u32::from(image[index]);
                tile.sums[1][side] += u32::from(reference[index]);
            }
        }
    }
    tiles
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [usize; 2] = [128, 128];

    /// A square of tissue 2 within tissue 1, with the grey levels `inside` and `outside`.
    fn picture(inside: u8, outside: u8) -> Vec<u8> {
        map(|square| if square { inside } else { outside })
    }

    fn map(value: impl Fn(bool) -> u8) -> Vec<u8> {
        let square = |i: usize| (30..90).contains(&(i % 128)) && (30..90).contains(&(i / 128));
        (0..128 * 128).map(|i| value(square(i))).collect()
    }

    fn lost(image: &[u8], reference: &[u8]) -> Vec<Option<f64>> {
        let segmentation = map(|square| 1 + u8::from(square));
        structures(image, reference, &segmentation, SIZE).unwrap().iter().map(|c| c.contrast_lost).collect()
    }

    #[test]
    fn lost_contrast_is_a_share() {
        let reference = picture(100, 60);
        assert_eq!(lost(&reference, &reference), [Some(0.0); 2]);
        assert_eq!(lost(&picture(80, 70), &reference), [Some(0.75); 2]);
        assert_eq!(lost(&picture(0, 0), &reference), [Some(1.0); 2]);
        assert_eq!(lost(&picture(60, 100), &reference), [Some(1.0); 2]);
        assert_eq!(lost(&picture(250, 10), &reference), [Some(0.0); 2]);
        assert_eq!(lost(&reference, &picture(60, 60)), [None; 2]);
    }

    #[test]
    fn grey_differences_are_by_tissue() {
        let segmentation = map(|square| 1 + u8::from(square));
        let found = structures(&picture(90, 64), &picture(100, 60), &segmentation, SIZE).unwrap();
        assert_eq!(found.iter().map(|c| (c.class, c.grey_difference)).collect::<Vec<_>>(), [(1, 4.0), (2, -10.0)]);
        assert_eq!(found[1].contrast, Some(40.0));
        assert_eq!(contrast_lost(&found), Some(14.0 / 40.0));
        assert_eq!(contrast_lost(&[]), None);
    }

    #[test]
    fn the_rim_of_the_sector_is_no_border() {
        let segmentation = map(u8::from);
        let found = structures(&picture(9, 0), &picture(100, 0), &segmentation, SIZE).unwrap();
        assert_eq!((found.len(), found[0].contrast), (1, None));
    }

    #[test]
    fn sizes_are_checked() {
        assert!(structures(&[0; 4], &[0; 4], &[0; 5], [2, 2]).is_err());
        assert_eq!(structures(&[], &[], &[], [0, 0]), Ok(Vec::new()));
    }
}
