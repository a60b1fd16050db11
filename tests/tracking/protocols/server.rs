//! Tests of the OpenIGTLink server and its clients.

use std::io::{ErrorKind, Read};
use std::net::TcpStream;
use std::process::{Command, Stdio};
use std::sync::atomic::Ordering;
use std::time::Duration;

use glam::{DQuat, DVec3};
use insonify::pose::{Estimate, Pose, TrackingState};
use insonify::settings::LiveSettings;
use insonify::sink::SinkError;
use insonify::sink::live::{FrameInfo, FrameSource, LiveSink, PresentedFrame};
use insonify::sink::openigtlink::{OpenIgtLink, Settings};
use insonify::transducer::{Probe, Sector};

use crate::protocols::messages::crc;

/// Time limit of tests that might hang; far longer than any step takes.
const LIMIT: Duration = Duration::from_secs(20);

fn pose() -> Pose {
    Pose {
        position_mm: DVec3::new(10.0, -20.0, 30.0),
        orientation: DQuat::from_rotation_x(0.5) * DQuat::from_rotation_z(1.0),
    }
}

fn tracked(state: TrackingState) -> Estimate {
    Estimate { scene_from_probe: Some(pose()), state, ..Estimate::default() }
}

fn frame(number: u64, width: u32, height: u32) -> PresentedFrame {
    let pixels = (width * height) as usize;
    let probe = Probe::default();
    let mut image: Vec<u8> = (0..pixels).map(|i| (i % 251) as u8).collect();
    image[0] = number as u8;
    let settings = LiveSettings { probe, ..LiveSettings::default() };
    PresentedFrame {
        number,
        info: FrameInfo { estimate: tracked(TrackingState::Good), settings, ..FrameInfo::default() },
        source: FrameSource::Raw,
        width,
        height,
        pixel_mm: Sector::fit(&probe, width, height).pixel_mm,
        image,
        segmentation: vec![0; pixels],
        attenuation: vec![0.0; pixels],
        mask: vec![255; pixels].into(),
        generator: None,
        point: None,
        tip_events: [].into(),
        notice: None,
    }
}

fn server(settings: Settings) -> Box<OpenIgtLink> {
    Box::new(OpenIgtLink::new(Settings { port: 0, ..settings }, Probe::default()).unwrap())
}

struct Message {
    kind: String,
    device: String,
    body: Vec<u8>,
}

struct Client(TcpStream);

impl Client {
    /// Connects, and waits until the server has noticed the client.
    fn connect(server: &OpenIgtLink) -> Self {
        let before = server.counters().accepted.load(Ordering::Relaxed);
        let stream = TcpStream::connect(server.address()).unwrap();
        stream.set_read_timeout(Some(LIMIT)).unwrap();
        while server.counters().accepted.load(Ordering::Relaxed) == before {
            std::thread::yield_now();
        }
        Self(stream)
    }

    fn message(&mut self) -> Message {
        let mut head = [0; 58];
        self.0.read_exact(&mut head).unwrap();
        assert_eq!(head[..2], [0, 1]);
        let text = |bytes: &[u8]| String::from_utf8(bytes.iter().copied().take_while(|&b| b != 0).collect()).unwrap();
        let number = |at: usize| u64::from_be_bytes(head[at..at + 8].try_into().unwrap());
        let mut body = vec![0; number(42) as usize];
        self.0.read_exact(&mut body).unwrap();
        assert_eq!(number(50), crc(&body));
        Message { kind: text(&head[2..14]), device: text(&head[14..34]), body }
    }

    /// The next image, and the other messages before it.
    fn image(&mut self) -> (Message, Vec<Message>) {
        let mut others = Vec::new();
        loop {
            let message = self.message();
            if message.kind == "IMAGE" {
                return (message, others);
            }
            others.push(message);
        }
    }
}

fn vectors(bytes: &[u8]) -> [DVec3; 4] {
    std::array::from_fn(|i| {
        let value =
            |j: usize| f64::from(f32::from_be_bytes(bytes[12 * i + 4 * j..12 * i + 4 * j + 4].try_into().unwrap()));
        DVec3::new(value(0), value(1), value(2))
    })
}

