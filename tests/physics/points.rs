//! Point targets: −6 dB widths against the pulse's and the beam's, whatever the buffers' steps.

use glam::{DQuat, DVec3};
use insonify::acoustics::pulse::FWHM_PER_SIGMA;
use insonify::anatomy::{Mesh, analytic};
use insonify::transducer::{Probe, ProbeKind};

use super::bench::{Bench, Rig, assert_part, at, linear, magnitude, silent, small};

/// A post along a scanline, so thin that only its ray meets it; its one visible face lies at `depth_mm`.
fn post(probe: &Probe, line: u32, depth_mm: f64) -> Mesh {
    let lateral = probe.lateral_coordinate((f64::from(line) + 0.5) / f64::from(probe.scanlines));
    let (origin, direction) = probe.ray(lateral);
    let width = 0.6 * probe.line_spacing_mm(depth_mm);
    let length = 400.0;
    let centre = origin + direction * (depth_mm + 0.5 * length);
    let rotation = DQuat::from_rotation_arc(DVec3::Z, direction);
    let size = DVec3::new(width, width, length);
    analytic::plate(centre.as_vec3(), size.as_vec3(), rotation.as_quat())
}

/// Full width at half the maximum of a sampled bell, in samples; logarithms are interpolated by parabolas, as a Gaussian's.
fn half_width(values: &[f64]) -> f64 {
    let peak = (0..values.len()).max_by(|&a, &b| values[a].total_cmp(&values[b])).unwrap();
    let top = values[peak];
    let side = |step: isize| {
        let mut at = peak as isize;
        while values[(at + step) as usize] >= 0.5 * top {
            at += step;
        }
        let (inside, outside) = (values[at as usize].ln(), values[(at + step) as usize].ln());
        // ln of a Gaussian is linear in the squared distance.
        let (d0, d1) = ((at - peak as isize).unsigned_abs() as f64, (at + step - peak as isize).unsigned_abs() as f64);
        let part = ((0.5 * top).ln() - inside) / (outside - inside);
        (d0 * d0 + part * (d1 * d1 - d0 * d0)).sqrt()
    };
    side(1) + side(-1)
}

#[test]
fn widths_of_points_are_the_pulses_and_the_beams_at_every_sampling() {
    let convex = Probe { scanlines: 1024, ..Probe::default() };
    let fine = linear(256, 0.1, 3072, 150.0);
    let coarse = linear(128, 0.2, 1024, 150.0);
    let dense = Probe { samples: 8192, ..fine };
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
    ] {
        // Posts so far apart that their beams don't meet.
        let depths = [20.0, 45.0, 70.0, 100.0, 135.0];
        let line = |i: usize| (2 * i as u32 + 1) * probe.scanlines / (2 * depths.len() as u32);
        let mut bench = Bench::new(silent(1540.0, 1.5));
        let target = bench.tissue(silent(1540.0, 1.7));
        for (i, &depth) in depths.iter().enumerate() {
            bench.add(target, 1, post(&probe, line(i), depth));
        }
        let mut rig = Rig::new(&bench.scene(), &probe, &small(1, 1));
        let frame = rig.frame(&at(0.0, 0.0, 0.0));
        for (i, &depth) in depths.iter().enumerate() {
            let samples = probe.samples as usize;
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
            assert_part(
                lateral,
                FWHM_PER_SIGMA * probe.lateral_sigma_mm(depth),
                0.05,
                &format!("{name}: lateral at {depth} mm"),
            );
        }
    }
}
