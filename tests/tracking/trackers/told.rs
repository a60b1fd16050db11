//! Messages of `insonify trackers`, `record` and `inspect` on tools, senders, damage and silence.

use std::io::Write;
use std::net::{TcpListener, UdpSocket};
use std::path::Path;
use std::process::{Command, Output};
use std::thread;
use std::time::{Duration, Instant};

use glam::{DMat3, DVec3};
use insonify::pose::Pose;
use insonify::recording::{RecordingInfo, RecordingWriter};
use insonify::tracker::{Protocol, ascii_line};

use crate::protocols::messages::{matrix, message};

fn insonify(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_insonify")).args(args).env_remove("RUST_LOG").output().unwrap()
}

/// Exit code, stdout and stderr of a command.
fn texts(output: &Output) -> (Option<i32>, String, String) {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

/// Address of a server for one client, to which it sends `message(n)` every 10 ms until the client leaves.
fn server(message: impl Fn(u32) -> Vec<u8> + Send + 'static) -> String {
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = server.local_addr().unwrap().to_string();
    thread::spawn(move || {
        let (mut client, _) = server.accept().unwrap();
        for n in 0..6000 {
            if client.write_all(&message(n)).is_err() {
                return;
            }
            thread::sleep(Duration::from_millis(10));
        }
    });
    address
}

fn transform(name: &str, x: f64) -> Vec<u8> {
    message(1, "TRANSFORM", name, 0, &matrix(DMat3::IDENTITY, DVec3::new(x, 0.0, 0.0)))
}

fn two_tools(_: u32) -> Vec<u8> {
    [transform("StylusToTracker", -500.0), transform("ProbeToTracker", 100.0)].concat()
}

fn watch(address: &str, protocol: &str, more: &[&str]) -> (Option<i32>, String, String) {
    let args = ["trackers", "--address", address, "--protocol", protocol, "--seconds", "1.2"];
    texts(&insonify(&[&args[..], more].concat()))
}

#[test]
fn tools_are_listed_and_one_is_named() {
    let (code, out, err) = watch(&server(two_tools), "openigtlink", &[]);
    assert_eq!(code, Some(1), "{out}{err}");
    assert!(err.contains("several sensors are heard and none is chosen") && err.contains("--tool"), "{err}");
    let rows = |name: &str| out.lines().filter(|line| line.contains(name) && line.contains("Hz  valid")).count();
    assert!(rows("StylusToTracker") > 0 && rows("ProbeToTracker") > 0, "{out}");

    let (code, out, err) = watch(&server(two_tools), "openigtlink", &["--tool", "ProbeToTracker"]);
    assert_eq!(code, Some(0), "{out}{err}");
    assert!(out.contains("probe  ProbeToTracker") && !err.contains("none is chosen"), "{out}{err}");
    assert!(out.lines().any(|line| line.contains("streaming") && line.contains("mm    100.00")), "{out}");

    let (code, _, err) = watch(&server(two_tools), "openigtlink", &["--tool", "Needle"]);
    assert_eq!(code, Some(1));
    assert!(err.contains("only others are heard: tool `StylusToTracker`, tool `ProbeToTracker`"), "{err}");

    let (code, _, err) = watch("127.0.0.1:1", "liberty", &["--tool", "Probe"]);
    assert_eq!(code, Some(2));
    assert!(err.contains("`liberty` has no named tools"), "{err}");

    let (code, _, err) = watch("127.0.0.1:1", "openigtlink", &["--sensor", "0"]);
    assert_eq!(code, Some(2));
    assert!(err.contains("`openigtlink` numbers its tools by arrival; name the probe by --tool"), "{err}");
}

/// A station in `dir` whose scene does not exist, with the `[tracker]` table `tracker`.
fn station(dir: &Path, tracker: &str) -> String {
    let path = dir.join("s.toml");
    std::fs::write(&path, format!("[scene]\npath = \"none.glb\"\n[tracker]\n{tracker}")).unwrap();
    path.display().to_string()
}

#[test]
fn a_number_where_tools_have_names_is_refused_by_each_command() {
    let dir = tempfile::tempdir().unwrap();
    let tracker = "transport = \"tcp\"\nprotocol = \"openigtlink\"\naddress = \"127.0.0.1:1\"\n";
    let calibration = "[calibration]\npath = \"c.toml\"";
    let (own, out) = (station(dir.path(), &format!("{tracker}{calibration}")), dir.path().join("r.mcap"));
    for args in [
        &["trackers", &own, "--sensor", "0"][..],
        &["record", &own, "--out", out.to_str().unwrap(), "--sensor", "0"],
        &["record", &own, "--out", out.to_str().unwrap(), "--stdin", "--sensor", "0"],
        &["calibrate", "probe", "--tracker", &own, "--sensor", "0"],
    ] {
        let (code, _, err) = texts(&insonify(args));
        assert_eq!(code, Some(2), "{args:?}: {err}");
        assert!(err.contains("`openigtlink` numbers its tools by arrival"), "{args:?}: {err}");
    }
    let numbered = station(dir.path(), &format!("{tracker}sensor = 0"));
    let (code, _, err) = texts(&insonify(&["trackers", &numbered]));
    assert_eq!(code, Some(2), "{err}");
    assert!(err.contains("`tracker.sensor` does not apply: `openigtlink` numbers its tools by arrival"), "{err}");
}

#[test]
fn a_tool_at_a_station_without_a_tracker_lacks_the_tracker() {
    let dir = tempfile::tempdir().unwrap();
    let (own, out) = (station(dir.path(), ""), dir.path().join("r.mcap"));
    let (code, _, err) =
        texts(&insonify(&["record", &own, "--out", out.to_str().unwrap(), "--tool", "ProbeToTracker"]));
    assert_eq!(code, Some(2), "{err}");
    assert!(err.contains("has no [tracker] with a `transport`: give --protocol"), "{err}");
}

#[test]
fn the_report_of_a_recording_counts_each_tool_from_its_start() {
    let dir = tempfile::tempdir().unwrap();
    let address = server(two_tools);
    let tracker =
        format!("transport = \"tcp\"\nprotocol = \"openigtlink\"\naddress = \"{address}\"\ntool = \"ProbeToTracker\"");
    let (own, out) = (station(dir.path(), &tracker), dir.path().join("r.mcap"));
    let args = ["record", &own, "--out", out.to_str().unwrap(), "--duration", "1.5", "--json"];
    let (code, text, err) = texts(&insonify(&args));
    assert_eq!(code, Some(0), "{err}");
    let report: serde_json::Value = serde_json::from_str(&text).unwrap();
    let of = |name: &str| {
        let sensors = report["sensors"].as_array().unwrap();
        sensors.iter().find(|sensor| sensor["name"] == name).unwrap().clone()
    };
    let (stylus, probe) = (of("StylusToTracker"), of("ProbeToTracker"));
    assert_eq!(probe["records"], report["records"]);
    assert!(stylus["records"].as_u64() >= probe["records"].as_u64(), "{report}");
    assert!(stylus["is_probe"] == false && probe["is_probe"] == true, "{report}");
    assert!(probe["rate_hz"].as_f64().is_some_and(|hz| hz > 5.0), "{report}");
}

#[test]
fn messages_without_a_checksum_are_taken_and_wrong_ones_all_counted() {
    let with_crc = |crc: u8| {
        move |_: u32| {
            let mut bytes = transform("ProbeToTracker", 5.0);
            bytes[50..58].fill(crc);
            bytes
        }
    };
    let (code, out, err) = watch(&server(with_crc(0)), "openigtlink", &[]);
    assert!(code == Some(0) && out.contains(" 0 damaged pieces"), "{out}{err}");
    let (code, out, err) = watch(&server(with_crc(7)), "openigtlink", &[]);
    assert_eq!(code, Some(1), "{out}");
    let total = out.lines().last().unwrap();
    let damaged: u32 = total.split("; ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!(damaged > 20, "{total}");
    // Counted, not a line each.
    assert!(err.lines().filter(|line| line.contains("has the CRC")).count() <= 3, "{err}");
}

#[test]
fn bytes_of_another_protocol_name_it() {
    let line = |n: u32| ascii_line::encode(n, u64::from(n) * 10_000, &Pose::IDENTITY).into_bytes();
    let (code, _, err) = watch(&server(line), "liberty", &[]);
    assert_eq!(code, Some(1), "{err}");
    assert!(err.contains("these bytes are `ascii-line`, not `liberty`: set"), "{err}");
}

#[test]
fn nothing_heard_at_a_udp_address_is_explained() {
    let (code, _, err) = watch("127.0.0.1:0", "opentrack", &[]);
    assert_eq!(code, Some(1), "{err}");
    assert!(err.contains("which only programs on this computer reach") && err.contains("0.0.0.0"), "{err}");
}

#[test]
fn a_second_sender_is_left_out_of_a_recording() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name).display().to_string();
    let port = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let address = format!("127.0.0.1:{port}");
    let table = format!(
        "[scene]\npath = \"none.glb\"\n[tracker]\ntransport = \"udp\"\nprotocol = \"opentrack\"\naddress = \"{address}\""
    );
    std::fs::write(at("s.toml"), table).unwrap();
    let senders = thread::spawn(move || {
        let [a, b] = [0, 1].map(|_| UdpSocket::bind("127.0.0.1:0").unwrap());
        let datagram =
            |x: f64| [x, 0.0, 0.0, 0.0, 0.0, 0.0].iter().flat_map(|v: &f64| v.to_le_bytes()).collect::<Vec<_>>();
        let started = Instant::now();
        while started.elapsed() < Duration::from_secs(4) {
            for (socket, x) in [(&a, 1.0), (&b, -50.0)] {
                // Nobody may listen yet.
                let _ = socket.send_to(&datagram(x), &address);
            }
            thread::sleep(Duration::from_millis(20));
        }
    });
    let (code, out, err) = texts(&insonify(&["record", &at("s.toml"), "--out", &at("r.mcap"), "--duration", "1.5"]));
    senders.join().unwrap();
    assert_eq!(code, Some(0), "{err}");
    assert!(
        out.contains("datagrams of other senders left out") && err.contains("datagrams of a second sender"),
        "{out}{err}"
    );
    let (poses, _) = insonify::recording::poses(&dir.path().join("r.mcap")).unwrap();
    let first = poses[0].pose.position_mm.x;
    assert!(poses.len() > 5 && poses.iter().all(|pose| pose.pose.position_mm.x == first), "{first}");
    let (_, out, _) = texts(&insonify(&["inspect", &at("r.mcap")]));
    assert!(out.contains("datagrams of a second sender"), "{out}");
}

