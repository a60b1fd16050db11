//! Sink that starts the server and hands it frames.

use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{SystemTime, UNIX_EPOCH};

use bytes::BytesMut;
use glam::{DMat3, DVec3};
use tokio::sync::{Semaphore, watch};
use tokio_util::sync::CancellationToken;

use super::Settings;
use super::server::{Counters, Encoded, Latest, Server, listen};
use crate::pose::{Pose, TrackingState};
use crate::presented::{Pool, PresentedFrame};
use crate::sink::SinkError;
use crate::sink::error::check_shape;
use crate::sink::live::LiveSink;
use crate::tracker::openigtlink::message;
use crate::transducer::{Probe, Sector};

const SINK: &str = "OpenIGTLink server";

/// Live sink with its server, which runs on its own thread.
pub struct OpenIgtLink {
    settings: Settings,
    probe: Probe,
    address: SocketAddr,
    latest: Arc<watch::Sender<Latest>>,
    /// Buffers of encoded frames: one for each client, and two more.
    pool: Pool<Encoded>,
    number: u64,
    counters: Arc<Counters>,
    cancel: CancellationToken,
    thread: Option<JoinHandle<()>>,
}

impl OpenIgtLink {
    /// Starts the server for frames of `probe`.
    ///
    /// # Errors
    /// The server can't listen at the address, or the system refuses a thread.
    pub fn new(settings: Settings, probe: Probe) -> Result<Self, SinkError> {
        let address = SocketAddr::new(settings.address, settings.port);
        let refused = |source| SinkError::Listen { sink: SINK, address, source };
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(refused)?;
        let listener = {
            let _context = runtime.enter();
            listen(address).map_err(refused)?
        };
        let address = listener.local_addr().map_err(refused)?;
        let (latest, _) = watch::channel(Latest::default());
        let (latest, counters) = (Arc::new(latest), Arc::new(Counters::default()));
        let cancel = CancellationToken::new();
        let server = Server {
            latest: Arc::clone(&latest),
            counters: Arc::clone(&counters),
            cancel: cancel.clone(),
            slots: Arc::new(Semaphore::new(settings.clients_max as usize)),
        };
        let thread = std::thread::Builder::new()
            .name("openigtlink".to_owned())
            .spawn(move || runtime.block_on(server.run(listener)))
            .map_err(refused)?;
        let (thread, pool) = (Some(thread), Pool::new(settings.clients_max as usize + 2));
        Ok(Self { settings, probe, address, latest, pool, number: 0, counters, cancel, thread })
    }

    /// Address at which the server listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Counters of the server; readable after the sink has ended.
    pub fn counters(&self) -> Arc<Counters> {
        Arc::clone(&self.counters)
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
            // The next client must not get an old frame.
            self.latest.send_modify(|latest| latest.frame = None);
            return Ok(());
        }
        let Self { settings, probe, pool, number, .. } = self;
        let filled = pool.fill(|encoded| {
            encoded.number = *number;
            encoded.bytes.clear();
            encode(settings, probe, frame, &mut encoded.bytes);
        });
        *number += 1;
        self.latest.send_replace(Latest { frame: filled.map(|(encoded, ())| encoded), next: *number });
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

/// Writes the messages of a frame.
fn encode(settings: &Settings, probe: &Probe, frame: &PresentedFrame, out: &mut BytesMut) {
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

    let ras_from_scene = settings.scene_axes.ras_from_scene;
    let pose = frame.info.pose().unwrap_or(Pose::IDENTITY);
    let ras_from_probe = ras_from_scene * DMat3::from_quat(pose.orientation);
    let probe_mm = ras_from_scene * pose.position_mm;
    if state.is_live() && frame.info.pose().is_some() {
        message::put_transform(out, "ProbeToScene", time_ns, ras_from_probe, probe_mm);
    }
    let probe = Probe { depth_mm: frame.info.settings.probe.depth_mm, ..*probe };
    let sector = Sector::fit(&probe, frame.width, frame.height);
    let half = 0.5 * sector.pixel_mm;
    let centre = sector.corner_mm + glam::DVec2::new(f64::from(frame.width), f64::from(frame.height)) * half;
    let placement = message::Placement {
        column_mm: ras_from_probe.x_axis * sector.pixel_mm,
        row_mm: ras_from_probe.z_axis * sector.pixel_mm,
        slice_mm: -ras_from_probe.y_axis * settings.slice_mm,
        centre_mm: probe_mm + ras_from_probe * DVec3::new(centre.x, 0.0, centre.y),
    };
    let size = [frame.width, frame.height].map(|extent| u16::try_from(extent).unwrap_or(u16::MAX));
    message::put_image(out, "Image", time_ns, size, &placement, &frame.image);
}
