//! Tests of generators with known effects (training/make_test_models.py), run by ONNX Runtime.
//!
//! They need ONNX Runtime's library: without it they fail with the advice to run scripts/setup.
// clippy.toml allows these in test functions only, not in their helpers.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod evaluate;
mod seams;

use std::cell::RefCell;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use insonify::anatomy::TissueTable;
use insonify::generator::{
    FeatureScale, Generator, GeneratorError, Input, LoadOptions, Manifest, OnnxFeatures, Precision, Provider, Runtime,
    Settings, load_generators,
};
use insonify::pipeline::{FrameGenerators, Generators};
use insonify::quality::{FeatureExtractor, frechet_distance_of};
use insonify::render::{ComputeDevice, Frame};
use insonify::sink::png::{self, Effort};
use insonify::sink::{npy, write_json};
use insonify::transducer::{Probe, ScanGeometry};
use sha2::{Digest, Sha256};

/// Tissues of the station, in a different order than the models' classes.
const TISSUES: [&str; 3] = ["placenta", "skull", "amniotic_fluid"];
/// Class of each tissue number, by number, in the models.
const CLASSES: [u8; 4] = [0, 2, 3, 1];
const SIZES: [(u32, u32); 6] = [(16, 16), (37, 23), (1, 1), (130, 71), (40, 30), (3, 200)];

fn model(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/generators").join(format!("{name}.onnx"))
}

fn runtime() -> &'static Runtime {
    Runtime::get().unwrap_or_else(|e| panic!("{e}"))
}

fn load_path(path: &Path, provider: Provider) -> Result<Generator, GeneratorError> {
    let tissues = TISSUES.map(str::to_owned);
    Generator::load(path, runtime(), &LoadOptions { provider, threads: 1, tissues: &tissues, ..LoadOptions::default() })
}

fn load(name: &str) -> Generator {
    load_path(&model(name), Provider::Cpu).unwrap_or_else(|e| panic!("{e}"))
}

#[track_caller]
fn assert_says(error: &GeneratorError, words: &[&str]) {
    let message = error.to_string();
    for word in words {
        assert!(message.contains(word), "`{word}` is missing: {message}");
    }
}

/// Maps of a frame: speckle, blocks of tissues, a shadow, and a sector that excludes two corners.
struct Maps {
    width: u32,
    height: u32,
    image: Vec<u8>,
    segmentation: Vec<u8>,
    attenuation: Vec<f32>,
    mask: Vec<u8>,
}

impl Maps {
    fn new((width, height): (u32, u32)) -> Self {
        let (w, h) = (width as usize, height as usize);
        let at = |i: usize| (i % w, i / w);
        let inside = |i: usize| {
            let (x, y) = at(i);
            w < 4 || (x + y / 2 >= w / 8 && x <= w - w / 8 + y / 2)
        };
        let all = |value: &dyn Fn(usize, usize) -> u8| -> Vec<u8> {
            (0..w * h).map(|i| if inside(i) { value(at(i).0, at(i).1) } else { 0 }).collect()
        };
        let image = all(&|x, y| ((x * 7919 + y * 104_729 + x * y * 31) % 256) as u8);
        let segmentation = all(&|x, y| 1 + ((x / 5 + y / 7) % 3) as u8);
        let attenuation = (0..w * h).map(|i| if inside(i) { (i % 97) as f32 / 96.0 } else { 0.0 }).collect();
        Self { width, height, image, segmentation, attenuation, mask: all(&|_, _| 255) }
    }

    fn input(&self) -> Input<'_> {
        Input {
            width: self.width,
            height: self.height,
            image: &self.image,
            segmentation: &self.segmentation,
            attenuation: &self.attenuation,
            mask: &self.mask,
            scan: None,
        }
    }

    fn unit(&self, x: usize, y: usize) -> f64 {
        f64::from(self.image[y * self.width as usize + x]) / 255.0
    }

    fn class(&self, x: usize, y: usize) -> u8 {
        CLASSES[usize::from(self.segmentation[y * self.width as usize + x])]
    }
}

/// Runs the model at every size, and compares each grey level with `expected` (0..=1), within rounding.
fn check(name: &str, expected: impl Fn(&Maps, usize, usize) -> f64) {
    let mut generator = load(name);
    let mut out = Vec::new();
    for size in SIZES {
        let maps = Maps::new(size);
        generator.run(&maps.input(), &mut out).unwrap();
        assert_eq!(out.len(), maps.image.len());
        for (i, &level) in out.iter().enumerate() {
            let (x, y) = (i % size.0 as usize, i / size.0 as usize);
            if maps.mask[i] == 0 {
                assert_eq!(level, 0, "{name} {size:?}: outside the sector at {x}, {y}");
                continue;
            }
            let exact = (expected(&maps, x, y) * 255.0).clamp(0.0, 255.0);
            let off = (f64::from(level) - exact).abs();
            assert!(off <= 0.5 + 1e-3, "{name} {size:?}: {level} at {x}, {y}, not {exact}");
        }
    }
}

