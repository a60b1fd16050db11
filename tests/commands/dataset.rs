//! Tests of data sets as a shell sees them: creation, resumption, refusals.
// clippy counts helpers as outside of tests; a failing helper fails its test.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use glam::Vec3;
use insonify::anatomy::analytic::cuboid;
use insonify::anatomy::export::{LabelledSurface, write_glb};
use insonify::dataset::{Dataset, DatasetError, Maker, Recipe, Row, Shard, Split, Step};
use insonify::files::hex;
use insonify::render::{Backend, BackendChoice};
use insonify::station::Station;
use sha2::{Digest, Sha256};
use tempfile::TempDir;

const STATION: &str = "[scene]\npath = \"scene.glb\"\n[probe]\nscanlines = 32\nsamples = 256\n\
                       [image]\nwidth = 80\nheight = 60\n[pose]\nposition_mm = [0, 0, 0]\nquaternion = [1, 0, 0, 0]\n";

fn insonify(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_insonify"));
    command.args(arguments).env_remove("RUST_LOG").current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// A station over a box of liver, and the directory of its data set.
fn station_and_output() -> (TempDir, PathBuf, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let mesh = cuboid(Vec3::new(-60.0, -60.0, 10.0), Vec3::new(60.0, 60.0, 90.0));
    let surface = LabelledSurface { name: "block".into(), tissue: "liver".into(), priority: 1, mesh };
    write_glb(&[surface], &dir.path().join("scene.glb")).unwrap();
    let station = dir.path().join("station.toml");
    std::fs::write(&station, STATION).unwrap();
    let out = dir.path().join("data");
    (dir, station, out)
}

fn make(station: &Path, out: &Path, more: &[&str]) -> Output {
    let usual =
        ["dataset", text(station), "--frames", "6", "--frames-per-exam", "2", "--hq", "4x1", "--out", text(out)];
    insonify(&[&usual, more].concat())
}

#[track_caller]
fn made(output: &Output) {
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
}

#[track_caller]
fn failed(output: &Output, code: i32, words: &[&str]) {
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{message}");
    words.iter().for_each(|word| assert!(message.contains(word), "`{word}` is missing: {message}"));
}

fn sums(out: &Path) -> BTreeMap<usize, String> {
    Dataset::open(out).unwrap().rows.into_iter().map(|row| (row.index, row.sha256)).collect()
}

#[test]
fn a_data_set_matches_its_rows_and_renders_again() {
    let (dir, station, out) = station_and_output();
    let output = make(&station, &out, &["--json"]);
    made(&output);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((report["made"].as_u64(), report["test"].as_u64()), (Some(6), Some(2)));

    let data = Dataset::open(&out).unwrap();
    assert_eq!((data.rows.len(), data.of(Split::Test).count()), (6, 2));
    let class = |name: &str| data.header.classes.iter().position(|c| c == name).unwrap() as u8;
    let (outside, liver, gel) = (class("outside"), class("liver"), class("gel"));
    let mut differ = 0;
    for row in &data.rows {
        let tuple = data.tuple(row).unwrap();
        assert_eq!(tuple.size, [80, 60]);
        assert!(tuple.segmentation.iter().all(|class| [outside, liver, gel].contains(class)));
        assert!(tuple.segmentation.contains(&liver), "{:?}", row.pose);
        for (at, &inside) in tuple.mask.iter().enumerate() {
            assert_eq!(inside == 0, tuple.segmentation[at] == outside);
            assert!(inside > 0 || (tuple.lq[at], tuple.hq[at], tuple.attenuation[at]) == (0, 0, 0));
        }
        differ += usize::from(tuple.lq != tuple.hq);
    }
    assert_eq!(differ, 6, "four rays differ from one");
    // The attenuation equals that of a frame rendered at the row's pose, within half a step of its fourth root.
    let row = &data.rows[0];
    let tuple = data.tuple(row).unwrap();
    let numbers: Vec<String> =
        row.pose.position_mm.iter().chain(&row.pose.quaternion).map(ToString::to_string).collect();
    let frame = dir.path().join("frame");
    let pose = format!("--pose={}", numbers.join(","));
    made(&insonify(&["render", text(&station), &pose, "--out", text(&frame)]));
    let npy = std::fs::read(frame.join("attenuation.npy")).unwrap();
    let rendered: Vec<f32> = npyz::NpyFile::new(&npy[..]).unwrap().into_vec().unwrap();
    for ((&byte, back), a) in tuple.attenuation.iter().zip(tuple.attenuation_map()).zip(rendered) {
        assert!((a.powf(0.25) - f32::from(byte) / 255.0).abs() <= 0.5 / 255.0 + 1e-5, "{a} became {byte}");
        assert!((back.powf(0.25) - f32::from(byte) / 255.0).abs() < 1e-5);
    }

    made(&insonify(&["dataset", "--verify", text(&out), "--tuples", "0"]));
    // Damage is detected.
    let manifest = out.join("manifest.jsonl");
    let rows = std::fs::read_to_string(&manifest).unwrap();
    let seed = format!("\"seed\":{}", data.rows[3].seed);
    assert_eq!(rows.matches(&seed).count(), 1);
    std::fs::write(&manifest, rows.replace(&seed, "\"seed\":1")).unwrap();
    failed(&insonify(&["dataset", "--verify", text(&out), "--tuples", "0"]), 1, &["1 of 6", "[3]"]);
}

#[test]
fn the_number_of_lanes_changes_no_byte() {
    let (dir, station, _) = station_and_output();
    // Two stations, so that the scene changes between sessions.
    let other = dir.path().join("other.toml");
    std::fs::write(&other, STATION.replace("samples = 256", "samples = 320")).unwrap();
    let files = |threads: &str, more: &[&str]| {
        let out = dir.path().join(format!("{threads}{}", more.concat()));
        let usual =
            ["dataset", text(&station), text(&other), "--frames", "10", "--frames-per-exam", "2", "--hq", "4x1"];
        let all = [&usual[..], more, &["--backend", "host", "--out", text(&out)]].concat();
        let mut command = Command::new(env!("CARGO_BIN_EXE_insonify"));
        made(&command.args(all).env("RAYON_NUM_THREADS", threads).output().unwrap());
        let folders = [out.join("tuples"), out.join("masks"), out];
        let paths =
            folders.iter().flat_map(|folder| std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()));
        let files = paths.filter(|path| path.is_file());
        let named = files.map(|path| (path.file_name().unwrap().to_owned(), std::fs::read(&path).unwrap()));
        named.collect::<BTreeMap<_, _>>()
    };
    for more in [&["--lq", "1x1,2x1"][..], &["--angles", "3", "--lq-angles", "3"]] {
        let one = files("1", more);
        assert_eq!(one.len(), 10 + 1 + 2, "{:?}", one.keys());
        for threads in ["2", "5"] {
            assert!(files(threads, more) == one, "{threads} threads, {more:?}");
        }
    }
}

