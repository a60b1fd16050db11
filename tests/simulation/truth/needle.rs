//! Frames of a needle against the exact echo of a cylinder in the slice of the default lens.
//!
//! The reference is the series solution of a rigid cylinder of 22 gauge at 8 MHz, in the field of the default lens,
//! relative to the echo of a plate at the same depth: levels, tilts and shadows of `needle.md`.

use glam::{DQuat, DVec2, DVec3, Vec3};
use insonify::anatomy::analytic::{self, Part, cuboid};
use insonify::anatomy::{Bvh, TissueTable};
use insonify::needle::Needle;
use insonify::pose::Pose;
use insonify::render::{
    Backend, BackendChoice, Choice, Effect, Frame, ImageConstants, Quality, RenderSettings, Renderer, TestHooks,
};
use insonify::settings::{NeedleKind, NeedleSettings};
use insonify::transducer::{Probe, ProbeKind};

/// Level of the reflection of steel in soft tissue, which the reference of a rigid cylinder lacks, dB.
const STEEL_DB: f64 = -0.6;

fn probe() -> Probe {
    let kind = ProbeKind::Linear { width_mm: 40.0 };
    Probe { kind, frequency_mhz: 8.0, depth_mm: 110.0, scanlines: 128, ..Probe::default() }
}

/// A renderer of a block of soft tissue, without attenuation. `speckle` adds scatterers.
fn renderer(speckle: bool, quality: Quality, kind: NeedleKind, hooks: &TestHooks) -> Renderer {
    let block = cuboid(Vec3::new(-90.0, -60.0, -20.0), Vec3::new(90.0, 60.0, 180.0));
    let parts = vec![Part { name: "block", tissue: "soft_tissue", priority: 1, mesh: block }];
    let scene = analytic::scene(parts, &TissueTable::builtin().unwrap(), "gel").unwrap();
    let mut settings = RenderSettings { lines: true, maps: true, quality, ..RenderSettings::default() };
    settings.needle = Some(NeedleSettings { kind, ..NeedleSettings::default() });
    (settings.image.width, settings.image.height) = (320, 440);
    let scatterers = if speckle { Choice::On } else { Choice::Off };
    for (effect, choice) in [
        (Effect::Scatterers, scatterers),
        (Effect::InterfaceEchoes, Choice::Off),
        (Effect::Attenuation, Choice::Off),
        (Effect::SpeedDisplacement, Choice::Off),
        (Effect::Aperture, Choice::On),
    ] {
        settings.effects = settings.effects.with(effect, choice);
    }
    let bvh = Bvh::build(&scene).unwrap();
    Renderer::with_hooks(&Backend::open(BackendChoice::Host).unwrap(), &scene, bvh, &probe(), &settings, hooks).unwrap()
}

/// A needle through a point of the image, tilted in the image plane by `tilt_deg`, its tip `beyond_mm` past that point.
fn needle(at_mm: DVec3, tilt_deg: f64, beyond_mm: f64) -> Needle {
    let (sin, cos) = tilt_deg.to_radians().sin_cos();
    let direction = DVec3::new(cos, 0.0, sin);
    let orientation = DQuat::from_rotation_arc(DVec3::Z, direction);
    let pose = Pose { position_mm: at_mm + beyond_mm * direction, orientation };
    Needle { scene_from_needle: pose, bevel_known: false }
}

fn rendered(renderer: &mut Renderer, needle: Option<Needle>) -> Frame {
    let mut frame = Frame::default();
    renderer.set_needle(needle);
    renderer.render(&Pose::IDENTITY, &mut frame).unwrap();
    frame
}

/// Magnitude of a scanline's samples around a depth.
fn around(frame: &Frame, line: usize, depth_mm: f64, half_mm: f64) -> Vec<(f64, f64)> {
    let samples = frame.lines.len() / probe().scanlines as usize;
    let spacing_mm = probe().depth_mm / samples as f64;
    let row = &frame.lines[line * samples..][..samples];
    let range_mm = |i: usize| (i as f64 + 0.5) * spacing_mm;
    let magnitude = |&[re, im]: &[f32; 2]| DVec2::new(re.into(), im.into()).length();
    let all = row.iter().enumerate().map(|(i, value)| (range_mm(i), magnitude(value)));
    all.filter(|(range, _)| (range - depth_mm).abs() < half_mm).collect()
}

/// Mean level of the shaft over the middle scanlines, dB over a plate of steel.
fn shaft_db(frame: &Frame, depth_of: impl Fn(f64) -> f64) -> f64 {
    let lines = 32..96;
    let width_mm = 40.0 / 128.0;
    let power = |line: usize| {
        let x_mm = (line as f64 + 0.5 - 64.0) * width_mm;
        let peak = around(frame, line, depth_of(x_mm), 0.3).into_iter().map(|(_, level)| level).fold(0.0, f64::max);
        peak * peak
    };
    10.0 * (lines.clone().map(power).sum::<f64>() / lines.len() as f64).log10() - STEEL_DB
}

