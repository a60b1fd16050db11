//! Speckle is fixed in the tissue: it stays while the probe moves, and is the same when the probe returns.

use insonify::render::Frame;
use insonify::transducer::Probe;

use super::bench::{Rig, at, grainy, linear, magnitude, small};
use super::speckle::block;

/// Correlation coefficient of pairs of envelope values.
fn correlation(pairs: &[(f64, f64)]) -> f64 {
    let n = pairs.len() as f64;
    let (a, b) = pairs.iter().fold((0.0, 0.0), |m, p| (m.0 + p.0 / n, m.1 + p.1 / n));
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for p in pairs {
        ab += (p.0 - a) * (p.1 - b);
        aa += (p.0 - a).powi(2);
        bb += (p.1 - b).powi(2);
    }
    ab / (aa * bb).sqrt()
}

/// Correlation of the envelopes of `a` and `b` away from the edges. `a` is read `lines` scanlines and `samples` samples
/// further than `b`.
fn overlap(probe: &Probe, a: &Frame, b: &Frame, lines: u32, samples: u32) -> f64 {
    let at =
        |frame: &Frame, line: u32, sample: u32| magnitude(frame.lines[(line * probe.sample_count() + sample) as usize]);
    let mut pairs = Vec::new();
    for line in 24..probe.scanlines - 24 - lines {
        for sample in (100..probe.sample_count() - 100 - samples).step_by(3) {
            pairs.push((at(a, line + lines, sample + samples), at(b, line, sample)));
        }
    }
    correlation(&pairs)
}

#[test]
fn speckle_stays_in_the_tissue_and_returns_with_the_probe() {
    let scene = block(grainy(0.0, 0.01));
    let probe = linear(160, 0.25, 2048, 100.0);
    let spacing = probe.sample_spacing_mm();
    for (rays, layers) in [(1, 1), (16, 3)] {
        let mut rig = Rig::new(&scene, &probe, &small(rays, layers));
        let home = at(0.0, 0.0, 0.0);
        let first = rig.frame(&home);
        for lines in [1, 8, 40] {
            let moved = rig.frame(&at(0.25 * f64::from(lines), 0.0, 0.0));
            let stays = overlap(&probe, &first, &moved, lines, 0);
            println!("{rays}×{layers}, {lines} lines aside: {stays:.4}");
            assert!(stays > 0.9, "{lines} lines: {stays}");
            // At the same place in the image there is another pattern.
            assert!(lines < 8 || overlap(&probe, &first, &moved, 0, 0).abs() < 0.1);
        }
        // The outer elevational layers are tilted, so they sweep through the tissue while the probe moves deeper.
        for samples in if layers == 1 { [1, 16, 200] } else { [1, 4, 8] } {
            let moved = rig.frame(&at(0.0, 0.0, spacing * f64::from(samples)));
            let stays = overlap(&probe, &first, &moved, 0, samples);
            println!("{rays}×{layers}, {samples} samples deeper: {stays:.4}");
            let least = if layers == 1 { 0.95 } else { 0.9 };
            assert!(stays > least, "{samples} samples: {stays}");
        }
        // Out of the plane the pattern is another one.
        let beside = rig.frame(&at(0.0, 9.0, 0.0));
        let control = overlap(&probe, &first, &beside, 0, 0);
        assert!(control.abs() < 0.05, "{control}");
        let again = rig.frame(&home);
        assert_eq!((&first.lines, &first.bmode), (&again.lines, &again.bmode));
        assert_eq!((&first.segmentation, &first.attenuation), (&again.segmentation, &again.attenuation));
    }
}
