//! HID transport. hidapi blocks, so it runs on a separate thread; each report is one message.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use bytes::BytesMut;
use tokio::sync::{mpsc, oneshot};

use super::{Received, not_open};
use crate::tracker::clock::host_time_ns;
use crate::tracker::devices;
use crate::tracker::settings::PortName;

/// Longest report, bytes, of a full-speed interrupt endpoint.
const REPORT_BYTES: usize = 64;

/// Capacity of the report queue, half a second of reports. If it is full, the thread waits.
const QUEUE_CAPACITY: usize = 64;

/// Interval at which the thread checks the stop flag, ms.
const POLL_MS: i32 = 50;

/// A report and its arrival time.
struct HidReport {
    time_ns: u64,
    length: usize,
    bytes: [u8; REPORT_BYTES],
}

/// A HID device.
pub(in crate::tracker) struct HidPort {
    device: Option<PortName>,
    open: Option<Open>,
}

struct Open {
    reports: mpsc::Receiver<io::Result<HidReport>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl HidPort {
    pub(super) fn new(device: Option<PortName>) -> Self {
        Self { device, open: None }
    }

    pub(super) async fn open(&mut self) -> io::Result<String> {
        self.close();
        let (sender, reports) = mpsc::channel(QUEUE_CAPACITY);
        let (opened, name) = oneshot::channel();
        let stop = Arc::new(AtomicBool::new(false));
        let (device, flag) = (self.device.clone(), stop.clone());
        let thread = std::thread::Builder::new()
            .name("hid".to_owned())
            .spawn(move || read(device.as_ref(), opened, &sender, &flag))?;
        // From here on, dropping `open` also ends the thread.
        let open = Open { reports, stop, thread: Some(thread) };
        let name = name.await.map_err(|_| io::Error::other("the thread that reads the HID device ended"))??;
        self.open = Some(open);
        Ok(name)
    }

    pub(super) async fn receive(&mut self, piece: &mut BytesMut) -> io::Result<Received> {
        let reports = &mut self.open.as_mut().ok_or_else(not_open)?.reports;
        let report = reports.recv().await.ok_or_else(not_open)??;
        piece.extend_from_slice(&report.bytes[..report.length]);
        Ok(Received::Bytes { time_ns: Some(report.time_ns) })
    }

    pub(super) fn close(&mut self) {
        self.open = None;
    }
}

impl Drop for Open {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.reports.close();
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("the thread that reads the HID device panicked");
        }
    }
}

/// Thread function: opens the device, then forwards each report until `stop` is set.
fn read(
    device: Option<&PortName>,
    opened: oneshot::Sender<io::Result<String>>,
    reports: &mpsc::Sender<io::Result<HidReport>>,
    stop: &AtomicBool,
) {
    let (hid, name) = match devices::open_hid(device) {
        Ok(found) => found,
        Err(error) => {
            // If the receiver is gone, the error is not needed.
            let _ = opened.send(Err(error));
            return;
        }
    };
    let _ = opened.send(Ok(name));
    while !stop.load(Ordering::Relaxed) {
        let mut bytes = [0; REPORT_BYTES];
        let report = match hid.read_timeout(&mut bytes, POLL_MS) {
            Ok(0) => continue,
            Ok(length) => Ok(HidReport { time_ns: host_time_ns(), length, bytes }),
            Err(error) => Err(io::Error::other(format!("the HID device is gone (unplugged?): {error}"))),
        };
        let failed = report.is_err();
        if reports.blocking_send(report).is_err() || failed {
            return;
        }
    }
}
