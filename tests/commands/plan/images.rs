//! A frame with the planned effects equals the frame with all effects, within the bound that the plan states.

use glam::{Quat, Vec3};
use insonify::anatomy::Tissue;
use insonify::anatomy::analytic::{Part, plate, sphere};
use insonify::render::plan::Bound;
use insonify::render::{Choice, Effect};
use insonify::transducer::ProbeKind;

use crate::plan::bench::{Case, difference, part, silent, slab, speckled};

fn bound_of(case: &Case, effect: Effect) -> Bound {
    case.plan().decisions().iter().find(|d| d.effect == effect).unwrap().bound.clone()
}

/// Largest fraction of the pixels that may differ by more than one level. A sample differs where rounding moves a point
/// into the next cell of scatterers, or makes another scatterer of a cell the nearest.
const MOVED: f64 = 3e-3;

/// Asserts that the frames are equal, except for rounding of grey levels.
fn assert_exact(name: &str, case: &Case) {
    let (planned, whole) = case.planned_and_whole();
    let off = difference(&planned, &whole);
    println!("{name}: {off:?}");
    assert!(off.mean > 2.0, "{name}: a black image proves nothing: {off:?}");
    assert!(off.part < MOVED && off.mean_off.abs() < 0.01, "{name}: {off:?}");
    assert_eq!(planned.segmentation, whole.segmentation, "{name}");
    let maps_off = planned.attenuation.iter().zip(&whole.attenuation).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(maps_off <= 0.5 / 255.0, "{name}: the attenuation map is {maps_off} off");
}

#[test]
fn the_sample_scenes_are_the_same_with_all_effects() {
    for name in ["slabs", "speckle_block", "sphere", "bone_plate", "lung_air", "qa_phantom"] {
        assert_exact(name, &Case::station(name));
    }
    for name in ["vessel_needle", "gallbladder_stones"] {
        assert_exact(name, &Case::station(name).asking(2, 2));
    }
}

/// A case with nothing but speckle, below a convex probe.
fn speckle_alone(speed_m_s: f64) -> Case {
    let mut case = Case::of(vec![part("slab", "a", slab(10.04, 20.0))], &[("a", speckled(speed_m_s, 1.6, 0.01))], "a");
    case.probe.kind = ProbeKind::Convex { radius_mm: 20.0, fov_deg: 50.0 };
    case.asking(6, 1)
}

#[test]
fn rays_without_effect_are_left_out() {
    let case = speckle_alone(1540.0);
    assert_eq!(case.on(), ["aperture", "scatterers", "elevational_speckle", "maps"]);
    assert_eq!(bound_of(&case, Effect::Rays), Bound::Exact);
    assert_exact("6 rays at 1540 m/s", &case);

    // At any speed: all rays read the scatterers on the scanline's axis.
    let case = speckle_alone(1580.0);
    assert_eq!(bound_of(&case, Effect::Rays), Bound::Exact);
    assert_exact("6 rays at 1580 m/s", &case);
}

#[test]
fn layers_are_left_out_where_the_slice_is_uniform() {
    let of = |tissue: Tissue| Case::of(vec![part("slab", "a", slab(10.04, 20.0))], &[("a", tissue)], "a").asking(1, 3);
    assert!(!of(silent(1540.0, 1.6)).plan().has(Effect::Layers));
    let case = of(speckled(1540.0, 1.6, 0.01));
    assert_eq!(bound_of(&case, Effect::Layers), Bound::Exact);
    assert_exact("3 layers of one medium", &case);
    // Oblique layers are longer and attenuate more.
    let lossy = |loss| of(Tissue { attenuation_db_cm_mhz: loss, ..speckled(1540.0, 1.6, 0.01) });
    let case = lossy(0.7);
    let Bound::Level { grey, .. } = bound_of(&case, Effect::Layers) else { panic!("{}", case.plan()) };
    let (planned, whole) = case.planned_and_whole();
    let off = difference(&planned, &whole);
    println!("3 layers of one medium that attenuates, {grey:.3} grey levels: {off:?}");
    assert!(grey > 0.0 && !case.plan().has(Effect::Layers), "{grey}");
    assert!(grey <= 1.0 && off.part < 1e-3 && off.mean_off.abs() <= grey, "{off:?}");
    assert!(lossy(10.0).plan().has(Effect::Layers), "{}", lossy(10.0).plan());
    let two = [("slab", speckled(1540.0, 1.6, 0.02)), ("all about", speckled(1540.0, 1.6, 0.01))];
    let two = Case::of(vec![part("slab", "slab", slab(10.04, 20.0))], &two, "all about").asking(1, 3);
    assert!(two.plan().has(Effect::Layers));
}

