//! Live part of the demo, with the recorded exam. Bytes of the tracker pass through decoder, estimator, renderer and
//! generator to the page and to files.

use std::io::IsTerminal;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use insonify::anatomy::Scene;
use insonify::pipeline::{Limits, LiveStation, LocalRendererFactory, Stop, Summary, TrackedPoses};
use insonify::pose::Estimator;
use insonify::render::Backend;
use insonify::settings::Control;
use insonify::sink::live::LiveSink;
use insonify::sink::{FrameLog, Stills, create_dir, remove, write_json};
use insonify::station::Station;
use insonify::tracker::{Speed, Transport};
use tokio::sync::mpsc;

use super::Args;
use crate::commands::{Classify, Failure, live, output, terminal};

/// Files of a shipped generator: path and contents of each.
macro_rules! generator {
    ($name:literal) => {
        generator!(
            $name,
            ".onnx",
            ".toml",
            ".parity_input.npy",
            ".parity_output.npy",
            ".int8.onnx",
            ".int8.parity_output.npy"
        )
    };
    ($name:literal, $($end:literal),+) => {
        [$((
            concat!("assets/generators/", $name, "/", $name, $end),
            include_bytes!(concat!("../../../assets/generators/", $name, "/", $name, $end)) as &[u8],
        )),+]
    };
}

/// Files of the live station, by their paths in the repository. They are embedded in the program, so that the demo
/// runs from anywhere.
const FILES: [(&str, &[u8]); 2] = [(STATION, include_bytes!("../../../configs/live.toml")), (RECORDING, super::EXAM)];
/// Files of the generators that the station names.
const GENERATORS: [[(&str, &[u8]); 6]; 1] = [generator!("beam_m_rolling")];
const STATION: &str = "configs/live.toml";
const RECORDING: &str = "assets/exams/obstetric_sweep.mcap";

/// Interval between saved pictures.
const STILL_PERIOD: Duration = Duration::from_secs(2);

/// Time after the exam's end at which the session ends in any case.
const GRACE: Duration = Duration::from_secs(10);

/// Plays the exam of duration `length` once. On a terminal it repeats while the page is watched. `interrupt` is
/// requested by Ctrl-C.
pub(super) fn run(
    args: &Args,
    backend: &Backend,
    scene: &Arc<Scene>,
    length: Duration,
    interrupt: &Stop,
) -> Result<Summary, Failure> {
    let mut station = station(&args.out.join("station"))?;
    args.effects.apply(&mut station.settings);
    let directory = args.out.join("live");
    create_dir(&directory)?;
    Stills::remove_from(&directory)?;
    remove(&directory.join("summary.json"))?;
    let stays = !args.once && std::io::stdin().is_terminal() && std::io::stderr().is_terminal();
    let factory = LocalRendererFactory::new(backend.clone(), scene.clone())?;
    let tracked = TrackedPoses::new(Estimator::new(station.pose_settings()?));
    let mut live = LiveStation::new(&mut station, factory, tracked.clone(), None, true)?;
    live::say(&mut live);
    let stop = live.parts.stop.clone();

    eprintln!("live: recorded tracker bytes → decoder → estimator → renderer → generator → page and files");
    let sinks = &mut live.parts.sinks;
    let page = page(&station, scene, &live.control);
    let seconds = length.as_secs_f64();
    let watchers: Box<dyn Fn() -> usize> = match page {
        Ok((sink, address, watchers)) => {
            let further = if stays { ", and goes on while the page is watched; Enter ends it" } else { "" };
            eprintln!("page: {address}  open it now: the exam takes {seconds:.0} s{further}");
            sinks.push(sink);
            watchers
        }
        Err(reason) => {
            tracing::warn!("no page is served: {reason}; the exam takes {seconds:.0} s");
            Box::new(|| 0)
        }
    };
    let stills = u32::try_from(length.as_secs() / STILL_PERIOD.as_secs()).unwrap_or(0);
    sinks.push(Box::new(Stills::new(&directory, STILL_PERIOD, stills)));
    live.parts.log = Some(FrameLog::create(&directory.join("frames.jsonl"))?);

    let mut tracker = station.tracker.clone();
    if let Transport::Recording { repeat, speed, .. } = &mut tracker.transport {
        (*repeat, *speed) = (stays, Speed::Factor(1.0));
    }
    let began = live.parts.clock.now();
    live.track(&tracked, &tracker)?;
    // Ends the session even if the recording stalls.
    let duration = (!stays).then(|| length + GRACE);
    let enter = if stays { enter() } else { Arc::default() };
    let end_s = (began + length).as_secs_f64();
    let mut end = End { end_s, stays, has_announced: false };
    let summary = live::run(&station, Limits { duration, frames: None }, live.parts, |now| {
        let asked = match (interrupt.is_requested(), enter.load(Ordering::Relaxed)) {
            (true, _) => Some("Ctrl-C"),
            (_, true) => Some("Enter"),
            _ => end.due(now.elapsed_s, watchers()),
        };
        if let Some(reason) = asked {
            stop.request(reason);
        } else if end.news(now.elapsed_s) {
            terminal::say("the exam begins again, since the page is watched: Enter goes on with the demo");
        }
    })?;
    drop(live.control);
    live::say_left_out("tracker", &tracked.counters());
    tracked.needle_counters().iter().for_each(|counters| live::say_left_out("needle", counters));
    write_json(&directory.join("summary.json"), &summary)?;
    for error in summary.sinks.iter().filter_map(|sink| sink.error.as_deref()) {
        tracing::warn!("{error}");
    }
    if interrupt.is_requested() { Err(Failure::Interrupted) } else { Ok(summary) }
}

