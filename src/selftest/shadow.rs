//! Speckle in the shadow of an opaque rod, compared with diffraction sums.

use glam::{DVec2, Vec3};

use super::bench::{Bench, at, grainy, linear, slab, small};
use super::fixture::fixture;
use super::measure::power_about;
use super::{Check, Family, Rig, Truth};
use crate::anatomy::{Tissue, analytic};
use crate::render::{Choice, Effect, RenderError};
use crate::transducer::Probe;

/// Depth and width of the rod, mm.
const ROD_MM: [f64; 2] = [60.0, 3.0];
/// Distances below the rod at which speckle is compared, mm.
const BEHIND_MM: [f64; 4] = [10.0, 20.0, 40.0, 60.0];
/// Transmit focal depths, mm.
const FOCI_MM: [f64; 3] = [60.0, 90.0, 120.0];
/// Elevational offsets of the frames whose power is averaged, mm.
const SLIDES_MM: [f64; 7] = [-15.0, -10.0, -5.0, 0.0, 5.0, 10.0, 15.0];
/// Power is averaged over depths within this distance of the compared one, mm.
const HALF_MM: f64 = 2.0;
/// Range of lateral distances from the shadow's middle at which scanlines count as unshadowed, mm.
const BESIDE_MM: [f64; 2] = [15.0, 24.0];
const LINES: u32 = 255;
const SPACING_MM: f64 = 0.24;

/// Speckle level below the rod relative to the level without a rod, dB, by diffraction sums.
fn level_db(focus_mm: f64, behind_mm: f64) -> f64 {
    let [depth_mm, width_mm] = ROD_MM;
    let key = format!("{depth_mm},{},0,5,20,{focus_mm},{behind_mm}", 0.5 * width_mm);
    fixture(include_str!("../../tests/truth/shadow.csv"), &key, "level_db")
}

/// Position of a rod in a block of speckle.
pub(super) struct Shadow {
    place: DVec2,
}

impl Shadow {
    pub(super) fn new(bench: &mut Bench) -> Self {
        let place = bench.place();
        let speckle = bench.tissue(grainy(0.0, 0.01));
        let opaque = bench.tissue(Tissue { attenuation_db_cm_mhz: 100.0, ..grainy(0.0, 0.01) });
        bench.add(speckle, 1, slab(place, 40.0, -1.0, 130.0));
        let [depth_mm, width_mm] = ROD_MM;
        let size = Vec3::new(width_mm as f32, 60.0, 1.0);
        bench.add(opaque, 2, analytic::plate(place.extend(depth_mm).as_vec3(), size, glam::Quat::IDENTITY));
        Self { place }
    }

    /// Speckle levels at [`BEHIND_MM`] below the rod, relative to unshadowed scanlines, dB.
    fn levels_db(&self, rig: &mut Rig, focus_mm: f64, choice: Choice) -> Result<Vec<f64>, RenderError> {
        let probe = Probe { frequency_mhz: 5.0, aperture_mm: 20.0, focus_mm, ..linear(LINES, SPACING_MM, 1536, 125.0) };
        let mut settings = small(1, 1);
        settings.effects = settings.effects.with(Effect::Aperture, choice);
        let (mut behind, mut beside) = ([0.0; BEHIND_MM.len()], [0.0; BEHIND_MM.len()]);
        for slide in SLIDES_MM {
            let frame = rig.frame(&probe, &settings, &at(self.place.x, self.place.y + slide, 0.0))?;
            let power = |number: u32, range_mm: f64| power_about(&probe, frame, number, range_mm, HALF_MM);
            let aside = |number: &u32| {
                let mm = (f64::from(*number) - f64::from(LINES / 2)).abs() * SPACING_MM;
                (BESIDE_MM[0]..BESIDE_MM[1]).contains(&mm)
            };
            let lines: Vec<u32> = (0..LINES).filter(aside).collect();
            for (i, mm) in BEHIND_MM.iter().enumerate() {
                let range_mm = ROD_MM[0] + mm;
                behind[i] += power(LINES / 2, range_mm);
                beside[i] += lines.iter().map(|&number| power(number, range_mm)).sum::<f64>() / lines.len() as f64;
            }
        }
        Ok(behind.iter().zip(beside).map(|(behind, beside)| 10.0 * (behind / beside).max(1e-12).log10()).collect())
    }
}

impl Truth for Shadow {
    fn effect(&self) -> Effect {
        Effect::Aperture
    }

    fn quantity(&self) -> &'static str {
        "speckle behind a rod"
    }

    fn compare(&self, rig: &mut Rig, choice: Choice) -> Result<Vec<Check>, RenderError> {
        let mut checks = Vec::new();
        for focus_mm in FOCI_MM {
            let measured = self.levels_db(rig, focus_mm, choice)?;
            for (behind_mm, measured) in BEHIND_MM.into_iter().zip(measured) {
                let expected = level_db(focus_mm, behind_mm);
                // Levels near the limit of a display's range have a wider tolerance. Deeper levels are not compared.
                let tolerance = match expected {
                    -25.0.. => 4.0,
                    -35.0.. => 7.0,
                    ..-35.0 => continue,
                    // NaN: the table has no value, so the check has to fail.
                    _ => 0.0,
                };
                let name = format!("{behind_mm:.0} mm behind a rod of {:.0} mm, focus {focus_mm:.0} mm", ROD_MM[1]);
                checks.push(Check::new("Shadow", name, "dB", expected, measured, tolerance));
            }
        }
        Ok(checks)
    }
}

impl Family for Shadow {
    fn groups(&self) -> &'static [&'static str] {
        &["Shadow"]
    }

    fn measure(&self, rig: &mut Rig) -> Result<Vec<Check>, RenderError> {
        self.compare(rig, Choice::On)
    }
}
