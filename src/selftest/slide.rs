//! Correlation of speckle before and after elevational slides of the probe, compared with diffraction of the lens.

use glam::{DQuat, DVec2, DVec3};

use super::bench::{Bench, at, grainy, linear, slab, small};
use super::fixture::fixture;
use super::measure::line;
use super::{Check, Family, Rig, Truth};
use crate::pose::Pose;
use crate::render::{Choice, Effect, RenderError};
use crate::transducer::Probe;

/// Elevational slides of the probe, mm.
const SLIDES_MM: [f64; 3] = [0.1, 0.5, 1.0];
/// Depths at which speckle is correlated, mm.
const DEPTHS_MM: [f64; 3] = [30.0, 70.0, 120.0];
/// Frequency (MHz), and height and focal depth of the elevational lens, mm.
const FREQUENCY_MHZ: f64 = 5.0;
const LENS_MM: [f64; 2] = [12.0, 70.0];
/// Half of the depth range over which samples are correlated, mm.
const HALF_MM: f64 = 9.0;
/// Turns of the scan plane about the probe's axis, over which correlations are averaged, degrees.
const TURNS_DEG: [f64; 5] = [3.0, 38.0, 75.0, 111.0, 149.0];
/// Largest accepted error of a mean correlation.
const TOLERANCE: f64 = 0.07;
const LINES: u32 = 144;

/// Expected correlation after a slide, by diffraction sums.
fn expected(depth_mm: f64, slide_mm: f64) -> f64 {
    let [height_mm, focus_mm] = LENS_MM;
    let key = format!("{FREQUENCY_MHZ},{height_mm},{focus_mm},{depth_mm},{slide_mm}");
    fixture(include_str!("../../tests/truth/elevation.csv"), &key, "correlation")
}

/// Position of a block of speckle.
pub(super) struct Slide {
    place: DVec2,
}

/// Complex samples around each depth.
type Patches = [Vec<DVec2>; DEPTHS_MM.len()];

impl Slide {
    pub(super) fn new(bench: &mut Bench) -> Self {
        let place = bench.place();
        let speckle = bench.tissue(grainy(0.0, 0.01));
        bench.add(speckle, 1, slab(place, 40.0, -1.0, 135.0));
        Self { place }
    }

    fn patches(&self, rig: &mut Rig, turn_deg: f64, slide_mm: f64, choice: Choice) -> Result<Patches, RenderError> {
        let [elevational_height_mm, elevational_focus_mm] = LENS_MM;
        let lens = Probe { elevational_height_mm, elevational_focus_mm, ..linear(LINES, 0.3, 2600, 130.0) };
        let probe = Probe { frequency_mhz: FREQUENCY_MHZ, ..lens };
        let mut settings = small(1, 1);
        settings.effects = settings.effects.with(Effect::ElevationalSpeckle, choice);
        let orientation = DQuat::from_rotation_z(turn_deg.to_radians());
        let face = at(self.place.x, self.place.y, 0.0).position_mm + orientation * DVec3::Y * slide_mm;
        let frame = rig.frame(&probe, &settings, &Pose { position_mm: face, orientation })?;
        let sample = |mm: f64| (mm / probe.sample_spacing_mm()) as usize;
        Ok(DEPTHS_MM.map(|depth_mm| {
            let range = sample(depth_mm - HALF_MM)..sample(depth_mm + HALF_MM);
            // Omits scanlines whose beam is cut off by the end of the array.
            let lines =
                (8..LINES - 8).flat_map(|number| line(&probe, frame, number).get(range.clone()).unwrap_or_default());
            lines.map(|&[re, im]| DVec2::new(re.into(), im.into())).collect()
        }))
    }
}

/// Magnitude of the normalised complex correlation, 0 to 1.
fn correlation(a: &[DVec2], b: &[DVec2]) -> f64 {
    let power = |of: &[DVec2]| of.iter().map(|v| v.length_squared()).sum::<f64>();
    // `rotate` multiplies as complex numbers; the conjugate makes it a correlation.
    let sum: DVec2 = a.iter().zip(b).map(|(a, b)| DVec2::new(b.x, -b.y).rotate(*a)).sum();
    sum.length() / (power(a) * power(b)).sqrt()
}

impl Truth for Slide {
    fn effect(&self) -> Effect {
        Effect::ElevationalSpeckle
    }

    fn quantity(&self) -> &'static str {
        "speckle's correlation after a slide"
    }

    fn compare(&self, rig: &mut Rig, choice: Choice) -> Result<Vec<Check>, RenderError> {
        let mut sums = [[0.0; SLIDES_MM.len()]; DEPTHS_MM.len()];
        for turn_deg in TURNS_DEG {
            let before = self.patches(rig, turn_deg, 0.0, choice)?;
            for (i, slide_mm) in SLIDES_MM.into_iter().enumerate() {
                let now = self.patches(rig, turn_deg, slide_mm, choice)?;
                for ((sums, before), now) in sums.iter_mut().zip(&before).zip(&now) {
                    sums[i] += correlation(before, now);
                }
            }
        }
        let mut checks = Vec::new();
        for (depth_mm, sums) in DEPTHS_MM.into_iter().zip(sums) {
            for (slide_mm, sum) in SLIDES_MM.into_iter().zip(sums) {
                let name = format!("correlation at {depth_mm:.0} mm after a slide of {slide_mm} mm");
                let measured = sum / TURNS_DEG.len() as f64;
                checks.push(Check::new("Slide", name, "", expected(depth_mm, slide_mm), measured, TOLERANCE));
            }
        }
        Ok(checks)
    }
}

impl Family for Slide {
    fn groups(&self) -> &'static [&'static str] {
        &["Slide"]
    }

    fn measure(&self, rig: &mut Rig) -> Result<Vec<Check>, RenderError> {
        self.compare(rig, Choice::On)
    }
}
