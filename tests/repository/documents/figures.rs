//! Tests of `scripts/figures`: tables agree with their data, and an interrupted measurement is resumed.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use tempfile::TempDir;

/// Stand-in for `insonify render` that logs its arguments. If the file `interrupt` exists, it interrupts the
/// measurement at HQ; if `fail` exists, it fails there.
const PROGRAM: &str = r#"#!/bin/sh
here=$(dirname "$0")
echo "$@" >> "$here/calls"
case "$*" in *"--quality hq"*)
    if [ -e "$here/interrupt" ]; then kill -INT $PPID; exec sleep 600; fi
    if [ -e "$here/fail" ]; then echo "the disk is full" >&2; exit 3; fi
esac
"#;

const PAGE: &str = "# Performance\n\n<!-- figure: memory -->\n<!-- /figure -->\n";

/// Name of the Python that the tests use.
pub(crate) fn python() -> String {
    std::env::var("INSONIFY_PYTHON").unwrap_or_else(|_| "python3".into())
}

fn figures(root: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(python());
    command.arg(super::root().join("scripts/figures")).arg("--root").arg(root).args(arguments);
    command.output().expect("scripts/figures needs python3")
}

/// A checkout with a document, a commit and a program.
struct Checkout {
    root: TempDir,
    bin: TempDir,
}

impl Checkout {
    fn new() -> Self {
        let checkout = Self { root: TempDir::new().unwrap(), bin: TempDir::new().unwrap() };
        let root = checkout.root.path();
        fs::create_dir_all(root.join("src")).unwrap();
        fs::create_dir_all(root.join("docs")).unwrap();
        fs::write(root.join("src/lib.rs"), "").unwrap();
        fs::write(root.join("docs/performance.md"), PAGE).unwrap();
        fs::write(checkout.program(), PROGRAM).unwrap();
        fs::set_permissions(checkout.program(), fs::Permissions::from_mode(0o755)).unwrap();
        checkout.git(&["init", "-q"]);
        checkout.commit("first");
        checkout
    }

    fn git(&self, arguments: &[&str]) {
        let user = ["-c", "user.name=test", "-c", "user.email=test@localhost", "-c", "commit.gpgsign=false"];
        let done = Command::new("git").args(user).args(arguments).current_dir(self.root.path()).output().unwrap();
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    }

    fn commit(&self, message: &str) {
        self.git(&["add", "."]);
        self.git(&["commit", "-q", "-m", message]);
    }

    fn program(&self) -> PathBuf {
        self.bin.path().join("fake")
    }

    fn page(&self) -> PathBuf {
        self.root.path().join("docs/performance.md")
    }

    /// Runs a measurement; returns the exit code and the messages.
    fn measure(&self, name: &str) -> (Option<i32>, String) {
        let program = self.program();
        let output = figures(self.root.path(), &[name, "--program", program.to_str().unwrap()]);
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    }

    /// Calls of the program since the last call of this function, by quality.
    fn calls(&self) -> Vec<&'static str> {
        let path = self.bin.path().join("calls");
        let text = fs::read_to_string(&path).unwrap_or_default();
        fs::write(path, "").unwrap();
        text.lines().map(|line| if line.contains("--quality hq") { "hq" } else { "lq" }).collect()
    }

    fn flag(&self, name: &str, on: bool) {
        let path = self.bin.path().join(name);
        if on { fs::write(path, "").unwrap() } else { fs::remove_file(path).unwrap() }
    }

    fn data(&self) -> Option<serde_json::Value> {
        let text = fs::read_to_string(self.root.path().join("docs/figures/memory.json")).ok()?;
        Some(serde_json::from_str(&text).unwrap())
    }

    fn check(&self) -> (Option<i32>, String) {
        let output = figures(self.root.path(), &["--check"]);
        (output.status.code(), String::from_utf8_lossy(&output.stdout).into_owned())
    }
}

