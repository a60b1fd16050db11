//! Parts of organs that no label shows, made from the surfaces of the organs: sheets between organs, the inside of the
//! kidneys, and the vessels of the liver.
//!
//! Capsules and layers of walls are parts as well; the tables of classes have them as layers of `wall`. All parts are
//! assumed: they have the usual size and place in adults. Each can be left out by its name.

mod field;
mod kidney;
mod liver_vessels;
mod sheets;

use glam::DVec3;
use insonify_core::anatomy::Mesh;
use rayon::prelude::*;

use super::from_labels::{Made, PARTS as ABOVE};
use super::part_kinds::{PART_KINDS, PartKind};

/// Least volume of a part, mm³.
const LEAST_MM3: f64 = 200.0;

/// A part of an organ.
#[derive(Debug, Clone, PartialEq)]
struct Part {
    name: String,
    tissue: String,
    /// Name of the segment that the part lies in.
    within: Option<String>,
    /// Number of parts of the organ that lie below this one where they overlap.
    above: i32,
    mesh: Mesh,
}

/// Outer surface of a segment.
fn outer<'a>(surfaces: &'a [Made], segment: &str) -> Option<&'a Made> {
    surfaces.iter().find(|made| made.segment.as_deref() == Some(segment) && made.voxels_mm3.is_some())
}

/// Adds the parts of the organs to `surfaces`, except those of the kinds `without` and those that segments show already.
/// A sentence names the kinds of all parts, including layers of walls.
pub fn add(surfaces: &mut Vec<Made>, without: &[String]) -> Option<String> {
    let is_labelled = |kind: &PartKind| {
        let names = surfaces.iter().filter_map(|made| made.segment.as_deref());
        names.into_iter().any(|name| kind.labelled.iter().any(|labelled| name.starts_with(labelled)))
    };
    let made: Vec<(&str, Vec<Part>)> = PART_KINDS
        .par_iter()
        .filter(|kind| kind.layer.is_none() && !without.iter().any(|name| name == kind.name) && !is_labelled(kind))
        .map(|kind| match kind.name {
            "kidney" => (kind.name, kidney::parts(surfaces)),
            "liver_vessels" => (kind.name, liver_vessels::parts(surfaces)),
            name => (name, sheets::parts(surfaces, name)),
        })
        .collect();
    let has_layer = |tissue: &str| surfaces.iter().any(|made| made.tissue == tissue);
    let layers = PART_KINDS.iter().filter(|kind| kind.layer.is_some_and(has_layer)).map(|kind| kind.name);
    let mut kinds: Vec<&str> = layers.collect();
    for (kind, parts) in made {
        for Part { name, tissue, within, above, mesh } in parts {
            let organ = within.as_deref().and_then(|name| outer(surfaces, name));
            let Some(priority) = organ.map(|made| made.priority + ABOVE + above) else { continue };
            // A segment of the part's name may be anything.
            if mesh.signed_volume_mm3() < LEAST_MM3 || surfaces.iter().any(|made| made.name == name) {
                continue;
            }
            surfaces.push(Made { name, tissue, priority, mesh, segment: within, voxels_mm3: None });
            kinds.extend((!kinds.contains(&kind)).then_some(kind));
        }
    }
    surfaces.sort_by_key(|made| made.priority);
    let words = kinds.join(", ");
    (!kinds.is_empty()).then(|| format!("assumed, as no label shows it: {words} (--without leaves them out)"))
}

/// Points of `of` at least `apart_mm` from each other, each the farthest from those before it.
fn spread(of: &[DVec3], apart_mm: f64) -> Vec<DVec3> {
    let mut away_mm = vec![f64::INFINITY; of.len()];
    let mut found = Vec::new();
    while let Some((at, &far_mm)) = away_mm.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1).then(b.0.cmp(&a.0))) {
        if far_mm < apart_mm {
            break;
        }
        found.push(of[at]);
        for (away_mm, point) in away_mm.iter_mut().zip(of) {
            *away_mm = away_mm.min(point.distance(of[at]));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use insonify_core::anatomy::analytic::cuboid;

    use super::*;
    use crate::segmentation::classes::ClassTable;

    /// A segment with its outer surface, for tests.
    pub(super) fn organ(name: &str, tissue: &str, mesh: Mesh) -> Made {
        let voxels_mm3 = Some(mesh.signed_volume_mm3());
        let (segment, name, tissue) = (Some(name.to_owned()), name.to_owned(), tissue.to_owned());
        Made { name, tissue, priority: 100, mesh, segment, voxels_mm3 }
    }

    #[test]
    fn every_layer_that_tables_name_can_be_left_out() {
        // It has the names of all tables.
        let table = ClassTable::builtin("total-v2").unwrap();
        let layers = || table.classes().iter().flat_map(|class| &class.wall).filter_map(|layer| layer.part.as_deref());
        for part in layers() {
            assert!(PART_KINDS.iter().any(|kind| kind.name == part && kind.layer.is_some()), "{part}");
        }
        for part in ["capsule", "gut_layers", "pericardium", "pleura"] {
            assert!(layers().any(|layer| layer == part), "{part}");
            let mut without = table.clone();
            without.leave_out(&[part.to_owned()]);
            assert!(without.classes().iter().flat_map(|class| &class.wall).all(|l| l.part.as_deref() != Some(part)));
            // The gut's wall stays as thick as it was.
            let stomach_mm =
                |table: &ClassTable| table.named("stomach").unwrap().wall.iter().map(|l| l.mm).sum::<f64>();
            assert!((stomach_mm(&without) - stomach_mm(&table)).abs() < 1e-12);
        }
    }

    #[test]
    fn parts_lie_above_their_organ_and_below_the_next_and_can_be_left_out() {
        let surfaces = vec![
            organ("lung_right", "lung_aerated", cuboid(Vec3::splat(-30.0), Vec3::new(30.0, 30.0, 0.0))),
            organ("liver", "liver", cuboid(Vec3::new(-40.0, -40.0, 0.0), Vec3::splat(40.0))),
        ];
        let mut with = surfaces.clone();
        let said = add(&mut with, &[]).unwrap();
        let sheet = with.iter().find(|made| made.name.starts_with("diaphragm")).unwrap();
        assert!(said.contains("diaphragm") && sheet.segment.as_deref() == Some("lung_right"), "{said}");
        assert!(sheet.priority > surfaces[0].priority && sheet.priority < surfaces[0].priority + 10);
        assert_eq!(with.len(), 3);
        let mut without = surfaces.clone();
        assert_eq!(add(&mut without, &["diaphragm".to_owned()]), None);
        assert_eq!(without, surfaces);
        // Nor is a part added that a label shows.
        let mut labelled = surfaces.clone();
        labelled.push(organ("diaphragm", "muscle", cuboid(Vec3::splat(-30.0), Vec3::new(30.0, 30.0, 1.0))));
        let before = labelled.clone();
        assert_eq!(add(&mut labelled, &[]), None);
        assert_eq!(labelled, before);
    }

    #[test]
    fn spread_points_keep_their_distance_and_leave_no_gap() {
        let line: Vec<DVec3> = (0..100).map(|n| DVec3::X * f64::from(n)).collect();
        let found = spread(&line, 10.0);
        assert!(found.iter().all(|p| found.iter().filter(|q| q.distance(*p) < 10.0).count() == 1), "{found:?}");
        assert!(line.iter().all(|p| found.iter().any(|q| q.distance(*p) < 10.0)));
        assert!(spread(&[], 1.0).is_empty());
    }
}
