//! Tests of beams that a tilted border bends out of the sector, compared with those that it bends inwards.

use glam::DVec2;
use insonify::anatomy::{Bvh, Tissue};
use insonify::render::{Backend, BackendChoice, Choice, Effect, Frame, Renderer};
use insonify::selftest::bench::{Bench, at, grainy, linear, slab, small};
use insonify::selftest::measure::line;
use insonify::transducer::Probe;

use crate::truth::fixtures::rows;
use crate::truth::refraction::bodies;

/// Number of scanlines, and distance between them, mm.
const LINES: u32 = 200;
const SPACING_MM: f64 = 0.25;
/// Width of the array, mm.
const WIDTH_MM: f64 = SPACING_MM * LINES as f64;
/// Depth of the image, mm.
const DEPTH_MM: f64 = 128.0;
/// Depths at which power is measured, mm.
const DEPTHS_MM: [f64; 3] = [60.0, 95.0, 120.0];
/// Number of slices over which power is summed, and distance between them, mm. Each has other speckle.
const SLIDES: u32 = 24;
const SLIDE_MM: f64 = 3.0;
/// Half the window in which power is summed, mm along a scanline.
const WINDOW_MM: f64 = 4.0;
/// Scanlines within this distance of a lateral position count as being there, mm.
const BESIDE_MM: f64 = 0.2;
/// Range of distances from the array's end at which apertures are whole, mm.
const MIDDLE_MM: std::ops::Range<f64> = 15.0..35.0;
/// Fractions of a beam's power beyond the array: up to the first, the beam is within the sector; from the second on, it
/// has left it.
const WITHIN: f64 = 0.05;
const BEYOND: f64 = 0.5;
/// Largest accepted difference, dB. Beyond the sector, there is the mirror image of the tissue inside, which has the
/// same level.
const MISS_DB: f64 = 1.0;

/// Power about each depth, summed over all slices, by the distance of a scanline from the array's end. The end at x = 0
/// is the right one if `side` is positive, else the left one.
fn powers(tilt_deg: Option<f64>, side: f64) -> [Vec<f64>; DEPTHS_MM.len()] {
    let probe =
        Probe { frequency_mhz: 8.0, aperture_mm: 20.0, focus_mm: 70.0, ..linear(LINES, SPACING_MM, 1536, DEPTH_MM) };
    let mut settings = small(1, 1);
    for effect in [Effect::Aperture, Effect::Refraction, Effect::SpeedDisplacement] {
        settings.effects = settings.effects.with(effect, Choice::On);
    }
    let (near, far, meshes) = tilt_deg.map_or((1540.0, 1540.0, Vec::new()), |tilt_deg| bodies("tilt", tilt_deg));
    let tissue = |speed_m_s| Tissue { speed_m_s, attenuation_db_cm_mhz: 0.0, ..grainy(0.0, 0.01) };
    let mut bench = Bench::new(tissue(near));
    let body = bench.tissue(tissue(far));
    meshes.into_iter().chain([slab(DVec2::new(500.0, 0.0), 1.0, 0.0, 1.0)]).for_each(|mesh| bench.add(body, 1, mesh));
    let scene = bench.scene().unwrap();
    let backend = Backend::open(BackendChoice::Host).unwrap();
    let mut renderer = Renderer::with_bvh(&backend, &scene, Bvh::build(&scene).unwrap(), &probe, &settings).unwrap();
    let mut frame = Frame::default();
    let mut powers = DEPTHS_MM.map(|_| vec![0.0; LINES as usize]);
    for slide in 0..SLIDES {
        let slide_mm = (f64::from(slide) - 0.5 * f64::from(SLIDES - 1)) * SLIDE_MM;
        renderer.render(&at(-0.5 * WIDTH_MM * side, slide_mm, 0.0), &mut frame).unwrap();
        for (row, depth_mm) in powers.iter_mut().zip(DEPTHS_MM) {
            let sample = |mm: f64| (mm / probe.sample_spacing_mm()) as usize;
            for (number, power) in (0..LINES).zip(row) {
                let number = if side > 0.0 { LINES - 1 - number } else { number };
                let samples = &line(&probe, &frame, number)[sample(depth_mm - WINDOW_MM)..sample(depth_mm + WINDOW_MM)];
                *power += samples.iter().map(|&[re, im]| f64::from(re).powi(2) + f64::from(im).powi(2)).sum::<f64>();
            }
        }
    }
    powers
}

/// Mean of `row` over scanlines whose distance from the end `counts` accepts.
fn mean(row: &[f64], counts: impl Fn(f64) -> bool) -> f64 {
    let counted: Vec<f64> = (0_u32..)
        .zip(row)
        .filter(|&(number, _)| counts((f64::from(number) + 0.5) * SPACING_MM))
        .map(|(_, &power)| power)
        .collect();
    counted.iter().sum::<f64>() / counted.len() as f64
}

#[test]
fn beams_dim_at_the_rim_and_keep_their_level_where_they_leave_the_sector() {
    let plain = powers(None, 1.0);
    let mut wrong = Vec::new();
    let (mut within, mut left) = (0, 0);
    for (tilt, side) in [("15", "1"), ("15", "-1"), ("30", "1"), ("30", "-1")] {
        let bent = powers(Some(tilt.parse().unwrap()), side.parse().unwrap());
        for row in rows("leaving.csv").iter().filter(|row| (row.text("tilt_deg"), row.text("side")) == (tilt, side)) {
            let [place_mm, depth_mm, theory_db, beyond] =
                ["place_mm", "depth_mm", "level_db", "beyond_part"].map(|column| row.number(column));
            let depth = DEPTHS_MM.iter().position(|&mm| mm == depth_mm).unwrap();
            let there = mean(&bent[depth], |mm| (mm - place_mm).abs() <= BESIDE_MM);
            let miss_db = 10.0 * (there / mean(&plain[depth], |mm| MIDDLE_MM.contains(&mm))).log10() - theory_db;
            let said = format!(
                "tilt {tilt}°, side {side}, {place_mm} mm at {depth_mm} mm, {beyond} beyond: {theory_db} dB, off by {miss_db:.1}"
            );
            println!("{said}");
            within += u32::from(beyond < WITHIN);
            left += u32::from(beyond > BEYOND);
            if miss_db.abs() > MISS_DB {
                wrong.push(said);
            }
        }
    }
    let enough = within > 40 && left > 10;
    assert!(enough && wrong.is_empty(), "{within} within the sector, {left} beyond; {wrong:#?}");
}
