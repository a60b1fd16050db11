//! Tests of echoes from plane interfaces: Fresnel amplitudes, ranges by time of flight, losses by attenuation.

use glam::{Quat, Vec3};
use insonify::acoustics::ASSUMED_SPEED_M_S;
use insonify::acoustics::attenuation::attenuation_db_mm;
use insonify::acoustics::interface::interface;
use insonify::anatomy::{Tissue, analytic};
use insonify::pose::Pose;
use insonify::render::RenderSettings;

use super::bench::{Bench, Rig, assert_part, at, linear, magnitude, silent, slab, small};

/// Distance between specimens, mm. Each has a pose of its own above it.
const PITCH: f64 = 60.0;

fn pose(i: usize) -> Pose {
    at(PITCH * i as f64, 0.0, 0.0)
}

fn energy(z1: f64, z2: f64) -> f64 {
    ((z2 - z1) / (z2 + z1)).powi(2)
}

#[test]
fn amplitudes_at_normal_incidence_follow_fresnel() {
    // MRayl: water | bone, fat | muscle, muscle | liver, tissue | air, a very weak one, and some reversed.
    let pairs = [(1.48, 7.8), (1.38, 1.65), (1.65, 1.62), (1.65, 0.0004), (1.66, 1.659), (0.0004, 1.65), (7.8, 1.48)];
    let mut bench = Bench::new(silent(1540.0, 1.0));
    for (i, (z1, z2)) in pairs.into_iter().enumerate() {
        let (first, second) = (bench.tissue(silent(1540.0, z1)), bench.tissue(silent(1540.0, z2)));
        bench.add(first, 1, slab(PITCH * i as f64, 20.0, -20.0, 60.0));
        bench.add(second, 2, slab(PITCH * i as f64, 19.0, 37.3, 80.0));
    }
    let mut rig = Rig::new(&bench.scene().unwrap(), &linear(16, 0.5, 1024, 50.0), &small(1, 1));
    for (i, (z1, z2)) in pairs.into_iter().enumerate() {
        let frame = rig.frame(&pose(i));
        let r = interface(z1, z2, 1540.0, 1540.0, 1.0).pressure_reflection;
        for line in 0..16 {
            let echoes = rig.echoes(&frame, line, 1e-5);
            assert_eq!(echoes.len(), 1, "{z1} | {z2}: {echoes:?}");
            assert_part(echoes[0].amplitude, r.abs(), 1e-4, &format!("{z1} | {z2}"));
            // The sign of r is the echo's: a wrong one is half a period off.
            assert!((echoes[0].range_mm(r) - 37.3).abs() < 1e-3, "{}", echoes[0].range_mm(r));
            assert!((echoes[0].peak_mm - 37.3).abs() <= 0.5 * rig.probe.sample_spacing_mm());
        }
    }
}

#[test]
fn oblique_layers_show_a_smooth_face_at_its_depth_and_in_phase() {
    let depths = [10.3, 21.7, 44.1, 70.0, 93.9, 118.4, 139.6];
    let mut bench = Bench::new(silent(1540.0, 1.6));
    let plate = bench.tissue(silent(1540.0, 1.7));
    for (i, depth) in depths.into_iter().enumerate() {
        bench.add(plate, 1, slab(PITCH * i as f64, 25.0, depth, 300.0));
    }
    let scene = bench.scene().unwrap();
    let probe = linear(16, 0.5, 3072, 150.0);
    let [mut one, mut three] = [1, 3].map(|layers| Rig::new(&scene, &probe, &small(1, layers)));
    for (i, depth) in depths.into_iter().enumerate() {
        let (single, frame) = (one.frame(&pose(i)), three.frame(&pose(i)));
        let (alone, all) = (one.echoes(&single, 8, 1e-4), three.echoes(&frame, 8, 1e-4));
        let part = all[0].amplitude / alone[0].amplitude;
        println!("{depth} mm: {} echoes, {part:.3} of a layer's", all.len());
        assert!((all[0].peak_mm - depth).abs() <= probe.sample_spacing_mm());
        // Out of phase, the outer two would leave a third. A mirror this oblique sends part of them past the aperture.
        assert!((0.85..1.01).contains(&part), "{depth} mm: {part}");
    }
}

#[test]
fn an_echo_from_behind_interfaces_has_passed_each_twice() {
    let impedances = [1.50, 1.62, 1.75, 1.55, 1.60];
    let mut bench = Bench::new(silent(1540.0, impedances[0]));
    for (i, &z) in impedances.iter().enumerate().skip(1) {
        let tissue = bench.tissue(silent(1540.0, z));
        bench.add(tissue, i as i32, slab(0.0, 30.0 - i as f64, 10.0 * i as f64, 100.0));
    }
    let mut rig = Rig::new(&bench.scene().unwrap(), &linear(16, 0.5, 2048, 50.0), &small(1, 1));
    let frame = rig.frame(&pose(0));
    for line in 0..16 {
        let echoes = rig.echoes(&frame, line, 1e-4);
        assert_eq!(echoes.len(), 4, "{echoes:?}");
        let mut passed = 1.0;
        for (echo, z) in echoes.iter().zip(impedances.windows(2)) {
            let reflected = energy(z[0], z[1]);
            assert_part(echo.amplitude, passed * reflected.sqrt(), 1e-4, "echo");
            passed *= 1.0 - reflected;
        }
    }
}

