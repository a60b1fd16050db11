//! Fakes of everything that a session uses: device, poses, generator, sinks, observer.

use super::*;

pub(super) const MS: Duration = Duration::from_millis(1);
pub(super) const SECOND: Duration = Duration::from_secs(1);
pub(super) const SHAPE: ImageShape = ImageShape { width: 8, height: 4, pixel_mm: 0.5 };
pub(super) const PIXELS: usize = 32;

/// Masks of a frame that carry a number (0 to 255) in every pixel. They are shared, like those of a renderer.
static MASKS: LazyLock<Vec<Arc<[u8]>>> =
    LazyLock::new(|| (0..=255).map(|tenths| std::iter::repeat_n(tenths, PIXELS).collect()).collect());

pub(super) fn clock() -> Arc<dyn Clock> {
    Arc::new(SimulatedClock::new())
}

pub(super) fn pose(x: f64) -> Pose {
    Pose { position_mm: DVec3::X * x, orientation: DQuat::IDENTITY }
}

/// Contact of the probe's face with the skin at a time.
pub(super) type Touch = dyn Fn(Duration) -> Option<Contact> + Send + Sync;

pub(super) type Extra = dyn Fn(Duration, FrameQuality) -> Duration + Send + Sync;

/// Processors that frames and generator runs share if there is no other device.
#[derive(Default)]
pub(super) struct Processors {
    pub(super) at_work: AtomicU64,
    /// Number of times that a frame and a generator run were computed at once.
    pub(super) shared: AtomicU64,
}

impl Processors {
    pub(super) fn work(&self, clock: &Arc<dyn Clock>, time: Duration) {
        let others = self.at_work.fetch_add(1, Ordering::Relaxed);
        self.shared.fetch_add(others, Ordering::Relaxed);
        clock.sleep_until(clock.now() + time);
        self.at_work.fetch_sub(1, Ordering::Relaxed);
    }
}

/// A GPU on bus `bus`. The fakes render frames on bus 1 and run generators on bus 2.
pub(super) fn gpu(bus: u8) -> ComputeDevice {
    ComputeDevice::Gpu { vendor: None, address: PciAddress::parse(&format!("0000:{bus:02x}:00.0")) }
}

/// Start and end of each frame's or run's work on a device.
pub(super) type Busy = Arc<Mutex<Vec<(Duration, Duration)>>>;

/// Needle of each submitted frame.
pub(super) type Needles = Arc<Mutex<Vec<Option<Needle>>>>;

/// A device that renders one frame after another, each in `service`, and fails at the frames that `faults` chooses.
pub(super) struct Device {
    pub(super) clock: Arc<dyn Clock>,
    pub(super) service: Duration,
    /// Time beyond `service` that a frame takes, by current time and quality.
    pub(super) extra: Arc<Extra>,
    pub(super) quality: Quality,
    /// For each frame in flight: completion time, pose, whether it has maps, and scene time, s.
    pub(super) in_flight: VecDeque<(Duration, Pose, bool, f64)>,
    pub(super) time_s: f64,
    pub(super) maps: bool,
    pub(super) free: Duration,
    pub(super) received: Arc<AtomicU64>,
    pub(super) faults: Arc<dyn Fn(u64) -> bool + Send + Sync>,
    pub(super) gain_db: f64,
    /// Processors that compute the frames in `submit`, if the device is these.
    pub(super) processors: Option<Arc<Processors>>,
    /// Compute device of a renderer that does not use the processors.
    pub(super) compute_device: ComputeDevice,
    /// List to which the start and end of each frame are appended, if wanted.
    pub(super) busy: Option<Busy>,
    /// Contact of the probe's face with the skin over time.
    pub(super) contact: Arc<Touch>,
    /// Needle of the next frame.
    pub(super) needle: Option<Needle>,
    /// List to which the needle of each submitted frame is appended, if wanted.
    pub(super) needles: Option<Needles>,
}

impl FrameRenderer for Device {
    fn shape(&self) -> ImageShape {
        SHAPE
    }

    fn renders_in_submit(&self) -> bool {
        self.processors.is_some()
    }

    fn compute_device(&self) -> ComputeDevice {
        if self.processors.is_some() { ComputeDevice::Processors } else { self.compute_device }
    }

