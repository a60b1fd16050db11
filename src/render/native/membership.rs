//! Which surfaces a point is inside, as `shaders/shared/surfaces.wgsl` has it.

use super::traverse::{Crossing, TOUCH_MM};
use crate::anatomy::bvh::PackedTriangle;

/// The surfaces that a point is inside, a bit each; the highest one is the medium.
pub(super) type Inside = [u32; 8];

/// The highest of the surfaces: below it, a path meets nothing that it would notice.
#[inline(always)]
pub(super) fn highest(inside: &Inside) -> Option<u32> {
    let word = (0..8).rev().find(|&word| inside[word] != 0)?;
    Some(32 * word as u32 + inside[word].ilog2())
}

/// Tissue of the medium, and [`MOVES`](crate::render::configuration::MOVES) where its surface moves.
#[inline(always)]
pub(super) fn medium_word(surface_words: &[u32], background: u32, inside: &Inside) -> u32 {
    highest(inside).map_or(background, |surface| surface_words[surface as usize])
}

/// Applies all of a place. A surface that is entered and left at one place is a crease or a silhouette: it stays as it was.
#[inline(always)]
pub(super) fn cross(triangles: &[PackedTriangle], place: &[Crossing], inside: &mut Inside) {
    let surface = |crossing: &Crossing| triangles[crossing.triangle as usize].surface;
    for crossing in place {
        let same = surface(crossing);
        let any = |enters: bool| place.iter().any(|c| c.enters == enters && surface(c) == same);
        let entered = any(true);
        if entered != any(false) {
            let (word, bit) = ((same >> 5) as usize, 1 << (same & 31));
            inside[word] = if entered { inside[word] | bit } else { inside[word] & !bit };
        }
    }
}

/// Applies crossings in the order of their distances, place by place.
#[inline(always)]
pub(super) fn cross_all(triangles: &[PackedTriangle], mut ahead: &[Crossing], inside: &mut Inside) {
    while let Some(first) = ahead.first() {
        let limit = first.t + TOUCH_MM;
        let (place, rest) = ahead.split_at(ahead.partition_point(|c| c.t <= limit));
        cross(triangles, place, inside);
        ahead = rest;
    }
}
