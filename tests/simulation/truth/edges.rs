//! Tests of speckle at the ends of the array, and near the edge of the part of the face that is in contact.
//!
//! Levels at the array's ends are relative to the middle of the same frames. Those for half contact are relative to
//! full contact in the same speckle, so they have hardly any noise.

use std::collections::BTreeMap;

use glam::Vec3;
use insonify::anatomy::{Bvh, Tissue, analytic};
use insonify::render::{Backend, BackendChoice, Choice, Effect, Frame, RenderSettings, Renderer};
use insonify::selftest::bench::{Bench, at, grainy, linear, small};
use insonify::selftest::measure::line;
use insonify::transducer::Probe;

use crate::truth::fixtures::rows;

/// Number of scanlines; x = 0 is between two of them.
const LINES: u32 = 200;
/// Distance between scanlines, mm.
const SPACING_MM: f64 = 0.25;
/// Half the width of the array, mm.
const HALF_WIDTH_MM: f64 = 0.5 * SPACING_MM * LINES as f64;
/// Depth of the image, mm.
const DEPTH_MM: f64 = 110.0;
/// Number of slices over which power is summed, and distance between them, mm. Each has other speckle.
const SLIDES: u32 = 12;
const SLIDE_MM: f64 = 3.0;
/// Half the window in which power is summed, mm along a scanline; at most the fraction `WINDOW_PART` of the depth.
const WINDOW_MM: f64 = 4.0;
const WINDOW_PART: f64 = 0.3;
/// Scanlines within this distance of a lateral position count as being there, mm.
const BESIDE_MM: f64 = 0.2;
/// Distance from the array's ends beyond which scanlines count as its middle, mm.
const MIDDLE_MM: f64 = 15.0;
/// Thickness of the film of gel, mm.
const GEL_MM: f64 = 3.0;
/// Thicknesses of the air gap below the film where the face is not coupled, mm. The first passes −92 dB, the second
/// nothing.
const GAPS_MM: [f64; 2] = [2.0, 10.0];
/// Distance from the edge of contact from which apertures are wholly coupled, mm.
const FAR_MM: f64 = 10.0;
/// Distance from the edge of contact into the coupled side, mm, from which scanlines start in the tissue.
const COUPLED_MM: f64 = 1.0;
/// Level below which nothing is compared, dB.
const FAINT_DB: f64 = -30.0;
/// Rays and layers: a single path, and many.
const SINGLE: [u32; 2] = [1, 1];
const MANY: [u32; 2] = [8, 3];

/// Level of a scanline by theory, dB, at a lateral position and a depth.
#[derive(Debug, Clone, Copy)]
struct Level {
    place_mm: f64,
    depth_mm: f64,
    theory_db: f64,
}

/// Levels of a case of edges.csv, for each beam.
fn beams(case: &str) -> Vec<(Probe, Vec<Level>)> {
    let mut beams: BTreeMap<String, (Probe, Vec<Level>)> = BTreeMap::new();
    for row in rows("edges.csv").iter().filter(|row| row.text("case") == case) {
        let key = row.without(&["place_mm", "depth_mm", "level_db"]).join(" ");
        let beam = beams.entry(key).or_insert_with(|| {
            let probe = Probe {
                frequency_mhz: row.number("frequency_mhz"),
                aperture_mm: row.number("aperture_mm"),
                focus_mm: row.number("focus_mm"),
                ..linear(LINES, SPACING_MM, 1536, DEPTH_MM)
            };
            (probe, Vec::new())
        });
        beam.1.push(Level {
            place_mm: row.number("place_mm"),
            depth_mm: row.number("depth_mm"),
            theory_db: row.number("level_db"),
        });
    }
    beams.into_values().collect()
}

/// Levels for the beam at 8 MHz.
fn first_beam(case: &str) -> (Probe, Vec<Level>) {
    beams(case).into_iter().find(|(probe, _)| probe.frequency_mhz == 8.0).unwrap()
}

/// Depths that occur in `levels`, ascending, each once.
fn depths_mm(levels: &[Level]) -> Vec<f64> {
    let mut depths: Vec<f64> = levels.iter().map(|level| level.depth_mm).collect();
    depths.sort_by(f64::total_cmp);
    depths.dedup();
    depths
}

/// Lateral position of a scanline, mm from the middle of the array.
fn x_mm(number: usize) -> f64 {
    (number as f64 + 0.5) * SPACING_MM - HALF_WIDTH_MM
}

/// Distance of a scanline from the array's nearer end, mm.
fn inward_mm(number: usize) -> f64 {
    HALF_WIDTH_MM - x_mm(number).abs()
}

/// Settings with an air gap of `gap_mm` where x < 0; for `None`, the whole face is coupled.
fn settings([rays, layers]: [u32; 2], aperture: Choice, gap_mm: Option<f64>) -> RenderSettings {
    let mut settings = small(rays, layers);
    let contact = if gap_mm.is_some() { Choice::On } else { Choice::Off };
    let choices = [(Effect::Aperture, aperture), (Effect::Contact, contact)];
    for (effect, choice) in choices.into_iter().chain([Effect::Rays, Effect::Layers].map(|e| (e, Choice::On))) {
        settings.effects = settings.effects.with(effect, choice);
    }
    settings.contact.gel_mm = GEL_MM;
    // Levels are of what the body returns.
    settings.receiver.reverberation_db = -400.0;
    settings
}

