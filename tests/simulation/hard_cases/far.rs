//! Hard cases of scenes far from the origin, or in the wrong unit.

use glam::{DVec3, Vec3};
use insonify::anatomy::{Mesh, Scene, analytic};
use insonify::pose::Pose;
use insonify::render::ShaderSet;
use insonify::selftest::bench::{Bench, at, grainy, linear, silent, small};

use super::common::{ROUNDING, frame, holds, renderer, row, words};

/// A plate in speckle, scaled and moved. Its corners are on multiples of 1/64 mm, which f32 represents exactly even 98
/// m away.
fn moved(offset: Vec3, scale: f32) -> Scene {
    let mut bench = Bench::new(silent(1540.0, 1.5));
    let (grain, plate) = (bench.tissue(grainy(0.0, 0.01)), bench.tissue(silent(1450.0, 1.8)));
    let to = |mesh: Mesh| Mesh { vertices_mm: mesh.vertices_mm.iter().map(|&v| v * scale + offset).collect(), ..mesh };
    let corner = |x: f32, y: f32, z: f32| Vec3::new(x, y, z) / 64.0;
    bench.add(grain, 1, to(analytic::cuboid(corner(-1900.0, -1900.0, 130.0), corner(1900.0, 1900.0, 3201.0))));
    bench.add(plate, 2, to(analytic::cuboid(corner(-700.0, -1500.0, 1203.0), corner(900.0, 1500.0, 1501.0))));
    bench.scene().unwrap()
}

/// A pose whose samples are off the faces of the scatterer lattice, where rounding would decide the cell.
fn near() -> Pose {
    at(0.1337, 0.2171, 0.0)
}

#[test]
fn a_scene_moved_by_100_metres_gives_the_same_frame() {
    let probe = linear(65, 0.5, 512, 55.0);
    let offset = Vec3::new(98_304.0, -65_536.0, 81_920.0);
    let here = frame(&mut renderer(&moved(Vec3::ZERO, 1.0), &probe, &small(1, 1), &ShaderSet::default()), &near());
    let pose = Pose { position_mm: near().position_mm + offset.as_dvec3(), ..at(0.0, 0.0, 0.0) };
    let mut there = renderer(&moved(offset, 1.0), &probe, &small(1, 1), &ShaderSet::default());
    holds("100 m from the origin", &mut there, &pose, ROUNDING);
    // Poses are f64: at this offset 0.1 mm is exact to 10⁻¹¹ mm, which f32 may or may not round away.
    let there = frame(&mut there, &pose);
    let differ = words(&here).iter().zip(words(&there)).filter(|(a, b)| **a != *b).count();
    assert_eq!((&here.segmentation, differ), (&there.segmentation, 0));

    // The same distance from absolute f32 coordinates.
    let mut naive = 0.0_f64;
    for i in 0..1000 {
        let z = f64::from(i) * 0.0537;
        let (probe_z, plate_z) = (f64::from(offset.z) + 0.0113, f64::from(offset.z) + 0.0113 + z);
        naive = naive.max((f64::from(plate_z as f32 - probe_z as f32) - z).abs());
    }
    let turns = naive * probe.phase_turns_per_mm();
    assert!(naive > 3e-3, "{naive}");
    row(
        "a scene 100 m from the origin",
        format!("ranges are off by {:.1} µm, phases by {turns:.2} turns", 1e3 * naive),
        "device coordinates are relative to the scene's centre, subtracted in f64",
        "bit-identical to the scene at the origin".to_owned(),
    );
}

#[test]
fn a_wrong_unit_gives_a_wrong_but_finite_picture() {
    let probe = linear(33, 0.5, 256, 55.0);
    // Metres read as mm: a grain of sand. Micrometres read as mm: walls a hundred metres apart.
    for (what, scale) in [("a thousandth of the size", 1e-3), ("a thousand times the size", 1e3)] {
        let mut renderer = renderer(&moved(Vec3::ZERO, scale), &probe, &small(1, 1), &ShaderSet::default());
        for z in [0.0, 0.02, 30.0, 20_000.0] {
            let pose = Pose { position_mm: DVec3::new(0.0013, 0.0017, z), ..at(0.0, 0.0, 0.0) };
            holds(&format!("{what}, at {z} mm"), &mut renderer, &pose, ROUNDING);
        }
    }
}