#[test]
fn a_program_makes_the_tuples_of_the_command() {
    let (dir, station, out) = station_and_output();
    made(&make(&station, &out, &["--backend", "host"]));
    let recipe =
        Recipe { frames: 6, frames_per_exam: 2, hq: [4, 1], ..Recipe::new(vec![Station::load(&station).unwrap()]) };
    let own = dir.path().join("own");
    let backend = Backend::open(BackendChoice::Host).unwrap();
    let maker = Maker::new(recipe.clone()).unwrap();
    let last = std::sync::Mutex::new(None);
    let report = maker.make(&own, &backend, &|step| *last.lock().unwrap() = Some(step)).unwrap();
    assert_eq!((report.made, report.kept, report.train, report.test), (6, 0, 4, 2));
    assert_eq!(*last.lock().unwrap(), Some(Step::Tuples { done: 6, total: 6 }));
    assert_eq!(maker.planned().train, 4);
    assert_eq!(Dataset::open(&own).unwrap(), Dataset { directory: own.clone(), ..Dataset::open(&out).unwrap() });
    let verified = Dataset::open(&own).unwrap().verify(&backend, 2, &|_| ()).unwrap();
    assert_eq!((verified.tuples, verified.differ), (2, vec![]));

    let recipe = || recipe.clone();
    for (wrong, word) in [
        (Recipe { lq: vec![], ..recipe() }, "low quality"),
        (Recipe { lq: vec![[0, 1]], ..recipe() }, "1..=256"),
        (Recipe { hq_angles: 0, ..recipe() }, "angles"),
        (Recipe { span_deg: Some(f64::NAN), ..recipe() }, "span_deg"),
        (Recipe { shard: Shard { number: 0, of: 3 }, ..recipe() }, "1..=3"),
        (Recipe { stations: vec![], ..recipe() }, "station"),
    ] {
        let error = Maker::new(wrong).unwrap_err().to_string();
        assert!(error.contains(word), "{error}");
    }
}

