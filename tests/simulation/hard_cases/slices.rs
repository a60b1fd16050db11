//! Hard cases of speckle across the slice: slides that hardly move, rotations through a whole circle, slices along
//! sheets of scatterers, lenses of any shape, and positions far from the scene's centre.

use glam::{DQuat, DVec3, Vec3};
use insonify::anatomy::{Scene, analytic};
use insonify::pose::Pose;
use insonify::render::{Frame, Renderer, ShaderSet};
use insonify::selftest::bench::{Bench, grainy, linear, small};
use insonify::selftest::measure::magnitude;
use insonify::transducer::Probe;

use super::common::{ROUNDING, finite, frame, holds, renderer, row};

/// A block of speckle around the centre of the scene.
fn block(half_mm: f32) -> Scene {
    let mut bench = Bench::new(grainy(0.0, 0.01));
    bench.add(0, 1, analytic::cuboid(Vec3::splat(-half_mm), Vec3::splat(half_mm)));
    bench.scene().unwrap()
}

fn probe() -> Probe {
    linear(65, 0.3, 1024, 60.0)
}

fn on_block(half_mm: f32, probe: &Probe) -> Renderer {
    renderer(&block(half_mm), probe, &small(1, 1), &ShaderSet::default())
}

/// Pose of a slice along no axis of the scatterer lattice.
fn general() -> Pose {
    Pose {
        position_mm: DVec3::new(1.13, 2.17, 3.31),
        orientation: DQuat::from_euler(glam::EulerRot::XYZ, 0.4, 0.7, 0.9),
    }
}

fn slid(pose: &Pose, along: DVec3, mm: f64) -> Pose {
    Pose { position_mm: pose.position_mm + pose.transform_vector(along) * mm, ..*pose }
}

/// Energy of the difference between two frames' lines, relative to the energy of the first.
fn change(a: &Frame, b: &Frame) -> f64 {
    let off = a.lines.iter().zip(&b.lines).map(|(a, b)| magnitude([a[0] - b[0], a[1] - b[1]]).powi(2)).sum::<f64>();
    off / a.lines.iter().map(|&v| magnitude(v).powi(2)).sum::<f64>()
}

/// Level of the lines relative to the tissue's, dB; and mean of the envelope divided by its standard deviation.
fn statistics(frame: &Frame) -> [f64; 2] {
    let n = frame.lines.len() as f64;
    let mean = frame.lines.iter().map(|&v| magnitude(v)).sum::<f64>() / n;
    let power = frame.lines.iter().map(|&v| magnitude(v).powi(2)).sum::<f64>() / n;
    [10.0 * (power / 1e-4).log10(), mean / (power - mean * mean).sqrt()]
}

#[test]
fn a_slide_of_a_thousandth_of_a_millimetre_hardly_changes_a_frame() {
    let mut renderer = on_block(300.0, &probe());
    let first = frame(&mut renderer, &general());
    let mut most = 0.0_f64;
    for step in 1..=100 {
        let moved = frame(&mut renderer, &slid(&general(), DVec3::Y, 1e-3 * f64::from(step)));
        let before = frame(&mut renderer, &slid(&general(), DVec3::Y, 1e-3 * f64::from(step - 1)));
        most = most.max(change(&before, &moved));
    }
    // With a cell of 0.15 mm for each place, a part of 0.001/0.15 of the samples takes another scatterer.
    let naive: f64 = 2.0 * 1e-3 / 0.15;
    assert!(most < 0.1 * naive, "{most}");
    // By 0.1 mm it has changed as theory says: 1 − ρ² is about 0.03.
    let whole = change(&first, &frame(&mut renderer, &slid(&general(), DVec3::Y, 0.1)));
    assert!((0.005..0.1).contains(&whole), "{whole}");
    row(
        "speckle after a slide of 0.001 mm across the slice",
        format!("{:.2} % of its energy flips", 100.0 * naive),
        "sheets of scatterers whose weights change",
        format!("{:.4} %", 100.0 * most),
    );
}

