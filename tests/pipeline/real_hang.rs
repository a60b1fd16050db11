//! A device that stops answering in a live session of the real renderer: software Vulkan, kept busy by an injected
//! dispatch.
//!
//! Times depend on the load of the machine, so they are printed and not asserted. Counts and orders are asserted: a
//! picture follows while the hang still lasts.

use insonify::pipeline::{LiveStation, LocalRendererFactory, RecordedSlot, TrackedPoses};
use insonify::recording::{DecodedRecording, Item, Recorded, RecordingReader, RecordingSummary, read_all, stream_of};
use insonify::render::{Backend, BackendChoice, ComputeDevice, InjectedHang};
use insonify::station::Station;

use super::program::small_station;
use super::*;

/// Number of pictures before the hang.
const BEFORE: usize = 15;
/// Number of pictures after the hang that end the session.
const AFTER: usize = 10;

/// A presented frame.
#[derive(Debug)]
struct Shown {
    number: u64,
    presented: Duration,
    /// Pose of the picture; `None` for a black frame.
    pose: Option<Pose>,
    is_black: bool,
    notice: Option<String>,
    /// Whether the hang had begun when the frame was presented.
    begun: bool,
    /// Whether the device hung when the frame was presented.
    hangs: bool,
}

/// Numbers of poses and events that the session passed to the recorder.
#[derive(Default)]
struct Told {
    poses: AtomicU64,
    events: AtomicU64,
}

/// Observer that counts what it is told, and passes it on to a recording.
struct Counting {
    told: Arc<Told>,
    recording: Arc<dyn Observer>,
}

impl Observer for Counting {
    fn event(&self, unix_ns: u64, text: &str) {
        self.told.events.fetch_add(1, Ordering::Relaxed);
        self.recording.event(unix_ns, text);
    }

    fn pose(&self, unix_ns: u64, estimate: &Estimate) {
        self.told.poses.fetch_add(u64::from(estimate.scene_from_probe.is_some()), Ordering::Relaxed);
        self.recording.pose(unix_ns, estimate);
    }

    fn settings(&self, unix_ns: u64, settings: &LiveSettings) {
        self.told.events.fetch_add(1, Ordering::Relaxed);
        self.recording.settings(unix_ns, settings);
    }
}

/// Result of a session in which the device hung.
struct Outcome {
    frames: Vec<Shown>,
    /// Duration of the hang, s.
    lasted_s: f64,
    summary: Summary,
    told: Arc<Told>,
    measurements: u64,
    recorded: Recorded,
    read: RecordingSummary,
    read_poses: Vec<Pose>,
}

/// A sink that injects the hang after [`BEFORE`] pictures. It ends the session [`AFTER`] pictures after a black frame,
/// or after the hang.
fn watching(hang: &InjectedHang, stop: &Stop, shown: &Arc<Mutex<Vec<Shown>>>) -> Box<dyn LiveSink> {
    let (hang, stop, shown, mut after) = (hang.clone(), stop.clone(), shown.clone(), 0);
    sink("watching", move |frame| {
        let is_black = frame.image.iter().all(|grey| *grey == 0);
        let mut shown = shown.lock().unwrap();
        let hangs = hang.lasts();
        let begun = hang.has_begun();
        shown.push(Shown {
            number: frame.number,
            presented: frame.info.timeline.presented,
            pose: frame.info.pose(),
            is_black,
            notice: frame.notice.clone(),
            begun,
            hangs,
        });
        let pictures = shown.iter().filter(|frame| !frame.is_black).count();
        if pictures == BEFORE && !is_black {
            hang.inject();
        }
        let given_up = shown.iter().any(|frame| frame.is_black && frame.begun);
        after += usize::from(begun && !is_black && (given_up || !hangs));
        if after == AFTER {
            stop.request("enough pictures after the hang");
        }
        Ok(())
    })
}

/// Whether the device is software; only such a device has known limits and speeds.
fn is_software() -> bool {
    Backend::open(BackendChoice::Device).unwrap().compute_device() == ComputeDevice::Processors
}

