//! Tests of the program as a shell sees it: exit codes, messages, files.

// clippy counts helpers as outside of tests; a failing helper fails its test.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use glam::{DQuat, DVec3, Vec3};
use insonify::anatomy::analytic::cuboid;
use insonify::anatomy::export::{LabelledSurface, write_glb};
use insonify::pose::Pose;
use insonify::recording::{Event, RecordingInfo, RecordingWriter};
use insonify::sink::write_json;
use insonify::tracker::{Protocol, ascii_line};
use serde_json::Value;
use shiguredo_mp4::TrackKind;
use shiguredo_mp4::demux::{Input, Mp4FileDemuxer};
use tempfile::TempDir;

use crate::program::{self, insonify, refused, stderr, succeeded};

const SMALL: &str = "[probe]\nscanlines = 32\nsamples = 256\n[image]\nwidth = 160\nheight = 120\n";

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// A directory with `scene.glb`, a box of liver below the probe at the origin.
fn directory() -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    scene(&dir.path().join("scene.glb"), "liver");
    dir
}

fn scene(path: &Path, tissue: &str) {
    let mesh = cuboid(Vec3::new(-60.0, -60.0, 10.0), Vec3::new(60.0, 60.0, 90.0));
    let surface = LabelledSurface { name: "block".into(), tissue: tissue.into(), priority: 1, mesh };
    write_glb(&[surface], path).unwrap();
}

/// A station file in `dir`: the table `[scene]`, then `rest`.
fn station(dir: &TempDir, rest: &str) -> PathBuf {
    let path = dir.path().join("station.toml");
    std::fs::write(&path, format!("[scene]\npath = \"scene.glb\"\n{rest}")).unwrap();
    path
}

fn render(dir: &TempDir, station: &Path, more: &[&str]) -> Output {
    let out = dir.path().join("out");
    insonify(&[&["render", text(station), "--out", text(&out)], more].concat())
}

const ORIGIN: [&str; 2] = ["--pose", "0,0,0,1,0,0,0"];

/// A recording of two seconds over the box, 60 poses a second.
fn recording(path: &Path) {
    let start_time_ns = 1_790_000_000_000_000_000;
    let info = RecordingInfo {
        protocol: Protocol::AsciiLine,
        device: "test".into(),
        scene: "box".into(),
        start_time_ns,
        sensor: None,
        needle: None,
    };
    let mut writer = RecordingWriter::create(path, &info).unwrap();
    for i in 0..121u32 {
        let time_ns = start_time_ns + u64::from(i) * 1_000_000_000 / 60;
        let pose = Pose { position_mm: DVec3::X * f64::from(i) * 0.1, orientation: DQuat::IDENTITY };
        writer.raw(time_ns, ascii_line::encode(i, u64::from(i) * 16_667, &pose).as_bytes()).unwrap();
        if i == 60 {
            writer.event(&Event::new(time_ns, "middle")).unwrap();
        }
    }
    writer.finish().unwrap();
}

#[test]
fn one_frame_is_written_with_all_its_maps() {
    let dir = directory();
    let station = station(&dir, SMALL);
    let first = render(&dir, &station, &[&ORIGIN[..], &["--quality", "2x1", "--seed", "7", "--json"]].concat());
    succeeded(&first);
    let out = dir.path().join("out");
    let read = |name: &str| std::fs::read(out.join(name)).unwrap();
    let size = |name: &str| {
        let image = image::load_from_memory(&read(name)).unwrap();
        assert_eq!(image.color(), image::ColorType::L8, "{name}");
        (image.width(), image.height())
    };
    for name in ["bmode.png", "segmentation.png", "mask.png"] {
        assert_eq!(size(name), (160, 120), "{name}");
    }
    let attenuation = read("attenuation.npy");
    let npy = npyz::NpyFile::new(&attenuation[..]).unwrap();
    assert_eq!(npy.shape(), &[120, 160]);
    let values: Vec<f32> = npy.into_vec().unwrap();
    assert!(values.iter().all(|v| (0.0..=1.0).contains(v)));
    let lines = read("lines.npy");
    let npy = npyz::NpyFile::new(&lines[..]).unwrap();
    assert_eq!((npy.shape(), npy.dtype().descr().contains("c8")), (&[32, 256][..], true));

    let names: Value = serde_json::from_slice(&read("tissues.json")).unwrap();
    assert_eq!(names["0"], "outside");
    let segmentation = image::load_from_memory(&read("segmentation.png")).unwrap().into_bytes();
    let mask = image::load_from_memory(&read("mask.png")).unwrap().into_bytes();
    let mut seen: Vec<&str> = segmentation.iter().map(|n| names[n.to_string()].as_str().unwrap()).collect();
    seen.sort_unstable();
    seen.dedup();
    assert_eq!(seen, ["gel", "liver", "outside"]);
    assert!(segmentation.iter().zip(&mask).all(|(&tissue, &mask)| (tissue > 0) == (mask == 255)));

    let json: Value = serde_json::from_slice(&read("frame.json")).unwrap();
    for (key, value) in [("rays", 2), ("layers", 1), ("seed", 7)] {
        assert_eq!(json["quality"][key], value, "{key}");
    }
    assert_eq!(json["pose"]["orientation_wxyz"], serde_json::json!([1.0, 0.0, 0.0, 0.0]));
    assert_eq!(json["overflows"], 0);
    assert!(json["times"]["total_ms"].as_f64().unwrap() > 0.0);
    let printed: Value = serde_json::from_slice(&first.stdout).unwrap();
    assert_eq!((&printed["image"], printed["files"].as_array().unwrap().len()), (&json["image"], 7));

    // The same command gives the same bytes.
    let again = render(&dir, &station, &[&ORIGIN[..], &["--quality", "2x1", "--seed", "7"]].concat());
    succeeded(&again);
    assert_eq!((read("lines.npy"), read("attenuation.npy")), (lines, attenuation));
}

#[test]
fn the_sphere_of_configs_renders_without_further_arguments() {
    let dir = tempfile::tempdir().unwrap();
    succeeded(&insonify(&["render", "configs/sphere.toml", "--out", text(dir.path())]));
    let image = image::open(dir.path().join("bmode.png")).unwrap().into_luma8();
    assert_eq!(image.dimensions(), (1386, 1000));
    let mean = |columns: std::ops::Range<u32>, rows: std::ops::Range<u32>| {
        let count = f64::from((columns.len() * rows.len()) as u32);
        let sum: u32 = rows
            .flat_map(|y| columns.clone().map(move |x| (x, y)))
            .map(|(x, y)| u32::from(image.get_pixel(x, y).0[0]))
            .sum();
        f64::from(sum) / count
    };
    // The cyst at 70 mm is darker than the liver beside it at the same depth.
    let (cyst, liver) = (mean(660..726, 450..530), mean(400..466, 450..530));
    assert!(liver > cyst + 20.0, "liver {liver}, cyst {cyst}");
}

