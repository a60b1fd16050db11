//! A session with fakes for everything around it, on simulated time; and one on the real thing.

// Helpers are outside of tests for clippy; a failing one fails its test.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod frame_log;
mod spans;
mod stuck;

use std::alloc::{GlobalAlloc, Layout, System};
use std::collections::VecDeque;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicI64, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError, RwLock, mpsc};
use std::time::Duration;

use glam::{DQuat, DVec3};
use insonify::pipeline::{
    Clock, EnhanceError, Enhancer, FrameRenderer, ImageShape, Limits, NEVER, Observer, Part, Parts, Pipeline,
    PoseSource, QualityBudget, QualitySummary, Readiness, RenderFault, RendererFactory, SimulatedClock, Stop, Summary,
    SystemClock, Terminator,
};
use insonify::pose::{Estimate, Pose, TrackingState};
use insonify::render::{Frame, Quality, QualityPoint, RenderSettings, climb};
use insonify::settings::{Assignment, ChoiceSettings, Control, LiveSettings, PipelineSettings};
use insonify::sink::live::{FrameSource, LiveSink, MapsWanted, PresentedFrame};
use insonify::sink::{FrameLog, SinkError};
use insonify::transducer::Probe;
use serde_json::Value;

const MS: Duration = Duration::from_millis(1);
const SECOND: Duration = Duration::from_secs(1);
const SHAPE: ImageShape = ImageShape { width: 8, height: 4, pixel_mm: 0.5 };
const PIXELS: usize = 32;

/// Counts what the whole binary allocates.
struct Counting;

static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);
static LIVE_BYTES: AtomicI64 = AtomicI64::new(0);

// SAFETY: every call is the system allocator's, with the caller's arguments; counting allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        LIVE_BYTES.fetch_add(layout.size() as i64, Ordering::Relaxed);
        // SAFETY: as the caller promised.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        LIVE_BYTES.fetch_sub(layout.size() as i64, Ordering::Relaxed);
        // SAFETY: as the caller promised.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Tests that count allocations run alone.
static ALONE: RwLock<()> = RwLock::new(());

fn beside_others() -> impl Drop {
    ALONE.read().unwrap_or_else(PoisonError::into_inner)
}

fn alone() -> impl Drop {
    ALONE.write().unwrap_or_else(PoisonError::into_inner)
}

fn clock() -> Arc<dyn Clock> {
    Arc::new(SimulatedClock::new())
}

fn pose(x: f64) -> Pose {
    Pose { position_mm: DVec3::X * x, orientation: DQuat::IDENTITY }
}

type Extra = dyn Fn(Duration, QualityPoint) -> Duration + Send + Sync;

/// What frames and generated pictures are made on where there is no other device.
#[derive(Default)]
struct Processors {
    at_work: AtomicU64,
    /// Times that both were at work at once.
    shared: AtomicU64,
}

impl Processors {
    fn work(&self, clock: &Arc<dyn Clock>, time: Duration) {
        let others = self.at_work.fetch_add(1, Ordering::Relaxed);
        self.shared.fetch_add(others, Ordering::Relaxed);
        clock.sleep_until(clock.now() + time);
        self.at_work.fetch_sub(1, Ordering::Relaxed);
    }
}

/// A device that takes `service` for a frame, one after another, and fails where `faults` says so.
struct Device {
    clock: Arc<dyn Clock>,
    service: Duration,
    /// What a frame of this quality takes beyond `service` now.
    extra: Arc<Extra>,
    quality: Quality,
    /// When each is done, its pose, whether it has maps, and the scene's time.
    in_flight: VecDeque<(Duration, Pose, bool, f64)>,
    time_s: f64,
    maps: bool,
    free: Duration,
    received: Arc<AtomicU64>,
    faults: Arc<dyn Fn(u64) -> bool + Send + Sync>,
    gain_db: f64,
    /// Where the processors make its frames, in `submit`.
    processors: Option<Arc<Processors>>,
}

impl FrameRenderer for Device {
    fn shape(&self) -> ImageShape {
        SHAPE
    }

    fn on_processors(&self) -> bool {
        self.processors.is_some()
    }

    fn submit(&mut self, pose: &Pose) -> Result<(), RenderFault> {
        assert!(self.in_flight.len() < 2, "two in flight at most");
        let extra = (self.extra)(self.clock.now(), self.quality.into());
        self.free = self.free.max(self.clock.now()) + self.service + extra;
        if let Some(processors) = &self.processors {
            processors.work(&self.clock, self.service + extra);
        }
        self.in_flight.push_back((self.free, *pose, self.maps, self.time_s));
        Ok(())
    }

    fn receive(&mut self, frame: &mut Frame) -> Result<(), RenderFault> {
        let (done, pose, maps, time_s) = self.in_flight.pop_front().expect("received more than was submitted");
        self.clock.sleep_until(done);
        let number = self.received.fetch_add(1, Ordering::Relaxed);
        if (self.faults)(number) {
            return Err(RenderFault::Lost(format!("device lost at frame {number}")));
        }
        (frame.width, frame.height) = (SHAPE.width, SHAPE.height);
        for map in [&mut frame.bmode, &mut frame.segmentation, &mut frame.mask] {
            map.clear();
            map.resize(PIXELS, 1 + self.gain_db as u8);
        }
        // In tenths of a second.
        frame.mask.fill((10.0 * time_s) as u8);
        frame.attenuation.clear();
        frame.attenuation.resize(PIXELS, pose.position_mm.x as f32);
        if !maps {
            frame.segmentation.clear();
            frame.attenuation.clear();
        }
        Ok(())
    }

    fn set_time_s(&mut self, time_s: f64) {
        self.time_s = time_s;
    }

    fn set_maps(&mut self, wanted: bool) {
        self.maps = wanted;
    }

    fn reconfigure(&mut self, _: &Probe, settings: &RenderSettings) -> Result<(), RenderFault> {
        assert!(self.in_flight.is_empty(), "configured with frames in flight");
        if settings.image.gain_db > 100.0 {
            return Err(RenderFault::Refused("too loud".to_owned()));
        }
        self.gain_db = settings.image.gain_db;
        self.quality = settings.quality;
        Ok(())
    }
}

/// Builds the device again; fails `failures` times first.
struct Factory {
    clock: Arc<dyn Clock>,
    device: Box<dyn Fn() -> Device + Send>,
    failures: u32,
}

impl RendererFactory for Factory {
    fn build(&mut self, _: &Probe, settings: &RenderSettings) -> Result<Box<dyn FrameRenderer>, RenderFault> {
        self.clock.sleep_until(self.clock.now() + 200 * MS);
        if self.failures > 0 {
            self.failures -= 1;
            return Err(RenderFault::Lost("still no driver".to_owned()));
        }
        let mut device = (self.device)();
        device.gain_db = settings.image.gain_db;
        device.quality = settings.quality;
        Ok(Box::new(device))
    }
}

struct Poses<F>(F);

impl<F: FnMut(Duration) -> Estimate + Send> PoseSource for Poses<F> {
    fn sample(&mut self, now_ns: u64, display_ns: u64) -> Estimate {
        assert!(display_ns >= now_ns);
        (self.0)(Duration::from_nanos(now_ns - START_NS))
    }
}

const START_NS: u64 = 1_767_225_600_000_000_000;

/// A tracker whose newest record's first byte came 5 ms before the sample.
fn tracked(now: Duration, x: f64) -> Estimate {
    Estimate {
        scene_from_probe: Some(pose(x)),
        state: TrackingState::Good,
        first_byte_ns: Some((START_NS + now.as_nanos() as u64).saturating_sub(5_000_000)),
        predicted_ms: 0.0,
    }
}

/// 20 mm/s.
fn moving(now: Duration) -> Estimate {
    tracked(now, 20.0 * now.as_secs_f64())
}

fn resting(now: Duration) -> Estimate {
    tracked(now, 0.0)
}

struct Translate<F> {
    work: F,
    terminator: Option<Terminator>,
    on_processors: bool,
}

impl<F: FnMut(&Frame, &mut Vec<u8>) -> Result<(), EnhanceError> + Send> Enhancer for Translate<F> {
    fn tier(&self) -> &str {
        "fake"
    }

    fn on_processors(&self) -> bool {
        self.on_processors
    }

    fn enhance(&mut self, frame: &Frame, out: &mut Vec<u8>) -> Result<(), EnhanceError> {
        (self.work)(frame, out)
    }

    fn terminator(&self) -> Option<Terminator> {
        self.terminator.clone()
    }
}

/// A generator that takes `time` a run and paints 200.
fn generator(clock: &Arc<dyn Clock>, time: Duration) -> Box<dyn Enhancer> {
    let clock = clock.clone();
    let work = move |frame: &Frame, out: &mut Vec<u8>| {
        clock.sleep_until(clock.now() + time);
        out.resize(frame.bmode.len(), 200);
        Ok(())
    };
    Box::new(Translate { work, terminator: None, on_processors: false })
}

