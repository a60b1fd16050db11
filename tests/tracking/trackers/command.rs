//! Tests of `insonify trackers`.

use std::process::{Command, Output};

fn run(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_insonify")).arg("trackers").args(args).env_remove("RUST_LOG").output().unwrap()
}

fn lines(output: &Output) -> Vec<serde_json::Value> {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout.clone()).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn connected_devices_are_listed() {
    let output = run(&["--json"]);
    let listed: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(output.status.success() && listed["serial"].is_array() && listed["hid"].is_array(), "{listed}");
}

#[test]
fn records_of_a_stations_tracker_are_printed() {
    let dir = tempfile::tempdir().unwrap();
    let station = dir.path().join("mock.toml");
    let text = "[scene]\npath = \"none.glb\"\n[pose]\nposition_mm = [100, 0, 0]\n[tracker]\ntransport = \"mock\"\n\
                schedule = \"move 60\"\nrate_hz = 200";
    std::fs::write(&station, text).unwrap();
    let found = lines(&run(&[station.to_str().unwrap(), "--seconds", "1.6", "--json"]));
    // One each half second, and the last; on a busy machine some come late.
    assert!(found.len() >= 2, "{found:?}");
    let last = found.last().unwrap();
    assert_eq!(last["state"], "streaming");
    for line in found.iter().filter(|line| !line["position_mm"].is_null()) {
        assert_eq!(line["missing"], 0);
        let x = line["position_mm"][0].as_f64().unwrap();
        assert!((80.0..120.0).contains(&x), "{line}");
    }
    assert!(!last["position_mm"].is_null(), "{last}");
    let mut events = found.iter().flat_map(|line| line["events"].as_array().unwrap());
    assert_eq!(events.next().unwrap(), "connected to a mock");
}

#[test]
fn a_recording_is_printed_to_its_end() {
    let dir = tempfile::tempdir().unwrap();
    let station = dir.path().join("replay.toml");
    let recording = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/exams/obstetric_sweep.mcap");
    let table = format!("[tracker]\ntransport = \"recording\"\nrecording = '{recording}'\nspeed = 0");
    std::fs::write(&station, format!("[scene]\npath = \"none.glb\"\n{table}")).unwrap();
    let output = run(&[station.to_str().unwrap()]);
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && text.contains("ended"), "{text}");
    assert!(text.lines().last().unwrap().contains(" 0 damaged pieces"), "{text}");
}

#[test]
fn missing_and_wrong_arguments_are_explained() {
    let station = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/sphere.toml");
    for (args, message) in [
        (&[station][..], "has no tracker: its [tracker] has no `transport`"),
        (&["--port", "/dev/ttyUSB0"], "--protocol"),
        (&["--port", "zz:1", "--protocol", "liberty"], "`zz:1` is no port"),
        (&["--port", "x", "--protocol", "librety"], "unknown tracker protocol `librety`"),
        (&["--protocol", "liberty"], "give --port or --address, too"),
        (&["--address", "x:1", "--protocol", "liberty", "--seconds", "0"], "--seconds is 0"),
    ] {
        let output = run(args);
        let text = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {text}");
        assert!(text.contains(message), "{args:?}: {text}");
    }
}

#[test]
fn why_an_address_could_not_be_opened_is_said_at_the_end() {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    drop(listener);
    let output = run(&["--address", &address, "--protocol", "ascii-line", "--seconds", "0.6"]);
    let text = String::from_utf8_lossy(&output.stderr);
    let last = text.rsplit("error: ").next().unwrap();
    assert_eq!(output.status.code(), Some(1), "{text}");
    let reason = last.split_once("it could not be opened: ").map(|(_, reason)| reason.trim());
    assert!(reason.is_some_and(|reason| !reason.is_empty()), "{text}");
}