#[test]
fn a_client_gets_the_image_at_its_place() {
    let mut server = server(Settings { slice_mm: 2.0, ..Settings::default() });
    let mut client = Client::connect(&server);
    let sent = frame(7, 130, 100);
    server.present(&sent).unwrap();
    let (image, others) = client.image();
    assert_eq!((image.device.as_str(), image.body.len()), ("Image", 72 + 130 * 100));
    assert_eq!(image.body[..12], [0, 1, 1, 3, 2, 1, 0, 130, 0, 100, 0, 1]);
    assert_eq!(image.body[60..72], [0, 0, 0, 0, 0, 0, 0, 130, 0, 100, 0, 1]);
    assert_eq!(image.body[72..], sent.image);

    // Each pixel is at its position in the sector.
    let [column, row, slice, centre] = vectors(&image.body[12..60]);
    let sector = Sector::fit(&Probe::default(), 130, 100);
    for (x, y) in [(0, 0), (129, 0), (17, 80), (129, 99)] {
        let found = centre + column * (f64::from(x) - 64.5) + row * (f64::from(y) - 49.5);
        let in_probe = sector.pixel_centre_mm(x, y);
        let expected = pose().transform_point(DVec3::new(in_probe.x, 0.0, in_probe.y));
        assert!(found.distance(expected) < 1e-4, "{x} {y}: {found} {expected}");
    }
    assert!((slice.length() - 2.0).abs() < 1e-6 && slice.dot(column.cross(row)) > 0.0);

    let [status, transform] = &others[..] else { panic!() };
    assert_eq!((status.kind.as_str(), &status.body[..2]), ("STATUS", &[0, 1][..]));
    assert_eq!((transform.kind.as_str(), transform.device.as_str()), ("TRANSFORM", "ProbeToScene"));
    let [x, _, z, position] = vectors(&transform.body);
    assert!(x.distance(pose().orientation * DVec3::X) < 1e-6 && z.distance(pose().orientation * DVec3::Z) < 1e-6);
    assert_eq!(position, pose().position_mm);
    server.finish().unwrap();
    assert_eq!(client.0.read(&mut [0]).unwrap(), 0);
}

#[test]
fn a_stale_pose_is_never_sent_as_a_good_one() {
    let mut server = server(Settings::default());
    let mut client = Client::connect(&server);
    for (tracking, code, has_transform) in [
        (TrackingState::Held, 1, true),
        (TrackingState::Stuck, 13, false),
        (TrackingState::Stale, 13, false),
        (TrackingState::Lost, 13, false),
    ] {
        let mut frame = frame(0, 16, 16);
        frame.info.estimate.state = tracking;
        server.present(&frame).unwrap();
        let (_, others) = client.image();
        assert_eq!(others[0].body[..2], [0, code]);
        assert_eq!(others.len() == 2, has_transform, "{tracking:?}");
    }
    let mut without_pose = frame(0, 16, 16);
    without_pose.info.estimate = Estimate::default();
    server.present(&without_pose).unwrap();
    let (image, others) = client.image();
    assert_eq!(others.len(), 1);
    assert!(vectors(&image.body[12..60])[3].length() < 100.0);
}

#[test]
fn scene_axes_are_converted_for_clients() {
    let lps = server(Settings { scene_axes: "LPS".parse().unwrap(), ..Settings::default() });
    let ras = server(Settings::default());
    let images = [lps, ras].map(|mut server| {
        let mut client = Client::connect(&server);
        server.present(&frame(0, 16, 16)).unwrap();
        let (image, others) = client.image();
        (vectors(&image.body[12..60]), vectors(&others[1].body))
    });
    let flip = DVec3::new(-1.0, -1.0, 1.0);
    for i in 0..4 {
        assert!((images[0].0[i] * flip).distance(images[1].0[i]) < 1e-6);
        assert!((images[0].1[i] * flip).distance(images[1].1[i]) < 1e-6);
    }
}

