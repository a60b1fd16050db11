//! Tests of `insonify evaluate --dataset` on a data set with known figures.

use super::*;
use serde_json::{Value, json};

const SIZE: [usize; 2] = [300, 256];
/// Rows of fluid, rows of bone below it, and the columns of that bone; all else is soft tissue.
const FLUID: std::ops::Range<usize> = 0..100;
const BONE: std::ops::Range<usize> = 100..110;
const MIDDLE: std::ops::Range<usize> = 100..200;

/// An array of bytes in `.npy` format 1.0.
fn write_npy(path: &Path, shape: &[usize], values: &[u8]) {
    let shape: Vec<String> = shape.iter().map(usize::to_string).collect();
    let mut header = format!("{{'descr': '|u1', 'fortran_order': False, 'shape': ({}), }}", shape.join(", "));
    while (10 + header.len() + 1) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(values);
    std::fs::write(path, bytes).unwrap();
}

/// Writes a data set of two tuples. Their high-quality images are the output of `maps_only`. Their low-quality images
/// are 10 levels above it in the first tuple, and 20 below it in the second.
fn data_set(directory: &Path) {
    let [width, height] = SIZE;
    for folder in ["tuples", "masks", "stations"] {
        std::fs::create_dir_all(directory.join(folder)).unwrap();
    }
    let station = "[scene]\npath = \"a.glb\"\n[probe]\nkind = \"linear\"\nwidth_mm = 60.0\ndepth_mm = 51.2\n";
    std::fs::write(directory.join("stations/a.toml"), station).unwrap();
    let header = json!({
        "format": 1, "insonify": "0.1.0", "seed": 1, "frames": 2,
        "classes": ["outside", "amniotic_fluid", "bone_fetal", "placenta"],
        "planes": ["lq", "hq", "segmentation", "attenuation"], "attenuation_power": 0.25, "lq": [1, 1], "hq": [32, 3], "phantoms": 0,
        "frames_per_exam": 1, "test_share": 0.5,
        "stations": [{"file": "stations/a.toml", "directory": "/nowhere"}],
    });
    std::fs::write(directory.join("dataset.json"), header.to_string()).unwrap();
    write_npy(&directory.join("masks/a.npy"), &[height, width], &vec![255; width * height]);
    let number = |i: usize| match (i % width, i / width) {
        (_, y) if FLUID.contains(&y) => 1,
        (x, y) if BONE.contains(&y) && MIDDLE.contains(&x) => 2,
        _ => 3,
    };
    let segmentation: Vec<u8> = (0..width * height).map(number).collect();
    // Fluid is the second class, at steps of 0.2; the others are the third.
    let hq: Vec<u8> = segmentation.iter().map(|&n| if n == 1 { 51 } else { 102 }).collect();
    let mut manifest = String::new();
    for (index, difference) in [10i16, -20].into_iter().enumerate() {
        let lq: Vec<u8> = hq.iter().map(|&level| (i16::from(level) + difference) as u8).collect();
        let planes = [&lq[..], &hq, &segmentation, &vec![0; width * height]].concat();
        let file = directory.join(format!("tuples/{index}.npy"));
        write_npy(&file, &[4, height, width], &planes);
        let sha256 = insonify::files::hex(&Sha256::digest(std::fs::read(&file).unwrap()));
        let row = json!({
            "index": index, "split": "test", "station": "stations/a.toml", "exam": {"number": index, "seed": 1},
            "time_s": 0.0, "pose": {"position_mm": [0.0, 0.0, 0.0], "quaternion": [1.0, 0.0, 0.0, 0.0]},
            "settings": {"gain_db": 24.0, "dynamic_range_db": 66.0, "focus_mm": 70.0}, "seed": 1,
            "lq": [1, 1], "hq": [32, 3], "size": [width, height], "file": format!("tuples/{index}.npy"),
            "mask": "masks/a.npy", "sha256": sha256,
        });
        manifest += &format!("{row}\n");
    }
    // An incomplete row, as a killed run leaves it.
    manifest += "{\"index\": 2, \"spl";
    std::fs::write(directory.join("manifest.jsonl"), manifest).unwrap();
}

fn close(value: &Value, expected: f64) {
    let found = value.as_f64().unwrap_or(f64::NAN);
    assert!((found - expected).abs() < 1e-6 * expected.abs().max(1.0), "{found}, not {expected}");
}

