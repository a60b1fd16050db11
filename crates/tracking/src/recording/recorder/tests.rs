//! Tests of the recorder.

use std::sync::mpsc::{Receiver, Sender, channel};

use super::super::{RecordingInfo, part_path};
use super::*;

/// Call that a store received.
#[derive(Debug, PartialEq)]
enum Seen {
    Raw(u64, Vec<u8>),
    Pose,
    Event(String, Option<serde_json::Value>),
    Finished,
    Discarded,
}

/// A disk that accepts one message for each value from `gate`, and fails if that value is false.
struct Disk {
    gate: Receiver<bool>,
    seen: Sender<Seen>,
}

impl Disk {
    fn take(&mut self, seen: Seen) -> Result<(), RecordingError> {
        // A dropped gate accepts everything.
        if self.gate.recv() == Ok(false) {
            return Err(RecordingError::Write { path: "disk".into(), reason: "it is full".into() });
        }
        let _ = self.seen.send(seen);
        Ok(())
    }
}

impl Store for Disk {
    fn raw(&mut self, host_time_ns: u64, bytes: &[u8]) -> Result<(), RecordingError> {
        self.take(Seen::Raw(host_time_ns, bytes.to_vec()))
    }

    fn pose(&mut self, _: &SessionPose) -> Result<(), RecordingError> {
        self.take(Seen::Pose)
    }

    fn needle_pose(&mut self, _: &SessionPose) -> Result<(), RecordingError> {
        self.take(Seen::Pose)
    }

    fn event(&mut self, event: &Event) -> Result<(), RecordingError> {
        self.take(Seen::Event(event.name.clone(), event.value.clone()))
    }

    fn flush(&mut self) -> Result<(), RecordingError> {
        Ok(())
    }

    fn finish(mut self) -> Result<(), RecordingError> {
        self.take(Seen::Finished)
    }

    fn discard(mut self) -> Result<(), RecordingError> {
        self.take(Seen::Discarded)
    }
}

fn recorder(limits: QueueLimits) -> (Recorder, Sender<bool>, Receiver<Seen>) {
    let ((open, gate), (seen, look)) = (channel(), channel());
    (Recorder::start_with(Disk { gate, seen }, limits).unwrap(), open, look)
}

#[test]
fn everything_is_written_in_order() {
    let (recorder, open, look) = recorder(QueueLimits::default());
    drop(open);
    let handle = recorder.handle();
    for i in 0..1000_u64 {
        handle.raw(i, &i.to_le_bytes());
        if i == 500 {
            handle.event(Event::new(i, "gain").with(3.5));
        }
    }
    let recorded = recorder.finish();
    assert_eq!((recorded.messages, recorded.bytes, recorded.events, recorded.left_out), (1000, 8000, 1, 0));
    assert!(recorded.failure.is_none());
    let mut seen = look.iter();
    for i in 0..1000_u64 {
        assert_eq!(seen.next(), Some(Seen::Raw(i, i.to_le_bytes().to_vec())));
        if i == 500 {
            assert_eq!(seen.next(), Some(Seen::Event("gain".into(), Some(3.5.into()))));
        }
    }
    assert_eq!(seen.next(), Some(Seen::Finished));
    handle.raw(0, b"late");
    assert_eq!(handle.shared.lock().recorded.left_out, 1);
}

#[test]
fn a_disk_that_hangs_ends_the_recording_and_blocks_nobody() {
    let (recorder, open, look) = recorder(QueueLimits { bytes: 100, messages: 1000 });
    let handle = recorder.handle();
    // The disk accepts nothing, yet each call returns.
    let taken = (0..1000_u64).take_while(|i| {
        handle.raw(*i, &[7; 10]);
        handle.failure().is_none()
    });
    let taken = taken.count() as u64;
    // At most ten in the queue and ten taken earlier by the thread.
    assert!((10..=20).contains(&taken), "{taken}");
    assert!(matches!(*handle.failure().unwrap(), RecorderError::Behind { bytes: 100, messages: 10 }));
    handle.raw(2000, b"later");
    drop(open);
    let recorded = recorder.finish();
    assert_eq!((recorded.messages, recorded.left_out), (taken, 2));
    let seen: Vec<_> = look.iter().collect();
    // All accepted messages without a gap, then the reason for the end, then a complete file.
    assert_eq!(seen.len() as u64, taken + 2);
    for (i, seen) in (0..taken).zip(&seen) {
        assert_eq!(*seen, Seen::Raw(i, vec![7; 10]));
    }
    let [.., Seen::Event(name, Some(reason)), Seen::Finished] = &seen[..] else { panic!("{seen:?}") };
    assert!(name == ENDED && reason.as_str().unwrap().contains("10 messages with 100 bytes"), "{reason}");
}

#[test]
fn a_source_that_can_wait_loses_nothing_to_a_small_queue_and_is_not_blocked_forever() {
    let (recorder, open, look) = recorder(QueueLimits { bytes: 100, messages: 3 });
    let handle = recorder.handle();
    let patience = Duration::from_secs(600);
    let writer = thread::spawn(move || {
        (0..500_u64).for_each(|i| handle.raw_within(i, &i.to_le_bytes(), patience));
        handle
    });
    for i in 0..500_u64 {
        open.send(true).unwrap();
        assert_eq!(look.recv(), Ok(Seen::Raw(i, i.to_le_bytes().to_vec())));
    }
    let handle = writer.join().unwrap();
    // The disk accepts nothing from here on.
    (0..50).for_each(|i| handle.raw_within(i, b"x", Duration::from_millis(1)));
    assert!(matches!(*handle.failure().unwrap(), RecorderError::Behind { messages: 3, .. }));
    drop(open);
    let recorded = recorder.finish();
    assert!((503..=506).contains(&recorded.messages), "{recorded:?}");
}

#[test]
fn a_full_disk_ends_the_recording_at_once() {
    let (recorder, open, look) = recorder(QueueLimits::default());
    let handle = recorder.handle();
    for word in [true, true, false] {
        open.send(word).unwrap();
    }
    for i in 0..10 {
        handle.raw(i, b"x");
    }
    let recorded = recorder.finish();
    let failure = recorded.failure.unwrap().to_string();
    assert_eq!(failure, "the recording ended: cannot write the recording disk: it is full");
    // The file is not finished: its `.part` stays.
    assert_eq!(look.iter().count(), 2);
}

#[test]
fn a_recorder_that_is_dropped_finishes_no_file() {
    let (taken, open, look) = recorder(QueueLimits::default());
    drop(open);
    taken.handle().raw(1, b"x");
    drop(taken);
    assert_eq!(look.iter().collect::<Vec<_>>(), [Seen::Raw(1, b"x".to_vec())]);
    let (unused, open, look) = recorder(QueueLimits::default());
    drop(open);
    drop(unused);
    assert_eq!(look.iter().collect::<Vec<_>>(), [Seen::Discarded]);
}

#[test]
fn a_recorder_that_is_dropped_leaves_an_earlier_recording_alone() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.mcap");
    std::fs::write(&path, "earlier").unwrap();
    let info = RecordingInfo { start_time_ns: 1, ..RecordingInfo::default() };
    for (bytes, part) in [(&b""[..], false), (b"x", true)] {
        let writer = RecordingWriter::create(&path, &info).unwrap();
        let recorder = Recorder::start(writer, QueueLimits::default()).unwrap();
        if !bytes.is_empty() {
            recorder.handle().raw(1, bytes);
        }
        drop(recorder);
        assert_eq!((std::fs::read(&path).unwrap(), part_path(&path).exists()), (b"earlier".to_vec(), part));
    }
}