#[test]
fn unusable_stations_are_refused() {
    let dir = directory();
    refused(&insonify(&["render", "no/such/station.toml"]), &["no/such/station.toml"]);
    let wrong = [
        ("[probe]\ndept_mm = 150", "dept_mm"),
        ("[prob]\ndepth_mm = 150", "prob"),
        ("[probe]\ndepth_mm = 0", "depth_mm"),
        ("[probe]\ndepth_mm = nan", "depth_mm"),
        ("[probe]\ndepth_mm = \"deep\"", "depth_mm"),
        ("[probe]\nsamples = 1000000000", "samples"),
        ("[probe]\nscanlines = 0", "scanlines"),
        ("[probe]\nkind = \"conve\"", "convex"),
        ("[probe]\nfov_deg = 400", "fov_deg"),
        ("[image]\nwidth = 0", "width"),
        ("[image]\nheight = 100000", "height"),
        ("[image]\ndynamic_range_db = -1", "dynamic_range_db"),
        ("[quality]\nrays = 0", "rays"),
        ("[quality]\nlayers = 1000", "layers"),
        ("[pose]\nposition_mm = [0, 0]", "position_mm"),
        ("[tissues.liver]\nspeed_m_s = 0", "speed_m_s"),
        ("[tissues.granite]\nspeed_m_s = 5900", "granite"),
        ("[probe", "TOML"),
    ];
    for (rest, word) in wrong {
        refused(&render(&dir, &station(&dir, rest), &ORIGIN), &["station.toml", word]);
    }
    let path = dir.path().join("station.toml");
    std::fs::write(&path, "[scene]\npath = \"scene.glb\"\nbackground = \"watr\"\n").unwrap();
    refused(&render(&dir, &path, &ORIGIN), &["watr", "water"]);
    std::fs::write(&path, "[probe]\n").unwrap();
    refused(&render(&dir, &path, &ORIGIN), &["scene"]);
}

#[test]
fn unusable_scenes_are_refused() {
    let dir = directory();
    let path = dir.path().join("scene.glb");
    let station = station(&dir, SMALL);
    let whole = std::fs::read(&path).unwrap();
    for length in [0, 3, 12, 40, whole.len() / 2, whole.len() - 1] {
        std::fs::write(&path, &whole[..length]).unwrap();
        refused(&render(&dir, &station, &ORIGIN), &["scene.glb"]);
    }
    std::fs::write(&path, "this is no scene, but it is text of some length").unwrap();
    refused(&render(&dir, &station, &ORIGIN), &["scene.glb"]);
    scene(&path, "livr");
    refused(&render(&dir, &station, &ORIGIN), &["scene.glb", "block", "livr", "liver"]);
    std::fs::remove_file(&path).unwrap();
    refused(&render(&dir, &station, &ORIGIN), &["scene.glb"]);
}

#[test]
fn unusable_poses_and_arguments_are_refused() {
    let dir = directory();
    let station = station(&dir, SMALL);
    let pose = |pose: &str| render(&dir, &station, &["--pose", pose]);
    refused(&pose("nan,0,0,1,0,0,0"), &["--pose", "`x` is NaN"]);
    refused(&pose("0,0,0,1,0,0,inf"), &["qz"]);
    refused(&pose("0,0,0,1,1,0,0"), &["norm"]);
    refused(&pose("0,0,0,0,0,0,0"), &["norm"]);
    refused(&pose("0,0,0,1,0,0"), &["seven numbers"]);
    refused(&pose("0,0,0,1,0,0,0,0"), &["seven numbers"]);
    refused(&pose("-1e9,0,0,1,0,0,0"), &["`x` is -1000000000 mm"]);
    refused(&pose(""), &["seven numbers"]);
    refused(&render(&dir, &station, &[]), &["--pose", "station.toml"]);
    for quality in ["0x1", "1x0", "mq", "1000x1", "8"] {
        refused(&render(&dir, &station, &[&ORIGIN[..], &["--quality", quality]].concat()), &["--quality", quality]);
    }
    refused(&render(&dir, &station, &[&ORIGIN[..], &["--seed", "-1"]].concat()), &["--seed"]);
    refused(&render(&dir, &station, &["--poes", "0,0,0,1,0,0,0"]), &["--pose"]);
    refused(&insonify(&["rendre"]), &["render"]);
    refused(&insonify(&["phantom", "--out", text(&dir.path().join("p.glb")), "--scale", "nan"]), &["scale", "NaN"]);
    refused(&insonify(&["demo", "--out", text(dir.path()), "--fps", "0"]), &["frames a second"]);
}

/// Runs `render` of a small station as on a machine without a Vulkan driver.
fn render_without_driver(dir: &TempDir, arguments: &[&str]) -> Output {
    let station = station(dir, SMALL);
    let mut command = Command::new(env!("CARGO_BIN_EXE_insonify"));
    command.args(["render", text(&station), ORIGIN[0], ORIGIN[1], "--out", text(&dir.path().join("out"))]);
    command.args(arguments).env("WGPU_BACKEND", "vulkan");
    command.env("VK_DRIVER_FILES", "/nonexistent").env("VK_ICD_FILENAMES", "/nonexistent").output().unwrap()
}

#[test]
fn a_missing_driver_is_refused_with_the_remedy_where_a_device_is_asked_for() {
    let output = render_without_driver(&directory(), &["--backend", "device"]);
    refused(&output, &["no GPU driver", "mesa-vulkan-drivers"]);
}

