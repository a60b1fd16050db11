//! Tests of mirrors, critical angles, and the choice of the medium where surfaces overlap.

use glam::{DQuat, DVec3, Quat, Vec3};
use insonify::acoustics::ASSUMED_SPEED_M_S;
use insonify::anatomy::{Scene, Tissue, analytic};
use insonify::render::{Choice, Effect};

use super::bench::{Bench, Rig, assert_part, at, grainy, linear, magnitude, mean_square, silent, slab, small};

#[test]
fn a_mirror_shows_its_target_at_the_folded_range() {
    // A sheet of air at 45° deflects the beam sideways to a plate; everything behind the mirror is dark.
    let mut bench = Bench::new(silent(1480.0, 1.5));
    let air = bench.tissue(silent(343.0, 0.0004));
    let wall = bench.tissue(silent(1480.0, 1.7));
    let turned = Quat::from_rotation_y(45f32.to_radians());
    bench.add(
        air,
        1,
        analytic::plate(Vec3::new(0.0, 0.0, 40.0) + turned * (5.0 * Vec3::Z), Vec3::new(40.0, 40.0, 10.0), turned),
    );
    let sideways = (DQuat::from_rotation_y(45f64.to_radians()) * DVec3::NEG_Z).x;
    let side = sideways.signum();
    bench.add(
        wall,
        1,
        analytic::plate(Vec3::new((side * 30.0) as f32, 0.0, 40.0), Vec3::new(10.0, 30.0, 30.0), Quat::IDENTITY),
    );
    let mut rig = Rig::new(&bench.scene().unwrap(), &linear(5, 4.0, 2048, 100.0), &small(1, 1));
    let frame = rig.frame(&at(0.0, 0.0, 0.0));
    let r: f64 = 0.2 / 3.2;
    let to_range = ASSUMED_SPEED_M_S / 1480.0;
    for line in 0..5 {
        // Down to the mirror, then across to the wall's face at 25 mm.
        let x = 4.0 * (f64::from(line) - 2.0);
        let mirror = 40.0 - x;
        let seen = rig.echoes(&frame, line, 1e-4).into_iter().find(|e| e.peak_mm > (mirror + 5.0) * to_range).unwrap();
        let want = (40.0 - x + 25.0 - side * x) * to_range;
        assert!((seen.range_mm(1.0) - want).abs() < 1e-3, "{line}: {} {want}", seen.range_mm(1.0));
        assert_part(seen.amplitude, r, 2e-3, "mirrored");
    }
}

#[test]
fn reverberation_between_plates_repeats_at_their_distance() {
    // Two plates 10 mm apart: probe → far → near → far → probe arrives 10 mm behind the far one.
    let (water, metal) = (1.5, 12.0);
    let mut bench = Bench::new(silent(1540.0, water));
    let plate = bench.tissue(silent(1540.0, metal));
    bench.add(plate, 1, slab(0.0, 20.0, 20.0, 21.0));
    bench.add(plate, 1, slab(0.0, 20.0, 31.0, 60.0));
    let mut rig = Rig::new(&bench.scene().unwrap(), &linear(32, 0.5, 2048, 50.0), &small(128, 1));
    let frame = rig.frame(&at(0.0, 0.0, 0.0));
    let r: f64 = (metal - water) / (metal + water);
    let passed = (1.0 - r * r).powi(2);
    let spacing = rig.probe.sample_spacing_mm();
    let mean = |range: f64| {
        let turn = rig.probe.phase_turns_per_mm() * range * std::f64::consts::TAU;
        let sample = (range / spacing) as usize;
        let real = |l| {
            let s = rig.line(&frame, l)[sample];
            f64::from(s[0]) * turn.cos() - f64::from(s[1]) * turn.sin()
        };
        (0..32).map(real).sum::<f64>() / 32.0
    };
    assert_part(mean(31.0 + 1e-6), passed * r, 0.06, "far plate");
    assert_part(mean(41.0 + 1e-6), passed * r.powi(3), 0.15, "its repetition");
}