#[test]
fn a_recording_of_rates_lasts_as_long_as_its_records() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("puck.mcap");
    let start_time_ns = 1_790_000_000_000_000_000;
    let info = RecordingInfo { protocol: Protocol::SpaceMouse, start_time_ns, ..RecordingInfo::default() };
    let mut writer = RecordingWriter::create(&path, &info).unwrap();
    for n in 0..151 {
        writer.raw(start_time_ns + n * 20_000_000, &[1, n as u8, 0, 20, 0, 30, 0, 0, 0, 0, 0, 0, 0]).unwrap();
    }
    writer.finish().unwrap();
    let (code, out, err) = texts(&insonify(&["inspect", path.to_str().unwrap()]));
    assert_eq!(code, Some(0), "{err}");
    assert!(out.contains("151 records in 151 messages over 3.0 s"), "{out}");
    assert!(out.contains("50.00 records a second") && out.contains("gaps       0"), "{out}");
    let (_, json, _) = texts(&insonify(&["inspect", "--json", path.to_str().unwrap()]));
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["duration_s"], 3.0);
}

#[test]
fn the_format_of_lines_is_in_the_help() {
    for command in ["trackers", "record"] {
        let (_, out, _) = texts(&insonify(&[command, "--help"]));
        assert!(out.contains("P,seq,t_us,x,y,z,qw,qx,qy,qz*HH") && out.contains("--tool"), "{out}");
        let example = out.lines().find_map(|line| line.split("as in ").nth(1).filter(|line| line.starts_with("P,")));
        let mut decoder = Protocol::AsciiLine.decoder();
        let mut buffer = bytes::BytesMut::from(format!("{}\n", example.unwrap()).as_bytes());
        assert!(decoder.decode(&mut buffer).unwrap().is_some(), "{example:?}");
    }
}

