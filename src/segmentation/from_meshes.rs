//! From meshes of organs to the closed surfaces of a scene: walls, and a body around them.

use super::classes::{Class, Role};
use super::from_labels::{Inputs, Made, Options, make};
use super::meshing::Part;
use super::summary::remark_of_outline;
use super::voxels::voxels_within;
use crate::anatomy::Mesh;

/// Side of the voxels in which a body is drawn around the meshes, mm.
const VOXEL_MM: f64 = 2.5;

/// A closed mesh, LPS, mm, and what it is.
#[derive(Debug, Clone, PartialEq)]
pub struct OrganMesh {
    /// Name of its surface.
    pub name: String,
    /// What it is.
    pub class: Class,
    /// Closed surface, outward.
    pub mesh: Mesh,
}

/// Surfaces of a scene, ascending in priority, and remarks on them. Organs get the walls of their classes. A mesh of the
/// body or skin is filled with skin, fat and soft tissue; without one a body is drawn around all meshes.
pub fn surfaces(organs: Vec<OrganMesh>, options: &Options) -> (Vec<Made>, Vec<String>) {
    let mut made = Vec::new();
    let mut remarks = Vec::new();
    let (bodies, organs): (Vec<_>, Vec<_>) =
        organs.into_iter().partition(|o| matches!(o.class.role, Role::Body | Role::Skin));
    if bodies.is_empty() {
        made.extend(body_around(&organs, options));
        remarks.push(remark_of_outline().to_owned());
    }
    for body in bodies {
        let part = part(&body.mesh);
        let layers = [("skin", "skin", 0.0), ("fat", "fat", options.skin_mm)];
        let soft = ("soft_tissue", "soft_tissue_maternal", options.skin_mm + options.fat_mm);
        for (priority, (name, tissue, depth_mm)) in (0..).zip(layers.into_iter().chain([soft])) {
            if priority == 0 && options.skin_mm == 0.0 {
                continue;
            }
            let layer = if depth_mm > 0.0 { part.inward(depth_mm) } else { part.clone() };
            let voxels_mm3 = (depth_mm == 0.0).then(|| part.volume_mm3());
            made.push(of_part(name, tissue, priority, &layer, None, voxels_mm3));
        }
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

/// Skin, fat and soft tissue around the organs.
fn body_around(organs: &[OrganMesh], options: &Options) -> Vec<Made> {
    let meshes: Vec<&Mesh> = organs.iter().map(|o| &o.mesh).collect();
    // Free voxels on all sides: the organs end within the body.
    let Some((grid, inside)) = voxels_within(&meshes, VOXEL_MM, 2) else { return Vec::new() };
    let labels = inside.iter().map(|&inside| u16::from(inside)).collect();
    let inputs = Inputs { grid, labels, organs: Vec::new(), body: None, fat: None, image: None };
    make(inputs, options, &|_, _| ()).surfaces
}
