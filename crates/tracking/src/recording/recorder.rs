//! Recorder of a live station: writes on a separate thread, from a bounded queue that does not block the sender.

use std::mem;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use thiserror::Error;

use super::{Event, RecordingError, RecordingWriter, SessionPose};

/// Longest time between flushes to the operating system, even without new messages.
const FLUSH_AFTER: Duration = Duration::from_secs(1);

/// Name of the last event of a recording that the disk could not keep up with.
const ENDED: &str = "recording-ended";

/// Capacity of the queue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct QueueLimits {
    /// Largest number of tracker bytes in the queue.
    pub bytes: usize,
    /// Largest number of messages of any kind in the queue.
    pub messages: usize,
}

impl Default for QueueLimits {
    /// Default: nearly three minutes of the fastest tracker (240 records of 100 bytes per second).
    fn default() -> Self {
        Self { bytes: 4 << 20, messages: 1 << 16 }
    }
}

/// Reason for an early end of a recording.
#[derive(Debug, Error)]
pub enum RecorderError {
    /// The disk is full or disconnected. Everything written before is in the `.part` file.
    #[error("the recording ended: {0}")]
    Disk(#[from] RecordingError),
    /// The disk is too slow. The recording is complete up to that point.
    #[error("the recording ended since the disk does not follow: {messages} messages with {bytes} bytes waited for it")]
    Behind {
        /// Number of queued messages.
        messages: usize,
        /// Number of tracker bytes in these messages.
        bytes: usize,
    },
    /// The thread could not be started, or it panicked.
    #[error("the recording ended: its thread {0}")]
    Thread(String),
}

/// Totals of a [`Recorder`].
#[derive(Debug, Default)]
#[must_use]
pub struct Recorded {
    /// Number of accepted messages of tracker bytes.
    pub messages: u64,
    /// Number of tracker bytes in these messages.
    pub bytes: u64,
    /// Number of accepted poses of the probe.
    pub poses: u64,
    /// Number of accepted poses of the needle.
    pub needle_poses: u64,
    /// Number of accepted events.
    pub events: u64,
    /// Number of messages of any kind that came after the end of the recording.
    pub left_out: u64,
    /// Reason for an early end; `None` for a complete recording.
    pub failure: Option<Arc<RecorderError>>,
}

/// Writes one recording on a separate thread.
///
/// A recording has no gaps. If the disk is full or too slow, the recording ends and an error is logged.
/// [`RecorderHandle::failure`] gives the reason, and the station continues.
///
/// Only [`finish`](Self::finish) gives the file its final name. Dropping the recorder keeps the `.part`, or removes it
/// if no bytes and no pose were accepted.
pub struct Recorder {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

/// Sender of messages to a [`Recorder`], usable from any thread. No call waits for the disk, except
/// [`raw_within`](Self::raw_within).
#[derive(Clone)]
pub struct RecorderHandle {
    shared: Arc<Shared>,
}

struct Shared {
    queue: Mutex<Queue>,
    /// Notified when the queue is no longer empty, or the end of the recording is requested.
    filled: Condvar,
    /// Notified when the thread has taken the queue, or when the recording has ended.
    drained: Condvar,
    limits: QueueLimits,
}

#[derive(Default)]
struct Queue {
    batch: Batch,
    closing: bool,
    /// Whether the recorder was dropped: the file keeps its `.part` name.
    abandoned: bool,
    recorded: Recorded,
}

/// Queued messages. The thread swaps the whole batch with its own, to reuse the memory.
#[derive(Default)]
struct Batch {
    messages: Vec<Message>,
    /// Tracker bytes of all messages, concatenated.
    bytes: Vec<u8>,
}

enum Message {
    Raw { host_time_ns: u64, length: usize },
    Pose(SessionPose),
    NeedlePose(SessionPose),
    Event(Event),
}

/// Destination of a recorder.
trait Store: Send + 'static {
    fn raw(&mut self, host_time_ns: u64, bytes: &[u8]) -> Result<(), RecordingError>;
    fn pose(&mut self, pose: &SessionPose) -> Result<(), RecordingError>;
    fn needle_pose(&mut self, pose: &SessionPose) -> Result<(), RecordingError>;
    fn event(&mut self, event: &Event) -> Result<(), RecordingError>;
    fn flush(&mut self) -> Result<(), RecordingError>;
    fn finish(self) -> Result<(), RecordingError>;
    fn discard(self) -> Result<(), RecordingError>;
}

impl Store for RecordingWriter {
    fn raw(&mut self, host_time_ns: u64, bytes: &[u8]) -> Result<(), RecordingError> {
        self.raw(host_time_ns, bytes)
    }

