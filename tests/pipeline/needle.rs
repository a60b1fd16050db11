//! A second tracked tool: what each frame shows of it, what its tip does, what is recorded, and what a replay makes of the
//! recording.

use insonify::anatomy::{TissueTable, analytic};
use insonify::exam::needle::{Approach, Exercise, Region, TIP_EVENT};
use insonify::needle::TipWatch;
use insonify::pipeline::replay::{FrameRange, Replay, ReplayOptions};
use insonify::pipeline::{RecordingObserver, ReplayedPoses, TrackedPoses, WithStandingNeedle};
use insonify::pose::{Estimator, Measurement, Reading, Settings as PoseSettings};
use insonify::recording::{Event, QueueLimits, Recorder, RecordingInfo, RecordingReader, RecordingWriter, read_tools};
use insonify::sink::FrameRate;
use insonify::station::Station;
use insonify::tracker::NeedleSensor;
use insonify::{Scene, glam::Vec3};

use super::program::{insonify, small_station};
use super::*;

/// Time without measurements of the needle. Its tracking is lost 2 s after the last one.
const SILENT: std::ops::Range<Duration> = Duration::from_secs(3)..Duration::from_secs(7);

/// Measurements of a tool at 60 Hz for 10 s, except at times in `silent`, moving along x from `x` at 5 mm/s.
fn measurements(x: f64, silent: &std::ops::Range<Duration>) -> Vec<Measurement> {
    let times = (0..600).map(|i| Duration::from_micros(16_667 * i)).filter(|time| !silent.contains(time));
    let measurement = |time: Duration| {
        let reading = Reading::Pose(pose(x + 5.0 * time.as_secs_f64()));
        let host_time_ns = START_NS + time.as_nanos() as u64;
        Measurement { host_time_ns, device_time_us: None, sequence: None, reading }
    };
    times.map(measurement).collect()
}

/// A tracker of two tools that pass through estimators of their own.
struct Tools {
    probe: ReplayedPoses,
    needle: ReplayedPoses,
}

impl Tools {
    fn new(silent: &std::ops::Range<Duration>) -> Self {
        let replayed = |measurements| ReplayedPoses::new(Estimator::new(PoseSettings::default()), measurements, &[]);
        Self {
            probe: replayed(measurements(0.0, &(Duration::ZERO..Duration::ZERO))),
            needle: replayed(measurements(100.0, silent)),
        }
    }
}

impl PoseSource for Tools {
    fn sample(&mut self, now_ns: u64, _: u64) -> Estimate {
        self.probe.at(now_ns)
    }

    fn sample_needle(&mut self, now_ns: u64, _: u64) -> Option<NeedleEstimate> {
        Some(NeedleEstimate::of(&self.needle.at(now_ns), false))
    }
}

fn x_of(needle: Option<Needle>) -> Option<f64> {
    needle.map(|needle| needle.tip_mm().x)
}

/// Balls of 4 mm on the needle's way, with an exercise that forbids the second one.
fn balls() -> (Scene, Exercise) {
    let ball = |name, x| analytic::Part {
        name,
        tissue: "soft_tissue",
        priority: 1,
        mesh: analytic::sphere(Vec3::new(x, 0.0, 0.0), 4.0, 4),
    };
    let parts = vec![ball("cyst", 110.0), ball("artery", 140.0)];
    let scene = analytic::scene(parts, &TissueTable::builtin().unwrap(), "gel").unwrap();
    let exercise = Exercise {
        name: "Cyst".into(),
        target: Region::Surface("cyst".into()),
        entry: None,
        forbidden: vec!["artery".into()],
        approach: Approach::Any,
        time_s: 30.0,
    };
    (scene, exercise)
}

/// Runs a session of two tools. Returns its frames, and the needle of each submitted frame.
fn session(
    control: Option<(Duration, Duration)>,
    observer: Option<Arc<dyn Observer>>,
) -> (Vec<PresentedFrame>, Vec<Option<Needle>>) {
    let (frames, needles, _) = session_of(Tools::new(&SILENT), control, observer);
    (frames, needles)
}