#[test]
fn without_a_driver_frames_are_made_on_the_host() {
    let dir = directory();
    let output = render_without_driver(&dir, &[]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let record = std::fs::read_to_string(dir.path().join("out/frame.json")).unwrap();
    assert!(record.contains("insonify host"), "{record}");
}

#[test]
fn an_unknown_way_of_trace_and_unknown_instructions_are_refused() {
    let dir = directory();
    let station = station(&dir, SMALL);
    let out = dir.path().join("out");
    let arguments = ["render", text(&station), ORIGIN[0], ORIGIN[1], "--backend", "host", "--out", text(&out)];
    let with = |name: &str, value: &str| program::program(&arguments).env(name, value).output().unwrap();
    refused(&with("INSONIFY_TRACE", "gpu"), &["INSONIFY_TRACE: `gpu` is no way of trace; they are path, lanes"]);
    let expected = "INSONIFY_SIMD: `sse` names no instructions; they are portable, avx2, avx512";
    refused(&with("INSONIFY_SIMD", "sse"), &[expected]);
    succeeded(&with("INSONIFY_SIMD", "portable"));
    let record = std::fs::read_to_string(out.join("frame.json")).unwrap();
    assert!(record.contains(&format!("threads, {}", std::env::consts::ARCH)), "{record}");
}

#[test]
#[ignore = "needs a graphics device or software Vulkan; `make test` runs it where there is one"]
fn a_device_traces_as_the_environment_says() {
    let dir = directory();
    let station = station(&dir, SMALL);
    let bmode = |way: &str, said: &str| {
        let out = dir.path().join(format!("out-{way}"));
        let mut command = program::program(&[
            "render",
            text(&station),
            ORIGIN[0],
            ORIGIN[1],
            "--backend",
            "device",
            "--out",
            text(&out),
        ]);
        succeeded(&command.env("INSONIFY_TRACE", way).output().unwrap());
        let record: Value = serde_json::from_slice(&std::fs::read(out.join("frame.json")).unwrap()).unwrap();
        let software = record["adapter"]["name"].as_str().unwrap().contains("llvmpipe");
        assert!(!software || record["adapter"]["trace"] == said, "{}", record["adapter"]);
        std::fs::read(out.join("bmode.png")).unwrap()
    };
    // Software Vulkan traces by path, unless it is told otherwise.
    let [lanes, path, chosen] = [bmode("lanes", "lanes"), bmode("path", "path"), bmode("", "path")];
    assert!(chosen == path || chosen == lanes);
}

#[test]
fn the_record_says_what_a_budget_chose() {
    let dir = directory();
    let record = |add: &str, options: &[&str]| {
        let station = station(&dir, &format!("{SMALL}{add}"));
        succeeded(&render(&dir, &station, &[&ORIGIN[..], options].concat()));
        let read = std::fs::read(dir.path().join("out/frame.json")).unwrap();
        serde_json::from_slice::<Value>(&read).unwrap()
    };
    let budget = "\n[quality]\nframe_budget_ms = 10000\n";
    let chosen = record(budget, &[]);
    assert_eq!([&chosen["quality"]["rays"], &chosen["quality"]["layers"]], [32, 3]);
    let said = chosen["chosen"].as_str().unwrap();
    assert!(said.starts_with("32x3, ") && said.contains(" grey levels off the converged picture ("), "{said}");
    assert_eq!(record(budget, &["--quality", "2x1"])["chosen"], Value::Null);
}

#[test]
fn an_unwritable_directory_is_another_failure() {
    let dir = directory();
    let station = station(&dir, SMALL);
    let out = dir.path().join("out");
    std::os::unix::fs::symlink("/proc/nowhere", &out).unwrap();
    let output = render(&dir, &station, &ORIGIN);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert!(stderr(&output).contains(text(&out)) && !stderr(&output).contains("panicked"));
    // A file in its place is a wrong argument.
    std::fs::remove_file(&out).unwrap();
    std::fs::write(&out, "in the way").unwrap();
    let output = render(&dir, &station, &ORIGIN);
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert!(stderr(&output).contains("takes a directory"), "{}", stderr(&output));
}

#[test]
fn a_recording_becomes_frames_and_a_video() {
    let dir = directory();
    let (station, exam, out) = (station(&dir, SMALL), dir.path().join("exam.mcap"), dir.path().join("frames"));
    recording(&exam);
    let replay = |more: &[&str]| {
        let output =
            insonify(&[&["replay", text(&exam), text(&station), "--out", text(&out), "--json"], more].concat());
        succeeded(&output);
        let report: Value = serde_json::from_slice(&output.stdout).unwrap();
        (report, stderr(&output))
    };
    let (report, _) = replay(&["--fps", "10", "--frames", "3..8", "--maps", "--raw-poses"]);
    assert_eq!((&report["rendered"], &report["held"], &report["overflowed"]), (&5.into(), &0.into(), &0.into()));
    assert_eq!(report["recording"]["clean"], true);
    let names = |map: &str| {
        let mut names: Vec<_> = std::fs::read_dir(out.join(map)).unwrap().map(|e| e.unwrap().file_name()).collect();
        names.sort();
        names
    };
    assert_eq!(names("bmode"), ["00003.png", "00004.png", "00005.png", "00006.png", "00007.png"]);
    assert_eq!((names("segmentation").len(), names("attenuation").len()), (5, 5));
    assert!(out.join("mask.png").is_file() && out.join("tissues.json").is_file());
    let file: Value = serde_json::from_slice(&std::fs::read(out.join("replay.json")).unwrap()).unwrap();
    assert_eq!(file["frames"][0]["index"], 3);
    assert!((file["frames"][0]["pose"]["position_mm"][0].as_f64().unwrap() - 1.8).abs() < 1e-3);
    let video = std::fs::read(report["video"].as_str().unwrap()).unwrap();
    let mut demuxer = Mp4FileDemuxer::new();
    demuxer.handle_input(Input { position: 0, data: &video });
    let track = &demuxer.tracks().unwrap()[0];
    assert_eq!((track.duration as f64 / f64::from(track.timescale.get()), track.kind), (0.5, TrackKind::Video));
    assert_eq!(std::iter::from_fn(|| demuxer.next_sample().unwrap().map(|sample| sample.keyframe)).count(), 5);

    // Files left by an earlier replay are reported.
    let (_, warning) = replay(&["--fps", "10", "--frames", "..2"]);
    assert!(warning.contains("15 frames of an earlier replay"), "{warning}");
}

#[test]
fn a_truncated_recording_is_used_up_to_its_end() {
    let dir = directory();
    let (station, exam, out) = (station(&dir, SMALL), dir.path().join("exam.mcap"), dir.path().join("frames"));
    recording(&exam);
    let whole = std::fs::read(&exam).unwrap();
    std::fs::write(&exam, &whole[..whole.len() * 2 / 3]).unwrap();
    let output = insonify(&["replay", text(&exam), text(&station), "--out", text(&out), "--fps", "5", "--json"]);
    succeeded(&output);
    assert!(stderr(&output).contains("exam.mcap") && stderr(&output).contains("not whole"), "{}", stderr(&output));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["recording"]["clean"], false);
    assert!(report["recording"]["truncated"].is_string());
    let rendered = report["rendered"].as_u64().unwrap();
    assert!((1..11).contains(&rendered), "{rendered}");
}