    fn pose(&mut self, pose: &SessionPose) -> Result<(), RecordingError> {
        self.pose(pose)
    }

    fn needle_pose(&mut self, pose: &SessionPose) -> Result<(), RecordingError> {
        self.needle_pose(pose)
    }

    fn event(&mut self, event: &Event) -> Result<(), RecordingError> {
        self.event(event)
    }

    fn flush(&mut self) -> Result<(), RecordingError> {
        self.flush()
    }

    fn finish(self) -> Result<(), RecordingError> {
        self.finish()
    }

    fn discard(self) -> Result<(), RecordingError> {
        self.discard()
    }
}

impl Recorder {
    /// Starts to write to `writer`.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn start(writer: RecordingWriter, limits: QueueLimits) -> Result<Self, RecorderError> {
        Self::start_with(writer, limits)
    }

    fn start_with(store: impl Store, limits: QueueLimits) -> Result<Self, RecorderError> {
        let shared =
            Arc::new(Shared { queue: Mutex::default(), filled: Condvar::new(), drained: Condvar::new(), limits });
        let run = {
            let shared = Arc::clone(&shared);
            move || run(&shared, store)
        };
        let thread = thread::Builder::new()
            .name("recorder".to_owned())
            .spawn(run)
            .map_err(|error| RecorderError::Thread(format!("cannot be started: {error}")))?;
        Ok(Self { shared, thread: Some(thread) })
    }

    /// A handle for senders.
    pub fn handle(&self) -> RecorderHandle {
        RecorderHandle { shared: Arc::clone(&self.shared) }
    }

    /// Writes the queued messages and finishes the file. Later messages are dropped.
    pub fn finish(mut self) -> Recorded {
        self.close();
        mem::take(&mut self.shared.lock().recorded)
    }

    fn close(&mut self) {
        let Some(thread) = self.thread.take() else { return };
        self.shared.lock().closing = true;
        self.shared.filled.notify_one();
        if thread.join().is_err() {
            self.shared.lock().fail(RecorderError::Thread("panicked".to_owned()));
        }
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        self.shared.lock().abandoned = true;
        self.close();
    }
}

impl RecorderHandle {
    /// Records bytes of the tracker; the first arrived at `host_time_ns`.
    pub fn raw(&self, host_time_ns: u64, bytes: &[u8]) {
        self.raw_within(host_time_ns, bytes, Duration::ZERO);
    }

    /// Like [`raw`](Self::raw), but waits up to `patience` for space in a full queue before the recording is ended.
    /// For offline sources, which can wait.
    pub fn raw_within(&self, host_time_ns: u64, bytes: &[u8], patience: Duration) {
        self.shared.push(Message::Raw { host_time_ns, length: bytes.len() }, bytes, patience);
    }

    /// Records a pose of the probe used by the session.
    pub fn pose(&self, pose: SessionPose) {
        self.shared.push(Message::Pose(pose), &[], Duration::ZERO);
    }

    /// Records a pose of the needle used by the session.
    pub fn needle_pose(&self, pose: SessionPose) {
        self.shared.push(Message::NeedlePose(pose), &[], Duration::ZERO);
    }

    /// Records an event.
    pub fn event(&self, event: Event) {
        self.shared.push(Message::Event(event), &[], Duration::ZERO);
    }

    /// Reason for an early end of the recording; `None` if there was none.
    pub fn failure(&self) -> Option<Arc<RecorderError>> {
        self.shared.lock().recorded.failure.clone()
    }
}