#[test]
fn the_identity_returns_every_level() {
    let mut generator = load("identity");
    let mut out = Vec::new();
    for size in SIZES {
        let maps = Maps::new(size);
        generator.run(&maps.input(), &mut out).unwrap();
        assert_eq!(out, maps.image, "{size:?}");
    }
}

#[test]
fn brightness_is_clipped_and_rounded() {
    check("brightness", |maps, x, y| 1.25 * maps.unit(x, y) + 0.1);
}

/// Mean of 3 × 3 pixels of a picture that is zero outside.
fn mean_of_nine(maps: &Maps, x: usize, y: usize) -> f64 {
    let near = |c: usize, n: u32| c.saturating_sub(1)..(c + 2).min(n as usize);
    near(y, maps.height).flat_map(|y| near(x, maps.width).map(move |x| maps.unit(x, y))).sum::<f64>() / 9.0
}

#[test]
fn a_blur_reads_only_the_frame() {
    check("blur", mean_of_nine);
}

#[test]
fn a_blur_reads_zeros_where_the_frame_is_padded() {
    check("blur_padded", mean_of_nine);
}

#[test]
fn sizes_are_padded_to_the_models_multiple_and_cropped_back() {
    let means = RefCell::new(HashMap::new());
    check("block_mean", |maps, x, y| {
        let (w, h) = (maps.width as usize, maps.height as usize);
        // Half of the padding precedes the picture; an odd pixel follows it.
        let before = |n: usize| (n.next_multiple_of(64) - n) / 2;
        // First pixel of the block, counted from the start of the padding.
        let (left, top) = ((x + before(w)) / 64 * 64, (y + before(h)) / 64 * 64);
        let mean = || {
            let within =
                |start: usize, n: usize| start.saturating_sub(before(n))..(start + 64).saturating_sub(before(n)).min(n);
            within(top, h).flat_map(|y| within(left, w).map(move |x| maps.unit(x, y))).sum::<f64>() / 4096.0
        };
        let mean = *means.borrow_mut().entry((w, h, left, top)).or_insert_with(mean);
        0.5 * (maps.unit(x, y) + mean)
    });
}

#[test]
fn tissues_are_mapped_to_classes_by_name() {
    check("inverted_class", |maps, x, y| if maps.class(x, y) == 2 { 1.0 - maps.unit(x, y) } else { maps.unit(x, y) });
    check("class_levels", |maps, x, y| [0.1, 0.3, 0.5, 0.7][usize::from(maps.class(x, y))] + 0.1 * maps.unit(x, y));
}

#[test]
fn channels_have_the_manifests_order() {
    check("weighted_maps", |maps, x, y| {
        let attenuation = f64::from(maps.attenuation[y * maps.width as usize + x]);
        0.5 * maps.unit(x, y) + 0.1 * f64::from(maps.class(x, y)) + 0.2 * attenuation
    });
}

#[test]
fn a_generator_of_maps_needs_no_image_and_accepts_tissue_groups() {
    // Classes of placenta, skull, amniotic fluid: other, a group of two tissues, a group of one.
    check("maps_only", |maps, x, y| {
        let attenuation = f64::from(maps.attenuation[y * maps.width as usize + x]);
        0.2 * f64::from(maps.class(x, y)) + 0.2 * attenuation
    });
    let maps = Maps::new((20, 10));
    let without = Input { image: &[], ..maps.input() };
    let (mut generator, [mut expected, mut found]) = (load("maps_only"), [vec![], vec![]]);
    generator.run(&maps.input(), &mut expected).unwrap();
    generator.run(&without, &mut found).unwrap();
    assert_eq!(found, expected);
    generator.measure(20, 10, 1).unwrap();
    let tissues = ["calvaria", "titanium"].map(str::to_owned);
    let options = LoadOptions { tissues: &tissues, ..LoadOptions::default() };
    let mut other = Generator::load(&model("maps_only"), runtime(), &options).unwrap();
    let attenuation = [0.0; 3];
    let input = Input {
        width: 3,
        height: 1,
        image: &[],
        segmentation: &[1, 2, 0],
        attenuation: &attenuation,
        mask: &[255; 3],
        scan: None,
    };
    other.run(&input, &mut found).unwrap();
    assert_eq!(found, [153, 102, 0], "a group's tissue, any other, outside");
}

#[test]
fn only_the_maps_that_a_model_reads_are_requested() {
    let maps = Maps::new((20, 10));
    let of = |name: &str, input: Input<'_>| load(name).run(&input, &mut Vec::new()).map_err(|e| e.to_string());
    let no_maps = Input { segmentation: &[], attenuation: &[], ..maps.input() };
    assert_eq!(of("blur", no_maps), Ok(()));
    assert!(of("inverted_class", no_maps).unwrap_err().contains("segmentation"));
    assert_eq!(of("inverted_class", Input { attenuation: &[], ..maps.input() }), Ok(()));
    assert!(of("weighted_maps", Input { attenuation: &[], ..maps.input() }).unwrap_err().contains("attenuation"));
    assert!(of("blur", Input { image: &[], ..maps.input() }).unwrap_err().contains("image"));
    assert!(of("maps_only", Input { mask: &[], ..maps.input() }).unwrap_err().contains("mask"));
}