/// Runs a session of these tools, whose picture is frozen as `control` says. Also returns its summary.
fn session_of(
    tools: Tools,
    control: Option<(Duration, Duration)>,
    observer: Option<Arc<dyn Observer>>,
) -> (Vec<PresentedFrame>, Vec<Option<Needle>>, Summary) {
    let clock = clock();
    let (frames, needles) = (Arc::<Mutex<Vec<PresentedFrame>>>::default(), Needles::default());
    let (sender, controls) = tokio::sync::mpsc::channel(4);
    let kept = frames.clone();
    let display = sink("display", move |frame| {
        let now = frame.info.timeline.presented;
        if let Some((from, to)) = control {
            let frozen = (from..to).contains(&now);
            if frozen != frame.info.settings.frozen {
                let _ = sender.try_send(Control::Set(vec![Assignment::new("frozen", f64::from(u8::from(frozen)))]));
            }
        }
        kept.lock().unwrap().push(frame.clone());
        Ok(())
    });
    let (scene, exercise) = balls();
    let watch = NeedleWatch::new(TipWatch::new(&scene).unwrap(), &scene, Some(&exercise));
    let session = Session {
        poses: Box::new(tools),
        needle: Some(watch),
        sinks: vec![display],
        needles: Some(needles.clone()),
        controls,
        observer,
        ..Session::new(&clock, resting)
    };
    let summary = session.run();
    let frames = Arc::into_inner(frames).unwrap().into_inner().unwrap();
    let needles = std::mem::take(&mut *needles.lock().unwrap());
    (frames, needles, summary)
}

#[test]
fn a_lost_needle_never_stops_the_picture() {
    let _guard = beside_others();
    let heard = Arc::new(Heard::default());
    let (frames, needles) = session(None, Some(heard.clone()));
    assert!(frames.iter().skip(1).all(|frame| frame.info.pose().is_some()), "the probe's picture goes on");
    let mut seen: Vec<TrackingState> = Vec::new();
    for frame in &frames {
        let needle = frame.info.needle.unwrap();
        if seen.last() != Some(&needle.state) {
            seen.push(needle.state);
        }
        assert_eq!(needle.needle.is_none(), needle.state == TrackingState::Lost);
        assert!(needle.needle.is_none_or(|needle| !needle.bevel_known));
        if let (TrackingState::Good, Some(x)) = (needle.state, x_of(needle.needle)) {
            let expected = 100.0 + 5.0 * frame.info.timeline.sampled.as_secs_f64();
            assert!((x - expected).abs() < 1.0, "{x} {expected}");
        }
    }
    use TrackingState::{Good, Held, Lost, Stale};
    // At 20 frames a second, three measurements come between two frames, so none shows the first after the silence.
    assert_eq!(seen[seen.len() - 5..], [Good, Held, Stale, Lost, Good], "{seen:?}");
    // A frame is rendered with the needle that it says.
    let lost = needles.iter().filter(|needle| needle.is_none()).count();
    let said = frames.iter().filter(|frame| frame.info.needle.unwrap().needle.is_none()).count();
    assert!(lost > 15 && lost.abs_diff(said) <= 2, "{lost} {said}");
    let heard = heard.0.lock().unwrap();
    let events: Vec<&str> =
        heard.events.iter().map(|(_, text)| text.as_str()).filter(|t| t.contains("needle")).collect();
    let last = &events[events.len() - 3..];
    assert_eq!(
        last,
        [
            "the needle's sensor is silent: the picture shows the needle's last pose",
            "needle lost: the picture goes on without it",
            "needle tracked"
        ]
    );
    assert!(!heard.events.iter().any(|(_, text)| text == "tracking lost"), "the probe's tracking is its own");
}

#[test]
fn the_events_of_the_tip_are_on_the_frames_and_told() {
    let _guard = beside_others();
    let heard = Arc::new(Heard::default());
    let (frames, _, summary) = session_of(Tools::new(&SILENT), None, Some(heard.clone()));
    let counts = summary.needle.as_ref().unwrap();
    assert_eq!((counts.events["target-reached"], counts.forbidden), (1, 1), "{counts:?}");
    assert!(counts.offered > 100 && counts.dropped < counts.offered, "{counts:?}");
    assert!(summary.to_string().contains("(1 forbidden), target reached 1 times"), "{summary}");
    let told = heard.0.lock().unwrap();
    let kinds: Vec<_> = told.tip.iter().map(|(_, event)| (event.kind.name(), event.surface.as_deref())).collect();
    let expected = [
        ("entered", Some("cyst")),
        ("target-reached", None),
        ("out-of-slice", None),
        ("left", Some("cyst")),
        ("entered", Some("artery")),
    ];
    assert_eq!(kinds[..5], expected, "{kinds:?}");
    // The needle moves at 5 mm/s from x = 100 mm, and is not silent before 3 s.
    let (unix_ns, entry) = &told.tip[0];
    assert!((entry.position_mm.x - 106.0).abs() < 0.05 && (entry.time_s - 1.2).abs() < 0.2, "{entry:?}");
    assert_eq!(*unix_ns, START_NS + (entry.time_s * 1e9) as u64);
    let told_of = |line: &String| line[line.find(':').unwrap()..].to_owned();
    let lines = |frame: &PresentedFrame| frame.tip_events.iter().map(told_of).collect::<Vec<_>>();
    assert!(frames.first().is_some_and(|frame| frame.tip_events.is_empty()));
    let last = frames.last().map(lines).unwrap();
    assert_eq!(last[0], ": entered cyst");
    assert!(last.iter().any(|line| line == ": entered artery, which is forbidden"), "{last:?}");
    let notice = "needle: entered artery, which is forbidden";
    assert!(frames.iter().any(|frame| frame.notice.as_deref() == Some(notice)));
}

