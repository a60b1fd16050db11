//! Tests of the NDI driver with an emulated device, in memory, on a simulated clock.

use std::time::Duration;

use bytes::BytesMut;
use insonify::pose::Reading;
use insonify::tracker::driver::{Driver, Line};
use insonify::tracker::ndi::{self, NdiDriver, Options, Reason, ReplyFormat};
use insonify::tracker::{self, DecodeError, Protocol, Record, StreamDecoder};
use proptest::prelude::*;

use crate::protocols::ndi_device::{Device, Port, Tool, framed, pose};

/// Time from a command to the arrival of its reply.
const ROUND_TRIP: Duration = Duration::from_millis(5);

/// Damages replies in transmission, given each reply's number.
type Fault<'a> = Box<dyn FnMut(usize, &mut Vec<u8>) + 'a>;

/// A driver and a device that are connected by a line.
struct Session<'a> {
    driver: NdiDriver,
    device: Device,
    now: Duration,
    buffer: BytesMut,
    records: Vec<Record>,
    errors: Vec<Reason>,
    /// All bytes that the host received, as in a recording.
    received: Vec<u8>,
    replies: usize,
    fault: Fault<'a>,
    /// Number of reply bytes that arrive at once.
    piece: usize,
}

impl<'a> Session<'a> {
    fn new(options: Options, device: Device) -> Self {
        options.validate().unwrap();
        let mut driver = NdiDriver::new(options);
        driver.start(Duration::ZERO, 0);
        Self {
            driver,
            device,
            now: Duration::ZERO,
            buffer: BytesMut::new(),
            records: Vec::new(),
            errors: Vec::new(),
            received: Vec::new(),
            replies: 0,
            fault: Box::new(|_, _| ()),
            piece: 7,
        }
    }

    fn decode(&mut self) {
        loop {
            let before = self.buffer.len();
            match self.driver.decode(self.now, &mut self.buffer) {
                Ok(Some(record)) => self.records.push(record),
                Ok(None) => return,
                Err(DecodeError { fault: tracker::Fault::Ndi(reason), .. }) => {
                    let is_of_the_clock = matches!(reason, Reason::NoReply { .. } | Reason::NoTool);
                    assert!(self.buffer.len() < before || is_of_the_clock, "{reason}");
                    self.errors.push(reason);
                }
                Err(error) => panic!("{error}"),
            }
        }
    }

    fn receive(&mut self, bytes: &[u8]) {
        self.received.extend(bytes);
        for piece in bytes.chunks(self.piece) {
            self.buffer.extend_from_slice(piece);
            self.decode();
        }
    }

    /// Runs driver and device for a time.
    fn run(&mut self, time: Duration) {
        let end = self.now + time;
        let mut turns = 0;
        while self.now < end {
            turns += 1;
            assert!(turns < 200_000, "the driver never rests");
            while let Some(line) = self.driver.line(self.now) {
                match line {
                    Line::Break => self.device.reset(!self.device.is_off),
                    Line::Speed(baud) => self.device.line_baud = baud,
                }
            }
            while let Some(bytes) = self.driver.transmit(self.now) {
                self.device.receive(&bytes);
            }
            let mut reply = self.device.take_output();
            if reply.is_empty() {
                let wake_at = self.driver.wake_at().unwrap_or(end);
                self.now = wake_at.max(self.now + Duration::from_micros(100)).min(end);
                self.decode();
            } else {
                (self.fault)(self.replies, &mut reply);
                self.replies += 1;
                self.now += ROUND_TRIP;
                self.receive(&reply);
            }
        }
    }

    fn seconds(&mut self, seconds: f64) -> &mut Self {
        self.run(Duration::from_secs_f64(seconds));
        self
    }