#[test]
fn a_model_without_a_class_for_a_tissue_is_refused() {
    let tissues = ["placenta", "titanium"].map(str::to_owned);
    let options = LoadOptions { tissues: &tissues, ..LoadOptions::default() };
    let error = Generator::load(&model("class_levels"), runtime(), &options).unwrap_err();
    assert_says(&error, &["class_levels.onnx", "`titanium`"]);
    assert!(Generator::load(&model("blur"), runtime(), &options).is_ok(), "it reads no tissues");
}

#[test]
fn a_model_in_beam_coordinates_translates_pictures() {
    let mut generator = load("identity_beam");
    let picture = |depth_mm: f64| {
        let scan = ScanGeometry::fit(&Probe { depth_mm, ..Probe::default() }, 300, 216);
        let pixels = (0..216).flat_map(|row| (0..300).map(move |column| (column, row)));
        let beams: Vec<_> = pixels.map(|(column, row)| scan.beam_at(column, row)).collect();
        let level = |(fraction, depth_mm): (f64, f64)| (128.0 + 90.0 * (6.0 * fraction + depth_mm / 25.0).sin()) as u8;
        Frame {
            width: 300,
            height: 216,
            bmode: beams.iter().map(|beam| beam.map_or(0, level)).collect(),
            mask: beams.iter().map(|beam| if beam.is_some() { 255 } else { 0 }).collect(),
            scan: Some(scan),
            ..Frame::default()
        }
    };
    let assert_shows = |frame: &Frame, out: &[u8]| {
        let far = out.iter().zip(&frame.bmode).filter(|(found, level)| found.abs_diff(**level) > 2).count();
        assert!(far < out.len() / 200, "{far} pixels");
        assert!(out.iter().zip(&*frame.mask).all(|(level, inside)| *inside > 0 || *level == 0));
    };
    let frame = picture(150.0);
    let mut out = Vec::new();
    generator.run(&Input::from(&frame), &mut out).unwrap();
    assert_shows(&frame, &out);
    // The same model with tensors of bytes rounds on the grid, too.
    let mut of_bytes = Vec::new();
    load("identity_beam_bytes").run(&Input::from(&frame), &mut of_bytes).unwrap();
    assert!(out.iter().zip(&of_bytes).all(|(floats, bytes)| floats.abs_diff(*bytes) <= 1));
    assert_shows(&frame, &of_bytes);
    // Another depth of the same size needs other tables.
    let shallow = picture(75.0);
    generator.run(&Input::from(&shallow), &mut out).unwrap();
    assert_shows(&shallow, &out);
}

#[test]
fn a_model_in_beam_coordinates_wants_the_scanlines() {
    let maps = Maps::new((130, 71));
    let mut generator = load("identity_beam");
    let mut out = vec![1];
    let error = generator.run(&maps.input(), &mut out).unwrap_err();
    assert_says(&error, &["identity_beam", "scanlines", "130 x 71", "insonify render"]);
    // Those of another picture are not its own.
    let scan = Some(ScanGeometry::fit(&Probe::default(), 131, 71));
    let error = generator.run(&Input { scan, ..maps.input() }, &mut out).unwrap_err();
    assert_says(&error, &["130 x 71"]);
    assert!(out.is_empty());
}

#[test]
fn a_model_with_tensors_of_bytes_gives_the_levels_of_the_one_with_floats() {
    // Attenuation of 8 bits moves a level by one at most; image, mask and classes are bytes anyway.
    for (name, allowed) in [("weighted_maps", 1), ("class_levels", 0)] {
        let (mut floats, mut bytes) = (load(name), load(&format!("{name}_bytes")));
        assert_eq!(bytes.parity().tolerance, 1.0);
        for size in SIZES {
            let maps = Maps::new(size);
            let [mut expected, mut found] = [const { Vec::new() }; 2];
            floats.run(&maps.input(), &mut expected).unwrap();
            bytes.run(&maps.input(), &mut found).unwrap();
            assert_eq!(found.len(), expected.len());
            let far = found.iter().zip(&expected).filter(|(a, b)| a.abs_diff(**b) > allowed).count();
            assert_eq!(far, 0, "{name} {size:?}");
        }
    }
    // Unknown tissues and sums are checked as ever.
    let segmentation = vec![4; 200];
    let maps = Maps::new((20, 10));
    let unknown = Input { segmentation: &segmentation, ..maps.input() };
    assert_says(&load("weighted_maps_bytes").run(&unknown, &mut Vec::new()).unwrap_err(), &["number 4", "go to 3"]);
}