struct Sink<F> {
    name: &'static str,
    maps: Option<MapsWanted>,
    take: F,
}

impl<F: FnMut(&PresentedFrame) -> Result<(), SinkError> + Send> LiveSink for Sink<F> {
    fn name(&self) -> &str {
        self.name
    }

    fn maps_wanted(&self) -> Option<MapsWanted> {
        self.maps.clone()
    }

    fn present(&mut self, frame: &PresentedFrame) -> Result<(), SinkError> {
        (self.take)(frame)
    }

    fn finish(self: Box<Self>) -> Result<(), SinkError> {
        Ok(())
    }
}

fn sink(
    name: &'static str,
    take: impl FnMut(&PresentedFrame) -> Result<(), SinkError> + Send + 'static,
) -> Box<dyn LiveSink> {
    Box::new(Sink { name, maps: None, take })
}

fn broken() -> SinkError {
    SinkError::FrameRate { fps: 0.0 }
}

/// A sink that keeps what it sees of each frame.
#[derive(Debug, Clone, PartialEq)]
struct Seen {
    number: u64,
    source: FrameSource,
    first_pixel: u8,
    x: Option<f64>,
    tracking: TrackingState,
    presented: Duration,
    age: Duration,
    frozen: bool,
    scene_ds: u8,
    notice: Option<String>,
    tier: Option<String>,
}

type Log = Arc<Mutex<Vec<Seen>>>;

fn logger(log: &Log) -> Box<dyn LiveSink> {
    let log = log.clone();
    let take = move |frame: &PresentedFrame| {
        assert_eq!(
            [frame.image.len(), frame.segmentation.len(), frame.attenuation.len(), frame.mask.len()],
            [PIXELS; 4]
        );
        assert!(frame.image.iter().all(|p| *p == frame.image[0]), "a picture of one frame");
        log.lock().unwrap().push(Seen {
            number: frame.number,
            source: frame.source,
            first_pixel: frame.image[0],
            x: frame.info.pose().map(|p| p.position_mm.x),
            tracking: frame.info.estimate.state,
            presented: frame.info.timeline.presented,
            age: frame.info.timeline.presented - frame.info.timeline.sampled,
            frozen: frame.info.settings.frozen,
            scene_ds: frame.mask[0],
            notice: frame.notice.clone(),
            tier: frame.tier.clone(),
        });
        Ok(())
    };
    Box::new(Sink { name: "log", maps: Some(Arc::new(|| true)), take })
}

fn seen(log: &Log) -> Vec<Seen> {
    std::mem::take(&mut log.lock().unwrap())
}

/// A session at 20 frames a second on a device that takes 20 ms.
struct Session {
    clock: Arc<dyn Clock>,
    stop: Stop,
    settings: PipelineSettings,
    limits: Limits,
    poses: Box<dyn PoseSource>,
    service: Duration,
    extra: Arc<Extra>,
    quality: Option<QualityBudget>,
    faults: Arc<dyn Fn(u64) -> bool + Send + Sync>,
    build_failures: u32,
    processors: Option<Arc<Processors>>,
    enhancer: Option<Box<dyn Enhancer>>,
    sinks: Vec<Box<dyn LiveSink>>,
    log: Option<FrameLog>,
    controls: tokio::sync::mpsc::Receiver<Control>,
    observer: Option<Arc<dyn Observer>>,
    before: Vec<Box<dyn Part>>,
    after: Vec<Box<dyn Part>>,
}

impl Session {
    fn new(clock: &Arc<dyn Clock>, poses: impl FnMut(Duration) -> Estimate + Send + 'static) -> Self {
        let choice = ChoiceSettings { hold_mm: 0.3, hold_deg: 0.3, steady_frames: 8 };
        Self {
            clock: clock.clone(),
            stop: Stop::new(clock),
            settings: PipelineSettings {
                frame_rate_hz: 20.0,
                budget_ms: 100.0,
                choice,
                hang_ms: 2000.0,
                finish_ms: 10_000.0,
            },
            limits: Limits { duration: Some(10 * SECOND), frames: None },
            poses: Box::new(Poses(poses)),
            service: 20 * MS,
            extra: Arc::new(|_, _| Duration::ZERO),
            quality: None,
            faults: Arc::new(|_| false),
            build_failures: 0,
            processors: None,
            enhancer: None,
            sinks: Vec::new(),
            log: None,
            controls: tokio::sync::mpsc::channel(1).1,
            observer: None,
            before: Vec::new(),
            after: Vec::new(),
        }
    }

    fn run(self) -> Summary {
        self.run_watched(|_| ())
    }

    fn run_watched(self, watch: impl FnMut(&insonify::pipeline::Status)) -> Summary {
        let (received, clock, service, faults) =
            (Arc::<AtomicU64>::default(), self.clock.clone(), self.service, self.faults);
        let (extra, processors) = (self.extra, self.processors);
        let mut render = RenderSettings::default();
        if let Some(budget) = &self.quality {
            render.quality = budget.point().with_seed(0);
        }
        let device = move || Device {
            clock: clock.clone(),
            service,
            extra: extra.clone(),
            quality: render.quality,
            in_flight: VecDeque::with_capacity(2),
            maps: true,
            free: Duration::ZERO,
            received: received.clone(),
            faults: faults.clone(),
            gain_db: 0.0,
            processors: processors.clone(),
            time_s: 0.0,
        };
        let parts = Parts {
            clock: self.clock.clone(),
            stop: self.stop,
            poses: self.poses,
            renderer: Box::new(device()),
            factory: Box::new(Factory { clock: self.clock, device: Box::new(device), failures: self.build_failures }),
            probe: Probe::default(),
            render,
            quality: self.quality,
            enhancer: self.enhancer,
            sinks: self.sinks,
            log: self.log,
            controls: self.controls,
            observer: self.observer,
            before: self.before,
            after: self.after,
        };
        let summary = Pipeline::run(&self.settings, self.limits, parts, watch).unwrap();
        all_counted(&summary);
        summary
    }
}

/// Nothing is lost without being counted.
#[track_caller]
fn all_counted(summary: &Summary) {
    let drops: u64 = summary.drops.values().sum();
    assert_eq!(summary.produced, summary.presented + drops, "{:?}", summary.drops);
    assert_eq!(summary.by_source.iter().sum::<u64>(), summary.presented);
    assert_eq!(summary.by_tracking.iter().sum::<u64>(), summary.presented);
    for sink in &summary.sinks {
        assert_eq!(sink.offered, summary.presented, "{}", sink.name);
        let at_work = u64::from(sink.stuck);
        assert_eq!(sink.offered, sink.taken + sink.dropped + sink.failed + at_work, "{sink:?}");
    }
    if let Some(generator) = &summary.generator {
        let at_work = u64::from(generator.stuck);
        assert_eq!(generator.offered, generator.done + generator.failed + generator.dropped + at_work, "{generator:?}");
    }
}

/// How often the picture's kind changes, and whether it ever goes back and forth within three frames.
fn changes(frames: &[Seen]) -> (usize, bool) {
    let enhanced: Vec<bool> = frames.iter().map(|f| f.source != FrameSource::LowQuality).collect();
    let changes = enhanced.windows(2).filter(|w| w[0] != w[1]).count();
    (changes, enhanced.windows(3).any(|w| w[0] == w[2] && w[0] != w[1]))
}

#[test]
fn without_a_generator_every_tick_is_a_frame_and_as_old_as_it_took() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let summary = Session { sinks: vec![logger(&log)], ..Session::new(&clock, moving) }.run();
    let frames = seen(&log);
    assert_eq!((summary.produced, frames.len() as u64), (200, summary.presented));
    assert!(frames.iter().enumerate().all(|(i, f)| f.number == i as u64 && f.age == 20 * MS), "{frames:?}");
    assert!(frames.windows(2).all(|w| w[1].presented - w[0].presented == 50 * MS));
    assert!(frames.iter().all(|f| f.source == FrameSource::LowQuality && f.tier.is_none() && f.first_pixel == 1));
    let latency = summary.pose_to_present.unwrap();
    assert!(latency.p50_ms >= 25.0 && latency.max_ms < 25.1, "5 ms of age when sampled: {latency:?}");
    assert!((summary.frames_per_s - 20.0).abs() < 0.01);
}