/// A uniform tissue, and the probe and settings that image it.
#[derive(Debug, Clone, Copy)]
struct Rig<'a> {
    probe: &'a Probe,
    tissue: &'a Tissue,
    quality: [u32; 2],
    aperture: Choice,
    depths_mm: &'a [f64],
}

impl Rig<'_> {
    /// Power of the scanlines about each depth, summed over all slices [depths × scanlines].
    fn powers(&self, gap_mm: Option<f64>) -> Vec<Vec<f64>> {
        let backend = Backend::open(BackendChoice::Host).unwrap();
        // The body is of the background's tissue: scatterers are the same with the gap and without it.
        let mut bench = Bench::new(self.tissue.clone());
        let skin_mm = (GEL_MM + gap_mm.unwrap_or(0.0)) as f32;
        for (from, to, top) in [(0.0, 90.0, -20.0), (-90.0, 0.0, skin_mm)] {
            bench.add(0, 1, analytic::cuboid(Vec3::new(from, -60.0, top), Vec3::new(to, 60.0, 200.0)));
        }
        let scene = bench.scene().unwrap();
        let settings = settings(self.quality, self.aperture, gap_mm);
        let bvh = Bvh::build(&scene).unwrap();
        let mut renderer = Renderer::with_bvh(&backend, &scene, bvh, self.probe, &settings).unwrap();
        let mut frame = Frame::default();
        let mut powers = vec![vec![0.0_f64; LINES as usize]; self.depths_mm.len()];
        for slide in 0..SLIDES {
            let slide_mm = (f64::from(slide) - 0.5 * f64::from(SLIDES - 1)) * SLIDE_MM;
            renderer.render(&at(0.0, slide_mm, 0.0), &mut frame).unwrap();
            for (row, &depth_mm) in powers.iter_mut().zip(self.depths_mm) {
                for (number, power) in (0_u32..).zip(row.iter_mut()) {
                    *power += self.power(&frame, number, depth_mm);
                }
            }
        }
        powers
    }

    /// Power of a scanline in the window about a depth.
    fn power(&self, frame: &Frame, number: u32, depth_mm: f64) -> f64 {
        let half_mm = WINDOW_MM.min(WINDOW_PART * depth_mm);
        let sample = |mm: f64| (mm / self.probe.sample_spacing_mm()) as usize;
        let samples = &line(self.probe, frame, number)[sample(depth_mm - half_mm)..sample(depth_mm + half_mm)];
        samples.iter().map(|&[re, im]| f64::from(re).powi(2) + f64::from(im).powi(2)).sum()
    }
}

/// Mean of `row` over the scanlines that `counts` accepts.
fn mean(row: &[f64], counts: impl Fn(usize) -> bool) -> f64 {
    let (mut sum, mut count) = (0.0_f64, 0_u32);
    for (_, &power) in row.iter().enumerate().filter(|&(number, _)| counts(number)) {
        sum += power;
        count += 1;
    }
    assert!(count > 0);
    sum / f64::from(count)
}

fn decibels(ratio: f64) -> f64 {
    10.0 * ratio.max(1e-30).log10()
}

/// Levels at the array's ends: theory, and the frames' level relative to the array's middle, dB.
fn rim(probe: &Probe, levels: &[Level], quality: [u32; 2], aperture: Choice) -> Vec<(Level, f64)> {
    let depths_mm = depths_mm(levels);
    let tissue = grainy(0.0, 0.01);
    let powers = Rig { probe, tissue: &tissue, quality, aperture, depths_mm: &depths_mm }.powers(None);
    // No scanline lies on the very end.
    let levels = levels.iter().filter(|level| level.place_mm > 0.0);
    let measured = |&level: &Level| {
        let row = &powers[depths_mm.iter().position(|&depth_mm| depth_mm == level.depth_mm).unwrap()];
        let there = mean(row, |number| (inward_mm(number) - level.place_mm).abs() <= BESIDE_MM);
        (level, decibels(there / mean(row, |number| inward_mm(number) >= MIDDLE_MM)))
    };
    levels.map(measured).collect()
}

/// Levels near the edge of contact: theory, and the frames' level relative to full contact, dB.
fn half_contact(
    probe: &Probe,
    levels: &[Level],
    quality: [u32; 2],
    aperture: Choice,
    gap_mm: f64,
) -> Vec<(Level, f64)> {
    let depths_mm = depths_mm(levels);
    let tissue = grainy(0.0, 0.01);
    let rig = Rig { probe, tissue: &tissue, quality, aperture, depths_mm: &depths_mm };
    let (half, full) = (rig.powers(Some(gap_mm)), rig.powers(None));
    let measured = |&level: &Level| {
        let depth = depths_mm.iter().position(|&depth_mm| depth_mm == level.depth_mm).unwrap();
        let there = |row: &[f64]| mean(row, |number| (x_mm(number) - level.place_mm).abs() <= BESIDE_MM);
        (level, decibels(there(&half[depth]) / there(&full[depth])))
    };
    levels.iter().filter(|level| level.theory_db > FAINT_DB).map(measured).collect()
}

