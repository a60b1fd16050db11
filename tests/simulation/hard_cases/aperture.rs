//! Hard cases of the aperture's gain. Obstacles are on the face or at its end, narrower than a cell, fully opaque, or
//! absent; apertures are wider than the face; faces have any radius.

use glam::{DVec2, Vec3};
use insonify::anatomy::{Scene, Tissue, analytic};
use insonify::render::{Choice, Frame, Renderer, ShaderSet};
use insonify::selftest::bench::{Bench, at, grainy, linear, slab};
use insonify::selftest::measure::{line, magnitude};
use insonify::transducer::{Probe, ProbeKind};

use super::common::{ROUNDING, frame, holds, renderer, row, settings};

/// Speckle with boxes that absorb `db_cm_mhz`; each is given by its lower and upper corner, mm.
fn obstacles(db_cm_mhz: f64, boxes: &[[[f32; 3]; 2]]) -> Scene {
    let mut bench = Bench::new(grainy(0.0, 0.01));
    let opaque = bench.tissue(Tissue { attenuation_db_cm_mhz: db_cm_mhz, ..grainy(0.0, 0.01) });
    for &[low, high] in boxes {
        bench.add(opaque, 1, analytic::cuboid(Vec3::from(low), Vec3::from(high)));
    }
    // A scene has a surface: this one lies far from every beam.
    bench.add(0, 1, slab(DVec2::new(900.0, 0.0), 1.0, 0.0, 1.0));
    bench.scene().unwrap()
}

fn probe() -> Probe {
    linear(96, 0.4, 512, 100.0)
}

#[test]
fn obstacles_anywhere_match_the_twin() {
    const FAR: f32 = 60.0;
    type Boxes = Vec<[[f32; 3]; 2]>;
    let cases: [(&str, f64, Boxes); 9] = [
        ("half of the face is covered", 40.0, vec![[[-FAR, -FAR, -1.0], [0.0, FAR, 2.0]]]),
        ("all of the face is covered", 40.0, vec![[[-FAR, -FAR, -1.0], [FAR, FAR, 5.0]]]),
        ("a plate that touches the face", 40.0, vec![[[-4.0, -FAR, 0.0], [4.0, FAR, 0.7]]]),
        ("at the end of the array", 40.0, vec![[[17.0, -FAR, 30.0], [25.0, FAR, 31.0]]]),
        ("narrower than a cell", 40.0, vec![[[0.1, -FAR, 30.0], [0.2, FAR, 30.5]]]),
        ("thinner than a sample", 100.0, vec![[[-2.0, -FAR, 30.0], [2.0, FAR, 30.01]]]),
        ("opaque beyond all measure", 100.0, vec![[[-2.0, -FAR, 30.0], [2.0, FAR, 60.0]]]),
        ("nothing is lost", 0.0, vec![[[-2.0, -FAR, 30.0], [2.0, FAR, 35.0]]]),
        (
            "a grid of bars",
            100.0,
            (0..12).map(|i| 3.0 * i as f32 - 18.0).map(|x| [[x, -FAR, 20.0], [x + 1.5, FAR, 21.0]]).collect(),
        ),
    ];
    for (what, loss, boxes) in cases {
        let scene = obstacles(loss, &boxes);
        for (rays, layers) in [(1, 1), (3, 2)] {
            let settings = settings(rays, layers, Choice::On);
            let mut renderer = renderer(&scene, &probe(), &settings, &ShaderSet::default());
            let at = at(0.011, 0.012, 0.0);
            let snapshot = holds(&format!("{what}, {rays} x {layers}"), &mut renderer, &at, ROUNDING);
            assert!(snapshot.inputs.aperture.is_some(), "{what}");
        }
    }
}

#[test]
fn apertures_and_faces_of_any_size_match_the_twin() {
    let convex = |radius_mm, fov_deg| ProbeKind::Convex { radius_mm, fov_deg };
    let cases = [
        ("an aperture wider than the face", Probe { aperture_mm: 30.0, ..linear(32, 0.25, 512, 100.0) }),
        ("an aperture as wide as the face", Probe { aperture_mm: 38.4, ..probe() }),
        ("an aperture of 1 mm", Probe { aperture_mm: 1.0, ..probe() }),
        ("a focus on the face", Probe { focus_mm: 1.0, ..probe() }),
        ("a focus at infinity", Probe { focus_mm: 1000.0, ..probe() }),
        ("a lens without a waist", Probe { elevational_height_mm: 4.0, elevational_focus_mm: 500.0, ..probe() }),
        ("a face of 8 mm radius", Probe { kind: convex(8.0, 140.0), ..probe() }),
        ("a face of 500 mm radius", Probe { kind: convex(500.0, 4.0), ..probe() }),
        ("15 MHz", Probe { frequency_mhz: 15.0, depth_mm: 40.0, focus_mm: 20.0, ..probe() }),
        ("1 MHz, 300 mm deep", Probe { frequency_mhz: 1.0, depth_mm: 300.0, ..probe() }),
        ("one scanline", Probe { ..linear(1, 0.4, 512, 100.0) }),
    ];
    let scene = obstacles(40.0, &[[[-3.0, -60.0, 15.0], [1.0, 60.0, 16.0]], [[4.0, -60.0, 25.0], [30.0, 60.0, 26.0]]]);
    let mut renderer = renderer(&scene, &probe(), &settings(1, 1, Choice::On), &ShaderSet::default());
    for (what, probe) in cases {
        for (rays, layers) in [(1, 1), (2, 3)] {
            renderer.reconfigure(&probe, &settings(rays, layers, Choice::On)).unwrap();
            let at = at(0.011, 0.012, 0.0);
            let snapshot = holds(&format!("{what}, {rays} x {layers}"), &mut renderer, &at, ROUNDING);
            assert!(snapshot.inputs.aperture.is_some(), "{what}");
        }
    }
}