/// Numbers of the frames that carried maps, each of them its own.
fn frames_with_maps(
    clock: &Arc<dyn Clock>,
    enhancer: Option<Box<dyn Enhancer>>,
    mut each: impl FnMut(u64, &AtomicBool, &tokio::sync::mpsc::Sender<Control>) + Send + 'static,
) -> Vec<u64> {
    let with_maps = Arc::<Mutex<Vec<u64>>>::default();
    let wanted = Arc::new(AtomicBool::new(false));
    let (sender, controls) = tokio::sync::mpsc::channel(4);
    let (kept, asked) = (with_maps.clone(), wanted.clone());
    let take = move |frame: &PresentedFrame| {
        assert_eq!(frame.segmentation.len(), frame.attenuation.len());
        assert_eq!([frame.image.len(), frame.mask.len()], [PIXELS; 2]);
        if !frame.segmentation.is_empty() {
            let x = frame.info.pose().map(|pose| pose.position_mm.x as f32);
            assert!(frame.attenuation.iter().all(|&a| Some(a) == x), "another frame's maps: {}", frame.number);
            kept.lock().unwrap().push(frame.number);
        }
        each(frame.number, &asked, &sender);
        Ok(())
    };
    let maps: MapsWanted = Arc::new(move || wanted.load(Ordering::Relaxed));
    let overlay = Box::new(Sink { name: "overlay", maps: Some(maps), take });
    Session { controls, enhancer, sinks: vec![overlay], ..Session::new(clock, moving) }.run();
    std::mem::take(&mut *with_maps.lock().unwrap())
}

#[test]
fn maps_are_rendered_while_somebody_reads_them() {
    let _guard = beside_others();
    let clock = clock();
    // An overlay that is shown from frame 50 to frame 120.
    let with_maps = frames_with_maps(&clock, None, |number, wanted, _| {
        wanted.store((50..120).contains(&number), Ordering::Relaxed);
    });
    let (first, last) = (with_maps[0], *with_maps.last().unwrap());
    assert!((51..=53).contains(&first) && (120..=122).contains(&last), "{first}..={last}");
    assert_eq!(with_maps.len() as u64, last - first + 1, "{with_maps:?}");
}

#[test]
fn maps_are_rendered_while_the_generator_is_at_work() {
    let _guard = beside_others();
    let clock = Arc::new(SimulatedClock::new()) as Arc<dyn Clock>;
    let read = Arc::<AtomicU64>::default();
    let (runs, clock_of_run) = (read.clone(), clock.clone());
    let work = move |frame: &Frame, out: &mut Vec<u8>| {
        assert_eq!([frame.segmentation.len(), frame.attenuation.len()], [PIXELS; 2], "a generator without its maps");
        runs.fetch_add(1, Ordering::Relaxed);
        clock_of_run.sleep_until(clock_of_run.now() + 10 * MS);
        out.resize(PIXELS, 200);
        Ok(())
    };
    let enhancer = Some(Box::new(Translate { work, terminator: None, on_processors: false }) as Box<dyn Enhancer>);
    let with_maps = frames_with_maps(&clock, enhancer, |number, _, sender| match number {
        50 => sender.try_send(Control::set("enhance", false)).unwrap(),
        120 => sender.try_send(Control::set("enhance", true)).unwrap(),
        _ => {}
    });
    assert!(with_maps.contains(&0) && with_maps.contains(&50) && with_maps.contains(&199));
    let without: Vec<u64> = (0..200).filter(|number| !with_maps.contains(number)).collect();
    assert!(without.len() >= 65 && without[0] > 50 && *without.last().unwrap() <= 123, "{without:?}");
    assert!(read.load(Ordering::Relaxed) > 100);
}

/// A generator that keeps the budget except between these times.
struct Resting {
    clock: Arc<dyn Clock>,
    rests: std::ops::Range<Duration>,
}

impl Enhancer for Resting {
    fn tier(&self) -> &str {
        "resting"
    }

    fn ready(&mut self, maps: bool) -> Readiness {
        match self.rests.contains(&self.clock.now()) {
            true => Readiness::Rests,
            false if maps => Readiness::Runs,
            false => Readiness::NeedsMaps,
        }
    }

    fn reads_maps(&self) -> bool {
        !self.rests.contains(&self.clock.now())
    }

    fn enhance(&mut self, frame: &Frame, out: &mut Vec<u8>) -> Result<(), EnhanceError> {
        assert_eq!([frame.segmentation.len(), frame.attenuation.len()], [PIXELS; 2], "a generator without its maps");
        out.resize(PIXELS, 200);
        Ok(())
    }

    fn terminator(&self) -> Option<Terminator> {
        None
    }
}

#[test]
fn maps_are_not_rendered_while_the_generator_rests() {
    let _guard = beside_others();
    let clock = Arc::new(SimulatedClock::new()) as Arc<dyn Clock>;
    let enhancer = Resting { clock: clock.clone(), rests: 2000 * MS..6000 * MS };
    let with_maps = frames_with_maps(&clock, Some(Box::new(enhancer)), |_, _, _| {});
    let without: Vec<u64> = (0..200).filter(|number| !with_maps.contains(number)).collect();
    // 20 frames/s: frames 40 to 120, and those that were in flight when it woke.
    assert!(with_maps.contains(&0) && with_maps.contains(&199), "{with_maps:?}");
    assert!((40..=44).contains(&without[0]) && (118..=125).contains(without.last().unwrap()), "{without:?}");
    assert!(without.len() >= 75, "{without:?}");
}

#[test]
fn a_generator_of_the_image_alone_makes_nobody_render_maps() {
    struct OfTheImage(Arc<AtomicU64>);
    impl Enhancer for OfTheImage {
        fn tier(&self) -> &str {
            "of the image"
        }

        fn ready(&mut self, _: bool) -> Readiness {
            Readiness::Runs
        }

        fn reads_maps(&self) -> bool {
            false
        }

        fn enhance(&mut self, frame: &Frame, out: &mut Vec<u8>) -> Result<(), EnhanceError> {
            self.0.fetch_add(1, Ordering::Relaxed);
            out.resize(frame.bmode.len(), 200);
            Ok(())
        }

        fn terminator(&self) -> Option<Terminator> {
            None
        }
    }
    let _guard = beside_others();
    let clock = Arc::new(SimulatedClock::new()) as Arc<dyn Clock>;
    let runs = Arc::<AtomicU64>::default();
    let enhancer = Box::new(OfTheImage(runs.clone()));
    let with_maps = frames_with_maps(&clock, Some(enhancer), |number, wanted, _| {
        wanted.store((50..70).contains(&number), Ordering::Relaxed);
    });
    assert!(with_maps[0] > 50 && with_maps.len() <= 22, "an overlay's alone: {with_maps:?}");
    assert_eq!(runs.load(Ordering::Relaxed), 200);
}

/// Frames of a session at 20 frames/s in which rendering for `service` and runs of `run` share the processors.
fn on_shared_processors(
    service: Duration,
    run: impl Fn(u64) -> Duration + Send + 'static,
) -> (Summary, Vec<Seen>, u64) {
    let (clock, log, processors) = (clock(), Log::default(), Arc::<Processors>::default());
    let (clock_of_run, shared, mut number) = (clock.clone(), processors.clone(), 0);
    let work = move |frame: &Frame, out: &mut Vec<u8>| {
        shared.work(&clock_of_run, run(number));
        number += 1;
        out.resize(frame.bmode.len(), 200);
        Ok(())
    };
    let enhancer: Box<dyn Enhancer> = Box::new(Translate { work, terminator: None, on_processors: true });
    let session = Session::new(&clock, moving);
    let session = Session {
        enhancer: Some(enhancer),
        processors: Some(processors.clone()),
        sinks: vec![logger(&log)],
        service,
        ..session
    };
    let summary = session.run();
    (summary, seen(&log), processors.shared.load(Ordering::Relaxed))
}

#[test]
fn frames_and_generated_pictures_take_turns_on_the_same_processors() {
    let _guard = beside_others();
    // One run in ten is late, but not by half a period.
    let (summary, frames, shared) = on_shared_processors(25 * MS, |n| if n % 10 == 4 { 35 * MS } else { 20 * MS });
    assert_eq!((shared, summary.missed_ticks, summary.presented), (0, 0, 200));
    assert!(frames[8..].iter().all(|frame| frame.source == FrameSource::Enhanced));
    assert!(frames.iter().all(|frame| frame.age <= 60 * MS), "rendered and translated without an interruption");
}

#[test]
fn where_both_do_not_fit_into_a_period_frames_come_a_little_later() {
    let _guard = beside_others();
    let (summary, frames, shared) = on_shared_processors(30 * MS, |_| 30 * MS);
    assert_eq!(shared, 0);
    assert!((summary.frames_per_s - 1.0 / 0.06).abs() < 0.2, "{}", summary.frames_per_s);
    assert!(frames[8..].iter().all(|frame| frame.source == FrameSource::Enhanced && frame.age == 60 * MS));
}

