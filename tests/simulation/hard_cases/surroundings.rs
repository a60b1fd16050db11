//! Hard cases of probes inside bone, in air, and outside everything.

use glam::{DQuat, DVec3, Vec3};
use insonify::anatomy::analytic::Part;
use insonify::anatomy::{TissueTable, analytic};
use insonify::pose::Pose;
use insonify::render::ShaderSet;
use insonify::selftest::bench::{at, linear, small};

use super::common::{ROUNDING, Tolerance, frame, holds, renderer};

#[test]
fn a_probe_may_be_anywhere() {
    let part = |name, tissue, priority, mesh| Part { name, tissue, priority, mesh };
    let parts = vec![
        part("body", "soft_tissue", 1, analytic::cuboid(Vec3::new(-60.0, -40.0, 0.04), Vec3::new(60.0, 40.0, 90.0))),
        part("bone", "bone_adult", 2, analytic::sphere(Vec3::new(-20.0, 0.0, 40.0), 15.0, 3)),
        part("air", "air", 3, analytic::sphere(Vec3::new(25.0, 0.0, 40.0), 12.0, 3)),
    ];
    let scene = analytic::scene(parts, &TissueTable::builtin().unwrap(), "air").unwrap();
    let mut renderer = renderer(&scene, &linear(33, 0.9, 256, 80.0), &small(2, 3), &ShaderSet::default());
    let looking =
        |from: [f64; 3], to: [f64; 3]| Pose::looking(DVec3::from(from), DVec3::from(to), DVec3::new(1.0, 0.1, 0.03));
    // Strong interfaces branch randomly: a path that branches differently is a different path.
    let chance = Tolerance { grey: 3.0, other: 0.01 };
    holds("inside bone", &mut renderer, &at(-20.0, 0.3, 40.0), chance);
    holds("inside air", &mut renderer, &at(25.0, 0.3, 40.0), chance);
    holds("in air, before the body", &mut renderer, &at(0.3, 0.2, -30.0), chance);
    holds("half in bone, half in tissue", &mut renderer, &at(-8.0, 0.2, 35.0), chance);
    holds("from behind", &mut renderer, &looking([3.0, 1.0, 120.0], [0.0, 0.1, -1.0]), chance);
    for (what, pose) in [
        ("outside, looking away", looking([0.0, 0.0, -50.0], [0.1, 0.2, -1.0])),
        ("3 m off", looking([3000.0, 0.0, 0.0], [-1.0, 0.0, 0.0])),
        ("100 m off", Pose { position_mm: DVec3::splat(1.0e5), orientation: DQuat::IDENTITY }),
    ] {
        holds(what, &mut renderer, &pose, ROUNDING);
        let frame = frame(&mut renderer, &pose);
        let air = scene.background as u8 + 1;
        assert!(frame.bmode.iter().all(|&g| g == 0), "{what}");
        assert!(frame.segmentation.iter().zip(&*frame.mask).all(|(&s, &m)| m == 0 || s == air), "{what}");
    }
}
