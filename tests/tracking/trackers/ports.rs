//! Tests of devices on pseudo-terminals.

use std::fs::File;
use std::io::{Read, Write};
use std::os::fd::OwnedFd;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use insonify::pose::{Pose, Reading};
use insonify::tracker::{NeedleSensor, PortName, Protocol, Record, Settings, TrackerEvent, Transport, ascii_line};
use nix::fcntl::{FcntlArg, OFlag, fcntl};
use nix::pty::openpty;
use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};

use crate::trackers::listener::{Live, connected, decode_error, disconnected};
use crate::trackers::polhemus::{Kind, Polhemus};

/// Emulated device at the far end of a terminal.
pub trait Board: Send + 'static {
    /// Tells the device the line speed that the host has set, baud.
    fn at_speed(&mut self, _baud: u32) {}
    fn receive(&mut self, now: Duration, bytes: &[u8]);
    fn next_record(&mut self, now: Duration) -> Option<Vec<u8>>;
}

impl Board for Polhemus {
    fn receive(&mut self, now: Duration, bytes: &[u8]) {
        Polhemus::receive(self, now, bytes);
    }

    fn next_record(&mut self, now: Duration) -> Option<Vec<u8>> {
        Polhemus::next_record(self, now)
    }
}

/// A hobby board that sends a line every 5 ms; the field counts them.
struct Lines(u32);

pub fn line(n: u32) -> String {
    let pose = Pose::from_components([f64::from(n), 2.0, 3.0, 1.0, 0.0, 0.0, 0.0]).unwrap();
    ascii_line::encode(n, u64::from(n) * 5000, &pose)
}

impl Board for Lines {
    fn receive(&mut self, _: Duration, _: &[u8]) {}

    fn next_record(&mut self, now: Duration) -> Option<Vec<u8>> {
        if now < Duration::from_millis(5) * self.0 {
            return None;
        }
        self.0 += 1;
        Some(line(self.0 - 1).into_bytes())
    }
}

pub enum Order {
    /// Sends only this many bytes of the next record and then nothing; answers with the total of bytes sent.
    Cut(usize, mpsc::Sender<usize>),
    /// Disappears, as if it were unplugged.
    Unplug,
    /// Flips bits of one byte in each of this many next records.
    Damage(usize),
    /// Falls silent (true) or sends again (false); its output in between is lost.
    Mute(bool),
}

/// A board on a pseudo-terminal behind a symbolic link, like those that udev creates by id.
pub struct Terminal {
    orders: mpsc::Sender<Order>,
    thread: Option<JoinHandle<()>>,
}

impl Terminal {
    pub fn plug_in(link: &Path, board: impl Board) -> Self {
        let pty = openpty(None, None).unwrap();
        let mut termios = tcgetattr(&pty.slave).unwrap();
        cfmakeraw(&mut termios);
        tcsetattr(&pty.slave, SetArg::TCSANOW, &termios).unwrap();
        let flags = OFlag::from_bits_truncate(fcntl(&pty.master, FcntlArg::F_GETFL).unwrap());
        fcntl(&pty.master, FcntlArg::F_SETFL(flags | OFlag::O_NONBLOCK)).unwrap();
        // In one step, as udev does.
        let new = link.with_extension("new");
        symlink(nix::unistd::ttyname(&pty.slave).unwrap(), &new).unwrap();
        std::fs::rename(&new, link).unwrap();
        let (orders, receiver) = mpsc::channel();
        let thread = std::thread::spawn(move || serve(pty.master, pty.slave, board, &receiver));
        Self { orders, thread: Some(thread) }
    }

    pub fn order(&self, order: Order) {
        self.orders.send(order).unwrap();
    }

    /// Waits until the board has ended.
    pub fn join(mut self) {
        self.thread.take().unwrap().join().unwrap();
    }
}

/// Line speed of a terminal, baud, including non-standard ones; `None` if it can't be read.
#[cfg(target_os = "linux")]
fn speed(terminal: &File) -> Option<u32> {
    use std::os::fd::AsRawFd;
    let mut settings = std::mem::MaybeUninit::<nix::libc::termios2>::zeroed();
    // SAFETY: the descriptor is open, the structure is the one that this request fills, and all zeros are a valid one.
    let settings = unsafe {
        let done = nix::libc::ioctl(terminal.as_raw_fd(), nix::libc::TCGETS2, settings.as_mut_ptr());
        (done == 0).then(|| settings.assume_init())
    };
    settings.map(|settings| settings.c_ospeed)
}

