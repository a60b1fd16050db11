//! Shapes of known geometry, and the scenes in `assets/scenes` that are made of them.
//!
//! A probe at the origin with identity orientation looks along +z, so image depth is scene z. All meshes are closed
//! and face outward.

use std::collections::HashMap;

use glam::{DVec3, Quat, Vec3, Vec3Swizzles};

use super::{Mesh, Scene, TissueTable};

/// Surface with the name of its tissue; unlike a surface of a [`Scene`], it needs no tissue table.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// Name of the surface.
    pub name: &'static str,
    /// Name of its tissue.
    pub tissue: &'static str,
    /// Priority: where parts overlap, the part of highest priority is the medium.
    pub priority: i32,
    /// The surface, mm.
    pub mesh: Mesh,
}

/// Scene of `parts` in the tissue `background`; `None` if `tissues` lacks the tissue of a part or of the background.
pub fn scene(parts: Vec<Part>, tissues: &TissueTable, background: &str) -> Option<Scene> {
    let mut scene = Scene::new(tissues.clone(), background).ok()?;
    for Part { name, tissue, priority, mesh } in parts {
        scene.add(name, tissue, priority, mesh).ok()?;
    }
    Some(scene)
}

/// Axis-aligned box from `min_mm` to `max_mm`.
pub fn cuboid(min_mm: Vec3, max_mm: Vec3) -> Mesh {
    hexahedron(|corner| min_mm + (max_mm - min_mm) * corner)
}

/// Box from `min_mm` to `max_mm` whose upper face is tilted about y by `tilt_deg` (clamped to ±80°). The upper face is
/// at `min_mm.z` for x = 0 and deeper towards +x.
pub fn oblique_slab(min_mm: Vec3, max_mm: Vec3, tilt_deg: f32) -> Mesh {
    let slope = tilt_deg.clamp(-80.0, 80.0).to_radians().tan();
    hexahedron(|corner| {
        let mut point = min_mm + (max_mm - min_mm) * corner;
        if corner.z == 0.0 {
            point.z += slope * point.x;
        }
        point
    })
}

/// Box of `size_mm` about `centre_mm`, rotated by `rotation`.
pub fn plate(centre_mm: Vec3, size_mm: Vec3, rotation: Quat) -> Mesh {
    hexahedron(|corner| centre_mm + rotation * (size_mm * (corner - 0.5)))
}

