//! Tests of NDI devices on a pseudo-terminal and on a socket, through complete sessions.
//!
//! The emulator refuses wrong checksums and commands out of order, and receives only noise if the line has another
//! speed. A pseudo-terminal carries no break, so resets by break are tested in memory
//! (`tests/tracking/protocols/ndi.rs`).

use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, mpsc};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use insonify::pose::Reading;
use insonify::tracker::ndi::{Reason, ReplyFormat};
use insonify::tracker::{DecodeError, Fault, Protocol, Record, Settings, TrackerEvent, Transport};

use crate::protocols::ndi_device::{Device, pose};
use crate::trackers::listener::{LIMIT, Live, connected, decode_error, disconnected};
use crate::trackers::ports::{Board, Order, Terminal, place, serial};

/// A device that a test can inspect while a session uses it.
type Shared = Arc<Mutex<Device>>;

fn shared(device: Device) -> Shared {
    Arc::new(Mutex::new(device))
}

/// The device on a serial line, and the number of next commands that reach it damaged.
struct OnLine(Shared, Arc<AtomicUsize>);

impl Board for OnLine {
    fn at_speed(&mut self, baud: u32) {
        self.0.lock().unwrap().line_baud = baud;
    }

    fn receive(&mut self, _: Duration, bytes: &[u8]) {
        let mut bytes = bytes.to_vec();
        if self.1.fetch_update(Ordering::SeqCst, Ordering::SeqCst, |left| left.checked_sub(1)).is_ok() {
            bytes[0] ^= 1;
        }
        self.0.lock().unwrap().receive(&bytes);
    }

    fn next_record(&mut self, _: Duration) -> Option<Vec<u8>> {
        Some(self.0.lock().unwrap().take_output()).filter(|output| !output.is_empty())
    }
}

fn plug_in(link: &std::path::Path, device: &Shared) -> (Terminal, Arc<AtomicUsize>) {
    let damage = Arc::<AtomicUsize>::default();
    (Terminal::plug_in(link, OnLine(device.clone(), damage.clone())), damage)
}

fn on_serial(link: &std::path::Path) -> Settings {
    let mut settings = serial(link, Protocol::Ndi);
    let Transport::Serial { baud, .. } = &mut settings.transport else { panic!() };
    *baud = 9600;
    settings.device.ndi.baud = Some(115_200);
    settings
}

/// Checks that the record's pose is the one that the device measured.
#[track_caller]
fn check(record: &Record) {
    let Reading::Pose(found) = record.reading else { panic!("{record:?}") };
    let (q, p) = pose(record.sensor as u8, record.sequence.unwrap());
    assert!(found.position_mm.distance(p) < 1e-3 && found.orientation.angle_between(q) < 1e-3, "{record:?}");
}

fn reasons(live: &Live) -> Vec<Reason> {
    live.listener.wait("what was heard", |heard| {
        let reason = |event: &TrackerEvent| match event {
            TrackerEvent::DecodeError(DecodeError { fault: Fault::Ndi(reason), .. }) => Some(reason.clone()),
            _ => None,
        };
        Some(heard.events.iter().filter_map(reason).collect())
    })
}

fn no_reply(event: &TrackerEvent) -> bool {
    matches!(event, TrackerEvent::DecodeError(DecodeError { fault: Fault::Ndi(Reason::NoReply { .. }), .. }))
}

