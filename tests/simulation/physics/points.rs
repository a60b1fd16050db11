//! Tests of point targets: −6 dB widths of pulse and beam at any buffer spacing, and compared with diffraction.

use glam::{DVec2, DVec3};
use insonify::acoustics::pulse::FWHM_PER_SIGMA;
use insonify::settings::{Apodization, Samples};
use insonify::transducer::{Probe, ProbeKind};

use super::bench::{Bench, Rig, assert_part, at, half_width, linear, magnitude, post, silent, small};
use crate::truth::fixtures::{Row, rows};

#[test]
fn point_widths_are_those_of_pulse_and_beam_at_every_sampling() {
    let convex = Probe { scanlines: 1024, ..Probe::default() };
    let fine = linear(256, 0.1, 3072, 150.0);
    let coarse = linear(128, 0.2, 1024, 150.0);
    let dense = Probe { samples: 8192.into(), ..fine };
    let slow = Probe { frequency_mhz: 3.5, aperture_mm: 15.0, focus_mm: 40.0, ..linear(256, 0.25, 3072, 150.0) };
    let short = Probe { fractional_bandwidth: 0.9, ..dense };
    let phased = Probe { kind: ProbeKind::Phased { fov_deg: 60.0 }, scanlines: 512, ..Probe::default() };
    for (name, probe) in [
        ("convex", convex),
        ("fine", fine),
        ("coarse", coarse),
        ("dense", dense),
        ("slow", slow),
        ("short", short),
        ("phased", phased),
        ("harmonic", Probe { harmonics: true, ..slow }),
    ] {
        // Posts so far apart that their beams don't meet, in the middle of a sample: between automatic samples, an echo is
        // longer than the pulse.
        let spacing_mm = probe.sample_spacing_mm();
        let depths = [20.0, 45.0, 70.0, 100.0, 135.0].map(|mm: f64| ((mm / spacing_mm).floor() + 0.5) * spacing_mm);
        let line = |i: usize| (2 * i as u32 + 1) * probe.scanlines / (2 * depths.len() as u32);
        let mut bench = Bench::new(silent(1540.0, 1.5));
        let target = bench.tissue(silent(1540.0, 1.7));
        for (i, &depth) in depths.iter().enumerate() {
            bench.add(target, 1, post(DVec3::ZERO, &probe, line(i), depth, 400.0));
        }
        let mut rig = Rig::new(&bench.scene().unwrap(), &probe, &small(1, 1));
        let frame = rig.frame(&at(0.0, 0.0, 0.0));
        for (i, &depth) in depths.iter().enumerate() {
            let samples = probe.sample_count() as usize;
            let sample = (depth / probe.sample_spacing_mm()) as usize;
            let envelope: Vec<f64> = rig.line(&frame, line(i)).iter().map(|&s| magnitude(s)).collect();
            let reach = (1.0 / probe.sample_spacing_mm()) as usize;
            let axial =
                half_width(&envelope[sample - reach..(sample + reach).min(samples)]) * probe.sample_spacing_mm();
            assert_part(axial, FWHM_PER_SIGMA * probe.axial_sigma_mm(), 0.02, &format!("{name}: axial at {depth} mm"));
            let neighbours = probe.scanlines / (2 * depths.len() as u32);
            let across: Vec<f64> = (line(i) - neighbours..line(i) + neighbours)
                .map(|l| magnitude(frame.lines[l as usize * samples + sample]).max(1e-30))
                .collect();
            let lateral = half_width(&across) * probe.line_spacing_mm(depth);
            // A phased array's aperture is seen at an angle.
            let angle_rad = probe.lateral_coordinate((f64::from(line(i)) + 0.5) / f64::from(probe.scanlines));
            let seen = if matches!(probe.kind, ProbeKind::Phased { .. }) { angle_rad.cos() } else { 1.0 };
            assert_part(
                lateral,
                FWHM_PER_SIGMA * probe.lateral_sigma_mm(depth) / seen,
                0.05,
                &format!("{name}: lateral at {depth} mm"),
            );
        }
    }
}

