//! Conversion of meshes of organs to the closed surfaces of a scene: organs, their walls, and a body around them.

use insonify_core::anatomy::{Bounds, Mesh};

use super::classes::{Class, Role};
use super::from_labels::{Inputs, Made, Options, make, nth_priority, shells};
use super::grid::Grid;
use super::meshing::Part;
use super::shape::pieces_ml;
use super::summary::remark_of_outline;
use super::voxels::{inside_of, voxels_within};

/// Voxel spacing for a body that is drawn around the meshes, mm.
const VOXEL_MM: f64 = 2.5;

/// A closed mesh (LPS, mm) and its class.
#[derive(Debug, Clone, PartialEq)]
pub struct OrganMesh {
    /// Name of the organ's surface.
    pub name: String,
    /// Class of the mesh.
    pub class: Class,
    /// Closed surface that faces outward.
    pub mesh: Mesh,
}

/// Classes of layers that are generated within a given body. Meshes of these classes are then left out.
const LAYERS: [&str; 5] = ["fat", "fascia", "soft_tissue", "subcutaneous_fat", "torso_fat"];

/// Surfaces of a scene, ascending in priority, and remarks on them. Organs get the walls of their classes. A mesh of
/// the body or skin is filled with fat and soft tissue; without such a mesh, a body is drawn around all meshes.
pub fn surfaces(organs: Vec<OrganMesh>, options: &Options) -> (Vec<Made>, Vec<String>) {
    let (bodies, mut organs): (Vec<_>, Vec<_>) =
        organs.into_iter().partition(|o| matches!(o.class.role, Role::Body | Role::Skin));
    let mut remarks = Vec::new();
    if !bodies.is_empty() {
        let is_layer = |organ: &OrganMesh| LAYERS.contains(&organ.class.name.as_str());
        for OrganMesh { name, .. } in organs.iter().filter(|organ| is_layer(organ)) {
            remarks.push(format!("`{name}` is left out: the body makes its own layers"));
        }
        organs.retain(|organ| !is_layer(organ));
    }
    let (mut made, outside) = layers(&bodies, &organs, options);
    remarks.extend(outside);
    if let [body] = &bodies[..] {
        // The given mesh is finer than a mesh made from voxels.
        let outer = part(&body.mesh);
        for (name, depth_mm) in [("skin", 0.0), ("fat", options.skin_mm)] {
            if let Some(layer) = made.iter_mut().find(|made| made.name == name) {
                let exact = if depth_mm > 0.0 { outer.inward(depth_mm) } else { outer.clone() };
                layer.mesh = exact.mesh(&glam::DAffine3::IDENTITY);
                layer.voxels_mm3 = layer.voxels_mm3.map(|_| outer.volume_mm3());
            }
        }
    } else if bodies.is_empty() {
        remarks.push(remark_of_outline().to_owned());
    }
    // Where organs of one class priority overlap, the smaller one counts, whatever the order of the files.
    let volume = |organ: &OrganMesh| organ.mesh.signed_volume_mm3();
    organs.sort_by(|a, b| class_priority(a).cmp(&class_priority(b)).then(volume(b).total_cmp(&volume(a))));
    remarks.extend(remark_of_overlaps(&organs));
    for (number, OrganMesh { name, class, mesh }) in organs.into_iter().enumerate() {
        let priority = nth_priority(number);
        let tissue = class.tissue.clone().unwrap_or_default();
        let outer = part(&mesh);
        let (segment, volume) = (Some(name.as_str()), Some(outer.volume_mm3()));
        for (layer, (shell, depth_mm, tissue)) in (0..).zip(shells(&name, &tissue, &class.wall)) {
            if depth_mm == 0.0 {
                made.push(of_part(&shell, tissue, priority, &outer, segment, volume));
                continue;
            }
            let inner = outer.inward(depth_mm);
            if inner.triangles.is_empty() {
                remarks.push(format!("`{shell}` is empty: the organ is thinner than its walls of {depth_mm} mm"));
            }
            made.push(of_part(&shell, tissue, priority + layer, &inner, segment, None));
        }
    }
    made.retain(|made| !made.mesh.triangles.is_empty());
    made.sort_by_key(|made| made.priority);
    (made, remarks)
}

fn class_priority(organ: &OrganMesh) -> i32 {
    organ.class.priority.unwrap_or(50)
}