/// Writes the station and all its files below `root`, and loads the station. `insonify run` can use these files as
/// well.
fn station(root: &Path) -> Result<Station, Failure> {
    for (name, bytes) in FILES.into_iter().chain(GENERATORS.into_iter().flatten()) {
        let path = root.join(name);
        output::make_parent(&path)?;
        std::fs::write(&path, bytes)
            .map_err(|error| anyhow::anyhow!("cannot write {}: {error}", path.display()))
            .other()?;
    }
    Ok(Station::load(&root.join(STATION))?)
}

/// Condition for the automatic end of the live part.
struct End {
    /// Session time at which the exam has played once, s.
    end_s: f64,
    stays: bool,
    has_announced: bool,
}

impl End {
    /// Reason to end the session at `now_s`; `None` if it goes on. `watchers` is the number of viewers of the page.
    fn due(&self, now_s: f64, watchers: usize) -> Option<&'static str> {
        (self.stays && self.played(now_s) && watchers == 0).then_some("the exam is over, and nobody watches")
    }

    /// Whether the exam has just begun to repeat; true only once.
    fn news(&mut self, now_s: f64) -> bool {
        let news = self.stays && self.played(now_s) && !self.has_announced;
        self.has_announced |= news;
        news
    }

    fn played(&self, now_s: f64) -> bool {
        now_s >= self.end_s
    }
}

/// Flag that becomes true when Enter is pressed. If nobody presses it, the waiting thread is abandoned.
fn enter() -> Arc<AtomicBool> {
    let pressed = Arc::<AtomicBool>::default();
    let set = pressed.clone();
    std::thread::spawn(move || {
        let read = std::io::stdin().read_line(&mut String::new());
        // The end of the input does not count as Enter.
        set.store(read.is_ok_and(|bytes| bytes > 0), Ordering::Relaxed);
    });
    pressed
}

/// Sink of the page, address of the page, and a function that counts its viewers.
type Page = (Box<dyn LiveSink>, String, Box<dyn Fn() -> usize>);

#[cfg(feature = "browser")]
fn page(station: &Station, scene: &Scene, control: &mpsc::Sender<Control>) -> Result<Page, String> {
    use insonify::sink::browser::BrowserSink;
    let scene = insonify::pipeline::scene_info(station, scene);
    let mut settings = station.browser.clone().unwrap_or_default();
    let sink = BrowserSink::new(&settings, control.clone(), &scene).or_else(|_| {
        // Uses any free port, because another station may have the default one.
        settings.port = 0;
        BrowserSink::new(&settings, control.clone(), &scene)
    });
    let sink = sink.map_err(|error| error.to_string())?;
    let (address, monitor) = (sink.address().to_owned(), sink.monitor());
    Ok((Box::new(sink), address, Box::new(move || monitor.clients().len())))
}

#[cfg(not(feature = "browser"))]
fn page(_: &Station, _: &Scene, _: &mpsc::Sender<Control>) -> Result<Page, String> {
    Err("this build has none; the feature `browser` adds it".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exam_goes_on_only_while_it_is_watched_at_a_terminal() {
        let mut end = End { end_s: 24.0, stays: true, has_announced: false };
        assert_eq!((end.due(23.9, 0), end.news(23.9)), (None, false));
        assert!(end.due(24.0, 0).is_some());
        assert_eq!((end.due(24.0, 1), end.news(24.0), end.news(24.2)), (None, true, false));
        assert!(end.due(60.0, 0).is_some(), "the page was closed");
        let mut end = End { end_s: 24.0, stays: false, has_announced: false };
        assert_eq!((end.due(60.0, 0), end.news(60.0)), (None, false), "its recording ends it");
    }
}