/// Runs a live session of a small station with a mock tracker and a recording, on a device that hangs for about `hang`.
fn session_that_hangs(hang: Duration, limit: Option<Duration>) -> Outcome {
    let _guard = beside_others();
    let directory = tempfile::tempdir().unwrap();
    let tables = "[tracker]\ntransport = 'mock'\nschedule = 'move 600'\n[pipeline]\nframe_rate_hz = 20.0\n";
    let path = small_station(directory.path(), tables);
    // A frame that takes little time, also where others take the processors.
    let text = std::fs::read_to_string(&path).unwrap();
    let text = text
        .replace("scanlines = 32", "scanlines = 16")
        .replace("width = 160\nheight = 120", "width = 80\nheight = 60");
    std::fs::write(&path, text + "[effects]\naperture = 'off'\nelevational_speckle = 'off'\n").unwrap();
    let mut station = Station::load(Path::new(&path)).unwrap();
    let scene = Arc::new(station.load_scene_from(station.scene_file().unwrap()).unwrap());
    let device = Backend::open(BackendChoice::Device).unwrap();
    let device = limit.into_iter().fold(device, Backend::answering_within);
    let (device, hang) = device.with_hang(hang).unwrap();
    let tracked = TrackedPoses::of_station(&station).unwrap().unwrap();
    let stream = stream_of(&station.tracker).unwrap();

    let factory = LocalRendererFactory::new(device.clone(), scene).unwrap();
    let mut live = LiveStation::new(&mut station, factory, tracked.clone(), None, false).unwrap();
    // The only handles that are left are those of the session and of the hang.
    let adapter = device.name();
    drop(device);
    let recording = directory.path().join("hang.mcap");
    let slot: RecordedSlot = live.record(&recording, &station, stream, &adapter).unwrap();
    let told = Arc::<Told>::default();
    let inner = live.parts.observer.take().unwrap();
    live.parts.observer = Some(Arc::new(Counting { told: told.clone(), recording: inner }));
    live.track(&tracked, &station.tracker).unwrap();
    let shown = Arc::<Mutex<Vec<Shown>>>::default();
    live.parts.sinks.push(watching(&hang, &live.parts.stop, &shown));
    let limits = Limits { duration: Some(120 * SECOND), frames: None };
    let summary = Pipeline::run(&station.pipeline, limits, live.parts, |_| ()).unwrap();

    // What the device was given up for ends some time; the process must live with it, and others need the processors.
    let started = std::time::Instant::now();
    while hang.lasts() && started.elapsed() < 120 * SECOND {
        std::thread::sleep(20 * MS);
    }
    assert!(hang.has_begun() && !hang.lasts(), "the hang ends");
    let recorded = slot.lock().unwrap().take().unwrap();
    let (_, read) = read_all(RecordingReader::open(&recording).unwrap()).unwrap();
    let mut decoded = DecodedRecording::new(RecordingReader::open(&recording).unwrap());
    let mut read_poses = Vec::new();
    while let Some(item) = decoded.next_item().unwrap() {
        if let Item::Pose(pose) = item {
            read_poses.push(pose.pose);
        }
    }
    let frames = std::mem::take(&mut *shown.lock().unwrap());
    let lasted_s = hang.lasted().unwrap().as_secs_f64();
    Outcome {
        frames,
        lasted_s,
        summary,
        told,
        measurements: tracked.counters().measurements,
        recorded,
        read,
        read_poses,
    }
}