#[test]
fn a_compounded_target_is_rendered_once_for_several_low_qualities() {
    let (dir, station, out) = station_and_output();
    made(&make(&station, &out, &["--angles", "4", "--span", "40"]));
    let data = Dataset::open(&out).unwrap();
    let look = data.header.look;
    assert_eq!((look.lq_angles, look.hq_angles, look.span_deg), (1, 3, 40.0), "even numbers are rounded down");
    let single = dir.path().join("single");
    made(&make(&station, &single, &["--span", "40"]));
    let single = Dataset::open(&single).unwrap();
    // Squared differences of neighbours in one tissue: mostly speckle.
    let roughness = |image: &[u8], tissue: &[u8]| -> f64 {
        let pairs =
            image.windows(2).zip(tissue.windows(2)).filter(|(_, tissue)| tissue[0] > 0 && tissue[0] == tissue[1]);
        pairs.map(|(levels, _)| (f64::from(levels[0]) - f64::from(levels[1])).powi(2)).sum()
    };
    assert!(!data.rows.is_empty() && data.rows.len() == single.rows.len());
    for (row, of_one) in data.rows.iter().zip(&single.rows) {
        let [compounded, one] = [data.tuple(row).unwrap(), single.tuple(of_one).unwrap()];
        assert_eq!(compounded.lq, one.lq);
        let [calm, rough] = [&compounded, &one].map(|tuple| roughness(&tuple.hq, &tuple.segmentation));
        assert!(calm < 0.8 * rough, "{calm} {rough}");
    }
    made(&insonify(&["dataset", "--verify", text(&out), "--tuples", "2"]));

    let more = dir.path().join("more");
    let from = ["--angles", "3", "--span", "40", "--hq-from", text(&out)];
    made(&make(&station, &more, &[&from[..], &["--lq", "2x1", "--lq-angles", "3"]].concat()));
    let others = Dataset::open(&more).unwrap();
    assert_eq!(data.rows.len(), others.rows.len());
    for (row, other) in data.rows.iter().zip(&others.rows) {
        let [row, other] = [data.tuple(row).unwrap(), others.tuple(other).unwrap()];
        assert_eq!((row.hq, row.segmentation), (other.hq, other.segmentation));
        assert_ne!(row.lq, other.lq);
    }
    made(&insonify(&["dataset", "--verify", text(&more), "--tuples", "2"]));
    let wrong = dir.path().join("wrong");
    for (options, word) in [
        (["--angles", "5"], "look.hq_angles is 3 there, 5 is wanted here: --angles"),
        (["--seed", "3"], "seed"),
        (["--span", "30"], "look.span_deg is 40 there, 30 is wanted here: --span"),
    ] {
        let usual: Vec<&str> = ["--angles", "3", "--span", "40", "--hq-from", text(&out)].into();
        let kept = usual.chunks(2).filter(|pair| pair[0] != options[0]).flatten().copied();
        failed(&make(&station, &wrong, &kept.chain(options).collect::<Vec<_>>()), 2, &["--hq-from", word]);
    }
}