#[test]
fn maps_of_the_wrong_size_are_errors() {
    let mut generator = load("weighted_maps");
    let maps = Maps::new((20, 10));
    let mut out = vec![1, 2, 3];
    let short = Input { mask: &maps.mask[1..], ..maps.input() };
    assert_says(&generator.run(&short, &mut out).unwrap_err(), &["mask", "199", "200"]);
    assert!(out.is_empty(), "an earlier image must not pass for this one's");
    let segmentation = vec![4; 200];
    let unknown = Input { segmentation: &segmentation, ..maps.input() };
    assert_says(&generator.run(&unknown, &mut out).unwrap_err(), &["number 4", "go to 3"]);
    let empty = Input { width: 0, height: 0, image: &[], segmentation: &[], attenuation: &[], mask: &[], scan: None };
    assert!(matches!(generator.run(&empty, &mut out), Err(GeneratorError::InputSize { .. })));
    generator.run(&maps.input(), &mut out).unwrap();
    assert_eq!(out.len(), 200);
}

#[test]
fn a_model_that_misses_its_parity_pair_is_refused_with_the_place() {
    let error = load_path(&model("wrong_parity"), Provider::Cpu).unwrap_err();
    let GeneratorError::Parity { difference, row, column, tolerance, .. } = &error else { panic!("{error}") };
    assert!((difference - 3.0).abs() < 1e-3, "{difference}");
    assert_eq!((row, column, tolerance), (&20, &17, &0.01));
    assert_says(&error, &["wrong_parity.onnx is refused", "row 20, column 17"]);
}

/// Precision that `auto` chooses on this processor for a sound model.
fn chosen_precision() -> Precision {
    let brightness = Manifest::load(&model("brightness").with_extension("toml")).unwrap().sha256;
    let (_dir, path) = with_int8(&brightness);
    load_path(&path, Provider::Cpu).unwrap().precision()
}

#[test]
fn every_other_model_meets_its_parity_pair() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let tissues = TissueTable::builtin().unwrap().names().to_vec();
    let test_tissues = TISSUES.map(str::to_owned);
    let of_tests = std::fs::read_dir(root.join("tests/data/generators")).unwrap().map(|file| file.unwrap().path());
    let onnx =
        of_tests.filter(|path| path.extension().is_some_and(|e| e == "onnx") && !path.ends_with("wrong_parity.onnx"));
    let all =
        onnx.map(|path| (path, &test_tissues[..])).chain(seams::shipped().into_iter().map(|path| (path, &tissues[..])));
    let (mut loaded, mut quantised) = (0, 0);
    for (path, tissues) in all {
        let load_in = |precision| {
            let options = LoadOptions { threads: 1, tissues, precision, ..LoadOptions::default() };
            let generator = Generator::load(&path, runtime(), &options).unwrap_or_else(|e| panic!("{e}"));
            assert!(generator.parity().difference <= generator.parity().tolerance);
            assert_eq!(generator.precision(), precision);
            generator
        };
        let generator = load_in(Precision::Float32);
        if let Some(other) = generator.manifest().quantised(Precision::Int8) {
            let model = std::fs::read(path.with_file_name(&other.model)).unwrap();
            let digest: String = Sha256::digest(&model).iter().map(|byte| format!("{byte:02x}")).collect();
            assert_eq!(digest, other.sha256, "{}", other.model);
            // Older processors run it with sums that overflow, and `auto` doesn't choose it there.
            if chosen_precision() == Precision::Int8 {
                load_in(Precision::Int8);
            }
            quantised += 1;
        }
        assert_eq!(generator.manifest().name, path.file_stem().unwrap().to_str().unwrap());
        loaded += 1;
    }
    assert!(loaded >= 13 && quantised >= 2, "{loaded}, {quantised}");
}

#[test]
fn nan_outputs_are_never_shown() {
    let mut generator = load("not_a_number");
    let mut maps = Maps::new((50, 40));
    maps.image.iter_mut().for_each(|level| *level = (*level).min(200));
    let sound = maps.image.clone();
    maps.image[7 * 50 + 31] = 255;
    maps.image[9 * 50 + 30] = 240;
    let mut out = Vec::new();
    let error = generator.run(&maps.input(), &mut out).unwrap_err();
    assert!(matches!(error, GeneratorError::NotFinite { count: 2, row: 7, column: 31, .. }), "{error}");
    assert!(out.is_empty());
    maps.image = sound;
    generator.run(&maps.input(), &mut out).unwrap();
    assert_eq!(out.len(), 2000);
}

#[test]
fn a_run_that_hangs_is_stopped_and_the_next_one_works() {
    let mut generator = load("endless");
    let terminator = generator.terminator();
    assert!(!terminator.terminate(), "nothing runs");
    let mut maps = Maps::new((200, 100));
    maps.image[0] = 255;
    let mut out = Vec::new();
    let error = std::thread::scope(|scope| {
        let stopper = scope.spawn(|| {
            let number = loop {
                match terminator.running() {
                    Some(number) => break number,
                    None => std::thread::yield_now(),
                }
            };
            assert!(!terminator.terminate_run(number + 1), "that run has not begun");
            terminator.terminate_run(number)
        });
        let error = generator.run(&maps.input(), &mut out).unwrap_err();
        assert!(stopper.join().unwrap());
        error
    });
    assert!(matches!(error, GeneratorError::Terminated { .. }), "{error}");
    assert!(out.is_empty());
    maps.image[0] = 0;
    assert!(!terminator.terminate(), "what comes later is not touched");
    generator.run(&maps.input(), &mut out).unwrap();
    assert_eq!(out, maps.image);
}

