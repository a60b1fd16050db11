//! Hard cases of triangles: slivers, zero-area and duplicate triangles; open and inverted meshes.

use glam::{DVec2, DVec3, Vec3};
use insonify::anatomy::{Mesh, Scene};
use insonify::render::ShaderSet;
use insonify::selftest::bench::{Bench, at, linear, silent, slab, small};

use super::common::{ROUNDING, Tolerance, assert_pass_contains, frame, holds, renderer, row, vector};
use insonify::random::SplitMix64;

/// Distance to a triangle by the published test of Möller and Trumbore, in f32; `None` for a miss.
fn naive(origin: Vec3, direction: Vec3, corner: Vec3, edge1: Vec3, edge2: Vec3) -> Option<f32> {
    let p = direction.cross(edge2);
    let inverse = 1.0 / edge1.dot(p);
    let s = origin - corner;
    let u = s.dot(p) * inverse;
    let q = s.cross(edge1);
    let v = direction.dot(q) * inverse;
    // Written so that NaN counts as a hit, as compilers that assume no NaN may do.
    (!(u < 0.0 || v < 0.0 || u + v > 1.0)).then_some(edge2.dot(q) * inverse)
}

/// Lines of the shader that [`shipped`] copies.
pub(crate) const SHIPPED: [&str; 13] = [
    "let to_corner = w0 - origin;",
    "let t0 = dot(to_corner, direction);",
    "let s = direction * t0 - to_corner;",
    "let p = cross(direction, w2.xyz);",
    "let determinant = dot(w1, p);",
    "let magnitude = abs(determinant);",
    "let side = select(-1.0, 1.0, determinant >= 0.0);",
    "let q = cross(s, w1);",
    "let u = dot(s, p) * side;",
    "let v = dot(direction, q) * side;",
    "let tolerance = w2.w * (abs(t0) + 100.0);",
    "let hit = magnitude > 2.0 * tolerance && u >= -tolerance && v >= -tolerance && u + v <= magnitude + tolerance;",
    "let t = t0 + dot(w2.xyz, q) * side / max(magnitude, 1.0e-30);",
];

/// The test with the guards of `crates/render/shaders/shared/bvh.wgsl`.
pub(crate) fn shipped(origin: Vec3, direction: Vec3, corner: Vec3, edge1: Vec3, edge2: Vec3) -> Option<f32> {
    let longest = edge1.length().max(edge2.length()).max((edge2 - edge1).length());
    let to_corner = corner - origin;
    let t0 = to_corner.dot(direction);
    let s = direction * t0 - to_corner;
    let p = direction.cross(edge2);
    let determinant = edge1.dot(p);
    let side = if determinant >= 0.0 { 1.0 } else { -1.0 };
    let q = s.cross(edge1);
    let (u, v) = (s.dot(p) * side, direction.dot(q) * side);
    let tolerance = longest * 2.0e-7 * (t0.abs() + 100.0);
    let magnitude = determinant.abs();
    let hit = magnitude > 2.0 * tolerance && u >= -tolerance && v >= -tolerance && u + v <= magnitude + tolerance;
    hit.then(|| t0 + edge2.dot(q) * side / magnitude.max(1.0e-30))
}

#[test]
fn zero_area_triangles_do_not_divide_by_zero() {
    for pass in ["locate", "trace", "section"] {
        assert_pass_contains(pass, &SHIPPED);
    }
    let mut random = SplitMix64::new(5);
    let (mut not_finite, mut shipped_hits) = (0, 0);
    for i in 0..1000 {
        let corner = (30.0 * vector(&mut random)).as_vec3();
        let edge = (10.0 * vector(&mut random)).as_vec3();
        // A point, a line there and back, and a line of double length.
        let (edge1, edge2) = [(Vec3::ZERO, Vec3::ZERO), (edge, edge), (edge, 2.0 * edge)][i % 3];
        let (origin, direction) = (Vec3::new(0.0, 0.0, -200.0), Vec3::Z);
        not_finite += usize::from(naive(origin, direction, corner, edge1, edge2).is_some_and(|t| !t.is_finite()));
        shipped_hits += usize::from(shipped(origin, direction, corner, edge1, edge2).is_some());
    }
    assert!(not_finite > 300, "{not_finite}");
    assert_eq!(shipped_hits, 0);
    row(
        "triangles of no area",
        format!("{not_finite} of 1000 are hit at a distance that is no number"),
        "a determinant below rounding is a miss",
        "no hit".to_owned(),
    );
}