#[test]
fn a_path_goes_on_beyond_the_segments_that_it_keeps() {
    const FACES: u32 = 60;
    let mut bench = Bench::new(silent(1540.0, 1.60));
    let other = bench.tissue(silent(1540.0, 1.61));
    for i in 0..FACES {
        let tissue = if i % 2 == 0 { other } else { 0 };
        bench.add(tissue, 1 + i as i32, slab(0.0, 45.0 - 0.3 * f64::from(i), 2.0 + 0.6 * f64::from(i), 100.0));
    }
    let plate = bench.tissue(silent(1540.0, 1.9));
    bench.add(plate, 100, slab(0.0, 20.0, 45.0, 100.0));
    let mut rig = Rig::new(&bench.scene().unwrap(), &linear(16, 0.5, 2048, 50.0), &small(1, 1));
    let frame = rig.frame(&pose(0));
    let passed = (1.0 - energy(1.60, 1.61)).powi(FACES as i32);
    for line in 0..16 {
        let echoes = rig.echoes(&frame, line, 0.02);
        assert_eq!(echoes.len(), 1, "{echoes:?}");
        assert!((echoes[0].peak_mm - 45.0).abs() <= rig.probe.sample_spacing_mm(), "{echoes:?}");
        assert_part(echoes[0].amplitude, passed * energy(1.60, 1.9).sqrt(), 1e-3, "echo");
    }
}

#[test]
fn strong_interfaces_transmit_and_reflect_their_shares_of_many_paths() {
    // Water, a plate, water: paths branch randomly, so the mean over rays and scanlines is tested.
    let plates = [2.6, 3.5, 7.8];
    let water = 1.48;
    let mut bench = Bench::new(silent(1480.0, water));
    for (i, z) in plates.into_iter().enumerate() {
        let tissue = bench.tissue(silent(3000.0, z));
        bench.add(tissue, 1, slab(PITCH * i as f64, 25.0, 20.0, 40.0));
    }
    let scene = bench.scene().unwrap();
    // All paths follow reflections, then half of them, with more noise.
    for (share, noise) in [(1.0, 0.03), (0.5, 0.08)] {
        let settings = RenderSettings { reflecting_share: share, ..small(128, 1) };
        let mut rig = Rig::new(&scene, &linear(32, 0.5, 1024, 50.0), &settings);
        for (i, z) in plates.into_iter().enumerate() {
            let frame = rig.frame(&pose(i));
            // Range of the front, of the back, and of one more round trip through the plate.
            let (to_front, through) = (20.0 * 1540.0 / 1480.0, 20.0 * 1540.0 / 3000.0);
            let reflected = energy(water, z);
            let once = 1.0 - reflected;
            let r = reflected.sqrt();
            for (n, (want, sign)) in [(r, 1.0), (once * r, -1.0), (once * reflected * r, -1.0)].into_iter().enumerate()
            {
                let range = to_front + n as f64 * through;
                let sample = (range / rig.probe.sample_spacing_mm()) as usize;
                let turn = rig.probe.phase_turns_per_mm() * range * std::f64::consts::TAU;
                let in_phase = |s: [f32; 2]| f64::from(s[0]) * turn.cos() - f64::from(s[1]) * turn.sin();
                let mean = (0..32).map(|l| in_phase(rig.line(&frame, l)[sample])).sum::<f64>() / 32.0;
                let part = if n < 2 { 0.01 } else { noise };
                assert_part(sign * mean, want, part, &format!("plate of {z} MRayl, echo {n}, share {share}"));
            }
        }
    }
}

