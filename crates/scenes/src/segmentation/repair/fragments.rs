//! Removal of parts that are too thin, or too small compared with the largest part.

use super::edges;
use super::orient::{self, Part};
use super::report::ActionKind;
use super::work::{Work, region};

/// Mean thickness below which the tracer cannot distinguish the two sides of a part, mm.
const THIN_MM: f64 = 2e-3;

/// Removes parts without thickness, and fragments: parts below the fraction `share` of the largest part's volume. Parts
/// with a rim stay: they may be pieces of a surface with holes. So do parts that close others.
pub(super) fn drop_fragments(work: &mut Work, share: f64) {
    let (parts, part_of) = orient::parts(&work.mesh);
    let largest = parts.iter().map(|part| part.volume_mm3.abs()).fold(0.0, f64::max);
    // A thin part's area counts both of its sides, so volume / (area / 2) is its thickness.
    let is_flat = |part: &Part| 2.0 * part.volume_mm3.abs() < THIN_MM * part.area_mm2;
    let is_fragment = |part: &Part| part.volume_mm3.abs() < share * largest;
    let loose: Vec<bool> = parts.iter().map(|part| !part.has_rim && (is_flat(part) || is_fragment(part))).collect();
    let needed = needed(work, &loose, &part_of);
    let (flat, fragments): (Vec<usize>, Vec<usize>) =
        (0..parts.len()).filter(|&i| loose[i] && !needed[i]).partition(|&i| is_flat(&parts[i]));
    if flat.is_empty() && fragments.is_empty() {
        return;
    }
    let mut gone = vec![false; parts.len()];
    flat.iter().chain(&fragments).for_each(|&i| gone[i] = true);
    let keep: Vec<bool> = part_of.iter().map(|&index| !gone[index as usize]).collect();
    work.retain(&keep);
    let at = |list: &[usize]| list.iter().map(|&i| region(parts[i].bounds.corners())).collect::<Vec<_>>();
    work.log(ActionKind::Flat, flat.len(), at(&flat));
    work.log(ActionKind::Crumb, fragments.len(), at(&fragments));
}

/// For each part, whether some edge would have an odd number of triangles without the loose parts.
fn needed(work: &Work, loose: &[bool], part_of: &[u32]) -> Vec<bool> {
    let mut needed = vec![false; loose.len()];
    let edges = edges::sorted(&work.mesh.triangles);
    for group in edges::groups(&edges).filter(|group| group.len() > 2) {
        let part = |edge: &edges::Edge| part_of[edge.triangle as usize] as usize;
        if group.iter().filter(|edge| !loose[part(edge)]).count() % 2 == 1 {
            group.iter().for_each(|edge| needed[part(edge)] = true);
        }
    }
    needed
}