/// Reference cases: probe, depth (mm) and expected −6 dB width (mm).
fn reference() -> Vec<(Probe, f64, f64)> {
    let probe = |row: &Row| Probe {
        apodization: Apodization::named(row.text("apodization")).unwrap(),
        frequency_mhz: row.number("frequency_mhz"),
        aperture_mm: row.number("aperture_mm"),
        focus_mm: row.number("focus_mm"),
        ..Probe::default()
    };
    let rows = rows("point_spread.csv");
    rows.iter().map(|row| (probe(row), row.number("depth_mm"), row.number("flat_width_mm"))).collect()
}

/// Widths, mm, of the images of points at `depths`, which lie on evenly spread scanlines of one frame.
fn rendered_widths(probe: &Probe, depths: &[f64]) -> Vec<f64> {
    let share = probe.scanlines / depths.len() as u32;
    let line = |i: usize| i as u32 * share + share / 2;
    let mut bench = Bench::new(silent(1540.0, 1.5));
    let target = bench.tissue(silent(1540.0, 1.7));
    for (i, &depth) in depths.iter().enumerate() {
        bench.add(target, 1, post(DVec3::ZERO, probe, line(i), depth, 400.0));
    }
    let frame = Rig::new(&bench.scene().unwrap(), probe, &small(1, 1)).frame(&at(0.0, 0.0, 0.0));
    let width = |(i, &depth): (usize, &f64)| {
        let sample = (depth / probe.sample_spacing_mm()) as usize;
        let across: Vec<f64> = (line(i) - share / 2..line(i) + share / 2)
            .map(|l| magnitude(frame.lines[l as usize * probe.sample_count() as usize + sample]).max(1e-30))
            .collect();
        half_width(&across) * probe.line_spacing_mm(depth)
    };
    depths.iter().enumerate().map(width).collect()
}

#[test]
fn point_images_are_as_wide_as_diffraction_makes_them() {
    let reference = reference();
    assert!(reference.len() >= 9 * 13);
    let mut worst: f64 = 0.0;
    for group in reference.chunk_by(|a, b| a.0 == b.0) {
        let depths: Vec<f64> = group.iter().map(|&(_, depth, _)| depth).collect();
        let wide = linear(1024, 0.2, 3072, 150.0);
        let Probe { apodization, frequency_mhz, aperture_mm, focus_mm, .. } = group[0].0;
        let probe = Probe { apodization, frequency_mhz, aperture_mm, focus_mm, ..wide };
        for (&(_, depth, want), got) in group.iter().zip(rendered_widths(&probe, &depths)) {
            worst = worst.max((got / want - 1.0).abs());
            let name = format!("{} at {frequency_mhz} MHz, focus {focus_mm} mm, {depth} mm", apodization.name());
            assert_part(got, want, 0.05, &name);
        }
    }
    println!("linear: within {:.1} % of diffraction", 100.0 * worst);
}

#[test]
fn point_images_of_a_curved_face_are_as_wide_as_diffraction_makes_them() {
    // All samples of a block have the kernel of its middle. With automatic samples, that is up to 1.5 mm away.
    for (samples, tolerance) in [(Samples::Number(3072), 0.05), (Samples::Auto, 0.08)] {
        let mut worst: f64 = 0.0;
        for group in reference().chunk_by(|a, b| a.0 == b.0) {
            for part in group.chunks(4) {
                let depths: Vec<f64> = part.iter().map(|&(_, depth, _)| depth).collect();
                // The default's scanlines are too far apart to measure a width that is not Gaussian.
                let probe = Probe { scanlines: 1024, samples, ..part[0].0 };
                for (&(_, depth, want), got) in part.iter().zip(rendered_widths(&probe, &depths)) {
                    worst = worst.max((got / want - 1.0).abs());
                    assert_part(got, want, tolerance, &format!("{probe:?} at {depth} mm"));
                }
            }
        }
        println!("convex, {samples:?} samples: within {:.1} % of diffraction", 100.0 * worst);
    }
}