#[test]
fn oblique_amplitudes_follow_both_cosines() {
    // Two plates of equal impedance at equal angles differ only in cosθₜ: the aperture's share of the echo cancels.
    let (z1, c1) = (1.48, 1480.0);
    let cases = [
        (10.0, 1.65, 1700.0),
        (20.0, 1.65, 1700.0),
        (20.0, 1.65, 1300.0),
        (20.0, 1.38, 1450.0),
        (20.0, 7.8, 4080.0),
        (22.0, 7.8, 4080.0),
        (35.0, 1.60, 2000.0),
        (30.0, 1.48, 1600.0),
    ];
    let mut bench = Bench::new(silent(c1, z1));
    for (i, (degrees, z2, c2)) in cases.into_iter().enumerate() {
        for (k, c) in [c1, c2].into_iter().enumerate() {
            // A plate of the background's impedance gives no echo to compare with: another impedance is used.
            let z = if k == 0 && z2 == z1 { 2.0 } else { z2 };
            let tissue = bench.tissue(silent(c, z));
            let rotation = Quat::from_rotation_y((degrees as f32).to_radians());
            let x = (PITCH * (2 * i + k) as f64) as f32;
            let centre = Vec3::new(x, 0.0, 30.0) + rotation * Vec3::new(0.0, 0.0, 15.0);
            bench.add(tissue, 1, analytic::plate(centre, Vec3::new(30.0, 30.0, 30.0), rotation));
        }
    }
    let mut rig = Rig::new(&bench.scene().unwrap(), &linear(1, 1.0, 1024, 50.0), &small(1, 1));
    for (i, (degrees, z2, c2)) in cases.into_iter().enumerate() {
        let mut first = |k: usize| {
            let frame = rig.frame(&pose(2 * i + k));
            rig.echoes(&frame, 0, 1e-16)[0]
        };
        let (reference, echo) = (first(0), first(1));
        let cos = f64::from(degrees as f32).to_radians().cos();
        let known = interface(z1, if z2 == z1 { 2.0 } else { z2 }, c1, c1, cos).pressure_reflection;
        let want = interface(z1, z2, c1, c2, cos).pressure_reflection;
        let what = format!("{degrees}° to {z2} MRayl, {c2} m/s");
        assert_part(echo.amplitude / reference.amplitude, (want / known).abs(), 0.003, &what);
        let expected_mm = 30.0 * ASSUMED_SPEED_M_S / c1;
        assert!((echo.range_mm(want) - expected_mm).abs() < 1e-3, "{what}: {}", echo.range_mm(want));
    }
}

#[test]
fn layers_displace_echoes_behind_them_by_the_time_of_flight() {
    // Layer speeds from fat to bone, 12 mm thick, in water; the plate behind is at 35 mm.
    let speeds = [1450.0, 1480.0, 1540.0, 1590.0, 4080.0, 1100.0];
    let mut bench = Bench::new(silent(1480.0, 1.48));
    let wall = bench.tissue(silent(1480.0, 1.7));
    for (i, speed) in speeds.into_iter().enumerate() {
        let layer = bench.tissue(silent(speed, 1.6));
        bench.add(layer, 1, slab(PITCH * i as f64, 20.0, 8.0, 20.0));
        bench.add(wall, 1, slab(PITCH * i as f64, 20.0, 35.0, 70.0));
    }
    let mut rig = Rig::new(&bench.scene().unwrap(), &linear(8, 0.5, 3072, 50.0), &small(1, 1));
    for (i, speed) in speeds.into_iter().enumerate() {
        let frame = rig.frame(&pose(i));
        for line in 0..8 {
            let echoes = rig.echoes(&frame, line, 1e-3);
            let want = ASSUMED_SPEED_M_S * ((35.0 - 12.0) / 1480.0 + 12.0 / speed);
            let wall = echoes.last().unwrap();
            assert!((wall.peak_mm - want).abs() <= 0.5001 * rig.probe.sample_spacing_mm(), "{speed}: {wall:?}");
            assert!((wall.range_mm(1.0) - want).abs() < 2e-4, "{speed}: {} {want}", wall.range_mm(1.0));
        }
    }
}

#[test]
fn echoes_decay_in_both_directions() {
    // dB/cm/MHz and its exponent: liver, muscle with a steeper frequency dependence, fluid, bone.
    let media = [(0.5, 1.0), (0.6, 1.2), (0.002, 2.0), (6.9, 0.7)];
    let depths = [5.0, 20.0, 41.0];
    for frequency_mhz in [3.0, 8.0] {
        let mut bench = Bench::new(silent(1540.0, 1.0));
        let wall = bench.tissue(silent(1540.0, 1.8));
        for (i, (alpha, exponent)) in media.into_iter().enumerate() {
            let lossy = Tissue { attenuation_db_cm_mhz: alpha, attenuation_exponent: exponent, ..silent(1540.0, 1.6) };
            let lossy = bench.tissue(lossy);
            for (k, &depth) in depths.iter().enumerate() {
                let x = PITCH * (depths.len() * i + k) as f64;
                bench.add(lossy, 1, slab(x, 22.0, -10.0, 70.0));
                bench.add(wall, 2, slab(x, 20.0, depth, 70.0));
            }
        }
        let mut probe = linear(8, 0.5, 2048, 50.0);
        probe.frequency_mhz = frequency_mhz;
        let mut rig = Rig::new(&bench.scene().unwrap(), &probe, &small(1, 1));
        let r = energy(1.6, 1.8).sqrt();
        for (i, (alpha, exponent)) in media.into_iter().enumerate() {
            for (k, &depth) in depths.iter().enumerate() {
                let frame = rig.frame(&pose(depths.len() * i + k));
                let want = r * 10f64.powf(-attenuation_db_mm(alpha, exponent, frequency_mhz) * depth / 10.0);
                // The peak, wherever it is; also for very weak ones.
                let peak = rig.line(&frame, 4).iter().map(|&s| magnitude(s)).fold(0.0, f64::max);
                assert_part(peak, want, 1e-3, &format!("{alpha} dB/cm at {frequency_mhz} MHz, {depth} mm"));
            }
        }
    }
}
