//! Tests of contact with the skin: coupling by gel, air, and partial contact.

use glam::{DVec3, Vec3};
use insonify::anatomy::analytic::{self, Part, cuboid};
use insonify::anatomy::{Scene, TissueTable};
use insonify::pose::Pose;
use insonify::render::{Choice, Effect, Frame, RenderSettings};
use insonify::settings::{ContactSettings, LookSettings};
use insonify::transducer::Probe;

use super::bench::Rig;

/// A flat body below z = 0, whose skin is its upper 2 mm.
fn body() -> Scene {
    let part = |name, tissue, priority, top: f32| {
        let mesh = cuboid(Vec3::new(-120.0, -60.0, top), Vec3::new(120.0, 60.0, 160.0));
        Part { name, tissue, priority, mesh }
    };
    let parts = vec![part("skin", "skin", 1, 0.0), part("inside", "liver", 2, 2.0)];
    analytic::scene(parts, &TissueTable::builtin().unwrap(), "gel").unwrap()
}

fn settings() -> RenderSettings {
    let mut settings = RenderSettings::default();
    (settings.image.width, settings.image.height) = (346, 250);
    (settings.image.gain_db, settings.image.tgc_db_per_cm) = (25.0, 7.0);
    // What the body returns, without the noise that a probe in air shows, too.
    settings.effects = settings.effects.with(Effect::Noise, Choice::Off);
    settings
}

/// Pose of a probe above the skin that looks down, tilted towards +x.
fn above(height_mm: f64, tilt_deg: f64) -> Pose {
    let tilt = tilt_deg.to_radians();
    let down = DVec3::new(tilt.sin(), 0.0, tilt.cos());
    Pose::looking(DVec3::new(0.0, 0.0, -height_mm), down, DVec3::new(tilt.cos(), 0.0, -tilt.sin()))
}

/// Mean grey level between two depths, given as fractions of the image's height, in the columns of one half or both.
fn mean(frame: &Frame, [top, bottom]: [f64; 2], columns: [f64; 2]) -> f64 {
    let (w, h) = (frame.width as usize, frame.height as usize);
    let of = |part: f64, whole: usize| (part * whole as f64) as usize;
    let (mut sum, mut count) = (0.0, 0.0);
    for y in of(top, h)..of(bottom, h) {
        for x in of(columns[0], w)..of(columns[1], w) {
            if frame.mask[y * w + x] == 255 {
                sum += f64::from(frame.bmode[y * w + x]);
                count += 1.0;
            }
        }
    }
    sum / count
}

/// Depth range beyond the probe's reverberation, as fractions of the image's height.
const DEEP: [f64; 2] = [0.35, 0.95];
const ALL: [f64; 2] = [0.0, 1.0];

#[test]
fn a_lifted_probe_loses_the_body() {
    let scene = body();
    let mut rig = Rig::new(&scene, &Probe::default(), &settings());
    let coupled = mean(&rig.frame(&above(0.0, 0.0)), DEEP, ALL);
    assert!(coupled > 80.0, "{coupled}");
    let bath = RenderSettings { effects: settings().effects.with(Effect::Contact, Choice::Off), ..settings() };
    let mut in_bath = Rig::new(&scene, &Probe::default(), &bath);
    let lifted = |rig: &mut Rig, height_mm: f64| {
        let frame = rig.frame(&above(height_mm, 0.0));
        (mean(&frame, DEEP, ALL), mean(&frame, [0.05, 0.12], ALL), frame.contact.unwrap())
    };
    let (body, _, contact) = lifted(&mut rig, 2.0);
    let through_gel = mean(&in_bath.frame(&above(2.0, 0.0)), DEEP, ALL);
    assert!((body - through_gel).abs() < 0.5 && contact.part > 0.99, "2 mm: {body}, {through_gel}, {contact:?}");
    for height_mm in [5.0, 40.0] {
        let (body, near, contact) = lifted(&mut rig, height_mm);
        assert!(body < 1.0 && contact.part < 0.02, "{height_mm} mm: {body}, {contact:?}");
        assert!(near > 90.0, "the probe's own reverberation: {near}");
    }
    let frame = rig.frame(&above(40.0, 0.0));
    let air = insonify::anatomy::TissueTable::builtin().unwrap().index_of("air").unwrap() as u8 + 1;
    assert!(frame.segmentation.iter().all(|&tissue| tissue == 0 || tissue == air), "the maps show nothing of the body");
}

