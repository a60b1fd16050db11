//! Tests of speckle as the probe slides out of its slice: correlation by diffraction of the lens, statistics and level.
//!
//! `tests/truth/elevation.csv` holds correlations computed by an independent program.

use std::sync::LazyLock;

use glam::{DQuat, DVec2, DVec3};
use insonify::pose::Pose;
use insonify::render::{Choice, Effect, RenderSettings};
use insonify::transducer::Probe;

use super::bench::{Rig, grainy, linear, mean_square, small};
use super::speckle::block;
use crate::truth::fixtures::{Row, rows};

/// Depths of the measured patches, mm; `HALF_MM` is half their height.
const DEPTHS_MM: [f64; 3] = [30.0, 70.0, 120.0];
const HALF_MM: f64 = 9.0;

/// Rows of `elevation.csv`.
static ROWS: LazyLock<Vec<Row>> = LazyLock::new(|| rows("elevation.csv"));

/// Expected correlation at a frequency, depth and slide, interpolated linearly between the tabled slides.
fn truth(frequency_mhz: f64, depth_mm: f64, slide_mm: f64) -> f64 {
    let lens = [("frequency_mhz", frequency_mhz), ("height_mm", 12.0), ("focus_mm", 70.0), ("depth_mm", depth_mm)];
    let of_lens = |row: &&Row| lens.iter().all(|&(column, value)| row.number(column) == value);
    let points: Vec<_> =
        ROWS.iter().filter(of_lens).map(|row| (row.number("slide_mm"), row.number("correlation"))).collect();
    let after = points.iter().position(|point| point.0 >= slide_mm).unwrap().max(1);
    let (a, b) = (points[after - 1], points[after]);
    a.1 + (b.1 - a.1) * (slide_mm - a.0) / (b.0 - a.0)
}

/// Poses of slices along no axis of the scatterer lattice.
fn slices() -> Vec<Pose> {
    let turned = |x, y, z| DQuat::from_euler(glam::EulerRot::XYZ, x, y, z);
    let at = |position: [f64; 3], orientation| Pose { position_mm: position.into(), orientation };
    vec![
        at([0.0, 0.0, 0.0], DQuat::IDENTITY),
        at([13.0, -7.0, 31.0], turned(0.4, 0.7, 0.9)),
        at([-21.0, 17.0, 5.0], turned(-1.1, 0.3, 2.0)),
        at([3.0, 41.0, -12.0], turned(2.2, -0.5, 0.2)),
        at([33.0, 1.0, 2.0], turned(0.1, -1.3, -0.7)),
        at([-4.0, -29.0, 19.0], turned(-0.6, 1.1, 1.4)),
    ]
}

/// A linear probe with scanlines 0.3 mm apart over 43 mm.
fn probe(frequency_mhz: f64) -> Probe {
    Probe { frequency_mhz, ..linear(144, 0.3, 2600, 130.0) }
}

fn rig(frequency_mhz: f64, settings: RenderSettings) -> Rig {
    Rig::new(&block(grainy(0.0, 0.01)), &probe(frequency_mhz), &settings)
}

/// Complex samples of the patch at each depth, without scanlines whose beam the array's end cuts.
fn patch(rig: &mut Rig, pose: &Pose) -> [Vec<DVec2>; 3] {
    let frame = rig.frame(pose);
    let sample = |mm: f64| (mm / rig.probe.sample_spacing_mm()) as usize;
    DEPTHS_MM.map(|depth| {
        let lines = (8..rig.probe.scanlines - 8).flat_map(|line| {
            let samples = &rig.line(&frame, line)[sample(depth - HALF_MM)..sample(depth + HALF_MM)];
            samples.iter().map(|s| DVec2::new(s[0].into(), s[1].into())).collect::<Vec<_>>()
        });
        lines.collect()
    })
}

fn correlation(a: &[DVec2], b: &[DVec2]) -> f64 {
    let power = |of: &[DVec2]| of.iter().map(|v| v.length_squared()).sum::<f64>();
    // `rotate` by the conjugate is the product of a complex correlation.
    let sum: DVec2 = a.iter().zip(b).map(|(a, b)| DVec2::new(b.x, -b.y).rotate(*a)).sum();
    sum.length() / (power(a) * power(b)).sqrt()
}

