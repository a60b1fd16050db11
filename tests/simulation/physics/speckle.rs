//! Tests of the speckle of a homogeneous block: statistics, level and decay; it never repeats.

use glam::{DQuat, DVec3, Vec3};
use insonify::acoustics::attenuation::attenuation_db_mm;
use insonify::anatomy::{Scene, Tissue, analytic};
use insonify::pose::Pose;
use insonify::render::{Choice, Effect, Frame, RenderSettings};
use insonify::statistics::slope;
use insonify::transducer::{Probe, ProbeKind};

use super::bench::{Bench, Rig, at, grainy, linear, magnitude, mean_square, silent, small};

/// A block of `tissue` so large around the probe that none of its faces is visible.
pub(crate) fn block(tissue: Tissue) -> Scene {
    let mut bench = Bench::new(tissue);
    bench.add(0, 1, analytic::cuboid(Vec3::splat(-300.0), Vec3::splat(300.0)));
    bench.scene().unwrap()
}

fn tilted() -> Pose {
    Pose { position_mm: DVec3::new(3.0, 4.0, 5.0), orientation: DQuat::from_euler(glam::EulerRot::XYZ, 0.4, 0.7, 0.9) }
}

/// Envelopes of the scanlines in each of `bands` ranges of depth. Scanlines whose beam the sector's edge cuts are left
/// out.
fn envelope(rig: &Rig, frame: &Frame, bands: usize) -> Vec<Vec<Vec<f64>>> {
    let length = rig.probe.sample_count() as usize / bands;
    let lines = 4..rig.probe.scanlines - 4;
    let part = |band: usize, line: u32| {
        rig.line(frame, line)[band * length..][..length].iter().map(|&s| magnitude(s)).collect()
    };
    (0..bands).map(|band| lines.clone().map(|line| part(band, line)).collect()).collect()
}

/// Kolmogorov–Smirnov distance of `sample` from a Rayleigh distribution of equal power, times √n: the limit at a
/// significance of 0.05 is 1.358.
fn kolmogorov_smirnov(mut sample: Vec<f64>) -> f64 {
    let power = mean_square(sample.iter().copied());
    sample.sort_by(f64::total_cmp);
    let n = sample.len() as f64;
    let distance = |(i, v): (usize, &f64)| {
        let rayleigh = 1.0 - (-v * v / power).exp();
        (rayleigh - i as f64 / n).abs().max((rayleigh - (i + 1) as f64 / n).abs())
    };
    sample.iter().enumerate().map(distance).fold(0.0, f64::max) * n.sqrt()
}

#[test]
fn speckle_is_fully_developed_at_the_tissues_level() {
    let tissue = grainy(0.0, 0.01);
    let scene = block(tissue);
    for (rays, layers) in [(1, 1), (32, 3)] {
        let mut rig = Rig::new(&scene, &Probe::default(), &all_paths(rays, layers));
        for pose in [at(0.0, 0.0, 0.0), tilted()] {
            let frame = rig.frame(&pose);
            let mut sample = Vec::new();
            for (band, lines) in envelope(&rig, &frame, 12).into_iter().enumerate() {
                let all = || lines.iter().flatten().copied();
                let power = mean_square(all());
                let level_db = 10.0 * (power / 1e-4).log10();
                let mean = all().sum::<f64>() / (lines.len() * lines[0].len()) as f64;
                let snr = mean / (power - mean * mean).sqrt();
                println!("{rays}×{layers}, band {band}: {level_db:+.2} dB, SNR {snr:.3}");
                assert!(level_db.abs() <= 0.5, "{level_db} dB off");
                assert!((snr - 1.913).abs() <= 0.05, "SNR {snr}");
                // Samples a millimetre of depth and ten lines apart are independent.
                let few = lines.iter().skip(band % 10).step_by(10).flat_map(|l| l.iter().step_by(20));
                sample.extend(few.map(|v| v / power.sqrt()));
            }
            let statistic = kolmogorov_smirnov(sample);
            println!("{rays}×{layers}: Kolmogorov–Smirnov {statistic:.3}");
            assert!(statistic <= 1.358, "Kolmogorov–Smirnov {statistic}");
        }
    }
}

/// Settings that trace all rays and layers, even if the effect plan finds that they change nothing.
fn all_paths(rays: u32, layers: u32) -> RenderSettings {
    let mut settings = small(rays, layers);
    settings.effects = settings.effects.with(Effect::Rays, Choice::On).with(Effect::Layers, Choice::On);
    settings
}

