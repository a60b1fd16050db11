//! Thin sheets between organs: the diaphragm, and the valves of the heart.

use serde::Deserialize;

use insonify_core::anatomy::{Bounds, Mesh};

use super::field::{FAR_MM, Field, Inside, intersection_mm, surface};
use super::{Part, outer};
use crate::segmentation::from_labels::Made;

/// The sheets: what lies within one organ and near another.
const TABLE: &str = include_str!("../../../assets/labels/sheets.toml");
/// Voxels across a sheet.
const VOXELS: f64 = 2.5;

/// A sheet: what is at most `mm` deep in one of the organs `within`, and as near to one of the organs `near`. Where the two
/// are apart, it fills a gap of up to `gap_mm`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Sheet {
    part: String,
    name: String,
    tissue: String,
    mm: f64,
    #[serde(default)]
    gap_mm: f64,
    within: Vec<String>,
    near: Vec<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    sheet: Vec<Sheet>,
}

fn sheets() -> Vec<Sheet> {
    toml::from_str::<File>(TABLE).map(|file| file.sheet).unwrap_or_default()
}

/// Sheets of the part called `part`, of the organs that the patient has.
pub(super) fn parts(surfaces: &[Made], part: &str) -> Vec<Part> {
    let mut parts = Vec::new();
    for sheet in sheets().into_iter().filter(|sheet| sheet.part == part) {
        let near: Vec<&Mesh> = sheet.near.iter().filter_map(|name| outer(surfaces, name)).map(|m| &m.mesh).collect();
        for within in sheet.within.iter().filter_map(|name| outer(surfaces, name)) {
            let reach_mm = sheet.mm.max(sheet.gap_mm);
            let Some(bounds) = common(&within.mesh, &near, reach_mm) else { continue };
            let (own, others) = (Inside::of([&within.mesh]), Inside::of(near.iter().copied()));
            // Within the other organs the sheet doesn't count: their priority is higher, or nothing is common.
            let near_mm = |at_mm| reach_mm - others.distance_mm(at_mm, reach_mm + FAR_MM);
            let field = |at_mm| {
                intersection_mm(near_mm(at_mm), || {
                    let depth_mm = own.depth_mm(at_mm);
                    (depth_mm + sheet.gap_mm).min(sheet.mm - depth_mm)
                })
            };
            let mesh = surface(&field, bounds, sheet.mm / VOXELS);
            let name = if sheet.within.len() > 1 {
                format!("{}_{}", sheet.name, within.segment.as_deref().unwrap_or_default())
            } else {
                sheet.name.clone()
            };
            parts.push(Part { name, tissue: sheet.tissue.clone(), within: within.segment.clone(), above: 0, mesh });
        }
    }
    parts
}

/// Box of the points that may lie at most `mm` from a mesh and from one of the meshes `near`.
fn common(within: &Mesh, near: &[&Mesh], mm: f64) -> Option<Bounds> {
    let own = within.bounds_mm()?;
    let all = near.iter().filter_map(|mesh| mesh.bounds_mm()).reduce(|a, b| Bounds::with(a.with(b.min), b.max))?;
    let all = Bounds { min: all.min - mm as f32, max: all.max + mm as f32 };
    let own = Bounds { min: own.min - mm as f32, max: own.max + mm as f32 };
    let bounds = Bounds { min: own.min.max(all.min), max: own.max.min(all.max) };
    bounds.min.cmple(bounds.max).all().then_some(bounds)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use insonify_core::anatomy::TissueTable;
    use insonify_core::anatomy::analytic::cuboid;

    use super::*;
    use crate::segmentation::details::tests::organ;

    #[test]
    fn each_sheet_has_a_part_that_can_be_left_out_and_a_tissue() {
        let tissues = TissueTable::builtin().unwrap();
        assert!(sheets().len() >= 5);
        for sheet in sheets() {
            assert!(
                crate::segmentation::part_kinds::PART_KINDS.iter().any(|part| part.name == sheet.part),
                "{sheet:?}"
            );
            assert!(tissues.index_of(&sheet.tissue).is_some(), "{sheet:?}");
        }
    }

    #[test]
    fn the_diaphragm_is_the_lungs_side_of_the_border_to_the_liver() {
        // A lung of 60 × 50 × 40 mm upon a liver of 100 × 100 × 40 mm, which it touches.
        let surfaces = [
            organ(
                "lung_lower_lobe_right",
                "lung_aerated",
                cuboid(Vec3::new(-30.0, -25.0, 0.0), Vec3::new(30.0, 25.0, 40.0)),
            ),
            organ("liver", "liver", cuboid(Vec3::new(-50.0, -50.0, -40.0), Vec3::new(50.0, 50.0, 0.0))),
        ];
        let parts = parts(&surfaces, "diaphragm");
        let [part] = &parts[..] else { panic!("{parts:?}") };
        let mm = sheets().into_iter().find(|sheet| sheet.part == "diaphragm").unwrap().mm;
        // What lies in the liver, and beside the lung, doesn't count.
        let height_mm = |part: &Part| {
            let within = part.mesh.vertices_mm.iter().filter(|v| v.x.abs() < 20.0 && v.y.abs() < 15.0);
            within
                .map(|v| f64::from(v.z))
                .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], z| [low.min(z), high.max(z)])
        };
        let [low, high] = height_mm(part);
        assert!(low < 0.1 && (high - mm).abs() < 0.15, "{low} {high}");
        assert_eq!(part.within.as_deref(), Some("lung_lower_lobe_right"));
        assert_eq!(part.mesh.unpaired_edges(), 0);
        // In a gap of 3 mm it reaches from the liver into the lung.
        let mut apart = surfaces;
        apart[0].mesh.vertices_mm.iter_mut().for_each(|v| v.z += 3.0);
        let [low, high] = height_mm(&super::parts(&apart, "diaphragm")[0]);
        assert!(low < 0.1 && (3.1..5.1).contains(&high), "{low} {high}");
        // A lung that ends 23 mm above the liver has none.
        apart[0].mesh.vertices_mm.iter_mut().for_each(|v| v.z += 20.0);
        assert!(super::parts(&apart, "diaphragm").iter().all(|part| part.mesh.triangles.is_empty()));
    }
}