#[test]
fn an_unavailable_provider_is_an_error() {
    for (provider, name) in [(Provider::Cuda, "`cuda`"), (Provider::TensorRt, "`tensorrt`")] {
        let error = load_path(&model("identity"), provider).unwrap_err();
        assert!(matches!(error, GeneratorError::Provider { .. }), "{error}");
        assert_says(&error, &[name, "not available", "ORT_DYLIB_PATH"]);
    }
}

/// Copy of a model and its files in a new directory. `change` makes the copy's manifest from the original's.
fn changed(name: &str, change: impl Fn(&str, &Path) -> String) -> (tempfile::TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let source = model(name);
    let copy = |file: &str| std::fs::copy(source.with_file_name(file), dir.path().join(file)).unwrap();
    for file in [format!("{name}.onnx"), "speckle.npy".to_owned(), format!("{name}.parity_output.npy")] {
        copy(&file);
    }
    let path = dir.path().join(format!("{name}.onnx"));
    let manifest = std::fs::read_to_string(source.with_extension("toml")).unwrap();
    std::fs::write(path.with_extension("toml"), change(&manifest, &path)).unwrap();
    (dir, path)
}

/// The model `blur`, whose variant int8 is in truth the model `brightness`. `sha256` is that variant's hash in the
/// manifest.
fn with_int8(sha256: &str) -> (tempfile::TempDir, PathBuf) {
    let of_other = |end: &str| std::fs::read(model("brightness").with_file_name(format!("brightness{end}"))).unwrap();
    let (dir, path) = changed("blur", |manifest, path| {
        std::fs::write(path.with_file_name("b.onnx"), of_other(".onnx")).unwrap();
        std::fs::write(path.with_file_name("b.npy"), of_other(".parity_output.npy")).unwrap();
        format!(
            "{manifest}\n[[precision]]\nname = \"int8\"\nmodel = \"b.onnx\"\nsha256 = \"{sha256}\"\noutput = \"b.npy\"\n\
             tolerance = 0.5\npsnr_db = 20.0\n"
        )
    });
    (dir, path)
}

#[test]
fn a_model_runs_in_the_precision_asked_for() {
    let brightness = Manifest::load(&model("brightness").with_extension("toml")).unwrap().sha256;
    let load_in = |path: &Path, precision| {
        Generator::load(path, runtime(), &LoadOptions { threads: 1, precision, ..LoadOptions::default() })
    };
    let image_of = |generator: &mut Generator| {
        let (maps, mut out) = (Maps::new((40, 30)), Vec::new());
        generator.run(&maps.input(), &mut out).unwrap();
        out
    };
    let expected = ["blur", "brightness"].map(|name| image_of(&mut load(name)));
    let (_dir, path) = with_int8(&brightness);
    for (precision, of) in [(Precision::Float32, 0), (Precision::Int8, 1)] {
        let mut generator = load_in(&path, precision).unwrap();
        assert_eq!((generator.precision(), image_of(&mut generator)), (precision, expected[of].clone()));
    }
    // By the processor.
    let mut chosen = load_in(&path, Precision::Auto).unwrap();
    assert_eq!(image_of(&mut chosen), expected[usize::from(chosen.precision() == Precision::Int8)]);

    let (_dir, path) = with_int8(&"0".repeat(64));
    assert_says(&load_in(&path, Precision::Int8).unwrap_err(), &["b.onnx has sha256", "0000"]);
    let mut chosen = load_in(&path, Precision::Auto).unwrap();
    assert_eq!((chosen.precision(), image_of(&mut chosen)), (Precision::Float32, expected[0].clone()));
    let error = load_in(&model("identity"), Precision::Int8).unwrap_err();
    assert_says(&error, &["identity.onnx has no `int8`", "use auto or float32"]);
    assert_eq!(load_in(&model("identity"), Precision::Auto).unwrap().precision(), Precision::Float32);
}