#[test]
fn a_killed_run_is_resumed_and_shards_make_the_same_tuples() {
    let (dir, station, out) = station_and_output();
    made(&make(&station, &out, &[]));
    let whole = sums(&out);

    // As a kill leaves it: two rows, half of the third.
    let manifest = out.join("manifest.jsonl");
    let rows = std::fs::read(&manifest).unwrap();
    let ends: Vec<usize> = rows.iter().enumerate().filter(|(_, b)| **b == b'\n').map(|(at, _)| at + 1).collect();
    std::fs::write(&manifest, &rows[..ends[1] + 40]).unwrap();
    assert_eq!(sums(&out).len(), 2);
    std::fs::remove_file(out.join("tuples/0000004.npy")).unwrap();
    let again = make(&station, &out, &["--json"]);
    made(&again);
    let report: serde_json::Value = serde_json::from_slice(&again.stdout).unwrap();
    assert_eq!((report["made"].as_u64(), report["kept"].as_u64()), (Some(4), Some(2)));
    assert_eq!(sums(&out), whole);

    let shards = dir.path().join("shards");
    for shard in ["2/2", "1/2"] {
        made(&make(&station, &shards, &["--shard", shard]));
    }
    assert_eq!(sums(&shards), whole);
}

#[test]
fn tuples_of_other_shards_are_not_made_again() {
    let (_dir, station, out) = station_and_output();
    made(&make(&station, &out, &["--shard", "1/3"]));
    let output = make(&station, &out, &["--json"]);
    made(&output);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((report["made"].as_u64(), report["kept"].as_u64()), (Some(4), Some(2)));
    assert_eq!(sums(&out).keys().copied().collect::<Vec<_>>(), (0..6).collect::<Vec<_>>());
    let output = make(&station, &out, &["--shard", "2/2", "--json"]);
    made(&output);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["made"].as_u64(), Some(0));
}

#[test]
fn a_run_does_not_resume_with_other_frames_or_beside_another_run() {
    let (_dir, station, out) = station_and_output();
    made(&make(&station, &out, &[]));
    let manifest = out.join("manifest.jsonl");
    let held = std::fs::File::open(&manifest).unwrap();
    held.lock().unwrap();
    for shard in ["1/1", "2/3"] {
        failed(&make(&station, &out, &["--shard", shard]), 2, &["manifest.jsonl", "another run"]);
    }
    drop(held);
    made(&make(&station, &out, &[]));

    // As another build, device or driver would leave it: the last row kept is that of another frame.
    let data = Dataset::open(&out).unwrap();
    let rows = std::fs::read_to_string(&manifest).unwrap();
    let first_five: String = rows.split_inclusive('\n').take(5).collect();
    std::fs::write(&manifest, first_five.replace(&data.rows[4].sha256, &"0".repeat(64))).unwrap();
    failed(&make(&station, &out, &[]), 2, &["tuple 4", "another version, driver or device"]);
    assert_eq!(Dataset::open(&out).unwrap().rows.len(), 5, "nothing was added");
    // Another shard checks it, too.
    failed(&make(&station, &out, &["--shard", "3/3"]), 2, &["tuple 4"]);
    std::fs::write(&manifest, first_five.repeat(2)).unwrap();
    failed(&make(&station, &out, &[]), 2, &["tuple 0", "twice"]);
}

