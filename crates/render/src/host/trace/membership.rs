//! Surfaces that a point is inside, as in `shaders/shared/surfaces.wgsl`.

use insonify_core::anatomy::bvh::PackedTriangle;
use insonify_core::simd::exp;

use super::traverse::Crossing;
use crate::host::constants::{GAP_MAX_MM, GAP_NP_MM, TOUCH_MM};

/// The surfaces that a point is inside, one bit each; the highest one is the medium.
pub(in crate::host) type Inside = [u32; 8];

/// Index of the highest surface; `None` outside of all. Crossings of lower surfaces don't change the medium.
#[inline(always)]
pub(super) fn highest(inside: &Inside) -> Option<u32> {
    let word = (0..8).rev().find(|&word| inside[word] != 0)?;
    Some(32 * word as u32 + inside[word].ilog2())
}

/// One-way amplitude that the face passes to a ray, 0..=1. The ray starts `face_depth_mm` below the face's apex and
/// goes `down` mm deeper per mm. Inside a surface the result is 1. Else the nearest of the crossings `ahead`, sorted by
/// distance, decides.
#[inline(always)]
pub(in crate::host) fn coupling(
    film_mm: f32,
    face_depth_mm: f32,
    down: f32,
    inside: &Inside,
    ahead: &[Crossing],
) -> f32 {
    if film_mm < 0.0 || highest(inside).is_some() {
        return 1.0;
    }
    let gap_mm = ahead.first().map_or(f32::MAX, |first| (face_depth_mm + down * first.t - film_mm).max(0.0));
    if gap_mm >= GAP_MAX_MM {
        return 0.0;
    }
    exp(-GAP_NP_MM * gap_mm * gap_mm / (1.0 + gap_mm))
}

/// Distance to the farthest crossing ahead that may couple a ray, mm; arguments as in [`coupling`].
#[inline(always)]
pub(super) fn film_reach_mm(film_mm: f32, face_depth_mm: f32, down: f32) -> f32 {
    if film_mm < 0.0 { 0.0 } else { ((film_mm + GAP_MAX_MM - face_depth_mm) / down.max(0.1)).max(0.0) }
}

/// Tissue of the highest surface, with [`MOVES`](crate::constants::MOVES) if it moves; `background` outside of all.
#[inline(always)]
pub(in crate::host) fn medium_word(surface_words: &[u32], background: u32, inside: &Inside) -> u32 {
    highest(inside).map_or(background, |surface| surface_words[surface as usize])
}

/// Enters and leaves surfaces at coincident crossings. A surface both entered and left there has a crease or a
/// silhouette: its membership is unchanged.
#[inline(always)]
pub(in crate::host) fn cross(triangles: &[PackedTriangle], coincident: &[Crossing], inside: &mut Inside) {
    let surface = |crossing: &Crossing| triangles[crossing.triangle as usize].surface;
    for crossing in coincident {
        let same = surface(crossing);
        let any = |enters: bool| coincident.iter().any(|c| c.enters == enters && surface(c) == same);
        let entered = any(true);
        if entered != any(false) {
            let (word, bit) = ((same >> 5) as usize, 1 << (same & 31));
            inside[word] = if entered { inside[word] | bit } else { inside[word] & !bit };
        }
    }
}

/// Applies crossings, sorted by distance, in coincident groups, up to the first group that reaches `t`. Returns the
/// number of groups, the end of the last group (mm), and the remaining crossings.
#[inline(always)]
pub(super) fn cross_until<'a>(
    triangles: &[PackedTriangle],
    mut ahead: &'a [Crossing],
    t: f32,
    inside: &mut Inside,
) -> (u32, f32, &'a [Crossing]) {
    let (mut groups, mut end) = (0, f32::NEG_INFINITY);
    while let Some(first) = ahead.first() {
        let limit = first.t + TOUCH_MM;
        if limit >= t {
            break;
        }
        let (coincident, rest) = ahead.split_at(ahead.partition_point(|c| c.t <= limit));
        cross(triangles, coincident, inside);
        (groups, end, ahead) = (groups + 1, limit, rest);
    }
    (groups, end, ahead)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A triangle of each of three surfaces.
    fn triangles() -> Vec<PackedTriangle> {
        (0..3).map(|surface| PackedTriangle { surface, ..bytemuck::Zeroable::zeroed() }).collect()
    }

    fn at(t: f32, triangle: u32, enters: bool) -> Crossing {
        Crossing { t, triangle, enters }
    }

    #[test]
    fn groups_that_end_before_the_crossing_are_passed_and_the_one_that_reaches_it_is_left() {
        let triangles = triangles();
        let touch = TOUCH_MM;
        // Two entries, a crease of the third surface, and an exit TOUCH_MM before the crossing.
        let crossings = [
            at(10.0, 0, true),
            at(10.0 + 0.5 * touch, 1, true),
            at(20.0, 2, true),
            at(20.0 + 0.9 * touch, 2, false),
            at(30.0 - touch, 0, false),
        ];
        let mut inside = [0; 8];
        let (groups, end, rest) = cross_until(&triangles, &crossings, 30.0, &mut inside);
        assert_eq!((groups, end, rest, inside[0]), (2, 20.0 + touch, &crossings[4..], 0b11));
        // Slightly farther on, that exit is a separate group.
        let (groups, _, rest) = cross_until(&triangles, rest, 30.0 + touch, &mut inside);
        assert_eq!((groups, rest, inside[0]), (1, &crossings[5..], 0b10));
    }

    #[test]
    fn the_highest_is_the_highest_bit() {
        assert_eq!(highest(&[0; 8]), None);
        assert_eq!(highest(&[1, 0, 0, 0, 0, 0, 0, 0]), Some(0));
        assert_eq!(highest(&[u32::MAX, 0, 0b101, 0, 0, 0, 0, 0]), Some(66));
    }
}