#[test]
fn unusable_recordings_are_refused() {
    let dir = directory();
    let (station, exam) = (station(&dir, SMALL), dir.path().join("exam.mcap"));
    let out = dir.path().join("frames");
    let replay =
        |more: &[&str]| insonify(&[&["replay", text(&exam), text(&station), "--out", text(&out)], more].concat());
    refused(&replay(&[]), &["exam.mcap"]);
    std::fs::write(&exam, "").unwrap();
    refused(&replay(&[]), &["exam.mcap"]);
    write_json(&exam, &"a text of more than eight characters").unwrap();
    refused(&replay(&[]), &["exam.mcap"]);
    recording(&exam);
    refused(&replay(&["--fps", "10", "--frames", "500.."]), &["--frames", "500", "21"]);
    refused(&replay(&["--frames", "8..3"]), &["--frames"]);
    refused(&replay(&["--fps", "-5"]), &["-5 frames a second"]);
    let whole = std::fs::read(&exam).unwrap();
    std::fs::write(&exam, &whole[..60]).unwrap();
    refused(&replay(&[]), &["exam.mcap"]);
    assert!(!out.exists(), "nothing is written before the input is known to be good");
}

#[test]
fn tables_are_printed_as_text_and_json() {
    let tissues = insonify(&["tissues", "--json"]);
    succeeded(&tissues);
    let json: Value = serde_json::from_slice(&tissues.stdout).unwrap();
    assert!(json["liver"]["speed_m_s"]["value"].as_f64().unwrap() > 1500.0);
    let keys = insonify(&["station-keys"]);
    succeeded(&keys);
    let keys = String::from_utf8(keys.stdout).unwrap();
    assert!(keys.contains("depth_mm") && keys.contains("dynamic_range_db"));
}

#[test]
fn help_is_complete() {
    for (command, words) in [
        ("demo", ["contact_sheet.png           key frames: LQ | translated from LQ | HQ |", "--no-live", "--once"]),
        ("record", ["--stdin", "--protocol", "FILE.part"]),
        ("render", ["x,y,z,qw,qx,qy,qz", "segmentation.png", "1..=256"]),
        ("replay", ["truncated", "--raw-poses", "--ignore-controls"]),
        ("phantom", ["--scale", "0.01..=20", "Example:"]),
        ("exam", ["--seed", "obstetric_sweep.mcap", "Example"]),
        ("tissues", ["--json", "ranges", "sources"]),
        ("station-keys", ["default", "range", "unit"]),
    ] {
        let output = insonify(&[command, "--help"]);
        succeeded(&output);
        let help = String::from_utf8(output.stdout).unwrap();
        for word in words {
            assert!(help.contains(word), "{command}: `{word}` is missing: {help}");
        }
    }
}

#[test]
#[cfg(unix)]
fn a_closed_output_pipe_is_not_a_panic() {
    use std::process::Stdio;
    let mut child = Command::new(env!("CARGO_BIN_EXE_insonify"))
        .args(["tissues", "--json"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(!stderr(&output).contains("panicked"), "{}", stderr(&output));
    assert_eq!(output.status.code(), Some(0));
}

/// A box in gel with a file of standard planes, a station, and a recording of an expert who finds the planes.
fn planes_station(dir: &TempDir) -> PathBuf {
    let mesh = cuboid(Vec3::new(-44.0, -60.0, 10.0), Vec3::new(44.0, 60.0, 90.0));
    let surface = LabelledSurface { name: "block".into(), tissue: "liver".into(), priority: 1, mesh };
    write_glb(&[surface], &dir.path().join("scene.glb")).unwrap();
    let planes = serde_json::json!({ "version": 1, "planes": [{
        "name": "middle", "title": "middle of the block",
        "tolerances": { "angle_deg": 10, "distance_mm": 5, "centring_mm": 20, "depth_mm": [20, 60] },
        "views": [{
            "centre_mm": [0, 0, 50], "normal": [0, 1, 0], "lateral": [1, 0, 0], "to_probe": [0, 0, -1],
            "landmarks": [{ "name": "middle", "position_mm": [0, 0, 50] }],
            "calipers": [{
                "name": "W", "title": "width", "kind": "line", "points_mm": [[-44, 0, 50], [44, 0, 50]],
                "surface": "block", "reach_mm": 5
            }]
        }]
    }]});
    write_json(&dir.path().join("scene.planes.json"), &planes).unwrap();
    station(dir, SMALL)
}

#[test]
fn a_users_own_scene_can_be_trained_on() {
    let dir = tempfile::tempdir().unwrap();
    let station = planes_station(&dir);
    let planes = insonify(&["planes", text(&station), "--json"]);
    succeeded(&planes);
    let planes: Value = serde_json::from_slice(&planes.stdout).unwrap();
    let depth_mm = planes["planes"][0]["views"][0]["pose"][2].as_f64().unwrap();
    assert!((depth_mm - 12.5).abs() < 0.01, "pressed 2.5 mm into the block: {planes}");

    let out = dir.path().join("sessions");
    let exam = insonify(
        &[
            &["exam", text(&station), "--out", text(&out), "--sessions", "2", "--seed", "40"][..],
            &["--skill", "expert", "--duration", "12", "--json"],
        ]
        .concat(),
    );
    succeeded(&exam);
    let sessions: Value = serde_json::from_slice(&exam.stdout).unwrap();
    assert_eq!(sessions.as_array().unwrap().len(), 2);
    assert_eq!(sessions[1]["key_frames"][0]["name"], "middle");
    assert!(out.join("sessions.json").is_file());

    let (recording, page) = (out.join("session_000041.mcap"), dir.path().join("page.html"));
    let score = insonify(&["score", text(&recording), text(&station), "--json", "--out", text(&page)]);
    succeeded(&score);
    let score: Value = serde_json::from_slice(&score.stdout).unwrap();
    let plane = &score["planes"][0];
    assert!(plane["found"] == true && score["poses"] == "tracker", "{score}");
    assert!((plane["measures"][0]["measured_mm"].as_f64().unwrap() - 88.0).abs() < 1.0, "{plane}");
    assert!(score["calipers"][0]["error_percent"].as_f64().unwrap().abs() < 5.0, "{score}");
    let page = std::fs::read_to_string(&page).unwrap();
    assert!(page.contains("middle of the block") && page.contains("<polyline") && page.ends_with("</html>\n"));
    let table = insonify(&["score", text(&recording), text(&station)]);
    succeeded(&table);
    assert!(String::from_utf8_lossy(&table.stdout).starts_with("1 of 1 planes found"));
}

#[test]
fn faulty_scores_and_exams_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let station = planes_station(&dir);
    let session = dir.path().join("session.mcap");
    recording(&session);
    let score = |more: &[&str]| insonify(&[&["score", text(&session), text(&station)], more].concat());
    succeeded(&score(&[]));
    refused(&score(&["--planes", "midle"]), &["no standard plane `midle`", "did you mean `middle`"]);
    refused(&score(&["--out", "score.png"]), &["must end in .html"]);
    refused(&insonify(&["score", text(&station), text(&station)]), &["is not a recording"]);
    let exam = |more: &[&str]| {
        let out = dir.path().join("exam.mcap");
        insonify(&[&["exam", text(&station), "--out", text(&out)], more].concat())
    };
    refused(&exam(&["--duration", "3"]), &["too short for 1 planes"]);
    refused(&exam(&["--duration", "nan"]), &["--duration is NaN"]);
    refused(&exam(&["--skill", "guru"]), &["novice, trained, expert, mixed"]);
    refused(&insonify(&["exam", "--out", "x.mcap", "--planes", "middle"]), &["STATION"]);

    let file = dir.path().join("scene.planes.json");
    let text_of = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, text_of.replace("\"block\"", "\"blok\"")).unwrap();
    refused(&score(&[]), &["scene.planes.json: plane `middle`", "surface `blok`", "did you mean `block`"]);
    std::fs::write(&file, text_of.replace("\"angle_deg\": 10", "\"angle_deg\": -10")).unwrap();
    refused(&score(&[]), &["scene.planes.json", "planes.middle.tolerances.angle_deg"]);
    std::fs::remove_file(&file).unwrap();
    refused(&score(&[]), &["has no standard planes", "scene.planes.json is not there"]);
}