/// A slab whose upper face is replaced by a fan of `count` slivers from one corner.
fn slivers(mesh: &Mesh, count: usize) -> Mesh {
    let mut mesh = mesh.clone();
    let z = mesh.bounds_mm().unwrap().min.z;
    let is_top = |t: &[u32; 3]| t.iter().all(|&v| mesh.vertices_mm[v as usize].z == z);
    let (top, rest): (Vec<[u32; 3]>, Vec<[u32; 3]>) = mesh.triangles.iter().partition(|t| is_top(t));
    // Each of the two triangles becomes slivers along its longest side.
    let mut triangles = rest;
    for [a, b, c] in top {
        let at = |v: u32| mesh.vertices_mm[v as usize];
        let (start, end) = (at(b), at(c));
        let mut last = b;
        for i in 1..count {
            mesh.vertices_mm.push(start.lerp(end, i as f32 / count as f32));
            let next = mesh.vertices_mm.len() as u32 - 1;
            triangles.push([a, last, next]);
            last = next;
        }
        triangles.push([a, last, c]);
    }
    mesh.triangles = triangles;
    mesh
}

/// Names and meshes of bodies of one shape, each with a different defect.
fn bodies() -> Vec<(&'static str, Mesh)> {
    let whole = |i: usize| slab(place(i), 20.0, 12.03, 30.04);
    let mut zero_area = whole(1);
    let lines: Vec<[u32; 3]> = zero_area.triangles.iter().flat_map(|&[a, b, _]| [[a, b, b], [a, a, a]]).collect();
    zero_area.triangles.extend(lines);
    let mut duplicates = whole(2);
    duplicates.triangles.extend(duplicates.triangles.clone());
    let mut tripled = whole(3);
    tripled.triangles = tripled.triangles.iter().flat_map(|&t| [t; 3]).collect();
    let sliver = slivers(&whole(4), 4000);
    let mut open = whole(5);
    open.triangles.retain(|t| t.iter().any(|&v| open.vertices_mm[v as usize].z < 20.0));
    let mut inverted = whole(6);
    inverted.flip();
    let mut half_inverted = whole(7);
    half_inverted.triangles.iter_mut().step_by(2).for_each(|t| t.swap(0, 1));
    let mut single = whole(8);
    single.triangles.truncate(1);
    vec![
        ("whole", whole(0)),
        ("zero-area triangles", zero_area),
        ("each triangle twice", duplicates),
        ("each triangle three times", tripled),
        ("4000 slivers", sliver),
        ("open below", open),
        ("inverted", inverted),
        ("every other triangle inverted", half_inverted),
        ("one triangle", single),
    ]
}

fn place(i: usize) -> DVec2 {
    DVec2::new(60.0 * (i % 3) as f64 - 60.0, 60.0 * (i / 3) as f64 - 60.0)
}

fn scene() -> Scene {
    let mut bench = Bench::new(silent(1540.0, 1.5));
    let body = bench.tissue(insonify::anatomy::Tissue { attenuation_db_cm_mhz: 0.5, ..silent(1540.0, 1.6) });
    for (_, mesh) in bodies() {
        bench.add(body, 1, mesh);
    }
    bench.scene().unwrap()
}

#[test]
fn broken_meshes_give_valid_frames_and_mended_ones_the_whole_image() {
    let mut renderer = renderer(&scene(), &linear(31, 0.7, 256, 50.0), &small(1, 1), &ShaderSet::default());
    let mut whole = None;
    for (i, (name, _)) in bodies().into_iter().enumerate() {
        let pose = at(place(i).x + 0.013, place(i).y + 0.017, 0.0);
        // Where triangles disagree about inside and outside, ambiguous edges may fall either way.
        let tolerance = if i < 5 { ROUNDING } else { Tolerance { grey: 3.0, other: 0.02 } };
        holds(name, &mut renderer, &pose, tolerance);
        let frame = frame(&mut renderer, &pose);
        let whole = whole.get_or_insert_with(|| frame.segmentation.clone());
        if i < 5 {
            assert_eq!(&frame.segmentation, whole, "{name}");
        }
    }
}

#[test]
fn duplicates_reverse_a_parity_of_crossings() {
    // A point inside by an odd count of crossings in any direction, compared with entering and leaving by the side of
    // each triangle.
    let mesh = &bodies()[2].1;
    let centre = place(2).extend(20.0);
    let mut random = SplitMix64::new(3);
    let mut naive_wrong = 0;
    for _ in 0..1000 {
        let direction = vector(&mut random).normalize();
        let crossings = mesh
            .corners_mm()
            .filter(|[a, b, c]| {
                let origin: DVec3 = centre - 200.0 * direction;
                let hit = shipped(origin.as_vec3(), direction.as_vec3(), *a, *b - *a, *c - *a);
                hit.is_some_and(|t| t < 200.0)
            })
            .count();
        naive_wrong += usize::from(crossings % 2 == 0);
    }
    assert!(naive_wrong > 900, "{naive_wrong}");
    row(
        "every triangle twice",
        format!("an odd-even count along {naive_wrong} of 1000 directions calls a point inside the body outside"),
        "a triangle's side says whether its surface is entered or left; equal hits count once",
        "the whole body's image".to_owned(),
    );
}
