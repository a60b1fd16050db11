//! Session with fakes, and a log of its frames.

use super::*;

/// Data of a presented frame, kept by `logger`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Seen {
    pub(super) number: u64,
    pub(super) source: FrameSource,
    pub(super) first_pixel: u8,
    pub(super) x: Option<f64>,
    pub(super) tracking: TrackingState,
    pub(super) presented: Duration,
    pub(super) age: Duration,
    pub(super) frozen: bool,
    pub(super) scene_ds: u8,
    pub(super) notice: Option<String>,
    pub(super) generator: Option<String>,
}

pub(super) type Log = Arc<Mutex<Vec<Seen>>>;

pub(super) fn logger(log: &Log) -> Box<dyn LiveSink> {
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
            generator: frame.generator.clone(),
        });
        Ok(())
    };
    Box::new(Sink { name: "log", maps: Some(Arc::new(|| true)), take })
}

pub(super) fn seen(log: &Log) -> Vec<Seen> {
    std::mem::take(&mut log.lock().unwrap())
}

/// Parts of a session at 20 frames a second, on a device that takes 20 ms per frame.
pub(super) struct Session {
    pub(super) clock: Arc<dyn Clock>,
    pub(super) stop: Stop,
    pub(super) settings: PipelineSettings,
    pub(super) limits: Limits,
    pub(super) poses: Box<dyn PoseSource>,
    pub(super) service: Duration,
    pub(super) extra: Arc<Extra>,
    pub(super) points: Option<PointController>,
    pub(super) faults: Arc<dyn Fn(u64) -> bool + Send + Sync>,
    pub(super) build_failures: u32,
    pub(super) processors: Option<Arc<Processors>>,
    pub(super) compute_device: ComputeDevice,
    pub(super) busy: Option<Busy>,
    pub(super) contact: Arc<Touch>,
    pub(super) needles: Option<Needles>,
    pub(super) generators: Option<Box<dyn FrameGenerators>>,
    pub(super) needle: Option<NeedleWatch>,
    pub(super) sinks: Vec<Box<dyn LiveSink>>,
    pub(super) log: Option<FrameLog>,
    pub(super) controls: tokio::sync::mpsc::Receiver<Control>,
    pub(super) observer: Option<Arc<dyn Observer>>,
    pub(super) before: Vec<Box<dyn Part>>,
    pub(super) after: Vec<Box<dyn Part>>,
}

impl Session {
    pub(super) fn new(clock: &Arc<dyn Clock>, poses: impl FnMut(Duration) -> Estimate + Send + 'static) -> Self {
        let choice = ChoiceSettings { hold_mm: 0.3, hold_deg: 0.3, steady_frames: 8 };
        Self {
            clock: clock.clone(),
            stop: Stop::new(clock),
            settings: PipelineSettings {
                frame_rate_hz: 20.0,
                deadline_ms: 100.0,
                choice,
                hang_ms: 2000.0,
                device_hang_ms: 2000.0,
                finish_ms: 10_000.0,
            },
            limits: Limits { duration: Some(10 * SECOND), frames: None },
            poses: Box::new(Poses(poses)),
            service: 20 * MS,
            extra: Arc::new(|_, _| Duration::ZERO),
            points: None,
            faults: Arc::new(|_| false),
            build_failures: 0,
            processors: None,
            compute_device: gpu(1),
            busy: None,
            contact: Arc::new(|_| None),
            needles: None,
            generators: None,
            needle: None,
            sinks: Vec::new(),
            log: None,
            controls: tokio::sync::mpsc::channel(1).1,
            observer: None,
            before: Vec::new(),
            after: Vec::new(),
        }
    }

    pub(super) fn run(self) -> Summary {
        self.run_watched(|_| ())
    }

    pub(super) fn run_watched(self, watch: impl FnMut(&insonify::pipeline::Status)) -> Summary {
        let (received, clock, service, faults) =
            (Arc::<AtomicU64>::default(), self.clock.clone(), self.service, self.faults);
        let (extra, processors, compute_device, busy) = (self.extra, self.processors, self.compute_device, self.busy);
        let (contact, needles) = (self.contact, self.needles);
        let mut render = RenderSettings::default();
        if let Some(points) = &self.points {
            render = points.point().quality.apply(&render, Choice::Auto);
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
            compute_device,
            busy: busy.clone(),
            contact: contact.clone(),
            needle: None,
            needles: needles.clone(),
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
            points: self.points,
            aperture: Choice::Auto,
            generators: self.generators,
            needle: self.needle,
            sinks: self.sinks,
            log: self.log,
            controls: self.controls,
            observer: self.observer,
            tracker: None,
            before: self.before,
            after: self.after,
        };
        let summary = Pipeline::run(&self.settings, self.limits, parts, watch).unwrap();
        all_counted(&summary);
        summary
    }
}

/// Asserts that every frame is presented or counted as dropped.
#[track_caller]
pub(super) fn all_counted(summary: &Summary) {
    let drops: u64 = summary.drops.values().sum();
    assert_eq!(summary.produced, summary.presented + drops, "{:?}", summary.drops);
    assert_eq!(summary.ticks, summary.produced + summary.missed_ticks);
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

/// Number of changes between rendered and generated images, and whether a change is reversed at the very next frame.
pub(super) fn changes(frames: &[Seen]) -> (usize, bool) {
    let generated: Vec<bool> = frames.iter().map(|f| f.source != FrameSource::Raw).collect();
    let changes = generated.windows(2).filter(|w| w[0] != w[1]).count();
    (changes, generated.windows(3).any(|w| w[0] == w[2] && w[0] != w[1]))
}
