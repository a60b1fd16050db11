//! Rules of the effect plan: forced effects, attenuation, lines, and the influence of roughness on other effects.

use insonify::anatomy::Tissue;
use insonify::render::plan::Bound;
use insonify::render::{Choice, Decision, Effect};

use crate::plan::bench::{Case, part, silent, slab, speckled};

fn decision(case: &Case, effect: Effect) -> Decision {
    case.plan().decisions().iter().find(|d| d.effect == effect).unwrap().clone()
}

/// A slab of tissue `b` in tissue `a`.
fn two(a: Tissue, b: Tissue) -> Case {
    Case::of(vec![part("slab", "b", slab(10.04, 20.0))], &[("a", a), ("b", b)], "a")
}

fn lossy(attenuation_db_cm_mhz: f64) -> Tissue {
    Tissue { attenuation_db_cm_mhz, ..speckled(1540.0, 1.6, 0.01) }
}

#[test]
fn a_weak_attenuation_common_to_all_media_is_left_out() {
    assert!(!two(lossy(0.0004), lossy(0.0004)).plan().has(Effect::Attenuation));
    // With two attenuations, echoes that cancel in a null of the speckle cease to do so.
    let case = two(lossy(0.0), lossy(0.0004));
    let Bound::Level { db, .. } = decision(&case, Effect::Attenuation).bound else { panic!("{}", case.plan()) };
    assert!(db > 10.0 * 0.016 && case.plan().has(Effect::Attenuation), "{db}");
    assert!(!two(lossy(0.0), lossy(0.00001)).plan().has(Effect::Attenuation));
}

#[test]
fn the_attenuation_map_is_as_accurate_as_the_image() {
    // 0.08 dB two-way are a third of a level; 1 % of the map.
    let case = two(lossy(0.002), lossy(0.002));
    assert!(case.plan().has(Effect::Attenuation), "{}", case.plan());
    assert!(decision(&case, Effect::Attenuation).bound.to_string().contains("map"));
}

#[test]
fn kept_lines_hold_invisible_echoes() {
    let mut faint = two(speckled(1540.0, 1.6, 0.01), speckled(1540.0, 1.600_000_6, 0.01));
    faint.settings.image.gain_db = 0.0;
    let mut weak = two(lossy(0.0004), lossy(0.0004));
    for (case, effect) in [(&mut faint, Effect::InterfaceEchoes), (&mut weak, Effect::Attenuation)] {
        assert!(!case.plan().has(effect), "{}", case.plan());
        case.settings.lines = true;
        assert!(case.plan().has(effect), "{}", case.plan());
    }
    // Effects that change nothing at all are still left out.
    let mut none = two(lossy(0.0), lossy(0.0));
    none.settings.lines = true;
    assert_eq!(none.on(), ["aperture", "scatterers", "elevational_speckle", "maps"]);
}

#[test]
fn echo_bounds_follow_the_simulated_attenuation() {
    // 40 dB over the depth, compensated by TGC: without the attenuation the gain still applies.
    let of = |impedance| Tissue { attenuation_db_cm_mhz: 1.0, ..speckled(1540.0, impedance, 0.01) };
    let mut case = two(of(1.6), of(1.600_000_6));
    (case.settings.image.gain_db, case.settings.image.tgc_db_per_cm) = (0.0, 10.0);
    assert!(!case.plan().has(Effect::InterfaceEchoes), "{}", case.plan());
    let case = case.with(Effect::Attenuation, Choice::Off);
    assert!(case.plan().has(Effect::InterfaceEchoes), "{}", case.plan());
}