#[test]
fn wrong_options_and_foreign_directories_are_refused() {
    let (_dir, station, out) = station_and_output();
    for (more, word) in [
        (&["--shard", "3/2"][..], "i from 1 to n"),
        (&["--test-share", "1.5"], "share of 1.5"),
        (&["--frames-per-exam", "6"], "too few"),
        (&["--frames", "1"], "2..="),
        (&["--hq", "x"], "rays x layers"),
        (&["--angles", "16"], "1..=15"),
        (&["--span", "61"], "1..=60"),
        (&["--frames-per-exam", "2", "--hq-from", "nowhere"], "nowhere"),
    ] {
        let usual = ["dataset", text(&station), "--out", text(&out)];
        let frames = if more.contains(&"--frames") { &[][..] } else { &["--frames", "6"] };
        failed(&insonify(&[&usual, frames, more].concat()), 2, &[word]);
    }
    assert!(!out.exists(), "nothing is left of what was refused");
    failed(&insonify(&["dataset", "--out", text(&out)]), 2, &["STATIONS"]);
    failed(&insonify(&["dataset", "--verify", text(&out)]), 2, &["dataset.json"]);

    made(&make(&station, &out, &["--dry-run"]));
    assert!(!out.exists(), "a dry run writes nothing");
    made(&make(&station, &out, &[]));
    failed(&make(&station, &out, &["--seed", "2"]), 2, &["another data set", "seed is 1, not 2"]);
    std::fs::write(&station, STATION.replace("[pose]", "gain_db = 3\n[pose]")).unwrap();
    failed(&make(&station, &out, &[]), 2, &["another data set", "stations"]);
}

#[test]
fn damaged_files_are_named() {
    let (_dir, station, out) = station_and_output();
    made(&make(&station, &out, &[]));
    let data = Dataset::open(&out).unwrap();
    let file = out.join(&data.rows[0].file);
    let bytes = std::fs::read(&file).unwrap();
    std::fs::write(&file, &bytes[..bytes.len() - 1]).unwrap();
    assert!(matches!(data.tuple(&data.rows[0]), Err(DatasetError::Array { path, .. }) if path == file));
    std::fs::write(&file, vec![0; 40]).unwrap();
    assert!(matches!(data.tuple(&data.rows[0]), Err(DatasetError::File(error)) if error.path == file));
    std::fs::copy(out.join(&data.rows[0].mask), &file).unwrap();
    assert!(matches!(data.tuple(&data.rows[0]), Err(DatasetError::Array { path, .. }) if path == file));
    // A class that the header doesn't name.
    let mut wrong = bytes;
    let at = wrong.len() - 80 * 60 - 1;
    wrong[at] = 255;
    std::fs::write(&file, wrong).unwrap();
    let error = data.tuple(&Row { sha256: String::new(), ..data.rows[0].clone() }).unwrap_err().to_string();
    assert!(error.contains("class 255"), "{error}");
    assert!(matches!(data.tuple(&data.rows[0]), Err(DatasetError::Damaged { path }) if path == file));

    let manifest = out.join("manifest.jsonl");
    let rows = std::fs::read_to_string(&manifest).unwrap();
    std::fs::write(&manifest, rows.replacen("\"index\":1,", "\"index\":0,", 1)).unwrap();
    assert!(Dataset::open(&out).unwrap_err().to_string().contains("twice"));
    std::fs::write(&manifest, rows.replacen("\"index\":1,", "", 1)).unwrap();
    let error = Dataset::open(&out).unwrap_err().to_string();
    assert!(error.contains("line 2") && error.contains("index"), "{error}");
}