#[test]
fn speckle_of_a_phased_array_keeps_its_level_beside_the_normal() {
    let kind = ProbeKind::Phased { fov_deg: 90.0 };
    let probe = Probe { kind, scanlines: 512, frequency_mhz: 3.0, ..Probe::default() };
    let scene = block(grainy(0.0, 0.01));
    let frame = Rig::new(&scene, &probe, &small(1, 1)).frame(&at(0.0, 0.0, 0.0));
    for (from_mm, to_mm) in [(16.0, 24.0), (24.0, 32.0), (40.0, 60.0), (90.0, 110.0)] {
        let level_db = |first: u32| {
            let samples = |mm: f64| (mm / probe.sample_spacing_mm()) as usize;
            let line =
                |line: u32| &frame.lines[(line * probe.sample_count()) as usize..][samples(from_mm)..samples(to_mm)];
            10.0 * (mean_square((first..first + 60).flat_map(|l| line(l).iter().map(|&s| magnitude(s)))) / 1e-4).log10()
        };
        let (middle, beside) = (level_db(226), level_db(20));
        println!("{from_mm} to {to_mm} mm: {middle:+.2} dB in the middle, {beside:+.2} dB at 36 degrees");
        // Scanlines share scatterers near the face.
        assert!(middle.abs() < 1.5, "{from_mm} mm: {middle} dB");
        assert!((middle - beside).abs() < 0.6, "{from_mm} mm: {middle} and {beside} dB");
    }
}

#[test]
fn paths_across_the_slice_are_weighted_in_power() {
    // A scattering half-space beside a silent one of the same medium: its face has no echo.
    let scene = |min: Vec3| {
        let mut bench = Bench::new(grainy(0.0, 0.0));
        let half = bench.tissue(grainy(0.0, 0.01));
        bench.add(half, 1, analytic::cuboid(min, Vec3::splat(300.0)));
        bench.scene().unwrap()
    };
    let probe = linear(160, 0.25, 2048, 40.0);
    let level_db = |min: Vec3| {
        let mut rig = Rig::new(&scene(min), &probe, &all_paths(32, 3));
        let mut values = Vec::new();
        for along_mm in [0.0, 50.0, 100.0] {
            let frame = rig.frame(&at(along_mm, 0.0, 0.0));
            values.extend((4..probe.scanlines - 4).flat_map(|line| rig.line(&frame, line).to_vec()));
        }
        10.0 * (mean_square(values.into_iter().map(magnitude)) / 1e-4).log10()
    };
    let beyond = |y_mm: f32| 10f64.powf(0.1 * level_db(Vec3::new(-300.0, y_mm, -300.0)));
    let all = beyond(-300.0);
    let half = beyond(0.0) / all;
    println!("scatterers beyond the image plane: {half:.4} of the power");
    assert!((half - 0.5).abs() < 0.02, "{half}");
    // The beam is even: what lies beyond y and beyond −y makes the whole.
    for y_mm in [0.7, 2.0] {
        let (outer, inner) = (beyond(y_mm) / all, beyond(-y_mm) / all);
        println!("scatterers beyond y = {y_mm} mm: {outer:.4} of the power; beyond {:.1} mm: {inner:.4}", -y_mm);
        assert!((outer + inner - 1.0).abs() < 0.02 && outer < 0.4 && outer > 0.05, "{outer} and {inner}");
    }
}

#[test]
fn layers_add_in_power_even_where_they_meet() {
    let probe = linear(160, 0.25, 2048, 100.0);
    let mut rig = Rig::new(&block(grainy(0.0, 0.01)), &probe, &all_paths(1, 3));
    let frame = rig.frame(&at(0.0, 0.0, 0.0));
    // A millimetre about the elevational focus, where one speckle for all three would be 4 dB stronger.
    let sample = |mm: f64| (mm / probe.sample_spacing_mm()) as usize;
    let focus = sample(probe.elevational_focus_mm - 1.0)..sample(probe.elevational_focus_mm + 1.0);
    let values = (4..probe.scanlines - 4).flat_map(|line| rig.line(&frame, line)[focus.clone()].to_vec());
    let level_db = 10.0 * (mean_square(values.map(magnitude)) / 1e-4).log10();
    println!("at the focus: {level_db:+.2} dB");
    assert!(level_db.abs() < 1.2, "{level_db} dB");
}