#[test]
fn every_table_is_as_its_data() {
    let output = figures(super::root(), &["--check"]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stdout));
}

#[test]
fn an_interrupted_measuring_goes_on_where_it_was() {
    let checkout = Checkout::new();
    checkout.flag("interrupt", true);
    let (code, said) = checkout.measure("memory");
    assert_eq!(code, Some(130), "{said}");
    assert_eq!((checkout.calls(), checkout.data()), (vec!["lq", "hq"], None));
    let listed = String::from_utf8(figures(checkout.root.path(), &[]).stdout).unwrap();
    assert!(listed.lines().any(|line| line.starts_with("memory") && line.contains("steps kept: 1")), "{listed}");

    checkout.flag("interrupt", false);
    let (code, said) = checkout.measure("memory");
    assert_eq!((code, checkout.calls()), (Some(0), vec!["hq"]), "{said}");
    let data = checkout.data().unwrap();
    assert_eq!(data["rows"].as_array().unwrap().len(), 2);
    assert!(data["rows"][0]["peak_mb"].as_f64().unwrap() > 0.0, "{data}");
    assert_eq!(
        data["steps"][1]["command"],
        "insonify render configs/obstetric.toml --quality hq --out out/figures/memory/hq/frame"
    );
    for key in ["commit", "date", "machine", "command"] {
        assert!(!data[key].is_null(), "{key}: {data}");
    }
    let page = fs::read_to_string(checkout.page()).unwrap();
    assert!(page.contains("| LQ | ") && page.contains(data["commit"].as_str().unwrap()), "{page}");
    assert_eq!(checkout.check().0, Some(0));

    // A figure that is complete is measured anew.
    assert_eq!(checkout.measure("memory").0, Some(0));
    assert_eq!(checkout.calls(), ["lq", "hq"]);
}

#[test]
fn steps_of_another_build_are_measured_again() {
    let checkout = Checkout::new();
    checkout.flag("interrupt", true);
    assert_eq!(checkout.measure("memory").0, Some(130));
    checkout.calls();
    checkout.flag("interrupt", false);
    fs::write(checkout.program(), format!("{PROGRAM}# another build\n")).unwrap();
    assert_eq!(checkout.measure("memory").0, Some(0));
    assert_eq!(checkout.calls(), ["lq", "hq"]);
    // A commit of documents alone keeps what was measured.
    checkout.flag("interrupt", true);
    assert_eq!(checkout.measure("memory").0, Some(130));
    checkout.commit("figures");
    checkout.flag("interrupt", false);
    checkout.calls();
    assert_eq!((checkout.measure("memory").0, checkout.calls()), (Some(0), vec!["hq"]));
}

#[test]
fn a_failed_step_says_why_and_keeps_the_others() {
    let checkout = Checkout::new();
    checkout.flag("fail", true);
    let (code, said) = checkout.measure("memory");
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("hq: exit code 3") && said.contains("the disk is full"), "{said}");
    checkout.flag("fail", false);
    checkout.calls();
    assert_eq!((checkout.measure("memory").0, checkout.calls()), (Some(0), vec!["hq"]));
}

#[test]
fn wrong_names_and_uncommitted_code_are_refused() {
    let checkout = Checkout::new();
    let (code, said) = checkout.measure("memry");
    assert!(code == Some(2) && said.contains("did you mean memory?"), "{said}");
    fs::write(checkout.root.path().join("src/lib.rs"), "// changed").unwrap();
    let (code, said) = checkout.measure("memory");
    assert!(code == Some(2) && said.contains("src/lib.rs"), "{said}");
    assert!(checkout.calls().is_empty());
    assert_eq!(figures(checkout.root.path(), &["--check", "--render"]).status.code(), Some(2));
}

