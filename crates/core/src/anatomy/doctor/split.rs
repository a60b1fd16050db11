//! Detection of objects that are closed as a whole, but whose surfaces of each material are not.

use std::collections::{BTreeMap, HashMap};

use glam::Vec3;

use super::finding::{Defect, Finding};
use super::surface_check::SurfaceCheck;

/// Undirected edge: the bits of its ends' coordinates, the lower end first.
type Key = [[u32; 3]; 2];

/// Reports surfaces of one glTF node whose open edges match each other. If all open edges of a surface match, the
/// report replaces the surface's finding about a hole.
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

/// Key of an edge, and 1 or −1 for its direction.
fn keyed(edge: &[Vec3; 2]) -> (Key, i32) {
    // Adding zero turns −0 into 0.
    let [a, b] = edge.map(|v| (v + Vec3::ZERO).to_array().map(f32::to_bits));
    if a < b { ([a, b], 1) } else { ([b, a], -1) }
}
