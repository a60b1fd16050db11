//! Tests of the program's files: those that it reads or has recorded are never lost, and none stops or hangs it.

// clippy counts helpers as outside of tests; a failing helper fails its test.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use glam::{DQuat, DVec3};
use insonify::pose::Pose;
use insonify::recording::{RecordingInfo, RecordingWriter, poses};
use insonify::tracker::{Protocol, ascii_line};
use serde_json::Value;
use tempfile::TempDir;

use crate::program::{insonify, program, refused, stderr, succeeded};

const SMALL: &str = "[probe]\nscanlines = 32\nsamples = 256\n[image]\nwidth = 160\nheight = 120\n[pose]\n";

/// A directory with a scene, a station, and a recording of two seconds.
struct Fixture {
    dir: TempDir,
    station: String,
    recording: String,
}

impl Fixture {
    fn new(more: &str) -> Self {
        let dir = tempfile::tempdir().unwrap();
        let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes/sphere.glb");
        std::fs::copy(scene, dir.path().join("scene.glb")).unwrap();
        let start = "[scene]\npath = \"scene.glb\"\nbackground = \"liver\"\n";
        std::fs::write(dir.path().join("station.toml"), format!("{start}{SMALL}{more}")).unwrap();
        let at = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
        let (station, recording) = (at("station.toml"), at("exam.mcap"));
        let start_time_ns = 1_790_000_000_000_000_000;
        let info = RecordingInfo {
            protocol: Protocol::AsciiLine,
            device: "test".into(),
            scene: "sphere".into(),
            start_time_ns,
            sensor: None,
            needle: None,
        };
        let mut writer = RecordingWriter::create(Path::new(&recording), &info).unwrap();
        for i in 0..121_u32 {
            let pose = Pose { position_mm: DVec3::X * f64::from(i) * 0.1, orientation: DQuat::IDENTITY };
            let line = ascii_line::encode(i, u64::from(i) * 16_667, &pose);
            writer.raw(start_time_ns + u64::from(i) * 16_666_667, line.as_bytes()).unwrap();
        }
        writer.finish().unwrap();
        Self { dir, station, recording }
    }

    fn at(&self, name: &str) -> String {
        self.dir.path().join(name).to_str().unwrap().to_owned()
    }

    /// Paths and contents of all files of the directory.
    fn files(&self) -> BTreeMap<PathBuf, Vec<u8>> {
        let entries = std::fs::read_dir(&self.dir).unwrap().map(|entry| entry.unwrap().path());
        entries.filter(|path| path.is_file()).map(|path| (path.clone(), std::fs::read(path).unwrap())).collect()
    }
}

#[test]
fn a_second_session_does_not_replace_the_recording_of_the_first() {
    let f = Fixture::new("");
    let (kept, metrics) = (f.at("kept.mcap"), f.at("frames.jsonl"));
    // To its end: after a few frames, nothing may have been recorded yet.
    let session = ["run", &f.station, "--replay", &f.recording, "--sink", "null"];
    let run = |more: &[&str]| insonify(&[&session[..], more].concat());
    succeeded(&run(&["--record", &kept, "--metrics", &metrics]));
    let before = f.files();
    for option in [["--record", &kept], ["--metrics", &metrics]] {
        refused(&run(&option), &["is there already; --force replaces it"]);
    }
    assert!(f.files() == before);
    succeeded(&run(&["--record", &kept, "--metrics", &metrics, "--force"]));
    assert!(poses(Path::new(&kept)).unwrap().1.is_clean());
    // A device takes a log as before.
    #[cfg(unix)]
    succeeded(&run(&["--metrics", "/dev/null"]));
}