#[test]
fn tables_that_differ_from_their_data_are_found() {
    let checkout = Checkout::new();
    assert_eq!(checkout.measure("memory").0, Some(0));
    let right = fs::read_to_string(checkout.page()).unwrap();
    let broken = [
        (right.replace("| LQ | ", "| LQ | 9"), "differs from its data"),
        (right.replace("<!-- /figure -->", ""), "has no end"),
        (right.replace("<!-- figure: memory -->", ""), "ends no figure"),
        (right.replace("figure: memory", "figure: memories"), "no table is named memories"),
        (right.replace("figure: memory", "figure: looks"), "the figure looks has no data"),
        (format!("{right}<!-- figure: memory -->\n<!-- figure: memory -->\n<!-- /figure -->\n"), "before the end"),
        ("# Performance\n".to_owned(), "shown nowhere"),
    ];
    for (page, reason) in broken {
        fs::write(checkout.page(), &page).unwrap();
        let (code, said) = checkout.check();
        assert!(code == Some(1) && said.contains(reason), "{reason}: {said}");
    }
    fs::write(checkout.page(), right.replace("| LQ | ", "| LQ | 9")).unwrap();
    assert_eq!(figures(checkout.root.path(), &["--render"]).status.code(), Some(0));
    assert_eq!(fs::read_to_string(checkout.page()).unwrap(), right);
}

/// Markdown of the table `name` for `data`, a Python expression.
fn rendered(name: &str, data: &str) -> String {
    let code = format!("from measuring import tables\nprint(tables.{name}({data}))");
    let output = Command::new("python3").arg("-c").arg(code).env("PYTHONPATH", super::root().join("scripts")).output();
    let output = output.expect("python3");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Data of a trade-off with four points: name, generator, p95, seen error. The effects are compared with theory
/// twice.
fn tradeoff_data(translated: f64) -> String {
    let point = |name: &str, generator: &str, ms: f64, seen: f64| {
        format!(
            "dict(name='{name}', generator={generator}, all_effects=False, median_ms={ms}, p95_ms={ms}, seen={seen}, levels={seen}, texture=1.0)"
        )
    };
    let points = [
        point("1x1", "None", 27.0, 29.0),
        point("4x3 9 rolling angles", "None", 57.0, 10.79),
        point("4x3 of 9 angles + beam_m_rolling", "'beam_m_rolling'", 62.0, translated),
        point("8x3 9 rolling angles", "None", 75.0, 9.5),
    ];
    let effect = "{'name': 'aperture', 'without': 9.3, 'with': 1.5, 'cost_ms': [10.4, 0.5]}";
    let reference = "dict(rays=64, rays_change=1.0, layers_compared=5, layers=3, layers_change=0.2, converged=True)";
    let machine = "machine=dict(processor='P', cores=2), commit='c', date='d', command='insonify tradeoff'";
    format!("dict(rows=[{}], effects=[{effect}] * 2, reference={reference}, {machine})", points.join(", "))
}

#[test]
fn a_generator_is_preferred_by_the_seen_error_and_stands_in_the_table() {
    let data = tradeoff_data(10.92);
    let said = rendered("tradeoff_summary", &data);
    assert!(said.contains("the best point is 4 × 3, 9 rolling (10.8 grey levels)"), "{said}");
    assert!(said.contains("with a generator is 4 × 3, 9 rolling + `beam_m_rolling` (10.9 grey levels)"), "{said}");
    let table = rendered("tradeoff", &data);
    assert!(table.contains("| 4 × 3, 9 rolling + `beam_m_rolling` | 62.0 |"), "{table}");

    let said = rendered("tradeoff_summary", &tradeoff_data(9.9));
    assert!(said.contains("the best point is 4 × 3, 9 rolling + `beam_m_rolling` (9.9 grey levels)"), "{said}");
    assert!(said.contains("The best without a generator is 4 × 3, 9 rolling (10.8 grey levels)"), "{said}");
}

#[test]
fn an_effect_that_is_compared_twice_is_listed_once() {
    let said = rendered("points", &tradeoff_data(10.0));
    assert_eq!(said.matches("`aperture` 10.4 ms").count(), 1, "{said}");
}