#[test]
fn a_blocked_client_delays_nobody_and_gets_the_newest_when_it_reads() {
    const FRAMES: u64 = 40;
    let mut server = server(Settings::default());
    let mut reader = Client::connect(&server);
    let mut blocked = Client::connect(&server);
    for number in 0..FRAMES {
        server.present(&frame(number, 1386, 1000)).unwrap();
        // Each frame arrives although the other client reads none.
        let (image, _) = reader.image();
        assert_eq!(image.body[72], number as u8);
    }
    let counters = server.counters();
    let mut received = Vec::new();
    while received.last() != Some(&(FRAMES as u8 - 1)) {
        received.push(blocked.image().0.body[72]);
    }
    assert!(received.len() < FRAMES as usize / 2, "{received:?}");
    assert!(received.is_sorted());
    assert_eq!(counters.dropped.load(Ordering::Relaxed), FRAMES - received.len() as u64);
    // New clients get the present picture.
    let mut late = Client::connect(&server);
    assert_eq!(late.image().0.body[72], FRAMES as u8 - 1);
    assert_eq!(counters.connected.load(Ordering::Relaxed), 3);
}

#[test]
fn the_server_ends_although_a_client_is_blocked() {
    let mut server = server(Settings::default());
    let _blocked = Client::connect(&server);
    for number in 0..10 {
        server.present(&frame(number, 1386, 1000)).unwrap();
    }
    server.finish().unwrap();
}

#[test]
fn clients_beyond_the_limit_are_refused() {
    let mut server = server(Settings { clients_max: 1, ..Settings::default() });
    let mut first = Client::connect(&server);
    let mut second = TcpStream::connect(server.address()).unwrap();
    second.set_read_timeout(Some(LIMIT)).unwrap();
    // Closed, or reset.
    assert!(
        second.read(&mut [0]).map_or_else(|error| error.kind() == ErrorKind::ConnectionReset, |length| length == 0)
    );
    assert_eq!(server.counters().refused.load(Ordering::Relaxed), 1);
    server.present(&frame(3, 16, 16)).unwrap();
    assert_eq!(first.image().0.body[72], 3);
}

#[test]
fn a_port_in_use_and_a_wrong_image_are_errors() {
    let mut server = server(Settings::default());
    let settings = Settings { port: server.address().port(), ..Settings::default() };
    let error = OpenIgtLink::new(settings, Probe::default()).err().unwrap();
    assert!(matches!(error, SinkError::Listen { .. }), "{error}");
    let mut wrong = frame(0, 16, 16);
    wrong.image.pop();
    assert!(matches!(server.present(&wrong), Err(SinkError::Shape { .. })));
    assert!(server.present(&frame(0, 16, 16)).is_ok());
}

#[test]
#[ignore = "needs Python's pyigtl; `make test` runs it where that is installed"]
fn pyigtl_receives_image_and_transform() {
    let python = std::env::var_os("INSONIFY_PYTHON").unwrap_or("python3".into());
    let mut server = server(Settings::default());
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/openigtlink_receive.py");
    let port = server.address().port().to_string();
    let mut child = Command::new(python).args([script, &port]).stdout(Stdio::piped()).spawn().unwrap();
    let sent = frame(7, 130, 100);
    let ended = std::time::Instant::now() + LIMIT;
    // At the pace of a display, until the receiver has everything.
    while child.try_wait().unwrap().is_none() && std::time::Instant::now() < ended {
        server.present(&sent).unwrap();
        std::thread::sleep(Duration::from_millis(20));
    }
    let _ = child.kill();
    let output = child.wait_with_output().unwrap();
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(found["shape"], serde_json::json!([1, 100, 130]));
    assert_eq!(found["world"], "ras");
    let pixels: Vec<u8> = found["pixels"].as_array().unwrap().iter().map(|v| v.as_u64().unwrap() as u8).collect();
    assert_eq!(pixels, sent.image);
    let point = |name: &str| {
        let value = |i: usize| found[name][i].as_f64().unwrap();
        DVec3::new(value(0), value(1), value(2))
    };
    let sector = Sector::fit(&Probe::default(), 130, 100);
    for (name, x, y) in [("first_pixel", 0, 0), ("last_pixel", 129, 99)] {
        let in_probe = sector.pixel_centre_mm(x, y);
        let expected = pose().transform_point(DVec3::new(in_probe.x, 0.0, in_probe.y));
        assert!(point(name).distance(expected) < 1e-3, "{name}: {} {expected}", point(name));
    }
    assert!(point("probe_point").distance(pose().transform_point(DVec3::new(1.0, 2.0, 3.0))) < 1e-3);
}