#[test]
fn a_generator_that_takes_long_does_not_slow_frames_down() {
    let _guard = beside_others();
    let (summary, _, shared) = on_shared_processors(25 * MS, |_| 300 * MS);
    // It gets its turns in the first run alone: nobody knew how long it takes.
    assert!(summary.presented >= 196 && summary.missed_ticks <= 4, "{summary:?}");
    assert!(shared > 100);
    let (summary, frames, _) = on_shared_processors(25 * MS, |n| if n == 30 { 1000 * SECOND } else { 10 * MS });
    assert!(frames.last().unwrap().number >= 150, "{summary:?}");
    assert!(frames[60..].iter().all(|frame| frame.source == FrameSource::LowQuality), "the generator hangs");
}

#[test]
fn a_frame_that_is_made_where_it_is_submitted_is_not_held_back() {
    let _guard = beside_others();
    let (clock, log, processors) = (clock(), Log::default(), Arc::<Processors>::default());
    let session = Session::new(&clock, moving);
    let processors = Some(processors);
    let summary = Session { service: 70 * MS, processors, sinks: vec![logger(&log)], ..session }.run();
    assert!((summary.frames_per_s - 1.0 / 0.07).abs() < 0.1, "{}", summary.frames_per_s);
    assert!(seen(&log).iter().all(|frame| frame.age == 70 * MS));
}

#[test]
fn the_same_session_runs_the_same_way_each_time() {
    let _guard = beside_others();
    let run = || {
        let (clock, log) = (clock(), Log::default());
        let enhancer = Some(generator(&clock, 63 * MS));
        let session = Session::new(&clock, |now| tracked(now, (now.as_secs_f64() * 3.0).sin().max(0.0)));
        Session { enhancer, sinks: vec![logger(&log)], service: 37 * MS, ..session }.run();
        seen(&log)
    };
    let first = run();
    assert!(first.len() > 150);
    assert_eq!(first, run());
}

#[test]
fn a_device_slower_than_the_ticks_is_kept_busy_without_a_queue() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let summary = Session { service: 80 * MS, sinks: vec![logger(&log)], ..Session::new(&clock, moving) }.run();
    let frames = seen(&log);
    assert!(summary.frames_per_s > 12.4, "80 ms a frame: {}", summary.frames_per_s);
    assert!(frames[10..].iter().all(|f| f.age <= 86 * MS), "poses don't wait in the device's queue");
    assert!(summary.missed_ticks > 60, "ticks are counted, not caught up: {}", summary.missed_ticks);
}

#[test]
fn a_fast_generator_is_shown_steadily_and_within_the_budget() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let enhancer = Some(generator(&clock, 30 * MS));
    let summary = Session { enhancer, sinks: vec![logger(&log)], ..Session::new(&clock, moving) }.run();
    let frames = seen(&log);
    assert_eq!(changes(&frames), (1, false), "once from rendered to generated");
    assert!(frames[12..].iter().all(|f| f.source == FrameSource::Enhanced && f.first_pixel == 200));
    assert!(frames[12..].iter().all(|f| f.age == 50 * MS && f.tier.as_deref() == Some("fake")), "20 + 30 ms");
    assert!(summary.enhanced_ratio > 0.9);
    assert!(summary.inference.unwrap().p50_ms > 29.9);
}

#[test]
fn a_frame_whose_run_fails_is_shown_as_soon_as_it_has() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let (clock_of_run, mut run) = (clock.clone(), 0);
    let work = move |frame: &Frame, out: &mut Vec<u8>| {
        run += 1;
        let fails = run % 20 == 0;
        clock_of_run.sleep_until(clock_of_run.now() + if fails { 10 * MS } else { 30 * MS });
        out.resize(frame.bmode.len(), 200);
        if fails { Err(EnhanceError("pixel 7 is NaN".to_owned())) } else { Ok(()) }
    };
    let enhancer: Option<Box<dyn Enhancer>> =
        Some(Box::new(Translate { work, terminator: None, on_processors: false }));
    let summary = Session { enhancer, sinks: vec![logger(&log)], ..Session::new(&clock, moving) }.run();
    assert!(summary.generator.unwrap().failed >= 9);
    let ages: Vec<_> = seen(&log).iter().map(|frame| frame.age).collect();
    // 20 ms alone, with a run of 10 ms that fails, and with one of 30 ms that doesn't; 100 ms are the deadline.
    assert!(ages.iter().all(|age| [20 * MS, 30 * MS, 50 * MS].contains(age)), "{ages:?}");
    assert!(ages.iter().filter(|age| **age == 30 * MS).count() >= 2, "{ages:?}");
}

#[test]
fn a_slow_generator_costs_no_frame_and_no_time_and_is_held_while_the_probe_rests() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let enhancer = Some(generator(&clock, 300 * MS));
    // Moves for 4 s, rests for 4 s, moves on.
    let poses = |now: Duration| {
        let s = now.as_secs_f64();
        tracked(now, 20.0 * (s.min(4.0) + (s - 8.0).max(0.0)))
    };
    let summary = Session { enhancer, sinks: vec![logger(&log)], ..Session::new(&clock, poses) }.run();
    let frames = seen(&log);
    assert_eq!(summary.presented, 200, "the cadence holds");
    assert!(frames.iter().all(|f| f.age == 20 * MS), "no frame waits for what can't be in time");
    assert_eq!(changes(&frames), (2, false));
    for frame in &frames {
        match frame.presented.as_secs_f64() {
            s if !(4.0..8.1).contains(&s) => assert_eq!(frame.source, FrameSource::LowQuality, "{frame:?}"),
            s if (5.2..8.0).contains(&s) => assert_eq!(frame.source, FrameSource::HeldEnhanced, "{frame:?}"),
            _ => {}
        }
    }
    let generator = summary.generator.unwrap();
    assert!(generator.late == generator.done && generator.done >= 30 && generator.dropped > 100, "{generator:?}");
}

#[test]
fn a_generator_at_its_limit_does_not_flicker() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let (clock_of, mut run) = (clock.clone(), 0_u64);
    let work = move |frame: &Frame, out: &mut Vec<u8>| {
        run += 1;
        // Most runs are in time, every fifth is not.
        clock_of.sleep_until(clock_of.now() + if run.is_multiple_of(5) { 110 * MS } else { 40 * MS });
        out.resize(frame.bmode.len(), 200);
        Ok(())
    };
    let enhancer: Option<Box<dyn Enhancer>> =
        Some(Box::new(Translate { work, terminator: None, on_processors: false }));
    let summary = Session {
        enhancer,
        sinks: vec![logger(&log)],
        limits: Limits { duration: Some(60 * SECOND), frames: None },
        ..Session::new(&clock, moving)
    }
    .run();
    let frames = seen(&log);
    let (count, flickers) = changes(&frames);
    assert!(!flickers && count <= 6, "{count} changes");
    assert!(frames.iter().all(|f| f.age <= 100 * MS), "the deadline holds");
    assert!(summary.presented >= 1195);
}

#[test]
fn a_sink_that_blocks_for_ever_harms_nobody_also_not_at_the_end() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let clock_of = clock.clone();
    let dead = sink("dead", move |frame| {
        if frame.number == 10 {
            clock_of.sleep_until(NEVER);
        }
        Ok(())
    });
    let summary = Session { sinks: vec![dead, logger(&log)], ..Session::new(&clock, moving) }.run();
    assert_eq!(seen(&log).len(), 200);
    let [dead, log] = &summary.sinks[..] else { panic!() };
    assert!(dead.stuck && dead.taken == 10 && dead.dropped == 189, "{dead:?}");
    assert_eq!((log.taken, log.dropped, log.stuck), (200, 0, false));
    assert_eq!(summary.stuck, ["dead"]);
    assert!(clock.now() < 25 * SECOND, "the end is bounded");
}

#[test]
fn a_sink_that_really_blocks_is_left_behind_on_the_machines_clock() {
    let _guard = beside_others();
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    let (_never, blocks) = mpsc::channel::<()>();
    let dead = sink("dead", move |_| {
        let _ = blocks.recv();
        Ok(())
    });
    let log = Log::default();
    let mut session = Session::new(&clock, |_| Estimate {
        scene_from_probe: Some(pose(0.0)),
        state: TrackingState::Good,
        ..Estimate::default()
    });
    session.poses = Box::new(insonify::pipeline::StandingPose(pose(0.0)));
    session.sinks = vec![dead, logger(&log)];
    session.service = MS;
    session.settings.frame_rate_hz = 200.0;
    session.settings.finish_ms = 20.0;
    session.limits = Limits { duration: None, frames: Some(5) };
    let summary = session.run();
    assert_eq!((summary.presented, summary.stuck), (5, vec!["dead".to_owned()]));
}