#[test]
fn view_renders_a_scene_and_refuses_unusable_ones() {
    let dir = directory();
    let scene = dir.path().join("scene.glb");
    let out = dir.path().join("view.png");
    let view =
        |more: &[&str]| insonify(&[&["view", text(&scene), "--out", text(&out), "--size", "400x300"], more].concat());
    for more in [&[][..], &ORIGIN, &["--sheet", "--pose", "0,0,0,1,0,0,0", "--cut", "z=30"]] {
        succeeded(&view(more));
        let picture = image::open(&out).unwrap().to_rgb8();
        assert_eq!(picture.dimensions(), (400, 300));
        std::fs::remove_file(&out).unwrap();
    }
    let station = station(&dir, SMALL);
    succeeded(&insonify(&[&["view", text(&station), "--out", text(&out), "--cut", "fan"][..], &ORIGIN].concat()));
    refused(&insonify(&["view", "/nowhere.glb"]), &["/nowhere.glb"]);
    refused(&insonify(&["view", "/nowhere.toml"]), &["/nowhere.toml"]);
    refused(&view(&["--hide", "blok"]), &["`blok`", "did you mean `block`"]);
    refused(&view(&["--only", "marrow"]), &["`marrow`"]);
    refused(&view(&["--hide", "liver"]), &["every surface is hidden"]);
    refused(&view(&["--from", "anteriour"]), &["anteriour", "did you mean `anterior`"]);
    refused(&view(&["--orbit", "30"]), &["AZIMUTH,ELEVATION"]);
    refused(&view(&["--cut", "w=3"]), &["`w=3`"]);
    refused(&view(&["--cut", "fan"]), &["--cut fan needs a probe"]);
    refused(&view(&["--bmode"]), &["needs a station"]);
    refused(&view(&["--pose", "0,0,0,2,0,0,0"]), &["quaternion"]);
}

#[test]
fn the_doctors_exit_code_reports_defects() {
    let dir = directory();
    let station = station(&dir, SMALL);
    let sound = insonify(&["doctor", text(&station)]);
    succeeded(&sound);
    assert_eq!(String::from_utf8_lossy(&sound.stdout), "nothing is wrong: 1 surface, 12 triangles\n");

    let mut mesh = cuboid(Vec3::new(-60.0, -60.0, 10.0), Vec3::new(60.0, 60.0, 90.0));
    mesh.triangles.pop();
    let path = dir.path().join("open.glb");
    write_glb(&[LabelledSurface { name: "block".into(), tissue: "livr".into(), priority: 1, mesh }], &path).unwrap();
    let broken = insonify(&["doctor", text(&path)]);
    assert_eq!(broken.status.code(), Some(1), "{}", stderr(&broken));
    assert!(stderr(&broken).contains("open.glb has 2 errors"), "{}", stderr(&broken));
    let told = String::from_utf8_lossy(&broken.stdout).into_owned();
    for words in ["error    `block` (livr): not closed: 3 open edges", "did you mean `liver`", "2 errors, 0 warnings"] {
        assert!(told.contains(words), "{words} in {told}");
    }
    let json = insonify(&["doctor", text(&path), "--json"]);
    assert_eq!(json.status.code(), Some(1));
    let json: Value = serde_json::from_slice(&json.stdout).unwrap();
    let findings = json["findings"].as_array().unwrap();
    assert!(findings.iter().any(|f| f["defect"] == "open" && f["places"][0]["size_mm"].as_f64().unwrap() > 50.0));
    assert!(findings.iter().all(|f| f["severity"] == "error" && f["remedy"].is_string()), "{json}");

    refused(&insonify(&["doctor", text(&dir.path().join("none.glb"))]), &["cannot read the scene", "none.glb"]);
    std::fs::write(&path, "no glTF").unwrap();
    refused(&insonify(&["doctor", text(&path)]), &["is not a whole glTF file"]);
}

