//! Which surfaces a point is inside, as `shaders/shared/surfaces.wgsl` has it.

use super::traverse::Crossing;
use crate::anatomy::bvh::PackedTriangle;

/// The surfaces that a point is inside, a bit each; the highest one is the medium.
pub(super) type Inside = [u32; 8];

/// Tissue of the medium, and [`MOVES`](crate::render::configuration::MOVES) where its surface moves.
#[inline(always)]
pub(super) fn medium_word(surface_words: &[u32], background: u32, inside: &Inside) -> u32 {
    let highest = (0..8).rev().find(|&word| inside[word] != 0);
    highest.map_or(background, |word| surface_words[32 * word + inside[word].ilog2() as usize])
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