#[test]
fn a_sink_that_fails_again_and_again_is_closed_and_one_that_fails_once_is_not() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let full = sink("full disk", |frame| if frame.number < 3 { Ok(()) } else { Err(broken()) });
    let hiccup = sink("hiccup", |frame| if frame.number.is_multiple_of(7) { Err(broken()) } else { Ok(()) });
    let summary = Session { sinks: vec![full, hiccup, logger(&log)], ..Session::new(&clock, moving) }.run();
    let [full, hiccup, _] = &summary.sinks[..] else { panic!() };
    assert_eq!((full.taken, full.failed, full.dropped, full.stuck), (3, 5, 192, false));
    assert!(full.error.as_ref().unwrap().contains("5 times in a row"));
    assert_eq!((hiccup.failed, hiccup.taken, hiccup.error.is_none()), (29, 171, true));
    let said = seen(&log).iter().any(|f| f.notice.as_ref().is_some_and(|n| n.contains("full disk")));
    assert!(said, "whoever watches another sink hears of it");
}

#[test]
fn a_sink_that_panics_is_closed() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let panics = sink("panics", |frame| {
        if frame.number == 4 {
            std::panic::resume_unwind(Box::new("a bug"));
        }
        Ok(())
    });
    let session = Session { sinks: vec![panics, logger(&log)], ..Session::new(&clock, moving) };
    let summary = session.run();
    assert_eq!(seen(&log).len(), 200);
    let panics = &summary.sinks[0];
    assert_eq!((panics.taken, panics.failed, panics.error.as_deref()), (4, 1, Some("it panicked")));
}

#[test]
fn a_generator_that_hangs_for_ever_leaves_the_station_at_rendered_frames() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let (clock_of, mut run) = (clock.clone(), 0);
    let work = move |frame: &Frame, out: &mut Vec<u8>| {
        run += 1;
        clock_of.sleep_until(if run == 40 { NEVER } else { clock_of.now() + 20 * MS });
        out.resize(frame.bmode.len(), 200);
        Ok(())
    };
    let enhancer: Option<Box<dyn Enhancer>> =
        Some(Box::new(Translate { work, terminator: None, on_processors: false }));
    let summary = Session { enhancer, sinks: vec![logger(&log)], ..Session::new(&clock, moving) }.run();
    let frames = seen(&log);
    // The frame that waited for its deadline comes together with the next one, which replaces it at the sink.
    assert_eq!((summary.presented, frames.len()), (200, 199), "{summary:?}");
    assert_eq!(changes(&frames), (2, false));
    assert!(frames.iter().all(|f| f.age <= 100 * MS));
    assert!(frames[45..].iter().all(|f| f.source == FrameSource::LowQuality));
    assert!(frames.iter().any(|f| f.notice.as_ref().is_some_and(|n| n.contains("hangs on frame"))));
    let generator = summary.generator.unwrap();
    assert_eq!((generator.hung, generator.given_up, generator.stuck, generator.done), (1, 1, true, 39));
    assert_eq!(summary.stuck, ["generator"]);
}

#[test]
fn a_generator_that_does_not_heed_its_termination_is_given_up_and_may_come_back() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let told = Arc::<AtomicU64>::default();
    let (clock_of, told_of, mut run) = (clock.clone(), told.clone(), 0);
    let work = move |frame: &Frame, out: &mut Vec<u8>| {
        run += 1;
        // Run 40 comes back long after it was told to end, run 60 never does.
        let time = match run {
            40 => 5 * SECOND,
            60 => NEVER,
            _ => 20 * MS,
        };
        clock_of.sleep_until(clock_of.now().saturating_add(time));
        out.resize(frame.bmode.len(), 200);
        Ok(())
    };
    let terminator: Terminator = Arc::new(move || {
        told_of.fetch_add(1, Ordering::Relaxed);
    });
    let enhancer: Option<Box<dyn Enhancer>> =
        Some(Box::new(Translate { work, terminator: Some(terminator), on_processors: false }));
    let limits = Limits { duration: Some(20 * SECOND), frames: None };
    let summary = Session { enhancer, limits, sinks: vec![logger(&log)], ..Session::new(&clock, moving) }.run();
    let frames = seen(&log);
    assert_eq!(summary.presented, 400, "the cadence holds");
    assert_eq!(changes(&frames), (4, false), "generated, rendered, generated, rendered");
    assert!(frames.iter().all(|f| f.age <= 100 * MS));
    for (from_s, words) in [(4.0, "is told to end"), (5.0, "is given up"), (11.5, "is given up")] {
        let said = |f: &&Seen| f.notice.as_ref().is_some_and(|n| n.contains(words));
        let first = frames.iter().find(|f| f.presented.as_secs_f64() >= from_s && said(f));
        assert!(first.is_some_and(|f| f.presented.as_secs_f64() < from_s + 1.5), "{words}: {first:?}");
    }
    let generator = summary.generator.unwrap();
    // The end of the session tells the last one again.
    assert_eq!((generator.hung, generator.given_up, told.load(Ordering::Relaxed)), (2, 2, 3));
    assert!(generator.stuck && summary.stuck == ["generator"], "{generator:?}");
    let after = frames.iter().filter(|f| f.presented.as_secs_f64() > 11.0).all(|f| f.source == FrameSource::LowQuality);
    assert!(after, "nobody waits for one that is given up");
}

#[test]
fn a_generator_that_hangs_is_terminated_where_its_provider_can() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let stop_run = Arc::new(insonify::pipeline::Signal::default());
    let (clock_of, clock_too, stopped, stops, mut run) = (clock.clone(), clock.clone(), stop_run.clone(), stop_run, 0);
    let work = move |frame: &Frame, out: &mut Vec<u8>| {
        run += 1;
        if run == 40 {
            clock_of.wait(&stopped, stopped.generation(), NEVER);
            return Err(EnhanceError("terminated".to_owned()));
        }
        clock_of.sleep_until(clock_of.now() + 20 * MS);
        out.resize(frame.bmode.len(), 200);
        Ok(())
    };
    let terminator: Option<Terminator> = Some(Arc::new(move || clock_too.notify(&stops)));
    let enhancer: Option<Box<dyn Enhancer>> = Some(Box::new(Translate { work, terminator, on_processors: false }));
    let summary = Session { enhancer, sinks: vec![logger(&log)], ..Session::new(&clock, moving) }.run();
    let frames = seen(&log);
    assert_eq!(changes(&frames), (3, false), "and it comes back");
    let generator = summary.generator.unwrap();
    assert_eq!((generator.hung, generator.stuck, generator.failed), (1, false, 1));
    assert!(summary.stuck.is_empty());
}

#[test]
fn a_generator_that_gives_nonsense_rests_and_is_tried_again() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let mut run = 0;
    let work = move |frame: &Frame, out: &mut Vec<u8>| {
        run += 1;
        match run {
            20 => out.resize(frame.bmode.len() - 1, 0),
            21..=40 => return Err(EnhanceError("pixel 7 is NaN".to_owned())),
            _ => out.resize(frame.bmode.len(), 200),
        }
        Ok(())
    };
    let enhancer: Option<Box<dyn Enhancer>> =
        Some(Box::new(Translate { work, terminator: None, on_processors: false }));
    let limits = Limits { duration: Some(200 * SECOND), frames: None };
    let summary = Session { enhancer, limits, sinks: vec![logger(&log)], ..Session::new(&clock, moving) }.run();
    let frames = seen(&log);
    assert_eq!(frames.len(), 4000);
    assert!(frames.iter().all(|f| matches!((f.source, f.first_pixel), (FrameSource::LowQuality, 1) | (_, 200))));
    assert_eq!(changes(&frames), (3, false));
    assert!(frames.iter().any(|f| f.notice.as_ref().is_some_and(|n| n.contains("NaN") && n.contains("rests"))));
    let generator = summary.generator.unwrap();
    assert_eq!(generator.failed, 21);
    assert_eq!(frames.last().unwrap().source, FrameSource::Enhanced, "it is back at the end");
}

#[test]
fn a_lost_device_is_built_anew_and_its_frames_are_counted() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let faults: Arc<dyn Fn(u64) -> bool + Send + Sync> = Arc::new(|n| n == 50 || n == 90);
    let session = Session { faults, build_failures: 3, sinks: vec![logger(&log)], ..Session::new(&clock, moving) };
    let summary = session.run();
    let frames = seen(&log);
    assert_eq!((summary.device_losses, summary.device_rebuilt), (2, 2));
    assert_eq!(summary.drops["lost with the device"], 2);
    let black: Vec<_> = frames.iter().filter(|f| f.x.is_none()).collect();
    assert!(!black.is_empty() && black.iter().all(|f| f.first_pixel == 0));
    assert!(black.iter().all(|f| f.notice.is_some()), "a black frame says why");
    assert!(frames.last().unwrap().x.is_some(), "and there are pictures again");
    assert!(frames.iter().any(|f| f.notice.as_ref().is_some_and(|n| n.contains("still no driver"))));
    // Three failures wait 0.25 + 0.5 + 1 s, each attempt takes 0.2 s.
    let gap = frames.windows(2).map(|w| w[1].presented - w[0].presented).max().unwrap();
    assert!(gap <= 300 * MS, "black frames go on between attempts: {gap:?}");
}