#[cfg(not(target_os = "linux"))]
fn speed(_: &File) -> Option<u32> {
    None
}

/// Loop of the board. It also holds the near end open, since a terminal that nobody has open reports errors.
fn serve(master: OwnedFd, slave: OwnedFd, mut board: impl Board, orders: &mpsc::Receiver<Order>) {
    let (mut far, start) = (File::from(master), Instant::now());
    let (mut cut, mut damage, mut mute, mut sent) = (None, 0, false, 0);
    loop {
        match orders.recv_timeout(Duration::from_millis(1)) {
            Ok(Order::Cut(length, answer)) => cut = Some((length, answer)),
            Ok(Order::Unplug) => return,
            Ok(Order::Damage(records)) => damage = records,
            Ok(Order::Mute(silent)) => mute = silent,
            Err(mpsc::RecvTimeoutError::Timeout) => {}
            Err(mpsc::RecvTimeoutError::Disconnected) => break,
        }
        let mut input = [0; 256];
        if let Ok(length) = far.read(&mut input) {
            // The host changes the speed before it writes, so it is checked after each write.
            if let Some(baud) = speed(&far) {
                board.at_speed(baud);
            }
            board.receive(start.elapsed(), &input[..length]);
        }
        while let Some(mut record) = board.next_record(start.elapsed()) {
            if mute {
                continue;
            }
            if let Some((length, answer)) = cut.take() {
                sent += far.write(&record[..length]).unwrap();
                answer.send(sent).unwrap();
                mute = true;
                continue;
            }
            if damage > 0 {
                damage -= 1;
                let at = 2 + damage % (record.len() - 2);
                record[at] ^= 0xff;
            }
            // A terminal that nobody reads fills up.
            sent += far.write(&record).unwrap_or(0);
        }
    }
    drop(slave);
}

