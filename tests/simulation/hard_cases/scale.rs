//! Hard cases of scale: the largest dimension of a scene is 10⁶ times the smallest.

use glam::Vec3;
use insonify::anatomy::analytic;
use insonify::render::ShaderSet;
use insonify::selftest::bench::{Bench, at, linear, silent, small};

use super::common::{Tolerance, assert_pass_contains, holds, renderer, row, vector};
use super::triangles::{SHIPPED, shipped};
use insonify::random::SplitMix64;

/// Distance to the plane of a triangle by the published test of Möller and Trumbore, which refers to the ray's origin.
fn naive(origin: Vec3, direction: Vec3, corner: Vec3, edge1: Vec3, edge2: Vec3) -> f32 {
    let s = origin - corner;
    edge2.dot(s.cross(edge1)) / edge1.dot(direction.cross(edge2))
}

#[test]
fn small_triangles_far_from_the_rays_origin_keep_their_place() {
    assert_pass_contains("trace", &SHIPPED);
    let mut random = SplitMix64::new(9);
    let (mut naive_worst, mut shipped_worst, mut missed) = (0.0_f64, 0.0_f64, 0);
    for _ in 0..5000 {
        // Sides of 0.1 mm, a metre from the origin.
        let (origin, direction) = ((1000.0 * vector(&mut random)).as_vec3(), vector(&mut random).normalize().as_vec3());
        let distance = random.between(500.0, 1500.0);
        let mut edge = || (0.1 * vector(&mut random)).as_vec3();
        let (edge1, edge2) = (edge(), edge());
        let normal = edge1.as_dvec3().cross(edge2.as_dvec3()).normalize();
        if normal.dot(direction.as_dvec3()).abs() < 0.3 {
            continue;
        }
        // The ray meets the triangle a third of each edge from its corner.
        let hit = origin.as_dvec3() + direction.as_dvec3() * distance;
        let corner = (hit - (edge1.as_dvec3() + edge2.as_dvec3()) / 3.0).as_vec3();
        let exact = (corner.as_dvec3() - origin.as_dvec3()).dot(normal) / direction.as_dvec3().dot(normal);
        naive_worst = naive_worst.max((f64::from(naive(origin, direction, corner, edge1, edge2)) - exact).abs());
        match shipped(origin, direction, corner, edge1, edge2) {
            Some(t) => shipped_worst = shipped_worst.max((f64::from(t) - exact).abs()),
            None => missed += 1,
        }
    }
    assert_eq!(missed, 0);
    assert!(naive_worst > 5.0 * shipped_worst, "{naive_worst} {shipped_worst}");
    assert!(shipped_worst < 1e-2, "{shipped_worst}");
    row(
        "triangles of 0.1 mm a metre away",
        format!("distances are off by up to {:.1} µm", 1e3 * naive_worst),
        "intersect about the point of the ray nearest to the corner",
        format!("{:.2} µm", 1e3 * shipped_worst),
    );
}

#[test]
fn ten_micrometres_and_twenty_metres_in_one_scene() {
    let mut bench = Bench::new(silent(1540.0, 1.5));
    let (wide, fine) = (bench.tissue(silent(1540.0, 1.6)), bench.tissue(silent(1540.0, 1.9)));
    // A box of 20 m that contains bodies of 0.2, 2 and 20 mm and a film of 20 µm.
    bench.add(wide, 1, analytic::cuboid(Vec3::new(-1e4, -1e4, 5.03), Vec3::splat(1e4)));
    for (i, radius) in [0.1, 1.0, 10.0].into_iter().enumerate() {
        bench.add(fine, 2, analytic::sphere(Vec3::new(30.0 * i as f32, 0.0, 25.0), radius, 3));
    }
    bench.add(fine, 2, analytic::cuboid(Vec3::new(80.0, -10.0, 25.0), Vec3::new(100.0, 10.0, 25.02)));
    let scene = bench.scene().unwrap();
    let mut renderer = renderer(&scene, &linear(33, 0.3, 512, 50.0), &small(1, 1), &ShaderSet::default());
    // Five metres from the scene's centre, f32 resolves half a micrometre.
    let loose = Tolerance { grey: 6.0, other: 0.02 };
    for x in [0.0, 30.0, 60.0, 90.0] {
        holds(&format!("at {x} mm in a box of 20 m"), &mut renderer, &at(x + 0.01, 0.02, 0.0), loose);
    }
}