    /// Checks the records since the last call, and that each of `sensors` has some; returns them.
    fn check(&mut self, sensors: &[u16]) -> Vec<Record> {
        assert!(self.driver.is_tracking() && self.device.is_tracking(), "{:?} {:?}", self.errors, self.device.log);
        let records = std::mem::take(&mut self.records);
        for sensor in sensors {
            let count = records.iter().filter(|record| record.sensor == *sensor).count();
            assert!(count > 10, "{count} records of {sensor}: {:?}", self.errors);
        }
        for record in &records {
            let Reading::Pose(found) = record.reading else { continue };
            let (q, p) = pose(record.sensor as u8, record.sequence.unwrap());
            assert!(found.position_mm.distance(p) < 1e-3, "{record:?}");
            assert!(found.orientation.angle_between(q) < 1e-3, "{record:?}");
        }
        records
    }

    /// Records decoded from the received replies as in a replay, and the number of errors.
    fn replayed(&self) -> (Vec<Record>, usize) {
        let mut decoder = Protocol::Ndi.decoder();
        let mut buffer = BytesMut::from(&self.received[..]);
        let (mut records, mut errors) = (Vec::new(), 0);
        loop {
            match decoder.decode(&mut buffer) {
                Ok(Some(record)) => records.push(record),
                Ok(None) => return (records, errors),
                Err(_) => errors += 1,
            }
        }
    }
}

fn serial(baud: u32) -> Options {
    Options { baud: Some(baud), ..Options::default() }
}

#[test]
fn a_device_is_brought_to_tracking_in_the_order_of_the_guide() {
    let mut session = Session::new(Options::default(), Device::new(&[1, 2]));
    session.seconds(1.0).check(&[1, 2]);
    let log: Vec<&str> = session.device.log.iter().map(String::as_str).take(12).collect();
    let expected = [
        "INIT:",
        "PHSR:01",
        "PHSR:02",
        "PINIT:01",
        "PINIT:02",
        "PHSR:02",
        "PHSR:03",
        "PENA:01D",
        "PENA:02D",
        "TSTART:80",
        "BX:0801",
        "BX:0801",
    ];
    assert_eq!(log, expected);
    assert_eq!(session.errors, []);
    assert_eq!(session.driver.stop().unwrap(), framed("TSTOP:"));
    assert_eq!(session.driver.stop(), None);
}

#[test]
fn both_reply_formats_give_the_same_records() {
    let run = |format| {
        let mut session = Session::new(Options { format, ..Options::default() }, Device::new(&[1, 2]));
        session.seconds(0.5);
        session.device.tools[0].in_view = false;
        session.device.tools[1].switches = 0b101;
        session.seconds(0.5);
        assert_eq!(session.errors, []);
        let (replayed, errors) = session.replayed();
        assert_eq!((&replayed, errors), (&session.records, 0));
        session.check(&[1, 2])
    };
    let binary = run(ReplyFormat::Binary);
    let text = run(ReplyFormat::Text);
    let key = |record: &Record| {
        (record.sensor, record.sequence, record.buttons, matches!(record.reading, Reading::OutOfView))
    };
    assert_eq!(binary.iter().map(key).collect::<Vec<_>>(), text.iter().map(key).collect::<Vec<_>>());
    let last = binary.last().map(key).unwrap();
    assert_eq!((last.0, last.2, last.3), (2, 0b101, false));
    let of_first = binary.iter().rev().find(|record| record.sensor == 1).map(key).unwrap();
    assert_eq!((of_first.2, of_first.3), (0, true));
}

#[test]
fn wireless_tools_get_their_description() {
    let rom = |seed: u8| ndi::pad_rom((0..752_u32).map(|i| (i as u8).wrapping_mul(seed)).collect()).unwrap();
    let roms = vec![rom(3), rom(7)];
    let mut session = Session::new(Options { roms: roms.clone(), ..Options::default() }, Device::new(&[]));
    session.seconds(2.0).check(&[1, 2]);
    for (tool, rom) in session.device.tools.iter().zip(&roms) {
        let written: Vec<u8> = tool.rom.as_ref().unwrap().iter().map(|byte| byte.unwrap()).collect();
        assert_eq!(&written, rom);
    }
    assert_eq!(session.device.log.iter().filter(|command| command.starts_with("PVWR")).count(), 32);
}

