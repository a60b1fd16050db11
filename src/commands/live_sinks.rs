//! Sinks of a live session.

use std::collections::HashSet;
use std::path::Path;

use insonify::anatomy::Scene;
use insonify::pipeline::CONTROLS_WAITING;
use insonify::settings::Control;
use insonify::sink::live::LiveSink;
use insonify::sink::openigtlink::OpenIgtLink;
use insonify::sink::{FrameLog, FrameRate, LiveSinkKind, LiveVideo, NullSink, PngSequence};
use insonify::station::Station;
use tokio::sync::mpsc;

use super::Failure;

/// Sinks of a session, and the controls that viewers send through them.
pub(crate) struct LiveSinks {
    pub(crate) sinks: Vec<Box<dyn LiveSink>>,
    /// Log of all presented frames.
    pub(crate) log: Option<FrameLog>,
    pub(crate) controls: mpsc::Receiver<Control>,
    /// Keeps the channel open if no sink takes input.
    pub(crate) control: mpsc::Sender<Control>,
    #[cfg(feature = "window")]
    pub(crate) window: Option<insonify::sink::window::WindowSlot>,
}

/// Sinks named on the command line, else by the station: its `display.sinks` and every display that has a table.
pub(crate) fn kinds(asked: &[LiveSinkKind], station: &Station) -> Vec<LiveSinkKind> {
    let mut kinds = asked.to_vec();
    if asked.is_empty() {
        kinds.clone_from(&station.sinks);
        kinds.extend(station.browser.as_ref().map(|_| LiveSinkKind::Browser));
        kinds.extend(station.window.as_ref().map(|_| LiveSinkKind::Window));
        kinds.extend(station.openigtlink.as_ref().map(|_| LiveSinkKind::OpenIgtLink));
    }
    let mut seen = HashSet::new();
    kinds.retain(|kind| seen.insert(*kind));
    kinds
}

/// Files of these sinks below their directory.
pub(crate) fn files(kinds: &[LiveSinkKind]) -> Vec<&'static str> {
    let of = |kind: &LiveSinkKind| match kind {
        LiveSinkKind::Png => &["png/index.jsonl", "png/*.png"][..],
        LiveSinkKind::Video => &["video.mp4", "video.part.mp4"],
        _ => &[],
    };
    kinds.iter().flat_map(of).copied().collect()
}

/// Opens the sinks; file sinks write below `out`.
pub(crate) fn open(
    asked: &[LiveSinkKind],
    station: &Station,
    scene: &Scene,
    out: &Path,
    metrics: Option<&Path>,
) -> Result<LiveSinks, Failure> {
    let (control, controls) = mpsc::channel(CONTROLS_WAITING);
    let mut live = LiveSinks {
        sinks: Vec::new(),
        log: None,
        controls,
        control,
        #[cfg(feature = "window")]
        window: None,
    };
    for kind in kinds(asked, station) {
        let sink: Box<dyn LiveSink> = match kind {
            LiveSinkKind::Null => Box::new(NullSink),
            LiveSinkKind::Png => Box::new(PngSequence::create(&out.join("png"))?),
            LiveSinkKind::Video => {
                Box::new(LiveVideo::new(&out.join("video"), FrameRate::new(station.pipeline.frame_rate_hz)?))
            }
            LiveSinkKind::OpenIgtLink => {
                let sink = OpenIgtLink::new(station.openigtlink.clone().unwrap_or_default(), station.probe)?;
                eprintln!("OpenIGTLink: {}", sink.address());
                Box::new(sink)
            }
            LiveSinkKind::Browser => browser(station, scene, &live.control)?,
            LiveSinkKind::Window => window(&mut live)?,
        };
        live.sinks.push(sink);
    }
    if let Some(path) = metrics {
        live.log = Some(FrameLog::create(path)?);
    }
    Ok(live)
}

/// Tissues and surfaces of the scene, for a page.
#[cfg(feature = "browser")]
pub(crate) fn scene_info(station: &Station, scene: &Scene) -> insonify::sink::browser::SceneInfo {
    use insonify::sink::browser::{SceneInfo, ScenePacket};
    let surfaces = ScenePacket::new(scene, &station.probe, station.axes());
    SceneInfo { tissues: station.tissues.names().to_vec(), surfaces: Some(surfaces) }
}

#[cfg(feature = "browser")]
fn browser(station: &Station, scene: &Scene, control: &mpsc::Sender<Control>) -> Result<Box<dyn LiveSink>, Failure> {
    use insonify::sink::browser::BrowserSink;
    let scene = scene_info(station, scene);
    let sink = BrowserSink::new(&station.browser.clone().unwrap_or_default(), control.clone(), &scene)?;
    eprintln!("page: {}", sink.address());
    Ok(Box::new(sink))
}

#[cfg(not(feature = "browser"))]
fn browser(_: &Station, _: &Scene, _: &mpsc::Sender<Control>) -> Result<Box<dyn LiveSink>, Failure> {
    Err(Failure::Input(anyhow::anyhow!("this build has no page: build it with the feature `browser`")))
}

#[cfg(feature = "window")]
fn window(live: &mut LiveSinks) -> Result<Box<dyn LiveSink>, Failure> {
    let (sink, slot) = insonify::sink::window::WindowSink::new();
    live.window = Some(slot);
    Ok(Box::new(sink))
}

#[cfg(not(feature = "window"))]
fn window(_: &mut LiveSinks) -> Result<Box<dyn LiveSink>, Failure> {
    Err(Failure::Input(anyhow::anyhow!("this build has no window: build it with the feature `window`")))
}