#[test]
fn smooth_faces_reflect_what_rough_ones_scatter() {
    // 7 % of the energy. A face of slope 0.5 returns at most half of it within the aperture: below the threshold for
    // reflections.
    let rough = |impedance| Tissue { roughness: 0.5, ..silent(1540.0, impedance) };
    let case = two(rough(1.6), rough(2.8));
    assert!(case.plan().has(Effect::Roughness) && !case.plan().has(Effect::Reflections), "{}", case.plan());
    let smooth = case.with(Effect::Roughness, Choice::Off);
    assert!(smooth.plan().has(Effect::Reflections), "{}", smooth.plan());
    // Without echoes, too, it is roughness that keeps them from being followed.
    let unechoed = two(rough(1.6), rough(2.8)).with(Effect::InterfaceEchoes, Choice::Off);
    assert!(unechoed.plan().has(Effect::Roughness), "{}", unechoed.plan());
    let neither = unechoed.with(Effect::Reflections, Choice::Off);
    assert!(!neither.plan().has(Effect::Roughness), "{}", neither.plan());
}

#[test]
fn fast_media_are_read_far_aside() {
    let fast = |speed| {
        let kind = insonify::transducer::ProbeKind::Convex { radius_mm: 20.0, fov_deg: 50.0 };
        let mut case = two(speckled(speed, 1.6, 0.01), speckled(speed, 1.6, 0.02)).asking(6, 1);
        case.probe.kind = kind;
        case
    };
    let aside = |speed| match decision(&fast(speed), Effect::Rays).bound {
        Bound::Aside { mm, allowed_mm } => (mm, allowed_mm),
        other => panic!("{other}"),
    };
    let share_mm = |speed: f64| 0.5 * 50f64.to_radians() / 64.0 * (20.0 + 40.0 * speed / 1540.0);
    for speed in [1560.0, 4000.0] {
        let (mm, allowed_mm) = aside(speed);
        println!("{speed} m/s: edges within {mm} mm, {allowed_mm} allowed");
        assert!((mm - share_mm(speed)).abs() < 1e-9, "{mm}");
        assert_eq!(fast(speed).plan().has(Effect::Rays), mm > allowed_mm);
    }
    assert!(fast(4000.0).plan().has(Effect::Rays), "{}", fast(4000.0).plan());
    // Scanlines an eighth as wide.
    let many = |speed| {
        let mut case = fast(speed);
        case.probe.scanlines *= 8;
        case
    };
    assert!(!many(1560.0).plan().has(Effect::Rays), "{}", many(1560.0).plan());
    // Without speed displacement, widths are nominal.
    let at_scale = fast(4000.0).with(Effect::SpeedDisplacement, Choice::Off);
    let Bound::Aside { mm, .. } = decision(&at_scale, Effect::Rays).bound else { panic!("{}", at_scale.plan()) };
    assert!((mm - share_mm(1540.0)).abs() < 1e-9, "{mm}");
}

#[test]
fn thick_faces_change_grain_with_several_paths() {
    let thick = |impedance| Tissue { thickness_mm: 0.4, ..speckled(1540.0, impedance, 0.01) };
    let bound = |rays| decision(&two(thick(1.6), thick(1.8)).asking(rays, 1), Effect::Thickness).bound;
    assert_eq!(bound(1), Bound::Displacement { mm: 0.2 });
    assert!(matches!(bound(4), Bound::None { .. }));
}

#[test]
fn reasons_are_true() {
    let mut case = two(silent(1500.0, 1.6), silent(1600.0, 1.8));
    case.settings.reflections_max = 2;
    assert!(decision(&case, Effect::Reflections).reason.contains("up to 2 a path"));
    let squared = |loss| Tissue { attenuation_exponent: 2.0, ..lossy(loss) };
    let mut case = two(squared(0.5), squared(0.5));
    case.probe.frequency_mhz = 1.0;
    assert_eq!(decision(&case, Effect::FrequencyExponent).reason, "every power of 1 MHz is 1");
    // Lossless water has no effect, whatever its exponent.
    let case = two(lossy(0.5), squared(0.0));
    assert!(decision(&case, Effect::FrequencyExponent).reason.contains("that attenuates"), "{}", case.plan());
}
