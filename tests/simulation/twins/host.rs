//! Tests of paths on the host. Changed ones are detected, those through moving scenes match their twin, and frames are
//! close to the device's.

use insonify::render::{Frame, Quality, RenderSettings, TestHooks, TraceConstants};
use insonify::transducer::ProbeKind;

use crate::twins::compare::compare;
use crate::twins::moving::{TIME_S, beating};
use crate::twins::reconfigure::untimed;
use crate::twins::scenes::{HOST, RENDERED, cases, nested};

#[test]
fn frames_in_flight_of_the_host_keep_their_time() {
    let case = beating();
    let mut renderer = case.host_renderer();
    let mut frames = [Frame::default(), Frame::default()];
    for (frame, time_s) in frames.iter_mut().zip([TIME_S, 0.05]) {
        renderer.set_time_s(time_s);
        renderer.render(&case.pose, frame).unwrap();
    }
    for time_s in [TIME_S, 0.05] {
        renderer.set_time_s(time_s);
        renderer.submit(&case.pose).unwrap();
    }
    let mut found = Frame::default();
    for expected in frames {
        renderer.receive(&mut found).unwrap();
        assert!(untimed(found.clone()) == untimed(expected));
    }
}

#[test]
fn wrong_paths_of_the_host_are_caught() {
    type Damage = fn(&mut TraceConstants);
    let damages: [(&str, &str, Damage); 4] = [
        ("nothing behind the face is looked for", "locate", |c| c.reach = 0.0),
        ("reflections are left to their weight", "trace", |c| c.reflection_followed = 2.0),
        ("echoes are offset by another cell", "trace", |c| c.off_the_grid_mm = 0.07),
        ("rough surfaces return twice as much", "trace", |c| c.diffuse *= 2.0),
    ];
    let case = nested();
    for (what, pass, damage) in damages {
        let mut hooks = TestHooks::default();
        damage(&mut hooks.trace);
        let snapshot = case.renderer_on(&HOST, &hooks).snapshot(&case.pose).unwrap();
        assert!(compare(pass, &snapshot).is_err(), "{pass}: {what}");
    }
}

#[test]
fn frames_of_the_host_and_of_the_device_hardly_differ() {
    for case in cases() {
        let mut host = Frame::default();
        case.host_renderer().render(&case.pose, &mut host).unwrap();
        let device = &RENDERED.iter().find(|r| r.name == case.name).unwrap().frame;
        let pixels = host.bmode.len();
        let grey = host.bmode.iter().zip(&device.bmode).filter(|(a, b)| a.abs_diff(**b) > 1).count();
        let tissue = host.segmentation.iter().zip(&device.segmentation).filter(|(a, b)| a != b).count();
        let level = host.attenuation.iter().zip(&device.attenuation).filter(|(a, b)| (*a - *b).abs() > 1e-3).count();
        println!("{}: {grey} grey, {tissue} tissues, {level} levels of {pixels} pixels differ", case.name);
        assert!(grey * 50 < pixels && tissue * 1000 < pixels && level * 1000 < pixels, "{}", case.name);
        // `trace` includes `locate`.
        assert_eq!(host.times.passes[0].name, "trace");
        assert!(host.times.passes[0].ms > 0.0 && host.times.passes.iter().all(|p| p.name != "locate"));
    }
}

#[test]
fn a_frame_of_several_batches_is_the_same_on_repeat_and_has_no_snapshot() {
    // More paths than a batch holds: 33 scanlines × 200 rays × 10 layers.
    let mut case = nested();
    case.probe.samples = 64.into();
    case.settings.quality = Quality { rays: 200, layers: 10, seed: 3 };
    let mut renderer = case.host_renderer();
    assert!(renderer.snapshot(&case.pose).is_err(), "the layers fit into one batch");
    let (mut frame, mut again) = (Frame::default(), Frame::default());
    renderer.render(&case.pose, &mut frame).unwrap();
    renderer.render(&case.pose, &mut again).unwrap();
    assert!(untimed(frame) == untimed(again));
}

#[test]
fn the_host_takes_more_than_every_device_binds() {
    // Segments of 254 MB, more than the 128 MiB that every device binds.
    let mut case = nested();
    case.probe.kind = ProbeKind::Linear { width_mm: 40.0 };
    (case.probe.scanlines, case.probe.samples) = (1024, 64.into());
    case.settings = RenderSettings { lines: false, maps: false, ..case.settings };
    case.settings.quality = Quality { rays: 128, layers: 1, seed: 3 };
    let mut frame = Frame::default();
    case.host_renderer().render(&case.pose, &mut frame).unwrap();
    assert!(frame.bmode.iter().any(|&grey| grey > 20));
}
