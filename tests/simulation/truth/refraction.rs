//! Tests of beams below bodies of other sound speed: their offset, their width and the power that they keep.

use std::collections::BTreeMap;

use glam::DVec2;
use insonify::anatomy::{Bvh, Mesh, Tissue};
use insonify::render::{Backend, BackendChoice, Choice, Effect, Renderer, Snapshot};
use insonify::selftest::bench::{Bench, at, linear, prism, silent, small};
use insonify::transducer::Probe;

use crate::truth::fixtures::rows;

/// Number of scanlines; one is in the middle.
const LINES: u32 = 301;
/// Distance between scanlines, mm.
const SPACING_MM: f64 = 0.25;
/// Depth of the image, mm.
const DEPTH_MM: f64 = 130.0;

/// Measures of a beam at a depth.
#[derive(Debug, Clone, Copy)]
struct Measures {
    shift_mm: f64,
    spread_mm: f64,
    level_db: f64,
}

/// `count` + 1 evenly spaced positions from `-half` to `half`.
fn span(half: f64, count: u32) -> Vec<f64> {
    (0..=count).map(|i| half * (2.0 * f64::from(i) / f64::from(count) - 1.0)).collect()
}

/// Speed of the background, speed of the bodies, m/s, and the bodies about x = 0 of a case of refraction.py.
pub(crate) fn bodies(case: &str, size: f64) -> (f64, f64, Vec<Mesh>) {
    let ellipse = |x0: f64, z0: f64, half: f64, height: f64| {
        let arc = |x: f64| height * (1.0 - ((x - x0) / half).powi(2)).max(0.0).sqrt() + 1.0e-3;
        // Denser where it is steep.
        let xs: Vec<f64> = (0..=120).map(|i| x0 - half * (std::f64::consts::PI * f64::from(i) / 120.0).cos()).collect();
        prism(DVec2::ZERO, &xs, |x| z0 - arc(x), |x| z0 + arc(x))
    };
    let below = |border: &dyn Fn(f64) -> f64| vec![prism(DVec2::ZERO, &span(70.0, 1400), border, |_| 200.0)];
    match case {
        "tilt" => (1450.0, 1580.0, below(&|x| 20.0 + x * size.to_radians().tan())),
        "wavy" => (1450.0, 1580.0, below(&|x| 20.0 + 1.5 * (std::f64::consts::TAU * x / size).sin())),
        "cylinder" => (1510.0, 1600.0, vec![ellipse(0.0, 45.0, size, size)]),
        "recti" => (1450.0, 1580.0, [-31.0, 31.0].map(|x| ellipse(x, 22.0, 30.0, size)).into()),
        _ => panic!("no case {case}"),
    }
}

/// Snapshot of a case, or of the homogeneous medium for `None`.
fn snapshot(case: Option<(&str, f64)>, rays: u32, layers: u32, refraction: Choice) -> (Probe, Snapshot) {
    let probe = linear(LINES, SPACING_MM, 1536, DEPTH_MM);
    let probe = Probe { frequency_mhz: 8.0, aperture_mm: 20.0, focus_mm: 70.0, ..probe };
    let mut settings = small(rays, layers);
    for effect in [Effect::Aperture, Effect::SpeedDisplacement] {
        settings.effects = settings.effects.with(effect, Choice::On);
    }
    settings.effects = settings.effects.with(Effect::Refraction, refraction);
    let (background, speed, meshes) = case.map_or((1540.0, 1540.0, Vec::new()), |(case, size)| bodies(case, size));
    // Impedances differ by little: nothing reflects.
    let mut bench = Bench::new(silent(background, 1.5));
    let body = bench.tissue(Tissue { ..silent(speed, 1.5) });
    let far = insonify::selftest::bench::slab(DVec2::new(500.0, 0.0), 1.0, 0.0, 1.0);
    meshes.into_iter().chain([far]).for_each(|mesh| bench.add(body, 1, mesh));
    let backend = Backend::open(BackendChoice::Host).unwrap();
    let scene = bench.scene().unwrap();
    let mut renderer = Renderer::with_bvh(&backend, &scene, Bvh::build(&scene).unwrap(), &probe, &settings).unwrap();
    let snapshot = renderer.snapshot(&at(0.0, 0.0, 0.0)).unwrap();
    (probe, snapshot)
}

/// Power that scatterers near a scanline return to it, by their lateral offset in scanlines.
fn powers(probe: &Probe, snapshot: &Snapshot, line: usize, depth_mm: f64) -> Vec<f64> {
    let aperture = snapshot.inputs.aperture.as_ref().unwrap();
    let plane = ((depth_mm / aperture.plane_mm - 0.5).round() as usize).min(aperture.planes - 1);
    let profile = &snapshot.profiles[plane * probe.scanlines as usize + line];
    let block = (depth_mm / probe.sample_spacing_mm()) as usize / snapshot.inputs.depth_block;
    let kernel = &snapshot.inputs.lateral_kernels[block];
    let weight = |(kernel, weight): (&f64, &f64)| (profile.kept * kernel + weight).powi(2);
    kernel.iter().zip(&profile.weights).map(weight).collect()
}