#[test]
fn with_fewer_paths_that_follow_reflections_the_mean_is_the_same() {
    // Half a mirror in uniform tissue: what lies behind it has no scatterers, so it shows mirrored tissue alone.
    let level_db = |share: f64, aperture: Choice| {
        let mut bench = Bench::new(grainy(0.0, 0.01));
        let metal = bench.tissue(silent(1540.0, 9.0));
        bench.add(metal, 1, slab(0.0, 60.0, 30.0, 200.0));
        let scene = bench.scene().unwrap();
        let mut settings = small(96, 1);
        settings.reflecting_share = share;
        settings.effects = settings.effects.with(Effect::Aperture, aperture);
        let power = (0..4).map(|seed| {
            settings.quality.seed = seed;
            let mut rig = Rig::new(&scene, &linear(128, 0.2, 1024, 60.0), &settings);
            let frame = rig.frame(&at(0.0, 0.0, 0.0));
            let sample = |mm: f64| (mm / rig.probe.sample_spacing_mm()) as usize;
            let of_line =
                |line| mean_square(rig.line(&frame, line)[sample(33.0)..sample(57.0)].iter().map(|&s| magnitude(s)));
            (32..96).map(of_line).sum::<f64>()
        });
        10.0 * power.sum::<f64>().log10()
    };
    for aperture in [Choice::Off, Choice::On] {
        let (all, few) = (level_db(1.0, aperture), level_db(0.25, aperture));
        println!("{aperture:?}: all {all:.2} dB, a quarter {few:.2} dB");
        assert!((few - all).abs() < 0.4, "{aperture:?}: all {all:.2} dB, a quarter {few:.2} dB");
    }
}

#[test]
fn nothing_is_transmitted_beyond_the_critical_angle() {
    // Water to bone: total from 21.27°. A plate is behind it, at either angle.
    let mut bench = Bench::new(silent(1480.0, 1.48));
    let bone = bench.tissue(silent(4080.0, 3.0));
    let wall = bench.tissue(silent(4080.0, 3.4));
    for (i, degrees) in [15.0_f32, 22.0, 30.0, 60.0].into_iter().enumerate() {
        let foot = Vec3::new(0.0, 80.0 * i as f32, 20.0);
        let turned = Quat::from_rotation_y(degrees.to_radians());
        bench.add(bone, 1, analytic::plate(foot + turned * (15.0 * Vec3::Z), Vec3::new(50.0, 50.0, 30.0), turned));
        bench.add(wall, 2, analytic::plate(foot + turned * (25.0 * Vec3::Z), Vec3::new(45.0, 45.0, 9.0), turned));
    }
    let mut rig = Rig::new(&bench.scene().unwrap(), &linear(1, 0.1, 1024, 80.0), &small(64, 1));
    for i in 0..4 {
        let frame = rig.frame(&at(0.0, 80.0 * f64::from(i), 0.0));
        let strongest = |from_mm: f64| {
            let line = rig.line(&frame, 0);
            let from = (from_mm / rig.probe.sample_spacing_mm()) as usize;
            line[from..].iter().map(|&s| magnitude(s)).fold(0.0, f64::max)
        };
        assert!(strongest(0.0) > 0.0);
        // The interface is at 20.8 mm of range.
        assert_eq!(strongest(22.5) > 0.0, i == 0, "{i}: {}", strongest(22.5));
    }
}

/// Media along the middle column of the image: tissue number, and depth of its first pixel, mm.
fn column(rig: &mut Rig, z: f64) -> Vec<(u8, f64)> {
    let frame = rig.frame(&at(0.0, 0.0, z));
    let sector = rig.sector();
    let mut runs: Vec<(u8, f64)> = Vec::new();
    for row in 0..frame.height {
        let label = frame.segmentation[(row * frame.width + frame.width / 2) as usize];
        if label > 0 && runs.last().is_none_or(|r| r.0 + 1 != label) {
            runs.push((label - 1, sector.pixel_centre_mm(0, row).y));
        }
    }
    runs
}

fn rig(scene: &Scene) -> Rig {
    let mut settings = small(1, 1);
    (settings.image.width, settings.image.height) = (64, 500);
    Rig::new(scene, &linear(8, 0.5, 2048, 50.0), &settings)
}

