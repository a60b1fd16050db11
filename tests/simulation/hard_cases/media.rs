//! Hard cases of media: impedances of 0.0004 next to 7.8 MRayl, and attenuation beyond the range of f32.

use insonify::acoustics::decibel::NEPER_PER_DB;
use insonify::acoustics::interface::interface;
use insonify::anatomy::Tissue;
use insonify::render::ShaderSet;
use insonify::selftest::bench::{Bench, at, grainy, linear, silent, small};
use insonify::selftest::measure::magnitude;

use super::common::{ROUNDING, Tolerance, frame, holds, renderer, row};

fn slab(x: f64, half: f64, top: f64, bottom: f64) -> insonify::anatomy::Mesh {
    insonify::selftest::bench::slab(glam::DVec2::new(x, 0.0), half, top, bottom)
}

#[test]
fn air_against_bone_is_a_mirror_from_both_sides() {
    let mut bench = Bench::new(silent(343.0, 0.0004));
    let bone = bench.tissue(silent(4080.0, 7.8));
    bench.add(bone, 1, slab(0.0, 20.0, 10.03, 30.02));
    let mut renderer =
        renderer(&bench.scene().unwrap(), &linear(9, 0.5, 1024, 60.0), &small(1, 1), &ShaderSet::default());
    for z in [9.0, 20.0] {
        let s = holds(
            &format!("air and bone, from {z} mm"),
            &mut renderer,
            &at(0.1, 0.2, z),
            Tolerance { grey: 3.0, other: 0.005 },
        );
        let (z1, z2) = if z < 10.0 { (0.0004, 7.8) } else { (7.8, 0.0004) };
        let want = interface(z1, z2, 1.0, 1.0, 1.0).pressure_reflection.abs();
        for path in &s.paths {
            let echo = path.segments[1].echo.abs();
            assert!((echo / want - 1.0).abs() < 1e-5, "{echo} {want}");
        }
    }
}

#[test]
fn levels_below_the_range_of_f32_are_kept_as_logarithms() {
    // 20 dB/cm at 8 MHz in steps of a mm, two-way, over 60 mm; then the TGC compensates it.
    let rate_db_mm = 2.0 * 20.0 * 8.0 / 10.0;
    let (mut product, mut sum) = (1.0_f32, 0.0_f32);
    let (mut first_lost, mut worst) = (None, 0.0_f64);
    for mm in 1..=60 {
        product *= 10f32.powf(-(rate_db_mm as f32) / 20.0);
        sum += (rate_db_mm * NEPER_PER_DB) as f32;
        let exact_db = -rate_db_mm * f64::from(mm);
        if !(20.0 * product.log10()).is_finite() {
            first_lost.get_or_insert(mm);
        }
        worst = worst.max((-f64::from(sum) / NEPER_PER_DB - exact_db).abs());
    }
    let lost = first_lost.unwrap();
    assert!(worst < 1e-2, "{worst}");
    row(
        "160 dB/cm one-way",
        format!("a product of amplitudes is 0 from {lost} mm on, its level −∞ dB"),
        "sum nepers, exponentiate once, silence below 10⁻³⁴",
        format!("{worst:.0e} dB at {:.0} dB", -rate_db_mm * 60.0),
    );
}

#[test]
fn a_totally_absorbing_medium_is_black_and_finite() {
    let mut bench = Bench::new(silent(1540.0, 1.5));
    let black = Tissue { attenuation_db_cm_mhz: 100.0, attenuation_exponent: 2.0, ..grainy(0.01, 0.1) };
    let black = bench.tissue(black);
    let wall = bench.tissue(silent(1540.0, 7.0));
    let faint = bench.tissue(Tissue { attenuation_db_cm_mhz: 5.0, ..silent(1540.0, 1.6) });
    let plate = bench.tissue(silent(1540.0, 1.8));
    bench.add(black, 1, slab(0.0, 40.0, -5.0, 500.0));
    bench.add(wall, 2, slab(0.0, 30.0, 40.0, 50.0));
    bench.add(faint, 1, slab(100.0, 40.0, -5.0, 500.0));
    bench.add(plate, 2, slab(100.0, 30.0, 27.0, 50.0));
    let scene = bench.scene().unwrap();
    let probe = insonify::transducer::Probe { frequency_mhz: 40.0, ..linear(9, 0.5, 512, 500.0) };
    let mut renderer = renderer(&scene, &probe, &small(1, 3), &ShaderSet::default());
    holds("160,000 dB/cm", &mut renderer, &at(0.0, 0.0, 0.0), ROUNDING);
    let deep = frame(&mut renderer, &at(0.0, 0.0, 1.0));
    assert_eq!(deep.lines.len(), 9 * 512);
    assert!(deep.lines.chunks(512).all(|line| line[16..].iter().all(|&s| magnitude(s) == 0.0)));

    // A plate at −216 dB is still exact.
    let probe = linear(9, 0.5, 512, 50.0);
    renderer.reconfigure(&probe, &small(1, 1)).unwrap();
    let s = holds("a plate at −216 dB", &mut renderer, &at(100.0, 0.0, 0.0), ROUNDING);
    let want = interface(1.6, 1.8, 1.0, 1.0, 1.0).pressure_reflection * 10f64.powf(-2.0 * 5.0 * 8.0 * 2.7 / 20.0);
    assert_eq!(s.paths.len(), 9);
    for path in &s.paths {
        let got = path.segments[1].echo;
        assert!((got / want - 1.0).abs() < 1e-4, "{got} {want}");
    }
}
