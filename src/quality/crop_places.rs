//! Random positions, within the sector, of the crops in which images are compared, as in the paper.

use super::QualityError;
use super::error::{check_holds, check_sizes};
use super::pixel_counts::PixelCounts;
use crate::random::SplitMix64;

/// Side of a crop in the paper, pixels.
pub const CROP_SIDE: usize = 512;
/// Number of crops per image in the paper.
pub const CROP_COUNT: usize = 4;
/// Smallest share of a crop's pixels inside the mask, if the mask allows it.
pub const CROP_INSIDE: f64 = 0.5;
/// Number of draws per crop; after them the best one is used.
const DRAWS: usize = 200;

/// Left and top of `count` crops of `side` × `side` pixels at random positions in an image [height × width]. The same
/// `seed` gives the same positions. At least the share [`CROP_INSIDE`] of a crop is inside `mask` (not 0). If 200
/// draws find no such position, the one with the most pixels inside is used. Crops may overlap.
///
/// # Errors
/// The image is smaller than a crop, the mask has another size, or the mask has no pixel inside.
pub(crate) fn crop_places(
    mask: &[u8],
    size: [usize; 2],
    side: usize,
    count: usize,
    seed: u64,
) -> Result<Vec<[usize; 2]>, QualityError> {
    check_sizes(size, &[("mask", mask)])?;
    check_holds(size, side, "a crop")?;
    if mask.iter().all(|&m| m == 0) {
        return Err(QualityError::EmptyMask);
    }
    let [width, height] = size;
    let mut counts = PixelCounts::new(size);
    counts.count(mask, |value| value > 0);
    let inside = |[left, top]: [usize; 2]| counts.within(left..left + side, top..top + side);
    let least = (CROP_INSIDE * (side * side) as f64).ceil() as u32;
    let mut random = SplitMix64::new(seed);
    let mut draw = |room: usize| ((random.unit() * (room + 1) as f64) as usize).min(room);
    let mut position = || {
        let mut best = [0, 0];
        let mut most = None;
        for _ in 0..DRAWS {
            let position = [draw(width - side), draw(height - side)];
            let found = inside(position);
            if most.is_none_or(|most| found > most) {
                (best, most) = (position, Some(found));
            }
            if found >= least {
                return position;
            }
        }
        best
    };
    Ok((0..count).map(|_| position()).collect())
}

/// Crop [side × side] of a map [height × width] with its upper left corner at `[left, top]`, clipped to the map.
pub fn cut<T: Copy>(map: &[T], width: usize, [left, top]: [usize; 2], side: usize) -> Vec<T> {
    let rows = map.chunks_exact(width.max(1)).skip(top).take(side);
    rows.flat_map(|row| row.iter().skip(left).take(side)).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crops_lie_in_the_sector_and_come_again() {
        let size = [60, 40];
        let mask: Vec<u8> = (0..2400).map(|i| if i % 60 >= 40 { 255 } else { 0 }).collect();
        let of = |seed| crop_places(&mask, size, 16, 50, seed).unwrap();
        let positions = of(1);
        assert_eq!((positions.len(), &positions), (50, &of(1)));
        assert_ne!(positions, of(2));
        assert!(positions.iter().all(|&[left, top]| (32..=44).contains(&left) && top <= 24), "{positions:?}");
        assert!(positions.iter().any(|p| p[0] == 44) && positions.iter().any(|p| p[1] > 15));
        let share = |p: [usize; 2]| cut(&mask, 60, p, 16).iter().filter(|&&m| m > 0).count();
        assert!(positions.iter().all(|&p| 2 * share(p) >= 256));
    }

    #[test]
    fn a_narrow_sector_gives_the_best_positions_and_none_is_an_error() {
        let mut mask = vec![0; 2400];
        mask[20 * 60 + 30] = 1;
        let positions = crop_places(&mask, [60, 40], 30, 4, 3).unwrap();
        assert!(positions.iter().all(|&p| cut(&mask, 60, p, 30).contains(&1)), "{positions:?}");
        assert_eq!(crop_places(&[0; 2400], [60, 40], 30, 4, 3), Err(QualityError::EmptyMask));
        assert!(crop_places(&mask, [60, 40], 41, 4, 3).is_err() && crop_places(&mask, [60, 41], 8, 4, 3).is_err());
        assert_eq!(crop_places(&mask, [60, 40], 40, 1, 3).unwrap()[0][1], 0);
    }

    #[test]
    fn a_crop_is_cut_out() {
        let map: Vec<u8> = (0..20).collect();
        assert_eq!(cut(&map, 5, [1, 2], 2), [11, 12, 16, 17]);
        assert_eq!(cut(&map, 5, [4, 3], 2), [19]);
    }
}