/// Centroid and RMS width of the power about a scanline, mm.
fn moments(powers: &[f64]) -> (f64, f64) {
    let place = |tap: usize| (tap as f64 - (powers.len() / 2) as f64) * SPACING_MM;
    let total: f64 = powers.iter().sum();
    let mean = powers.iter().enumerate().map(|(tap, power)| power * place(tap)).sum::<f64>() / total;
    let square = powers.iter().enumerate().map(|(tap, power)| power * (place(tap) - mean).powi(2)).sum::<f64>() / total;
    (mean, square.sqrt())
}

/// Power of a scanline's beam relative to the greatest power without obstacles.
fn level(snapshot: &Snapshot, line: usize, depth_mm: f64) -> f64 {
    let aperture = snapshot.inputs.aperture.as_ref().unwrap();
    let plane = ((depth_mm / aperture.plane_mm - 0.5).round() as usize).min(aperture.planes - 1);
    let node = aperture.line_cells[line] / aperture.node_cells[plane] as f64;
    let power = |node: usize| snapshot.beam_powers[plane * aperture.cells + node];
    let part = node.fract();
    power(node as usize) * (1.0 - part) + power(node as usize + 1) * part
}

fn measured(probe: &Probe, snapshot: &Snapshot, plain: &Snapshot, offset_mm: f64, depth_mm: f64) -> Measures {
    // A body moved by an offset lies as far from the middle scanline as one in the middle from another scanline.
    let middle = (LINES / 2) as usize;
    let line = middle.checked_add_signed(-(offset_mm / SPACING_MM).round() as isize).unwrap();
    let (shift_mm, spread_mm) = moments(&powers(probe, snapshot, line, depth_mm));
    let (straight_mm, _) = moments(&powers(probe, plain, line, depth_mm));
    let level_db = 10.0 * (level(snapshot, line, depth_mm) / level(plain, line, depth_mm)).log10();
    Measures { shift_mm: shift_mm - straight_mm, spread_mm, level_db }
}

/// Theory by case and size, then by depth, mm: offset of the body, mm, and measures of the beam.
type Cases = BTreeMap<(String, String), BTreeMap<u32, Vec<(f64, Measures)>>>;

fn cases() -> Cases {
    let mut cases = Cases::new();
    for row in rows("refraction.csv") {
        let theory = Measures {
            shift_mm: row.number("shift_mm"),
            spread_mm: row.number("spread_mm"),
            level_db: row.number("level_db"),
        };
        let case = cases.entry((row.text("case").to_owned(), row.text("size").to_owned())).or_default();
        case.entry(row.number("depth_mm") as u32).or_default().push((row.number("offset_mm"), theory));
    }
    cases
}

/// Root mean square.
fn rms(values: impl Iterator<Item = f64> + Clone) -> f64 {
    (values.clone().map(|v| v * v).sum::<f64>() / values.count() as f64).sqrt()
}

/// Compares every case with theory; returns texts on what is out of bounds.
fn compare(rays: u32, layers: u32) -> Vec<String> {
    let (_, plain) = snapshot(None, rays, layers, Choice::On);
    let mut wrong = Vec::new();
    for ((case, size), depths) in cases() {
        let (probe, bent) = snapshot(Some((&case, size.parse().unwrap())), rays, layers, Choice::On);
        for (depth, beams) in depths {
            let pairs: Vec<(Measures, Measures)> = beams
                .iter()
                .map(|&(offset_mm, theory)| (theory, measured(&probe, &bent, &plain, offset_mm, depth.into())))
                .collect();
            let theory_mm = rms(pairs.iter().map(|(theory, _)| theory.shift_mm));
            let miss_mm = rms(pairs.iter().map(|(theory, got)| got.shift_mm - theory.shift_mm));
            let mean =
                |of: &dyn Fn(&(Measures, Measures)) -> f64| pairs.iter().map(of).sum::<f64>() / pairs.len() as f64;
            let spreads = [mean(&|pair| pair.0.spread_mm), mean(&|pair| pair.1.spread_mm)];
            let levels = [mean(&|pair| pair.0.level_db), mean(&|pair| pair.1.level_db)];
            let said = format!(
                "{case} {size} at {depth} mm: shift {theory_mm:.2} mm rms, off by {miss_mm:.2}; spread {:.2}/{:.2} mm; level {:.1}/{:.1} dB",
                spreads[0], spreads[1], levels[0], levels[1]
            );
            println!("{said}");
            let good = miss_mm <= (0.15 * theory_mm).max(0.4)
                && (spreads[1] / spreads[0] - 1.0).abs() <= 0.35
                && (levels[1] - levels[0]).abs() <= 3.0;
            if !good {
                wrong.push(said);
            }
        }
    }
    wrong
}

#[test]
fn beams_behind_speed_maps_are_those_of_wave_theory() {
    let wrong = compare(1, 1);
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn beams_with_many_rays_are_those_of_wave_theory() {
    let wrong = compare(32, 3);
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn without_refraction_beams_stay_where_they_are() {
    // A comparison that passes without the effect would prove nothing.
    let (probe, plain) = snapshot(None, 1, 1, Choice::On);
    let (_, straight) = snapshot(Some(("tilt", 15.0)), 1, 1, Choice::Off);
    let theory = cases()[&("tilt".to_owned(), "15".to_owned())][&95][0].1;
    let measured = measured(&probe, &straight, &plain, 0.0, 95.0);
    assert!(theory.shift_mm.abs() > 1.0 && measured.shift_mm.abs() < 0.1, "{measured:?}, theory {theory:?}");
}