#[test]
fn these_statistics_distinguish_other_textures() {
    // One cell in twenty contains a scatterer: far from fully developed.
    let sparse = Tissue { scatterer_density: 0.05, ..grainy(0.0, 0.01) };
    let mut rig = Rig::new(&block(sparse), &Probe::default(), &small(1, 1));
    let frame = rig.frame(&at(0.0, 0.0, 0.0));
    let lines = envelope(&rig, &frame, 1).remove(0);
    let few = lines.iter().step_by(5).flat_map(|l| l.iter().step_by(20).copied());
    assert!(kolmogorov_smirnov(few.collect()) > 5.0);
}

#[test]
fn the_level_follows_density_mean_and_deviation() {
    for (density, mean, deviation) in [(0.5, 0.0, 0.02), (0.8, 0.01, 0.01), (0.3, -0.02, 0.005)] {
        let tissue = Tissue { scatterer_density: density, ..grainy(mean, deviation) };
        let mut rig = Rig::new(&block(tissue), &Probe::default(), &small(1, 1));
        let frame = rig.frame(&tilted());
        let power = mean_square(envelope(&rig, &frame, 1)[0].iter().flatten().copied());
        let stated = density * (mean * mean + deviation * deviation);
        let off = 10.0 * (power / stated).log10();
        println!("{density} {mean} {deviation}: {off:+.2} dB");
        assert!(off.abs() <= 0.5, "{off} dB");
    }
}

#[test]
fn speckle_behind_a_strong_interface_has_passed_it_twice() {
    // Random branching: the power of all paths together is the share transmitted in both directions.
    for impedance in [1.9, 3.0, 7.8] {
        let grain = Tissue { density_kg_m3: impedance * 1e6 / 1540.0, ..grainy(0.0, 0.01) };
        let mut bench = Bench::new(silent(1540.0, 1.5));
        let grain = bench.tissue(grain);
        bench.add(grain, 1, analytic::cuboid(Vec3::new(-60.0, -60.0, 10.0), Vec3::new(60.0, 60.0, 200.0)));
        let mut rig = Rig::new(&bench.scene().unwrap(), &linear(128, 0.3, 2048, 100.0), &small(64, 1));
        let frame = rig.frame(&at(0.0, 0.0, 0.0));
        let power = mean_square(envelope(&rig, &frame, 4)[1..].iter().flatten().flatten().copied());
        let passed = 1.0 - ((impedance - 1.5) / (impedance + 1.5)).powi(2);
        let off = 20.0 * (power.sqrt() / (0.01 * passed)).log10();
        println!("behind {impedance} MRayl: {off:+.2} dB");
        assert!(off.abs() <= 0.5, "{off} dB");
    }
}

#[test]
fn speckle_decays_at_twice_the_one_way_loss() {
    for (alpha, exponent) in [(0.5, 1.0), (0.3, 1.1)] {
        let lossy = Tissue { attenuation_db_cm_mhz: alpha, attenuation_exponent: exponent, ..grainy(0.0, 0.01) };
        let mut rig = Rig::new(&block(lossy), &Probe::default(), &small(1, 1));
        // Four places per frame: more independent grains.
        let bands = 96;
        let mut power = vec![0.0; bands];
        for place in 0..4 {
            let frame = rig.frame(&at(0.0, 12.0 * f64::from(place), 0.0));
            for (sum, lines) in power.iter_mut().zip(envelope(&rig, &frame, bands)) {
                *sum += mean_square(lines.into_iter().flatten());
            }
        }
        let band_cm = rig.probe.sample_spacing_mm() / 10.0 * (rig.probe.sample_count() as usize / bands) as f64;
        let depth_cm = |band: usize| band_cm * (band as f64 + 0.5);
        let points: Vec<_> = power.iter().enumerate().map(|(b, p)| (depth_cm(b), 10.0 * p.log10())).collect();
        let (slope, error) = slope(&points);
        let want = -2.0 * 10.0 * attenuation_db_mm(alpha, exponent, 8.0);
        println!("{slope:.4} ± {error:.4} dB/cm, expected {want:.4}");
        assert!(3.0 * error < 0.01 * want.abs(), "too few grains to tell: ± {error}");
        assert!((slope / want - 1.0).abs() <= 0.01, "{slope} dB/cm, expected {want}");
    }
}

