//! Server: accepts clients and sends each the newest frame.

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

/// Longest time in which a client may read nothing before it is disconnected.
pub const STALL_LIMIT: Duration = Duration::from_secs(30);

/// The system's send buffer for each client, bytes: about one frame. More would add latency.
const SEND_BUFFER: u32 = 1 << 20;

/// Counters of the server.
#[derive(Debug, Default)]
pub struct Counters {
    /// Number of clients connected now.
    pub connected: AtomicU64,
    /// Number of clients accepted.
    pub accepted: AtomicU64,
    /// Number of clients refused because too many were connected.
    pub refused: AtomicU64,
    /// Number of frames sent or being sent, summed over clients.
    pub sent: AtomicU64,
    /// Number of frames skipped for a newer one, summed over clients.
    pub dropped: AtomicU64,
    /// Number of clients disconnected because they read nothing.
    pub stalled: AtomicU64,
}

/// Encoded messages of a frame.
#[derive(Default)]
pub(super) struct Encoded {
    pub(super) number: u64,
    pub(super) bytes: BytesMut,
}

/// The newest frame, shared by all clients.
#[derive(Default)]
pub(super) struct Latest {
    /// The newest frame; `None` before the first one, or if the newest could not be encoded.
    pub(super) frame: Option<Arc<Encoded>>,
    /// Number that the next frame will have.
    pub(super) next: u64,
}

impl Latest {
    /// Number of the first frame to send to a client that connects at this moment.
    fn first_due(&self) -> u64 {
        self.frame.as_ref().map_or(self.next, |frame| frame.number)
    }
}

/// Opens the listening socket. Accepted connections inherit its buffer size.
pub(super) fn listen(address: SocketAddr) -> std::io::Result<TcpListener> {
    let socket = if address.is_ipv4() { TcpSocket::new_v4() } else { TcpSocket::new_v6() }?;
    // Without this, a restarted server would find its port in use by connections that have ended.
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
    pub(super) slots: Arc<Semaphore>,
}

impl Server {
    pub(super) async fn run(self, listener: TcpListener) {
        loop {
            let accepted = tokio::select! {
                () = self.cancel.cancelled() => return,
                accepted = listener.accept() => accepted,
            };
            let Ok((stream, client)) = accepted else {
                // Probably too many files are open: waits before the next attempt.
                tokio::time::sleep(Duration::from_millis(100)).await;
                continue;
            };
            let Ok(slot) = Arc::clone(&self.slots).try_acquire_owned() else {
                self.counters.refused.fetch_add(1, Ordering::Relaxed);
                tracing::warn!("OpenIGTLink client {client} is turned away: too many are connected");
                continue;
            };
            let mut frames = self.latest.subscribe();
            // A client that connects while the picture is frozen gets the frozen frame.
            frames.mark_changed();
            let due = frames.borrow().first_due();
            // Counted last, so that a client that is counted gets the next frame.
            self.counters.accepted.fetch_add(1, Ordering::Relaxed);
            self.counters.connected.fetch_add(1, Ordering::Relaxed);
            tracing::info!("OpenIGTLink client {client} is connected");
            let (counters, cancel) = (Arc::clone(&self.counters), self.cancel.clone());
            tokio::spawn(async move {
                serve(stream, client, (frames, due), &counters, &cancel).await;
                counters.connected.fetch_sub(1, Ordering::Relaxed);
                drop(slot);
            });
        }
    }
}

/// Serves one client until it leaves, stalls, or the server ends.
async fn serve(
    stream: TcpStream,
    client: SocketAddr,
    (frames, due): (watch::Receiver<Latest>, u64),
    counters: &Counters,
    cancel: &CancellationToken,
) {
    // A failure costs latency only.
    let _ = stream.set_nodelay(true);
    let (reader, writer) = stream.into_split();
    let left = tokio::select! {
        () = cancel.cancelled() => "the server ends",
        () = discard(reader) => "it has left",
        left = feed(writer, frames, due, counters) => left,
    };
    tracing::info!("OpenIGTLink client {client} is disconnected: {left}");
}

/// Reads and discards a client's data until the client leaves.
async fn discard(mut reader: OwnedReadHalf) {
    let mut bytes = [0; 4096];
    while reader.read(&mut bytes).await.is_ok_and(|length| length > 0) {}
}

/// Sends a client every newest frame from number `due` on. Returns the reason why the connection ended.
async fn feed(
    mut writer: OwnedWriteHalf,
    mut frames: watch::Receiver<Latest>,
    mut due: u64,
    counters: &Counters,
) -> &'static str {
    while frames.changed().await.is_ok() {
        let Some(frame) = frames.borrow_and_update().frame.clone() else { continue };
        counters.dropped.fetch_add(frame.number.saturating_sub(due), Ordering::Relaxed);
        due = frame.number + 1;
        // Counted before it is sent, so that whoever has received the frame finds it counted.
        counters.sent.fetch_add(1, Ordering::Relaxed);
        let mut rest = &frame.bytes[..];
        while !rest.is_empty() {
            match tokio::time::timeout(STALL_LIMIT, writer.write(rest)).await {
                Ok(Ok(length)) if length > 0 => rest = &rest[length..],
                Ok(_) => return "it has left",
                Err(_) => {
                    counters.stalled.fetch_add(1, Ordering::Relaxed);
                    // The frames that arrived during the write count as dropped, including the newest.
                    counters.dropped.fetch_add(frames.borrow().next.saturating_sub(due), Ordering::Relaxed);
                    return "it read nothing for too long";
                }
            }
        }
    }
    "the server ends"
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Publishes a frame of one byte with the number `number`.
    fn publish(latest: &watch::Sender<Latest>, number: u64) {
        let frame = Some(Arc::new(Encoded { number, bytes: BytesMut::from(&[number as u8][..]) }));
        latest.send_replace(Latest { frame, next: number + 1 });
    }

    #[tokio::test]
    async fn frames_before_a_client_s_task_has_begun_count_as_dropped() {
        for newest_at_connection in [None, Some(4)] {
            let (latest, mut frames) = watch::channel(Latest { frame: None, next: 4 });
            if let Some(number) = newest_at_connection {
                publish(&latest, number);
            }
            frames.mark_changed();
            let due = frames.borrow().first_due();
            for number in 5..8 {
                publish(&latest, number);
            }
            drop(latest);
            let listener = listen("127.0.0.1:0".parse().unwrap()).unwrap();
            let _client = TcpStream::connect(listener.local_addr().unwrap()).await.unwrap();
            let (_, writer) = listener.accept().await.unwrap().0.into_split();
            let counters = Counters::default();
            feed(writer, frames, due, &counters).await;
            let counts = [&counters.sent, &counters.dropped].map(|counter| counter.load(Ordering::Relaxed));
            assert_eq!(counts, [1, 3], "connected at {newest_at_connection:?}");
        }
    }
}
