//! Hard cases of grazing, critical and normal incidence.

use glam::{DQuat, DVec2, DVec3};
use insonify::acoustics::interface::interface;
use insonify::render::ShaderSet;
use insonify::selftest::bench::{Bench, at, facing, linear, silent, small};

use super::common::{ROUNDING, Tolerance, assert_pass_contains, holds, renderer, row};

/// Cosine of the angle of refraction by the textbook formula.
fn naive(ratio: f32, cos: f32) -> f32 {
    (1.0 - ratio * ratio * (1.0 - cos * cos)).sqrt()
}

/// Lines of the shader that [`shipped`] copies.
const SHIPPED: [&str; 5] = [
    "let sin2_incident = max((1.0 - cos_incident) * (1.0 + cos_incident), 0.0);",
    "let sin2_transmitted = speed_ratio * speed_ratio * sin2_incident;",
    "if sin2_transmitted >= 1.0 {",
    "return Interface(1.0, 1.0, 0.0);",
    "let cos_transmitted = sqrt(max(1.0 - sin2_transmitted, 0.0));",
];

/// Cosine of the angle of refraction as in `crates/render/shaders/shared/interface.wgsl`.
fn shipped(ratio: f32, cos: f32) -> f32 {
    let sin2 = ((1.0 - cos) * (1.0 + cos)).max(0.0);
    let sin2_transmitted = ratio * ratio * sin2;
    if sin2_transmitted >= 1.0 { 0.0 } else { (1.0 - sin2_transmitted).max(0.0).sqrt() }
}

#[test]
fn beyond_the_critical_angle_the_cosine_is_nan() {
    assert_pass_contains("trace", &SHIPPED);
    let ratio = 4080.0 / 1480.0;
    let cosines: Vec<f32> = (0..=1000).map(|i| i as f32 / 1000.0).collect();
    let lost = cosines.iter().filter(|&&c| naive(ratio, c).is_nan()).count();
    let worst = cosines.iter().map(|&c| {
        let exact = interface(1.48, 7.8, 1.0, f64::from(ratio), f64::from(c)).cos_transmitted;
        let got = f64::from(shipped(ratio, c));
        assert!((0.0..=1.0).contains(&got));
        (got - exact).abs()
    });
    let worst = worst.fold(0.0, f64::max);
    assert!(lost > 900 && worst < 1e-3, "{lost} {worst}");
    row(
        "water to bone beyond 21.27°",
        format!("cosθₜ is NaN at {lost} of {} angles", cosines.len()),
        "compare sin²θₜ with 1 before the root; R = 1",
        format!("cosθₜ within {worst:.0e}"),
    );
}

#[test]
fn near_normal_incidence_one_minus_a_square_loses_its_digits() {
    assert_pass_contains("trace", &SHIPPED);
    let (mut naive, mut shipped) = (0.0_f64, 0.0_f64);
    for i in 1..=1000 {
        // Steps of a hundredth of a degree.
        let cos = (f64::from(i) * 1e-4).cos() as f32;
        let exact = (1.0 - f64::from(cos)) * (1.0 + f64::from(cos));
        if exact > 0.0 {
            naive = naive.max((f64::from(1.0 - cos * cos) / exact - 1.0).abs());
            shipped = shipped.max((f64::from((1.0 - cos) * (1.0 + cos)) / exact - 1.0).abs());
        }
    }
    assert!(naive > 5e-5 && shipped < 2e-7, "{naive} {shipped}");
    row(
        "sin²θ within 6° of the normal",
        format!("1 − cos²θ is off by {naive:.0e} of it"),
        "(1 − cosθ)(1 + cosθ)",
        format!("{shipped:.0e} of it"),
    );
}

#[test]
fn plates_at_any_angle_match_the_twin() {
    // Water to bone is total from 21.2672°; then grazing, and a ray in the plate's face.
    let critical = (1480.0_f64 / 4080.0).asin().to_degrees();
    let angles = [
        0.0,
        critical - 1e-3,
        critical - 1e-6,
        critical,
        critical + 1e-6,
        45.0,
        80.0,
        89.0,
        89.9,
        89.99,
        89.9999,
        90.0,
    ];
    let mut bench = Bench::new(silent(1480.0, 1.48));
    let bone = bench.tissue(silent(4080.0, 7.8));
    let place = |i: usize| DVec2::new(90.0 * (i % 4) as f64, 90.0 * (i / 4) as f64);
    for (i, degrees) in angles.into_iter().enumerate() {
        let point: DVec3 = place(i).extend(20.01);
        bench.add(bone, 1, facing(point, 30.0, DQuat::from_rotation_y(f64::to_radians(degrees))));
    }
    let scene = bench.scene().unwrap();
    let mut renderer = renderer(&scene, &linear(9, 0.5, 256, 60.0), &small(2, 1), &ShaderSet::default());
    for (i, degrees) in angles.into_iter().enumerate() {
        // At 90° the face is a line of pixels that rounding assigns to either side; at the critical angle chance does.
        let tie = degrees == 90.0 || (degrees - critical).abs() < 1e-5;
        let tolerance = if tie { Tolerance { grey: 20.0, other: 0.15 } } else { ROUNDING };
        holds(&format!("plate under {degrees}°"), &mut renderer, &at(place(i).x, place(i).y, 0.0), tolerance);
    }
}