#[test]
fn contradictory_files_are_refused() {
    let refused = |change: &dyn Fn(&str, &Path) -> String, words: &[&str]| {
        let (_dir, path) = changed("identity", change);
        assert_says(&load_path(&path, Provider::Cpu).unwrap_err(), words);
    };
    let replace = |from: &'static str, to: &'static str| {
        move |text: &str, _: &Path| {
            assert!(text.contains(from), "{from}");
            text.replacen(from, to, 1)
        }
    };
    refused(&replace("[input]\nname = \"input\"", "[input]\nname = \"x\""), &["its input is `input`", "`x`"]);
    refused(&replace("[output]\nname = \"output\"", "[output]\nname = \"y\""), &["no output `y`", "output"]);
    refused(&replace("format = 1", "format = 1\nspeed = 2"), &["identity.toml", "unknown field `speed`"]);
    let classes = "variant = \"MS\"\n[segmentation]\nencoding = \"map\"\nclasses = [\"outside\", \"placenta\", \
                   \"skull\", \"amniotic_fluid\"]\n[input]\nsegmentation = { scale = 1.0, offset = 0.0 }\n";
    let three = move |text: &str, _: &Path| {
        let text = text
            .replace("variant = \"M\"\n", "")
            .replace("[input]\n", "")
            .replace("\"mask\"]", "\"mask\", \"segmentation\"]");
        let (head, rest) = text.split_once("name = \"input\"").unwrap();
        format!("{head}{classes}name = \"input\"{rest}")
    };
    refused(&three, &["`input` has 2 channels", "are 3"]);
    let shorten = |text: &str, path: &Path| {
        let model = std::fs::read(path).unwrap();
        std::fs::write(path, &model[..model.len() - 1]).unwrap();
        text.to_owned()
    };
    refused(&shorten, &["sha256", "identity.onnx"]);
    let garbage = |text: &str, path: &Path| {
        std::fs::write(path, b"no model").unwrap();
        let hash: String = Sha256::digest(b"no model").iter().map(|b| format!("{b:02x}")).collect();
        let start = text.find("sha256 = \"").unwrap() + 10;
        format!("{}{hash}{}", &text[..start], &text[start + 64..])
    };
    refused(&garbage, &["ONNX Runtime cannot use", "identity.onnx"]);
    // A tensor whose values lie in `w.data`: field 7 (graph), 5 (initializer), 13 (external_data), as other exporters write it.
    let external = |text: &str, path: &Path| {
        let entry = b"\x0a\x08location\x12\x06w.data";
        let nested = [7u8, 5, 13]
            .iter()
            .rev()
            .fold(entry.to_vec(), |content, number| [&[number << 3 | 2, content.len() as u8], &content[..]].concat());
        let model = [std::fs::read(path).unwrap(), nested].concat();
        with_model(text, path, &model)
    };
    refused(&external, &["identity.onnx keeps its weights in `w.data`", "external_data=False"]);
    let no_pair = |text: &str, path: &Path| {
        std::fs::remove_file(path.with_file_name("speckle.npy")).unwrap();
        text.to_owned()
    };
    refused(&no_pair, &["cannot read", "speckle.npy"]);
    let swapped = replace("input = \"speckle.npy\"", "input = \"identity.parity_output.npy\"");
    refused(&swapped, &["identity.parity_output.npy", "[4, height, width]"]);
    let no_manifest = |text: &str, path: &Path| {
        std::fs::write(path.with_file_name("other.txt"), text).unwrap();
        String::new()
    };
    refused(&no_manifest, &["identity.toml", "missing field"]);
    assert_says(&load_path(&model("nothing"), Provider::Cpu).unwrap_err(), &["cannot read", "nothing.toml"]);
}

/// `text`, a manifest, with the hash of `model`, which is written to `path`.
fn with_model(text: &str, path: &Path, model: &[u8]) -> String {
    std::fs::write(path, model).unwrap();
    let hash: String = Sha256::digest(model).iter().map(|byte| format!("{byte:02x}")).collect();
    let start = text.find("sha256 = \"").unwrap() + 10;
    format!("{}{hash}{}", &text[..start], &text[start + 64..])
}

#[test]
fn broken_truncated_and_foreign_models_are_refused_and_the_others_are_used() {
    let not_numbers = changed("blur", |text, path| {
        let mut model = std::fs::read(path).unwrap();
        let ninth = (1.0f32 / 9.0).to_le_bytes();
        let at = model.windows(4).position(|bytes| bytes == ninth).expect("a weight of 1/9");
        model[at..at + 4].copy_from_slice(&f32::NAN.to_le_bytes());
        with_model(text, path, &model)
    });
    let truncated = changed("identity", |text, path| {
        let model = std::fs::read(path).unwrap();
        with_model(text, path, &model[..model.len() / 2])
    });
    let texture = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/quality/texture64.onnx");
    let foreign = changed("identity", |text, path| with_model(text, path, &std::fs::read(&texture).unwrap()));
    let other_channels =
        changed("brightness", |text, path| with_model(text, path, &std::fs::read(model("weighted_maps")).unwrap()));
    let models = [&not_numbers.1, &truncated.1, &foreign.1, &other_channels.1, &model("identity")].map(Clone::clone);
    let settings = Settings { models: models.to_vec(), threads: 1, run_budget_ms: 10_000.0, ..Settings::default() };
    let tissues = TISSUES.map(str::to_owned);
    let mut loaded = load_generators(&settings, &tissues).unwrap();
    let words: [&[&str]; 4] = [
        &["`blur`", "not finite"],
        &["ONNX Runtime cannot use", "identity.onnx"],
        &["does not fit its manifest", "no output `output`"],
        &["does not fit its manifest", "`input` has 4 channels; the manifest's are 2"],
    ];
    assert_eq!(loaded.refused.len(), 4);
    for ((refused, words), path) in loaded.refused.iter().zip(words).zip(&models) {
        assert_eq!(&refused.path, path);
        assert_says(&refused.error, words);
    }
    let maps = Maps::new((40, 30));
    let mut out = Vec::new();
    loaded.generators[0].run(&maps.input(), &mut out).unwrap();
    assert_eq!((loaded.generators.len(), out), (1, maps.image));
    // Without a valid model the station has none, and shows its rendered frames.
    let none = Settings { models: models[..4].to_vec(), ..settings };
    let loaded = load_generators(&none, &tissues).unwrap();
    assert!(loaded.generators.is_empty() && loaded.refused.len() == 4);
}