/// Smallest common volume of two organs that is reported, ml.
const COMMON_ML: f64 = 0.5;

/// Class priority from which a mesh is no layer of the body.
const ORGAN: i32 = 20;

/// A remark on organs that overlap. They are given in ascending order of priority.
fn remark_of_overlaps(organs: &[OrganMesh]) -> Option<String> {
    let bounds: Vec<Option<Bounds>> = organs.iter().map(|organ| organ.mesh.bounds_mm()).collect();
    let mut named = Vec::new();
    for (n, upper) in organs.iter().enumerate() {
        let is_over = |&m: &usize| {
            class_priority(&organs[m]) >= ORGAN && bounds[m].zip(bounds[n]).is_some_and(|(a, b)| a.meets(b))
        };
        let over: Vec<usize> = (0..n).filter(is_over).collect();
        if over.is_empty() {
            continue;
        }
        let Some((grid, own)) = voxels_within(&[&upper.mesh], VOXEL_MM, 0) else { continue };
        for lower in over.into_iter().map(|m| &organs[m]) {
            let common = own.iter().zip(inside_of(&[&lower.mesh], &grid)).filter(|(a, b)| **a && *b).count();
            let ml = common as f64 * grid.voxel_mm3() * 1e-3;
            if ml >= COMMON_ML {
                named.push((ml, format!("`{}` in `{}` ({ml:.1} ml)", upper.name, lower.name)));
            }
        }
    }
    named.sort_by(|a, b| b.0.total_cmp(&a.0));
    let named: Vec<String> = named.into_iter().map(|(_, words)| words).collect();
    let words = insonify_core::names::listed(&named, 6, ", ");
    (!named.is_empty()).then(|| format!("where organs overlap, the first named counts: {words}"))
}

/// Remarks on organs that occur more than once, and on organs of several separate pieces.
pub fn remarks_on_organs(organs: &[OrganMesh]) -> Vec<String> {
    let mut remarks = Vec::new();
    let extents: Vec<_> = organs.iter().map(|o| (o.mesh.bounds_mm(), o.mesh.signed_volume_mm3())).collect();
    for (index, organ) in organs.iter().enumerate() {
        for (other, extent) in organs[..index].iter().zip(&extents) {
            if other.class.tissue == organ.class.tissue && is_same_place(extent, &extents[index]) {
                let (a, b) = (&other.name, &organ.name);
                remarks.push(format!("`{a}` and `{b}` have the same size and place: one mesh may be there twice"));
            }
        }
        let numbered = organ.name.strip_prefix(&organ.class.name).is_some_and(|rest| rest.starts_with('_'));
        if numbered {
            let (name, own) = (&organ.class.name, &organ.name);
            remarks.push(format!("`{name}` is given more than once: this one is called `{own}`"));
        }
        let pieces = pieces_ml(&organ.mesh);
        if pieces.len() > 1 {
            let volumes: Vec<String> = pieces.iter().take(4).map(|ml| format!("{ml:.1}")).collect();
            remarks.push(format!(
                "`{}` has {} separate pieces ({} ml): if they are different organs, export a file for each",
                organ.name,
                pieces.len(),
                volumes.join(", ")
            ));
        }
    }
    remarks
}

/// Whether two meshes, each given by bounds and volume, nearly coincide.
fn is_same_place((p, v): &(Option<Bounds>, f64), (q, w): &(Option<Bounds>, f64)) -> bool {
    let (Some(p), Some(q)) = (p, q) else { return false };
    let near_mm = 0.02 * p.size().max_element();
    let far_mm = (p.min - q.min).abs().max((p.max - q.max).abs()).max_element();
    far_mm < near_mm && (v - w).abs() < 0.05 * v.abs()
}

fn part(mesh: &Mesh) -> Part {
    let vertices_mm: Vec<_> = mesh.vertices_mm.iter().map(|v| v.as_dvec3()).collect();
    Part { borders: vec![0; vertices_mm.len()], vertices_mm, triangles: mesh.triangles.clone() }
}

fn of_part(
    name: &str,
    tissue: &str,
    priority: i32,
    part: &Part,
    segment: Option<&str>,
    voxels_mm3: Option<f64>,
) -> Made {
    Made {
        name: name.to_owned(),
        tissue: tissue.to_owned(),
        priority,
        mesh: part.mesh(&glam::DAffine3::IDENTITY),
        segment: segment.map(str::to_owned),
        voxels_mm3,
    }
}

