//! Errors of post-processing steps (parts of a look): remaining variation of a uniform tissue and of receiver noise,
//! and width of a point.

use glam::DVec2;

use super::bench::{Bench, at, grainy, post, silent, slab, small};
use super::measure::{half_width, line, magnitude};
use super::rig::Rig;
use super::{SelfTestError, TruthError};
use crate::anatomy::{Bvh, Scene};
use crate::look::{Look, Shape};
use crate::render::{Backend, Choice, Effect, ImageSettings, RenderError, RenderSettings, Renderer};
use crate::settings::{LookSettings, ReceiverSettings};
use crate::transducer::{Probe, ProbeKind};

/// Level of the receiver noise before gain and TGC, dB relative to the echo of a perfect reflector.
const NOISE_DB: f64 = -70.0;
/// Depth of the point target, mm. The focus is there as well.
const POINT_MM: f64 = 70.0;
/// Number of frames in a sequence, and time between them, s. Persistence has settled at the end.
const FRAMES: u32 = 16;
const FRAME_S: f64 = 0.04;
/// Measured part of the picture, as fractions: from and to across, then from and to in depth.
const PART: [[f64; 2]; 2] = [[0.4, 0.6], [0.3, 0.8]];
/// Tolerance: standard deviation of the level that is hard to see, dB.
const LEVEL_DB: f64 = 1.0;
/// Tolerance: width that is hard to see in a picture of 15 cm, mm.
const WIDTH_MM: f64 = 0.3;

/// A post-processing step, and the errors with and without it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LookError {
    /// Plain post-processing, [`LookSettings::default`], with this step added.
    pub look: LookSettings,
    /// Whether the step is tissue harmonics.
    pub harmonics: bool,
    /// Errors with and without the step.
    pub error: TruthError,
}

/// Kind of specimen on which a step is measured.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Specimen {
    /// Uniform tissue, whose ideal picture has one level.
    Tissue,
    /// Water, whose picture is only receiver noise.
    Noise,
    /// Point target, whose ideal picture has no width.
    Point,
}