/// Sphere: an icosahedron with edges halved `subdivisions` times (at most 7) and all vertices on the sphere.
///
/// From one subdivision on, facets are inside the sphere by at most 0.40·radius / 4^subdivisions.
pub fn sphere(centre_mm: Vec3, radius_mm: f32, subdivisions: u32) -> Mesh {
    let (mut directions, mut triangles) = icosahedron();
    for _ in 0..subdivisions.min(7) {
        let mut middle = HashMap::new();
        let mut halve = |a: u32, b: u32| {
            *middle.entry((a.min(b), a.max(b))).or_insert_with(|| {
                directions.push((directions[a as usize] + directions[b as usize]).normalize());
                (directions.len() - 1) as u32
            })
        };
        let split = |[a, b, c]: [u32; 3]| {
            let [ab, bc, ca] = [halve(a, b), halve(b, c), halve(c, a)];
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        triangles = triangles.into_iter().flat_map(split).collect();
    }
    let vertices_mm = directions.into_iter().map(|d| centre_mm + (d * f64::from(radius_mm)).as_vec3()).collect();
    Mesh { vertices_mm, triangles }
}

/// Closed tube of `sides` (at least 3) flat sides. Each ring of `path_mm` has a centre and semi-axes (across, up), mm.
///
/// For a path along y, "across" is x and "up" is z; along x they are z and y. With four sides, one flat side faces up;
/// a square of side a has semi-axes of a/√2. Fewer than two rings make an empty mesh. The path must not turn by more
/// than a right angle.
pub fn tube(path_mm: &[(Vec3, (f32, f32))], sides: u32) -> Mesh {
    let (Some(&(first, _)), Some(&(last, _))) = (path_mm.first(), path_mm.last()) else { return Mesh::default() };
    if path_mm.len() < 2 {
        return Mesh::default();
    }
    let sides = sides.max(3);
    let overall = (last - first).normalize_or(Vec3::Y);
    let helper = if overall.y.abs() > 0.9 { Vec3::Z } else { Vec3::Y };
    let mut mesh = Mesh::default();
    for (i, &(centre, (across, up))) in path_mm.iter().enumerate() {
        let (before, after) = (path_mm[i.saturating_sub(1)].0, path_mm[(i + 1).min(path_mm.len() - 1)].0);
        let along = (after - before).normalize_or(overall);
        // across × up = along, so rings run counter-clockwise seen from the path's end.
        let u = if overall.y.abs() > 0.9 { along.cross(helper) } else { helper.cross(along) }.normalize_or(Vec3::X);
        let v = along.cross(u);
        for side in 0..sides {
            let angle = (side as f32 + 0.5) / sides as f32 * std::f32::consts::TAU;
            mesh.vertices_mm.push(centre + u * (across * angle.cos()) + v * (up * angle.sin()));
        }
    }
    let ring = |ring: usize, side: u32| ring as u32 * sides + side % sides;
    for r in 0..path_mm.len() - 1 {
        for s in 0..sides {
            let [a, b, c, d] = [ring(r, s), ring(r, s + 1), ring(r + 1, s + 1), ring(r + 1, s)];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    let ends = mesh.vertices_mm.len() as u32;
    mesh.vertices_mm.extend([first, last]);
    for s in 0..sides {
        let end = path_mm.len() - 1;
        mesh.triangles.push([ends, ring(0, s + 1), ring(0, s)]);
        mesh.triangles.push([ends + 1, ring(end, s), ring(end, s + 1)]);
    }
    mesh
}

/// Union of meshes that do not touch each other.
pub fn joined(meshes: impl IntoIterator<Item = Mesh>) -> Mesh {
    meshes.into_iter().fold(Mesh::default(), |mut all, mesh| {
        let offset = all.vertices_mm.len() as u32;
        all.vertices_mm.extend(mesh.vertices_mm);
        all.triangles.extend(mesh.triangles.into_iter().map(|t| t.map(|i| i + offset)));
        all
    })
}

fn icosahedron() -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let golden = 0.5 * (1.0 + 5f64.sqrt());
    // The vertices are the corners of three golden rectangles, four each.
    let first = [(-1.0, 1.0), (1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)].map(|(s, t)| DVec3::new(s, golden * t, 0.0));
    let turned: [fn(DVec3) -> DVec3; 3] = [|v| v, |v| v.zxy(), |v| v.yzx()];
    let directions: Vec<_> = turned.into_iter().flat_map(|turn| first.map(|v| turn(v).normalize())).collect();
    // Neighbours are one edge apart; each triple of neighbours is a face, wound by its normal.
    let edge = |a: usize, b: usize| directions[a].dot(directions[b]) > 0.4;
    let mut triangles = Vec::with_capacity(20);
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if edge(a, b) && edge(b, c) && edge(c, a) {
                    let outward = directions[a].dot(directions[b].cross(directions[c])) > 0.0;
                    let [b, c] = if outward { [b, c] } else { [c, b] };
                    triangles.push([a as u32, b as u32, c as u32]);
                }
            }
        }
    }
    (directions, triangles)
}

/// Box whose corners are at `at(c)`, for each `c` with coordinates of 0 or 1.
fn hexahedron(at: impl Fn(Vec3) -> Vec3) -> Mesh {
    let bit = |i: u32, axis: u32| ((i >> axis) & 1) as f32;
    let vertices_mm = (0..8).map(|i| at(Vec3::new(bit(i, 0), bit(i, 1), bit(i, 2)))).collect();
    // The bits of a vertex index are its coordinates: 0 is x, 1 is y, 2 is z.
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    Mesh { vertices_mm, triangles: quads.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect() }
}

/// Block of liver in contact with the probe: fully developed speckle, side walls left and right, a back wall at 120 mm.
pub fn speckle_block() -> Vec<Part> {
    let mesh = cuboid(Vec3::new(-60.0, -40.0, -20.0), Vec3::new(60.0, 40.0, 120.0));
    vec![Part { name: "block", tissue: "liver", priority: 1, mesh }]
}

/// Radius of the sphere of [`cyst`], mm.
pub(crate) const CYST_RADIUS_MM: f32 = 20.0;
/// Centre of the sphere of [`cyst`], mm.
pub(crate) const CYST_CENTRE_MM: Vec3 = Vec3::new(0.0, 0.0, 70.0);

/// Sphere of amniotic fluid, to be put in a background of tissue.
pub fn cyst() -> Vec<Part> {
    vec![Part { name: "cyst", tissue: "amniotic_fluid", priority: 1, mesh: sphere(CYST_CENTRE_MM, CYST_RADIUS_MM, 5) }]
}