#[test]
fn no_command_writes_a_file_that_it_reads() {
    let f = Fixture::new("");
    let copy = |name: &str| std::fs::copy(&f.station, f.at(name)).map(|_| f.at(name)).unwrap();
    let [frame, replay, tradeoff, qa, header] =
        ["frame.json", "replay.json", "tradeoff.json", "qa_phantom.json", "dataset.json"].map(copy);
    let [hard, soft] = ["hard.mcap", "soft.toml"].map(|name| f.at(name));
    std::fs::hard_link(&f.recording, &hard).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink(&f.station, &soft).unwrap();
    #[cfg(not(unix))]
    std::fs::copy(&f.station, &soft).unwrap();
    let dir = f.dir.path().to_str().unwrap();
    let around = format!("{dir}/../{}/exam.mcap", f.dir.path().file_name().unwrap().to_str().unwrap());
    for name in ["a.png", "b.png", "mask.png"] {
        image::GrayImage::new(16, 16).save(f.at(name)).unwrap();
    }
    std::fs::write(f.at("points.csv"), "0,0,0,0,0,0\n").unwrap();
    let [a, b, points, scene] = ["a.png", "b.png", "points.csv", "scene.glb"].map(|name| f.at(name));
    let model = "tests/data/generators/blur.onnx";
    let [station, recording] = [&f.station, &f.recording].map(String::as_str);
    let run = ["run", station, "--replay", recording, "--frames", "2", "--sink", "null", "--force"];
    let before = f.files();
    for arguments in [
        [&run[..], &["--record", recording]].concat(),
        [&run[..], &["--record", &hard]].concat(),
        [&run[..], &["--record", &around]].concat(),
        [&run[..], &["--record", station]].concat(),
        [&run[..], &["--metrics", station]].concat(),
        [&run[..], &["--metrics", &soft]].concat(),
        [&run[..], &["--metrics", &scene]].concat(),
        [&run[..], &["--metrics", recording]].concat(),
        vec!["record", station, "--stdin", "--protocol", "ascii-line", "--force", "--out", station],
        vec!["render", &frame, "--out", dir],
        vec!["replay", recording, &replay, "--out", dir],
        vec!["export", recording, station, "--force", "--out", &hard],
        vec!["import", &points, "--force", "--out", &points],
        vec!["exam", station, "--force", "--out", &scene],
        vec!["qa", &qa, "--out", dir],
        vec!["bench", station, "--json", station],
        vec!["view", station, "--out", &scene],
        vec!["view", &scene, "--out", &scene],
        vec!["dataset", &header, "--frames", "4", "--out", dir],
        vec!["tradeoff", &tradeoff, "--quick", "--out", dir],
        vec!["front", station, "--motion", recording, "--out", recording],
        vec!["evaluate", &a, &b, "--csv", &a],
        vec!["evaluate", &a, &b, "--json", &b],
        vec!["generator", model, "--frame", dir, "--out", model],
        vec!["calibrate", "pivot", recording, "--out", &hard],
        vec!["calibrate", "spin", recording, "--out", &hard],
        vec!["calibrate", "landmarks", &points, "--out", &points],
    ] {
        let output = insonify(&arguments);
        let message = stderr(&output);
        assert!(message.contains("this command reads"), "{arguments:?}: {message}");
        refused(&output, &["must name another place"]);
        assert!(f.files() == before, "{arguments:?} changed a file");
    }
    let page = f.at("page.html");
    refused(&insonify(&["selftest", "--json", &page, "--html", &page]), &["--json and --html name one file"]);
}

#[test]
fn files_that_exist_are_replaced_by_force_alone() {
    let f = Fixture::new("");
    let before = f.files();
    let [station, recording] = [&f.station, &f.recording].map(String::as_str);
    let other = f.at("other.mcap");
    std::fs::copy(recording, &other).unwrap();
    for arguments in [
        vec!["exam", "--out", &other],
        vec!["exam", station, "--out", &other],
        vec!["export", recording, station, "--out", &other],
        vec!["phantom", "--scale", "0.3", "--out", &other],
    ] {
        refused(&insonify(&arguments), &["other.mcap is there already; --force replaces it"]);
    }
    std::fs::remove_file(&other).unwrap();
    assert!(f.files() == before);
    succeeded(&insonify(&["exam", "--out", &other]));
    succeeded(&insonify(&["exam", "--out", &other, "--force"]));
}