#[test]
fn the_doctor_tells_how_a_wall_aberrates() {
    let dir = directory();
    let path = dir.path().join("wedge.glb");
    // Half the aperture lies over fat: 20 mm of it delay a ray by 806 ns.
    let mesh = cuboid(Vec3::new(0.0, -60.0, 5.0), Vec3::new(90.0, 60.0, 25.0));
    write_glb(&[LabelledSurface { name: "half".into(), tissue: "fat".into(), priority: 1, mesh }], &path).unwrap();
    let without_pose = insonify(&["doctor", text(&path)]);
    assert_eq!(String::from_utf8_lossy(&without_pose.stdout), "nothing is wrong: 1 surface, 12 triangles\n");
    let at_pose = insonify(&["doctor", text(&path), "--pose", "0,0,0,1,0,0,0"]);
    succeeded(&at_pose);
    let told = String::from_utf8_lossy(&at_pose.stdout).into_owned();
    assert_eq!(told.lines().filter(|line| line.starts_with("aberration to ")).count(), 3, "{told}");
    let json = insonify(&["doctor", text(&path), "--pose", "0,0,0,1,0,0,0", "--json"]);
    let json: Value = serde_json::from_slice(&json.stdout).unwrap();
    let at_40_mm = &json["aberration"][1];
    assert_eq!(at_40_mm["depth_mm"], 40.0);
    // A step: a quarter of its height remains beside the best-fit line where it is in the middle of the aperture, and at
    // most 0.29 of it elsewhere.
    let most = at_40_mm["delay_rms_ns"][1].as_f64().unwrap();
    assert!((195.0..245.0).contains(&most), "{json}");
    assert!(at_40_mm["tilt_mrad"][1].as_f64().unwrap() > 50.0 && at_40_mm["wall"].is_string(), "{json}");
}

/// Writes an image with grey levels like those of speckle.
fn grey_image(path: &Path, width: u32, height: u32, seed: u32) {
    let level = |i: u32| ((i ^ seed.wrapping_mul(77)).wrapping_mul(2_654_435_761) >> 25) as u8 + (i % width) as u8 / 2;
    let pixels: Vec<u8> = (0..width * height).map(level).collect();
    insonify::sink::png::write_grey(path, width, height, &pixels, insonify::sink::png::Effort::Fast).unwrap();
}

#[test]
fn folders_of_images_are_evaluated_by_file_name() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    for folder in ["a", "b", "m"] {
        std::fs::create_dir(path(folder)).unwrap();
    }
    for (name, a, b) in [("one.png", 1, 2), ("two.png", 3, 3), ("x,y.png", 4, 5)] {
        grey_image(&path("a").join(name), 64, 48, a);
        grey_image(&path("b").join(name), 64, 48, b);
        grey_image(&path("m").join(name), 64, 48, 9);
    }
    let (a, b, m) = (path("a"), path("b"), path("m"));
    let (json, csv) = (path("scores.json"), path("scores.csv"));
    let files = ["--json", text(&json), "--csv", text(&csv)];
    let done = insonify(&[&["evaluate", text(&a), text(&b), "--mask", text(&m)], &files[..]].concat());
    succeeded(&done);
    let table = String::from_utf8(done.stdout).unwrap();
    for word in ["PSNR", "SSIM", "pKL x100", "seen error", "texture", "3 images; 1 identical"] {
        assert!(table.contains(word), "{table}");
    }
    assert!(!table.contains("FD"), "{table}");
    let report: Value = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
    assert_eq!((&report["summary"]["images"], &report["summary"]["identical"]), (&3.into(), &1.into()));
    assert_eq!((&report["scores"][1]["name"], &report["scores"][1]["psnr_db"]), (&"two.png".into(), &Value::Null));
    assert_eq!((&report["scores"][1]["pkl"], &report["scores"][1]["seen"]["whole"]), (&0.0.into(), &0.0.into()));
    let rows = std::fs::read_to_string(&csv).unwrap();
    assert!(rows.starts_with("image,psnr_db,ssim,pkl,seen,levels,texture\none.png,"), "{rows}");
    assert!(rows.contains("\ntwo.png,inf,") && rows.contains("\n\"x,y.png\","), "{rows}");

    // For a single pair, the mask is a single image.
    let one = |p: &Path| p.join("one.png");
    let pair = [one(&a), one(&b), one(&m)];
    succeeded(&insonify(&["evaluate", text(&pair[0]), text(&pair[1]), "--mask", text(&pair[2])]));

    grey_image(&b.join("only.png"), 64, 48, 1);
    std::fs::remove_file(m.join("two.png")).unwrap();
    let masked = ["evaluate", text(&a), text(&b), "--mask", text(&m)];
    refused(&insonify(&masked), &["only.png is only in", "two.png has no mask"]);
    std::fs::remove_file(b.join("only.png")).unwrap();
    grey_image(&one(&b), 64, 50, 1);
    refused(&insonify(&masked[..3]), &["one.png", "64 x 50", "64 x 48"]);
    refused(&insonify(&["evaluate", text(&a), text(&pair[1])]), &["no folder"]);
    grey_image(&one(&a), 20, 20, 1);
    grey_image(&one(&b), 20, 20, 2);
    let small = insonify(&["evaluate", text(&one(&a)), text(&one(&b)), "--csv", text(&csv)]);
    succeeded(&small);
    let table = String::from_utf8(small.stdout).unwrap();
    assert!(table.contains("1 without pKL") && table.contains("SSIM"), "{table}");
    let row = table.lines().find(|line| line.starts_with("pKL x100")).unwrap();
    assert_eq!(row.split_whitespace().collect::<Vec<_>>(), ["pKL", "x100", "-", "-"]);
    assert!(std::fs::read_to_string(&csv).unwrap().ends_with(",\n"), "pKL is not empty");
    let black = path("black.png");
    insonify::sink::png::write_grey(&black, 64, 48, &[0; 64 * 48], insonify::sink::png::Effort::Fast).unwrap();
    let two = a.join("two.png");
    refused(&insonify(&["evaluate", text(&two), text(&two), "--mask", text(&black)]), &["two.png", "mask"]);
}

#[test]
fn a_feature_extractor_gives_a_frechet_distance() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    grey_image(&path("a.png"), 64, 48, 1);
    grey_image(&path("b.png"), 64, 48, 2);
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/quality/block_means.onnx");
    let (a, b, json) = (path("a.png"), path("b.png"), path("scores.json"));
    let evaluate = |b: &Path| {
        let files = ["evaluate", text(&a), text(b), "--json", text(&json)];
        let done = insonify(&[&files[..], &["--features", text(&model), "--features-scale", "grey"]].concat());
        succeeded(&done);
        assert!(String::from_utf8(done.stdout).unwrap().contains("\nFD "));
        let report: Value = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
        report["frechet_distance"].as_f64().unwrap()
    };
    assert!(evaluate(&a) < 1e-6);
    assert!(evaluate(&b) > 1e-3);
}

