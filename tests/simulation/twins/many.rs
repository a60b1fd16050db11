//! Frames made several to a dispatch equal those made one by one.

use glam::DVec3;
use insonify::pose::Pose;
use insonify::render::{
    Backend, BackendChoice, Choice, Effect, Frame, Job, Quality, RenderError, RenderSettings, TestHooks, TraceBy,
};

use crate::twins::across::assert_alike;
use crate::twins::moving::beating;
use crate::twins::multiples::reflecting;
use crate::twins::reconfigure::untimed;
use crate::twins::scenes::{Case, cases, lifted, nested};

/// Jobs near the pose of a case. Three in succession have the same scene time.
fn jobs(case: &Case, count: u32) -> Vec<Job> {
    let job = |i: u32| Job {
        pose: Pose { position_mm: case.pose.position_mm + DVec3::X * 0.7 * f64::from(i), ..case.pose },
        time_s: 0.2 * f64::from(i / 3),
        seed: 40 + i / 2,
        needle: None,
    };
    (0..count).map(job).collect()
}

/// Frames of `jobs`, up to `at_once` of them per dispatch; with a GPU's variants of the passes if `as_gpu`.
fn rendered(case: &Case, at_once: u32, as_gpu: bool, jobs: &[Job]) -> Vec<Frame> {
    let mut backend = Backend::open(BackendChoice::Device).unwrap().with_frames_at_once(at_once);
    if as_gpu && backend.has_trace_by_lanes() {
        backend = backend.tracing_by(TraceBy::Lanes).unwrap();
    }
    let mut hooks = TestHooks::default();
    hooks.shaders.as_gpu = as_gpu;
    let mut renderer = case.renderer_on(&backend, &hooks);
    let mut frames = Vec::new();
    let mut is_timed = false;
    // Twice: what makes several frames is kept.
    for _ in 0..at_once.min(2) {
        frames.clear();
        let each = |number, frame: &mut Frame| {
            assert_eq!(number, frames.len());
            // The passes of a dispatch are timed with its first frame.
            let has_times = !frame.times.passes.is_empty();
            is_timed |= number == 0 && has_times;
            assert_eq!(has_times, is_timed && (at_once == 1 || number % 3 == 0), "{}: frame {number}", case.name);
            frames.push(untimed(frame.clone()));
            Ok::<_, RenderError>(())
        };
        renderer.render_many(jobs.iter().copied(), each).unwrap();
    }
    // One frame at a time is as before.
    let mut alone = Frame::default();
    renderer.set_time_s(jobs[0].time_s);
    let settings = RenderSettings { quality: Quality { seed: jobs[0].seed, ..case.settings.quality }, ..case.settings };
    renderer.reconfigure(&case.probe, &settings).unwrap();
    renderer.render(&jobs[0].pose, &mut alone).unwrap();
    assert_alike(&alone, &frames[0], case.name);
    frames
}

#[test]
fn frames_of_one_dispatch_are_those_made_alone() {
    let mut all: Vec<Case> = cases().into_iter().step_by(2).collect();
    all.push(beating());
    // Without scatterers nothing writes the whole baseband.
    let mut bare = nested();
    bare.settings.effects = bare.settings.effects.with(Effect::Scatterers, Choice::Off);
    all.push(bare);
    let mut without_maps = nested();
    (without_maps.settings.maps, without_maps.settings.lines) = (false, true);
    all.push(without_maps);
    all.push(reflecting(lifted()));
    for case in all {
        let jobs = jobs(&case, 8);
        let alone = rendered(&case, 1, false, &jobs);
        assert!(alone[0] != alone[1] && alone[2] != alone[3], "{}", case.name);
        let together = rendered(&case, 4, case.name == nested().name, &jobs);
        assert_eq!(together.len(), jobs.len());
        for (number, (together, alone)) in together.iter().zip(&alone).enumerate() {
            assert_alike(together, alone, &format!("{}, frame {number}", case.name));
            assert_eq!((together.scan, &together.mask, together.overflows), (alone.scan, &alone.mask, alone.overflows));
        }
    }
}

#[test]
fn after_an_error_no_frame_of_many_is_left() {
    let case = nested();
    let backend = Backend::open(BackendChoice::Device).unwrap().with_frames_at_once(4);
    let mut renderer = case.renderer_on(&backend, &TestHooks::default());
    let (mut before, mut after) = (Frame::default(), Frame::default());
    renderer.render(&case.pose, &mut before).unwrap();
    let stop = |number, _: &mut Frame| if number == 1 { Err(RenderError::RingEmpty) } else { Ok(()) };
    assert!(matches!(renderer.render_many(jobs(&case, 9), stop), Err(RenderError::RingEmpty)));
    assert_eq!((renderer.frames_in_flight(), renderer.settings().quality), (0, case.settings.quality));
    renderer.render(&case.pose, &mut after).unwrap();
    assert!(untimed(before) == untimed(after));
}
