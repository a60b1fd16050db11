//! On-demand access to the poses of a live tracker.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::Duration;

use insonify_core::pose::{Pose, Reading};

use super::{Listener, Monitor, Record, SensorName, TrackerEvent, TrackerReport};

/// Capacity of the queue of poses; poses beyond it are dropped.
const QUEUE_CAPACITY: usize = 1024;

/// Sending end: a listener that forwards poses while they are requested.
#[derive(Debug)]
pub struct PoseTap {
    shared: Arc<Shared>,
    sender: SyncSender<Pose>,
    monitor: Monitor,
}

/// Receiving end of a [`PoseTap`].
#[derive(Debug)]
pub struct PoseStream {
    shared: Arc<Shared>,
    receiver: Receiver<Pose>,
    monitor: Monitor,
}

#[derive(Debug, Default)]
struct Shared {
    open: AtomicBool,
    without_pose: AtomicU64,
}

/// A connected pair of tap and stream.
pub fn pose_tap() -> (PoseTap, PoseStream) {
    let (sender, receiver) = sync_channel(QUEUE_CAPACITY);
    let (shared, monitor) = (Arc::<Shared>::default(), Monitor::default());
    let stream = PoseStream { shared: shared.clone(), receiver, monitor: monitor.clone() };
    (PoseTap { shared, sender, monitor }, stream)
}

impl fmt::Display for PoseStream {
    /// State of the tracker, for error messages.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let report = self.report();
        write!(f, "the tracker is {}", report.state.name())?;
        if self.without_pose() > 0 {
            write!(f, ", {} records held no position", self.without_pose())?;
        }
        report.events.last().map_or(Ok(()), |event| write!(f, " (last: {event})"))
    }
}

impl Listener for PoseTap {
    fn bytes(&mut self, host_time_ns: u64, bytes: &[u8]) {
        self.monitor.bytes(host_time_ns, bytes);
    }

    fn heard(&mut self, host_time_ns: u64, sensor: &SensorName, record: &Record) {
        self.monitor.heard(host_time_ns, sensor, record);
    }

    fn record(&mut self, host_time_ns: u64, record: &Record) {
        self.monitor.record(host_time_ns, record);
        if !self.shared.open.load(Ordering::Acquire) {
            return;
        }
        match record.reading {
            // If the queue is full, new poses are dropped, so the queued poses are a sequence without gaps.
            Reading::Pose(pose) => drop(self.sender.try_send(pose)),
            _ => drop(self.shared.without_pose.fetch_add(1, Ordering::Relaxed)),
        }
    }

    fn event(&mut self, host_time_ns: u64, event: &TrackerEvent) {
        self.monitor.event(host_time_ns, event);
    }
}

impl PoseStream {
    /// Iterator over poses measured from now on. It ends when no pose arrives for `silence`, or with the session.
    pub fn poses(&self, silence: Duration) -> Poses<'_> {
        while self.receiver.try_recv().is_ok() {}
        self.shared.without_pose.store(0, Ordering::Relaxed);
        self.shared.open.store(true, Ordering::Release);
        Poses { stream: self, silence }
    }

    /// Number of records without a pose since the last call of [`poses`](Self::poses): the sensor was out of view, or
    /// the device measures no position.
    pub fn without_pose(&self) -> u64 {
        self.shared.without_pose.load(Ordering::Relaxed)
    }

    /// Statistics of the tracker since the last report.
    pub fn report(&self) -> TrackerReport {
        self.monitor.report()
    }
}

/// Iterator over poses as they arrive.
#[derive(Debug)]
pub struct Poses<'a> {
    stream: &'a PoseStream,
    silence: Duration,
}

impl Iterator for Poses<'_> {
    type Item = Pose;

    fn next(&mut self) -> Option<Pose> {
        self.stream.receiver.recv_timeout(self.silence).ok()
    }
}

impl Drop for Poses<'_> {
    fn drop(&mut self) {
        self.stream.shared.open.store(false, Ordering::Release);
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn only_poses_of_the_requested_time_are_delivered() {
        let (mut tap, stream) = pose_tap();
        let record = |x: u32| {
            let pose = Pose { position_mm: DVec3::X * f64::from(x), ..Pose::IDENTITY };
            Record::pose(x, 0, pose)
        };
        tap.record(0, &record(1));
        let mut poses = stream.poses(Duration::ZERO);
        assert_eq!(poses.next(), None);
        tap.record(0, &record(2));
        tap.record(0, &Record { reading: Reading::OutOfView, ..record(3) });
        assert_eq!(poses.next().unwrap().position_mm.x, 2.0);
        assert_eq!((poses.next(), stream.without_pose()), (None, 1));
        drop(poses);
        tap.record(0, &record(4));
        assert_eq!(stream.poses(Duration::ZERO).next(), None);
        // Without a receiver the queue stays bounded.
        let poses = stream.poses(Duration::ZERO);
        (0..5000).for_each(|x| tap.record(0, &record(x)));
        assert_eq!(poses.count(), QUEUE_CAPACITY);
        assert_eq!(stream.report().records, 5004);
    }
}