#[test]
fn speckle_never_repeats() {
    // Autocorrelation of the complex lines over every lag along a line, and over every distance across.
    let mut rig = Rig::new(&block(grainy(0.0, 0.01)), &linear(256, 0.3, 2048, 100.0), &small(1, 1));
    let frame = rig.frame(&at(0.0, 0.0, 0.0));
    let samples = rig.probe.sample_count() as usize;
    let lines: Vec<&[[f32; 2]]> = (0..256).map(|l| rig.line(&frame, l)).collect();
    let product = |a: &[[f32; 2]], b: &[[f32; 2]]| {
        a.iter().zip(b).fold((0.0, 0.0), |(re, im), (a, b)| {
            let [ar, ai, br, bi] = [a[0], a[1], b[0], b[1]].map(f64::from);
            (re + ar * br + ai * bi, im + ai * br - ar * bi)
        })
    };
    let correlation = |pairs: &mut dyn Iterator<Item = (&[[f32; 2]], &[[f32; 2]])>| {
        let (mut sum, mut power) = ((0.0, 0.0), (0.0, 0.0));
        for (a, b) in pairs {
            let p = product(a, b);
            sum = (sum.0 + p.0, sum.1 + p.1);
            power = (power.0 + product(a, a).0, power.1 + product(b, b).0);
        }
        f64::hypot(sum.0, sum.1) / (power.0 * power.1).sqrt()
    };
    assert!(correlation(&mut lines.iter().map(|l| (&l[..samples - 1], &l[1..]))) > 0.8);
    // Beyond 0.8 mm of depth, twice the pulse plus a cell, and at most half of the block.
    let along = (16..samples / 2)
        .map(|lag| correlation(&mut lines.iter().step_by(4).map(|l| (&l[..samples - lag], &l[lag..]))))
        .fold(0.0, f64::max);
    // Beyond twelve lines, 3.6 mm: the widest beam.
    let across = (12..128)
        .map(|lag| correlation(&mut (0..256 - lag).step_by(2).map(|l| (lines[l], lines[l + lag]))))
        .fold(0.0, f64::max);
    println!("highest side peaks: {along:.3} along, {across:.3} across");
    assert!(along < 0.06 && across < 0.06, "{along} {across}");
}

#[test]
fn speckle_behind_refraction_is_the_scanlines_own() {
    // Balls of equal impedance but different speed.
    let mut bench = Bench::new(grainy(0.0, 0.01));
    for (x, speed_m_s) in [(-12.0, 1450.0), (12.0, 1640.0)] {
        let ball = bench.tissue(Tissue { scatterer_density: 1.0, scatterer_deviation: 0.01, ..silent(speed_m_s, 1.6) });
        bench.add(ball, 1, analytic::sphere(Vec3::new(x, 0.0, 20.0), 10.0, 5));
    }
    let scene = bench.scene().unwrap();
    let probe = linear(160, 0.3, 2048, 100.0);
    let frames = [(1, 0), (16, 0), (16, 0x5bd1_e995)].map(|(rays, seed)| {
        let mut settings = small(rays, 1);
        settings.quality.seed = seed;
        let mut rig = Rig::new(&scene, &probe, &settings);
        let frame = rig.frame(&at(0.0, 0.0, 0.0));
        (rig, frame)
    });
    // Behind the balls.
    let deep = probe.sample_count() as usize * 2 / 5..probe.sample_count() as usize;
    let signals = frames.each_ref().map(|(rig, frame)| {
        let lines = (4..probe.scanlines - 4).flat_map(|line| rig.line(frame, line)[deep.clone()].to_vec());
        lines.map(|[re, im]| glam::DVec2::new(re.into(), im.into())).collect::<Vec<_>>()
    });
    let product = |a: usize, b: usize| signals[a].iter().zip(&signals[b]).map(|(a, b)| a.dot(*b)).sum::<f64>();
    let alike = |a: usize, b: usize| product(a, b) / (product(a, a) * product(b, b)).sqrt();
    println!("1 and 16 rays {:.3}, seeds {:.3}", alike(0, 1), alike(1, 2));
    assert!(alike(0, 1) > 0.999 && alike(1, 2) > 0.999, "{} {}", alike(0, 1), alike(1, 2));
}