/// Layers of different speed and attenuation, by depth: fat from 10 mm, muscle from 35 mm, liver from 75 to 135 mm. The
/// upper face of the liver is tilted by 10° (75 mm is at x = 0). The liver contains water from 105 to 115 mm.
pub fn slabs() -> Vec<Part> {
    // Neighbouring layers overlap and differ in width, to avoid coincident faces.
    let slab = |x: f32, y: f32, top: f32, bottom: f32| cuboid(Vec3::new(-x, -y, top), Vec3::new(x, y, bottom));
    let liver = oblique_slab(Vec3::new(-108.5, -38.5, 75.0), Vec3::new(108.5, 38.5, 135.0), 10.0);
    let part = |name, tissue, priority, mesh| Part { name, tissue, priority, mesh };
    vec![
        part("fat", "fat", 1, slab(110.0, 40.0, 10.0, 40.0)),
        part("muscle", "muscle", 2, slab(109.0, 39.0, 35.0, 110.0)),
        part("oblique liver", "liver", 3, liver),
        part("water band", "water", 4, slab(108.0, 38.0, 105.0, 115.0)),
    ]
}

/// Bone plate 4 mm thick at a depth of 50 mm, from x = −40 to 10 mm, to be put in a background of tissue.
pub fn bone_plate() -> Vec<Part> {
    let mesh = plate(Vec3::new(-15.0, 0.0, 52.0), Vec3::new(50.0, 80.0, 4.0), Quat::IDENTITY);
    vec![Part { name: "plate", tissue: "bone_adult", priority: 1, mesh }]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_are_closed_and_outward_with_their_volumes() {
        let tilted = oblique_slab(Vec3::new(-10.0, -10.0, 5.0), Vec3::new(10.0, 10.0, 25.0), 30.0);
        let turned = plate(Vec3::ONE, Vec3::new(1.0, 2.0, 3.0), Quat::from_rotation_x(0.7));
        let half = std::f32::consts::SQRT_2;
        let bar = |to| tube(&[(Vec3::ZERO, (half, half)), (to, (half, half))], 4);
        let bars =
            [Vec3::Y, Vec3::X, Vec3::Z, Vec3::new(3.0, 0.0, -4.0), -Vec3::Y].map(|to| (bar(to), 4.0 * to.length()));
        let solids = [(cuboid(Vec3::ZERO, Vec3::splat(3.0)), 27.0), (tilted, 8000.0), (turned, 6.0)];
        for (mesh, volume) in solids.into_iter().chain(bars.map(|(mesh, volume)| (mesh, f64::from(volume)))) {
            assert_eq!(mesh.unpaired_edges(), 0);
            assert!((mesh.signed_volume_mm3() / volume - 1.0).abs() < 1e-5, "{}", mesh.signed_volume_mm3());
        }
    }

    #[test]
    fn a_sphere_of_20_mm_is_within_0_02_mm() {
        for subdivisions in 1..=5 {
            let mesh = sphere(CYST_CENTRE_MM, 20.0, subdivisions);
            assert_eq!((mesh.unpaired_edges(), mesh.triangles.len()), (0, 20 << (2 * subdivisions)));
            let radius = |v: Vec3| (v - CYST_CENTRE_MM).length();
            assert!(mesh.vertices_mm.iter().all(|&v| (radius(v) - 20.0).abs() < 1e-5));
            // A facet is farthest inside the sphere at its circumcentre; in a near-equilateral facet, that is the
            // centroid.
            let chord = mesh.corners_mm().map(|[a, b, c]| 20.0 - radius((a + b + c) / 3.0)).fold(0.0, f32::max);
            assert!(chord < 0.4 * 20.0 / 4f32.powi(subdivisions as i32), "{subdivisions}: {chord}");
            assert!(subdivisions < 5 || chord < 0.02, "{chord}");
        }
        let exact = 4.0 / 3.0 * std::f64::consts::PI * 8000.0;
        let volume = sphere(CYST_CENTRE_MM, 20.0, 5).signed_volume_mm3();
        assert!((volume / exact - 1.0).abs() < 1e-3, "{volume}");
    }

    #[test]
    fn a_scene_of_parts_needs_their_tissues() {
        let table = TissueTable::builtin().unwrap();
        let found = scene(slabs(), &table, "gel").unwrap();
        assert_eq!(table.names()[found.surfaces[3].tissue], "water");
        assert!(scene(slabs(), &table, "jam").is_none());
    }
}