#[test]
fn a_device_that_is_lost_at_once_each_time_is_not_opened_in_a_loop() {
    let _guard = beside_others();
    let clock = clock();
    let limits = Limits { duration: Some(60 * SECOND), frames: None };
    let session = Session { faults: Arc::new(|n| n > 20), limits, ..Session::new(&clock, moving) };
    let summary = session.run();
    assert!((10..25).contains(&summary.device_losses), "{}", summary.device_losses);
}

#[test]
fn stale_and_lost_poses_are_shown_as_such() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    // Each second: 0.2 s in each state.
    let poses = |now: Duration| {
        let phase = now.as_secs_f64().fract();
        let state = match phase {
            p if p < 0.2 => TrackingState::Good,
            p if p < 0.4 => TrackingState::Held,
            p if p < 0.6 => TrackingState::Stuck,
            p if p < 0.8 => TrackingState::Stale,
            _ => TrackingState::Lost,
        };
        Estimate { state, ..tracked(now, phase) }
    };
    let enhancer = Some(generator(&clock, 10 * MS));
    let summary = Session { enhancer, sinks: vec![logger(&log)], ..Session::new(&clock, poses) }.run();
    let frames = seen(&log);
    for frame in &frames {
        let lost = frame.tracking == TrackingState::Lost;
        assert_eq!(frame.x.is_none(), lost, "{frame:?}");
        assert_eq!(frame.first_pixel == 0, lost, "a lost pose has no picture, old or new");
    }
    assert!(summary.by_tracking.iter().all(|n| *n >= 30), "{:?}", summary.by_tracking);
    assert!(frames.windows(2).all(|w| w[1].number == w[0].number + 1 && w[1].presented > w[0].presented));
}

#[test]
fn freezing_stops_the_picture_while_sliders_still_act() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let (sender, controls) = tokio::sync::mpsc::channel(16);
    let viewer = sink("viewer", move |frame| {
        let send = |control| sender.try_send(control).unwrap();
        match frame.number {
            40 => send(Control::set("frozen", true)),
            60 => send(Control::set("gain_db", 9.0)),
            80 => send(Control::set("gain_db", 150.0)),
            90 => send(Control::set("gain_db", f64::NAN)),
            100 => send(Control::set("frozen", false)),
            120 => send(Control::Quit),
            _ => {}
        }
        Ok(())
    });
    let session = Session { controls, sinks: vec![viewer, logger(&log)], ..Session::new(&clock, moving) };
    let summary = session.run();
    let frames = seen(&log);
    let frozen: Vec<_> = frames.iter().filter(|f| f.frozen).collect();
    assert!(frozen.len() >= 58 && frozen.iter().all(|f| f.x == frozen[0].x), "{}", frozen.len());
    assert!(frozen.iter().all(|f| f.scene_ds == frozen[0].scene_ds), "what moves in the scene stands still, too");
    assert!(frames[110].scene_ds >= frozen[0].scene_ds + 30, "and goes on at the session's time");
    assert!(frames[45].first_pixel == 1 && frames[65].first_pixel == 10 && frames[110].first_pixel == 10);
    assert!(frames.windows(2).filter(|w| !w[1].frozen).all(|w| w[1].x > w[0].x));
    assert_eq!((summary.controls, summary.controls_refused), (5, 1));
    assert!(frames.iter().any(|f| f.notice.as_ref().is_some_and(|n| n.contains("too loud"))), "the device refused");
    assert!(frames.iter().any(|f| f.notice.as_ref().is_some_and(|n| n.contains("image.gain_db"))));
    assert!(frames.len() < 125 && summary.stuck.is_empty(), "and it ends when a watcher asks for it");
}

#[test]
fn switching_the_generator_off_shows_rendered_frames_at_once() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let (sender, controls) = tokio::sync::mpsc::channel(16);
    let viewer = sink("viewer", move |frame| {
        match frame.number {
            50 => sender.try_send(Control::set("enhance", false)).unwrap(),
            100 => sender.try_send(Control::set("enhance", true)).unwrap(),
            // What was generated before is another picture.
            150 => sender.try_send(Control::set("gain_db", 3.0)).unwrap(),
            _ => {}
        }
        Ok(())
    });
    let enhancer = Some(generator(&clock, 300 * MS));
    let sinks = vec![viewer, logger(&log)];
    Session { enhancer, controls, sinks, ..Session::new(&clock, resting) }.run();
    let frames = seen(&log);
    let source = |n: usize| frames[n].source;
    assert_eq!(source(49), FrameSource::HeldEnhanced);
    assert!((53..100).all(|n| source(n) == FrameSource::LowQuality));
    assert_eq!(source(149), FrameSource::HeldEnhanced);
    assert!((153..157).all(|n| source(n) == FrameSource::LowQuality && frames[n].first_pixel == 4));
    assert_eq!(source(199), FrameSource::HeldEnhanced);
}

/// Notes the order in which parts end.
struct Noted {
    name: &'static str,
    order: Arc<Mutex<Vec<&'static str>>>,
    ends: bool,
}

impl Part for Noted {
    fn name(&self) -> &str {
        self.name
    }

    fn stop(&mut self) {
        self.order.lock().unwrap().push(self.name);
    }

    fn has_ended(&mut self) -> bool {
        self.ends
    }
}

#[test]
fn every_state_ends_in_order_and_in_time() {
    let _guard = beside_others();
    type Prepare = fn(Session) -> Session;
    let hang: Prepare = |session| {
        let clock = session.clock.clone();
        let work = move |_: &Frame, _: &mut Vec<u8>| {
            clock.sleep_until(NEVER);
            Ok(())
        };
        Session { enhancer: Some(Box::new(Translate { work, terminator: None, on_processors: false })), ..session }
    };
    let states: [(&str, Prepare, &[&str]); 7] = [
        ("plain", |s| s, &[]),
        ("no pose yet", |s| Session { poses: Box::new(Poses(|_| Estimate::default())), ..s }, &[]),
        ("generating", |s| Session { enhancer: Some(generator(&s.clock, 90 * MS)), ..s }, &[]),
        ("generator hangs", hang, &["generator"]),
        ("no device", |s| Session { faults: Arc::new(|_| true), build_failures: u32::MAX, ..s }, &[]),
        ("device hangs", |s| Session { service: Duration::from_secs(1 << 30), ..s }, &["renderer"]),
        ("slow device", |s| Session { service: 700 * MS, ..s }, &[]),
    ];
    for (name, prepare, stuck) in states {
        for stop_at in [Duration::ZERO, MS, 33 * MS, 70 * MS, 2345 * MS] {
            let (clock, order) = (clock(), Arc::<Mutex<Vec<_>>>::default());
            let part = |name, ends| -> Box<dyn Part> { Box::new(Noted { name, order: order.clone(), ends }) };
            let order_of = order.clone();
            let last = sink("last", move |_| {
                order_of.lock().unwrap().push("frame");
                Ok(())
            });
            let session = Session {
                limits: Limits { duration: Some(stop_at), frames: None },
                before: vec![part("tracker", true)],
                after: vec![part("recorder", true)],
                sinks: vec![last],
                ..Session::new(&clock, moving)
            };
            let summary = prepare(session).run();
            assert!(clock.now() <= stop_at + 5 * SECOND, "{name} at {stop_at:?}: {:?}", clock.now());
            assert!(summary.stuck.iter().all(|s| stuck.contains(&s.as_str())), "{name}: {:?}", summary.stuck);
            let order = order.lock().unwrap();
            assert_eq!(order.last(), Some(&"recorder"), "{name}: the recorder hears all");
            assert!(order.contains(&"tracker"));
        }
    }
}

#[test]
fn a_part_that_does_not_end_is_left_behind() {
    let _guard = beside_others();
    let clock = clock();
    let part: Box<dyn Part> = Box::new(Noted { name: "tracker", order: Arc::default(), ends: false });
    let summary = Session { before: vec![part], ..Session::new(&clock, moving) }.run();
    assert_eq!(summary.stuck, ["tracker"]);
    assert!(clock.now() < 14 * SECOND);
}

#[test]
fn exactly_as_many_frames_as_were_asked_for() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let limits = Limits { duration: None, frames: Some(17) };
    let summary = Session { limits, sinks: vec![logger(&log)], ..Session::new(&clock, moving) }.run();
    assert_eq!((summary.presented, seen(&log).len()), (17, 17));
}

