//! Tests of the directions of refracted paths against Snell's law. Only paths that have reflected bend; before that,
//! the aperture bends beams (`tests/simulation/truth/refraction.rs`).

use glam::{DMat3, DQuat, DVec3, Vec3};
use insonify::acoustics::ASSUMED_SPEED_M_S;
use insonify::acoustics::interface::refracted;
use insonify::anatomy::{Tissue, analytic};
use insonify::pose::Pose;
use insonify::render::{Choice, Effect};
use insonify::transducer::Probe;

use super::bench::{Bench, Rig, at, facing, linear, silent, slab, small};

/// Distance between specimens, mm. They lie on a grid with rows of `ROW`, so that none is far from the scene's centre.
const PITCH: f64 = 200.0;
const ROW: usize = 6;
/// Depth of the plate below a bone, mm.
const PLATE_MM: f64 = 60.0;
/// Length of a path up to the second medium, mm.
const ENTRY_MM: f64 = 20.0;
/// Depth of the mirror, which turns a path from z to x, mm.
const MIRROR_MM: f64 = 10.0;

fn pose(specimen: usize) -> Pose {
    at(PITCH * (specimen % ROW) as f64, PITCH * (specimen / ROW) as f64, 0.0)
}

/// Position in the scene, after the mirror, of the point `straight` of a path that would go straight on from `foot`.
fn mirrored(foot: DVec3, straight: DVec3) -> DVec3 {
    let mirror = MIRROR_MM * DVec3::Z;
    foot + mirror + turned_by_mirror() * (straight - mirror)
}

/// Rotation of the path by the mirror: from z to x.
fn turned_by_mirror() -> DQuat {
    DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2)
}

#[test]
fn refracted_paths_follow_snell_within_0_05_degrees() {
    // Speeds in m/s, angle of incidence in degrees, and azimuth of the plane's tilt about the beam.
    let cases = [
        (1450.0, 1578.0, 20.0, 0.0),
        (1450.0, 1578.0, 45.0, 30.0),
        (1480.0, 4080.0, 15.0, 180.0),
        (1480.0, 4080.0, 20.0, 75.0),
        (1578.0, 1450.0, 50.0, 250.0),
        (1540.0, 1500.0, 5.0, 90.0),
        (1600.0, 343.0, 40.0, 120.0),
        (1480.0, 1600.0, 60.0, 300.0),
    ];
    // Three planes of different orientation, met by the same path.
    let tilts = [(35.0, 20.0), (30.0, 140.0), (40.0, 260.0)];
    let turned = |(tilt, about): (f64, f64)| {
        DQuat::from_rotation_z(f64::to_radians(about)) * DQuat::from_rotation_y(f64::to_radians(tilt))
    };
    let snell = |c1, c2, rotation: DQuat| refracted(c1, c2, rotation * DVec3::NEG_Z, DVec3::Z).unwrap();
    let mut bench = Bench::new(silent(1540.0, 1.5));
    let gas = bench.tissue(silent(343.0, 0.0004));
    let mut planes = Vec::new();
    for (i, (c1, c2, incidence, azimuth)) in cases.into_iter().enumerate() {
        let rotation = turned((incidence, azimuth));
        let direction = snell(c1, c2, rotation);
        // Impedances near intromission: every path is transmitted.
        let cos_t = -direction.dot(rotation * DVec3::NEG_Z);
        let z2 = 1.1 * 1.5 * cos_t / incidence.to_radians().cos();
        let first = bench.tissue(silent(c1, 1.5));
        let second = bench.tissue(silent(c2, z2));
        let plane = bench.tissue(Tissue { roughness: 0.5, ..silent(c2, 1.2 * z2) });
        for (k, &tilt) in tilts.iter().enumerate() {
            let foot = pose(tilts.len() * i + k).position_mm;
            let around = (foot + MIRROR_MM * DVec3::Z).as_vec3();
            bench.add(first, 0, analytic::plate(around, Vec3::splat(90.0), glam::Quat::IDENTITY));
            let mirror = DQuat::from_rotation_y(-std::f64::consts::FRAC_PI_4);
            bench.add(gas, 3, facing(foot + MIRROR_MM * DVec3::Z, 6.0, mirror));
            let entry = ENTRY_MM * DVec3::Z;
            bench.add(second, 1, facing(mirrored(foot, entry), 45.0, turned_by_mirror() * rotation));
            // A plane about 12 mm further on, tilted against the path.
            let about_path = DQuat::from_rotation_arc(DVec3::Z, direction) * turned(tilt);
            let point = entry + 12.0 * direction;
            bench.add(plane, 2, facing(mirrored(foot, point), 20.0, turned_by_mirror() * about_path));
            planes.push((point - entry, about_path * DVec3::NEG_Z));
        }
    }
    let mut rig = Rig::new(&bench.scene().unwrap(), &linear(1, 1.0, 8192, 120.0), &small(1, 1));
    let mut worst = 0.0_f64;
    for (i, (c1, c2, incidence, azimuth)) in cases.into_iter().enumerate() {
        let mut normals = [DVec3::ZERO; 3];
        let mut parts = [0.0; 3];
        for k in 0..3 {
            let specimen = 3 * i + k;
            let frame = rig.frame(&pose(specimen));
            let entered = ENTRY_MM * ASSUMED_SPEED_M_S / c1;
            let echoes = rig.echoes(&frame, 0, 1e-9);
            let plane = echoes.iter().find(|e| e.peak_mm > entered + 2.0).unwrap();
            let path_mm = (plane.range_mm(1.0) - entered) * c2 / ASSUMED_SPEED_M_S;
            let (point, normal) = planes[specimen];
            // The path ends on the plane: normal · direction · path = normal · point.
            normals[k] = normal;
            parts[k] = normal.dot(point) / path_mm;
        }
        let measured =
            DMat3::from_cols_array_2d(&normals.map(|n| n.to_array())).transpose().inverse() * DVec3::from_array(parts);
        let want = snell(c1, c2, turned((incidence, azimuth)));
        // A direction solved from three lengths is a unit vector only if all three are right.
        assert!((measured.length() - 1.0).abs() < 5e-4, "{}", measured.length());
        let off = measured.angle_between(want).to_degrees();
        worst = worst.max(off);
        assert!(off <= 0.05, "{c1} → {c2} m/s at {incidence}°: {off}° off");
    }
    println!("largest departure from Snell: {worst:.5}°");
}