#[test]
fn a_tradeoff_is_measured_and_can_be_resumed() {
    let dir = directory();
    let pose = "[pose]\nposition_mm = [0, 0, 0]\nquaternion = [1, 0, 0, 0]\n";
    let station = station(&dir, &format!("{SMALL}{pose}"));
    let out = dir.path().join("out");
    let tradeoff = |more: &[&str]| {
        let done = insonify(&[&["tradeoff", text(&station), "--out", text(&out), "--quick"], more].concat());
        succeeded(&done);
        stderr(&done)
    };
    let said = tradeoff(&[]);
    for word in ["1 pose, the station's own", "The reference, ", "[1/", "left"] {
        assert!(said.contains(word), "{said}");
    }
    let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    let report: Value = serde_json::from_str(&read("tradeoff.json")).unwrap();
    let points = report["points"].as_array().unwrap();
    assert!(points.len() > 10 && points.iter().any(|p| p["on_front"] == true));
    let named = |name: &str| points.iter().find(|p| p["name"] == name).unwrap();
    let error = |name: &str| named(name)["error"]["seen"]["whole"].as_f64().unwrap();
    assert!(error("32x3") < error("1x1"), "{} {}", error("32x3"), error("1x1"));
    assert_eq!(named("1x1 all effects")["knobs"]["all_effects"], true);
    assert!(named("1x1")["time"]["median_ms"].as_f64().unwrap() > 0.0);
    assert_eq!(named("32x3")["classes"][0]["tissue"], "gel");
    assert_eq!(read("tradeoff.csv").lines().count(), points.len() + 1);
    assert!(read("tradeoff.md").contains("1x1 (LQ)") && read("tradeoff.svg").starts_with("<svg"));
    assert_eq!(image::open(out.join("tradeoff.png")).unwrap().width(), 1200);
    for effect in report["effects"].as_array().unwrap() {
        let [with, without] = ["with", "without"].map(|key| effect[key].as_f64().unwrap());
        assert!(with < 0.5 * without && with < effect["tolerance"].as_f64().unwrap(), "{effect}");
    }
    assert_eq!(read("effects.csv").lines().count(), 7);
    let looks = report["looks"].as_array().unwrap();
    assert_eq!((looks.len(), read("looks.csv").lines().count()), (4, 5));
    for step in looks {
        let [with, without] = ["with", "without"].map(|key| step[key].as_f64().unwrap());
        assert!(with < 0.8 * without && with > 0.1 * without, "{step}");
    }

    // Existing points are not measured again and give the same figures; a missing one is measured.
    let mut kept = std::fs::read_dir(out.join("points")).unwrap().map(|entry| entry.unwrap().path());
    std::fs::remove_file(kept.find(|path| text(path).ends_with("_8x3.json")).unwrap()).unwrap();
    tradeoff(&["--resume"]);
    let again: Value = serde_json::from_str(&read("tradeoff.json")).unwrap();
    let median = |report: &Value, name: &str| {
        let point = report["points"].as_array().unwrap().iter().find(|p| p["name"] == name).cloned();
        point.unwrap()["time"]["median_ms"].as_f64().unwrap()
    };
    assert_eq!(median(&report, "1x1"), median(&again, "1x1"));
    assert_ne!(median(&report, "8x3"), median(&again, "8x3"));
    assert_eq!(report["reference"], again["reference"]);
}

#[test]
fn a_front_by_speed_is_measured_in_parts() {
    let dir = directory();
    let pose = "[pose]\nposition_mm = [0, 0, 0]\nquaternion = [1, 0, 0, 0]\n[pipeline]\nframe_rate_hz = 14\n";
    let station = station(&dir, &format!("{SMALL}{pose}"));
    let out = dir.path().join("out/front.toml");
    let front = |more: &[&str]| {
        let only = ["--poses", "3", "--points", "1x1", "--angles", "1,9"];
        let done = insonify(&[&["front", text(&station), "--out", text(&out)], &only[..], more].concat());
        succeeded(&done);
        stderr(&done)
    };
    let said = front(&["--minutes", "0"]);
    assert!(said.contains("stopped after 0 minutes") && !out.exists(), "{said}");
    front(&["--resume"]);
    let table = std::fs::read_to_string(&out).unwrap();
    let found: toml::Table = table.parse().unwrap();
    let [station] = &found["station"].as_array().unwrap()[..] else { panic!("{table}") };
    assert_eq!((station["poses"].as_integer(), station["frame_rate_hz"].as_float()), (Some(3), Some(14.0)));
    let error = |angles: i64, speed: &str| {
        let angles_of = |point: &toml::Value| point["quality"].get("angles").map_or(1, |n| n.as_integer().unwrap());
        let without = |point: &toml::Value| point["quality"].get("aperture").is_some();
        let points = station["point"].as_array().unwrap();
        let point = points.iter().find(|point| angles_of(point) == angles && !without(point)).unwrap();
        point["by_speed"][speed].as_float().unwrap()
    };
    // Rolling compounding is worth most at rest, and nothing in fast motion.
    let gain = |speed: &str| error(1, speed) - error(9, speed);
    assert!(gain("at_rest") > 2.0 && gain("fast") < 0.5 * gain("at_rest"), "{table}");
    // What is there is kept; another station's table keeps it.
    let said = front(&["--resume", "--merge", text(&out)]);
    assert!(!said.contains("reference 32x3"), "{said}");
    let again: toml::Table = std::fs::read_to_string(&out).unwrap().parse().unwrap();
    assert_eq!((&again["station"], &again["format"]), (&found["station"], &found["format"]));
    refused(&insonify(&["front", "configs/sphere.toml", "--points", "7x3"]), &["--points", "1x1, 1x3"]);
    refused(&insonify(&["front", "configs/sphere.toml", "--angles", "5"]), &["--angles 5", "1, 3 and 9"]);
}

#[test]
fn a_tradeoff_of_black_images_can_be_resumed() {
    let dir = directory();
    let pose = "gain_db = -200.0\ntgc_db_per_cm = 0.0\n[pose]\nposition_mm = [0, 0, 0]\nquaternion = [1, 0, 0, 0]\n";
    let station = station(&dir, &format!("{SMALL}{pose}"));
    let out = dir.path().join("out");
    for more in [&[][..], &["--resume"]] {
        let done = insonify(&[&["tradeoff", text(&station), "--out", text(&out), "--quick"], more].concat());
        succeeded(&done);
        assert!(String::from_utf8_lossy(&done.stdout).contains("The reference, "));
        let report: Value = serde_json::from_slice(&std::fs::read(out.join("tradeoff.json")).unwrap()).unwrap();
        let error = &report["points"][0]["error"];
        assert_eq!((&error["psnr_db"], &error["identical"], &error["rmse"]), (&Value::Null, &1.into(), &0.0.into()));
    }
}

