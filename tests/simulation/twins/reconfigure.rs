//! Comparison of a reconfigured renderer with one built with the same settings. Frames by the same pipelines are equal
//! bit for bit. Frames with and without maps are by different pipelines (`across.rs`).

use std::sync::LazyLock;

use insonify::render::{
    BackendError, Frame, FrameTimes, ImageSettings, Quality, RenderError, RenderSettings, Renderer, ShaderSet,
};
use insonify::settings::{Kind, Samples, Setting, SettingsGroup as _};
use insonify::transducer::{Probe, ProbeKind};

use crate::twins::across::assert_alike;
use crate::twins::scenes::{Case, cases, nested};

pub(crate) type Change = fn(&mut Probe, &mut RenderSettings);
type Expected = fn(&RenderError) -> bool;

/// Changes of a station's settings, one by one and together.
pub(crate) const CHANGES: [(&str, Change); 18] = [
    ("nothing", |_, _| ()),
    ("gain", |_, s| s.image.gain_db = 31.0),
    ("dynamic range", |_, s| s.image.dynamic_range_db = 45.0),
    ("TGC", |_, s| (s.image.tgc_db_per_cm, s.image.tgc_sliders_db[3]) = (5.0, -7.0)),
    ("seed", |_, s| s.quality.seed = 99),
    ("depth", |p, _| p.depth_mm *= 0.6),
    ("focus", |p, _| p.focus_mm *= 0.5),
    ("frequency", |p, _| p.frequency_mhz = 3.5),
    ("4 × 2", |_, s| (s.quality.rays, s.quality.layers) = (4, 2)),
    ("1 × 1", |_, s| (s.quality.rays, s.quality.layers) = (1, 1)),
    ("caps", |_, s| (s.reflections_max, s.beam_taps_max, s.pulse_taps_max) = (1, 5, 7)),
    ("image", |_, s| (s.image.width, s.image.height) = (97, 61)),
    ("lines", |_, s| s.lines = !s.lines),
    ("samples", |p, _| (p.samples, p.scanlines) = (333.into(), 17)),
    ("automatic samples", |p, _| p.samples = Samples::Auto),
    ("coarse samples", |p, s| (p.samples, s.coarse_samples) = (Samples::Auto, true)),
    ("linear", |p, _| p.kind = ProbeKind::Linear { width_mm: 60.0 }),
    ("all", |p, s| {
        p.kind = ProbeKind::Phased { fov_deg: 80.0 };
        p.depth_mm = 70.0;
        s.image = ImageSettings { width: 130, height: 90, gain_db: 12.0, ..s.image };
        s.quality = Quality { rays: 3, layers: 3, seed: 5 };
        s.lines = false;
    }),
];

fn render(renderer: &mut Renderer, case: &Case) -> Frame {
    let mut frame = Frame::default();
    renderer.render(&case.pose, &mut frame).unwrap();
    untimed(frame)
}

pub(crate) fn untimed(frame: Frame) -> Frame {
    Frame { times: FrameTimes::default(), ..frame }
}

/// The nested case with a change, and its frame by a newly built renderer.
fn built(change: Change) -> (Case, Frame) {
    let mut case = nested();
    change(&mut case.probe, &mut case.settings);
    let frame = render(&mut case.renderer(&ShaderSet::default()), &case);
    (case, frame)
}

/// For each change: the case, and its frame by a newly built renderer; rendered once for all tests.
static BUILT: LazyLock<Vec<(&str, Case, Frame)>> = LazyLock::new(|| {
    let frame = |(name, change)| {
        let (case, frame) = built(change);
        (name, case, frame)
    };
    CHANGES.into_iter().map(frame).collect()
});

