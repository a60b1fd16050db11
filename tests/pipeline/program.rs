//! Tests of the program itself on the real renderer.

use super::*;

pub(super) fn insonify(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_insonify"));
    command.args(arguments).env_remove("RUST_LOG").current_dir(env!("CARGO_MANIFEST_DIR"));
    command
}

/// Writes the sphere's station with a small image, which is fast on the software device, and the tables `rest`.
pub(super) fn small_station(directory: &Path, rest: &str) -> String {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes/sphere.glb");
    let path = directory.join("station.toml");
    let text = format!(
        "[scene]\npath = \"{}\"\nbackground = \"liver\"\n[probe]\nscanlines = 32\nsamples = 256\n[image]\nwidth = 160\nheight = 120\n[pose]\n{rest}",
        scene.display()
    );
    std::fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

fn json_lines(path: &Path) -> Vec<Value> {
    std::fs::read_to_string(path).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn the_program_runs_a_station_on_the_real_renderer() {
    let _guard = beside_others();
    let dir = tempfile::tempdir().unwrap();
    let station = small_station(dir.path(), "[pipeline]\nframe_rate_hz = 20.0\n");
    let (out, metrics) = (dir.path().join("out"), dir.path().join("frames.jsonl"));
    let arguments = ["run", &station, "--frames", "6", "--sink", "png", "--sink", "video", "--json"];
    let paths = ["--out", out.to_str().unwrap(), "--metrics", metrics.to_str().unwrap()];
    let output = insonify(&[&arguments[..], &paths].concat()).env("PATH", "").output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let summary: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(summary["presented"], 6);
    assert_eq!(summary["by_tracking"], serde_json::json!([6, 0, 0, 0, 0]));
    let drops: u64 = summary["drops"].as_object().unwrap().values().map(|n| n.as_u64().unwrap()).sum();
    assert_eq!(summary["produced"], 6 + drops);

    // The same pose as `insonify render`: the same picture.
    let still = dir.path().join("still");
    let rendered = insonify(&["render", &station, "--out", still.to_str().unwrap()]).output().unwrap();
    assert!(rendered.status.success());
    let expected = image::open(still.join("bmode.png")).unwrap().into_bytes();
    let index = json_lines(&out.join("png/index.jsonl"));
    assert!(!index.is_empty());
    for line in &index {
        let file = out.join("png").join(line["file"].as_str().unwrap());
        assert_eq!(image::open(file).unwrap().into_bytes(), expected);
    }
    assert!(std::fs::read(out.join("video.mp4")).unwrap()[4..].starts_with(b"ftyp"));
    let lines = json_lines(&metrics);
    let (last, frames) = lines.split_last().unwrap();
    assert_eq!(last["summary"]["presented"], 6);
    for line in frames {
        let at = |key: &str| line[key].as_f64().unwrap();
        assert!(at("sampled_ms") <= at("submitted_ms") && at("submitted_ms") < at("rendered_ms"));
        assert!(at("rendered_ms") <= at("presented_ms"));
    }
}

#[test]
fn stations_and_flags_that_cannot_run_are_refused() {
    let _guard = beside_others();
    let dir = tempfile::tempdir().unwrap();
    let station = small_station(dir.path(), "");
    let text = std::fs::read_to_string(&station).unwrap();
    let no_pose = dir.path().join("no_pose.toml");
    std::fs::write(&no_pose, text.replace("[pose]\n", "")).unwrap();
    let misspelt = dir.path().join("misspelt.toml");
    std::fs::write(&misspelt, format!("{text}[display]\nsinks = [\"vidoe\"]\n")).unwrap();
    let cases: [(&[&str], &str); 6] = [
        (&["run", no_pose.to_str().unwrap()], "no pose"),
        (&["run", misspelt.to_str().unwrap()], "did you mean `video`"),
        (&["run", &station, "--sink", "vidio"], "did you mean `video`"),
        (&["run", &station, "--duration", "0"], "expected seconds"),
        (&["run", &station, "--frames", "0"], "--frames"),
        (&["run", &station, "--replay", "nowhere.mcap"], "nowhere.mcap"),
    ];
    for (arguments, word) in cases {
        let output = insonify(arguments).output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
        assert!(message.contains(word) && !message.contains("panicked"), "{arguments:?}: {message}");
    }
}

/// Runs a session with --json, calls `meanwhile` after the first frame, and ends the session by SIGINT. Returns the
/// printed summary, and the messages after the first frame.
#[cfg(unix)]
fn interrupted(command: &mut std::process::Command, meanwhile: impl FnOnce()) -> (Value, Vec<String>) {
    use std::io::{BufRead, BufReader};

    command.env("RUST_LOG", "insonify=info").stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    // "tracking" is logged at the first frame.
    let mut said = BufReader::new(child.stderr.take().unwrap()).lines();
    assert!(said.by_ref().any(|line| line.unwrap().contains("tracking")));
    meanwhile();
    let id = nix::unistd::Pid::from_raw(i32::try_from(child.id()).unwrap());
    nix::sys::signal::kill(id, nix::sys::signal::Signal::SIGINT).unwrap();
    let rest: Vec<String> = said.map(Result::unwrap).collect();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{rest:?}");
    (serde_json::from_slice(&output.stdout).unwrap(), rest)
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_the_program_in_order_and_a_truncated_file_is_never_left() {
    let _guard = beside_others();
    let dir = tempfile::tempdir().unwrap();
    let station = small_station(dir.path(), "");
    let (out, metrics) = (dir.path().join("out"), dir.path().join("frames.jsonl"));
    let arguments = ["run", &station, "--sink", "video", "--out", out.to_str().unwrap()];
    let mut command = insonify(&[&arguments[..], &["--metrics", metrics.to_str().unwrap(), "--json"]].concat());
    let (summary, rest) = interrupted(command.env("PATH", ""), || {});
    assert!(rest.iter().any(|line| line.contains("Ctrl-C")), "{rest:?}");
    assert_eq!(summary["stuck"], serde_json::json!([]));
    let names: Vec<_> = std::fs::read_dir(&out).into_iter().flatten().map(|f| f.unwrap().file_name()).collect();
    assert!(names.iter().all(|name| name == "video.mp4"), "{names:?}");
    assert!(json_lines(&metrics).last().unwrap()["summary"].is_object());
}

#[cfg(unix)]
#[test]
fn a_log_that_is_renamed_meanwhile_is_whole() {
    let _guard = beside_others();
    let dir = tempfile::tempdir().unwrap();
    let station = small_station(dir.path(), "");
    let (metrics, moved) = (dir.path().join("frames.jsonl"), dir.path().join("moved.jsonl"));
    let arguments = ["run", &station, "--sink", "null", "--metrics", metrics.to_str().unwrap(), "--json"];
    let (printed, rest) = interrupted(&mut insonify(&arguments), || std::fs::rename(&metrics, &moved).unwrap());
    assert!(rest.iter().any(|line| line.contains("was renamed or deleted")), "{rest:?}");
    let last = json_lines(&moved).pop().unwrap();
    assert_eq!(last["summary"], printed, "with its version and station");
    assert_eq!(printed["station"], station.as_str());
    assert!(!metrics.exists());
}

#[cfg(target_os = "linux")]
#[test]
fn a_log_that_cannot_be_written_costs_no_summary() {
    let _guard = beside_others();
    let dir = tempfile::tempdir().unwrap();
    let station = small_station(dir.path(), "");
    let arguments = ["run", &station, "--frames", "3", "--sink", "null", "--metrics", "/dev/full"];
    for json in [false, true] {
        let mut command = insonify(&arguments);
        if json {
            command.arg("--json");
        }
        let output = command.output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains("error: ") && said.contains("cannot write /dev/full"), "{said}");
        let printed = String::from_utf8_lossy(&output.stdout);
        assert!(printed.contains(if json { "\"presented\"" } else { "pose to present" }), "{printed}");
    }
}

/// Tests the complete chain of the program: a recorded tracker's bytes, estimator, generator, sink and recording.
#[test]
fn the_program_tracks_generates_and_records() {
    use insonify::recording::{RecordingInfo, RecordingWriter, poses};
    use insonify::tracker::Protocol;
    let _guard = beside_others();
    let dir = tempfile::tempdir().unwrap();
    // A protocol that the station doesn't name: only the recording knows it.
    let info = RecordingInfo {
        protocol: Protocol::OpenTrack,
        device: "test".into(),
        scene: "sphere".into(),
        start_time_ns: 1_790_000_000_000_000_000,
        sensor: None,
        needle: None,
    };
    let taken = dir.path().join("taken.mcap");
    let mut writer = RecordingWriter::create(&taken, &info).unwrap();
    for i in 0..120_u64 {
        let datagram: Vec<u8> =
            [0.01 * i as f64, 0.0, 5.0, 0.0, 0.0, 0.0].iter().flat_map(|v| v.to_le_bytes()).collect();
        writer.raw(info.start_time_ns + i * 25_000_000, &datagram).unwrap();
    }
    writer.finish().unwrap();
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/generators/blur.onnx");
    let tables = format!(
        "[tracker]\ntransport = 'recording'\nrecording = '{}'\n[generator]\nmodels = ['{}']\nrun_budget_ms = 4000\n",
        taken.display(),
        model.display()
    );
    let station = small_station(dir.path(), &tables);
    let (kept, metrics) = (dir.path().join("kept.mcap"), dir.path().join("frames.jsonl"));
    let paths = [&kept, &metrics].map(|path| path.to_str().unwrap().to_owned());
    let done = insonify(&["run", &station, "--record", &paths[0], "--metrics", &paths[1], "--json"]).output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let summary: Value = serde_json::from_slice(&done.stdout).unwrap();
    assert!(summary["generated_ratio"].as_f64().unwrap() > 0.0, "{summary}");
    let sums: Vec<_> = [&taken, &kept].into_iter().map(|path| poses(path).unwrap()).collect();
    assert_eq!(sums[1].1.info.protocol, Protocol::OpenTrack);
    assert_eq!(
        sums[0].0.iter().map(|p| p.pose).collect::<Vec<_>>(),
        sums[1].0.iter().map(|p| p.pose).collect::<Vec<_>>()
    );
}

/// The operating point is measured at the first start, kept for the next unless disturbed or damaged, and shown on
/// every line.
#[test]
fn the_program_chooses_its_point_and_keeps_its_times() {
    let _guard = beside_others();
    let dir = tempfile::tempdir().unwrap();
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/generators/blur.onnx");
    let tables = format!(
        "[quality]\nframe_budget_ms = 500\n[generator]\nmodels = ['{}']\n[pipeline]\nframe_rate_hz = 2\n",
        model.display()
    );
    let station = small_station(dir.path(), &tables);
    let cache = dir.path().join("cache");
    let run = |metrics: &str| {
        let metrics = dir.path().join(metrics);
        let arguments = [
            "run",
            &station,
            "--pose=0,0,0,1,0,0,0",
            "--frames",
            "3",
            "--json",
            "--metrics",
            metrics.to_str().unwrap(),
        ];
        let done = insonify(&arguments).env("INSONIFY_CACHE", &cache).output().unwrap();
        let said = String::from_utf8_lossy(&done.stderr).into_owned();
        assert!(done.status.success(), "{said}");
        (said, serde_json::from_slice::<Value>(&done.stdout).unwrap(), json_lines(&metrics))
    };
    let (said, summary, lines) = run("first.jsonl");
    assert!(said.contains("ms of 450 (measured now)"), "{said}");
    let begun = summary["points"]["begun"].as_str().unwrap();
    assert!(said.contains(&format!("quality: {begun}, ")), "{said}");
    assert_eq!(lines[0]["point"], begun);
    let files: Vec<_> = std::fs::read_dir(&cache).unwrap().map(|file| file.unwrap().path()).collect();
    assert_eq!(files.len(), 1);
    // What a busy machine had no time to measure is measured at the next start.
    let whole = (0..20).any(|nth| run(&format!("whole{nth}.jsonl")).0.contains("(as measured before)"));
    assert!(whole, "some times are never measured");
    let times: Value = serde_json::from_slice(&std::fs::read(&files[0]).unwrap()).unwrap();
    // Other tests run meanwhile: kept times of any spread and size stand for an idle machine and a busy one.
    let kept_with = |ms: f64, spread: f64| {
        let mut times = times.clone();
        times["spread"] = spread.into();
        for point in times["render_ms"].as_array_mut().unwrap() {
            point[1] = ms.into();
        }
        times.to_string()
    };
    for (kept, measured, metrics) in [
        (kept_with(1e-3, 1.0), "(as measured before)", "again.jsonl"),
        (kept_with(1e-3, 1.5), "(measured now)", "varied.jsonl"),
        (kept_with(1e6, 1.0), "(measured now)", "slow.jsonl"),
        ("{".into(), "(measured now)", "damaged.jsonl"),
    ] {
        std::fs::write(&files[0], &kept).unwrap();
        let (said, _, _) = run(metrics);
        assert!(said.contains(measured), "{kept}: {said}");
    }
}
