//! Server side: accepts clients and feeds each the newest frame.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use bytes::BytesMut;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::tcp::{OwnedReadHalf, OwnedWriteHalf};
use tokio::net::{TcpListener, TcpSocket, TcpStream};
use tokio::sync::{Semaphore, watch};
use tokio_util::sync::CancellationToken;

/// Longest time without a read before a client is disconnected.
pub const STALL_LIMIT: Duration = Duration::from_secs(30);

/// System's send buffer per client, bytes: about one frame. More would add latency.
const SEND_BUFFER: u32 = 1 << 20;

/// Counters of the server.
#[derive(Debug, Default)]
pub struct Counters {
    /// Clients connected now.
    pub connected: AtomicU64,
    /// Clients accepted.
    pub accepted: AtomicU64,
    /// Clients refused because too many were connected.
    pub refused: AtomicU64,
    /// Frames sent or being sent, summed over clients.
    pub sent: AtomicU64,
    /// Frames skipped for a newer one, summed over clients.
    pub dropped: AtomicU64,
    /// Clients disconnected because they read nothing.
    pub stalled: AtomicU64,
}

/// Encoded messages of a frame.
#[derive(Default)]
pub(super) struct Encoded {
    pub(super) number: u64,
    pub(super) bytes: BytesMut,
}

pub(super) type Latest = Option<Arc<Encoded>>;

/// Listens; accepted connections inherit the buffer's size.
pub(super) fn listen(address: SocketAddr) -> std::io::Result<TcpListener> {
    let socket = if address.is_ipv4() { TcpSocket::new_v4() } else { TcpSocket::new_v6() }?;
    // Without this, a restarted server finds its port in use by ended connections.
    #[cfg(unix)]
    socket.set_reuseaddr(true)?;
    socket.set_send_buffer_size(SEND_BUFFER)?;
    socket.bind(address)?;
    socket.listen(64)
}

pub(super) struct Server {
    pub(super) latest: Arc<watch::Sender<Latest>>,
    pub(super) counters: Arc<Counters>,
    pub(super) cancel: CancellationToken,
    pub(super) places: Arc<Semaphore>,
}

impl Server {
    pub(super) async fn run(self, listener: TcpListener) {
        loop {
            let accepted = tokio::select! {
                () = self.cancel.cancelled() => return,
                accepted = listener.accept() => accepted,
            };
            let Ok((stream, client)) = accepted else {
                // Probably too many open files: waits before the next attempt.
                tokio::time::sleep(Duration::from_millis(100)).await;
                continue;
            };
            let Ok(place) = Arc::clone(&self.places).try_acquire_owned() else {
                self.counters.refused.fetch_add(1, Ordering::Relaxed);
                tracing::warn!("OpenIGTLink client {client} is turned away: too many are connected");
                continue;
            };
            let mut frames = self.latest.subscribe();
            // A client that connects during a freeze gets the frozen frame.
            frames.mark_changed();
            // Counted last: a client that is counted gets the next frame.
            self.counters.accepted.fetch_add(1, Ordering::Relaxed);
            self.counters.connected.fetch_add(1, Ordering::Relaxed);
            tracing::info!("OpenIGTLink client {client} is connected");
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

/// Reads and discards data of a client until it leaves.
async fn discard(mut reader: OwnedReadHalf) {
    let mut bytes = [0; 4096];
    while reader.read(&mut bytes).await.is_ok_and(|length| length > 0) {}
}

/// Sends a client every newest frame. Returns why it ended.
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
        // Counted first: who has received the frame finds it counted.
        counters.sent.fetch_add(1, Ordering::Relaxed);
        let mut rest = &frame.bytes[..];
        while !rest.is_empty() {
            match tokio::time::timeout(STALL_LIMIT, writer.write(rest)).await {
                Ok(Ok(length)) if length > 0 => rest = &rest[length..],
                Ok(_) => return "it has left",
                Err(_) => {
                    counters.stalled.fetch_add(1, Ordering::Relaxed);
                    // Counts the frames that came meanwhile, including the newest.
                    let newest = frames.borrow().as_ref().map(|newest| newest.number);
                    counted(newest.map_or(frame.number + 1, |number| number + 1));
                    return "it read nothing for too long";
                }
            }
        }
    }
    "the server ends"
}
