//! An OpenIGTLink server (TCP 18944): images and transforms for 3D Slicer, PLUS, or whoever connects.
//!
//! Each presented frame goes to every client as three version 1 messages:
//!
//! | message | device | content |
//! |---|---|---|
//! | `STATUS` | `Tracking` | 1 (all is well), or 13 (not ready) while the sensor is stuck, or the pose stale or lost |
//! | `TRANSFORM` | `ProbeToScene` | the probe's pose; left out while the status is not 1 |
//! | `IMAGE` | `Image` | the picture, u8, one slice, where it lies in the scene |
//!
//! # Frames
//! All coordinates are RAS, mm: what 3D Slicer displays in. The scene is taken for the patient; [`SceneAxes`] says where
//! its axes point. The image's first index runs along the probe's x (lateral), its second along the probe's z (into the
//! body), so that its normal is the probe's −y. Its position is that of its centre, as the protocol asks. In 3D Slicer the
//! image therefore lies at the probe's pose as it comes: it must *not* be put under `ProbeToScene` as well. Before the
//! first pose the probe is taken to be at the scene's origin.
//!
//! # Who gets what
//! Each client has its own task and takes the newest frame when it is ready for one: what it passes over is counted, and
//! a client that doesn't read delays nobody. One that reads nothing for [`STALL_LIMIT`] is disconnected. The protocol
//! knows no password: whoever reaches the port sees the picture, so that it is loopback unless configured.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::Path;
use std::str::FromStr;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use bytes::BytesMut;
use glam::{DMat3, DQuat, DVec3};
use thiserror::Error;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::tcp::{OwnedReadHalf, OwnedWriteHalf};
use tokio::net::{TcpListener, TcpSocket, TcpStream};
use tokio::sync::{Semaphore, watch};
use tokio_util::sync::CancellationToken;

use super::SinkError;
use super::error::check_shape;
use super::live::{LiveSink, PresentedFrame};
use crate::pose::TrackingState;
use crate::tracker::openigtlink::{TCP_PORT, message};
use crate::transducer::{Probe, Sector};

/// Longest that a client may read nothing.
pub const STALL_LIMIT: Duration = Duration::from_secs(30);

/// Bytes that the system may hold for a client: a frame or so. More would be latency.
const SEND_BUFFER: u32 = 1 << 20;

const SINK: &str = "OpenIGTLink server";

/// Directions of the scene's axes in the patient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneAxes {
    ras_from_scene: DMat3,
}

/// Letters that say no axes.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error("`{text}` are no axes: expected three letters of R or L, A or P, S or I, each pair once, right-handed")]
pub struct SceneAxesError {
    /// Text given.
    pub text: String,
}

impl FromStr for SceneAxes {
    type Err = SceneAxesError;

    /// The directions of x, y and z by their letters: `RAS`, `LPS`, `LSA` and so on.
    fn from_str(text: &str) -> Result<Self, SceneAxesError> {
        let direction = |letter| match letter {
            'R' => Some(DVec3::X),
            'L' => Some(-DVec3::X),
            'A' => Some(DVec3::Y),
            'P' => Some(-DVec3::Y),
            'S' => Some(DVec3::Z),
            'I' => Some(-DVec3::Z),
            _ => None,
        };
        let mut letters = text.chars().map(direction);
        let mut next = || letters.next().flatten();
        let columns = (next(), next(), next());
        let (Some(x), Some(y), Some(z)) = columns else { return Err(SceneAxesError { text: text.to_owned() }) };
        let ras_from_scene = DMat3::from_cols(x, y, z);
        // A scene is right-handed, as RAS is: other letters would mirror it.
        if letters.next().is_some() || ras_from_scene.determinant() < 0.5 {
            return Err(SceneAxesError { text: text.to_owned() });
        }
        Ok(Self { ras_from_scene })
    }
}

impl Default for SceneAxes {
    /// RAS.
    fn default() -> Self {
        Self { ras_from_scene: DMat3::IDENTITY }
    }
}

