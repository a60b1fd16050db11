//! The pass of multiples on device and host against its twin; damaged passes must fail the comparison.

use insonify::render::{Choice, Effect, ImageConstants, ShaderSet, Snapshot, TestHooks};

use super::compare::{MULTIPLES, PASSES, compare};
use super::scenes::{Case, DEVICE, HOST, lifted, nested};

/// A case whose face reflects.
pub(crate) fn reflecting(mut case: Case) -> Case {
    case.settings.effects = case.settings.effects.with(Effect::Multiples, Choice::On);
    case.settings.receiver.face_reflection_db = -8.0;
    case
}

fn snapshot(case: &Case, on_host: bool, hooks: &TestHooks) -> Snapshot {
    case.renderer_on(if on_host { &HOST } else { &DEVICE }, hooks).snapshot(&case.pose).unwrap()
}

#[test]
fn every_pass_with_multiples_is_its_twin() {
    let mut wrong = Vec::new();
    for case in [nested(), lifted()].map(reflecting) {
        for on_host in [true, false] {
            let snapshot = snapshot(&case, on_host, &TestHooks::default());
            let changed = snapshot.with_needle.iter().zip(&snapshot.with_multiples).filter(|(a, b)| a != b).count();
            assert!(changed > 1000, "{}: {changed} samples with multiples prove nothing", case.name);
            let all = PASSES.iter().chain([&MULTIPLES]);
            wrong.extend(all.filter_map(|pass| compare(pass, &snapshot).err()).map(|e| (case.name, on_host, e)));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn a_damaged_pass_of_multiples_is_caught() {
    let damages = [
        ("REFLECTED: f32 = 1.0", "REFLECTED: f32 = 0.99"),
        ("a.x * b.y + a.y * b.x", "a.x * b.y - a.y * b.x"),
        ("row + i - 1u - strong_at[j]", "row + i - strong_at[j]"),
        ("again[row + i] = whole + weak", "again[row + i] = whole"),
        ("> MULTIPLE_SAMPLES {", "> MULTIPLE_SAMPLES - 4u {"),
        ("echo * (1.0 - bitcast<f32>(weakest) / power)", "echo"),
    ];
    let case = reflecting(nested());
    for (from, to) in damages {
        let mut shaders = ShaderSet::default();
        assert!(shaders.replace(MULTIPLES, from, to), "there is no `{from}` to damage");
        let snapshot = snapshot(&case, false, &TestHooks { shaders, ..TestHooks::default() });
        assert!(compare(MULTIPLES, &snapshot).is_err(), "`{to}` is not caught");
    }
    let image = ImageConstants { face_reflected: 0.99, ..ImageConstants::default() };
    let snapshot = snapshot(&case, true, &TestHooks { image, ..TestHooks::default() });
    assert!(compare(MULTIPLES, &snapshot).is_err(), "a face that reflects less is not caught on the host");
}
