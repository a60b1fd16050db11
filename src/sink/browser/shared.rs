//! State that the sink, its server and its clients share.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use bytes::Bytes;
use tokio::sync::{Notify, mpsc, watch};
use tokio_util::sync::CancellationToken;

use super::access::Access;
use super::connections::Connections;
use super::scene::ScenePacket;
use crate::settings::{Assignment, Control, LiveSettings, SettingsError, check_offered};

/// Encoded messages of one frame.
#[derive(Debug)]
pub(super) struct FrameSet {
    /// Number of the set, from 1. A client missed the frames whose numbers are skipped in the sets sent to it.
    pub(super) sequence: u64,
    pub(super) number: u64,
    pub(super) settings: LiveSettings,
    pub(super) image: Bytes,
    pub(super) segmentation: Option<Bytes>,
    pub(super) attenuation: Option<Bytes>,
}

/// Maps that are sent in addition to the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Overlays {
    pub(super) segmentation: bool,
    pub(super) attenuation: bool,
}

impl Overlays {
    pub(super) fn or(self, other: Self) -> Self {
        Self {
            segmentation: self.segmentation || other.segmentation,
            attenuation: self.attenuation || other.attenuation,
        }
    }
}

/// Counters of a page, since it connected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ClientCounters {
    /// Number of the page, from 1.
    pub id: u64,
    /// Network address of the page.
    pub address: SocketAddr,
    /// Number of frames sent to the page, or being sent.
    pub sent: u64,
    /// Number of frames skipped because the page was too slow.
    pub dropped: u64,
}

/// State of a page, shared with the sink.
#[derive(Debug)]
pub(super) struct Client {
    pub(super) id: u64,
    pub(super) address: SocketAddr,
    pub(super) segmentation: AtomicBool,
    pub(super) attenuation: AtomicBool,
    pub(super) sent: AtomicU64,
    pub(super) dropped: AtomicU64,
    /// Number of marks that the page has set, changed or removed.
    pub(super) marks: AtomicU64,
}

impl Client {
    pub(super) fn overlays(&self) -> Overlays {
        Overlays {
            segmentation: self.segmentation.load(Ordering::Relaxed),
            attenuation: self.attenuation.load(Ordering::Relaxed),
        }
    }

    pub(super) fn counters(&self) -> ClientCounters {
        let [sent, dropped] = [&self.sent, &self.dropped].map(|counter| counter.load(Ordering::Relaxed));
        ClientCounters { id: self.id, address: self.address, sent, dropped }
    }
}

/// State that the sink, its requests and its clients share.
#[derive(Debug)]
pub(super) struct Shared {
    pub(super) access: Access,
    pub(super) hello: String,
    pub(super) surfaces: Option<ScenePacket>,
    pub(super) controls: mpsc::Sender<Control>,
    pub(super) frames: watch::Receiver<Option<Arc<FrameSet>>>,
    pub(super) cancel: CancellationToken,
    /// Settings of the first frame; empty before it.
    pub(super) begun: OnceLock<LiveSettings>,
    pub(super) connections: Arc<Connections>,
    pub(super) clients: Mutex<BTreeMap<u64, Arc<Client>>>,
    pub(super) clients_max: u32,
    /// Number of the next page to connect.
    pub(super) next_client: AtomicU64,
    pub(super) client_left: Notify,
    /// Whether the terminal has reported that a page was refused.
    pub(super) has_warned_of_page: AtomicBool,
}

impl Shared {
    /// State before the first frame and the first page.
    pub(super) fn new(
        access: Access,
        hello: String,
        surfaces: Option<ScenePacket>,
        controls: mpsc::Sender<Control>,
        frames: watch::Receiver<Option<Arc<FrameSet>>>,
        clients_max: u32,
    ) -> Self {
        Self {
            access,
            hello,
            surfaces,
            controls,
            frames,
            cancel: CancellationToken::new(),
            begun: OnceLock::new(),
            connections: Arc::default(),
            clients: Mutex::default(),
            clients_max,
            next_client: AtomicU64::new(1),
            client_left: Notify::new(),
            has_warned_of_page: AtomicBool::default(),
        }
    }

    fn clients(&self) -> MutexGuard<'_, BTreeMap<u64, Arc<Client>>> {
        self.clients.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn client_count(&self) -> usize {
        self.clients().len()
    }

    pub(super) fn counters(&self) -> Vec<ClientCounters> {
        self.clients().values().map(|client| client.counters()).collect()
    }

    /// Checks that the page offers these values.
    ///
    /// # Errors
    /// Errors of [`check_offered`].
    pub(super) fn check_offered(&self, assignments: &[Assignment]) -> Result<(), SettingsError> {
        let newest = self.frames.borrow().as_ref().map(|set| set.settings);
        let shown: Vec<_> = self.begun.get().copied().into_iter().chain(newest).collect();
        check_offered(assignments, &shown)
    }

    /// Maps that at least one client wants.
    pub(super) fn wanted(&self) -> Overlays {
        self.clients().values().fold(Overlays::default(), |all, client| all.or(client.overlays()))
    }

    /// A slot for another client; `None` if all slots are taken.
    pub(super) fn enter(self: &Arc<Self>, address: SocketAddr) -> Option<ClientSlot> {
        let mut clients = self.clients();
        if clients.len() >= self.clients_max as usize {
            return None;
        }
        let client = Arc::new(Client {
            id: self.next_client.fetch_add(1, Ordering::Relaxed),
            address,
            segmentation: AtomicBool::default(),
            attenuation: AtomicBool::default(),
            sent: AtomicU64::default(),
            dropped: AtomicU64::default(),
            marks: AtomicU64::default(),
        });
        clients.insert(client.id, client.clone());
        Some(ClientSlot { shared: self.clone(), client })
    }
}

/// Slot of a client, freed on drop.
pub(super) struct ClientSlot {
    pub(super) shared: Arc<Shared>,
    pub(super) client: Arc<Client>,
}

impl Drop for ClientSlot {
    fn drop(&mut self) {
        self.shared.clients().remove(&self.client.id);
        self.shared.client_left.notify_one();
    }
}