/// Asserts that every sample of the tracker, and the pose of every frame, is in the recording.
fn nothing_recorded_is_lost(outcome: &Outcome) {
    let Outcome { frames, summary, told, measurements, recorded, read, read_poses, .. } = outcome;
    all_counted(summary);
    assert!(summary.stuck.is_empty(), "{:?}", summary.stuck);
    assert!(recorded.failure.is_none(), "{:?}", recorded.failure);
    assert!(read.is_clean(), "{read}");
    assert_eq!((read.messages, read.bytes), (recorded.messages, recorded.bytes));
    assert_eq!(read.records, *measurements, "each record that the estimator has taken is in the file");
    let told = [&told.poses, &told.events].map(|count| count.load(Ordering::Relaxed));
    assert_eq!([recorded.poses, read.session_poses, read_poses.len() as u64], [told[0]; 3]);
    // The tracker's own events are beside the session's.
    assert_eq!(read.events.len() as u64, recorded.events);
    let of_session = |event: &&insonify::recording::Event| matches!(&*event.name, "session" | "settings");
    assert_eq!(read.events.iter().filter(of_session).count() as u64, told[1]);
    // A pose is written in metres.
    let same = |a: &Pose, b: &Pose| {
        (a.position_mm - b.position_mm).length() < 1e-9 && (1.0 - a.orientation.dot(b.orientation).abs()) < 1e-12
    };
    let mut rest = read_poses.iter();
    for frame in frames.iter().filter(|frame| frame.pose.is_some()) {
        let pose = frame.pose.unwrap();
        assert!(rest.any(|read| same(read, &pose)), "the pose of frame {} is in the file, in its order", frame.number);
    }
}

/// Time from the last picture before the hang to the next picture, s.
fn gap_s(frames: &[Shown]) -> f64 {
    let pictures: Vec<_> = frames.iter().filter(|frame| !frame.is_black).collect();
    let gap = pictures.windows(2).map(|pair| pair[1].presented - pair[0].presented).max().unwrap();
    gap.as_secs_f64()
}

#[test]
fn pictures_go_on_while_the_old_device_still_hangs_and_nothing_recorded_is_lost() {
    let outcome = session_that_hangs(12 * SECOND, Some(500 * MS));
    let Outcome { frames, summary, .. } = &outcome;
    let (gap_s, lasted_s) = (gap_s(frames), outcome.lasted_s);
    eprintln!("{gap_s:.2} s without a picture of a hang of {lasted_s:.2} s; devices lost: {}", summary.device_losses);
    assert!(summary.device_losses >= 1 && summary.device_rebuilt >= 1, "{summary:?}");
    let first_black = frames.iter().position(|frame| frame.is_black && frame.begun).unwrap();
    let (before, after) = frames.split_at(first_black);
    assert!(before.iter().filter(|frame| !frame.is_black).count() >= BEFORE);
    let notice = |frame: &Shown| frame.notice.as_ref().is_some_and(|text| text.contains("did not answer within 0.5 s"));
    assert!(notice(&after[0]), "a black frame says why: {:?}", after[0]);
    assert!(after[0].pose.is_none() && after[0].hangs, "{:?}", after[0]);
    let on = after.iter().filter(|frame| !frame.is_black && frame.pose.is_some() && frame.hangs).count();
    assert!(on >= AFTER / 2, "pictures of the new device while the old one hangs: {on}: {after:?}");
    assert!(frames.windows(2).all(|pair| pair[1].number > pair[0].number && pair[1].presented > pair[0].presented));
    let said = |words: &str| {
        outcome.read.events.iter().any(|event| {
            event.name == "session"
                && event.value.as_ref().and_then(Value::as_str).is_some_and(|text| text.contains(words))
        })
    };
    assert!(said("did not answer within 0.5 s") && said("the renderer was built anew"));
    nothing_recorded_is_lost(&outcome);
}

#[test]
fn without_a_limit_no_picture_comes_before_the_hang_is_over() {
    if !is_software() {
        return;
    }
    let outcome = session_that_hangs(3 * SECOND, None);
    let Outcome { frames, summary, .. } = &outcome;
    let (gap_s, lasted_s) = (gap_s(frames), outcome.lasted_s);
    eprintln!("{gap_s:.2} s without a picture of a hang of {lasted_s:.2} s");
    assert_eq!(summary.device_losses, 0, "software may take any time");
    // A frame that was done before the hang may be handed on after its begin.
    let hanging = frames.iter().filter(|frame| frame.hangs).count();
    assert!(hanging <= 3, "{hanging} frames during the hang");
    assert!(2.0 * gap_s > lasted_s, "{gap_s:.2} s of {lasted_s:.2} s");
    nothing_recorded_is_lost(&outcome);
}
