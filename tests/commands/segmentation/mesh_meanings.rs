//! Tests of `insonify scene from-meshes` with files of several organs, other units and far positions.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::files::written;
use crate::program::{insonify, refused, succeeded};

/// Text of an OBJ file of boxes. Each box is given by the statements before it, its sides and its position, in the
/// file's unit.
fn boxes(boxes: &[(&str, DVec3, DVec3)]) -> String {
    let mut text = String::new();
    for (n, (before, low, size)) in boxes.iter().enumerate() {
        for i in 0..8 {
            let corner = *low + *size * DVec3::from_array([i >> 2 & 1, i >> 1 & 1, i & 1].map(f64::from));
            text += &format!("v {} {} {}\n", corner.x, corner.y, corner.z);
        }
        text += before;
        for face in [[1, 2, 4, 3], [5, 7, 8, 6], [1, 5, 6, 2], [3, 4, 8, 7], [1, 3, 7, 5], [2, 6, 8, 4]] {
            let [a, b, c, d] = face.map(|corner| corner + 8 * n);
            text += &format!("f {a} {b} {c} {d}\n");
        }
    }
    text
}

const LIVER: (DVec3, DVec3) = (DVec3::new(-110.0, -60.0, 0.0), DVec3::new(160.0, 100.0, 120.0));
const KIDNEY: (DVec3, DVec3) = (DVec3::new(-90.0, 60.0, -90.0), DVec3::new(50.0, 50.0, 105.0));

/// Text of an OBJ file of liver and right kidney, mm in LPS, with the statements before each.
fn organs(liver: &str, kidney: &str) -> String {
    boxes(&[(liver, LIVER.0, LIVER.1), (kidney, KIDNEY.0, KIDNEY.1)])
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn out(&self) -> PathBuf {
        self.0.path().join("p.glb")
    }

    fn file(&self, name: &str, text: &str) -> String {
        written(self.0.path(), name, text.as_bytes())
    }

    fn run(&self, arguments: &[impl AsRef<str>]) -> std::process::Output {
        let out = self.out().display().to_string();
        let arguments: Vec<&str> = arguments.iter().map(AsRef::as_ref).collect();
        insonify(&[&["scene", "from-meshes"], &arguments[..], &["--out", &out, "--force", "--json"]].concat())
    }

    /// Volume of a surface of the scene that the command with `arguments` makes, ml.
    fn ml(&self, arguments: &[impl AsRef<str>], surface: &str) -> f64 {
        let summary = self.summary(arguments);
        let rows = summary["surfaces"].as_array().unwrap();
        let row = rows.iter().find(|row| row["name"] == surface);
        row.unwrap_or_else(|| panic!("no {surface}: {summary:#}"))["mesh_ml"].as_f64().unwrap()
    }

    fn summary(&self, arguments: &[impl AsRef<str>]) -> serde_json::Value {
        serde_json::from_str(&succeeded(&self.run(arguments))).unwrap()
    }

    #[track_caller]
    fn refuses(&self, arguments: &[impl AsRef<str>], words: &[&str]) {
        refused(&self.run(arguments), words);
        assert!(!self.out().exists());
    }
}

const PLACED: [&str; 4] = ["--units", "mm", "--axes", "lps"];
const LIVER_ML: f64 = 1920.0;
const KIDNEY_ML: f64 = 262.5;

fn is_near(a: f64, b: f64) -> bool {
    (a / b - 1.0).abs() < 1e-3
}

#[test]
fn each_mesh_of_a_file_gets_its_own_meaning() {
    let folder = Folder::new();
    let file = folder.file("scene.obj", &organs("g grp0\nusemtl mtl0\n", "g grp1\nusemtl mtl1\n"));
    let with = |words: &[&str]| -> Vec<String> {
        words.iter().map(|word| format!("{file}{word}")).chain(PLACED.map(str::to_owned)).collect()
    };
    folder.refuses(&with(&[""]), &["scene.obj", "`grp0`, `grp1`", "#grp0=liver", "#*=MEANING"]);
    folder.refuses(&with(&["=liver"]), &["2 meshes", "#grp0=liver", "#*=liver"]);
    folder.refuses(&with(&["#grp0=liver"]), &["`grp1` is no known organ"]);
    folder.refuses(&with(&["#grp0=liver", "#grp1"]), &["#grp1=liver"]);
    let both = with(&["#grp0=liver", "#grp1=kidney_right"]);
    assert!(is_near(folder.ml(&both, "liver"), LIVER_ML) && is_near(folder.ml(&both, "kidney_right"), KIDNEY_ML));
}

