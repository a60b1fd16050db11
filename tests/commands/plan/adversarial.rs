//! Scenes that need an effect for an inconspicuous reason. The plan keeps the effect, and the image shows why.

use glam::{DVec3, Quat, Vec3};
use insonify::anatomy::analytic::{Part, plate, sphere};
use insonify::anatomy::motion::{Drift, Field, Rhythm, Shape};
use insonify::anatomy::{Motion, Tissue};
use insonify::pose::Pose;
use insonify::render::Effect;
use insonify::station::Station;

use crate::plan::bench::{Case, difference, part, silent, slab, speckled};

/// Asserts that the plan keeps `effect`, and that the image changes without it.
fn assert_needed(case: &Case, effect: Effect) {
    assert!(case.plan().has(effect), "{}", case.plan());
    let (planned, without) = case.planned_and_without(effect);
    let off = difference(&planned, &without);
    println!("without {effect}: {off:?}");
    assert!(off.most > 40 && off.part > 0.01, "{effect}: {off:?}");
}

/// Pose of a probe at (`x`, 0, `z`), whose axis is tilted by `angle_deg` from +z to +x.
fn tilted(x: f64, z: f64, angle_deg: f64) -> Pose {
    let (sin, cos) = angle_deg.to_radians().sin_cos();
    Pose::looking(DVec3::new(x, 0.0, z), DVec3::new(sin, 0.0, cos), DVec3::new(cos, 0.0, -sin))
}

#[test]
fn a_weak_interface_at_critical_incidence() {
    // Equal impedances: no echo at normal incidence. From 1500 to 1600 m/s, reflection is total beyond 69.6°.
    let tissues = [("slow", speckled(1500.0, 1.6, 0.01)), ("fast", speckled(1600.0, 1.6, 0.01))];
    let mut case = Case::of(vec![part("deep", "fast", slab(12.04, 80.0))], &tissues, "slow");
    for effect in [Effect::Refraction, Effect::InterfaceEchoes, Effect::Reflections, Effect::SpeedDisplacement] {
        assert!(case.plan().has(effect), "{}", case.plan());
    }
    case.pose = tilted(-5.0, 6.0, 72.0);
    assert_needed(&case, Effect::Refraction);
    assert_needed(&case, Effect::Reflections);
}

#[test]
fn a_thin_slow_layer() {
    // 0.4 mm of equal impedance, oblique: it neither echoes nor attenuates.
    let tissues = [("slow", speckled(1350.0, 1.6, 0.01)), ("all", speckled(1540.0, 1.6, 0.01))];
    let layer = plate(Vec3::new(0.0, 0.0, 10.0), Vec3::new(80.0, 80.0, 0.4), Quat::from_rotation_y(0.9));
    let case = Case::of(vec![part("layer", "slow", layer)], &tissues, "all");
    for effect in [Effect::Refraction, Effect::SpeedDisplacement, Effect::InterfaceEchoes, Effect::Reflections] {
        assert!(case.plan().has(effect), "{}", case.plan());
    }
    // Tissue behind it is displaced sideways and in depth by more than a wavelength: different speckle.
    assert_needed(&case, Effect::Refraction);
    assert_needed(&case, Effect::SpeedDisplacement);
}

#[test]
fn a_rough_surface_outside_the_fan_mirrored_into_it() {
    // A smooth plate at 45° below the probe mirrors a rough one to the side, outside every scanline.
    let mirror = plate(Vec3::new(0.0, 0.0, 14.0), Vec3::new(40.0, 30.0, 1.0), Quat::from_rotation_y(-0.785));
    let beside = plate(Vec3::new(22.0, 0.0, 14.0), Vec3::new(1.0, 30.0, 16.0), Quat::IDENTITY);
    let rough = Tissue { roughness: 0.3, thickness_mm: 0.2, ..silent(1540.0, 6.0) };
    let tissues = [("mirror", silent(1540.0, 30.0)), ("rough", rough), ("all", speckled(1540.0, 1.6, 0.001))];
    let parts = vec![part("mirror", "mirror", mirror), Part { priority: 2, ..part("beside", "rough", beside) }];
    let mut case = Case::of(parts, &tissues, "all").asking(4, 1);
    case.settings.image.gain_db = 10.0;
    for effect in [Effect::Rays, Effect::Thickness] {
        assert!(case.plan().has(effect), "{}", case.plan());
    }
    assert_needed(&case, Effect::Reflections);
    assert_needed(&case, Effect::Roughness);
}