#[test]
fn bench_times_each_kind_of_frame() {
    let dir = tempfile::tempdir().unwrap();
    let json = dir.path().join("bench.json");
    let output =
        insonify(&["bench", "configs/sphere.toml", "--frames", "2", "--backend", "host", "--json", text(&json)]);
    succeeded(&output);
    let printed = String::from_utf8(output.stdout).unwrap();
    for word in ["LQ, moving", "HQ", "256x4096", "many", "trace", "whole frame", "frames/s", "bench.json"] {
        assert!(printed.contains(word), "{word}: {printed}");
    }
    let report: Value = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
    let kinds = report["kinds"].as_array().unwrap();
    assert_eq!((kinds.len(), &report["frames"]), (7, &Value::from(2)));
    for kind in kinds {
        let stages = kind["stages"].as_array().unwrap();
        let whole = stages.iter().find(|stage| stage["stage"] == "whole frame").unwrap();
        assert!(whole["p50_ms"].as_f64().unwrap() > 0.0 && whole["count"] == 2, "{kind}");
        assert_eq!(stages.iter().any(|stage| stage["stage"] == "section"), kind["maps"] == true, "{kind}");
    }
    refused(&insonify(&["bench", "configs/sphere.toml", "--frames", "0"]), &["--frames", "1..=100000"]);
    refused(&insonify(&["bench", "configs/sphere.toml", "--replay", "no.mcap"]), &["no.mcap"]);
}

#[test]
fn a_selftest_passes_and_leaves_its_reports() {
    let dir = tempfile::tempdir().unwrap();
    let (json, html) = (dir.path().join("selftest.json"), dir.path().join("selftest.html"));
    let output = insonify(&["selftest", "--json", text(&json), "--html", text(&html)]);
    succeeded(&output);
    let table = String::from_utf8(output.stdout).unwrap();
    for group in
        ["Snell", "Fresnel", "Time of flight", "Attenuation", "Point spread", "Speckle", "Shadow", "Determinism"]
    {
        assert!(table.contains(group), "{group} is missing:\n{table}");
    }
    assert!(!table.contains("FAIL"), "{table}");
    let report: Value = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
    assert_eq!(report["passed"], true);
    assert!(report["checks"].as_array().unwrap().len() > 30);
    let page = std::fs::read_to_string(&html).unwrap();
    assert!(page.contains("insonify self-test") && page.contains(report["device"].as_str().unwrap()));
    refused(&insonify(&["selftest", "--html", "selftest.txt"]), &["--html", ".html"]);
}

#[test]
fn a_plan_lists_the_effects_of_a_scene() {
    let plan = |arguments: &[&str]| insonify(&[&["plan", "configs/speckle.toml"], arguments].concat());
    let decided = plan(&["--no-measure", "--json"]);
    succeeded(&decided);
    let json: Value = serde_json::from_slice(&decided.stdout).unwrap();
    assert_eq!(json["quality"], "HQ");
    let effect = |json: &Value, name: &str| {
        json["effects"].as_array().unwrap().iter().find(|e| e["effect"] == name).cloned().unwrap()
    };
    assert_eq!(effect(&json, "rays")["on"], false);
    assert_eq!(effect(&json, "scatterers")["on"], true);
    assert_eq!(effect(&json, "refraction")["bound"]["kind"], "exact");
    assert_eq!(json["measured"], Value::Null);

    let forced = plan(&["--no-measure", "--effect", "scatterers=off", "--effect", "rays=on"]);
    succeeded(&forced);
    assert!(stderr(&forced).contains("warning: scatterers is off though"), "{}", stderr(&forced));
    let table = String::from_utf8_lossy(&forced.stdout).into_owned();
    assert!(table.contains("OFF") && table.contains("liver"), "{table}");

    refused(&plan(&["--effect", "scaterers=off"]), &["did you mean `scatterers`?"]);
    refused(&plan(&["--effect", "maps=off"]), &["maps can be `auto` or `on`"]);
}

#[test]
fn a_plan_measures_the_cost_of_effects() {
    let dir = directory();
    let station = station(&dir, SMALL);
    let measured = insonify(&["plan", text(&station), "--pose", "0,0,0,1,0,0,0", "--json"]);
    succeeded(&measured);
    let json: Value = serde_json::from_slice(&measured.stdout).unwrap();
    let costs = json["measured"]["costs"].as_array().unwrap();
    assert!(costs.iter().any(|cost| cost["effect"] == "scatterers" && cost["cost_ms"].is_number()), "{costs:?}");
    assert!(json["measured"]["planned_ms"].as_f64().unwrap() > 0.0);
    assert!(json["measured"]["frames"].as_u64().unwrap() >= 9);
}

#[test]
fn an_option_of_another_mode_is_refused() {
    // clap skips `requires` if the required option conflicts with an argument that is given.
    for (command, option) in [
        (&["calibrate", "probe", "a.mcap", "--sensor", "2"][..], "--sensor"),
        (&["calibrate", "probe", "a.mcap", "--tool", "Probe"], "--tool"),
        (&["calibrate", "pivot", "a.mcap", "--sensor", "2"], "--sensor"),
        (&["calibrate", "spin", "--of", "needle", "a.mcap", "--tool", "Needle"], "--tool"),
        (&["calibrate", "landmarks", "a.csv", "--sensor", "2"], "--sensor"),
        (&["calibrate", "landmarks", "a.csv", "--points", "b.csv"], "--points"),
        (&["calibrate", "landmarks", "a.csv", "--samples", "9"], "--samples"),
        (&["calibrate", "landmarks", "a.csv", "--tolerance", "2"], "--tolerance"),
        (&["dataset", "a.toml", "--tuples", "9", "--out", "out"], "--tuples"),
        (&["evaluate", "a.png", "b.png", "--frames", "9"], "--frames"),
        (&["evaluate", "a.png", "b.png", "--step", "9"], "--step"),
        (&["evaluate", "a.png", "b.png", "--again", "9"], "--again"),
    ] {
        refused(&insonify(command), &["cannot be used with", option]);
    }
}