/// Asserts the media and echoes seen by a probe at depth `z`. `want` lists (tissue, depth); tissue i has 1.5 + 0.1·i
/// MRayl.
#[track_caller]
fn assert_media(rig: &mut Rig, z: f64, want: &[(u8, f64)]) {
    let runs = column(rig, z);
    assert_eq!(runs.len(), want.len(), "{runs:?}");
    for (run, want) in runs.iter().zip(want) {
        assert!(run.0 == want.0 && (run.1 - (want.1 - z).max(0.0)).abs() < 0.11, "{runs:?}");
    }
    let frame = rig.frame(&at(0.0, 0.0, z));
    let echoes = rig.echoes(&frame, 3, 1e-4);
    assert_eq!(echoes.len(), want.len() - 1, "{echoes:?}");
    let impedance = |tissue: u8| 1.5 + 0.1 * f64::from(tissue);
    let mut passed = 1.0;
    for (echo, pair) in echoes.iter().zip(want.windows(2)) {
        let (z1, z2) = (impedance(pair[0].0), impedance(pair[1].0));
        let r = (z2 - z1) / (z2 + z1);
        assert_part(echo.amplitude, passed * r.abs(), 1e-3, "echo");
        assert!((echo.range_mm(r) - (pair[1].1 - z)).abs() < 1e-3, "{echo:?}");
        passed *= 1.0 - r * r;
    }
}

fn bench() -> Bench {
    let mut bench = Bench::new(silent(1540.0, 1.5));
    for i in 1..5 {
        bench.tissue(silent(1540.0, 1.5 + 0.1 * f64::from(i)));
    }
    bench
}

#[test]
fn overlapping_surfaces_give_the_medium_of_the_highest_priority() {
    let mut b = bench();
    b.add(1, 1, slab(0.0, 20.0, 10.0, 30.0));
    b.add(2, 3, slab(0.0, 19.0, 20.0, 40.0));
    // Lower than both: visible only where it protrudes.
    b.add(3, 0, slab(0.0, 18.0, 15.0, 45.0));
    // Completely inside a higher one: never visible.
    b.add(4, 2, slab(0.0, 17.0, 25.0, 35.0));
    let mut rig = rig(&b.scene().unwrap());
    let media = [(0, 0.0), (1, 10.0), (2, 20.0), (3, 40.0), (0, 45.0)];
    assert_media(&mut rig, 0.0, &media);
    // Probes that start inside one, two, three and four of them.
    assert_media(&mut rig, 12.0, &media[1..]);
    assert_media(&mut rig, 17.0, &media[1..]);
    assert_media(&mut rig, 22.0, &media[2..]);
    assert_media(&mut rig, 27.0, &media[2..]);
    assert_media(&mut rig, 42.0, &media[3..]);
}

#[test]
fn nested_spheres_show_shell_after_shell() {
    let mut b = bench();
    for (i, radius) in [18.0, 12.0, 6.0].into_iter().enumerate() {
        b.add(i + 1, i as i32, analytic::sphere(Vec3::new(0.0, 0.0, 22.0), radius, 6));
    }
    let media = column(&mut rig(&b.scene().unwrap()), 0.0);
    let want = [(0, 0.0), (1, 4.0), (2, 10.0), (3, 16.0), (2, 28.0), (1, 34.0), (0, 40.0)];
    assert_eq!(media.len(), want.len(), "{media:?}");
    assert!(media.iter().zip(&want).all(|(m, w)| m.0 == w.0 && (m.1 - w.1).abs() < 0.15), "{media:?}");
}

#[test]
fn touching_surfaces_make_one_interface_or_none() {
    // The lower priority first, then reversed; equal tissues; a third face in the same plane.
    for (first, second) in [(1, 2), (2, 1)] {
        let mut b = bench();
        b.add(1, first, slab(0.0, 20.0, 10.0, 20.0));
        b.add(3, second, slab(0.0, 20.0, 20.0, 30.0));
        b.add(3, second, slab(0.0, 20.0, 30.0, 40.0));
        b.add(2, 0, slab(0.0, 20.0, 20.0, 45.0));
        let media = [(0, 0.0), (1, 10.0), (3, 20.0), (2, 40.0), (0, 45.0)];
        let mut rig = rig(&b.scene().unwrap());
        assert_media(&mut rig, 0.0, &media);
        assert_media(&mut rig, 15.0, &media[1..]);
        assert_media(&mut rig, 25.0, &media[2..]);
    }
}