#[test]
fn an_attenuating_tissue_only_in_the_near_field() {
    // Half a millimetre of 40; equal impedance and speed.
    let lossy = Tissue { attenuation_db_cm_mhz: 30.0, ..speckled(1540.0, 1.6, 0.01) };
    let tissues = [("lossy", lossy), ("all", speckled(1540.0, 1.6, 0.01))];
    let case = Case::of(vec![part("film", "lossy", slab(0.52, 1.02))], &tissues, "all");
    assert_eq!(case.on(), ["attenuation", "aperture", "scatterers", "elevational_speckle", "maps"]);
    let (planned, without) = case.planned_and_without(Effect::Attenuation);
    let off = difference(&planned, &without);
    // 2 · 30 dB/cm/MHz · 5 MHz · 0.05 cm = 15 dB darker behind it: 64 grey levels.
    assert!((off.mean_off - 15.0 * 255.0 / 60.0).abs() < 6.0, "{off:?}");
}

#[test]
fn a_tissue_whose_speed_the_station_overrides() {
    let plan = |tissues: &str| {
        let text = format!(
            "[scene]\npath = \"assets/scenes/qa_phantom.glb\"\nbackground = \"tmm\"\n[tissues.nylon]\nspeed_m_s = 1540\n{tissues}"
        );
        let station = Station::parse(&text, std::path::Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap();
        let scene = station.load_scene_from(station.scene_file().unwrap()).unwrap();
        insonify::render::EffectPlan::new(&scene, &station.probe, &station.settings)
    };
    // The wires, given the speed of everything else.
    assert!(!plan("").has(Effect::Refraction) && !plan("").has(Effect::SpeedDisplacement), "{}", plan(""));
    let overridden = plan("[tissues.tmm_plus_6_db]\nspeed_m_s = 1541");
    for effect in [Effect::Refraction, Effect::SpeedDisplacement, Effect::Reflections] {
        assert!(overridden.has(effect), "{overridden}");
    }
    // A tissue that is not in the scene changes nothing.
    assert_eq!(plan("[tissues.liver]\nspeed_m_s = 1700"), plan(""));
}

#[test]
fn a_tissue_present_only_as_the_background() {
    let tissues = [("inside", speckled(1540.0, 1.6, 0.01)), ("outside", speckled(1450.0, 1.4, 0.01))];
    let slabs = || vec![part("slab", "inside", slab(-10.04, 30.0))];
    for effect in [Effect::Refraction, Effect::SpeedDisplacement, Effect::InterfaceEchoes, Effect::Reflections] {
        assert!(Case::of(slabs(), &tissues, "outside").plan().has(effect));
        assert!(!Case::of(slabs(), &tissues, "inside").plan().has(effect));
    }
    assert_needed(&Case::of(slabs(), &tissues, "outside"), Effect::SpeedDisplacement);
}

#[test]
fn a_moving_part() {
    let tissues = [("part", speckled(1540.0, 1.6, 0.05)), ("all", speckled(1540.0, 1.6, 0.01))];
    let centre_mm = Vec3::new(0.7, 0.3, 20.0);
    let mut case = Case::of(vec![part("part", "part", sphere(centre_mm, 7.0, 4))], &tissues, "all");
    assert!(!case.plan().has(Effect::Motion));
    let shape = Shape::Beat { centre_mm, axis: Vec3::Y, radius_mm: 7.0, squeeze: 0.35, shorten: 0.1 };
    let rhythm = Rhythm::Heart { beats_per_min: 60.0 };
    let field = Field { name: "heart".into(), surfaces: vec!["part".into()], shape, rhythm };
    case.scene.motion = Motion { fields: vec![field], drift: None };
    assert_needed(&case, Effect::Motion);
    // Also a drift of the whole scene.
    let drift = Some(Drift { way_mm: Vec3::new(0.0, 0.0, 4.0), rhythm });
    case.scene.motion = Motion { fields: Vec::new(), drift };
    assert_needed(&case, Effect::Motion);
}