/// Server settings of a station.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Address to listen at.
    pub address: IpAddr,
    /// Port; 0 for any free one.
    pub port: u16,
    /// Directions of the scene's axes.
    pub scene_axes: SceneAxes,
    /// Thickness of the image that clients are told, mm.
    pub slice_mm: f64,
    /// Clients that may be connected at a time; others are turned away.
    pub clients_max: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            address: Ipv4Addr::LOCALHOST.into(),
            port: TCP_PORT,
            scene_axes: SceneAxes::default(),
            slice_mm: 1.0,
            clients_max: 16,
        }
    }
}

/// Counters of the server.
#[derive(Debug, Default)]
pub struct Counters {
    /// Clients connected now.
    pub connected: AtomicU64,
    /// Clients that have come.
    pub accepted: AtomicU64,
    /// Clients turned away since there were too many.
    pub refused: AtomicU64,
    /// Frames sent, each client's.
    pub sent: AtomicU64,
    /// Frames that a client passed over for a newer one, each client's.
    pub dropped: AtomicU64,
    /// Clients disconnected since they read nothing.
    pub stalled: AtomicU64,
}

/// A frame as it goes over the wire.
#[derive(Default)]
struct Encoded {
    number: u64,
    bytes: BytesMut,
}

type Latest = Option<Arc<Encoded>>;

/// The server, on a thread of its own.
pub struct OpenIgtLink {
    settings: Settings,
    probe: Probe,
    address: SocketAddr,
    latest: Arc<watch::Sender<Latest>>,
    /// Buffers that are filled anew once no client holds them: one a client and two.
    pool: Vec<Arc<Encoded>>,
    number: u64,
    counters: Arc<Counters>,
    cancel: CancellationToken,
    thread: Option<JoinHandle<()>>,
}

impl OpenIgtLink {
    /// Starts listening for clients that want the frames of `probe`.
    ///
    /// # Errors
    /// The address can't be listened at, or the system gives no thread.
    pub fn new(settings: Settings, probe: Probe) -> Result<Self, SinkError> {
        let address = SocketAddr::new(settings.address, settings.port);
        let refused = |source| SinkError::Listen { sink: SINK, address, source };
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(refused)?;
        let listener = {
            let _context = runtime.enter();
            listen(address).map_err(refused)?
        };
        let address = listener.local_addr().map_err(refused)?;
        let (latest, _) = watch::channel(None);
        let (latest, counters) = (Arc::new(latest), Arc::new(Counters::default()));
        let cancel = CancellationToken::new();
        let server = Server {
            latest: Arc::clone(&latest),
            counters: Arc::clone(&counters),
            cancel: cancel.clone(),
            places: Arc::new(Semaphore::new(settings.clients_max)),
        };
        let thread = std::thread::Builder::new()
            .name("openigtlink".to_owned())
            .spawn(move || runtime.block_on(server.run(listener)))
            .map_err(refused)?;
        let thread = Some(thread);
        Ok(Self { settings, probe, address, latest, pool: Vec::new(), number: 0, counters, cancel, thread })
    }

    /// Address that it listens at.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Counters; readable after the end.
    pub fn counters(&self) -> Arc<Counters> {
        Arc::clone(&self.counters)
    }

    fn encode(&self, frame: &PresentedFrame, out: &mut BytesMut) {
        let time_ns = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_nanos() as u64);
        let state = frame.info.estimate.state;
        let (name, text) = match state {
            TrackingState::Good => ("GOOD", ""),
            TrackingState::Held => ("HELD", "the last pose is held over a short gap"),
            TrackingState::Stuck => ("STUCK", "the sensor repeats one reading; the picture may not follow the probe"),
            TrackingState::Stale => ("STALE", "the picture doesn't follow the probe"),
            TrackingState::Lost => ("LOST", "there is no pose"),
        };
        let code = if state.is_live() { message::STATUS_OK } else { message::STATUS_NOT_READY };
        message::put_status(out, "Tracking", time_ns, code, name, text);

