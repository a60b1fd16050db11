//! Conversion of meshes of organs to the closed surfaces of a scene: organs, their walls, and a body around them.

use insonify_core::anatomy::{Bounds, Mesh};

use super::classes::{Class, Role};
use super::from_labels::{Inputs, Made, Options, make};
use super::grid::Grid;
use super::meshing::Part;
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
const LAYERS: [&str; 4] = ["fat", "soft_tissue", "subcutaneous_fat", "torso_fat"];

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
    for OrganMesh { name, class, mesh } in organs {
        let priority = 10 * class.priority.unwrap_or(50);
        let tissue = class.tissue.clone().unwrap_or_default();
        let outer = part(&mesh);
        let (segment, volume) = (Some(name.as_str()), Some(outer.volume_mm3()));
        match &class.wall {
            Some(wall) => {
                made.push(of_part(&format!("{name}_wall"), &wall.tissue, priority, &outer, segment, volume));
                let inner = outer.inward(wall.mm);
                made.push(of_part(&name, &tissue, priority + 1, &inner, segment, None));
            }
            None => made.push(of_part(&name, &tissue, priority, &outer, segment, volume)),
        }
    }
    made.sort_by_key(|made| made.priority);
    (made, remarks)
}

/// Smallest volume of a separate piece that is reported, relative to its organ.
const PIECE: f64 = 0.15;

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

/// Volumes of the larger pieces of a mesh, ml, largest first. Pieces share no vertex with each other.
fn pieces_ml(mesh: &Mesh) -> Vec<f64> {
    let (piece_of, count) = mesh.pieces();
    let mut volumes = vec![0.0; count];
    for (corners, piece) in mesh.corners_mm().zip(piece_of) {
        let [a, b, c] = corners.map(|v| v.as_dvec3());
        volumes[piece as usize] += a.dot(b.cross(c)) / 6.0;
    }
    let whole = mesh.signed_volume_mm3();
    let mut large: Vec<f64> = volumes.into_iter().filter(|v| *v > PIECE * whole).map(|v| v * 1e-3).collect();
    large.sort_by(|a, b| b.total_cmp(a));
    large
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