impl Drop for Terminal {
    fn drop(&mut self) {
        // Without a sender of orders the thread ends.
        self.orders = mpsc::channel().0;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

pub fn serial(link: &Path, protocol: Protocol) -> Settings {
    let port = PortName::Path(link.display().to_string());
    let mut settings =
        Settings { transport: Transport::Serial { port, baud: 115_200 }, protocol, ..Settings::default() };
    settings.device.reset_delay = Duration::from_millis(100);
    settings
}

pub fn place() -> (tempfile::TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let link = dir.path().join("usb-tracker-0");
    (dir, link)
}

fn polhemus(kind: Kind) -> Polhemus {
    let mut device = Polhemus::new(kind);
    device.reset_time = Duration::from_millis(50);
    device
}

fn position_mm(reading: Reading) -> glam::DVec3 {
    match reading {
        Reading::Pose(pose) => pose.position_mm,
        other => panic!("no pose: {other:?}"),
    }
}

#[test]
fn polhemus_devices_stream_over_a_serial_line() {
    for (kind, protocol) in [
        (Kind::Fastrak, Protocol::FastrakAscii),
        (Kind::Fastrak, Protocol::FastrakBinary),
        (Kind::Liberty, Protocol::Liberty),
    ] {
        let (_dir, link) = place();
        let _terminal = Terminal::plug_in(&link, polhemus(kind));
        let live = Live::start(&serial(&link, protocol));
        let record = live.listener.more_records(100);
        let position = position_mm(record.reading);
        assert!((position.y + 200.0).abs() < 0.1 && (position.z - 300.0).abs() < 0.1, "{protocol:?}: {position}");
        assert_eq!(record.sensor, 1);
        let errors =
            live.listener.wait("errors", |heard| Some(heard.events.iter().filter(|e| decode_error(e)).count()));
        assert_eq!(errors, 0, "{protocol:?}");
    }
}

#[test]
fn damaged_records_lose_only_themselves() {
    for (kind, protocol) in [
        (Kind::Fastrak, Protocol::FastrakAscii),
        (Kind::Fastrak, Protocol::FastrakBinary),
        (Kind::Liberty, Protocol::Liberty),
    ] {
        let (_dir, link) = place();
        let terminal = Terminal::plug_in(&link, polhemus(kind));
        let live = Live::start(&serial(&link, protocol));
        live.listener.more_records(10);
        terminal.order(Order::Damage(5));
        live.listener.nth_event(1, decode_error);
        live.listener.more_records(50);
        live.listener.wait("nothing else", |heard| {
            assert!(!heard.events.iter().any(disconnected), "{:?}", heard.events);
            Some(())
        });
    }
}

#[test]
fn a_device_unplugged_within_a_record_is_found_again_where_it_returns() {
    let (_dir, link) = place();
    let terminal = Terminal::plug_in(&link, polhemus(Kind::Liberty));
    let live = Live::start(&serial(&link, Protocol::Liberty));
    live.listener.more_records(20);
    let (answer, sent) = mpsc::channel();
    terminal.order(Order::Cut(17, answer));
    let sent = sent.recv().unwrap();
    live.listener.wait("the half record", |heard| (heard.bytes.len() == sent).then_some(()));
    terminal.order(Order::Unplug);
    terminal.join();
    let reason = live.listener.nth_event(1, disconnected);
    // The incomplete record is reported before the lost port.
    let TrackerEvent::DecodeError(error) = live.listener.nth_event(1, decode_error) else { panic!() };
    assert!(error.to_string().contains("ends after 17 bytes"), "{error}");
    assert!(!reason.to_string().is_empty());
    // It returns as another terminal, in its power-on state.
    let _terminal = Terminal::plug_in(&link, polhemus(Kind::Liberty));
    live.listener.nth_event(2, connected);
    live.listener.more_records(20);
}

#[test]
fn a_tracker_that_is_plugged_in_late_is_found() {
    let (_dir, link) = place();
    let live = Live::start(&serial(&link, Protocol::AsciiLine));
    let TrackerEvent::Disconnected { reason, .. } = live.listener.nth_event(1, disconnected) else { panic!() };
    assert!(reason.contains("cannot open") && reason.contains("usb-tracker-0"), "{reason}");
    let _terminal = Terminal::plug_in(&link, Lines(0));
    let record = live.listener.more_records(30);
    assert_eq!(position_mm(record.reading).y, 2.0);
    let sequence = record.sequence.unwrap();
    assert_eq!(position_mm(record.reading).x, f64::from(sequence));
}

#[test]
fn a_silent_line_is_reported_and_reopened() {
    let (_dir, link) = place();
    let terminal = Terminal::plug_in(&link, Lines(0));
    let mut settings = serial(&link, Protocol::AsciiLine);
    settings.device.silence = Duration::from_millis(60);
    let live = Live::start(&settings);
    live.listener.more_records(20);
    terminal.order(Order::Mute(true));
    let silent = |event: &TrackerEvent| matches!(event, TrackerEvent::Silent { .. });
    let TrackerEvent::Silent { for_, attempt, .. } = live.listener.nth_event(1, silent) else { panic!() };
    assert!(for_ >= Duration::from_millis(60) && attempt == 1);
    terminal.order(Order::Mute(false));
    live.listener.more_records(20);
}

#[test]
fn two_stations_of_a_liberty_are_probe_and_needle() {
    let (_dir, link) = place();
    let mut device = polhemus(Kind::Liberty);
    device.stations = 2;
    let _terminal = Terminal::plug_in(&link, device);
    let mut settings = serial(&link, Protocol::Liberty);
    settings.device.needle = Some(NeedleSensor::Number(2));
    let live = Live::start(&settings);
    live.listener.wait("records of both", |heard| {
        (heard.records.len() >= 50 && heard.needle.len() >= 50).then(|| {
            let at_y = |records: &[(u64, Record)], y_mm: f64| {
                records.iter().all(|(_, record)| (position_mm(record.reading).y - y_mm).abs() < 1e-3)
            };
            assert!(at_y(&heard.records, -200.0) && at_y(&heard.needle, 200.0));
            assert!(heard.needle.iter().all(|(_, record)| record.sensor == 2));
            // Both stations report at each tick of the device's clock.
            let [probe, needle] = [&heard.records, &heard.needle].map(|records| records[10].1);
            assert_eq!((probe.sequence, probe.device_time_us), (needle.sequence, needle.device_time_us));
        })
    });
    live.listener.wait("no event of another sensor", |heard| {
        heard.events.iter().all(|event| !matches!(event, TrackerEvent::OtherSensor { .. })).then_some(())
    });
}
