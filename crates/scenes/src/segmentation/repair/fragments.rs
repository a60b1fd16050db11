//! Removal of parts that are too thin, or too small compared with the largest part.

use super::orient::{self, Part};
use super::report::ActionKind;
use super::work::{Work, region};

/// Mean thickness below which the tracer cannot distinguish the two sides of a part, mm.
const THIN_MM: f64 = 2e-3;

/// Removes parts without thickness, and fragments: parts below the fraction `share` of the largest part's volume.
pub(super) fn drop_fragments(work: &mut Work, share: f64) {
    let (parts, part_of) = orient::parts(&work.mesh);
    let largest = parts.iter().map(|part| part.volume_mm3.abs()).fold(0.0, f64::max);
    // A thin part's area counts both of its sides, so volume / (area / 2) is its thickness.
    let is_flat = |part: &Part| 2.0 * part.volume_mm3.abs() < THIN_MM * part.area_mm2;
    let is_fragment = |part: &Part| part.volume_mm3.abs() < share * largest;
    let flat: Vec<usize> = (0..parts.len()).filter(|&i| is_flat(&parts[i])).collect();
    let fragments: Vec<usize> = (0..parts.len()).filter(|&i| !is_flat(&parts[i]) && is_fragment(&parts[i])).collect();
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
