//! Hard cases of bent beams: delays of many wavelengths between adjacent cells, borders along the axis, a lens on the
//! face, hard bodies in part of the aperture, and beams that leave the sector.

use glam::Vec3;
use insonify::anatomy::{Mesh, Scene, Tissue, analytic};
use insonify::render::{Choice, ShaderSet, Snapshot};
use insonify::selftest::bench::{Bench, at, grainy, linear, silent};
use insonify::transducer::{Probe, ProbeKind};

use super::common::{ROUNDING, holds, renderer, settings};

/// Extent of bodies across the scan plane and to its sides, mm.
const FAR: f32 = 60.0;

fn cuboid(x: [f32; 2], z: [f32; 2]) -> Mesh {
    analytic::cuboid(Vec3::new(x[0], -FAR, z[0]), Vec3::new(x[1], FAR, z[1]))
}

/// Speckle of 1540 m/s, with bodies of the same scatterers but another speed.
fn bodies(speed_m_s: f64, meshes: Vec<Mesh>) -> Scene {
    let mut bench = Bench::new(grainy(0.0, 0.01));
    let body = bench.tissue(Tissue { speed_m_s, ..grainy(0.0, 0.01) });
    for mesh in meshes {
        bench.add(body, 1, mesh);
    }
    bench.scene().unwrap()
}

/// Largest lateral offset of a beam's echo power from its scanline, in mm at the image's depth. Depth planes deeper
/// than the fraction `from` of the image count.
fn greatest_shift_mm(snapshot: &Snapshot, probe: &Probe, from: f64) -> f64 {
    let planes = snapshot.profiles.len() / probe.scanlines as usize;
    let behind = &snapshot.profiles[(from * planes as f64) as usize * probe.scanlines as usize..];
    let shift = |weights: &[f64]| {
        let half = (weights.len() / 2) as f64;
        let power: f64 = weights.iter().map(|w| w * w).sum();
        let moment: f64 = weights.iter().enumerate().map(|(tap, w)| (tap as f64 - half) * w * w).sum();
        if power > 0.0 { (moment / power).abs() } else { 0.0 }
    };
    let greatest = behind.iter().map(|profile| shift(&profile.weights)).fold(0.0, f64::max);
    greatest * probe.line_spacing_mm(probe.depth_mm)
}

#[test]
fn beams_behind_any_delay_match_the_twin() {
    let linear = linear(96, 0.4, 512, 100.0);
    let narrow = Probe { kind: ProbeKind::Convex { radius_mm: 40.0, fov_deg: 30.0 }, ..linear };
    let comb = || (0..24).map(|i| 1.6 * i as f32 - 19.2).map(|x| cuboid([x, x + 0.8], [10.0, 40.0])).collect();
    let wedge = || {
        let turned = glam::Quat::from_rotation_y(30.0_f32.to_radians());
        vec![analytic::plate(Vec3::new(0.0, 0.0, 30.0) + turned * (20.0 * Vec3::Z), Vec3::new(FAR, FAR, 40.0), turned)]
    };
    // Whether beams are shifted, by more than 0.5 mm, at half of the depth and below.
    let cases = [
        ("a comb that delays by 16 wavelengths from cell to cell", bodies(1700.0, comb()), linear, true),
        ("a border along the axis", bodies(1600.0, vec![cuboid([0.011, 2.0 * FAR], [-5.0, 120.0])]), linear, true),
        ("a lens on the face", bodies(1600.0, vec![analytic::sphere(Vec3::ZERO, 20.0, 4)]), linear, true),
        ("a wedge that leads beams out of the sector", bodies(1650.0, wedge()), narrow, true),
        ("bone before half of the aperture", bodies(3500.0, vec![cuboid([0.0, FAR], [5.0, 8.0])]), linear, false),
        ("gas before half of the aperture", bodies(343.0, vec![cuboid([0.0, FAR], [5.0, 8.0])]), linear, false),
    ];
    for (what, scene, probe, shifted) in cases {
        for (rays, layers) in [(1, 1), (3, 2)] {
            let mut renderer = renderer(&scene, &probe, &settings(rays, layers, Choice::On), &ShaderSet::default());
            let snapshot =
                holds(&format!("{what}, {rays} x {layers}"), &mut renderer, &at(0.011, 0.012, 0.0), ROUNDING);
            let shift_mm = greatest_shift_mm(&snapshot, &probe, 0.5);
            println!("{what}, {rays} x {layers}: greatest shift {shift_mm:.2} mm");
            assert!(!shifted || shift_mm > 0.5, "{what}: {shift_mm} mm");
        }
    }
}

#[test]
fn a_medium_as_fast_as_assumed_bends_nothing() {
    // Another impedance alone: nothing is delayed, so profiles are the kernel.
    let mut bench = Bench::new(grainy(0.0, 0.01));
    let body = bench.tissue(silent(1540.0, 1.62));
    bench.add(body, 1, cuboid([0.0, FAR], [20.0, 40.0]));
    let scene = bench.scene().unwrap();
    let probe = linear(96, 0.4, 512, 100.0);
    let mut renderer = renderer(&scene, &probe, &settings(1, 1, Choice::On), &ShaderSet::default());
    let snapshot = holds("no delay", &mut renderer, &at(0.011, 0.012, 0.0), ROUNDING);
    let middle = |i: usize| (32..64).contains(&(i % probe.scanlines as usize));
    // Beams whose apertures don't reach the array's ends; the border hardly scatters.
    let kept = snapshot.profiles.iter().enumerate().filter(|&(i, _)| middle(i)).map(|(_, profile)| profile.kept);
    let least = kept.fold(1.0, f64::min);
    assert!(least > 0.99, "the least part of the kernel is {least}");
}