#[test]
fn edges_of_silent_targets_stay_within_a_scanlines_width() {
    let louder = speckled(1540.0, 1.6, 0.05);
    let tissues = [("target", louder), ("all about", speckled(1540.0, 1.6, 0.01))];
    let target = || vec![part("target", "target", sphere(Vec3::new(0.7, 0.3, 20.0), 5.0, 4))];
    let mut case = Case::of(target(), &tissues, "all about").asking(8, 1);
    // Half of 0.31 mm is more than half a pixel, and than a quarter of the beam's σ.
    let Bound::Aside { mm, allowed_mm } = bound_of(&case, Effect::Rays) else { panic!("{}", case.plan()) };
    assert!((mm - 0.5 * 20.0 / 64.0).abs() < 1e-9 && mm > allowed_mm && case.plan().has(Effect::Rays), "{allowed_mm}");
    case.probe.scanlines = 192;
    let Bound::Aside { mm, .. } = bound_of(&case, Effect::Rays) else { panic!("{}", case.plan()) };
    assert!((mm - 0.5 * 20.0 / 192.0).abs() < 1e-9);
    assert_eq!(case.on(), ["aperture", "scatterers", "elevational_speckle", "maps"]);
    let (planned, whole) = case.planned_and_whole();
    // Pixels whose level depends on an edge: the point-spread function extends beyond the bound.
    let (width, pixel_mm) = (planned.width as usize, 40.0 / 320.0);
    let reach_mm = mm + 2.5 * case.probe.lateral_sigma_mm(20.0) + 4.0 * case.probe.axial_sigma_mm();
    let (mut inner, mut beyond) = (0, 0);
    for i in (0..planned.mask.len()).filter(|&i| planned.mask[i] == 255) {
        let (column, row) = ((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
        let x_mm = (column - 0.5 * width as f64) * pixel_mm - 0.7;
        let z_mm = row * pixel_mm - 20.0;
        let from_edge_mm = (x_mm.hypot(z_mm) - (25.0f64 - 0.09).sqrt()).abs();
        if from_edge_mm > reach_mm + 0.3 {
            inner += 1;
            beyond += usize::from(planned.bmode[i].abs_diff(whole.bmode[i]) > 1);
        }
    }
    let off = difference(&planned, &whole);
    println!("silent target: {off:?}, {inner} pixels away from its edge, {beyond} differ");
    assert!(inner > 10_000 && beyond * 1000 < inner && off.mean_off.abs() < 1.0, "{inner}, {beyond}: {off:?}");
}

#[test]
fn echoes_below_black_add_half_a_level_at_most() {
    // Equal speed, and an impedance higher by 4·10⁻⁷: −135 dB.
    let tissues = [("a", speckled(1540.0, 1.6, 0.01)), ("b", speckled(1540.0, 1.600_000_6, 0.01))];
    let mut case = Case::of(vec![part("slab", "b", slab(10.04, 20.0))], &tissues, "a");
    case.settings.image.gain_db = 0.0;
    let Bound::Level { grey, .. } = bound_of(&case, Effect::InterfaceEchoes) else { panic!("{}", case.plan()) };
    assert!(grey > 0.0 && grey <= 0.5, "{grey}");
    assert!(!case.plan().has(Effect::InterfaceEchoes));
    assert_exact("an echo below black", &case);
    // At maximum gain it is visible.
    let mut loud = case;
    loud.settings.image.gain_db = 120.0;
    assert!(loud.plan().has(Effect::InterfaceEchoes), "{}", loud.plan());
}

#[test]
fn a_plan_that_changes_with_the_gain_equals_a_new_renderers() {
    let tissues = [("a", speckled(1540.0, 1.6, 0.01)), ("b", speckled(1540.0, 1.600_000_6, 0.01))];
    let case = Case::of(vec![part("slab", "b", slab(10.04, 20.0))], &tissues, "a");
    let with_gain = |gain_db| {
        let mut settings = case.settings;
        settings.image.gain_db = gain_db;
        settings
    };
    let mut renderer = case.renderer(&with_gain(0.0));
    let mut frame = insonify::render::Frame::default();
    for (gain_db, echoes) in [(0.0, false), (120.0, true), (0.0, false)] {
        let settings = with_gain(gain_db);
        renderer.reconfigure(&case.probe, &settings).unwrap();
        assert_eq!(renderer.plan().has(Effect::InterfaceEchoes), echoes, "{gain_db} dB: {}", renderer.plan());
        renderer.set_time_s(0.3);
        renderer.render(&case.pose, &mut frame).unwrap();
        assert!(frame.bmode == case.frame(&settings).bmode, "{gain_db} dB");
    }
}

#[test]
fn media_of_equal_speed_and_impedance_never_reflect() {
    // A scanline meets a face at 10⁻⁴ rad, 20 mm deep: 1 − cos² rounds to 1.
    let rough = Tissue { roughness: 0.3, ..speckled(1540.0, 1.6, 0.01) };
    let line_x = 0.5 * 20.0 / 64.0;
    let (normal_to, size) = (Quat::from_rotation_y(1e-4), Vec3::new(10.0, 80.0, 200.0));
    let beside = plate(Vec3::new(line_x + 5.0, 0.0, 20.0), size, normal_to);
    let case = Case::of(vec![part("beside", "b", beside)], &[("a", rough.clone()), ("b", rough)], "a");
    assert_eq!(case.on(), ["aperture", "scatterers", "elevational_speckle", "maps"]);
    assert_exact("a grazed face between like media", &case);
}

#[test]
fn invisible_attenuation_is_left_out() {
    let lossy = Tissue { attenuation_db_cm_mhz: 0.0004, ..speckled(1540.0, 1.6, 0.01) };
    let case = Case::of(vec![part("slab", "b", slab(10.04, 20.0))], &[("a", lossy.clone()), ("b", lossy)], "a");
    let Bound::Level { db, grey } = bound_of(&case, Effect::Attenuation) else { panic!("{}", case.plan()) };
    assert!((db - 2.0 * 0.0004 * 5.0 * 4.0).abs() < 1e-9 && grey < 0.5, "{db} dB, {grey}");
    assert!(!case.plan().has(Effect::Attenuation));
    let (planned, whole) = case.planned_and_whole();
    let off = difference(&planned, &whole);
    println!("weak attenuation: {off:?}");
    assert!(off.mean > 20.0 && off.part < 1e-3 && off.mean_off.abs() <= grey, "{off:?}");
    // The map: one-way e^(−Σμ).
    let least = 10f64.powf(-0.5 * db / 20.0);
    assert!(!planned.attenuation.is_empty() && planned.attenuation.len() == whole.attenuation.len());
    for (a, b) in planned.attenuation.iter().zip(&whole.attenuation) {
        assert!(f64::from((a - b).abs()) <= 1.0 - least + 1e-6, "{a} {b}");
    }
}

/// Parts of several tissues of equal speed, which refract nothing and reflect little.
fn one_speed() -> (Vec<Part>, [(&'static str, Tissue); 3]) {
    let parts = vec![
        part("slab", "b", slab(8.04, 30.0)),
        Part { priority: 2, ..part("ball", "c", sphere(Vec3::new(1.0, 0.0, 18.0), 4.0, 4)) },
    ];
    let tissues =
        [("a", speckled(1540.0, 1.5, 0.01)), ("b", speckled(1540.0, 1.6, 0.02)), ("c", speckled(1540.0, 1.7, 0.005))];
    (parts, tissues)
}

#[test]
fn equal_speed_and_weak_interfaces_need_neither_refraction_nor_reflections() {
    let (parts, tissues) = one_speed();
    let case = Case::of(parts, &tissues, "a");
    let on = ["interface_echoes", "aperture", "scatterers", "elevational_speckle", "maps"];
    assert_eq!(case.on(), on, "{}", case.plan());
    assert_exact("one speed", &case);
}

#[test]
fn an_anechoic_scene_has_no_march_pass() {
    let (parts, tissues) = one_speed();
    let still = tissues.map(|(name, t)| (name, Tissue { scatterer_density: 0.0, ..t }));
    let mut case = Case::of(parts, &still, "a");
    case.settings.image.gain_db = 40.0;
    assert_eq!(case.on(), ["interface_echoes", "aperture", "maps"]);
    let (planned, whole) = case.planned_and_whole();
    let off = difference(&planned, &whole);
    assert!(off.mean > 2.0 && off.most <= 1, "{off:?}");
    // Whole passes are missing, not only their work.
    let names = |frame: &insonify::render::Frame| frame.times.passes.iter().map(|p| p.name).collect::<Vec<_>>();
    if !planned.times.passes.is_empty() {
        assert!(!names(&planned).contains(&"march") && names(&whole).contains(&"march"));
    }
}

#[test]
fn a_plan_follows_changed_settings() {
    use insonify::render::{EffectChoices, RenderSettings};
    let case = Case::station("speckle").asking(4, 1);
    let all = RenderSettings { effects: EffectChoices::ALL_ON, ..case.settings };
    let (planned, whole) = case.planned_and_whole();
    let mut renderer = case.renderer(&all);
    let mut frame = insonify::render::Frame::default();
    for (settings, expected) in [(&all, &whole), (&case.settings, &planned), (&all, &whole)] {
        renderer.reconfigure(&case.probe, settings).unwrap();
        renderer.render(&case.pose, &mut frame).unwrap();
        assert!(frame.bmode == expected.bmode);
    }
    // A forced effect acts: without scatterers the speckle block is black.
    let dark = RenderSettings { effects: case.settings.effects.with(Effect::Scatterers, Choice::Off), ..case.settings };
    renderer.reconfigure(&case.probe, &dark).unwrap();
    renderer.render(&case.pose, &mut frame).unwrap();
    assert!(frame.bmode.iter().all(|&level| level == 0));
}
