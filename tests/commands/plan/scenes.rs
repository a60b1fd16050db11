//! Effect plans of all scenes in `configs/`.

use glam::Vec3;
use insonify::anatomy::TissueTable;
use insonify::anatomy::analytic::{self, Part, cuboid};
use insonify::phantom::{Parameters, movement, organs};
use insonify::pose::Pose;
use insonify::render::plan::{Bound, GREY_ALLOWED};
use insonify::render::{Choice, Effect};

use crate::plan::bench::{Case, station};

/// Effects that any scene with interfaces between tissues needs.
const TISSUES: [&str; 7] =
    ["refraction", "speed_displacement", "interface_echoes", "roughness", "thickness", "reflections", "attenuation"];

/// [`TISSUES`] and the effects `more`, in canonical order.
fn tissues_and(more: &[&'static str]) -> Vec<&'static str> {
    Effect::NAMES.iter().copied().filter(|name| TISSUES.contains(name) || more.contains(name)).collect()
}

/// The obstetric station with boxes instead of organs. A plan reads only the organs' tissues and motion.
fn obstetric() -> Case {
    let station = station("obstetric");
    let parameters = Parameters::default();
    let boxed = |organ: insonify::phantom::Organ| Part {
        name: organ.name,
        tissue: organ.tissue,
        priority: organ.priority,
        mesh: cuboid(Vec3::ZERO, Vec3::ONE),
    };
    let parts = organs(&parameters).into_iter().map(boxed).collect();
    let mut scene = analytic::scene(parts, &TissueTable::builtin().unwrap(), &station.background).unwrap();
    scene.motion = movement(&parameters);
    Case { scene, probe: station.probe, settings: station.settings, pose: Pose::IDENTITY }
}

#[test]
fn each_scene_calls_for_its_effects() {
    let usual = ["aperture", "scatterers", "elevational_speckle", "maps"];
    let and = |more: &[&'static str]| tissues_and(&[&usual[..], more].concat());
    let table = [
        // Heartbeat and maternal breathing; low quality asks for one ray and one layer.
        ("obstetric", and(&["contact", "frequency_exponent", "texture", "clutter", "noise", "motion"])),
        ("slabs", and(&["frequency_exponent"])),
        ("speckle_block", and(&["frequency_exponent"])),
        ("sphere", and(&["frequency_exponent"])),
        // Here and below, attenuation is proportional to the frequency.
        ("bone_plate", and(&[])),
        // Nylon wires: 2600 m/s among 1540.
        ("qa_phantom", and(&["rays"])),
        // Here and below, the scene has skin.
        ("lung_air", and(&["rays", "contact", "texture", "clutter", "noise"])),
        ("vessel_needle", and(&["rays", "layers", "contact", "frequency_exponent", "texture", "clutter"])),
        ("gallbladder_stones", and(&["rays", "layers", "contact", "texture", "clutter"])),
        // Liver alone: 1575 m/s displaces; no refraction, echoes or reflections; speckle differs across the slice.
        (
            "speckle",
            vec![
                "speed_displacement",
                "layers",
                "attenuation",
                "aperture",
                "scatterers",
                "elevational_speckle",
                "maps",
            ],
        ),
    ];
    for (name, expected) in &table {
        let case = if *name == "obstetric" { obstetric() } else { Case::station(name) };
        assert_eq!(case.on(), *expected, "{name}:\n{}", case.plan());
    }
    let sets = |names: [&str; 4]| names.map(|name| &table.iter().find(|(n, _)| *n == name).unwrap().1);
    let four = sets(["obstetric", "speckle", "slabs", "vessel_needle"]);
    for (i, one) in four.iter().enumerate() {
        assert!(four[..i].iter().all(|other| other != one), "{one:?} twice");
    }
}

#[test]
fn every_decision_has_a_reason_and_a_bound() {
    for case in [obstetric(), Case::station("speckle"), Case::station("vessel_needle")] {
        let plan = case.plan();
        assert_eq!(plan.decisions().len(), Effect::COUNT);
        for decision in plan.decisions() {
            assert!(decision.reason.len() > 8, "{decision:?}");
            assert_eq!(decision.on, decision.called_for, "{decision:?}");
            match &decision.bound {
                Bound::Level { grey, .. } => assert_eq!(decision.on, *grey > GREY_ALLOWED, "{decision:?}"),
                Bound::Displacement { .. } | Bound::None { .. } => assert!(decision.on, "{decision:?}"),
                Bound::Exact | Bound::OnRequest | Bound::Aside { .. } => {
                    assert!(!decision.on, "{decision:?}")
                }
            }
        }
        assert_eq!(plan.warnings().count(), 0);
        // A specimen's tissues have textures, too; a patient's are shown.
        let textured = plan.notices().any(|notice| notice.contains("texture") && notice.contains("no surface is skin"));
        assert_eq!(textured, !plan.has(Effect::Texture));
    }
}

#[test]
fn forced_choices_are_carried_out_and_reported() {
    let case = Case::station("slabs").with(Effect::Refraction, Choice::Off).with(Effect::Motion, Choice::On);
    let plan = case.plan();
    assert!(!plan.has(Effect::Refraction) && plan.has(Effect::Motion));
    let warnings: Vec<_> = plan.warnings().collect();
    assert_eq!(warnings.len(), 1);
    for words in ["refraction is off", "fat has 1450 m/s", "muscle has 1580 m/s", "total reflection"] {
        assert!(warnings[0].contains(words), "{}", warnings[0]);
    }
    // Effects that the scene doesn't call for may be switched off silently.
    let case = Case::station("speckle").with(Effect::Refraction, Choice::Off);
    assert_eq!(case.plan().warnings().count(), 0);
}

#[test]
fn maps_are_made_only_for_readers() {
    let mut case = Case::station("slabs");
    assert!(case.plan().has(Effect::Maps));
    let mut renderer = case.renderer(&case.settings);
    for maps in [false, true, false] {
        renderer.set_maps(maps);
        assert_eq!(renderer.plan().has(Effect::Maps), maps);
    }
    case.settings.maps = false;
    assert!(!case.plan().has(Effect::Maps));
    let frame = case.frame(&case.settings);
    assert!(frame.segmentation.is_empty() && frame.attenuation.is_empty());
    let case = case.with(Effect::Maps, Choice::On);
    let frame = case.frame(&case.settings);
    assert_eq!(frame.segmentation.len(), frame.bmode.len());
}