#[test]
fn a_turn_about_each_axis_keeps_level_and_statistics() {
    let mut renderer = on_block(300.0, &probe());
    for axis in DVec3::AXES {
        let mut range = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        let mut mean = [0.0; 2];
        for step in 0..72 {
            let turn = DQuat::from_axis_angle(axis, f64::from(step) * 5f64.to_radians());
            let found = statistics(&frame(&mut renderer, &Pose { orientation: turn, ..general() }));
            for i in 0..2 {
                // A NaN fails below.
                range[i] = [range[i][0].min(found[i]), range[i][1].max(found[i])];
                mean[i] += found[i] / 72.0;
            }
        }
        println!("about {axis}: level {range:?}, mean {mean:?}");
        // Of one patch, noise included.
        assert!(mean[0].abs() < 0.4 && range[0][1] - range[0][0] < 2.0, "{axis}: {range:?} {mean:?}");
        assert!((mean[1] - 1.913).abs() < 0.03, "{axis}: {mean:?}");
    }
}

#[test]
fn a_slice_along_the_sheets_is_speckle_as_any_other() {
    let mut renderer = on_block(300.0, &probe());
    for number in 0..6u32 {
        // Found by walking: the family of a slice about each direction.
        let axis = DVec3::new(
            (1.3 * f64::from(number)).cos(),
            (1.3 * f64::from(number)).sin(),
            0.35 * f64::from(number) - 0.8,
        );
        let about = Pose { orientation: DQuat::from_rotation_arc(DVec3::Y, axis.normalize()), ..general() };
        let normal = renderer.snapshot(&about).unwrap().inputs.sheets[0].axes[0].normalize();
        // Also in the plane of a sheet, half-way between sheets, and a rounding beside.
        for mm in [0.0, 0.2, 0.4, 1e-5] {
            let along = Pose { orientation: DQuat::from_rotation_arc(DVec3::Y, normal), ..general() };
            let pose = slid(&along, DVec3::Y, mm);
            let s = renderer.snapshot(&pose).unwrap();
            finite("along the sheets", &s);
            assert!(s.inputs.sheets.len() == 1 && s.inputs.sheets[0].oblique < 1.0 + 1e-6, "{:?}", s.inputs.sheets);
            let frame = frame(&mut renderer, &pose);
            let [level_db, snr] = statistics(&frame);
            assert!(level_db.abs() < 1.0 && (snr - 1.913).abs() < 0.1, "{level_db} {snr}");
            let moved = super::common::frame(&mut renderer, &slid(&pose, DVec3::Y, 0.001));
            assert!(change(&frame, &moved) < 1e-3, "{}", change(&frame, &moved));
        }
    }
}

#[test]
fn lenses_of_any_shape_make_speckle() {
    // Without a waist, nearly flat, and beyond every probe.
    for (frequency_mhz, height_mm, focus_mm) in
        [(2.5, 12.0, 80.0), (8.0, 0.5, 1000.0), (8.0, 100.0, 1.0), (40.0, 12.0, 70.0), (0.5, 30.0, 10.0)]
    {
        let lens = Probe { elevational_height_mm: height_mm, elevational_focus_mm: focus_mm, ..probe() };
        let what = format!("a lens of {height_mm} mm focused at {focus_mm} mm, {frequency_mhz} MHz");
        let s = on_block(300.0, &Probe { frequency_mhz, ..lens }).snapshot(&general()).unwrap();
        finite(&what, &s);
        let power = s.scattered.iter().map(|v| v.length_squared()).sum::<f64>();
        assert!(power > 0.0, "{what}");
        assert!(s.inputs.sheets_per_reach_mm.iter().all(|v| v.is_finite() && *v > 0.0), "{what}");
    }
}

#[test]
fn speckle_ten_metres_from_the_centre_is_speckle() {
    let mut renderer = on_block(12_000.0, &probe());
    for place in [DVec3::new(10_000.0, 0.0, 0.0), DVec3::new(-6000.0, 7000.0, 4000.0)] {
        let pose = Pose { position_mm: place, ..general() };
        let [level_db, snr] = statistics(&frame(&mut renderer, &pose));
        assert!(level_db.abs() < 1.0 && (snr - 1.913).abs() < 0.1, "{level_db} {snr}");
        let first = frame(&mut renderer, &pose);
        let near = change(&first, &frame(&mut renderer, &slid(&pose, DVec3::Y, 0.05)));
        let far = change(&first, &frame(&mut renderer, &slid(&pose, DVec3::Y, 0.5)));
        println!("at {place}: {near:.4} after 0.05 mm, {far:.3} after 0.5 mm");
        // Coordinates are rounded to 0.001 mm there.
        assert!(near < 0.06 && (0.1..1.2).contains(&far), "{near} {far}");
    }
    holds("at the centre of a large block", &mut renderer, &general(), ROUNDING);
}
