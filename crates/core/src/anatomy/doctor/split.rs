//! Detection of objects that are closed as a whole, but not in each of their materials.

use std::collections::{BTreeMap, HashMap};

use glam::Vec3;

use super::finding::{Defect, Finding};
use super::surface_check::SurfaceCheck;

/// Edge as the bits of its corners, the lower corner first.
type Key = [[u32; 3]; 2];

/// Checks whether open edges of surfaces of one node match each other. If so, the finding about a hole is replaced.
pub(super) fn find(checks: &mut [SurfaceCheck]) {
    let mut of_node = BTreeMap::<usize, Vec<usize>>::new();
    for (index, check) in checks.iter().enumerate().filter(|(_, p)| !p.open_mm.is_empty()) {
        of_node.entry(check.node).or_default().push(index);
    }
    for siblings in of_node.into_values().filter(|siblings| siblings.len() > 1) {
        let mut balance = HashMap::<Key, i32>::new();
        for edge in siblings.iter().flat_map(|&index| &checks[index].open_mm) {
            let (key, turn) = keyed(edge);
            *balance.entry(key).or_default() += turn;
        }
        for index in siblings {
            let check = &mut checks[index];
            let total = check.open_mm.len();
            let joined = check.open_mm.iter().filter(|edge| balance[&keyed(edge).0] == 0).count();
            if joined == 0 {
                continue;
            }
            if joined == total {
                check.findings.retain(|f| f.defect != Defect::Open);
            }
            let what = format!(
                "split by material: {joined} of its {total} open edges go on in other materials of the same object"
            );
            check.report(Finding::new(Defect::SplitByMaterial, what));
        }
    }
}

/// Undirected edge and its direction.
fn keyed(edge: &[Vec3; 2]) -> (Key, i32) {
    // Adding zero turns −0 into 0.
    let [a, b] = edge.map(|v| (v + Vec3::ZERO).to_array().map(f32::to_bits));
    if a < b { ([a, b], 1) } else { ([b, a], -1) }
}
