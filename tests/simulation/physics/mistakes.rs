//! Tests named after known mistakes of other simulators; each fails if the renderer makes that mistake.

use insonify::anatomy::{Scene, Tissue};
use insonify::render::Frame;

use super::bench::{Bench, Rig, assert_part, at, linear, magnitude, silent, slab, small};

/// Speckle of this deviation down to 20 mm, where a plate of `impedance_mrayl` begins.
fn layered(deviation: f64, impedance_mrayl: f64) -> Scene {
    let grain = Tissue {
        scatterer_density: if deviation > 0.0 { 1.0 } else { 0.0 },
        scatterer_deviation: deviation,
        ..silent(1540.0, 1.6)
    };
    let mut bench = Bench::new(grain);
    let plate = bench.tissue(silent(1540.0, impedance_mrayl));
    bench.add(plate, 1, slab(0.0, 40.0, 20.0, 80.0));
    bench.scene().unwrap()
}

#[test]
fn an_interface_echo_adds_to_its_sample() {
    let probe = linear(32, 0.5, 1024, 40.0);
    let frame = |deviation, z| Rig::new(&layered(deviation, z), &probe, &small(1, 1)).frame(&at(0.0, 0.0, 0.0));
    let (both, grain, plate) = (frame(0.05, 1.7), frame(0.05, 1.6), frame(0.0, 1.7));
    let mut both_differ = 0;
    for ((b, g), p) in both.lines.iter().zip(&grain.lines).zip(&plate.lines) {
        assert!((0..2).all(|i| (b[i] - g[i] - p[i]).abs() < 1e-6), "{b:?} {g:?} {p:?}");
        both_differ += usize::from(magnitude(*g) > 1e-3 && magnitude(*p) > 1e-3);
    }
    assert!(both_differ > 100);
}

#[test]
fn two_interfaces_within_a_sample_both_count() {
    // A film a quarter of a wavelength thick: its faces have opposite signs, and half a period between them inverts the
    // second.
    let quarter = 0.25 * 1.54 / 8.0;
    let mut bench = Bench::new(silent(1540.0, 1.5));
    let film = bench.tissue(silent(1540.0, 1.7));
    bench.add(film, 1, slab(0.0, 20.0, 20.01, 20.01 + quarter));
    let probe = linear(8, 0.5, 256, 40.0);
    assert!(probe.sample_spacing_mm() > 3.0 * quarter);
    let mut rig = Rig::new(&bench.scene().unwrap(), &probe, &small(1, 1));
    let frame = rig.frame(&at(0.0, 0.0, 0.0));
    let r: f64 = 0.2 / 3.2;
    let peak = rig.line(&frame, 4).iter().map(|&s| magnitude(s)).fold(0.0, f64::max);
    assert_part(peak, r + r * (1.0 - r * r), 2e-3, "film");
}

#[test]
fn the_carrier_turns_twice_per_wavelength() {
    // Phase between poses 10 µm apart: 2·2π·f/c₀ per mm of depth.
    let mut rig = Rig::new(&layered(0.0, 1.7), &linear(8, 0.5, 2048, 40.0), &small(1, 1));
    let peak_turns = |frame: &Frame| {
        let sample = (20.0 / (40.0 / 2048.0)) as usize - 3;
        let [re, im] = frame.lines[4 * 2048 + sample].map(f64::from);
        im.atan2(re) / std::f64::consts::TAU
    };
    let a = peak_turns(&rig.frame(&at(0.0, 0.0, 0.0)));
    let b = peak_turns(&rig.frame(&at(0.0, 0.0, 0.01)));
    let turned = (b - a).rem_euclid(1.0);
    // The plate comes nearer: the phase −2·f/c₀·z rises.
    assert_part(turned, 2.0 * 8.0 / 1.54 * 0.01, 2e-3, "turns");
}

#[test]
fn grey_levels_do_not_depend_on_other_objects() {
    // A grainy block with and without a perfect reflector beside it: there is no automatic exposure.
    let grey = |reflector: bool| {
        let grain = Tissue { scatterer_density: 1.0, scatterer_deviation: 0.01, ..silent(1540.0, 1.6) };
        let mut bench = Bench::new(grain);
        let air = bench.tissue(silent(343.0, 0.0004));
        bench.add(if reflector { air } else { 0 }, 1, slab(30.0, 10.0, 15.0, 20.0));
        let mut settings = small(1, 1);
        settings.image.tgc_db_per_cm = 0.0;
        (settings.image.width, settings.image.height) = (640, 480);
        let mut rig = Rig::new(&bench.scene().unwrap(), &linear(160, 0.5, 1024, 60.0), &settings);
        let (frame, sector) = (rig.frame(&at(0.0, 0.0, 0.0)), rig.sector());
        let left = (0..frame.bmode.len()).filter(move |&i| {
            let (column, row) = (i as u32 % sector.width, i as u32 / sector.width);
            sector.pixel_centre_mm(column, row).x < 0.0
        });
        let brightest = frame.bmode.iter().copied().max().unwrap();
        (left.map(|i| frame.bmode[i]).collect::<Vec<_>>(), brightest)
    };
    let (alone, alone_max) = grey(false);
    let (beside, beside_max) = grey(true);
    assert!(beside_max >= 240 && alone_max < 200, "{beside_max} {alone_max}");
    assert_eq!(alone, beside);
    assert!(alone.iter().any(|&g| g > 40));
}