/// Name of a step, its specimen, and the plain post-processing with this step.
type Step = (&'static str, Specimen, LookSettings);

const HARMONICS: &str = "harmonics";

fn steps() -> [Step; 4] {
    let plain = LookSettings::default();
    [
        ("angles = 9", Specimen::Tissue, LookSettings { angles: 9, ..plain }),
        ("speckle_reduction = 0.5", Specimen::Tissue, LookSettings { speckle_reduction: 0.5, ..plain }),
        ("persistence = 0.7", Specimen::Noise, LookSettings { persistence: 0.7, ..plain }),
        (HARMONICS, Specimen::Point, plain),
    ]
}

/// Measures the errors with and without each post-processing step that theory covers. `progress` gets the number of
/// finished steps, and the total.
///
/// # Errors
/// A device that fails.
pub(crate) fn look_errors(backend: &Backend, progress: &dyn Fn(usize, usize)) -> Result<Vec<LookError>, SelfTestError> {
    let mut bench = Bench::new(silent(1540.0, 1.5));
    let specimens = Specimens::new(&mut bench);
    let new = |scene: &Scene, bvh: Bvh, probe: &Probe, settings: &RenderSettings| {
        Renderer::with_bvh(backend, scene, bvh, probe, settings)
    };
    let mut rig = Rig::new(&bench.scene()?, &new)?;
    let steps = steps();
    let total = steps.len();
    let mut errors = Vec::with_capacity(total);
    for (done, (name, specimen, look)) in steps.into_iter().enumerate() {
        progress(done, total);
        let harmonics = name == HARMONICS;
        let without = specimens.error(&mut rig, specimen, LookSettings::default(), false)?;
        let with = specimens.error(&mut rig, specimen, look, harmonics)?;
        let (quantity, unit, tolerance) = match specimen {
            Specimen::Tissue => ("deviation of a uniform tissue's level", "dB", LEVEL_DB),
            Specimen::Noise => ("deviation of the noise's level", "dB", LEVEL_DB),
            Specimen::Point => ("width of a point at the focus, 4 MHz", "mm", WIDTH_MM),
        };
        let error = TruthError {
            effect: name.to_owned(),
            quantity: quantity.to_owned(),
            unit: unit.to_owned(),
            values: 1,
            tolerance,
            without,
            with,
        };
        errors.push(LookError { look, harmonics, error });
    }
    progress(total, total);
    Ok(errors)
}

/// Positions of the specimens.
struct Specimens {
    tissue: DVec2,
    noise: DVec2,
    point: DVec2,
}

impl Specimens {
    fn new(bench: &mut Bench) -> Self {
        let [tissue, noise, point] = [bench.place(), bench.place(), bench.place()];
        let speckle = bench.tissue(grainy(0.0, 0.01));
        bench.add(speckle, 1, slab(tissue, 40.0, -20.0, 130.0));
        let target = bench.tissue(silent(1540.0, 1.7));
        let probe = fan(false);
        bench.add(target, 1, post(point.extend(0.0), &probe, probe.scanlines / 2, POINT_MM, 300.0));
        Self { tissue, noise, point }
    }

    fn error(
        &self,
        rig: &mut Rig,
        specimen: Specimen,
        look: LookSettings,
        harmonics: bool,
    ) -> Result<f64, RenderError> {
        match specimen {
            Specimen::Tissue => deviation_db(rig, self.tissue, look, 1),
            Specimen::Noise => deviation_db(rig, self.noise, look, FRAMES),
            Specimen::Point => width_mm(rig, self.point, &fan(harmonics)),
        }
    }
}

/// Convex probe whose scanlines are close together at the focus.
fn fan(harmonics: bool) -> Probe {
    let kind = ProbeKind::Convex { radius_mm: 40.0, fov_deg: 20.0 };
    Probe { kind, harmonics, frequency_mhz: 4.0, focus_mm: POINT_MM, ..Probe::default() }
}

/// Standard deviation of the levels, dB, in the middle of a picture. The picture is the last of `frames` successive
/// ones.
fn deviation_db(rig: &mut Rig, place: DVec2, look: LookSettings, frames: u32) -> Result<f64, RenderError> {
    let probe = super::bench::linear(256, 0.3, 1536, 80.0);
    let base = small(1, 1);
    let image = ImageSettings {
        width: 400,
        height: 500,
        gain_db: 30.0,
        tgc_db_per_cm: 0.0,
        dynamic_range_db: 60.0,
        ..base.image
    };
    let receiver = ReceiverSettings { noise_db: NOISE_DB, ..ReceiverSettings::default() };
    let mut settings = RenderSettings { image, look, receiver, ..base };
    settings.effects = settings.effects.with(Effect::Noise, Choice::On);
    let mut memory = Look::default();
    let mut picture = Vec::new();
    for number in 0..frames {
        rig.set_time_s(FRAME_S * f64::from(number));
        let frame = rig.frame(&probe, &settings, &at(place.x, place.y, 0.0))?.clone();
        picture.clone_from(&frame.bmode);
        let shape =
            Shape::new(image.width, rig.sector().pixel_mm, &frame.mask, &image, look.independent_angles(&probe));
        memory.apply(&look, shape, &mut picture);
    }
    let [columns, rows] = [(PART[0], image.width), (PART[1], image.height)]
        .map(|(part, size)| part.map(|p| (p * f64::from(size)) as usize));
    let levels_db: Vec<f64> = picture
        .chunks_exact(image.width as usize)
        .take(rows[1])
        .skip(rows[0])
        .flat_map(|row| row.get(columns[0]..columns[1]).unwrap_or_default())
        .map(|&level| f64::from(level) / 255.0 * image.dynamic_range_db)
        .collect();
    let count = levels_db.len() as f64;
    let mean_db = levels_db.iter().sum::<f64>() / count;
    Ok((levels_db.iter().map(|db| (db - mean_db).powi(2)).sum::<f64>() / count).sqrt())
}

/// Full lateral width of the point at half its amplitude, mm.
fn width_mm(rig: &mut Rig, place: DVec2, probe: &Probe) -> Result<f64, RenderError> {
    let frame = rig.frame(probe, &small(1, 1), &at(place.x, place.y, 0.0))?;
    let sample = (POINT_MM / probe.sample_spacing_mm()) as usize;
    let across: Vec<f64> = (0..probe.scanlines)
        .map(|number| line(probe, frame, number).get(sample).map_or(0.0, |&s| magnitude(s)))
        .collect();
    Ok(half_width(&across) * probe.line_spacing_mm(POINT_MM))
}