impl Shared {
    /// Locks the queue. A panic under the lock does no harm, because the queue is consistent after every statement.
    fn lock(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn push(&self, message: Message, bytes: &[u8], patience: Duration) {
        let full = |queue: &Queue| {
            let Batch { messages, bytes: waiting } = &queue.batch;
            messages.len() >= self.limits.messages || waiting.len() + bytes.len() > self.limits.bytes
        };
        let mut queue = self.lock();
        if !patience.is_zero() {
            let wait = self.drained.wait_timeout_while(queue, patience, |queue| full(queue) && !queue.ending());
            (queue, _) = wait.unwrap_or_else(PoisonError::into_inner);
        }
        if queue.ending() {
            queue.recorded.left_out += 1;
            return;
        }
        if full(&queue) {
            let Batch { messages, bytes: waiting } = &queue.batch;
            let error = RecorderError::Behind { messages: messages.len(), bytes: waiting.len() };
            queue.recorded.left_out += 1;
            queue.fail(error);
            return;
        }
        match &message {
            Message::Raw { .. } => queue.recorded.messages += 1,
            Message::Pose(_) => queue.recorded.poses += 1,
            Message::NeedlePose(_) => queue.recorded.needle_poses += 1,
            Message::Event(_) => queue.recorded.events += 1,
        }
        queue.recorded.bytes += bytes.len() as u64;
        queue.batch.bytes.extend_from_slice(bytes);
        queue.batch.messages.push(message);
        drop(queue);
        self.filled.notify_one();
    }
}

impl Queue {
    /// Stores an error, unless there is an earlier one.
    fn fail(&mut self, error: RecorderError) {
        if self.recorded.failure.is_none() {
            tracing::error!("{error}");
            self.recorded.failure = Some(Arc::new(error));
        }
    }

    fn ending(&self) -> bool {
        self.closing || self.recorded.failure.is_some()
    }
}

/// Thread function: writes batches until the end is requested and the queue is empty.
fn run(shared: &Shared, mut store: impl Store) {
    let mut batch = Batch::default();
    let mut last_ns = 0;
    let mut unflushed = false;
    loop {
        let queue = shared.lock();
        let wait = shared
            .filled
            .wait_timeout_while(queue, FLUSH_AFTER, |queue| queue.batch.messages.is_empty() && !queue.ending());
        let (mut queue, _) = wait.unwrap_or_else(PoisonError::into_inner);
        mem::swap(&mut queue.batch, &mut batch);
        let ending = queue.ending();
        drop(queue);
        shared.drained.notify_all();
        let idle = batch.messages.is_empty();
        if idle && ending {
            break;
        }
        let written = match idle {
            true if unflushed => store.flush(),
            true => Ok(()),
            false => batch.write(&mut store, &mut last_ns),
        };
        unflushed = !idle;
        if let Err(error) = written {
            // The store is dropped unfinished: complete chunks stay in its `.part`.
            shared.lock().fail(error.into());
            shared.drained.notify_all();
            return;
        }
    }
    let queue = shared.lock();
    let (abandoned, behind) = (queue.abandoned, queue.recorded.failure.clone());
    let empty = queue.recorded.bytes == 0 && queue.recorded.poses == 0;
    drop(queue);
    let noted = match behind {
        Some(error) => store.event(&Event::new(last_ns, ENDED).with(error.to_string())),
        None => Ok(()),
    };
    let ended = noted.and_then(|()| match (abandoned, empty) {
        (false, _) => store.finish(),
        (true, true) => store.discard(),
        (true, false) => store.flush(),
    });
    if let Err(error) = ended {
        shared.lock().fail(error.into());
    }
}

impl Batch {
    /// Writes all messages in order and empties the batch.
    fn write(&mut self, store: &mut impl Store, last_ns: &mut u64) -> Result<(), RecordingError> {
        let mut start = 0;
        for message in self.messages.drain(..) {
            match message {
                Message::Raw { host_time_ns, length } => {
                    *last_ns = host_time_ns;
                    store.raw(host_time_ns, self.bytes.get(start..start + length).unwrap_or_default())?;
                    start += length;
                }
                Message::Pose(pose) => {
                    *last_ns = pose.host_time_ns;
                    store.pose(&pose)?;
                }
                Message::NeedlePose(pose) => {
                    *last_ns = pose.host_time_ns;
                    store.needle_pose(&pose)?;
                }
                Message::Event(event) => {
                    *last_ns = event.host_time_ns;
                    store.event(&event)?;
                }
            }
        }
        self.bytes.clear();
        Ok(())
    }
}

#[cfg(test)]
mod tests;