#[test]
fn a_data_sets_figures_are_right() {
    let dir = tempfile::tempdir().unwrap();
    let (data, out) = (dir.path().join("data"), dir.path().join("out"));
    data_set(&data);
    let (json, csv) = (dir.path().join("all.json"), dir.path().join("all.csv"));
    let text = |path: &Path| path.to_str().unwrap().to_owned();
    let run = |models: &[&str], more: &[&str]| {
        let models = models.iter().flat_map(|name| ["--model".to_owned(), text(&model(name))]);
        let arguments: Vec<String> = ["evaluate".to_owned(), "--dataset".to_owned(), text(&data)]
            .into_iter()
            .chain(models)
            .chain(more.iter().map(|word| (*word).to_owned()))
            .collect();
        insonify(&arguments.iter().map(String::as_str).collect::<Vec<_>>(), None)
    };
    let files = ["--out", &text(&out), "--json", &text(&json), "--csv", &text(&csv), "--crop", "256", "--crops", "2"];
    let done = run(&["maps_only", "maps_only"], &files);
    let printed = String::from_utf8_lossy(&done.stdout).into_owned();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    for words in ["| maps_only (Maps) | inf |", "maps_only (2) (Maps)", "FD texture64", "2 tuples", "too few"] {
        assert!(printed.contains(words), "`{words}`: {printed}");
    }

    let report: Value = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
    let rows = report["dataset"]["rows"].as_array().unwrap();
    assert_eq!(
        rows.iter().map(|r| r["name"].as_str().unwrap()).collect::<Vec<_>>(),
        ["LQ", "maps_only", "maps_only (2)"]
    );
    let psnr = |difference: f64| 20.0 * (255.0 / difference).log10();
    for part in ["full", "crops"] {
        let (lq, perfect) = (&rows[0][part], &rows[1][part]);
        close(&lq["psnr_db"]["mean"], 0.5 * (psnr(10.0) + psnr(20.0)));
        assert_eq!(lq["images"], if part == "full" { 2 } else { 4 });
        assert_eq!(perfect["identical"], lq["images"]);
        close(&perfect["ssim"]["mean"], 1.0);
        close(&perfect["pkl"]["mean"], 0.0);
        close(&perfect["seen"]["whole"], 0.0);
        close(&lq["seen"]["levels"], 15.0);
        close(&lq["seen"]["texture"], 0.0);
        assert!(lq["pkl"]["mean"].as_f64().unwrap() > 1.0 && lq["ssim"]["mean"].as_f64().unwrap() < 1.0);
        let distance = |row: &Value| row["distances"][0][part].as_f64().unwrap();
        assert!(
            distance(&rows[0]) > 0.01 && distance(&rows[1]) < 1e-6,
            "{} {}",
            distance(&rows[0]),
            distance(&rows[1])
        );
    }
    // 10 above and 20 below average to 5 below and 15 off, everywhere.
    let region = |value: &Value, pixels: usize, level: f64| {
        assert_eq!(value["pixels"], 2 * pixels);
        close(&value["reference_grey"], level);
        close(&value["difference"], -5.0);
        close(&value["absolute_difference"], 15.0);
    };
    let [width, height] = SIZE;
    let tissues = rows[0]["tissues"].as_array().unwrap();
    let names: Vec<&str> = tissues.iter().map(|t| t["tissue"].as_str().unwrap()).collect();
    assert_eq!(names, ["placenta", "amniotic_fluid", "bone_fetal"]);
    let (fluid, bone) = (FLUID.len() * width, BONE.len() * MIDDLE.len());
    region(&tissues[0], width * height - fluid - bone, 102.0);
    region(&tissues[1], fluid, 51.0);
    region(&tissues[2], bone, 102.0);
    close(&tissues[2]["share"], bone as f64 / (width * height) as f64);
    // A pixel is 0.2 mm: from 2 mm behind the first row of bone, every pixel counts, except for rounding in the last.
    let behind = rows[0]["behind_bone"]["pixels"].as_u64().unwrap() as usize / 2;
    let most = (height - BONE.end) * MIDDLE.len();
    assert!((most - MIDDLE.len()..=most).contains(&behind), "{behind} of {most}");
    region(&rows[0]["behind_bone"], behind, 102.0);
    assert_eq!(rows[0]["elsewhere"]["pixels"], 2 * (width * height - behind));
    close(&rows[1]["behind_bone"]["difference"], 0.0);

    let lines = std::fs::read_to_string(&csv).unwrap();
    assert_eq!((lines.lines().count(), lines.matches("LQ,crop").count()), (1 + 3 * 2 * 3, 4), "{lines}");
    let mut files: Vec<String> =
        std::fs::read_dir(&out).unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
    files.sort();
    assert_eq!(files.len(), 3, "{files:?}");
    assert!(files[0].starts_with("best_") && files[1].starts_with("median_") && files[2] == "table.md", "{files:?}");
    assert!(std::fs::read_to_string(out.join("table.md")).unwrap().contains("| maps_only (Maps) | inf |"));

    let refused = |output: Output, words: &[&str]| {
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(words.iter().all(|word| message.contains(word)), "{words:?}: {message}");
    };
    refused(run(&[], &["--split", "train"]), &["no tuple of the split train", "2 for the test"]);
    refused(run(&["class_levels"], &[]), &["class_levels.onnx", "`bone_fetal`"]);
    refused(run(&["wrong_parity"], &[]), &["wrong_parity.onnx is refused"]);
    refused(run(&[], &["--limit", "0"]), &["--limit"]);
    assert!(run(&["identity"], &["--limit", "1", "--crop", "257"]).status.success());
    std::fs::remove_file(data.join("stations/a.toml")).unwrap();
    let done = run(&[], &["--crops", "0"]);
    assert!(String::from_utf8_lossy(&done.stdout).contains("nothing is said of what lies behind bone"));
    std::fs::write(data.join("dataset.json"), "{}").unwrap();
    refused(run(&[], &[]), &["dataset.json"]);
    refused(insonify(&["evaluate", "--model", "a.onnx"], None), &["<A>"]);
}