/// Compares a level with the reference.
fn check(what: &str, got_db: f64, want_db: f64, within_db: f64) -> Result<(), String> {
    if (got_db - want_db).abs() <= within_db {
        return Ok(());
    }
    Err(format!("{what}: {got_db:.2} dB, not {want_db} within {within_db}"))
}

/// Levels of a shaft that faces the probe, in the image plane and aside of it.
fn levels(quality: Quality, hooks: &TestHooks) -> Result<Vec<f64>, String> {
    let mut renderer = renderer(false, quality, NeedleKind::Plain, hooks);
    let cases = [(20.0, 0.0, -21.0), (70.0, 0.0, -16.5), (70.0, 0.5, -20.5), (70.0, 1.0, -34.6), (20.0, 3.0, -31.9)];
    let mut got = Vec::new();
    for (depth_mm, aside_mm, want_db) in cases {
        let frame = rendered(&mut renderer, Some(needle(DVec3::new(0.0, aside_mm, depth_mm), 0.0, 45.0)));
        let level = shaft_db(&frame, |_| depth_mm - 0.36);
        check(&format!("{depth_mm} mm deep, {aside_mm} mm aside"), level, want_db, 0.5)?;
        got.push(level);
    }
    Ok(got)
}

#[test]
fn a_needle_beside_the_image_plane_is_fainter_as_the_lens_has_it() {
    let low = levels(Quality::LQ, &TestHooks::default()).unwrap();
    let high = levels(Quality::HQ, &TestHooks::default()).unwrap();
    for (low, high) in low.iter().zip(&high) {
        assert!((low - high).abs() <= 0.5, "{low} at 1 × 1, {high} at 32 × 3");
    }
}

#[test]
fn a_needle_that_is_too_bright_is_noticed() {
    let image = ImageConstants { needle_amplitude: 1.1, ..ImageConstants::default() };
    assert!(levels(Quality::LQ, &TestHooks { image, ..TestHooks::default() }).is_err());
}

#[test]
fn a_tilted_needle_is_fainter_as_the_aperture_has_it() {
    let mut renderer = renderer(false, Quality::LQ, NeedleKind::Plain, &TestHooks::default());
    let mut level = |tilt_deg: f64| {
        let frame = rendered(&mut renderer, Some(needle(DVec3::new(0.0, 0.0, 40.0), tilt_deg, 45.0)));
        let slope = tilt_deg.to_radians().tan();
        shaft_db(&frame, |x_mm| 40.0 - 0.36 / tilt_deg.to_radians().cos() + slope * x_mm)
    };
    let facing = level(0.0);
    for (tilt_deg, want_db) in [(4.0, -2.5), (6.0, -5.7)] {
        check(&format!("{tilt_deg} degrees"), level(tilt_deg) - facing, want_db, 1.0).unwrap();
    }
    // The floor of a plain shaft, which scatters to all sides.
    check("30 degrees", level(30.0) - facing, -25.0, 2.5).unwrap();
    check("-30 degrees", level(-30.0) - facing, -25.0, 2.5).unwrap();
}

#[test]
fn a_needle_casts_the_shadow_of_its_part_of_the_slice() {
    let run = |hooks: &TestHooks| -> Result<(), String> {
        let mut renderer = renderer(true, Quality::LQ, NeedleKind::Plain, hooks);
        let clear = rendered(&mut renderer, None);
        // Mean power of the speckle of the middle scanlines between two depths.
        let power = |frame: &Frame, from: f64, to: f64| {
            let of = |line: usize| {
                let all = around(frame, line, 0.5 * (from + to), 0.5 * (to - from));
                all.into_iter().map(|(_, level)| level * level).sum::<f64>()
            };
            (24..104).map(of).sum::<f64>()
        };
        for (depth_mm, least_db, most_db) in [(20.0, -2.3, -0.8), (40.0, -3.9, -1.9), (70.0, -8.4, -6.9)] {
            let frame = rendered(&mut renderer, Some(needle(DVec3::new(0.0, 0.0, depth_mm), 0.0, 45.0)));
            // Beyond the comet tail, and where the shadow has grown to the full.
            let (from, to) = (depth_mm + 8.0, (depth_mm + 38.0_f64).min(108.0));
            let shadow_db = 10.0 * (power(&frame, from, to) / power(&clear, from, to)).log10();
            let want_db = shadow_db.clamp(least_db, most_db);
            check(&format!("behind {depth_mm} mm"), shadow_db, want_db, 2.5)?;
            if shadow_db > 0.5 * most_db {
                return Err(format!("behind {depth_mm} mm: {shadow_db:.2} dB are hardly a shadow"));
            }
        }
        Ok(())
    };
    run(&TestHooks::default()).unwrap();
    let image = ImageConstants { needle_transmission: 0.7, ..ImageConstants::default() };
    assert!(run(&TestHooks { image, ..TestHooks::default() }).is_err());
}