#[test]
fn the_line_is_switched_to_the_requested_speed() {
    let mut session = Session::new(serial(115_200), Device::new(&[1]));
    session.seconds(1.0).check(&[1]);
    assert_eq!((session.device.baud, session.device.line_baud), (115_200, 115_200));
    assert!(session.device.log.contains(&"COMM:50000".to_owned()));
    assert_eq!(session.errors, []);
    // At the power-on speed nothing is switched.
    let mut session = Session::new(serial(9600), Device::new(&[1]));
    session.seconds(1.0).check(&[1]);
    assert!(!session.device.log.iter().any(|command| command.starts_with("COMM")));
}

#[test]
fn a_device_left_tracking_at_another_speed_is_taken_over() {
    let mut session = Session::new(serial(115_200), Device::left_tracking(&[1, 2], 115_200));
    session.seconds(10.0).check(&[1, 2]);
    let log = &session.device.log;
    assert_eq!(log[..5], ["INIT:", "TSTOP:", "INIT:", "PHSR:01", "PHF:01"], "{log:?}");
    assert!(matches!(&session.errors[..], [Reason::NoReply { .. }]), "{:?}", session.errors);

    // At an unknown speed only a break helps.
    let mut session = Session::new(serial(115_200), Device::left_tracking(&[1], 19_200));
    session.seconds(20.0).check(&[1]);
    assert_eq!(session.device.baud, 115_200);
}

#[test]
fn an_old_device_starts_without_the_option() {
    let mut device = Device::new(&[1]);
    device.is_old = true;
    let mut session = Session::new(Options::default(), device);
    session.seconds(1.0).check(&[1]);
    assert_eq!(session.errors, []);
}

#[test]
fn a_broken_tool_does_not_stop_the_others() {
    let mut device = Device::new(&[1, 2]);
    device.tools[0].broken = true;
    let mut session = Session::new(Options::default(), device);
    session.seconds(1.0).check(&[2]);
    let refused = Reason::Refused { code: 0x13, command: "PINIT:01".to_owned() };
    assert_eq!(session.errors, std::slice::from_ref(&refused));
    assert!(refused.to_string().contains("the tool in the port could not be initialised"), "{refused}");
}

#[test]
fn a_missing_tool_is_reported_and_a_new_one_is_used() {
    let mut session = Session::new(Options::default(), Device::new(&[]));
    session.seconds(5.0);
    assert_eq!(session.errors, [Reason::NoTool]);
    session.device.tools.push(Tool::wired(4));
    session.seconds(2.0).check(&[4]);
}

#[test]
fn added_and_removed_tools_are_set_up_again() {
    let mut session = Session::new(Options::default(), Device::new(&[1]));
    session.seconds(3.0).check(&[1]);
    session.device.tools.push(Tool::wired(2));
    session.device.system_status = 0x40;
    session.seconds(1.0).check(&[1, 2]);
    session.device.system_status = 0;
    session.seconds(3.0);
    // As after a short circuit in its cable: the device has disabled it.
    session.device.tools[1].port = Port::Disabled;
    session.seconds(0.1);
    assert!(session.device.log.iter().rev().take(40).any(|command| command == "TSTOP:"));
    session.seconds(1.0);
    session.records.clear();
    session.seconds(1.0).check(&[1]);
    assert_eq!(session.errors, []);
}

#[test]
fn a_restart_of_the_device_is_noticed_even_if_unannounced() {
    for (options, says_so) in [(Options::default(), true), (Options::default(), false), (serial(115_200), true)] {
        let mut session = Session::new(options, Device::new(&[1]));
        session.seconds(1.0).check(&[1]);
        session.device.reset(says_so);
        session.seconds(10.0).check(&[1]);
        assert_eq!(session.errors.contains(&Reason::Restarted), says_so && session.device.baud == 9600);
        assert_eq!(session.device.log.iter().filter(|command| *command == "TSTART:80").count(), 2);
    }
}