#[test]
fn a_device_is_set_up_over_a_serial_line_at_its_new_speed_and_stopped_at_the_end() {
    for format in [ReplyFormat::Binary, ReplyFormat::Text] {
        let (_dir, link) = place();
        let device = shared(Device::new(&[1, 2]));
        let (_terminal, _) = plug_in(&link, &device);
        let mut settings = on_serial(&link);
        settings.device.ndi.format = format;
        settings.device.sensor = Some(2);
        let live = Live::start(&settings);
        let record = live.listener.more_records(30);
        assert_eq!(record.sensor, 2);
        check(&record);
        assert_eq!(reasons(&live), []);
        {
            let device = device.lock().unwrap();
            assert_eq!((device.baud, device.line_baud), (115_200, 115_200));
            let order = ["INIT:", "COMM:50000", "PHSR:01", "PHSR:02", "PINIT:01", "PINIT:02", "PHSR:02", "PHSR:03"];
            assert_eq!(device.log[..8], order, "{format:?}");
        }
        drop(live);
        // It is commanded to stop; the terminal needs a moment to deliver that.
        let asked = Instant::now();
        while device.lock().unwrap().is_tracking() {
            assert!(asked.elapsed() < LIMIT, "it was not told to stop");
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

#[test]
fn a_wireless_tool_gets_the_file_named_by_the_station() {
    let (dir, link) = place();
    let rom: Vec<u8> = (0..752_u32).map(|i| (i * 7) as u8).collect();
    let path = dir.path().join("probe.rom");
    std::fs::write(&path, &rom).unwrap();
    let device = shared(Device::new(&[]));
    let (_terminal, _) = plug_in(&link, &device);
    let mut settings = on_serial(&link);
    settings.device.ndi.rom_files = vec![path];
    let live = Live::start(&settings);
    check(&live.listener.more_records(10));
    let device = device.lock().unwrap();
    let written: Vec<u8> = device.tools[0].rom.as_ref().unwrap().iter().map(|byte| byte.unwrap()).collect();
    assert_eq!((&written[..752], &written[752..]), (&rom[..], &[0; 1024 - 752][..]));
    drop(device);
    settings.device.ndi.rom_files = vec!["/nonexistent/probe.rom".into()];
    let listener = Box::new(crate::trackers::listener::TrackerListener::default());
    let error = insonify::tracker::spawn(&settings, listener, Default::default()).unwrap_err().to_string();
    assert!(error.starts_with("cannot read the tool description /nonexistent/probe.rom"), "{error}");
}

#[test]
fn damaged_commands_and_replies_are_repeated() {
    let (_dir, link) = place();
    let device = shared(Device::new(&[1]));
    let (terminal, damaged_commands) = plug_in(&link, &device);
    let live = Live::start(&on_serial(&link));
    live.listener.more_records(10);
    damaged_commands.store(2, Ordering::SeqCst);
    live.listener.nth_event(2, decode_error);
    live.listener.more_records(10);
    terminal.order(Order::Damage(2));
    live.listener.nth_event(3, decode_error);
    check(&live.listener.more_records(20));
    assert!(device.lock().unwrap().log.iter().filter(|command| *command == "bad CRC").count() == 2);
    let refused = |reason: &Reason| matches!(reason, Reason::Refused { code: 4, .. });
    assert_eq!(reasons(&live).iter().filter(|reason| refused(reason)).count(), 2);
    live.listener.wait("nothing else", |heard| (!heard.events.iter().any(disconnected)).then_some(()));
}

#[test]
fn a_device_unplugged_within_a_reply_is_set_up_again_when_it_comes_back() {
    let (_dir, link) = place();
    let (terminal, _) = plug_in(&link, &shared(Device::new(&[1])));
    let live = Live::start(&on_serial(&link));
    live.listener.more_records(10);
    let (answer, sent) = mpsc::channel();
    terminal.order(Order::Cut(17, answer));
    let sent = sent.recv().unwrap();
    live.listener.wait("the half reply", |heard| (heard.bytes.len() == sent).then_some(()));
    terminal.order(Order::Unplug);
    terminal.join();
    live.listener.nth_event(1, disconnected);
    assert!(reasons(&live).contains(&Reason::Incomplete { length: 17 }), "{:?}", reasons(&live));
    let device = shared(Device::new(&[1]));
    let _terminal = plug_in(&link, &device);
    live.listener.nth_event(2, connected);
    check(&live.listener.more_records(20));
    assert!(device.lock().unwrap().log.contains(&"COMM:50000".to_owned()));
}

#[test]
fn unanswered_commands_are_reported_while_the_device_is_silent() {
    let (_dir, link) = place();
    let device = shared(Device::new(&[1]));
    let (_terminal, _) = plug_in(&link, &device);
    let live = Live::start(&on_serial(&link));
    live.listener.more_records(10);
    device.lock().unwrap().is_off = true;
    let event = live.listener.nth_event(1, no_reply);
    assert!(event.to_string().contains("no reply to `BX:0801` within 500 ms"), "{event}");
    device.lock().unwrap().is_off = false;
    check(&live.listener.more_records(20));
    // A short power failure: the device has lost its set-up and its speed.
    device.lock().unwrap().reset(false);
    check(&live.listener.more_records(20));
    let starts = device.lock().unwrap().log.iter().filter(|command| *command == "TSTART:80").count();
    assert_eq!(starts, 2);
}

/// The device as a TCP server. If `cut` is set, it closes the connection after that many bytes of the next reply.
struct Server {
    address: String,
    cut: Arc<Mutex<Option<usize>>>,
    thread: Option<JoinHandle<()>>,
    over: Arc<AtomicUsize>,
}

impl Server {
    fn start(device: &Shared) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        listener.set_nonblocking(true).unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let (cut, over) = (Arc::<Mutex<Option<usize>>>::default(), Arc::<AtomicUsize>::default());
        let (device, its_cut, its_over) = (device.clone(), cut.clone(), over.clone());
        let thread = std::thread::spawn(move || {
            while its_over.load(Ordering::SeqCst) == 0 {
                match listener.accept() {
                    Ok((stream, _)) => serve(stream, &device, &its_cut, &its_over),
                    Err(_) => std::thread::sleep(Duration::from_millis(1)),
                }
            }
        });
        Self { address, cut, thread: Some(thread), over }
    }

    fn settings(&self) -> Settings {
        let transport = Transport::Tcp { address: self.address.clone() };
        Settings { transport, protocol: Protocol::Ndi, ..Settings::default() }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.over.store(1, Ordering::SeqCst);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn serve(mut stream: TcpStream, device: &Shared, cut: &Mutex<Option<usize>>, over: &AtomicUsize) {
    stream.set_nonblocking(false).unwrap();
    stream.set_read_timeout(Some(Duration::from_millis(1))).unwrap();
    let mut input = [0; 256];
    while over.load(Ordering::SeqCst) == 0 {
        match stream.read(&mut input) {
            Ok(0) => return,
            Ok(length) => device.lock().unwrap().receive(&input[..length]),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(_) => return,
        }
        let output = device.lock().unwrap().take_output();
        if output.is_empty() {
            continue;
        }
        if let Some(length) = cut.lock().unwrap().take() {
            let _ = stream.write_all(&output[..length]);
            return;
        }
        if stream.write_all(&output).is_err() {
            return;
        }
    }
}

#[test]
fn a_device_is_set_up_over_tcp_and_taken_over_after_a_lost_connection() {
    let device = shared(Device::new(&[1]));
    let server = Server::start(&device);
    let live = Live::start(&server.settings());
    check(&live.listener.more_records(20));
    assert!(!device.lock().unwrap().log.iter().any(|command| command.starts_with("COMM")));
    assert_eq!(reasons(&live), []);
    // The connection ends within a reply; the device continues tracking.
    *server.cut.lock().unwrap() = Some(21);
    live.listener.nth_event(1, disconnected);
    assert_eq!(reasons(&live), [Reason::Incomplete { length: 21 }]);
    live.listener.nth_event(2, connected);
    check(&live.listener.more_records(20));
    let log = device.lock().unwrap().log.clone();
    let again = log.iter().rposition(|command| command == "TSTOP:").unwrap();
    assert_eq!(log[again - 1..again + 3], ["INIT:", "TSTOP:", "INIT:", "PHSR:01"]);
}

#[test]
fn a_restart_of_a_device_behind_tcp_is_noticed() {
    let device = shared(Device::new(&[1]));
    let server = Server::start(&device);
    let live = Live::start(&server.settings());
    live.listener.more_records(10);
    for says_so in [true, false] {
        device.lock().unwrap().reset(says_so);
        check(&live.listener.more_records(20));
    }
    assert!(reasons(&live).contains(&Reason::Restarted), "{:?}", reasons(&live));
    let starts = device.lock().unwrap().log.iter().filter(|command| *command == "TSTART:80").count();
    assert_eq!(starts, 3);
    live.listener.wait("nothing else", |heard| (!heard.events.iter().any(disconnected)).then_some(()));
}
