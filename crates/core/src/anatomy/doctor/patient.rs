//! Volumes and positions of a patient's organs.

use glam::DVec3;

use super::{Defect, Finding, Region};
use crate::anatomy::organs::{Aspect, OrganFact, check_organs, is_known};
use crate::anatomy::{Bounds, Mesh};

/// Distance from the scene's bounds below which an organ counts as cut off by the scan, mm.
const BORDER_MM: f32 = 1.5;

/// Findings about the organs among `surfaces`: the names and meshes of a scene's closed surfaces, LPS, mm. If an organ
/// has a wall, the outer surface of the wall is measured.
pub(super) fn examine<'a>(surfaces: impl Iterator<Item = (&'a str, &'a Mesh)>, scene: Option<Bounds>) -> Vec<Finding> {
    let surfaces: Vec<(&str, &Mesh)> = surfaces.collect();
    let named = |name: &str| surfaces.iter().find(|(other, _)| *other == name);
    let facts: Vec<OrganFact> = surfaces
        .iter()
        .filter(|(name, _)| name.strip_suffix("_wall").is_none_or(|organ| named(organ).is_none()))
        .filter_map(|&(name, mesh)| {
            let outer = named(&format!("{name}_wall")).map_or(mesh, |(_, wall)| *wall);
            fact(name, outer, scene)
        })
        .collect();
    let finding = |found: crate::anatomy::organs::OrganFinding| {
        let defect = match found.aspect {
            Aspect::Volume | Aspect::Scale => Defect::UnusualVolume,
            Aspect::Side | Aspect::Position => Defect::UnusualPosition,
        };
        let at = facts.iter().find(|fact| fact.name == found.organ);
        let region = at.map(|fact| Region { at_mm: fact.centre_mm.as_vec3().to_array(), size_mm: 0.0 });
        Finding::new(defect, found.what).at(region)
    };
    let mut findings: Vec<Finding> = check_organs(&facts).into_iter().map(finding).collect();
    findings.extend(outside(&facts, named("skin").and_then(|(_, skin)| skin.bounds_mm())));
    findings
}

/// Findings about organs whose centre of mass lies outside the bounds of the skin.
fn outside(facts: &[OrganFact], skin: Option<Bounds>) -> Vec<Finding> {
    let Some(skin) = skin else { return Vec::new() };
    let is_outside = |fact: &&OrganFact| {
        let centre_mm = fact.centre_mm.as_vec3();
        is_known(&fact.name) && (centre_mm.cmplt(skin.min).any() || centre_mm.cmpgt(skin.max).any())
    };
    let finding = |fact: &OrganFact| {
        let region = Region { at_mm: fact.centre_mm.as_vec3().to_array(), size_mm: 0.0 };
        Finding::new(Defect::UnusualPosition, format!("`{}` lies outside the skin", fact.name)).at([region])
    };
    facts.iter().filter(is_outside).map(finding).collect()
}

fn fact(name: &str, mesh: &Mesh, scene: Option<Bounds>) -> Option<OrganFact> {
    let about = mesh.vertices_mm.first()?.as_dvec3();
    let (mut volume_mm3, mut moment) = (0.0, DVec3::ZERO);
    for corners in mesh.corners_mm() {
        let [a, b, c] = corners.map(|v| v.as_dvec3() - about);
        let v = a.dot(b.cross(c)) / 6.0;
        volume_mm3 += v;
        moment += 0.25 * v * (a + b + c);
    }
    if volume_mm3 < 1e-3 {
        return None;
    }
    let is_cut = match (mesh.bounds_mm(), scene) {
        (Some(own), Some(all)) => ((own.min - all.min).abs().min((own.max - all.max).abs())).min_element() < BORDER_MM,
        _ => false,
    };
    let centre_mm = about + moment / volume_mm3;
    Some(OrganFact { name: name.to_owned(), volume_ml: volume_mm3 * 1e-3, centre_mm, is_cut })
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::anatomy::analytic::sphere;

    #[test]
    fn an_organ_outside_the_skin_is_told() {
        let (skin, spleen) = (sphere(Vec3::ZERO, 150.0, 4), |x: f32| sphere(Vec3::new(x, 0.0, 0.0), 35.0, 4));
        let found = |x: f32| {
            let spleen = spleen(x);
            let findings = examine([("skin", &skin), ("spleen", &spleen)].into_iter(), skin.bounds_mm());
            findings.into_iter().map(|finding| finding.what).collect::<Vec<_>>()
        };
        assert_eq!(found(90.0), [""; 0]);
        assert_eq!(found(190.0), ["`spleen` lies outside the skin"]);
    }
}