/// Smallest share of an organ's vertices outside the body, 0..=1, for which the organ is reported.
const OUTSIDE: f64 = 0.1;

/// A remark on organs that extend outside the body; `body` is a mask on `grid`.
fn remark_outside(organs: &[OrganMesh], body: &[bool], grid: &Grid) -> Option<String> {
    let voxel_from_lps = grid.lps_from_voxel.inverse();
    let is_outside = |vertex: &&glam::Vec3| {
        let at = voxel_from_lps.transform_point3(vertex.as_dvec3()).round();
        let within = (0..3).all(|n| (0.0..grid.size[n] as f64).contains(&at[n]));
        !within || !body[(at.z as usize * grid.size[1] + at.y as usize) * grid.size[0] + at.x as usize]
    };
    let named = organs.iter().filter_map(|organ| {
        let vertices = &organ.mesh.vertices_mm;
        let share = vertices.iter().filter(is_outside).count() as f64 / vertices.len().max(1) as f64;
        (share > OUTSIDE).then(|| format!("`{}` with {:.0} % of its surface", organ.name, 100.0 * share))
    });
    let named: Vec<String> = named.collect();
    let words = insonify_core::names::listed(&named, 6, ", ");
    (!named.is_empty()).then(|| format!("organs reach out of the body: {words}: are all meshes of one frame?"))
}

/// Skin, fat and soft tissue within the given bodies, or around the organs if there are no bodies. Also a remark on
/// organs that extend outside the bodies.
fn layers(bodies: &[OrganMesh], organs: &[OrganMesh], options: &Options) -> (Vec<Made>, Option<String>) {
    let meshes: Vec<&Mesh> = bodies.iter().chain(organs).map(|o| &o.mesh).collect();
    // A margin of two voxels on all sides, so that the organs end within the body.
    let Some((grid, _)) = voxels_within(&meshes, VOXEL_MM, 2) else { return (Vec::new(), None) };
    let within = |of: &[OrganMesh]| {
        let meshes: Vec<&Mesh> = of.iter().map(|o| &o.mesh).collect();
        inside_of(&meshes, &grid)
    };
    let labels = within(organs).into_iter().map(u16::from).collect();
    let body = (!bodies.is_empty()).then(|| within(bodies));
    let outside = body.as_ref().and_then(|body| remark_outside(organs, body, &grid));
    let inputs = Inputs {
        grid: grid.clone(),
        labels,
        organs: Vec::new(),
        body,
        fat: None,
        image: None,
        is_ct: false,
        remarks: Vec::new(),
    };
    (make(inputs, options, &|_, _| ()).surfaces, outside)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use insonify_core::anatomy::analytic::sphere;

    use super::*;
    use crate::segmentation::classes::ClassTable;

    #[test]
    fn the_smaller_of_overlapping_organs_counts_in_any_order() {
        let table = ClassTable::builtin("total-v2").unwrap();
        let organ = |name: &str, at: Vec3, radius_mm: f32| OrganMesh {
            name: name.to_owned(),
            class: table.classes().iter().find(|class| class.name == name).unwrap().clone(),
            mesh: sphere(at, radius_mm, 4),
        };
        let organs = [organ("spleen", Vec3::ZERO, 30.0), organ("liver", Vec3::X * 20.0, 60.0)];
        let reversed = [organs[1].clone(), organs[0].clone()];
        let [first, second] = [organs.to_vec(), reversed.to_vec()].map(|organs| surfaces(organs, &Options::default()));
        let priority = |of: &[Made], name: &str| of.iter().find(|made| made.name == name).unwrap().priority;
        for (made, remarks) in [&first, &second] {
            assert!(priority(made, "spleen") > priority(made, "liver"));
            // Of the spleen, 113.1 ml, all lies within the liver.
            let said = remarks.iter().find(|remark| remark.contains("overlap")).unwrap();
            let ml: f64 = said.split(['(', ' ']).find_map(|word| word.parse().ok()).unwrap();
            assert!(said.contains("`spleen` in `liver`") && (ml / 113.1 - 1.0).abs() < 0.03, "{said}");
        }
        assert_eq!(first, second);
    }
}