#[test]
fn nothing_happens_in_a_frozen_picture_and_none_of_it_afterwards() {
    let _guard = beside_others();
    let heard = Arc::new(Heard::default());
    // The needle leaves the cyst 2.8 s after the start.
    let frozen = (2 * SECOND, Duration::from_millis(2900));
    session_of(Tools::new(&SILENT), Some(frozen), Some(heard.clone()));
    let told = heard.0.lock().unwrap();
    assert!(told.tip.iter().any(|(_, event)| event.surface.as_deref() == Some("cyst")));
    assert!(told.tip.iter().all(|(_, event)| event.kind.name() != "left" || event.time_s > 3.0), "{:?}", told.tip);
    assert!(told.tip.iter().all(|(_, event)| !(2.2..2.9).contains(&event.time_s)), "{:?}", told.tip);
}

#[test]
fn a_needle_that_was_silent_goes_no_straight_way_back() {
    let _guard = beside_others();
    let heard = Arc::new(Heard::default());
    // Outside the artery before the silence, and inside it afterwards. It is stale meanwhile, and never lost.
    let silent = Duration::from_millis(6500)..Duration::from_millis(8000);
    let (frames, ..) = session_of(Tools::new(&silent), None, Some(heard.clone()));
    let states: Vec<TrackingState> = frames.iter().map(|frame| frame.info.needle.unwrap().state).collect();
    assert!(states.contains(&TrackingState::Stale) && !states[20..].contains(&TrackingState::Lost));
    let told = heard.0.lock().unwrap();
    let of_artery = told.tip.iter().filter(|(_, event)| event.surface.as_deref() == Some("artery"));
    assert_eq!(of_artery.map(|(_, event)| event.kind.name()).collect::<Vec<_>>(), ["left"]);
}

#[test]
fn a_frozen_picture_keeps_its_needle() {
    let _guard = beside_others();
    let (frames, _) = session(Some((SECOND, 2 * SECOND)), None);
    let frozen: Vec<&PresentedFrame> = frames.iter().filter(|frame| frame.info.settings.frozen).collect();
    assert!(frozen.len() > 10);
    let shown = |frame: &PresentedFrame| (frame.info.pose(), frame.info.needle.unwrap().needle);
    assert!(frozen.iter().all(|frame| shown(frame) == shown(frozen[0])));
    let before = frames.iter().rfind(|frame| frame.number < frozen[0].number).unwrap();
    assert_eq!(shown(frozen[0]), shown(before));
    let after = frames.iter().find(|frame| frame.number > frozen[frozen.len() - 1].number).unwrap();
    assert!(x_of(shown(after).1) > x_of(shown(frozen[0]).1));
}

#[test]
fn a_recording_keeps_the_tools_apart() {
    let _guard = beside_others();
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("session.mcap");
    let info =
        RecordingInfo { needle: Some(NeedleSensor::Number(1)), start_time_ns: START_NS, ..RecordingInfo::default() };
    let mut writer = RecordingWriter::create(&path, &info).unwrap();
    writer.raw(START_NS, b"\n").unwrap();
    let recorder = Recorder::start(writer, QueueLimits::default()).unwrap();
    let (frames, _) = session(None, Some(Arc::new(RecordingObserver(recorder.handle()))));
    let recorded = recorder.finish();
    assert!(recorded.failure.is_none() && recorded.needle_poses > 100 && recorded.poses > recorded.needle_poses);
    let tools = read_tools(RecordingReader::open(&path).unwrap()).unwrap();
    assert_eq!(tools.summary.info, info);
    assert_eq!(
        (tools.probe.used.len() as u64, tools.needle.used.len() as u64),
        (recorded.poses, recorded.needle_poses)
    );
    assert!(tools.probe.used.iter().all(|used| used.pose.position_mm.x < 90.0));
    assert!(tools.needle.used.iter().all(|used| used.pose.position_mm.x > 90.0));
    let of_tip = |event: &&Event| event.name.starts_with(TIP_EVENT);
    let of_tip: Vec<&Event> = tools.summary.events.iter().filter(of_tip).collect();
    assert!(of_tip.len() >= 4 && of_tip[0].name == "needle.entered", "{of_tip:?}");
    let value = of_tip[0].value.as_ref().unwrap();
    assert_eq!((&value["surface"], &value["tissue"]), (&"cyst".into(), &"soft_tissue".into()), "{value}");
    assert!((value["position_mm"][0].as_f64().unwrap() - 106.0).abs() < 0.05 && value.get("time_s").is_none());
    let good = |frame: &&PresentedFrame| frame.info.needle.unwrap().state == TrackingState::Good;
    let recorded_good = tools.needle.used.iter().filter(|used| used.state == TrackingState::Good).count();
    assert!(frames.iter().filter(good).count() <= recorded_good);
}

