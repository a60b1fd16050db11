//! Tests of the shadows of opaque strips and half-planes.
//!
//! The same speckle is rendered with the obstacle and without it, so the ratio of powers has hardly any noise.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3, Quat, Vec3};
use insonify::anatomy::Tissue;
use insonify::anatomy::{Bvh, analytic};
use insonify::render::{Backend, BackendChoice, Choice, Effect, Frame, RenderSettings, Renderer};
use insonify::selftest::bench::{Bench, at, grainy, linear, slab, small};
use insonify::selftest::measure::power_about;
use insonify::transducer::{Probe, ProbeKind};

use crate::truth::fixtures::rows;

/// Thickness of the obstacles, mm.
const THICK_MM: f64 = 1.0;
/// Half the window in which power is averaged, mm along the middle scanline.
const WINDOW_MM: f64 = 1.0;
/// Number of slices over which power is averaged, and distance between them, mm.
const SLICES: u32 = 3;
const SLICE_MM: f64 = 4.0;
/// Number of scanlines; one is in the middle.
const LINES: u32 = 255;

/// An obstacle, a beam, and levels below the obstacle.
struct Case {
    radius_mm: Option<f64>,
    /// Whether a phased array renders it. In the middle of its sector theory is that of a flat array.
    phased: bool,
    depth_mm: f64,
    half_width_mm: f64,
    offset_mm: f64,
    frequency_mhz: f64,
    aperture_mm: f64,
    focus_mm: f64,
    /// Distance below the obstacle (mm), and level by theory (dB).
    levels: Vec<(f64, f64)>,
}

/// Cases of a table. Rows that differ only in the distance below the obstacle belong to one case.
fn cases(file: &str) -> Vec<Case> {
    let mut cases: BTreeMap<String, Case> = BTreeMap::new();
    for row in rows(file) {
        let key = row.without(&["behind_mm", "level_db"]).join(" ");
        let case = cases.entry(key).or_insert_with(|| Case {
            radius_mm: row.optional("radius_mm"),
            phased: false,
            depth_mm: row.number("depth_mm"),
            half_width_mm: row.number("half_width_mm"),
            offset_mm: row.number("offset_mm"),
            frequency_mhz: row.number("frequency_mhz"),
            aperture_mm: row.number("aperture_mm"),
            focus_mm: row.number("focus_mm"),
            levels: Vec::new(),
        });
        case.levels.push((row.number("behind_mm"), row.number("level_db")));
    }
    cases.into_values().collect()
}

impl Case {
    fn probe(&self) -> Probe {
        let depth_mm = self.depth_mm + self.levels.iter().map(|level| level.0).fold(0.0, f64::max) + 5.0;
        let flat = linear(LINES, 0.24, 1536, depth_mm);
        let kind = match self.radius_mm {
            Some(radius_mm) => ProbeKind::Convex { radius_mm, fov_deg: 60.0 },
            None if self.phased => ProbeKind::Phased { fov_deg: 70.0 },
            None => flat.kind,
        };
        Probe {
            kind,
            frequency_mhz: self.frequency_mhz,
            aperture_mm: self.aperture_mm,
            focus_mm: self.focus_mm,
            ..flat
        }
    }

    /// The obstacle as adjacent boxes along an arc of equal depth.
    fn obstacle(&self) -> Vec<insonify::anatomy::Mesh> {
        let plate = |across_mm: f64, width_mm: f64| {
            let (centre, turn) = match self.radius_mm {
                None => (DVec3::new(across_mm, 0.0, self.depth_mm), 0.0),
                Some(radius) => {
                    let angle = across_mm / (radius + self.depth_mm);
                    let far = radius + self.depth_mm;
                    (DVec3::new(far * angle.sin(), 0.0, far * angle.cos() - radius), angle)
                }
            };
            let size = Vec3::new(width_mm as f32, 60.0, THICK_MM as f32);
            analytic::plate(centre.as_vec3(), size, Quat::from_rotation_y(turn as f32))
        };
        let Some(_) = self.radius_mm else { return vec![plate(self.offset_mm, 2.0 * self.half_width_mm)] };
        let count = (2.0 * self.half_width_mm / 2.0).ceil() as u32;
        let width_mm = 2.0 * self.half_width_mm / f64::from(count);
        let place = |i: u32| self.offset_mm - self.half_width_mm + (f64::from(i) + 0.5) * width_mm;
        // Neighbours overlap a little on their inner side.
        (0..count).map(|i| plate(place(i), width_mm + if count > 1 { 0.02 } else { 0.0 })).collect()
    }

    /// Levels below the obstacle relative to those without it, dB.
    fn measured_db(&self, backend: &Backend, rays: u32, layers: u32, aperture: Choice) -> Vec<f64> {
        let (probe, mut settings) = (self.probe(), small(rays, layers));
        settings.effects = settings.effects.with(Effect::Aperture, aperture);
        let render = |obstacle: bool| {
            let mut bench = Bench::new(grainy(0.0, 0.01));
            let opaque = bench.tissue(Tissue { attenuation_db_cm_mhz: 100.0, ..grainy(0.0, 0.01) });
            // A scene has a surface: this one lies far from every beam.
            bench.add(opaque, 1, slab(DVec2::new(500.0, 0.0), 1.0, 0.0, 1.0));
            // The background in the obstacle's place, so that the scatterers stay where they are.
            let tissue = if obstacle { opaque } else { 0 };
            self.obstacle().into_iter().for_each(|mesh| bench.add(tissue, 1, mesh));
            frames(backend, bench, &probe, &settings)
        };
        let (with, without) = (render(true), render(false));
        let power = |frames: &[Frame], range_mm: f64| {
            frames.iter().map(|frame| power_about(&probe, frame, LINES / 2, range_mm, WINDOW_MM)).sum::<f64>()
        };
        let level = |&(behind_mm, _): &(f64, f64)| {
            let range_mm = self.depth_mm + behind_mm;
            10.0 * (power(&with, range_mm) / power(&without, range_mm)).max(1e-12).log10()
        };
        self.levels.iter().map(level).collect()
    }
}