    fn submit(&mut self, pose: &Pose) -> Result<(), RenderFault> {
        assert!(self.in_flight.len() < 2, "two in flight at most");
        let quality = FrameQuality::new(self.quality.rays, self.quality.layers);
        let extra = (self.extra)(self.clock.now(), quality);
        let begins = self.free.max(self.clock.now());
        self.free = begins + self.service + extra;
        if let Some(busy) = &self.busy {
            busy.lock().unwrap().push((begins, self.free));
        }
        if let Some(processors) = &self.processors {
            processors.work(&self.clock, self.service + extra);
        }
        self.in_flight.push_back((self.free, *pose, self.maps, self.time_s));
        self.needles.iter().for_each(|needles| needles.lock().unwrap().push(self.needle));
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
        frame.contact = (self.contact)(done);
        for map in [&mut frame.bmode, &mut frame.segmentation] {
            map.clear();
            map.resize(PIXELS, 1 + self.gain_db as u8);
        }
        // Scene time in tenths of a second.
        frame.mask = MASKS[usize::from((10.0 * time_s) as u8)].clone();
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

    fn set_needle(&mut self, needle: Option<Needle>) {
        self.needle = needle;
    }

    fn skin_distance_mm(&self, _: &Pose) -> Option<f64> {
        Some(300.0)
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

/// Builds the device anew; the first `failures` attempts fail.
pub(super) struct Factory {
    pub(super) clock: Arc<dyn Clock>,
    pub(super) device: Box<dyn Fn() -> Device + Send>,
    pub(super) failures: u32,
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

pub(super) struct Poses<F>(pub(super) F);

impl<F: FnMut(Duration) -> Estimate + Send> PoseSource for Poses<F> {
    fn sample(&mut self, now_ns: u64, display_ns: u64) -> Estimate {
        assert!(display_ns >= now_ns);
        (self.0)(Duration::from_nanos(now_ns - START_NS))
    }
}

pub(super) const START_NS: u64 = 1_767_225_600_000_000_000;

/// Estimate of a tracker at x, whose newest record's first byte came 5 ms before.
pub(super) fn tracked(now: Duration, x: f64) -> Estimate {
    Estimate {
        scene_from_probe: Some(pose(x)),
        state: TrackingState::Good,
        first_byte_ns: Some((START_NS + now.as_nanos() as u64).saturating_sub(5_000_000)),
        ..Estimate::default()
    }
}

/// Estimate of a probe that moves along x at 20 mm/s.
pub(super) fn moving(now: Duration) -> Estimate {
    tracked(now, 20.0 * now.as_secs_f64())
}

pub(super) fn resting(now: Duration) -> Estimate {
    tracked(now, 0.0)
}

pub(super) struct Translate<F> {
    pub(super) work: F,
    pub(super) terminator: Option<Terminator>,
    pub(super) compute_device: ComputeDevice,
}

impl<F: FnMut(&Frame, &mut Vec<u8>) -> Result<(), GenerateError> + Send> FrameGenerators for Translate<F> {
    fn name(&self, _: usize) -> &str {
        "fake"
    }

    fn compute_device(&self) -> ComputeDevice {
        self.compute_device
    }

    fn generate(&mut self, _: usize, frame: &Frame, out: &mut Vec<u8>) -> Result<(), GenerateError> {
        (self.work)(frame, out)
    }

    fn terminator(&self) -> Option<Terminator> {
        self.terminator.clone()
    }
}

/// A controller with the generator `fake` at the default quality, on a device of its own.
pub(super) fn with_generator() -> PointController {
    let of = |generator: Option<usize>, error, run_ms| {
        let (quality, error) = (FrameQuality::of(&RenderSettings::default()), BySpeed::all(error));
        Candidate { quality, generator, error, render_ms: 20.0, run_ms }
    };
    let budget = FrameBudget { frame_ms: None, run_ms: 1000.0, apart: true, spread: 1.0 };
    PointController::new(vec![of(Some(0), 1.0, 1.0), of(None, 2.0, 0.0)], vec!["fake".to_owned()], budget).unwrap()
}

/// A generator that calls `work` in each run, on a device of its own.
pub(super) fn translate(
    work: impl FnMut(&Frame, &mut Vec<u8>) -> Result<(), GenerateError> + Send + 'static,
) -> Box<dyn FrameGenerators> {
    Box::new(Translate { work, terminator: None, compute_device: gpu(2) })
}

/// A generator that takes `time` per run and paints every pixel 200.
pub(super) fn generator(clock: &Arc<dyn Clock>, time: Duration) -> Box<dyn FrameGenerators> {
    let clock = clock.clone();
    let work = move |frame: &Frame, out: &mut Vec<u8>| {
        clock.sleep_until(clock.now() + time);
        out.resize(frame.bmode.len(), 200);
        Ok(())
    };
    translate(work)
}

pub(super) struct Sink<F> {
    pub(super) name: &'static str,
    pub(super) maps: Option<MapsWanted>,
    pub(super) take: F,
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
}

pub(super) fn sink(
    name: &'static str,
    take: impl FnMut(&PresentedFrame) -> Result<(), SinkError> + Send + 'static,
) -> Box<dyn LiveSink> {
    Box::new(Sink { name, maps: None, take })
}

pub(super) fn broken() -> SinkError {
    SinkError::FrameRate { fps: 0.0 }
}

/// What an observer received: events and changes of marks, the numbers of poses and settings, and the last settings.
#[derive(Default)]
pub(super) struct Counted {
    pub(super) tip: Vec<(u64, NeedleEvent)>,
    pub(super) events: Vec<(u64, String)>,
    pub(super) poses: u64,
    pub(super) settings: u64,
    pub(super) last: Option<LiveSettings>,
    /// Each change of marks: the time since the start of the session, ns, and the control.
    pub(super) marks: Vec<(u64, Control)>,
}

#[derive(Default)]
pub(super) struct Heard(pub(super) Mutex<Counted>);

impl Observer for Heard {
    fn event(&self, unix_ns: u64, text: &str) {
        self.0.lock().unwrap().events.push((unix_ns, text.to_owned()));
    }

    fn pose(&self, _: u64, _: &Estimate) {
        self.0.lock().unwrap().poses += 1;
    }

    fn tip(&self, unix_ns: u64, event: &NeedleEvent) {
        self.0.lock().unwrap().tip.push((unix_ns, event.clone()));
    }

    fn settings(&self, _: u64, settings: &LiveSettings) {
        let mut heard = self.0.lock().unwrap();
        heard.settings += 1;
        heard.last = Some(*settings);
    }

    fn marks(&self, unix_ns: u64, start_unix_ns: u64, control: &Control) {
        self.0.lock().unwrap().marks.push((unix_ns - start_unix_ns, control.clone()));
    }
}