#[test]
fn a_renderer_configured_anew_is_one_that_was_built_so() {
    let start = nested();
    let mut renderer = start.renderer(&ShaderSet::default());
    let begun = render(&mut renderer, &start);
    for (name, case, expected) in BUILT.iter() {
        assert!(expected.bmode.iter().any(|&grey| grey > 20), "{name}: a black image proves nothing");
        // From the start to the change, and from one change to the next.
        renderer.reconfigure(&case.probe, &case.settings).unwrap();
        assert!(render(&mut renderer, case) == *expected, "{name}");
        assert_eq!((renderer.probe(), renderer.settings()), (&case.probe, &case.settings));
        let sampled = case.probe.sampled(case.settings.coarse_samples);
        let samples = (sampled.scanlines * sampled.sample_count()) as usize;
        assert_eq!(expected.lines.len(), if case.settings.lines { samples } else { 0 }, "{name}");
        assert_eq!(*name == "nothing", *expected == begun, "{name}");
    }
    renderer.reconfigure(&start.probe, &start.settings).unwrap();
    assert!(render(&mut renderer, &start) == begun, "back at the start");
    for (name, case, _) in BUILT.iter() {
        renderer.reconfigure(&case.probe, &case.settings).unwrap();
        renderer.reconfigure(&start.probe, &start.settings).unwrap();
        assert!(render(&mut renderer, &start) == begun, "there and back without a frame: {name}");
    }
}

/// The nested case with another value of a setting: a number times 0.8 (5 instead of 0), a count plus or minus 2.
pub(crate) fn changed(setting: &Setting) -> Case {
    let mut case = nested();
    let stored = match setting.table {
        "probe" => case.probe.stored_mut(setting.key),
        _ => case.settings.stored_mut(setting.key),
    };
    let stored = stored.unwrap();
    let last = setting.count() - 1;
    let value = stored.get(last);
    let other = match setting.kind {
        // A limit shows only where it cuts.
        Kind::Whole if setting.key.ends_with("_max") => setting.min,
        Kind::Whole | Kind::WholeOrAuto if value + 2.0 <= setting.max => value + 2.0,
        Kind::Whole | Kind::WholeOrAuto => value - 2.0,
        Kind::Word(_) => setting.min,
        Kind::Switch => 1.0 - value,
        _ if value == 0.0 => 5.0,
        _ => 0.8 * value,
    };
    setting.check(other).unwrap();
    stored.set(last, other);
    case
}

#[test]
fn a_change_of_any_setting_makes_what_it_needs() {
    let start = nested();
    let mut renderer = start.renderer(&ShaderSet::default());
    let begun = render(&mut renderer, &start);
    let groups = [Probe::settings(), ImageSettings::settings(), Quality::settings(), RenderSettings::settings()];
    for setting in groups.into_iter().flatten() {
        let case = changed(setting);
        let needed = start.probe.change_to(&case.probe).max(start.settings.change_to(&case.settings));
        assert_eq!(needed, setting.change, "{}", setting.path);
        let built = render(&mut case.renderer(&ShaderSet::default()), &case);
        renderer.reconfigure(&case.probe, &case.settings).unwrap();
        assert!(render(&mut renderer, &case) == built, "{}", setting.path);
        // All of a few paths follow reflections, whatever the share. A number of samples is never coarse.
        let unread = ["reflecting_share", "coarse_samples"].contains(&setting.key);
        assert_eq!(built != begun, !unread, "{}: no pass reads it", setting.path);
        renderer.reconfigure(&start.probe, &start.settings).unwrap();
    }
}

#[test]
fn frames_in_flight_stay_as_they_were_submitted() {
    let start = nested();
    let mut renderer = start.renderer(&ShaderSet::default());
    let begun = render(&mut renderer, &start);
    let mut frame = Frame::default();
    for (name, case, expected) in BUILT.iter() {
        // One frame in flight, then two.
        renderer.submit(&start.pose).unwrap();
        renderer.reconfigure(&case.probe, &case.settings).unwrap();
        renderer.submit(&case.pose).unwrap();
        assert_eq!(renderer.frames_in_flight(), 2);
        renderer.reconfigure(&start.probe, &start.settings).unwrap();
        for expected in [&begun, expected] {
            renderer.receive(&mut frame).unwrap();
            assert!(untimed(frame.clone()) == *expected, "{name}");
        }
        assert!(render(&mut renderer, &start) == begun, "{name}: after it");
    }
}