/// Ranges of the plate's echo, mm, on the scanlines below a tilted bone of 3 mm.
fn ranges_behind_a_bone(aperture: Choice) -> Vec<f64> {
    let mut bench = Bench::new(silent(1540.0, 1.5));
    let bone = bench.tissue(Tissue { attenuation_db_cm_mhz: 4.0, ..silent(2800.0, 4.2) });
    let plate = bench.tissue(Tissue { roughness: 0.5, ..silent(1540.0, 1.7) });
    let tilt = glam::Quat::from_rotation_y(0.3);
    bench.add(bone, 1, analytic::plate(Vec3::new(0.0, 0.0, 40.0), Vec3::new(3.0, 60.0, 3.0), tilt));
    bench.add(plate, 1, slab(0.0, 40.0, PLATE_MM, 80.0));
    let mut settings = small(1, 1);
    settings.effects = settings.effects.with(Effect::Aperture, aperture);
    // A narrow beam: echoes beside the bone stay out.
    let probe = Probe { aperture_mm: 20.0, focus_mm: 60.0, ..linear(129, 0.3, 4096, 80.0) };
    let mut rig = Rig::new(&bench.scene().unwrap(), &probe, &settings);
    let frame = rig.frame(&at(0.05, 0.0, 0.0));
    let strongest = |line: u32| {
        let echoes = rig.echoes(&frame, line, 1e-12);
        let behind = echoes.into_iter().filter(|e| e.peak_mm > 50.0);
        behind.max_by(|a, b| a.amplitude.total_cmp(&b.amplitude)).map_or(f64::NAN, |e| e.peak_mm)
    };
    // Within 1 mm of the bone's middle.
    (61..=67).map(strongest).collect()
}

#[test]
fn what_is_seen_past_a_small_bone_lies_in_its_place() {
    let (seen, straight) = (ranges_behind_a_bone(Choice::On), ranges_behind_a_bone(Choice::Off));
    println!("{seen:.2?}\n{straight:.2?}");
    assert!(seen.iter().all(|range| (range - PLATE_MM).abs() < 0.1), "{seen:?}");
    // Through the bone, the plate comes 1.3 mm too early.
    assert!(straight.iter().any(|range| PLATE_MM - range > 1.0), "{straight:?}");
}