#[test]
fn a_tilted_probe_is_dark_on_one_side() {
    let scene = body();
    let mut rig = Rig::new(&scene, &Probe::default(), &settings());
    let whole = rig.frame(&above(0.0, 0.0));
    let frame = rig.frame(&above(1.0, 16.0));
    // Beyond 0.6, beams of the coupled part fade.
    let sides = [[0.05, 0.35], [0.7, 0.95]];
    let [left, right] = sides.map(|columns| mean(&frame, [0.4, 0.75], columns));
    let [left_whole, right_whole] = sides.map(|columns| mean(&whole, [0.4, 0.75], columns));
    let part = frame.contact.unwrap().part;
    println!("left {left:.0} of {left_whole:.0}, right {right:.0} of {right_whole:.0}; {part:.2} of the face");
    // Tilted towards +x, its right end rises.
    assert!(right < 0.25 * left && left > 0.8 * left_whole, "{right} {left} of {left_whole}");
    assert!((0.4..0.95).contains(&part), "{part}");
}

#[test]
fn lifting_and_landing_have_no_flash_and_no_jump() {
    let scene = body();
    // As live: one angle a frame.
    let look = LookSettings { angles: 3, span_deg: 20.0, ..LookSettings::default() };
    let mut rig = Rig::new(&scene, &Probe::default(), &RenderSettings { look, ..settings() });
    let steps = 120;
    let heights_mm = (0..=2 * steps).map(|i: i32| -1.0 + 0.1 * f64::from(steps - (steps - i).abs()));
    let levels: Vec<f64> =
        heights_mm.map(|height_mm| mean(&rig.rolling(&above(height_mm, 0.0), 1), DEEP, ALL)).collect();
    // The film lets the probe stand off by 3 mm.
    let whole = levels[8..40].iter().fold(0.0, |most: f64, level| most.max(*level));
    for (i, pair) in levels.windows(2).enumerate().skip(8) {
        let change = (pair[1] - pair[0]) / whole;
        let (lifts, change_max) = (i < steps as usize, 0.25);
        assert!(if lifts { change < 0.04 } else { change > -0.04 }, "a flash after step {i}: {pair:?}");
        assert!(change.abs() < change_max && pair[1] < 1.02 * whole, "a jump after step {i}: {pair:?}");
    }
    assert!(levels[steps as usize] < 1.0);
    assert!((levels[2 * steps as usize] - levels[8]).abs() < 0.04 * whole, "landed");
}

#[test]
fn a_tolerance_keeps_a_hovering_probe_on_the_skin() {
    let scene = body();
    let tolerant =
        RenderSettings { contact: ContactSettings { tolerance_mm: 5.0, ..ContactSettings::default() }, ..settings() };
    let mut rig = Rig::new(&scene, &Probe::default(), &tolerant);
    let touching = rig.frame(&above(0.0, 0.0));
    for height_mm in [-4.0, 4.0] {
        let frame = rig.frame(&above(height_mm, 0.0));
        let contact = frame.contact.unwrap();
        assert!((contact.shift_mm - height_mm).abs() < 0.05, "{contact:?}");
        assert!((mean(&frame, DEEP, ALL) - mean(&touching, DEEP, ALL)).abs() < 2.0, "{height_mm}");
    }
    let far = rig.frame(&above(12.0, 0.0)).contact.unwrap();
    assert!((far.shift_mm - 5.0).abs() < 0.05 && far.part < 0.01, "{far:?}");
}

#[test]
fn a_bath_conducts_everywhere() {
    let scene = body();
    let bath = RenderSettings { effects: settings().effects.with(Effect::Contact, Choice::Off), ..settings() };
    let mut rig = Rig::new(&scene, &Probe::default(), &bath);
    let frame = rig.frame(&above(40.0, 0.0));
    assert!(frame.contact.is_none() && mean(&frame, DEEP, ALL) > 50.0);
    // A specimen without skin is in a bath unless the station says otherwise.
    let mut scene = body();
    let liver = scene.tissues.index_of("liver").unwrap();
    scene.surfaces.iter_mut().for_each(|surface| surface.tissue = liver);
    let mut rig = Rig::new(&scene, &Probe::default(), &settings());
    assert!(rig.frame(&above(40.0, 0.0)).contact.is_none());
    let air = RenderSettings { effects: settings().effects.with(Effect::Contact, Choice::On), ..settings() };
    let mut rig = Rig::new(&scene, &Probe::default(), &air);
    let frame = rig.frame(&above(40.0, 0.0));
    assert!(frame.contact.unwrap().part == 0.0 && mean(&frame, DEEP, ALL) < 1.0);
}