/// Frames of the scene in [`SLICES`] slices, each with other scatterers.
fn frames(backend: &Backend, bench: Bench, probe: &Probe, settings: &RenderSettings) -> Vec<Frame> {
    let scene = bench.scene().unwrap();
    let mut renderer = Renderer::with_bvh(backend, &scene, Bvh::build(&scene).unwrap(), probe, settings).unwrap();
    let slice = |slice: u32| {
        let mut frame = Frame::default();
        renderer.render(&at(0.0, SLICE_MM * f64::from(slice), 0.0), &mut frame).unwrap();
        frame
    };
    (0..SLICES).map(slice).collect()
}

/// Whether a level is near enough to theory: within 4 dB above −25 dB, within 7 dB above −35 dB, and below −28 dB
/// otherwise.
fn good(theory_db: f64, measured_db: f64) -> bool {
    match theory_db {
        -25.0.. => (measured_db - theory_db).abs() <= 4.0,
        -35.0.. => (measured_db - theory_db).abs() <= 7.0,
        _ => measured_db < -28.0,
    }
}

/// Compares cases with theory; returns the fraction of levels near enough to it.
fn compare(cases: &[Case], rays: u32, layers: u32) -> f64 {
    compare_with(cases, rays, layers, Choice::Auto)
}

/// Like [`compare`], with a choice for the aperture effect.
fn compare_with(cases: &[Case], rays: u32, layers: u32, aperture: Choice) -> f64 {
    let backend = Backend::open(BackendChoice::Host).unwrap();
    let (mut count, mut within) = (0, 0);
    let mut squares = 0.0;
    let mut above = 0;
    for case in cases {
        let measured = case.measured_db(&backend, rays, layers, aperture);
        let mut text = String::new();
        for (&(behind_mm, theory_db), &measured_db) in case.levels.iter().zip(&measured) {
            let good = good(theory_db, measured_db);
            count += 1;
            within += u32::from(good);
            if theory_db > -25.0 {
                squares += (measured_db - theory_db).powi(2);
                above += 1;
            }
            text += &format!(" {behind_mm:.0}: {theory_db:.1}/{measured_db:.1}{}", if good { "" } else { " WRONG" });
        }
        println!(
            "{}strip {:.1} + {:.1} at {} mm, {} MHz, aperture {}, focus {}:{text}",
            case.radius_mm.map_or(String::new(), |r| format!("R {r} ")),
            2.0 * case.half_width_mm,
            case.offset_mm,
            case.depth_mm,
            case.frequency_mhz,
            case.aperture_mm,
            case.focus_mm
        );
    }
    let fraction = f64::from(within) / f64::from(count);
    println!(
        "{within} of {count} levels within bounds; rms above -25 dB {:.2} dB",
        (squares / f64::from(above)).sqrt()
    );
    fraction
}

/// Expected fraction of levels near enough to theory, as measured. The others are on steep edges, which single rays
/// locate to half a scanline. A level is a ratio of two speckle patterns, since an obstacle changes the beams'
/// profiles.
const LINEAR_GOOD: f64 = 0.96;
const CONVEX_GOOD: f64 = 0.93;
const PHASED_GOOD: f64 = 0.98;

#[test]
fn shadows_of_a_linear_array_are_those_of_diffraction() {
    let cases = cases("shadow.csv");
    assert!(cases.len() > 30);
    assert!(compare(&cases, 1, 1) >= LINEAR_GOOD);
}

#[test]
fn shadows_of_a_convex_array_are_those_of_diffraction() {
    assert!(compare(&cases("convex.csv"), 1, 1) >= CONVEX_GOOD);
}

#[test]
fn shadows_of_a_phased_array_are_those_of_diffraction() {
    let phased = |case: Case| Case { phased: true, ..case };
    let cases: Vec<Case> = cases("shadow.csv").into_iter().map(phased).collect();
    assert!(compare(&cases, 1, 1) >= PHASED_GOOD);
}

#[test]
fn shadows_with_many_rays_are_those_of_diffraction() {
    // The named cases of the fixture.
    let named = |case: &Case| case.frequency_mhz == 5.0 && case.aperture_mm == 20.0 && case.depth_mm % 20.0 == 0.0;
    let named: Vec<Case> = cases("shadow.csv").into_iter().filter(named).collect();
    assert!(named.len() > 12, "{}", named.len());
    assert_eq!(compare(&named, 32, 3), 1.0);
}

#[test]
fn without_the_aperture_shadows_are_wrong() {
    // A test that passes without the effect would prove nothing.
    let cases: Vec<Case> = cases("shadow.csv").into_iter().take(12).collect();
    assert!(compare_with(&cases, 1, 1, Choice::Off) < 0.7);
}