/// A pose slid along its elevational axis.
fn slid(pose: &Pose, mm: f64) -> Pose {
    Pose { position_mm: pose.position_mm + pose.transform_vector(DVec3::Y) * mm, ..*pose }
}

#[test]
fn speckle_follows_a_slide_as_the_lens_makes_it() {
    let slides = [0.05, 0.1, 0.15, 0.2, 0.3, 0.5, 0.75, 1.0, 1.5];
    for frequency_mhz in [5.0, 8.0] {
        let mut rig = rig(frequency_mhz, small(1, 1));
        let slices = slices();
        let mut found = [[0.0; 9]; 3];
        let mut worst = 0.0_f64;
        for slice in &slices {
            let first = patch(&mut rig, slice);
            for (i, &slide) in slides.iter().enumerate() {
                let now = patch(&mut rig, &slid(slice, slide));
                for depth in 0..3 {
                    let rho = correlation(&first[depth], &now[depth]);
                    found[depth][i] += rho / slices.len() as f64;
                    worst = worst.max((rho - truth(frequency_mhz, DEPTHS_MM[depth], slide)).abs());
                }
            }
        }
        println!("{frequency_mhz} MHz: worst of a single slice {worst:.3}");
        for (depth, row) in DEPTHS_MM.into_iter().zip(found) {
            for (slide, rho) in slides.into_iter().zip(row) {
                let theory = truth(frequency_mhz, depth, slide);
                println!("{frequency_mhz} MHz, {depth} mm, {slide} mm: {rho:.3}, theory {theory:.3}");
                assert!((rho - theory).abs() <= 0.05, "{frequency_mhz} MHz, {depth} mm, {slide} mm: {rho}, {theory}");
            }
        }
        assert!(worst <= 0.1, "{worst}");
    }
}

#[test]
fn speckle_changes_smoothly() {
    for frequency_mhz in [5.0, 8.0] {
        let mut rig = rig(frequency_mhz, small(1, 1));
        for slice in &slices()[..2] {
            let first = patch(&mut rig, slice);
            let mut before = first.clone();
            let mut since = [1.0; 3];
            for step in 1..=30 {
                let now = patch(&mut rig, &slid(slice, 0.02 * f64::from(step)));
                for depth in 0..3 {
                    let theory = |mm| truth(frequency_mhz, DEPTHS_MM[depth], mm);
                    let alike = correlation(&before[depth], &now[depth]);
                    assert!(alike >= theory(0.02) - 4e-4, "step {step} of {frequency_mhz} MHz: {alike}");
                    // The largest fall of theory's curve.
                    let steepest = (0..40).map(|i| theory(0.02 * f64::from(i)) - theory(0.02 * f64::from(i + 1)));
                    let steepest = steepest.fold(0.0, f64::max);
                    let rho = correlation(&first[depth], &now[depth]);
                    assert!(since[depth] - rho <= steepest + 0.004, "step {step}: {} {rho} {steepest}", since[depth]);
                    since[depth] = rho;
                }
                before = now;
            }
        }
    }
}