#[test]
fn a_needle_may_stand_still_in_any_session() {
    let _guard = beside_others();
    let needle = Needle { scene_from_needle: pose(7.0), bevel_known: true };
    let mut source = WithStandingNeedle { poses: Poses(resting), needle: Some(needle) };
    assert_eq!(source.sample_needle(START_NS, START_NS).unwrap().needle, Some(needle));
    let mut tracked = WithStandingNeedle { poses: Tools::new(&SILENT), needle: Some(needle) };
    assert_eq!(tracked.sample_needle(START_NS, START_NS).unwrap().state, TrackingState::Held);
    let mut none = TrackedPoses::new(Estimator::new(PoseSettings::default()));
    none.push_needle(&measurements(0.0, &SILENT)[0]);
    assert_eq!((none.sample_needle(START_NS, START_NS), none.needle_counters()), (None, None));
}

/// The chain of the program: a mock's two tools, recorded, inspected and replayed twice.
#[test]
fn the_program_records_a_needle_and_replays_it_bit_for_bit() {
    let _guard = beside_others();
    let dir = tempfile::tempdir().unwrap();
    let station = small_station(
        dir.path(),
        "[tracker]\ntransport = 'mock'\n[needle]\ngauge = 20\nposition_mm = [0, 0, 20]\n[pipeline]\nframe_rate_hz = 10\n",
    );
    let kept = dir.path().join("kept.mcap");
    let kept_path = kept.to_str().unwrap();
    let done = insonify(&["run", &station, "--record", kept_path, "--duration", "3", "--sink", "null", "--json"]);
    let summary = succeeded(done);
    let needle_records = summary["tracker"]["needle_records"].as_u64().unwrap();
    assert!(needle_records > 100 && summary["tracker"]["records"].as_u64().unwrap().abs_diff(needle_records) <= 1);
    assert_eq!(summary["tracker"]["other_sensors"], 0);

    let inspected = succeeded(insonify(&["inspect", kept_path, "--json"]));
    assert_eq!((&inspected["needle"]["sensor"], &inspected["sensor"]), (&1.into(), &0.into()));
    assert!(inspected["needle"]["poses"].as_u64().unwrap() > 100, "{inspected}");
    assert!(inspected["needle"]["session_poses"].as_u64().unwrap() > 0 && inspected["other_sensors"] == 0);
    let text = insonify(&["inspect", kept_path]).output().unwrap();
    assert!(String::from_utf8_lossy(&text.stdout).contains("needle     sensor 1: "));

    let replayed: Vec<Value> = ["a", "b"]
        .into_iter()
        .map(|name| {
            let out = dir.path().join(name);
            succeeded(insonify(&[
                "replay",
                kept_path,
                &station,
                "--fps",
                "5",
                "--out",
                out.to_str().unwrap(),
                "--json",
            ]));
            serde_json::from_slice(&std::fs::read(out.join("replay.json")).unwrap()).unwrap()
        })
        .collect();
    assert_eq!(replayed[0]["frames_sha256"], replayed[1]["frames_sha256"]);
    assert_eq!(replayed[0]["frames"], replayed[1]["frames"]);
    let frames = replayed[0]["frames"].as_array().unwrap();
    let depth_mm = |frame: &Value| frame["needle"]["position_mm"][2].as_f64();
    let (first, last) = (frames.iter().find_map(depth_mm).unwrap(), frames.iter().rev().find_map(depth_mm).unwrap());
    assert!(frames.len() > 10 && first < last && last < 21.0, "it goes in: {first} {last}");

    // The same bytes, without the station's needle.
    let mut without = Station::load(Path::new(&station)).unwrap();
    without.settings.needle = None;
    let rate = FrameRate::new(5.0).unwrap();
    let all = FrameRange { start: 0, end: None };
    let options =
        ReplayOptions { rate, frames: all, quality: None, seed: None, raw_poses: false, ignore_controls: false };
    let replay = Replay::read(&kept, without, &options).unwrap();
    assert!(replay.timeline.needles.iter().all(Option::is_none));
    assert_eq!(replay.timeline.poses.len(), frames.len());
}

/// The JSON that the program prints.
fn succeeded(mut command: std::process::Command) -> Value {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap_or(Value::Null)
}