/// Runs a small station with the tracker at `address` for some seconds. Returns the summary, the frames and stderr.
fn run(address: &str) -> (serde_json::Value, Vec<serde_json::Value>, String) {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name).display().to_string();
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/scenes/sphere.glb");
    let station = format!(
        "[scene]\npath = \"{scene}\"\nbackground = \"liver\"\n[probe]\nscanlines = 32\nsamples = 256\n[image]\nwidth = 160\n\
         height = 120\n[tracker]\ntransport = \"tcp\"\nprotocol = \"ascii-line\"\naddress = \"{address}\""
    );
    std::fs::write(at("s.toml"), station).unwrap();
    let args = ["run", &at("s.toml"), "--backend", "host", "--sink", "null", "--duration", "4", "--json"];
    let output = insonify(&[&args[..], &["--metrics", &at("m.jsonl")]].concat());
    let (code, out, err) = texts(&output);
    assert_eq!(code, Some(0), "{err}");
    let lines = std::fs::read_to_string(at("m.jsonl")).unwrap();
    let frames = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    (serde_json::from_str(&out).unwrap(), frames, err)
}

fn notices(frames: &[serde_json::Value]) -> Vec<&str> {
    frames.iter().filter_map(|frame| frame["notice"].as_str()).collect()
}

#[test]
fn a_session_tells_of_damaged_lines_on_frames_terminal_and_summary() {
    let address = server(|n| {
        let line = ascii_line::encode(n, u64::from(n) * 10_000, &Pose::IDENTITY);
        if n.is_multiple_of(2) { line.into_bytes() } else { line.replace(",", ";").into_bytes() }
    });
    let (summary, frames, err) = run(&address);
    let tracker = &summary["tracker"];
    assert!(tracker["damaged"].as_u64() > Some(20) && tracker["records"].as_u64() > Some(20), "{tracker}");
    assert!(tracker["last_fault"].as_str().unwrap().contains("damaged piece"), "{tracker}");
    let notices = notices(&frames);
    let on_frames = |text: &&str| text.starts_with("tracker: ") && text.contains("must start with `P,`");
    assert!(notices.iter().any(on_frames), "{notices:?}");
    assert!(err.contains("warning: tracker: ") && err.contains("damaged pieces"), "{err}");
}

#[test]
fn a_session_tells_of_bytes_that_make_no_sense() {
    let address =
        server(|n| (0..64).map(|i| (n.wrapping_mul(2_654_435_761).wrapping_add(i * 40_503) >> 9) as u8).collect());
    let (summary, frames, err) = run(&address);
    assert_eq!(summary["tracker"]["records"], 0);
    let told = |text: &&str| text.contains("no protocol known here");
    // From then on until the end: it is trouble that leaves no pose.
    let notices = notices(&frames);
    assert!(
        notices.iter().any(told) && notices.last().is_some_and(|last| last.starts_with("tracker: ")),
        "{notices:?}"
    );
    assert!(err.contains("no protocol known here"), "{err}");
}
