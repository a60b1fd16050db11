//! The self-test passes on this device, and detects damaged shaders.

use insonify::render::{Backend, BackendChoice, ShaderSet, TestHooks};
use insonify::selftest::{self, Report};

use super::bench::backend;

/// Report of the self-test with these shaders on a device, up to the first failing check of `group`.
fn report(shaders: ShaderSet, group: &str) -> Report {
    let device = Backend::open(BackendChoice::Device).unwrap();
    selftest::run_with_hooks(&device, &TestHooks { shaders, ..TestHooks::default() }, Some(group), &|_, _| {}).unwrap()
}

fn print(report: &Report) {
    for c in &report.checks {
        let result = if c.passed { "pass" } else { "FAIL" };
        println!(
            "{result} {:14} {:55} {:.6} measured {:.6} ± {:.6}",
            c.group, c.name, c.expected, c.measured, c.tolerance
        );
    }
    println!("{:.1} s", report.duration_s);
}

#[test]
fn a_sound_device_passes() {
    let report = selftest::run(backend(), &|_, _| {}).unwrap();
    print(&report);
    assert!(report.passed, "{:#?}", report.failed().collect::<Vec<_>>());
    assert!(!report.device.is_empty() && report.date.ends_with('Z'));
}

/// Damage: its name, the pass, the source text and its replacement, and the group of checks that must fail.
type Damage = (&'static str, &'static str, &'static str, &'static str, &'static str);

const DAMAGES: [Damage; 26] = [
    ("sign of the echoes' phase", "echo", "phasor(-params", "phasor(params", "Time of flight"),
    ("sign of the speckle's phase", "march", "phasor(-params", "phasor(params", "Speckle"),
    (
        "carrier f/c in place of 2f/c",
        "march",
        "-params.phase_turns_per_mm",
        "-0.5 * params.phase_turns_per_mm",
        "Speckle",
    ),
    (
        "one-way decay of echoes",
        "trace",
        "exp(max(ln_arriving, LN_SILENT))",
        "exp(max(0.5 * ln_arriving, LN_SILENT))",
        "Attenuation",
    ),
    (
        "one-way decay of speckle",
        "trace",
        "let fall = tissue.attenuation_np_mm",
        "let fall = 0.5 * tissue.attenuation_np_mm",
        "Attenuation",
    ),
    ("missing cosine", "trace", "let b = z1 * cos_transmitted;", "let b = z1;", "Fresnel"),
    ("an echo without R", "trace", "echo = at_facet.pressure_reflection * ", "echo = ", "Fresnel"),
    (
        "Snell upside down",
        "trace",
        "let sin2_transmitted = speed_ratio * speed_ratio * sin2_incident;",
        "let sin2_transmitted = sin2_incident / (speed_ratio * speed_ratio);",
        "Snell",
    ),
    ("sound speed ignored", "trace", "let passed_mm = t / path_per_range", "let passed_mm = t", "Time of flight"),
    (
        "pulse of half the step",
        "detect",
        "= tap(index + i);",
        "= tap(2 * (index + i) - half - PULSE_PAD);",
        "Point spread",
    ),
    ("beam of one depth everywhere", "lateral", "let block = first >> BLOCK_SHIFT;", "let block = 0u;", "Point spread"),
    ("paths all in the plane", "trace", "vec3<f32>(0.0, elevation.y, 0.0)", "vec3<f32>(0.0)", "Point spread"),
    (
        "a texture that repeats every 9.6 mm",
        "march",
        "let bits = lattice_hash(cell)",
        "let bits = lattice_hash(cell & vec3<i32>(63))",
        "Speckle",
    ),
    (
        "a texture that repeats sideways only",
        "march",
        "let bits = lattice_hash(cell)",
        "let bits = lattice_hash(cell & vec3<i32>(63, -1, -1))",
        "Speckle",
    ),
    ("sheets of scatterers of one weight", "march", "let weight = bell * bell;", "let weight = 1.0;", "Speckle"),
    ("beams that only send", "beams", "dot(sent, sent) * dot(heard, heard)", "dot(sent, sent)", "Shadow"),
    ("beams that don't bend", "transmission", "(value.y - middle_mm)", "(0.0 * middle_mm)", "Full wave"),
    ("half of the delays", "transmission", "(value.y - middle_mm)", "0.5 * (value.y - middle_mm)", "Bent beams"),
    ("delays ignored behind a face", "trace", "let passed_mm = t / path_per_range", "let passed_mm = t", "Full wave"),
    (
        "a face that is coupled everywhere",
        "trace",
        "let coupling = couplings[path];",
        "let coupling = max(couplings[path], 1.0);",
        "Contact",
    ),
    ("sheets of one weight after a slide", "march", "let weight = bell * bell;", "let weight = 1.0;", "Slide"),
    ("no gain", "detect", "+ image_gain_db()", "", "Image"),
    ("no sliders", "detect", "+ vec4<f32>(slider_db", "+ 0.0 * vec4<f32>(slider_db", "Twin"),
    ("half of the TGC", "detect", "params.tgc_db_per_mm *", "0.5 * params.tgc_db_per_mm *", "Image"),
    (
        "one-way shadow",
        "trace",
        "ln_amplitude -= tissue.attenuation_np_mm * t",
        "ln_amplitude -= 0.5 * tissue.attenuation_np_mm * t",
        "Shadow",
    ),
    (
        "a buffer that keeps the last frame",
        "march",
        "vec4<f32>(0.0), begins)",
        "0.5 * baseband[at], begins)",
        "Determinism",
    ),
];

#[test]
fn each_damage_is_identified() {
    let mut missed = Vec::new();
    for (what, pass, from, to, group) in DAMAGES {
        let mut shaders = ShaderSet::default();
        assert!(shaders.replace(pass, from, to), "{pass} has no `{from}` to damage ({what})");
        let report = report(shaders, group);
        let failed: Vec<_> = report.failed().map(|c| format!("{}: {} ({})", c.group, c.name, c.measured)).collect();
        println!("{what}, {:.1} s: {failed:#?}", report.duration_s);
        if !report.failed().any(|check| check.group == group) {
            missed.push((what, group));
        }
    }
    assert!(missed.is_empty(), "not named: {missed:#?}");
}
