//! A log of all presented frames, one line of JSON each.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::SinkError;
use super::file::create;
use super::frame_line::FrameLine;
use crate::presented::PresentedFrame;

/// Largest number of bytes that wait for the disk: about four minutes of lines at 30 frames per second.
const WAITING_MAX: usize = 4 << 20;

/// Log that loses no line to a slow disk.
///
/// Lines wait in a bounded buffer, from which a thread writes them to disk. If the buffer is full,
/// [`push`](Self::push) waits for it and counts the line as `waited`. Lines on disk stay readable if the process is
/// killed.
#[derive(Debug)]
pub struct FrameLog {
    shared: Arc<Shared>,
    /// Buffer for the current line.
    line: Vec<u8>,
    thread: Option<JoinHandle<()>>,
    counts: LogCounts,
}

/// Counts of lines.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LogCounts {
    /// Number of lines that were pushed.
    pub pushed: u64,
    /// Number of pushed lines that had to wait for the disk.
    pub waited: u64,
    /// Number of lines lost because the file could not be written.
    pub failed: u64,
}

/// Outcome of finishing a log.
#[derive(Debug)]
pub enum LogEnd {
    /// Every line is in the file.
    Complete,
    /// The file cannot be written.
    Failed(SinkError),
    /// The disk did not take the lines in time; the thread is abandoned.
    Stuck,
}

#[derive(Debug)]
struct Shared {
    queue: Mutex<Queue>,
    changed: Condvar,
    waiting_max: usize,
}

#[derive(Debug, Default)]
struct Queue {
    /// Complete lines that wait for the writer.
    bytes: Vec<u8>,
    /// Number of lines in `bytes`.
    lines: u64,
    closed: bool,
    ended: bool,
    error: Option<SinkError>,
    /// Lines lost to the error of the writer.
    failed: u64,
}

impl FrameLog {
    /// Replaces the file at `path` by an empty log.
    ///
    /// # Errors
    /// The file cannot be created, or the system refuses a thread.
    pub fn create(path: &Path) -> Result<Self, SinkError> {
        Self::to_writer(create(path)?, path, WAITING_MAX)
    }

    /// Logs to `writer` with a buffer of at most `waiting_max` bytes. Errors name `path`.
    ///
    /// # Errors
    /// The system refuses a thread.
    pub fn to_writer(writer: impl Write + Send + 'static, path: &Path, waiting_max: usize) -> Result<Self, SinkError> {
        let shared = Arc::new(Shared { queue: Mutex::default(), changed: Condvar::new(), waiting_max });
        let (own, writer_path) = (shared.clone(), path.to_owned());
        let thread = std::thread::Builder::new()
            .name("metrics".to_owned())
            .spawn(move || own.write(writer, writer_path))
            .map_err(SinkError::io(path))?;
        Ok(Self { shared, line: Vec::new(), thread: Some(thread), counts: LogCounts::default() })
    }

    /// Adds the line of a frame. Returns whether it had to wait for the disk.
    ///
    /// # Errors
    /// The file cannot be written. Returned once; later lines are counted as failed.
    pub fn push(&mut self, frame: &PresentedFrame) -> Result<bool, SinkError> {
        self.line.clear();
        // Cannot fail: it writes to memory, and all keys are strings.
        let _ = serde_json::to_writer(&mut self.line, &FrameLine::new(frame));
        self.line.push(b'\n');
        self.counts.pushed += 1;
        let mut queue = self.shared.lock();
        let mut waits = false;
        while queue.has_no_room(self.line.len(), self.shared.waiting_max) {
            waits = true;
            queue = self.shared.changed.wait(queue).unwrap_or_else(PoisonError::into_inner);
        }
        self.counts.waited += u64::from(waits);
        if queue.ended {
            queue.failed += 1;
            return queue.error.take().map_or(Ok(waits), Err);
        }
        queue.bytes.extend_from_slice(&self.line);
        queue.lines += 1;
        drop(queue);
        self.shared.changed.notify_all();
        Ok(waits)
    }

    /// Waits up to `patience` for the last line to be written. Returns the counts of lines, and whether the log is
    /// complete.
    pub fn finish(mut self, patience: Duration) -> (LogCounts, LogEnd) {
        self.close();
        let until = Instant::now() + patience;
        let mut queue = self.shared.lock();
        while !queue.ended {
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return (self.counts, LogEnd::Stuck);
            }
            queue = self.shared.changed.wait_timeout(queue, left).unwrap_or_else(PoisonError::into_inner).0;
        }
        let counts = LogCounts { failed: queue.failed, ..self.counts };
        let end = queue.error.take().map_or(LogEnd::Complete, LogEnd::Failed);
        drop(queue);
        // Does not block: the thread's work is done.
        let _ = self.thread.take().map(JoinHandle::join);
        (counts, end)
    }

    fn close(&self) {
        self.shared.lock().closed = true;
        self.shared.changed.notify_all();
    }
}