#[test]
fn the_picture_shows_the_tip_where_it_is() {
    let mut renderer = renderer(false, Quality::LQ, NeedleKind::Plain, &TestHooks::default());
    let width_mm = 40.0 / 128.0;
    for i in 0..20 {
        let at_mm = DVec3::new(-6.0 + 0.613 * f64::from(i), 0.0, 30.0 + 2.07 * f64::from(i));
        let tilt_deg = -3.0 + 0.31 * f64::from(i);
        let frame = rendered(&mut renderer, Some(needle(at_mm, tilt_deg, 0.0)));
        // The surface that faces the probe lies a radius before the axis.
        let (sin, cos) = tilt_deg.to_radians().sin_cos();
        let tip_mm = at_mm + 0.36 * DVec3::new(sin, 0.0, -cos);
        let peak = |line: usize| {
            let depth_mm = tip_mm.z + ((line as f64 + 0.5 - 64.0) * width_mm - tip_mm.x) * sin / cos;
            let near = around(&frame, line, depth_mm, 0.4);
            near.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap()
        };
        let inside = ((tip_mm.x - 8.0) / width_mm + 64.0) as usize..((tip_mm.x - 3.0) / width_mm + 64.0) as usize;
        let whole = inside.clone().map(|line| peak(line).1).sum::<f64>() / inside.len() as f64;
        // The beam spreads the end of a line, whose level falls to a half at the end.
        let last = (inside.end..120).take_while(|&line| peak(line).1 > 0.5 * whole).last().unwrap();
        let [above, below] = [last, last + 1].map(|line| peak(line).1);
        let part = (above - 0.5 * whole) / (above - below);
        let x_mm = (last as f64 + part + 0.5 - 64.0) * width_mm;
        assert!((x_mm - tip_mm.x).abs() < 0.1, "pose {i}: tip at {x_mm}, not {}", tip_mm.x);
        // Depth of the shaft shortly before the tip.
        let line = last - 2;
        let along_mm = (line as f64 + 0.5 - 64.0) * width_mm - tip_mm.x;
        let want_mm = tip_mm.z + along_mm * sin / cos;
        let (got_mm, _) = peak(line);
        assert!((got_mm - want_mm).abs() < 0.1, "pose {i}: depth {got_mm}, not {want_mm}");
    }
}

#[test]
fn the_segmentation_shows_the_cross_section_in_the_image_plane() {
    let mut renderer = renderer(false, Quality::LQ, NeedleKind::Plain, &TestHooks::default());
    let number = TissueTable::builtin().unwrap().index_of("needle").unwrap() as u8 + 1;
    let mut area_mm2 = |needle: Needle| {
        let frame = rendered(&mut renderer, Some(needle));
        let pixels = frame.segmentation.iter().filter(|&&tissue| tissue == number).count() as f64;
        pixels * renderer.sector().pixel_mm.powi(2)
    };
    // A shaft of 0.72 mm, a little oblique to the pixels, across the whole face of 40 mm, then one that ends in the middle, then one aside.
    let whole = area_mm2(needle(DVec3::new(0.0, 0.0, 50.0), 3.0, 45.0));
    assert!((whole / (0.72 * 40.0) - 1.0).abs() < 0.12, "{whole} mm²");
    let half = area_mm2(needle(DVec3::new(0.0, 0.0, 50.0), 3.0, 0.0));
    assert!((half / whole - 0.5).abs() < 0.02, "{half} of {whole} mm²");
    assert_eq!(area_mm2(needle(DVec3::new(0.0, 0.4, 50.0), 0.0, 45.0)), 0.0);
}

#[test]
fn a_pointer_and_a_lost_needle_leave_the_frame_as_it_is() {
    let quality = Quality::LQ;
    let at = Some(needle(DVec3::new(0.0, 0.0, 50.0), 10.0, 5.0));
    let mut pointer = renderer(true, quality, NeedleKind::Pointer, &TestHooks::default());
    let mut plain = renderer(true, quality, NeedleKind::Plain, &TestHooks::default());
    let [shown, lost] = [at, None].map(|needle| rendered(&mut plain, needle));
    let pointed = rendered(&mut pointer, at);
    assert_eq!((&pointed.bmode, &pointed.lines), (&lost.bmode, &lost.lines));
    assert_ne!(shown.bmode, lost.bmode);
}