#[test]
fn a_device_that_is_switched_off_and_on_again_is_found() {
    for options in [Options::default(), serial(57_600)] {
        let mut session = Session::new(options, Device::new(&[1]));
        session.device.is_off = true;
        session.seconds(30.0);
        assert!(session.errors.iter().all(|error| matches!(error, Reason::NoReply { .. })));
        session.device.is_off = false;
        session.seconds(30.0).check(&[1]);
    }
}

#[test]
fn an_incomplete_reply_before_a_restart_does_not_swallow_the_next() {
    let mut session = Session::new(Options::default(), Device::new(&[1]));
    session.fault = Box::new(|number, reply| {
        if number == 40 {
            reply.truncate(30)
        }
    });
    session.seconds(2.0).check(&[1]);
    assert!(
        matches!(session.errors[..], [Reason::NoReply { .. }, Reason::Incomplete { length: 30 }]),
        "{:?}",
        session.errors
    );
}

#[test]
fn a_frame_polled_twice_gives_one_record() {
    let tools = [Tool { port: Port::Enabled, ..Tool::wired(1) }];
    let reply = crate::protocols::ndi_device::binary_reply(9, &tools, 0);
    let mut decoder = ndi::Decoder::default();
    let mut buffer = BytesMut::from(&[&reply[..], &reply[..]].concat()[..]);
    assert!(decoder.decode(&mut buffer).unwrap().is_some());
    assert_eq!(decoder.decode(&mut buffer), Ok(None));
    assert!(buffer.is_empty());
}

#[derive(Debug, Clone)]
enum Damage {
    Lost,
    Changed(usize, u8),
    Cut(usize),
    Noise(Vec<u8>),
}

fn fault() -> impl Strategy<Value = Damage> {
    prop_oneof![
        Just(Damage::Lost),
        (any::<usize>(), 1..=255_u8).prop_map(|(at, bits)| Damage::Changed(at, bits)),
        any::<usize>().prop_map(Damage::Cut),
        prop::collection::vec(any::<u8>(), 1..40).prop_map(Damage::Noise),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Whichever few replies are damaged, the device tracks in the end, and no wrong pose is reported.
    #[test]
    fn faults_are_overcome(
        faults in prop::collection::vec((0..60_usize, fault()), 0..6),
        format in prop_oneof![Just(ReplyFormat::Binary), Just(ReplyFormat::Text)],
        is_serial in any::<bool>(),
        piece in 1..80_usize,
    ) {
        let options = Options { format, baud: is_serial.then_some(115_200), ..Options::default() };
        let mut session = Session::new(options, Device::new(&[1, 2]));
        session.piece = piece;
        session.fault = Box::new(move |number, reply| {
            for (_, fault) in faults.iter().filter(|(at, _)| *at == number) {
                match fault {
                    Damage::Lost => reply.clear(),
                    Damage::Changed(at, bits) if !reply.is_empty() => {
                        let at = at % reply.len();
                        reply[at] ^= bits;
                    }
                    Damage::Changed(..) => {}
                    Damage::Cut(at) => reply.truncate(at % (reply.len() + 1)),
                    Damage::Noise(noise) => {
                        reply.splice(0..0, noise.iter().copied());
                    }
                }
            }
        });
        // The worst case: six resets, each waited for.
        let mut waited = 0;
        while !(session.replies > 80 && session.driver.is_tracking()) {
            waited += 1;
            prop_assert!(waited < 150, "{:?}", session.errors);
            session.seconds(1.0);
        }
        session.seconds(0.5).check(&[1, 2]);
        session.errors.clear();
        session.seconds(1.0).check(&[1, 2]);
        prop_assert_eq!(&session.errors, &[]);
    }
}