#[test]
fn a_refused_change_leaves_the_renderer_as_it_was() {
    let start = nested();
    let mut renderer = start.renderer(&ShaderSet::default());
    let begun = render(&mut renderer, &start);
    let refused: [(Change, Expected); 4] = [
        (|_, s| s.image.gain_db = f64::NAN, |e| matches!(e, RenderError::Settings(_))),
        (|_, s| s.quality.rays = 0, |e| matches!(e, RenderError::Settings(_))),
        (|p, _| p.depth_mm = 0.0, |e| matches!(e, RenderError::Settings(_))),
        // Each in range, but more than any device binds at once; detected only after the paths' buffers are made.
        (
            |p, s| {
                (p.scanlines, p.kind) = (1024, ProbeKind::Linear { width_mm: 40.0 });
                (s.quality.rays, s.quality.layers) = (256, 33);
            },
            |e| matches!(e, RenderError::Backend(BackendError::Limit { .. } | BackendError::Memory { .. })),
        ),
    ];
    for (i, (change, expected)) in refused.into_iter().enumerate() {
        let mut case = nested();
        change(&mut case.probe, &mut case.settings);
        renderer.submit(&start.pose).unwrap();
        match renderer.reconfigure(&case.probe, &case.settings) {
            Err(error) => assert!(expected(&error), "{i}: {error}"),
            // A device with enough memory.
            Ok(()) if i == 3 => renderer.reconfigure(&start.probe, &start.settings).unwrap(),
            Ok(()) => panic!("{i} was taken"),
        }
        let mut frame = Frame::default();
        renderer.receive(&mut frame).unwrap();
        assert!(untimed(frame) == begun, "{i}: in flight");
        assert!(render(&mut renderer, &start) == begun, "{i}");
        assert_eq!((renderer.probe(), renderer.settings()), (&start.probe, &start.settings));
    }
}

#[test]
fn an_image_without_maps_is_the_image_with_them() {
    for case in cases() {
        let mut renderer = case.renderer(&ShaderSet::default());
        let with = render(&mut renderer, &case);
        renderer.set_maps(false);
        let mut frame = with.clone();
        renderer.submit(&case.pose).unwrap();
        // Each frame in flight keeps its own choice.
        renderer.set_maps(true);
        renderer.submit(&case.pose).unwrap();
        renderer.receive(&mut frame).unwrap();
        assert!(frame.segmentation.is_empty() && frame.attenuation.is_empty(), "{}", case.name);
        assert_eq!(frame.attenuation_p98, 0.0);
        assert!(frame.times.passes.iter().all(|pass| !["section", "percentile"].contains(&pass.name)));
        assert_eq!((frame.width, frame.height, &frame.mask), (with.width, with.height, &with.mask));
        // `scan_convert` without maps is another pipeline.
        assert_alike(&frame, &with, case.name);
        assert!(frame.lines == with.lines, "{}", case.name);
        renderer.receive(&mut frame).unwrap();
        assert!(untimed(frame) == with, "{}", case.name);

        let settings = RenderSettings { maps: false, ..case.settings };
        let case = Case { settings, ..case };
        let frame = render(&mut case.renderer(&ShaderSet::default()), &case);
        assert!(frame.segmentation.is_empty(), "{}", case.name);
        assert_alike(&frame, &with, case.name);
    }
}

#[test]
fn maps_without_the_image_are_those_with_it() {
    for case in cases() {
        let case = Case { settings: RenderSettings { lines: false, maps: true, ..case.settings }, ..case };
        let mut renderer = case.renderer(&ShaderSet::default());
        let with = render(&mut renderer, &case);
        renderer.set_image(false);
        let mut frame = with.clone();
        renderer.submit(&case.pose).unwrap();
        // Each frame in flight keeps its own choice; the one without maps has its image.
        renderer.set_maps(false);
        renderer.submit(&case.pose).unwrap();
        renderer.receive(&mut frame).unwrap();
        assert!(frame.bmode.is_empty() && frame.mask == with.mask, "{}", case.name);
        assert!(frame.segmentation == with.segmentation && frame.attenuation == with.attenuation, "{}", case.name);
        assert_eq!(frame.attenuation_p98, with.attenuation_p98);
        assert!(frame.times.passes.iter().all(|pass| ["section", "percentile", "scan_convert"].contains(&pass.name)));
        renderer.receive(&mut frame).unwrap();
        assert!(frame.segmentation.is_empty(), "{}", case.name);
        assert_alike(&frame, &with, case.name);
        renderer.set_maps(true);
        renderer.set_image(true);
        assert!(render(&mut renderer, &case) == with, "{}", case.name);
    }
}
