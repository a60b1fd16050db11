//! Hard cases of the phase of deep echoes, and of small angles of a fan.

use std::f64::consts::TAU;

use super::common::{assert_pass_contains, row};
use insonify::random::SplitMix64;

/// Lines of the shader that [`shipped`] copies.
const SHIPPED: [&str; 7] = [
    "let within = turns - round(turns);",
    "let halves = round(2.0 * within);",
    "let r = within - 0.5 * halves;",
    "let u = r * r;",
    "let c = 0.99999994 + u * (-19.739172 + u * (64.93459 + u * (-85.240326 + u * 56.242363)));",
    "let s = r * (6.283185 + u * (-41.341656 + u * (81.601006 + u * (-76.54978 + u * 39.536697))));",
    "return vec2<f32>(c, s) * (1.0 - 2.0 * abs(halves));",
];

/// `phasor` as in `crates/render/shaders/shared/phasor.wgsl`.
#[allow(clippy::approx_constant, reason = "the shader's own digits")]
fn shipped(turns: f32) -> [f32; 2] {
    let within = turns - turns.round_ties_even();
    let halves = (2.0 * within).round_ties_even();
    let r = within - 0.5 * halves;
    let u = r * r;
    let c = 0.99999994 + u * (-19.739172 + u * (64.93459 + u * (-85.240326 + u * 56.242363)));
    let s = r * (6.283185 + u * (-41.341656 + u * (81.601006 + u * (-76.54978 + u * 39.536697))));
    let sign = 1.0 - 2.0 * halves.abs();
    [c * sign, s * sign]
}

#[test]
fn a_carrier_of_thousands_of_turns_keeps_its_phase() {
    for pass in ["march", "echo"] {
        assert_pass_contains(pass, &SHIPPED);
    }
    let mut random = SplitMix64::new(2);
    let (mut naive, mut kept) = (0.0_f64, 0.0_f64);
    for _ in 0..100_000 {
        // 500 mm at 40 MHz are 26,000 turns.
        let turns = random.between(-26_000.0, 26_000.0) as f32;
        let exact = TAU * (f64::from(turns) - f64::from(turns).round());
        let off = |[c, s]: [f32; 2]| (f64::from(c) - exact.cos()).hypot(f64::from(s) - exact.sin());
        let angle = std::f32::consts::TAU * turns;
        naive = naive.max(off([angle.cos(), angle.sin()]));
        kept = kept.max(off(shipped(turns)));
    }
    assert!(naive > 5e-3 && kept < 1e-6, "{naive} {kept}");
    row(
        "phase after 26,000 turns (500 mm at 40 MHz)",
        format!("sin and cos of 2π·turns are off by {naive:.0e}"),
        "take whole turns off first, then polynomials of our own",
        format!("{kept:.0e}"),
    );
}

#[test]
fn small_angles_keep_the_faces_curvature() {
    let (mut naive, mut kept) = (0.0_f64, 0.0_f64);
    for i in 1..=1024 {
        // Half of a field of view of 0.1°.
        let angle = (0.05_f64.to_radians() * f64::from(i) / 1024.0) as f32;
        let (radius, wide) = (40.0_f32, f64::from(angle));
        let exact = -2.0 * 40.0 * (0.5 * wide).sin().powi(2);
        naive = naive.max((f64::from(radius * (angle.cos() - 1.0)) / exact - 1.0).abs());
        kept = kept.max((f64::from(-2.0 * radius * (0.5 * angle).sin().powi(2)) / exact - 1.0).abs());
    }
    assert!(naive >= 0.9 && kept < 1e-6, "{naive} {kept}");
    row(
        "curvature of a face within 0.1°",
        format!("r·(cosφ − 1) is off by {:.0} %", 100.0 * naive),
        "−2r·sin²(φ/2), in f64",
        format!("{kept:.0e} of it in f32, nothing in f64"),
    );
}