/// −6 dB width, mm, of a point at (`depth_mm`, `angle_rad`) from the centre of a phased array, as scanlines turn past
/// the point. It is computed by two-way Huygens sums over the array's elements and its band.
fn diffraction_width_mm(probe: &Probe, depth_mm: f64, angle_rad: f64) -> f64 {
    const ELEMENTS: u32 = 256;
    const STEP_RAD: f64 = 2.0e-4;
    let point = depth_mm * DVec2::new(angle_rad.sin(), angle_rad.cos());
    let one_way = |aperture_mm: f64, focus: DVec2, wave_number: f64| {
        let element = |i: u32| {
            let place = (f64::from(i) + 0.5) / f64::from(ELEMENTS) - 0.5;
            let x = DVec2::new(place * aperture_mm, 0.0);
            let way_mm = x.distance(point) - x.distance(focus);
            DVec2::from_angle(wave_number * way_mm) * (-0.5 * (place / 0.3).powi(2)).exp()
        };
        (0..ELEMENTS).map(element).sum::<DVec2>().length_squared()
    };
    let energy = |turn_rad: f64| {
        let axis = DVec2::new((angle_rad + turn_rad).sin(), (angle_rad + turn_rad).cos());
        let band = (-4..=4).map(|i| {
            let aside = probe.fractional_bandwidth * f64::from(i) / 8.0;
            let wave_number = std::f64::consts::TAU * (1.0 + aside) * probe.frequency_mhz / 1.54;
            let weight = (-0.5 * (aside * FWHM_PER_SIGMA / probe.fractional_bandwidth).powi(2)).exp();
            let sent = one_way(probe.aperture_mm, probe.focus_mm * axis, wave_number);
            weight * sent * one_way(probe.aperture_mm.min(depth_mm / 2.0), depth_mm * axis, wave_number)
        });
        band.sum::<f64>()
    };
    let half = 0.25 * energy(0.0);
    let turned = |way: f64| (1..).map(|i| way * STEP_RAD * f64::from(i)).find(|&turn| energy(turn) < half).unwrap();
    depth_mm * (turned(1.0) - turned(-1.0))
}

#[test]
fn points_of_a_phased_array_widen_beside_its_normal_as_by_diffraction() {
    let kind = ProbeKind::Phased { fov_deg: 90.0 };
    let probe = Probe { kind, scanlines: 512, frequency_mhz: 3.0, ..Probe::default() };
    let step_deg = 90.0 / 512.0;
    for (depth_mm, angle_deg) in [(70.0, 0.0), (70.0, 20.0), (70.0, 35.0)] {
        let line = ((angle_deg + 45.0) / step_deg) as u32;
        let angle_rad = ((f64::from(line) + 0.5) * step_deg - 45.0_f64).to_radians();
        let mut bench = Bench::new(silent(1540.0, 1.5));
        let target = bench.tissue(silent(1540.0, 1.7));
        bench.add(target, 1, post(DVec3::ZERO, &probe, line, depth_mm, 400.0));
        let frame = Rig::new(&bench.scene().unwrap(), &probe, &small(1, 1)).frame(&at(0.0, 0.0, 0.0));
        let sample = (depth_mm / probe.sample_spacing_mm()) as usize;
        let across: Vec<f64> = (line - 40..line + 40)
            .map(|l| magnitude(frame.lines[l as usize * probe.sample_count() as usize + sample]).max(1e-30))
            .collect();
        let got = half_width(&across) * probe.line_spacing_mm(depth_mm);
        let want = diffraction_width_mm(&probe, depth_mm, angle_rad);
        println!("phased: {depth_mm} mm at {angle_deg}°: {got:.2} mm, by diffraction {want:.2}");
        assert_part(got, want, 0.06, &format!("phased: {depth_mm} mm at {angle_deg}°"));
    }
}