/// Events, and how many poses and settings.
#[derive(Default)]
struct Counted {
    events: Vec<(u64, String)>,
    poses: u64,
    settings: u64,
}

#[derive(Default)]
struct Heard(Mutex<Counted>);

impl Observer for Heard {
    fn event(&self, unix_ns: u64, text: &str) {
        self.0.lock().unwrap().events.push((unix_ns, text.to_owned()));
    }

    fn pose(&self, _: u64, _: &Estimate) {
        self.0.lock().unwrap().poses += 1;
    }

    fn settings(&self, _: u64, _: &LiveSettings) {
        self.0.lock().unwrap().settings += 1;
    }
}

/// A session with a budget of 40 ms on a device of which a frame takes 7.9 ms and 1.34 ms a path (4x3: 24, 2x3: 16, 8x3: 40.1),
/// and twice as much from 20 s to 60 s.
fn budgeted(clock: &Arc<dyn Clock>, heard: &Arc<Heard>) -> Session {
    let cost_ms = |point: QualityPoint| 7.9 + 1.34 * f64::from(point.paths());
    let climbed = climb::<()>(40.0, |point| Ok(Some(cost_ms(point)))).unwrap();
    let extra: Arc<Extra> = Arc::new(move |now, point| {
        let slow = if (20 * SECOND..60 * SECOND).contains(&now) { 2.0 } else { 1.0 };
        Duration::from_secs_f64(1e-3 * slow * cost_ms(point))
    });
    let limits = Limits { duration: Some(120 * SECOND), frames: None };
    let (quality, observer) = (Some(QualityBudget::new(&climbed)), Some(heard.clone() as Arc<dyn Observer>));
    Session { service: Duration::ZERO, extra, quality, observer, limits, ..Session::new(clock, moving) }
}

/// What was said of the quality, with its time in whole seconds.
fn said_of_quality(heard: &Heard) -> Vec<(u64, String)> {
    let heard = heard.0.lock().unwrap();
    let said = heard.events.iter().filter_map(|(at, text)| Some((*at, text.strip_prefix("quality: ")?)));
    said.map(|(at, text)| ((at - START_NS) / 1_000_000_000, text.to_owned())).collect()
}

#[test]
fn quality_follows_what_the_machine_affords() {
    let _guard = beside_others();
    let (clock, log, heard) = (clock(), Log::default(), Arc::<Heard>::default());
    let summary = Session { sinks: vec![logger(&log)], ..budgeted(&clock, &heard) }.run();
    let said = said_of_quality(&heard);
    let texts: Vec<&str> = said.iter().map(|(_, text)| text.as_str()).collect();
    assert_eq!(texts, ["4x3 -> 2x3: frames take 48 ms of 40", "2x3 -> 4x3: frames take 16 ms of 40"]);
    assert!((23..30).contains(&said[0].0) && (70..80).contains(&said[1].0), "{said:?}");
    let (begun, ended) = ("4x3".to_owned(), "4x3".to_owned());
    let expected = QualitySummary { budget_ms: 40.0, begun, ended, lowered: 1, raised: 1, refused: 0, by_hand: false };
    assert_eq!(summary.quality, Some(expected));
    assert_eq!(heard.0.lock().unwrap().settings, 3, "at the start, and at each change");
    let frames = seen(&log);
    assert_eq!(frames.len(), 2400, "no frame is lost to a change");
    let late = |from: u64, to: u64, ms: u32| {
        let within = |f: &&Seen| (SECOND * from as u32..SECOND * to as u32).contains(&f.presented);
        frames.iter().filter(within).filter(|f| f.age > ms * MS).count()
    };
    assert_eq!([late(0, 20, 24), late(30, 60, 32), late(61, 70, 16), late(80, 120, 24)], [0; 4]);
}

#[test]
fn a_quality_that_is_set_by_hand_stays() {
    let _guard = beside_others();
    let (clock, heard) = (clock(), Arc::<Heard>::default());
    let (sender, controls) = tokio::sync::mpsc::channel(1);
    sender.try_send(Control::Set(vec![Assignment::new("rays", 8.0), Assignment::new("layers", 1.0)])).unwrap();
    let summary = Session { controls, ..budgeted(&clock, &heard) }.run();
    let said = said_of_quality(&heard);
    assert!(matches!(&said[..], [(0, text)] if text.contains("by hand")), "{said:?}");
    let quality = summary.quality.unwrap();
    assert_eq!((quality.by_hand, quality.lowered, quality.raised), (true, 0, 0));
}

#[test]
fn an_observer_hears_every_event_pose_and_setting() {
    let _guard = beside_others();
    let clock = clock();
    let heard = Arc::<Heard>::default();
    let (sender, controls) = tokio::sync::mpsc::channel(1);
    sender.try_send(Control::set("gain_db", 2.0)).unwrap();
    let observer: Option<Arc<dyn Observer>> = Some(heard.clone());
    let faults: Arc<dyn Fn(u64) -> bool + Send + Sync> = Arc::new(|n| n == 20);
    let summary = Session { observer, controls, faults, ..Session::new(&clock, moving) }.run();
    let heard = heard.0.lock().unwrap();
    assert_eq!((heard.poses, heard.settings), (summary.produced, 2), "the settings at the start, and the changed ones");
    assert_eq!(heard.events[0].1, "tracking");
    let (time_ns, text) = &heard.events[1];
    assert!(text.contains("device lost at frame 20"), "{text}");
    assert_eq!((time_ns - START_NS) / 1_000_000, 1020);
}

#[test]
fn nothing_is_allocated_per_frame() {
    let _guard = alone();
    let clock = clock();
    let at = Arc::new([AtomicU64::new(0), AtomicU64::new(0)]);
    let probe_at = at.clone();
    let probe = sink("probe", move |frame| {
        let index = match frame.number {
            400 => 0,
            1400 => 1,
            _ => return Ok(()),
        };
        probe_at[index].store(ALLOCATIONS.load(Ordering::Relaxed), Ordering::Relaxed);
        Ok(())
    });
    let session = Session {
        enhancer: Some(generator(&clock, 70 * MS)),
        sinks: vec![probe],
        limits: Limits { duration: None, frames: Some(1500) },
        ..Session::new(&clock, moving)
    };
    session.run();
    let [from, to] = [0, 1].map(|i| at[i].load(Ordering::Relaxed));
    assert!(from > 0);
    assert_eq!(to - from, 0, "allocations in a thousand frames");
}

#[test]
fn ten_minutes_with_everything_going_wrong_leave_memory_and_latency_flat() {
    let _guard = alone();
    let clock = clock();
    // A tracker that drops out for three of ten seconds, a generator that is slow and fails, a sink that stalls, a
    // device that is lost every minute.
    let poses = |now: Duration| match now.as_secs() % 10 {
        0..3 => Estimate { state: TrackingState::Lost, ..Estimate::default() },
        3 => Estimate { state: TrackingState::Stale, ..tracked(now, 0.0) },
        second if second < 7 => moving(now),
        _ => resting(now),
    };
    let (clock_of, mut run) = (clock.clone(), 0_u64);
    let work = move |frame: &Frame, out: &mut Vec<u8>| {
        run += 1;
        clock_of.sleep_until(clock_of.now() + (60 + 37 * (run % 5) as u32) * MS);
        if run.is_multiple_of(97) {
            return Err(EnhanceError("NaN".to_owned()));
        }
        out.resize(frame.bmode.len(), 200);
        Ok(())
    };
    let clock_of = clock.clone();
    let stalls = sink("stalls", move |frame| {
        let wait = if frame.number.is_multiple_of(100) { 3000 } else { 70 };
        clock_of.sleep_until(clock_of.now() + wait * MS);
        Ok(())
    });
    let received = Arc::<AtomicU64>::default();
    let received_of = received.clone();
    let slowest = Arc::new(Mutex::new([Duration::ZERO; 10]));
    let slowest_of = slowest.clone();
    let probe = sink("probe", move |frame| {
        received_of.fetch_add(1, Ordering::Relaxed);
        let minute = (frame.info.timeline.presented.as_secs() / 60).min(9) as usize;
        let age = frame.info.timeline.presented - frame.info.timeline.sampled;
        let mut slowest = slowest_of.lock().unwrap();
        slowest[minute] = slowest[minute].max(age);
        Ok(())
    });
    let session = Session {
        enhancer: Some(Box::new(Translate { work, terminator: None, on_processors: false })),
        sinks: vec![stalls, probe],
        faults: Arc::new(|n| n > 0 && n.is_multiple_of(800)),
        limits: Limits { duration: Some(600 * SECOND), frames: None },
        ..Session::new(&clock, poses)
    };
    let mut live = Vec::with_capacity(16);
    let summary = session.run_watched(|status| {
        if status.elapsed_s >= 60.0 * (live.len() + 1) as f64 {
            live.push(LIVE_BYTES.load(Ordering::Relaxed));
        }
    });
    assert_eq!(summary.presented, received.load(Ordering::Relaxed));
    assert!(summary.presented > 11_500, "{}", summary.presented);
    assert_eq!(live.len(), 10);
    assert!((live[9] - live[1]).abs() < 8192, "bytes in use, minute by minute: {live:?}");
    let slowest = slowest.lock().unwrap();
    assert!(slowest.iter().all(|age| *age <= 100 * MS), "{slowest:?}");
    assert!(summary.device_losses >= 8 && summary.device_rebuilt == summary.device_losses);
    assert!(summary.enhanced_ratio > 0.05, "{}", summary.enhanced_ratio);
    let stalls = &summary.sinks[0];
    assert!(stalls.dropped > 3000 && !stalls.stuck, "{stalls:?}");
}