#[test]
fn materials_of_one_object_that_are_organs_become_two() {
    let folder = Folder::new();
    let file = folder.file("scene.obj", &organs("o abdomen\nusemtl liver\n", "usemtl right_kidney\n"));
    let placed = [&[file.as_str()][..], &PLACED].concat();
    assert!(is_near(folder.ml(&placed, "liver"), LIVER_ML) && is_near(folder.ml(&placed, "kidney_right"), KIDNEY_ML));
    std::fs::remove_file(folder.out()).unwrap();
    folder.refuses(&[&[format!("{file}=liver").as_str()][..], &PLACED].concat(), &["2 meshes", "`right_kidney`"]);
}

#[test]
fn a_comment_that_ends_in_a_backslash_takes_no_vertex() {
    let folder = Folder::new();
    let text = format!("# made in C:\\work\\\n{}", boxes(&[("o liver\n", DVec3::ZERO, DVec3::new(80.0, 60.0, 50.0))]));
    let file = folder.file("in.obj", &text);
    assert!(is_near(folder.ml(&[&[file.as_str()][..], &PLACED].concat(), "liver"), 240.0));
}

#[test]
fn meshes_far_away_are_refused_or_moved_to_the_origin() {
    let folder = Folder::new();
    let far = DVec3::new(0.0, 523_000.0, 0.0);
    let text = boxes(&[("o liver\n", LIVER.0 + far, LIVER.1), ("o kidney_right\n", KIDNEY.0 + far, KIDNEY.1)]);
    let file = folder.file("far.obj", &text);
    let placed = [&[file.as_str()][..], &PLACED].concat();
    folder.refuses(&placed, &["523.1 m from the origin", "--to-origin"]);
    let moved = [&placed[..], &["--to-origin"]].concat();
    assert!(is_near(folder.ml(&moved, "liver"), LIVER_ML));
    assert!(folder.summary(&moved)["remarks"].to_string().contains("moved by"));
    std::fs::remove_file(folder.out()).unwrap();
    // Files of two frames.
    let near = folder.file("near.obj", &boxes(&[("o spleen\n", DVec3::ZERO, DVec3::splat(100.0))]));
    folder.refuses(&[&[near.as_str()][..], &placed].concat(), &["lie far apart", "same frame"]);
}

#[test]
fn inches_are_asked_about_and_read() {
    let folder = Folder::new();
    let inch = |v: DVec3| v / 25.4;
    let (liver, kidney) = ("o liver\n", "o kidney_right\n");
    let text = boxes(&[(liver, inch(LIVER.0), inch(LIVER.1)), (kidney, inch(KIDNEY.0), inch(KIDNEY.1))]);
    let file = folder.file("inches.obj", &text);
    folder.refuses(&[&file, "--axes", "lps"], &["inches", "in cm, that of a small child", "--units in"]);
    assert!(is_near(folder.ml(&[&file, "--axes", "lps", "--units", "in"], "liver"), LIVER_ML));
    let stated = folder.file("stated.obj", &format!("# Units: inches\n{text}"));
    assert!(is_near(folder.ml(&[&stated, "--axes", "lps"], "liver"), LIVER_ML));
    std::fs::remove_file(folder.out()).unwrap();
    let both = folder.file("both.obj", &format!("# Units: inches\n# units=mm\n{text}"));
    folder.refuses(&[&both, "--axes", "lps"], &["`Units: inches` and `units=mm`", "--units"]);
}

