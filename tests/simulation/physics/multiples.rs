//! Tests of multiples: echoes that the probe's face reflects back into the body, and that return again.

use insonify::anatomy::Tissue;
use insonify::render::{Choice, Effect, Frame, RenderSettings};

use super::bench::{Bench, Rig, assert_part, at, grainy, linear, magnitude, mean_square, silent, slab, small};

/// Settings with a face that reflects `face_reflection_db`, and without other reflections.
fn reflecting(face_reflection_db: f64) -> RenderSettings {
    let mut settings = small(1, 1);
    settings.receiver.face_reflection_db = face_reflection_db;
    settings.effects = settings.effects.with(Effect::Multiples, Choice::On).with(Effect::Reflections, Choice::Off);
    settings
}

/// Largest magnitude within 0.3 mm of a range, and its range, mm.
fn peak(rig: &Rig, frame: &Frame, line: u32, range_mm: f64) -> (f64, f64) {
    let spacing_mm = rig.probe.sample_spacing_mm();
    let samples = rig.line(frame, line).iter().enumerate();
    samples
        .map(|(i, &sample)| (magnitude(sample), (i as f64 + 0.5) * spacing_mm))
        .filter(|(_, mm)| (mm - range_mm).abs() < 0.3)
        .fold((0.0, 0.0), |best, found| if found.0 > best.0 { found } else { best })
}

#[test]
fn a_plate_returns_at_each_multiple_of_its_depth() {
    let mut bench = Bench::new(silent(1540.0, 1.5));
    let plate = bench.tissue(silent(1540.0, 4.5));
    bench.add(plate, 1, slab(0.0, 40.0, 15.0, 80.0));
    let scene = bench.scene().unwrap();
    let r: f64 = 3.0 / 6.0;
    let face: f64 = 0.2;
    let mut rig = Rig::new(&scene, &linear(16, 0.5, 2048, 50.0), &reflecting(20.0 * face.log10()));
    let frame = rig.frame(&at(0.0, 0.0, 0.0));
    for line in 0..16 {
        let (first, _) = peak(&rig, &frame, line, 15.0);
        assert_part(first, r, 0.02, "the plate");
        for (times, part) in [(2.0, face * r.powi(2)), (3.0, face.powi(2) * r.powi(3))] {
            let (level, at_mm) = peak(&rig, &frame, line, times * 15.0);
            assert_part(level, part, 0.05, "its multiple");
            assert!((at_mm - times * 15.0).abs() <= times * rig.probe.sample_spacing_mm(), "{at_mm} mm");
        }
    }
    // A face that reflects nothing shows no multiple.
    let mut rig = Rig::new(&scene, &rig.probe, &reflecting(-400.0));
    let frame = rig.frame(&at(0.0, 0.0, 0.0));
    assert!(peak(&rig, &frame, 8, 30.0).0 < 1e-6);
}

#[test]
fn tissue_behind_a_layer_returns_as_haze_in_the_fluid_below() {
    // Tissue with a reflecting layer at 10 mm, and fluid from 26 mm on. The layer's echo travels again to the tissue down
    // to 26 mm, and the tissue's to the layer: twice the face's part of the layer's part of the tissue's level.
    let mut bench = Bench::new(grainy(0.0, 0.002));
    let denser = Tissue { density_kg_m3: 2.4e6 / 1540.0, ..grainy(0.0, 0.002) };
    let (layer, fluid) = (bench.tissue(denser), bench.tissue(silent(1540.0, 2.4)));
    bench.add(layer, 1, slab(0.0, 60.0, 10.0, 26.0));
    bench.add(fluid, 2, slab(0.0, 60.0, 26.0, 90.0));
    let (r, face): (f64, f64) = (0.8 / 4.0, 0.3);
    let mut settings = reflecting(20.0 * face.log10());
    settings.effects = settings.effects.with(Effect::Aperture, Choice::Off);
    let mut rig = Rig::new(&bench.scene().unwrap(), &linear(128, 0.3, 2048, 50.0), &settings);
    let frame = rig.frame(&at(0.0, 0.0, 0.0));
    let sample = |mm: f64| (mm / rig.probe.sample_spacing_mm()) as usize;
    let power = |from_mm: f64, to_mm: f64| -> f64 {
        let of_line =
            |line| mean_square(rig.line(&frame, line)[sample(from_mm)..sample(to_mm)].iter().map(|&s| magnitude(s)));
        (0..128).map(of_line).sum()
    };
    // Beside the layer's own multiples, at 20 and 30 mm.
    let haze_db = 10.0 * (power(31.5, 34.5) / power(21.5, 24.5)).log10();
    let expected_db = 20.0 * (2.0 * face * r).log10();
    assert!((haze_db - expected_db).abs() < 1.0, "{haze_db:.1} dB, expected {expected_db:.1}");
}

#[test]
fn a_stack_of_strong_plates_never_grows() {
    // A face that reflects all of it before plates without loss: the sum of what returns is held below 1.
    let mut bench = Bench::new(silent(1540.0, 1.5));
    let plate = bench.tissue(silent(1540.0, 7.0));
    for n in 0..12 {
        let top_mm = 6.0 + 3.0 * f64::from(n);
        bench.add(plate, 1, slab(0.0, 40.0, top_mm, top_mm + 1.5));
    }
    let mut rig = Rig::new(&bench.scene().unwrap(), &linear(16, 0.5, 2048, 60.0), &reflecting(0.0));
    let frame = rig.frame(&at(0.0, 0.0, 0.0));
    for line in 0..16 {
        let largest = rig.line(&frame, line).iter().map(|&s| magnitude(s)).fold(0.0, f64::max);
        assert!(largest < 1.0, "line {line}: {largest}");
    }
}
