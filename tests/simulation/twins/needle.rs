//! The passes of the needle on device and host against their twins; damaged passes must fail the comparison.

use glam::{DQuat, DVec3};
use insonify::needle::Needle;
use insonify::pose::Pose;
use insonify::render::{Choice, Effect, ImageConstants, ShaderSet, Snapshot, TestHooks};
use insonify::settings::{NeedleKind, NeedleSettings};

use super::compare::{NEEDLE_PASSES, PASSES, compare};
use super::scenes::{Case, DEVICE, HOST, cases, nested};

/// A case with an etched needle near the image plane. Its shaft is oblique to all axes.
fn with_needle(mut case: Case) -> (Case, Needle) {
    case.settings.needle = Some(NeedleSettings { gauge: 18, kind: NeedleKind::Etched, ..NeedleSettings::default() });
    let direction = DVec3::new(0.8, 0.02, 0.5).normalize();
    let orientation = DQuat::from_rotation_arc(DVec3::Z, direction) * DQuat::from_rotation_z(0.7);
    let in_probe = Pose { position_mm: DVec3::new(7.3, 0.2, 41.7), orientation };
    let scene_from_needle = case.pose * in_probe;
    (case, Needle { scene_from_needle, bevel_known: true })
}

/// A snapshot of a case with its needle.
fn snapshot(case: &Case, needle: Needle, on_host: bool, hooks: &TestHooks) -> Snapshot {
    let mut renderer = case.renderer_on(if on_host { &HOST } else { &DEVICE }, hooks);
    renderer.set_needle(Some(needle));
    renderer.snapshot(&case.pose).unwrap()
}

#[test]
fn every_pass_with_a_needle_is_its_twin() {
    let mut wrong = Vec::new();
    let mut straight = nested();
    straight.settings.effects = straight.settings.effects.with(Effect::Aperture, Choice::Off);
    let single = cases().swap_remove(0);
    for (case, needle) in [nested(), straight, single].map(with_needle) {
        for on_host in [true, false] {
            let snapshot = snapshot(&case, needle, on_host, &TestHooks::default());
            let table = snapshot.inputs.needle.as_ref().unwrap();
            assert!(table.echoes.iter().any(|line| line.len() > 3), "{}: no echo proves nothing", case.name);
            assert_eq!(table.shadows.is_empty(), snapshot.inputs.aperture.is_none(), "{}", case.name);
            let all = PASSES.iter().chain(&NEEDLE_PASSES);
            wrong.extend(all.filter_map(|pass| compare(pass, &snapshot).err()).map(|e| (case.name, on_host, e)));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn a_damaged_pass_of_the_needle_is_caught() {
    let damages = [
        ("needle_shadow", "NEEDLE_TRANSMISSION: f32 = 1.0", "NEEDLE_TRANSMISSION: f32 = 0.9"),
        ("needle_echo", "left_mm -= through_mm;", "left_mm -= 0.98 * through_mm;"),
        ("needle_echo", "trips * ln_gain", "0.9 * ln_gain"),
        ("needle_echo", "phasor(echo.w)", "vec2<f32>(1.0, 0.0)"),
        ("needle_map", "NEEDLE_RADIUS: f32 = 1.0", "NEEDLE_RADIUS: f32 = 1.5"),
    ];
    let (case, needle) = with_needle(nested());
    for (pass, from, to) in damages {
        let mut shaders = ShaderSet::default();
        assert!(shaders.replace(pass, from, to), "{pass} has no `{from}` to damage");
        let snapshot = snapshot(&case, needle, false, &TestHooks { shaders, ..TestHooks::default() });
        assert!(compare(pass, &snapshot).is_err(), "{pass}: `{to}` is not caught");
    }
    let usual = ImageConstants::default();
    let changed = [
        ("needle_shadow", ImageConstants { needle_transmission: 0.9, ..usual }),
        ("needle_echo", ImageConstants { needle_amplitude: 1.02, ..usual }),
        ("needle_map", ImageConstants { needle_radius: 1.5, ..usual }),
    ];
    for (pass, image) in changed {
        let snapshot = snapshot(&case, needle, true, &TestHooks { image, ..TestHooks::default() });
        assert!(compare(pass, &snapshot).is_err(), "{pass} is not caught on the host");
    }
}

#[test]
fn frames_with_a_needle_are_the_same_from_run_to_run() {
    let (case, needle) = with_needle(nested());
    for on_host in [true, false] {
        let [one, other] = [(), ()].map(|()| snapshot(&case, needle, on_host, &TestHooks::default()));
        assert_eq!((one.bmode, one.segmentation), (other.bmode, other.segmentation));
    }
}