        let ras_from_scene = self.settings.scene_axes.ras_from_scene;
        let (orientation, position_mm) =
            frame.info.pose().map_or((DQuat::IDENTITY, DVec3::ZERO), |pose| (pose.orientation, pose.position_mm));
        let ras_from_probe = ras_from_scene * DMat3::from_quat(orientation);
        let probe_mm = ras_from_scene * position_mm;
        if state.is_live() && frame.info.pose().is_some() {
            message::put_transform(out, "ProbeToScene", time_ns, ras_from_probe, probe_mm);
        }
        let probe = Probe { depth_mm: frame.info.settings.depth_mm, ..self.probe };
        let sector = Sector::fit(&probe, frame.width, frame.height);
        let half = 0.5 * sector.pixel_mm;
        let centre = sector.corner_mm + glam::DVec2::new(f64::from(frame.width), f64::from(frame.height)) * half;
        let placement = message::Placement {
            column_mm: ras_from_probe.x_axis * sector.pixel_mm,
            row_mm: ras_from_probe.z_axis * sector.pixel_mm,
            slice_mm: -ras_from_probe.y_axis * self.settings.slice_mm,
            centre_mm: probe_mm + ras_from_probe * DVec3::new(centre.x, 0.0, centre.y),
        };
        let size = [frame.width, frame.height].map(|extent| u16::try_from(extent).unwrap_or(u16::MAX));
        message::put_image(out, "Image", time_ns, size, &placement, &frame.image);
    }

    /// A buffer that no client holds.
    fn free_buffer(&mut self) -> Arc<Encoded> {
        let free = self.pool.iter().position(|buffer| Arc::strong_count(buffer) == 1);
        free.map_or_else(Arc::default, |at| self.pool.swap_remove(at))
    }
}

impl LiveSink for OpenIgtLink {
    fn name(&self) -> &str {
        "openigtlink"
    }