#[test]
fn a_file_in_another_unit_and_axes_that_organs_contradict_are_told() {
    let folder = Folder::new();
    let text = boxes(&[("o liver\n", LIVER.0, LIVER.1), ("o kidney_right\n", KIDNEY.0 / 1000.0, KIDNEY.1 / 1000.0)]);
    let file = folder.file("mixed.obj", &text);
    folder.refuses(&[&[file.as_str()][..], &PLACED].concat(), &["`kidney_right` is 0.1 mm long", "70 to 180 mm"]);
    let ras = |v: DVec3| DVec3::new(-v.x, -v.y, v.z);
    let at = |low: DVec3, size: DVec3| (ras(low).min(ras(low + size)), size);
    let left = (DVec3::new(60.0, 60.0, -90.0), KIDNEY.1);
    let [(a, b), (c, d), (e, f)] = [LIVER, KIDNEY, left].map(|(low, size)| at(low, size));
    let organs = [("o liver\n", a, b), ("o kidney_right\n", c, d), ("o kidney_left\n", e, f)];
    let file = folder.file("ras.obj", &format!("# SPACE=LPS\n{}", boxes(&organs)));
    folder.refuses(&[&file], &["`kidney_left` is to the left of `kidney_right`", "--axes ras", "--axes lps"]);
    let remarks = folder.summary(&[&file, "--axes", "lps"])["remarks"].to_string();
    assert!(remarks.contains("the axes may be wrong"), "{remarks}");
    let remarks = folder.summary(&[&file, "--axes", "ras"])["remarks"].to_string();
    assert!(!remarks.contains("the axes may be wrong"), "{remarks}");
}

#[test]
fn mirrored_meshes_that_fit_no_axes_are_refused() {
    let folder = Folder::new();
    let mirrored = |low: DVec3, size: DVec3| (DVec3::new(-low.x - size.x, low.y, low.z), size);
    let left = (DVec3::new(40.0, 60.0, -90.0), KIDNEY.1);
    let gallbladder = (DVec3::new(-60.0, -110.0, -20.0), DVec3::new(30.0, 30.0, 40.0));
    let [(a, b), (c, d), (e, f), (g, h)] = [LIVER, KIDNEY, left, gallbladder].map(|(low, size)| mirrored(low, size));
    let organs =
        [("o liver\n", a, b), ("o kidney_right\n", c, d), ("o kidney_left\n", e, f), ("o gallbladder\n", g, h)];
    let file = folder.file("mirror.obj", &boxes(&organs));
    folder.refuses(&[&file, "--units", "mm"], &["front and back are exchanged", "mirrored", "--axes ras"]);
    assert!(folder.summary(&[&file, "--units", "mm", "--axes", "ras"])["remarks"].is_array());
}

#[test]
fn organs_that_are_there_twice_or_in_pieces_are_told() {
    let folder = Folder::new();
    let one = folder.file("one.obj", &boxes(&[("", LIVER.0, LIVER.1)]));
    let other = folder.file("other.obj", &boxes(&[("", LIVER.0, LIVER.1)]));
    let pieces = folder.file("pieces.obj", &boxes(&[("", KIDNEY.0, KIDNEY.1), ("", KIDNEY.0 + 100.0, KIDNEY.1)]));
    let words = [format!("{one}=liver"), format!("{other}=liver"), format!("{pieces}=kidney_right")];
    let all: Vec<&str> = words.iter().map(String::as_str).chain(PLACED).collect();
    let remarks = folder.summary(&all)["remarks"].to_string();
    for says in
        ["one mesh may be there twice", "this one is called `liver_2`", "`kidney_right` has 2 separate pieces (262.5"]
    {
        assert!(remarks.contains(says), "`{says}`: {remarks}");
    }
    let stated = folder.file("stated.obj", &format!("# SPACE=LPS\n{}", boxes(&[("", LIVER.0, LIVER.1)])));
    let words = [format!("{stated}=liver"), format!("{pieces}=kidney_right")];
    let remarks = folder.summary(&words)["remarks"].to_string();
    assert!(remarks.contains("pieces.obj states no axes: taken in lps, as the others"), "{remarks}");
    let path = Path::new(&one);
    std::fs::remove_file(folder.out()).unwrap();
    folder.refuses(
        &[&[format!("{}#a=liver", path.display()).as_str()][..], &PLACED].concat(),
        &["one.obj has no mesh `a`", "it has one"],
    );
}