#[test]
fn the_texture_network_distinguishes_textures() {
    let mut network = OnnxFeatures::texture64(runtime()).unwrap();
    assert_eq!((network.name(), network.crop()), ("texture64", 256));
    // Black and white have no texture; sums and logarithms of zero stay finite.
    for level in [0, 255] {
        let features = network.features(&[level; 65_536]).unwrap();
        assert_eq!(features.len(), 64);
        assert!(features.iter().all(|f| f.is_finite()) && (features[0] - f64::from(level) / 63.75).abs() < 1e-4);
    }
    // Waves of 8 pixels along rows: strongest in the second octave at 0 degrees.
    let wave = |x: usize, y: usize, turned: bool| {
        let along = if turned { y } else { x };
        (127.5 + 100.0 * (std::f64::consts::TAU * along as f64 / 8.0).sin()) as u8
    };
    for turned in [false, true] {
        let crop: Vec<u8> = (0..65_536).map(|i| wave(i % 256, i / 256, turned)).collect();
        let features = network.features(&crop).unwrap();
        let strongest = (4..20).max_by(|&a, &b| features[a].total_cmp(&features[b])).unwrap();
        assert_eq!(strongest, 4 + 4 + if turned { 2 } else { 0 }, "{features:?}");
    }
    // Grain of a different size is further away than different grain of the same size.
    let grain = |size: usize, seed: u32| -> Vec<u8> {
        let hash = |x: usize, y: usize| {
            let n = (x as u32).wrapping_mul(0x9e37_79b1) ^ (y as u32).wrapping_mul(0x85eb_ca77) ^ seed;
            (n ^ (n >> 15)).wrapping_mul(0x27d4_eb2f) >> 24
        };
        (0..65_536).map(|i| hash(i % 256 / size, i / 256 / size) as u8).collect()
    };
    let mut set = |size: usize, first: u32| -> Vec<Vec<f64>> {
        (0..6).map(|i| network.features(&grain(size, first + 1000 * i)).unwrap()).collect()
    };
    let (fine, again, coarse) = (set(2, 1), set(2, 99), set(3, 1));
    let distance = |a: &[Vec<f64>], b: &[Vec<f64>]| frechet_distance_of(a, b).unwrap();
    assert!(distance(&fine, &coarse) > 10.0 * distance(&fine, &again));
}

#[test]
fn a_station_uses_the_valid_models() {
    let models = ["wrong_parity", "slow", "identity"].map(model).to_vec();
    let settings = Settings { models, threads: 1, ..Settings::default() };
    let loaded = load_generators(&settings, &[]).unwrap();
    assert_eq!(loaded.refused.len(), 1);
    assert_says(&loaded.refused[0].error, &["wrong_parity.onnx"]);
    let names: Vec<_> = loaded.generators.iter().map(|g| g.manifest().name.as_str()).collect();
    assert_eq!(names, ["slow", "identity"]);

    let off = Settings { enabled: false, ..settings };
    assert!(load_generators(&off, &[]).unwrap().generators.is_empty());
}

#[test]
fn the_demos_filter_smooths_speckle_and_keeps_edges() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/generators/demo_smooth/demo_smooth.onnx");
    let mut generator = load_path(&path, Provider::Cpu).unwrap();
    let (width, height) = (161usize, 90usize);
    // Dark at left, bright at right, with a spread of 60 levels.
    let level = |x: usize, y: usize| {
        let scatter = (x * 7919 + y * 104_729 + x * x * y * 31) % 61;
        (if x < 80 { 20 } else { 170 }) + scatter as u8
    };
    let image: Vec<u8> = (0..width * height).map(|i| level(i % width, i / width)).collect();
    let (none, attenuation, mask) = (vec![0; image.len()], vec![0.0; image.len()], vec![255; image.len()]);
    let input = Input {
        width: width as u32,
        height: height as u32,
        image: &image,
        segmentation: &none,
        attenuation: &attenuation,
        mask: &mask,
        scan: None,
    };
    let mut out = Vec::new();
    generator.run(&input, &mut out).unwrap();
    let moments = |pixels: &[u8], columns: std::ops::Range<usize>| {
        let values: Vec<f64> =
            pixels.chunks_exact(width).flat_map(|row| &row[columns.clone()]).map(|v| f64::from(*v)).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64;
        (mean, variance.sqrt())
    };
    for columns in [0..60, 100..161] {
        let (before, after) = (moments(&image, columns.clone()), moments(&out, columns));
        assert!((before.0 - after.0).abs() < 2.0, "{before:?} {after:?}");
        assert!(after.1 < 0.4 * before.1, "{before:?} {after:?}");
    }
    let step = moments(&out, 82..84).0 - moments(&out, 76..78).0;
    assert!(step > 110.0, "{step} of 150");
}