#[test]
fn a_recording_does_not_replace_a_file_of_another_kind() {
    let f = Fixture::new("");
    let calibration = f.at("other.toml");
    std::fs::write(&calibration, "version = 1\n").unwrap();
    let before = f.files();
    let run = ["run", &f.station, "--replay", &f.recording, "--frames", "2", "--sink", "null", "--force", "--record"];
    let record = ["record", &f.station, "--stdin", "--protocol", "ascii-line", "--force", "--out"];
    for arguments in [&run[..], &record[..]] {
        refused(&insonify(&[arguments, &[calibration.as_str()]].concat()), &["other.toml", "it must end in .mcap"]);
    }
    assert!(f.files() == before);
}

#[test]
fn a_folder_in_place_of_a_file_is_refused_at_the_start() {
    let f = Fixture::new("");
    let folder = f.at("folder");
    std::fs::create_dir(&folder).unwrap();
    let before = f.files();
    let run = ["run", &f.station, "--replay", &f.recording, "--frames", "2", "--sink", "null"];
    for option in ["--record", "--metrics"] {
        refused(&insonify(&[&run[..], &[option, &folder]].concat()), &["is a directory", "takes a file"]);
        let below = format!("{}/new.mcap", f.station);
        refused(&insonify(&[&run[..], &[option, &below]].concat()), &["station.toml is not a directory"]);
    }
    refused(&insonify(&["exam", "--force", "--out", &folder]), &["is a directory", "takes a file"]);
    refused(&insonify(&["render", &f.station, "--out", &f.recording]), &["--out takes a directory"]);
    assert!(f.files() == before);
}

#[cfg(unix)]
#[test]
fn devices_pipes_and_huge_files_are_refused_by_name() {
    let f = Fixture::new("[calibration]\npath = \"calibration.toml\"\n");
    let calibration = f.at("calibration.toml");
    let replay = |station: &str| insonify(&["replay", &f.recording, station, "--out", &f.at("out")]);
    let refused_for = |reason: &str| {
        refused(&replay(&f.station), &["cannot read the calibration file", "calibration.toml", reason]);
        std::fs::remove_file(&calibration).unwrap();
    };
    std::os::unix::fs::symlink("/dev/zero", &calibration).unwrap();
    refused_for("it is not a regular file");
    nix::unistd::mkfifo(Path::new(&calibration), nix::sys::stat::Mode::S_IRWXU).unwrap();
    refused_for("it is not a regular file");
    std::fs::File::create(&calibration).unwrap().set_len(1 << 40).unwrap();
    refused_for("it has 1099511627776 bytes; a calibration has at most 1048576");

    let pipe = f.at("pipe");
    nix::unistd::mkfifo(Path::new(&pipe), nix::sys::stat::Mode::S_IRWXU).unwrap();
    refused(&replay("/dev/zero"), &["cannot read the station file /dev/zero"]);
    refused(&insonify(&["inspect", &pipe]), &["cannot read the recording", "not a regular file"]);
    refused(&insonify(&["doctor", &pipe]), &["cannot read the scene", "not a regular file"]);
    refused(&insonify(&["evaluate", &pipe, &pipe]), &["cannot read", "not a regular file"]);
    refused(&insonify(&["calibrate", "landmarks", &pipe]), &["cannot read the landmarks", "not a regular file"]);
    refused(&insonify(&["generator", "/dev/zero"]), &["cannot read"]);
}

#[test]
fn a_cache_that_cannot_be_written_is_said_and_stops_nothing() {
    let f = Fixture::new("");
    let station = f.at("phantom.toml");
    std::fs::write(&station, "[scene]\nphantom = \"obstetric\"\nphantom_scale = 0.3\n").unwrap();
    // Below a file nothing can be made, not even by root.
    let output =
        program(&["doctor", &station, "--json"]).env("INSONIFY_CACHE", f.at("exam.mcap/cache")).output().unwrap();
    let message = stderr(&output);
    assert!(message.contains("the generated scene is not kept"), "{message}");
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let path = Path::new(report["path"].as_str().unwrap());
    assert!(report["surfaces"].as_u64().unwrap() > 10 && !path.exists(), "{report}");
}