#[test]
fn stored_files_are_compared_and_lost_ones_are_made_again() {
    let (_dir, station, out) = station_and_output();
    made(&make(&station, &out, &[]));
    let data = Dataset::open(&out).unwrap();
    let [file, mask] = [&data.rows[1].file, &data.rows[1].mask].map(|name| out.join(name));
    let [tuple, sector] = [&file, &mask].map(|path| std::fs::read(path).unwrap());
    let manifest = std::fs::read_to_string(out.join("manifest.jsonl")).unwrap();
    let verify = || insonify(&["dataset", "--verify", text(&out), "--tuples", "0", "--json"]);
    let counts = |output: &Output| {
        let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        (report["made"].as_u64(), report["kept"].as_u64())
    };

    // Another byte is seen by who reads the file, not by its length.
    let mut changed = tuple.clone();
    changed[200] ^= 1;
    std::fs::write(&file, changed).unwrap();
    let output = verify();
    failed(&output, 1, &["files of 1 of 6 tuples", "0000001.npy is damaged"]);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&report["differ"], &report["damaged"]), (&serde_json::json!([]), &serde_json::json!([1])));
    let judge = ["evaluate", "--dataset", text(&out), "--split", "all", "--crops", "0"];
    failed(&insonify(&judge), 2, &["0000001.npy is damaged", "Remove it"]);

    // Lost and cut files are made again, without further rows.
    std::fs::remove_file(&file).unwrap();
    failed(&verify(), 1, &["cannot read", "0000001.npy"]);
    let cut = out.join(&data.rows[4].file);
    std::fs::write(&cut, &std::fs::read(&cut).unwrap()[..900]).unwrap();
    let again = make(&station, &out, &["--json"]);
    made(&again);
    assert_eq!(counts(&again), (Some(2), Some(4)));
    assert!(String::from_utf8_lossy(&again.stderr).contains("making 2 tuples again"));
    assert!(std::fs::read(&file).unwrap() == tuple);
    made(&verify());

    // All tuples share the mask: one of them brings it back.
    std::fs::remove_dir_all(out.join("masks")).unwrap();
    failed(&verify(), 1, &["files of 6 of 6 tuples", "masks"]);
    let again = make(&station, &out, &["--json"]);
    made(&again);
    assert_eq!(counts(&again), (Some(1), Some(5)));
    assert!(std::fs::read(&mask).unwrap() == sector);
    made(&verify());
    assert_eq!(std::fs::read_to_string(out.join("manifest.jsonl")).unwrap(), manifest);
}

#[test]
fn random_noise_in_the_target_is_measured() {
    let (dir, station, out) = station_and_output();
    made(&make(&station, &out, &[]));
    let file = dir.path().join("report.json");
    let judge = || {
        let output =
            insonify(&["evaluate", "--dataset", text(&out), "--crops", "0", "--again", "6", "--json", text(&file)]);
        made(&output);
        let report: serde_json::Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
        let rows = report["dataset"]["rows"].as_array().unwrap().clone();
        assert_eq!(
            rows.iter().map(|row| row["name"].as_str().unwrap()).collect::<Vec<_>>(),
            ["LQ", "HQ again", "mean of 6 of HQ"]
        );
        let of = |row: usize, measure: &str| rows[row]["full"][measure]["mean"].as_f64().unwrap();
        ([0, 1, 2].map(|row| of(row, "psnr_db")), [0, 1, 2].map(|row| of(row, "ssim")), output)
    };
    let (psnr, ssim, output) = judge();
    assert!(!String::from_utf8_lossy(&output.stdout).contains("its own seed"));
    // Chance leaves a small error, near that of grey levels; averaging squares leaves less.
    assert!(psnr[1] > 25.0 && psnr[1] + 0.3 < psnr[2] && psnr[2] < 80.0, "{psnr:?}");
    assert!(ssim[1] > 0.8 && ssim[1] < ssim[2] && ssim[2] < 1.0, "{ssim:?}");

    // A target that this program can't render is reported.
    let row = Dataset::open(&out).unwrap().of(Split::Test).next().unwrap().clone();
    let mut bytes = std::fs::read(out.join(&row.file)).unwrap();
    let high = bytes.len() - 2 * 80 * 60 - 1;
    bytes[high - 80 * 30] ^= 1;
    let manifest = out.join("manifest.jsonl");
    let rows = std::fs::read_to_string(&manifest).unwrap();
    std::fs::write(&manifest, rows.replace(&row.sha256, &hex(&Sha256::digest(&bytes)))).unwrap();
    std::fs::write(out.join(&row.file), bytes).unwrap();
    assert!(String::from_utf8_lossy(&judge().2.stdout).contains("its own seed"));
    failed(&insonify(&["evaluate", "--dataset", text(&out), "--again", "0"]), 2, &["--again"]);
    failed(&insonify(&["evaluate", "--again", "2", "--steadiness", text(&station)]), 2, &["--dataset"]);
}