#[test]
fn tilts_and_turns_change_speckle_by_the_way_of_each_place() {
    let mut rig = rig(8.0, small(1, 1));
    let slices = slices();
    for (angle_deg, depth) in [(0.1, 1), (0.2, 1), (0.4, 1), (0.2, 2), (0.5, 0)] {
        let mut about = |axis: DVec3| {
            let turn = DQuat::from_axis_angle(axis, f64::to_radians(angle_deg));
            let alike = slices.iter().map(|slice| {
                let turned = Pose { orientation: slice.orientation * turn, ..*slice };
                correlation(&patch(&mut rig, slice)[depth], &patch(&mut rig, &turned)[depth])
            });
            alike.collect::<Vec<_>>().iter().sum::<f64>() / slices.len() as f64
        };
        // About the lateral axis of the face every place at a depth moves alike.
        let (found, theory) =
            (about(DVec3::X), truth(8.0, DEPTHS_MM[depth], DEPTHS_MM[depth] * angle_deg.to_radians()));
        println!("tilt by {angle_deg}° at {} mm: {found:.3}, theory {theory:.3}", DEPTHS_MM[depth]);
        assert!((found - theory).abs() < 0.05, "{found} {theory}");
    }
    // A turned elevational line meets the sheets up to 1 mm aside at other places of their cells, which theory lacks.
    for (angle_deg, within) in [(0.5, 0.03), (1.0, 0.05), (2.0, 0.1)] {
        let turn = DQuat::from_rotation_z(f64::to_radians(angle_deg));
        let found = slices.iter().map(|slice| {
            let turned = Pose { orientation: slice.orientation * turn, ..*slice };
            correlation(&patch(&mut rig, slice)[1], &patch(&mut rig, &turned)[1])
        });
        let found = found.collect::<Vec<_>>().iter().sum::<f64>() / slices.len() as f64;
        let ways = (0..128).map(|i| truth(8.0, 70.0, 0.3 * (f64::from(i) - 63.5).abs() * angle_deg.to_radians()));
        let theory = ways.sum::<f64>() / 128.0;
        println!("turn by {angle_deg}°: {found:.3}, theory {theory:.3}");
        assert!((found - theory).abs() < within, "{found} {theory}");
    }
}

#[test]
fn a_turn_from_family_to_family_is_smooth() {
    // Slices are turned by 120° about the face's lateral axis: borders of several families.
    let mut rig = rig(8.0, small(1, 1));
    let near = |rig: &mut Rig, angle_deg: f64| {
        let orientation = slices()[1].orientation * DQuat::from_rotation_x(angle_deg.to_radians());
        let frame = rig.frame(&Pose { orientation, ..slices()[1] });
        let lines = (8..rig.probe.scanlines - 8).flat_map(|line| rig.line(&frame, line)[160..400].to_vec());
        lines.map(|s| DVec2::new(s[0].into(), s[1].into())).collect::<Vec<_>>()
    };
    let mut before = near(&mut rig, 0.0);
    let (mut least, mut mean) = (1.0_f64, 0.0);
    for step in 1..=600 {
        // 14 mm deep the step is a slide of 0.05 mm.
        let now = near(&mut rig, 0.2 * f64::from(step));
        let alike = correlation(&before, &now);
        (least, mean) = (least.min(alike), mean + alike / 600.0);
        before = now;
    }
    println!("steps of 0.2° at 8 to 20 mm: least {least:.3}, mean {mean:.3}");
    assert!(least > mean - 0.02, "{least} {mean}");
}

#[test]
fn speckle_across_the_slice_keeps_level_and_statistics() {
    let mut off = small(1, 1);
    off.effects = off.effects.with(Effect::ElevationalSpeckle, Choice::Off);
    for frequency_mhz in [5.0, 8.0] {
        let found = [small(1, 1), off].map(|settings| {
            let mut rig = rig(frequency_mhz, settings);
            let (mut powers, mut ratios) = (Vec::new(), Vec::new());
            for (i, slice) in slices().iter().enumerate() {
                for more in 0..4 {
                    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 1.3 * f64::from(more), i as f64, 2.1);
                    let slice = Pose { orientation: slice.orientation * turn, ..*slice };
                    for samples in patch(&mut rig, &slice) {
                        let power = mean_square(samples.iter().map(|v| v.length()));
                        let mean = samples.iter().map(|v| v.length()).sum::<f64>() / samples.len() as f64;
                        ratios.push(mean / (power - mean * mean).sqrt());
                        powers.push(10.0 * (power / 1e-4).log10());
                    }
                }
            }
            let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
            let (level_db, snr) = (mean(&powers), mean(&ratios));
            let spread = (powers.iter().map(|p| (p - level_db).powi(2)).sum::<f64>() / powers.len() as f64).sqrt();
            println!("{frequency_mhz} MHz: {level_db:+.2} ± {spread:.2} dB, SNR {snr:.3}");
            (level_db, snr)
        });
        let (with, without) = (found[0], found[1]);
        assert!((with.0 - without.0).abs() < 0.2 && (with.1 - 1.913).abs() < 0.03, "{found:?}");
    }
}