fn insonify(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_insonify"));
    command.args(arguments).env_remove("RUST_LOG").current_dir(env!("CARGO_MANIFEST_DIR"));
    command
}

/// The sphere's station with a small image, so that the software device is quick.
fn small_station(directory: &Path, rest: &str) -> String {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes/sphere.glb");
    let path = directory.join("station.toml");
    let text = format!(
        "[scene]\npath = \"{}\"\nbackground = \"liver\"\n[probe]\nscanlines = 32\nsamples = 256\n[image]\nwidth = 160\nheight = 120\n[pose]\n{rest}",
        scene.display()
    );
    std::fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

fn json_lines(path: &Path) -> Vec<Value> {
    std::fs::read_to_string(path).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn the_program_runs_a_station_on_the_real_renderer() {
    let _guard = beside_others();
    let dir = tempfile::tempdir().unwrap();
    let station = small_station(dir.path(), "[pipeline]\nframe_rate_hz = 20.0\n");
    let (out, metrics) = (dir.path().join("out"), dir.path().join("frames.jsonl"));
    let arguments = ["run", &station, "--frames", "6", "--sink", "png", "--sink", "video", "--json"];
    let paths = ["--out", out.to_str().unwrap(), "--metrics", metrics.to_str().unwrap()];
    let output = insonify(&[&arguments[..], &paths].concat()).env("PATH", "").output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let summary: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(summary["presented"], 6);
    assert_eq!(summary["by_tracking"], serde_json::json!([6, 0, 0, 0, 0]));
    let drops: u64 = summary["drops"].as_object().unwrap().values().map(|n| n.as_u64().unwrap()).sum();
    assert_eq!(summary["produced"], 6 + drops);

    // The same pose as `insonify render`: the same picture.
    let still = dir.path().join("still");
    let rendered = insonify(&["render", &station, "--out", still.to_str().unwrap()]).output().unwrap();
    assert!(rendered.status.success());
    let expected = image::open(still.join("bmode.png")).unwrap().into_bytes();
    let index = json_lines(&out.join("png/index.jsonl"));
    assert!(!index.is_empty());
    for line in &index {
        let file = out.join("png").join(line["file"].as_str().unwrap());
        assert_eq!(image::open(file).unwrap().into_bytes(), expected);
    }
    assert!(std::fs::read(out.join("video.mp4")).unwrap()[4..].starts_with(b"ftyp"));
    let lines = json_lines(&metrics);
    let (last, frames) = lines.split_last().unwrap();
    assert_eq!(last["summary"]["presented"], 6);
    for line in frames {
        let at = |key: &str| line[key].as_f64().unwrap();
        assert!(at("sampled_ms") <= at("submitted_ms") && at("submitted_ms") < at("rendered_ms"));
        assert!(at("rendered_ms") <= at("presented_ms"));
    }
}

#[test]
fn what_cannot_be_run_is_refused() {
    let _guard = beside_others();
    let dir = tempfile::tempdir().unwrap();
    let station = small_station(dir.path(), "");
    let text = std::fs::read_to_string(&station).unwrap();
    let no_pose = dir.path().join("no_pose.toml");
    std::fs::write(&no_pose, text.replace("[pose]\n", "")).unwrap();
    let misspelt = dir.path().join("misspelt.toml");
    std::fs::write(&misspelt, format!("{text}[display]\nsinks = [\"vidoe\"]\n")).unwrap();
    let cases: [(&[&str], &str); 6] = [
        (&["run", no_pose.to_str().unwrap()], "no pose"),
        (&["run", misspelt.to_str().unwrap()], "did you mean `video`"),
        (&["run", &station, "--sink", "vidio"], "did you mean `video`"),
        (&["run", &station, "--duration", "0"], "expected seconds"),
        (&["run", &station, "--frames", "0"], "--frames"),
        (&["run", &station, "--replay", "nowhere.mcap"], "nowhere.mcap"),
    ];
    for (arguments, word) in cases {
        let output = insonify(arguments).output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
        assert!(message.contains(word) && !message.contains("panicked"), "{arguments:?}: {message}");
    }
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_the_program_in_order_and_a_truncated_file_is_never_left() {
    use std::io::{BufRead, BufReader};

    let _guard = beside_others();
    let dir = tempfile::tempdir().unwrap();
    let station = small_station(dir.path(), "");
    let (out, metrics) = (dir.path().join("out"), dir.path().join("frames.jsonl"));
    let arguments = ["run", &station, "--sink", "video", "--out", out.to_str().unwrap()];
    let mut child = insonify(&[&arguments[..], &["--metrics", metrics.to_str().unwrap(), "--json"]].concat())
        .env("PATH", "")
        .env("RUST_LOG", "insonify=info")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // "tracking" is said at the first frame.
    let mut said = BufReader::new(child.stderr.take().unwrap()).lines();
    assert!(said.by_ref().any(|line| line.unwrap().contains("tracking")));
    let id = nix::unistd::Pid::from_raw(i32::try_from(child.id()).unwrap());
    nix::sys::signal::kill(id, nix::sys::signal::Signal::SIGINT).unwrap();
    let rest: Vec<String> = said.map(Result::unwrap).collect();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{rest:?}");
    assert!(rest.iter().any(|line| line.contains("Ctrl-C")), "{rest:?}");
    let summary: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(summary["stuck"], serde_json::json!([]));
    let names: Vec<_> = std::fs::read_dir(&out).into_iter().flatten().map(|f| f.unwrap().file_name()).collect();
    assert!(names.iter().all(|name| name == "video.mp4"), "{names:?}");
    assert!(json_lines(&metrics).last().unwrap()["summary"].is_object());
}

/// The whole chain of the program: a recorded tracker's bytes, estimator, generator, sink and recording.
#[test]
fn the_program_tracks_enhances_and_records() {
    use insonify::tracker::Protocol;
    use insonify::tracker::recording::{RecordingInfo, RecordingWriter, poses};
    let _guard = beside_others();
    let dir = tempfile::tempdir().unwrap();
    // A protocol that the station doesn't name: only the recording knows it.
    let info = RecordingInfo {
        protocol: Protocol::OpenTrack,
        device: "test".into(),
        scene: "sphere".into(),
        start_time_ns: 1_790_000_000_000_000_000,
        sensor: None,
    };
    let taken = dir.path().join("taken.mcap");
    let mut writer = RecordingWriter::create(&taken, &info).unwrap();
    for i in 0..120_u64 {
        let datagram: Vec<u8> =
            [0.01 * i as f64, 0.0, 5.0, 0.0, 0.0, 0.0].iter().flat_map(|v| v.to_le_bytes()).collect();
        writer.raw(info.start_time_ns + i * 25_000_000, &datagram).unwrap();
    }
    writer.finish().unwrap();
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/generators/blur.onnx");
    let tables = format!(
        "[tracker]\ntransport = 'recording'\nrecording = '{}'\n[generator]\nmodels = ['{}']\nbudget_ms = 5000\n",
        taken.display(),
        model.display()
    );
    let station = small_station(dir.path(), &tables);
    let (kept, metrics) = (dir.path().join("kept.mcap"), dir.path().join("frames.jsonl"));
    let paths = [&kept, &metrics].map(|path| path.to_str().unwrap().to_owned());
    let done = insonify(&["run", &station, "--record", &paths[0], "--metrics", &paths[1], "--json"]).output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let summary: Value = serde_json::from_slice(&done.stdout).unwrap();
    assert!(summary["enhanced_ratio"].as_f64().unwrap() > 0.0, "{summary}");
    let sums: Vec<_> = [&taken, &kept].into_iter().map(|path| poses(path).unwrap()).collect();
    assert_eq!(sums[1].1.info.protocol, Protocol::OpenTrack);
    assert_eq!(
        sums[0].0.iter().map(|p| p.pose).collect::<Vec<_>>(),
        sums[1].0.iter().map(|p| p.pose).collect::<Vec<_>>()
    );
}