#[test]
fn a_time_to_finish_that_no_display_can_keep_is_refused() {
    let f = Fixture::new("[pipeline]\nfinish_ms = 0\n");
    refused(&insonify(&["run", &f.station, "--frames", "2"]), &["pipeline.finish_ms", "100..=600000"]);
    let f = Fixture::new("[pipeline]\nfinish_ms = 100\n");
    succeeded(&insonify(&["run", &f.station, "--frames", "2", "--sink", "null"]));
}

/// Number of frames in an interrupted video.
#[cfg(unix)]
fn interrupted_frames(bytes: &[u8]) -> usize {
    use shiguredo_mp4::demux::{DemuxError, Fmp4FileDemuxer, Input};
    let (mut demuxer, mut frames) = (Fmp4FileDemuxer::new(), 0);
    while let Some(required) = demuxer.required_input() {
        let data = bytes.get(required.position as usize..).unwrap_or_default();
        let data = &data[..required.size.map_or(data.len(), |size| size.min(data.len()))];
        demuxer.handle_input(Input { position: required.position, data });
        loop {
            match demuxer.next_sample() {
                Ok(Some(_)) => frames += 1,
                Ok(None) | Err(DemuxError::InputRequired(_)) => break,
                Err(_) => return frames,
            }
        }
    }
    frames
}

#[cfg(unix)]
fn names(directory: &str) -> Vec<String> {
    let entries = std::fs::read_dir(directory).unwrap();
    let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[cfg(unix)]
#[test]
fn a_killed_session_leaves_a_video_that_plays_and_the_next_one_keeps_it() {
    let f = Fixture::new("[pipeline]\nframe_rate_hz = 20\n");
    let out = f.at("out");
    let session = ["run", &f.station, "--sink", "video", "--out", &out];
    let mut child = program(&session).stderr(std::process::Stdio::null()).spawn().unwrap();
    let part = f.at("out/video.part.mp4");
    let deadline = std::time::Instant::now() + std::time::Duration::from_secs(120);
    while std::fs::read(&part).map_or(0, |bytes| interrupted_frames(&bytes)) < 40 {
        assert!(std::time::Instant::now() < deadline, "no two seconds of video are written");
        std::thread::yield_now();
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(names(&out), ["video.part.mp4"]);
    let left = std::fs::read(&part).unwrap();
    assert!(interrupted_frames(&left) >= 40);

    let next = insonify(&[&session[..], &["--frames", "2"]].concat());
    succeeded(&next);
    assert!(stderr(&next).contains("video.recovered-1.mp4"), "{}", stderr(&next));
    assert_eq!(names(&out), ["video.mp4", "video.recovered-1.mp4"]);
    assert!(std::fs::read(f.at("out/video.recovered-1.mp4")).unwrap() == left);
}

#[cfg(unix)]
#[test]
fn a_full_disk_leaves_a_video_that_plays() {
    let f = Fixture::new(
        "[pipeline]\nframe_rate_hz = 20\n[tracker]\ntransport = \"mock\"\nschedule = \"move 60\"\nrate_hz = 100\n",
    );
    let out = f.at("out");
    let session = ["run", &f.station, "--sink", "video", "--out", &out, "--frames", "240"];
    // Files end at 200 kB or 400 kB, depending on the shell's block size. Writing more is an error instead of a signal.
    let limited = Command::new("sh")
        .args(["-c", "trap '' XFSZ; ulimit -f 400; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_insonify")])
        .args(session)
        .env_remove("RUST_LOG")
        .output()
        .unwrap();
    let message = stderr(&limited);
    assert_eq!(limited.status.code(), Some(1), "{message}");
    assert!(message.contains("video.part.mp4") && message.contains("File too large"), "{message}");
    assert_eq!(names(&out), ["video.part.mp4"]);
    let bytes = std::fs::read(f.at("out/video.part.mp4")).unwrap();
    assert!(interrupted_frames(&bytes) >= 20, "{} frames in {} bytes", interrupted_frames(&bytes), bytes.len());
}