fn insonify(arguments: &[&str], library: Option<&str>) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_insonify"));
    command.args(arguments).env_remove("RUST_LOG").current_dir(env!("CARGO_MANIFEST_DIR"));
    if let Some(library) = library {
        command.env("ORT_DYLIB_PATH", library);
    }
    command.output().unwrap()
}

#[test]
fn without_the_library_the_program_gives_advice() {
    let identity = model("identity");
    for library in ["/nowhere/libonnxruntime.so", "Cargo.toml"] {
        let output = insonify(&["generator", identity.to_str().unwrap()], Some(library));
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains(library) && message.contains("scripts/setup"), "{message}");
        assert!(message.contains("ORT_DYLIB_PATH") && !message.contains("panicked"), "{message}");
    }
}

#[test]
fn the_command_checks_measures_and_applies_a_model() {
    let dir = tempfile::tempdir().unwrap();
    let maps = Maps::new((60, 45));
    let write = |name: &str, map: &[u8]| png::write_grey(&dir.path().join(name), 60, 45, map, Effort::Fast).unwrap();
    write("bmode.png", &maps.image);
    let (frame, out) = (dir.path().to_str().unwrap(), dir.path().join("new/out.png"));
    let apply = |name: &str| {
        let model = model(name);
        let arguments = ["generator", model.to_str().unwrap(), "--frame", frame, "--runs", "2", "--json"];
        insonify(&[&arguments[..], &["--out", out.to_str().unwrap()]].concat(), None)
    };
    let refused = |output: Output, word: &str| {
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains(word), "{message}");
    };
    refused(apply("identity"), "mask.png");
    write("mask.png", &maps.mask);
    let output = apply("identity");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&report["manifest"]["name"], &report["times"]["width"]), (&"identity".into(), &60.into()));
    assert_eq!(image::open(&out).unwrap().into_bytes(), maps.image);

    refused(apply("weighted_maps"), "segmentation.png");
    write("segmentation.png", &maps.segmentation);
    let names = std::iter::once("outside").chain(TISSUES).enumerate();
    write_json(&dir.path().join("tissues.json"), &names.collect::<std::collections::BTreeMap<_, _>>()).unwrap();
    refused(apply("weighted_maps"), "attenuation.npy");
    npy::write_f32(&dir.path().join("attenuation.npy"), [45, 60], &maps.attenuation).unwrap();
    assert!(apply("weighted_maps").status.success());
    let mut expected = Vec::new();
    load("weighted_maps").run(&maps.input(), &mut expected).unwrap();
    assert_eq!(image::open(&out).unwrap().into_bytes(), expected);
}

#[test]
fn a_feature_extractor_returns_its_features() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/quality/block_means.onnx");
    let crop: Vec<u8> = (0..256).map(|i| if i % 16 < 8 { 51 } else { (i / 16) as u8 }).collect();
    for (scale, of) in [
        (FeatureScale::Signed, (|level| level / 127.5 - 1.0) as fn(f64) -> f64),
        (FeatureScale::Unit, |level| level / 255.0),
        (FeatureScale::Grey, |level| level),
    ] {
        let mut extractor = OnnxFeatures::load(&path, runtime(), scale).unwrap();
        assert_eq!(extractor.crop(), 16);
        let found = extractor.features(&crop).unwrap();
        let expected = [1.0, 2.0, 3.0].iter().flat_map(|gain| [51.0, 3.5, 51.0, 11.5].map(|level| gain * of(level)));
        assert_eq!(found.len(), 12);
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-5 * expected.abs().max(1.0), "{scale}: {found} {expected}");
        }
        assert!(extractor.features(&crop[1..]).is_err());
    }
    // A generator isn't one: it has two input channels.
    let error = OnnxFeatures::load(&model("identity"), runtime(), FeatureScale::Unit).unwrap_err();
    assert_says(&error, &["identity.onnx", "1 or 3"]);
}

#[test]
fn a_pipeline_runs_generators_by_index() {
    let mut generators = Generators::new(vec![load("weighted_maps"), load("blur")]).unwrap();
    assert_eq!((generators.compute_device(), generators.count()), (ComputeDevice::Processors, 2));
    assert_eq!([0, 1, 2].map(|index| generators.reads_maps(index)), [true, false, false]);
    assert_eq!([0, 1, 2].map(|index| generators.name(index).to_owned()), ["weighted_maps", "blur", "none"]);
    let maps = Maps::new((20, 10));
    let frame = Frame {
        width: 20,
        height: 10,
        bmode: maps.image.clone(),
        segmentation: maps.segmentation.clone(),
        attenuation: maps.attenuation.clone(),
        mask: maps.mask.clone().into(),
        ..Frame::default()
    };
    let mut outputs = [const { Vec::new() }; 2];
    for (index, out) in outputs.iter_mut().enumerate() {
        generators.generate(index, &frame, out).unwrap();
        assert_eq!(out.len(), 200);
    }
    assert_ne!(outputs[0], outputs[1]);
    let error = generators.generate(2, &frame, &mut Vec::new()).unwrap_err().to_string();
    assert!(error.contains("no generator 2"), "{error}");
    assert!(Generators::new(Vec::new()).is_none());
}
