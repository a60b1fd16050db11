//! Sink that encodes each frame for the pages and runs their server.

use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::thread::JoinHandle;

use bytes::Bytes;
use tokio::sync::{mpsc, watch};

use super::access::Access;
use super::server;
use super::shared::{ClientCounters, FrameSet, Shared};
use super::wire::{self, Map};
use super::{SceneInfo, Settings, messages};
use crate::presented::{Pool, PresentedFrame};
use crate::settings::Control;
use crate::sink::SinkError;
use crate::sink::live::{LiveSink, MapsWanted};

const NAME: &str = "browser";

/// Buffer of a message, reused once every page has received the message.
struct Owner(Arc<Vec<u8>>);

impl AsRef<[u8]> for Owner {
    fn as_ref(&self) -> &[u8] {
        &self.0
    }
}

/// Live sink that serves the page.
#[derive(Debug)]
pub struct BrowserSink {
    shared: Arc<Shared>,
    frames: watch::Sender<Option<Arc<FrameSet>>>,
    pool: Pool<Vec<u8>>,
    sequence: u64,
    url: String,
    local: SocketAddr,
    thread: Option<JoinHandle<()>>,
}

/// Counts of the connected pages, for use after the sink has moved to its thread.
#[derive(Debug, Clone)]
pub struct BrowserMonitor {
    shared: Arc<Shared>,
}

impl BrowserMonitor {
    /// Counters of each connected page.
    pub fn clients(&self) -> Vec<ClientCounters> {
        self.shared.counters()
    }
}

impl BrowserSink {
    /// Listens and serves on its own thread. Checked controls go to `controls`; if that queue is full, the page shows
    /// an error.
    ///
    /// # Errors
    /// The server can't listen at the address, or gets no random token, runtime or thread.
    pub fn new(settings: &Settings, controls: mpsc::Sender<Control>, scene: &SceneInfo) -> Result<Self, SinkError> {
        let address = SocketAddr::new(settings.address, settings.port);
        let listen = |source| SinkError::Listen { sink: NAME, address, source };
        let listener = TcpListener::bind(address).map_err(listen)?;
        listener.set_nonblocking(true).map_err(listen)?;
        let local = listener.local_addr().map_err(listen)?;
        let access = Access::new(settings, local).map_err(|e| start(format!("no random token: {e}")))?;
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
        let runtime = runtime.map_err(|e| start(e.to_string()))?;
        let url = access.url();
        let (frames, receiver) = watch::channel(None);
        let hello = messages::write(&messages::hello(scene));
        let surfaces = scene.surfaces.clone();
        let shared = Arc::new(Shared::new(access, hello, surfaces, controls, receiver, settings.clients_max));
        let served = shared.clone();
        let run = move || {
            if let Err(e) = runtime.block_on(server::serve(listener, served)) {
                tracing::error!("the browser page is no longer served: {e}");
            }
        };
        let thread = std::thread::Builder::new().name("insonify-browser".to_owned()).spawn(run);
        let thread = Some(thread.map_err(|e| start(e.to_string()))?);
        Ok(Self { shared, frames, pool: Pool::new(usize::MAX), sequence: 0, url, local, thread })
    }

    /// Address to open in a browser, with the token if one is demanded.
    pub fn address(&self) -> &str {
        &self.url
    }

    /// Addresses to open at the configured origins, with the token if one is demanded.
    pub fn origin_addresses(&self) -> Vec<String> {
        self.shared.access.origin_urls()
    }

    /// Address at which the server listens.
    pub fn local_address(&self) -> SocketAddr {
        self.local
    }

    /// A handle to the counters of the connected pages, for use after the sink has moved to its thread.
    pub fn monitor(&self) -> BrowserMonitor {
        BrowserMonitor { shared: self.shared.clone() }
    }
}

impl LiveSink for BrowserSink {
    fn name(&self) -> &str {
        NAME
    }

    fn maps_wanted(&self) -> Option<MapsWanted> {
        let shared = self.shared.clone();
        Some(Arc::new(move || {
            let wanted = shared.wanted();
            wanted.segmentation || wanted.attenuation
        }))
    }

    fn present(&mut self, frame: &PresentedFrame) -> Result<(), SinkError> {
        if self.thread.as_ref().is_none_or(JoinHandle::is_finished) {
            return Err(SinkError::Ended { sink: NAME, reason: "its server has stopped".to_owned() });
        }
        wire::check(frame)?;
        let wanted = self.shared.wanted();
        let mut message = |map| {
            let (message, ()) = self.pool.fill(|out| wire::encode(frame, map, out))?;
            Some(Bytes::from_owner(Owner(message)))
        };
        // Overlays may be requested while the picture is frozen, when no new frame comes.
        let frozen = frame.info.settings.frozen;
        let has_segmentation = (wanted.segmentation || frozen) && !frame.segmentation.is_empty();
        let has_attenuation = (wanted.attenuation || frozen) && !frame.attenuation.is_empty();
        let segmentation = if has_segmentation { message(Map::Segmentation) } else { None };
        let attenuation = if has_attenuation { message(Map::Attenuation) } else { None };
        let image = message(Map::Image).unwrap_or_default();
        self.sequence += 1;
        let (sequence, number, settings) = (self.sequence, frame.number, frame.info.settings);
        self.shared.begun.get_or_init(|| settings);
        let set = FrameSet { sequence, number, settings, image, segmentation, attenuation };
        self.frames.send_replace(Some(Arc::new(set)));
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Result<(), SinkError> {
        self.shared.cancel.cancel();
        match self.thread.take().map(JoinHandle::join) {
            Some(Err(_)) => Err(SinkError::Ended { sink: NAME, reason: "its thread panicked".to_owned() }),
            _ => Ok(()),
        }
    }
}

impl Drop for BrowserSink {
    fn drop(&mut self) {
        self.shared.cancel.cancel();
    }
}

fn start(reason: String) -> SinkError {
    SinkError::Ended { sink: NAME, reason: format!("it could not start: {reason}") }
}
