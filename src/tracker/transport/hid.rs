//! HID devices. hidapi blocks, so it has a thread of its own; each report is one message.

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

/// Longest report, bytes: that of a full-speed interrupt endpoint.
const REPORT: usize = 64;

/// Reports that may wait for the session, half a second of them. They aren't dropped: the thread waits.
const WAITING: usize = 64;

/// How often the thread looks whether it is still wanted, ms.
const LOOK_MS: i32 = 50;

/// A report and when it came.
struct Report {
    time_ns: u64,
    length: usize,
    bytes: [u8; REPORT],
}

/// A HID device.
pub(in crate::tracker) struct HidPort {
    device: Option<PortName>,
    open: Option<Open>,
}

struct Open {
    reports: mpsc::Receiver<io::Result<Report>>,
    unwanted: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl HidPort {
    pub(super) fn new(device: Option<PortName>) -> Self {
        Self { device, open: None }
    }

    pub(super) async fn open(&mut self) -> io::Result<String> {
        self.close();
        let (sender, reports) = mpsc::channel(WAITING);
        let (opened, name) = oneshot::channel();
        let unwanted = Arc::new(AtomicBool::new(false));
        let (device, flag) = (self.device.clone(), unwanted.clone());
        let thread = std::thread::Builder::new()
            .name("hid".to_owned())
            .spawn(move || read(device.as_ref(), opened, &sender, &flag))?;
        // From here on dropping it ends the thread, too.
        let open = Open { reports, unwanted, thread: Some(thread) };
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
        self.unwanted.store(true, Ordering::Relaxed);
        self.reports.close();
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("the thread that reads the HID device panicked");
        }
    }
}

/// The thread: opens the device, then hands each report on until nobody wants them.
fn read(
    device: Option<&PortName>,
    opened: oneshot::Sender<io::Result<String>>,
    reports: &mpsc::Sender<io::Result<Report>>,
    unwanted: &AtomicBool,
) {
    let (hid, name) = match devices::open_hid(device) {
        Ok(found) => found,
        Err(error) => {
            // Where nobody listens any more, nobody wants to know.
            let _ = opened.send(Err(error));
            return;
        }
    };
    let _ = opened.send(Ok(name));
    while !unwanted.load(Ordering::Relaxed) {
        let mut bytes = [0; REPORT];
        let report = match hid.read_timeout(&mut bytes, LOOK_MS) {
            Ok(0) => continue,
            Ok(length) => Ok(Report { time_ns: host_time_ns(), length, bytes }),
            Err(error) => Err(io::Error::other(format!("the HID device is gone (unplugged?): {error}"))),
        };
        let failed = report.is_err();
        if reports.blocking_send(report).is_err() || failed {
            return;
        }
    }
}