    fn present(&mut self, frame: &PresentedFrame) -> Result<(), SinkError> {
        if self.thread.as_ref().is_none_or(JoinHandle::is_finished) {
            return Err(SinkError::Ended { sink: SINK, reason: "its thread has ended".to_owned() });
        }
        let shape = [frame.height as usize, frame.width as usize];
        let limit = usize::from(u16::MAX);
        if shape.iter().any(|&extent| extent == 0 || extent > limit) {
            let reason = format!("an image has 1 to {limit} pixels a side; this one is {} × {}", shape[1], shape[0]);
            return Err(SinkError::Ended { sink: SINK, reason });
        }
        check_shape(Path::new("an OpenIGTLink image"), shape, frame.image.len())?;
        if self.latest.receiver_count() == 0 {
            // What the last client left behind would be old news to the next one.
            self.latest.send_replace(None);
            return Ok(());
        }
        let mut buffer = self.free_buffer();
        if let Some(encoded) = Arc::get_mut(&mut buffer) {
            encoded.number = self.number;
            encoded.bytes.clear();
            self.encode(frame, &mut encoded.bytes);
        }
        self.number += 1;
        self.pool.push(Arc::clone(&buffer));
        self.latest.send_replace(Some(buffer));
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Result<(), SinkError> {
        self.cancel.cancel();
        let ended = self.thread.take().map_or(Ok(()), JoinHandle::join);
        ended.map_err(|_| SinkError::Ended { sink: SINK, reason: "its thread panicked".to_owned() })
    }
}

impl Drop for OpenIgtLink {
    fn drop(&mut self) {
        self.cancel.cancel();
    }
}

/// Listens; what it accepts inherits the buffer's size.
fn listen(address: SocketAddr) -> std::io::Result<TcpListener> {
    let socket = if address.is_ipv4() { TcpSocket::new_v4() } else { TcpSocket::new_v6() }?;
    // A server that starts anew finds its port still in use by connections that have ended.
    #[cfg(unix)]
    socket.set_reuseaddr(true)?;
    socket.set_send_buffer_size(SEND_BUFFER)?;
    socket.bind(address)?;
    socket.listen(64)
}

struct Server {
    latest: Arc<watch::Sender<Latest>>,
    counters: Arc<Counters>,
    cancel: CancellationToken,
    places: Arc<Semaphore>,
}

impl Server {
    async fn run(self, listener: TcpListener) {
        loop {
            let accepted = tokio::select! {
                () = self.cancel.cancelled() => return,
                accepted = listener.accept() => accepted,
            };
            let Ok((stream, client)) = accepted else {
                // Too many open files, most likely: that takes a while to get better.
                tokio::time::sleep(Duration::from_millis(100)).await;
                continue;
            };
            let Ok(place) = Arc::clone(&self.places).try_acquire_owned() else {
                self.counters.refused.fetch_add(1, Ordering::Relaxed);
                tracing::warn!("OpenIGTLink client {client} is turned away: too many are connected");
                continue;
            };
            self.counters.accepted.fetch_add(1, Ordering::Relaxed);
            self.counters.connected.fetch_add(1, Ordering::Relaxed);
            tracing::info!("OpenIGTLink client {client} is connected");
            let mut frames = self.latest.subscribe();
            // One that connects while the picture is frozen sees it, too.
            frames.mark_changed();
            let (counters, cancel) = (Arc::clone(&self.counters), self.cancel.clone());
            tokio::spawn(async move {
                serve(stream, client, frames, &counters, &cancel).await;
                counters.connected.fetch_sub(1, Ordering::Relaxed);
                drop(place);
            });
        }
    }
}

/// Serves one client until it leaves, stalls, or the server ends.
async fn serve(
    stream: TcpStream,
    client: SocketAddr,
    frames: watch::Receiver<Latest>,
    counters: &Counters,
    cancel: &CancellationToken,
) {
    // A failure costs latency only.
    let _ = stream.set_nodelay(true);
    let (reader, writer) = stream.into_split();
    let left = tokio::select! {
        () = cancel.cancelled() => "the server ends",
        () = discard(reader) => "it has left",
        left = feed(writer, frames, counters) => left,
    };
    tracing::info!("OpenIGTLink client {client} is disconnected: {left}");
}

/// Reads what a client says, which is of no interest, until it leaves.
async fn discard(mut reader: OwnedReadHalf) {
    let mut bytes = [0; 4096];
    while reader.read(&mut bytes).await.is_ok_and(|length| length > 0) {}
}

/// Sends a client the newest frame, and again when there is a newer one.
async fn feed(mut writer: OwnedWriteHalf, mut frames: watch::Receiver<Latest>, counters: &Counters) -> &'static str {
    let mut last: Option<u64> = None;
    let mut counted = |number: u64| {
        let passed_over = last.map_or(0, |last| number.saturating_sub(last + 1));
        counters.dropped.fetch_add(passed_over, Ordering::Relaxed);
        last = Some(number);
    };
    while frames.changed().await.is_ok() {
        let Some(frame) = frames.borrow_and_update().clone() else { continue };
        counted(frame.number);
        let mut rest = &frame.bytes[..];
        while !rest.is_empty() {
            match tokio::time::timeout(STALL_LIMIT, writer.write(rest)).await {
                Ok(Ok(length)) if length > 0 => rest = &rest[length..],
                Ok(_) => return "it has left",
                Err(_) => {
                    counters.stalled.fetch_add(1, Ordering::Relaxed);
                    // All that came meanwhile, the newest too.
                    let newest = frames.borrow().as_ref().map(|newest| newest.number);
                    counted(newest.map_or(frame.number + 1, |number| number + 1));
                    return "it read nothing for too long";
                }
            }
        }
        counters.sent.fetch_add(1, Ordering::Relaxed);
    }
    "the server ends"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_letters() {
        let matrix = |text: &str| text.parse::<SceneAxes>().map(|axes| axes.ras_from_scene);
        assert_eq!(matrix("RAS"), Ok(DMat3::IDENTITY));
        assert_eq!(matrix("LPS"), Ok(DMat3::from_diagonal(DVec3::new(-1.0, -1.0, 1.0))));
        assert_eq!(matrix("LSA"), Ok(DMat3::from_cols(-DVec3::X, DVec3::Z, DVec3::Y)));
        for text in ["", "RA", "RASS", "LAS", "RRS", "ras", "RAX"] {
            assert!(matrix(text).is_err(), "{text}");
        }
    }
}
