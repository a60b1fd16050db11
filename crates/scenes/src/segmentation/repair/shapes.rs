//! Shapes for tests.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use insonify_core::anatomy::Mesh;

/// A sphere of `20 · 4^levels` triangles about the origin, facing outward.
pub(super) fn sphere(radius_mm: f64, levels: u32) -> Mesh {
    let golden = (1.0 + 5.0f64.sqrt()) / 2.0;
    let mut points: Vec<DVec3> = Vec::new();
    for (a, b) in [(-1.0, golden), (1.0, golden), (-1.0, -golden), (1.0, -golden)] {
        points.push(DVec3::new(a, b, 0.0));
    }
    for i in 0..4 {
        points.push(DVec3::new(0.0, points[i].x, points[i].y));
    }
    for i in 0..4 {
        points.push(DVec3::new(points[i].y, 0.0, points[i].x));
    }
    // The faces are the triples of icosahedron corners with the shortest distances between them.
    let near = |a: usize, b: usize| points[a].distance(points[b]) < 2.1;
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(c, a) {
                    let out = (points[b] - points[a]).cross(points[c] - points[a]).dot(points[a]) > 0.0;
                    triangles.push(if out { [a, b, c] } else { [a, c, b] }.map(|i| i as u32));
                }
            }
        }
    }
    for _ in 0..levels {
        let mut middle = HashMap::new();
        let mut split = Vec::with_capacity(4 * triangles.len());
        for [a, b, c] in triangles {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(a, b)| {
                *middle.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    points.push((points[a as usize].normalize() + points[b as usize].normalize()) * 0.5);
                    points.len() as u32 - 1
                })
            });
            split.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = split;
    }
    let vertices_mm = points.iter().map(|p| (p.normalize() * radius_mm).as_vec3()).collect();
    Mesh { vertices_mm, triangles }
}

/// A tube along z without caps, facing away from the axis.
pub(super) fn tube(radius_mm: f64, half_length_mm: f64, around: u32, along: u32) -> Mesh {
    let point = |i: u32, k: u32| {
        let angle = std::f64::consts::TAU * f64::from(i % around) / f64::from(around);
        let z = half_length_mm * (2.0 * f64::from(k) / f64::from(along) - 1.0);
        DVec3::new(radius_mm * angle.cos(), radius_mm * angle.sin(), z).as_vec3()
    };
    let vertices_mm = (0..=along).flat_map(|k| (0..around).map(move |i| point(i, k))).collect();
    let index = |i: u32, k: u32| k * around + i % around;
    let quad = |i: u32, k: u32| {
        let (a, b, c, d) = (index(i, k), index(i + 1, k), index(i + 1, k + 1), index(i, k + 1));
        [[a, b, c], [a, c, d]]
    };
    let triangles = (0..along).flat_map(|k| (0..around).flat_map(move |i| quad(i, k))).collect();
    Mesh { vertices_mm, triangles }
}

/// An axis-aligned cuboid with `n × n` squares on each side, facing outward; `half` are its half edges.
pub(super) fn cuboid(centre: Vec3, half: Vec3, n: u32) -> Mesh {
    let mut mesh = Mesh::default();
    for axis in 0..3 {
        for side in [-1.0f32, 1.0] {
            let vertex = |i: u32, k: u32| {
                let [u, v] = [i, k].map(|j| 2.0 * j as f32 / n as f32 - 1.0);
                let mut p = [0.0; 3];
                (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side, u, v);
                centre + half * Vec3::from(p)
            };
            for i in 0..n {
                for k in 0..n {
                    let first = mesh.vertices_mm.len() as u32;
                    mesh.vertices_mm.extend([vertex(i, k), vertex(i + 1, k), vertex(i + 1, k + 1), vertex(i, k + 1)]);
                    let quad = if side > 0.0 { [[0, 1, 2], [0, 2, 3]] } else { [[0, 2, 1], [0, 3, 2]] };
                    mesh.triangles.extend(quad.map(|t| t.map(|v: u32| first + v)));
                }
            }
        }
    }
    welded(mesh)
}

/// The mesh with coincident vertices joined.
pub(super) fn welded(mesh: Mesh) -> Mesh {
    let mut at = HashMap::new();
    let mut vertices_mm = Vec::new();
    let mut index = Vec::new();
    for v in mesh.vertices_mm {
        index.push(*at.entry((v + Vec3::ZERO).to_array().map(f32::to_bits)).or_insert_with(|| {
            vertices_mm.push(v);
            vertices_mm.len() as u32 - 1
        }));
    }
    Mesh { vertices_mm, triangles: mesh.triangles.iter().map(|t| t.map(|v| index[v as usize])).collect() }
}

/// The mesh with three vertices for each triangle, shared with no other.
pub(super) fn unwelded(mesh: &Mesh) -> Mesh {
    let vertices_mm: Vec<Vec3> = mesh.corners_mm().flatten().collect();
    let triangles = (0..mesh.triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    Mesh { vertices_mm, triangles }
}

/// The part of a mesh where `normal · p ≤ offset`, open at the cut.
pub(super) fn cut(mesh: &Mesh, normal: DVec3, offset_mm: f64) -> Mesh {
    let height: Vec<f64> = mesh.vertices_mm.iter().map(|v| normal.dot(v.as_dvec3()) - offset_mm).collect();
    let is_in = |v: u32| height[v as usize] <= 1e-5;
    let is_on = |v: u32| height[v as usize].abs() <= 1e-5;
    let mut result = Mesh { vertices_mm: mesh.vertices_mm.clone(), triangles: Vec::new() };
    let mut crossings = HashMap::new();
    let mut crossing = |a: u32, b: u32| {
        let (low, high) = (a.min(b), a.max(b));
        *crossings.entry((low, high)).or_insert_with(|| {
            let [p, q] = [low, high].map(|v| mesh.vertices_mm[v as usize].as_dvec3());
            let t = height[low as usize] / (height[low as usize] - height[high as usize]);
            result.vertices_mm.push(p.lerp(q, t).as_vec3());
            result.vertices_mm.len() as u32 - 1
        })
    };
    for &triangle in &mesh.triangles {
        let mut kept: Vec<u32> = Vec::new();
        for i in 0..3 {
            let (a, b) = (triangle[i], triangle[(i + 1) % 3]);
            if is_in(a) {
                kept.push(a);
            }
            if is_in(a) != is_in(b) && !is_on(a) && !is_on(b) {
                kept.push(crossing(a, b));
            }
        }
        for i in 1..kept.len().saturating_sub(1) {
            result.triangles.push([kept[0], kept[i], kept[i + 1]]);
        }
    }
    result
}

/// The two meshes combined into one.
pub(super) fn both(a: &Mesh, b: &Mesh) -> Mesh {
    let first = a.vertices_mm.len() as u32;
    let mut mesh = a.clone();
    mesh.vertices_mm.extend(&b.vertices_mm);
    mesh.triangles.extend(b.triangles.iter().map(|t| t.map(|v| v + first)));
    mesh
}

/// The mesh moved by `by`.
pub(super) fn moved(mut mesh: Mesh, by: Vec3) -> Mesh {
    mesh.vertices_mm.iter_mut().for_each(|v| *v += by);
    mesh
}

/// The mesh turned inside out.
pub(super) fn flipped(mut mesh: Mesh) -> Mesh {
    mesh.flip();
    mesh
}

/// Pseudo-random numbers in [0, 1) from a seed.
pub(super) struct Numbers(pub(super) u64);

impl Numbers {
    pub(super) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    pub(super) fn below(&mut self, n: usize) -> usize {
        (self.next() * n as f64) as usize
    }
}