impl Drop for FrameLog {
    fn drop(&mut self) {
        self.close();
    }
}

impl Queue {
    /// Whether `length` more bytes exceed the limit. An empty buffer takes a line of any length.
    fn has_no_room(&self, length: usize, waiting_max: usize) -> bool {
        !self.ended && !self.bytes.is_empty() && self.bytes.len() + length > waiting_max
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes lines until the log is closed and empty, or the writer fails.
    fn write(&self, mut writer: impl Write, path: PathBuf) {
        let mut taken = Vec::new();
        loop {
            let mut queue = self.lock();
            while queue.bytes.is_empty() && !queue.closed {
                queue = self.changed.wait(queue).unwrap_or_else(PoisonError::into_inner);
            }
            if queue.bytes.is_empty() {
                queue.ended = true;
                break;
            }
            std::mem::swap(&mut taken, &mut queue.bytes);
            let lines = std::mem::take(&mut queue.lines);
            drop(queue);
            self.changed.notify_all();
            if let Err(error) = writer.write_all(&taken).and_then(|()| writer.flush()) {
                let mut queue = self.lock();
                queue.failed += lines + std::mem::take(&mut queue.lines);
                queue.bytes.clear();
                (queue.error, queue.ended) = (Some(SinkError::io(&path)(error)), true);
                break;
            }
            taken.clear();
        }
        self.changed.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use super::super::live_video::tests::frame;
    use super::*;

    /// Writer that takes `delay` per write, and fails after `limit` bytes.
    struct Slow {
        written: Arc<Mutex<Vec<u8>>>,
        delay: Duration,
        limit: usize,
    }

    impl Write for Slow {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            std::thread::sleep(self.delay);
            let mut written = self.written.lock().unwrap();
            if written.len() >= self.limit {
                return Err(std::io::ErrorKind::StorageFull.into());
            }
            let taken = bytes.len().min(300);
            written.extend_from_slice(&bytes[..taken]);
            Ok(taken)
        }

        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    fn slow(limit: usize) -> (FrameLog, Arc<Mutex<Vec<u8>>>) {
        let written = Arc::<Mutex<Vec<u8>>>::default();
        let writer = Slow { written: written.clone(), delay: Duration::from_micros(200), limit };
        (FrameLog::to_writer(writer, Path::new("frames.jsonl"), 2000).unwrap(), written)
    }

    #[test]
    fn a_slow_writer_holds_frames_up_and_loses_none() {
        let (mut log, written) = slow(usize::MAX);
        for number in 0..500 {
            log.push(&frame(number, 50 * number)).unwrap();
            assert!(log.shared.lock().bytes.len() <= 2000);
        }
        let (counts, end) = log.finish(Duration::from_secs(60));
        assert!(matches!(end, LogEnd::Complete));
        assert!(counts.waited > 20, "{counts:?}");
        assert_eq!((counts.pushed, counts.failed), (500, 0));
        let text = String::from_utf8(std::mem::take(&mut written.lock().unwrap())).unwrap();
        let number = |line: &str| serde_json::from_str::<serde_json::Value>(line).unwrap()["number"].as_u64().unwrap();
        assert_eq!(text.lines().map(number).collect::<Vec<_>>(), (0..500).collect::<Vec<_>>());
    }

    #[test]
    fn a_full_disk_is_said_once_and_counted() {
        let (mut log, _) = slow(5000);
        let errors = (0..200).filter(|&number| log.push(&frame(number, 0)).is_err()).count();
        let (counts, end) = log.finish(Duration::from_secs(60));
        assert_eq!(errors, 1);
        assert!(matches!(end, LogEnd::Complete), "the error was said already");
        assert!(counts.failed > 150 && counts.pushed == 200, "{counts:?}");
    }

    #[test]
    fn a_disk_that_hangs_is_not_waited_for_without_bound() {
        struct Hangs;
        impl Write for Hangs {
            fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
                loop {
                    std::thread::park();
                }
            }

            fn flush(&mut self) -> std::io::Result<()> {
                Ok(())
            }
        }
        let mut log = FrameLog::to_writer(Hangs, Path::new("frames.jsonl"), 1 << 20).unwrap();
        log.push(&frame(0, 0)).unwrap();
        assert!(matches!(log.finish(Duration::from_millis(20)).1, LogEnd::Stuck));
    }
}