#[test]
fn behind_a_tilted_mirror_the_level_is_that_behind_a_flat_one() {
    // Gas in uniform tissue: what is shown behind it is that tissue, mirrored.
    let levels_db = |degrees: f32, aperture: Choice| {
        let mut bench = Bench::new(grainy(0.0, 0.01));
        let gas = bench.tissue(silent(343.0, 0.0004));
        let turned = Quat::from_rotation_y(degrees.to_radians());
        let foot = Vec3::new(0.0, 0.0, 40.0) + turned * (30.0 * Vec3::Z);
        bench.add(gas, 1, analytic::plate(foot, Vec3::new(100.0, 60.0, 60.0), turned));
        let mut settings = small(1, 1);
        settings.effects = settings.effects.with(Effect::Aperture, aperture);
        let mut rig = Rig::new(&bench.scene().unwrap(), &linear(192, 0.2, 2048, 120.0), &settings);
        let frame = rig.frame(&at(0.0, 0.0, 0.0));
        // The middle of the array, 50 to 70 mm behind the mirror.
        let level_db = |behind_mm: f64| {
            let power = (64..128).map(|line| {
                let x_mm = 0.2 * (f64::from(line) - 95.5);
                let from_mm = 40.0 - x_mm * f64::from(degrees).to_radians().tan() + behind_mm;
                let sample = |mm: f64| (mm / rig.probe.sample_spacing_mm()) as usize;
                mean_square(
                    rig.line(&frame, line)[sample(from_mm)..sample(from_mm + 5.0)].iter().map(|&s| magnitude(s)),
                )
            });
            10.0 * (power.sum::<f64>() / 64.0).log10()
        };
        [50.0, 55.0, 60.0, 65.0].map(level_db)
    };
    for (name, aperture) in [("straight", Choice::Off), ("aperture", Choice::On)] {
        let (flat, tilted) = (levels_db(0.0, aperture), levels_db(20.0, aperture));
        println!("{name}: {flat:.2?} {tilted:.2?}");
        for (flat_db, tilted_db) in flat.iter().zip(tilted) {
            assert!((tilted_db - flat_db).abs() <= 1.5, "{name}: flat {flat:.2?}, tilted {tilted:.2?} dB");
        }
    }
}

#[test]
fn scanlines_without_echoes_of_their_own_receive_those_of_neighbours_behind_gas() {
    // Stripes of gas, which show mirrored tissue, and of an absorber, narrower than the beam. Mean power, and mean
    // difference of neighbouring scanlines, dB.
    let speckle = |aperture: Choice| {
        let mut bench = Bench::new(grainy(0.0, 0.01));
        let gas = bench.tissue(silent(343.0, 0.0004));
        let absorber = bench.tissue(Tissue { attenuation_db_cm_mhz: 100.0, ..silent(1540.0, 1.6) });
        bench.add(gas, 1, slab(0.0, 60.0, 30.0, 150.0));
        for i in -16_i8..=16 {
            let centre = Vec3::new(1.2 * f32::from(i), 0.0, 90.0);
            bench.add(absorber, 2, analytic::plate(centre, Vec3::new(0.6, 60.0, 121.0), Quat::IDENTITY));
        }
        let mut settings = small(1, 1);
        settings.effects = settings.effects.with(Effect::Aperture, aperture);
        let mut rig = Rig::new(&bench.scene().unwrap(), &linear(192, 0.2, 2048, 120.0), &settings);
        let frame = rig.frame(&at(0.0, 0.0, 0.0));
        let sample = |mm: f64| (mm / rig.probe.sample_spacing_mm()) as usize;
        let of_line = |line: u32| {
            mean_square(rig.line(&frame, line)[sample(40.0)..sample(55.0)].iter().map(|&s| magnitude(s))).max(1e-30)
        };
        let powers: Vec<f64> = (40..150).map(of_line).collect();
        let step_db = |pair: &[f64]| (10.0 * (pair[1] / pair[0]).log10()).abs();
        let steps_db = powers.windows(2).map(step_db).sum::<f64>() / (powers.len() - 1) as f64;
        (10.0 * (powers.iter().sum::<f64>() / powers.len() as f64).log10(), steps_db)
    };
    let [(straight_db, straight_steps_db), (level_db, steps_db)] = [Choice::Off, Choice::On].map(speckle);
    println!(
        "level {straight_db:.2} dB, {level_db:.2} dB with; steps {straight_steps_db:.2} dB, {steps_db:.2} dB with"
    );
    assert!((level_db - straight_db).abs() < 1.5, "{straight_db:.2} dB without, {level_db:.2} dB with");
    assert!(steps_db < straight_steps_db + 0.5, "{straight_steps_db:.2} dB without, {steps_db:.2} dB with");
}