#[test]
fn a_body_of_one_tissue_looks_the_same_without_the_aperture() {
    // The loss is the same for all paths, so there is nothing to look past.
    for loss in [0.0, 0.5, 2.0] {
        let mut bench = Bench::new(Tissue { attenuation_db_cm_mhz: loss, ..grainy(0.0, 0.01) });
        bench.add(0, 1, slab(DVec2::new(900.0, 0.0), 1.0, 0.0, 1.0));
        let scene = bench.scene().unwrap();
        for kind in [probe().kind, ProbeKind::Convex { radius_mm: 40.0, fov_deg: 60.0 }] {
            let probe = Probe { kind, ..probe() };
            let frames = [Choice::On, Choice::Off].map(|aperture| {
                let mut renderer = renderer(&scene, &probe, &settings(1, 1, aperture), &ShaderSet::default());
                frame(&mut renderer, &at(0.011, 0.012, 0.0))
            });
            // Scanlines whose aperture the ends of the array don't cut.
            let whole = |frame: &Frame| {
                let lines = probe.scanlines / 3..probe.scanlines - probe.scanlines / 3;
                lines.flat_map(|number| line(&probe, frame, number).to_vec()).collect::<Vec<_>>()
            };
            let [with, without] = frames.each_ref().map(whole);
            let size: f64 = without.iter().map(|&v| magnitude(v).powi(2)).sum();
            let pairs = with.iter().zip(&without);
            let off: f64 = pairs.map(|(a, b)| magnitude([a[0] - b[0], a[1] - b[1]]).powi(2)).sum();
            assert!(off < 1e-4 * size, "{loss} dB/cm/MHz, {kind:?}: {}", off / size);
        }
    }
}

#[test]
fn a_shadow_moves_without_jumps() {
    let scene = obstacles(100.0, &[[[-1.5, -60.0, 40.0], [1.5, 60.0, 41.0]]]);
    let probe = Probe { focus_mm: 60.0, ..linear(127, 0.3, 1024, 100.0) };
    // Level at 20 to 40 mm behind the rod on the middle scanline, over that without it, as the probe slides past.
    let levels_db = |aperture: Choice| -> Vec<f64> {
        let power = |renderer: &mut Renderer, x: f64| {
            let frame = frame(renderer, &at(x, 0.0, 0.0));
            let sample = |mm: f64| (mm / probe.sample_spacing_mm()) as usize;
            let samples = &line(&probe, &frame, probe.scanlines / 2)[sample(60.0)..sample(80.0)];
            samples.iter().map(|&v| magnitude(v).powi(2)).sum::<f64>()
        };
        let mut with = renderer(&scene, &probe, &settings(1, 1, aperture), &ShaderSet::default());
        let empty = obstacles(0.0, &[[[-1.5, -60.0, 40.0], [1.5, 60.0, 41.0]]]);
        let mut without = renderer(&empty, &probe, &settings(1, 1, aperture), &ShaderSet::default());
        let at_place = |i: i32| {
            let x = 0.1 * f64::from(i) + 0.013;
            10.0 * (power(&mut with, x) / power(&mut without, x)).max(1e-12).log10()
        };
        (0..60).map(at_place).collect()
    };
    let steepest = |levels: &[f64]| levels.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
    let (seen, straight) = (levels_db(Choice::On), levels_db(Choice::Off));
    println!("{seen:.1?}\n{straight:.1?}");
    let (seen, straight) = (steepest(&seen), steepest(&straight));
    assert!(seen < 3.0 && straight > 2.0 * seen, "{seen}, {straight}");
    row(
        "a probe slides past a rod of 3 mm in steps of 0.1 mm",
        format!("straight paths: the speckle behind it jumps by {straight:.0} dB"),
        "what the aperture sees, by waves through the scan plane; cells share the rays on their borders",
        format!("{seen:.1} dB a step"),
    );
}

#[test]
fn an_obstacle_changes_nothing_before_it() {
    // A thin plate late in an interval of 3 mm; its scanlines and those beside it.
    let scene = obstacles(100.0, &[[[-6.0, -60.0, 47.6], [6.0, 60.0, 48.6]]]);
    let probe = Probe { focus_mm: 50.0, ..linear(127, 0.3, 1024, 100.0) };
    let frames = [Choice::On, Choice::Off].map(|aperture| {
        let mut renderer = renderer(&scene, &probe, &settings(1, 1, aperture), &ShaderSet::default());
        frame(&mut renderer, &at(0.011, 0.012, 0.0))
    });
    let sample = |mm: f64| (mm / probe.sample_spacing_mm()) as usize;
    let power = |frame: &Frame, number: u32| {
        let samples = &line(&probe, frame, number)[sample(44.0)..sample(47.0)];
        samples.iter().map(|&v| magnitude(v).powi(2)).sum::<f64>()
    };
    // Scanlines whose aperture the ends of the array don't cut.
    for number in 34..93 {
        let change_db = 10.0 * (power(&frames[0], number) / power(&frames[1], number)).log10();
        assert!(change_db.abs() < 0.5, "scanline {number}: {change_db} dB");
    }
}