/// Whether a level at the array's ends is near enough to theory.
fn good_at_rim(&(level, measured_db): &(Level, f64)) -> bool {
    level.theory_db < -10.0 || (measured_db - level.theory_db).abs() <= 0.7
}

/// Whether a level near the edge of contact is near enough to theory. It must be within 0.5 dB far from the edge, 2.5
/// dB near it, and 4.5 dB on the edge and where the face is not coupled.
fn good_beside_contact(&(level, measured_db): &(Level, f64)) -> bool {
    let allowed_db = match level.place_mm {
        far if far >= FAR_MM => 0.5,
        coupled if coupled >= COUPLED_MM => 2.5,
        _ => 4.5,
    };
    (measured_db - level.theory_db).abs() <= allowed_db
}

/// Prints levels, and returns texts on those that are not good.
fn wrong(said: &str, probe: &Probe, pairs: &[(Level, f64)], good: impl Fn(&(Level, f64)) -> bool) -> Vec<String> {
    let mut wrong = Vec::new();
    for pair in pairs {
        let (Level { place_mm, depth_mm, theory_db }, measured_db) = *pair;
        let text = format!(
            "{said}, {} MHz: {place_mm} mm at {depth_mm} mm: {theory_db:.2}/{measured_db:.2} dB",
            probe.frequency_mhz
        );
        println!("{text}{}", if good(pair) { "" } else { " WRONG" });
        if !good(pair) {
            wrong.push(text);
        }
    }
    assert!(pairs.len() > 15);
    wrong
}

#[test]
fn the_rim_of_an_array_dims_as_by_diffraction() {
    let mut all = Vec::new();
    for (probe, levels) in beams("rim") {
        all.extend(wrong("rim", &probe, &rim(&probe, &levels, SINGLE, Choice::On), good_at_rim));
    }
    assert!(all.is_empty(), "{all:#?}");
}

#[test]
fn the_rim_with_many_rays_dims_as_by_diffraction() {
    let (probe, levels) = first_beam("rim");
    let wrong = wrong("rim", &probe, &rim(&probe, &levels, MANY, Choice::On), good_at_rim);
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn half_a_face_in_contact_fades_as_by_diffraction() {
    let mut all = Vec::new();
    for (probe, levels) in beams("contact") {
        for gap_mm in GAPS_MM {
            let pairs = half_contact(&probe, &levels, SINGLE, Choice::On, gap_mm);
            all.extend(wrong(&format!("gap of {gap_mm} mm"), &probe, &pairs, good_beside_contact));
        }
    }
    assert!(all.is_empty(), "{all:#?}");
}

#[test]
fn half_contact_with_many_rays_fades_as_by_diffraction() {
    let (probe, levels) = first_beam("contact");
    let pairs = half_contact(&probe, &levels, MANY, Choice::On, GAPS_MM[0]);
    let wrong = wrong("many rays", &probe, &pairs, good_beside_contact);
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn far_from_the_edge_of_contact_a_lossy_tissue_keeps_its_level() {
    let (probe, _) = first_beam("contact");
    let tissue = Tissue { attenuation_db_cm_mhz: 1.0, ..grainy(0.0, 0.01) };
    let depths_mm = [5.0, 10.0, 20.0, 40.0, 60.0];
    let rig = Rig { probe: &probe, tissue: &tissue, quality: SINGLE, aperture: Choice::On, depths_mm: &depths_mm };
    let full = rig.powers(None);
    for gap_mm in GAPS_MM {
        let half = rig.powers(Some(gap_mm));
        for (depth_mm, (half, full)) in depths_mm.iter().zip(half.iter().zip(&full)) {
            // Up to where the apertures reach the array's end.
            let far = |number: usize| (FAR_MM + 0.5..HALF_WIDTH_MM - FAR_MM).contains(&x_mm(number));
            let level_db = decibels(mean(half, far) / mean(full, far));
            assert!(level_db.abs() <= 0.5, "gap of {gap_mm} mm, depth of {depth_mm} mm: {level_db:.2} dB");
        }
    }
}

#[test]
fn without_the_aperture_edges_are_wrong() {
    // A test that passes without the effect would prove nothing.
    let (probe, levels) = first_beam("rim");
    let pairs = rim(&probe, &levels, SINGLE, Choice::Off);
    assert!(!wrong("rim without the aperture", &probe, &pairs, good_at_rim).is_empty());
    let (probe, levels) = first_beam("contact");
    let pairs = half_contact(&probe, &levels, SINGLE, Choice::Off, GAPS_MM[0]);
    assert!(!wrong("contact without the aperture", &probe, &pairs, good_beside_contact).is_empty());
}
