//! Speckle near the edge of contact, with half of the probe's face lifted off the skin, compared with diffraction sums.

use glam::{DVec2, Vec3};

use super::bench::{Bench, at, grainy, linear, small};
use super::fixture::fixture;
use super::measure::power_about;
use super::{Check, Family, Rig, Truth};
use crate::anatomy::{Tissue, analytic};
use crate::render::{Choice, Effect, RenderError};
use crate::transducer::Probe;

/// Depths of the compared speckle, mm.
const DEPTHS_MM: [f64; 2] = [60.0, 100.0];
/// Distances of the compared scanlines from the edge of contact, mm; negative where the face is lifted.
const PLACES_MM: [f64; 5] = [-5.0, -2.0, 0.0, 3.0, 10.0];
/// Largest accepted error of a speckle level, dB.
const TOLERANCE_DB: f64 = 2.0;
/// Thickness of the gel film under the lifted half, and of the air gap beyond, mm. Only −92 dB pass it.
const GEL_MM: f64 = 3.0;
const GAP_MM: f64 = 2.0;
/// Elevational offsets of the frames whose power is summed, mm.
const SLIDES_MM: [f64; 2] = [-3.0, 3.0];
/// Half of the depth range over which power is summed, mm.
const HALF_MM: f64 = 4.0;
/// Largest lateral distance of a scanline from a compared position to count there, mm.
const BESIDE_MM: f64 = 0.2;
const LINES: u32 = 200;
const SPACING_MM: f64 = 0.25;

/// Speckle level with half contact relative to full contact, dB, by diffraction sums.
fn level_db(place_mm: f64, depth_mm: f64) -> f64 {
    let key = format!("contact,8,20,70,{place_mm},{depth_mm}");
    fixture(include_str!("../../tests/truth/edges.csv"), &key, "level_db")
}

/// Power of each scanline at each depth [depths][scanlines].
type Powers = [Vec<f64>; DEPTHS_MM.len()];

/// Position of a body whose skin lies deeper on one side.
pub(super) struct HalfContact {
    place: DVec2,
}

impl HalfContact {
    pub(super) fn new(bench: &mut Bench) -> Self {
        let place = bench.place();
        let speckle = bench.tissue(Tissue { attenuation_db_cm_mhz: 0.0, ..grainy(0.0, 0.01) });
        for (from, to, skin_mm) in [(0.0, 40.0, -20.0), (-40.0, 0.0, GEL_MM + GAP_MM)] {
            let corner = |x: f64, y: f64, z: f64| (place + DVec2::new(x, y)).extend(z).as_vec3();
            let [min, max]: [Vec3; 2] = [corner(from, -40.0, skin_mm), corner(to, 40.0, 130.0)];
            bench.add(speckle, 1, analytic::cuboid(min, max));
        }
        Self { place }
    }

    /// Powers with half of the face in contact if `contact` is on, otherwise with the whole face.
    fn powers(&self, rig: &mut Rig, aperture: Choice, contact: Choice) -> Result<Powers, RenderError> {
        let probe =
            Probe { frequency_mhz: 8.0, aperture_mm: 20.0, focus_mm: 70.0, ..linear(LINES, SPACING_MM, 1536, 110.0) };
        let mut settings = small(1, 1);
        settings.effects = settings.effects.with(Effect::Aperture, aperture).with(Effect::Contact, contact);
        settings.contact.gel_mm = GEL_MM;
        // No reverberation: the levels compare only what the body returns.
        settings.receiver.reverberation_db = -400.0;
        let mut powers = DEPTHS_MM.map(|_| vec![0.0; LINES as usize]);
        for slide_mm in SLIDES_MM {
            let frame = rig.frame(&probe, &settings, &at(self.place.x, self.place.y + slide_mm, 0.0))?;
            for (row, depth_mm) in powers.iter_mut().zip(DEPTHS_MM) {
                for (number, power) in (0..LINES).zip(row) {
                    *power += power_about(&probe, frame, number, depth_mm, HALF_MM);
                }
            }
        }
        Ok(powers)
    }
}

/// Power of the scanlines near a lateral position, summed.
fn there(row: &[f64], place_mm: f64) -> f64 {
    let x_mm = |number: u32| (f64::from(number) + 0.5 - 0.5 * f64::from(LINES)) * SPACING_MM;
    (0_u32..)
        .zip(row)
        .filter(|&(number, _)| (x_mm(number) - place_mm).abs() <= BESIDE_MM)
        .map(|(_, &power)| power)
        .sum()
}

impl Truth for HalfContact {
    fn effect(&self) -> Effect {
        Effect::Aperture
    }

    fn quantity(&self) -> &'static str {
        "speckle beside half a face in contact"
    }

    fn compare(&self, rig: &mut Rig, choice: Choice) -> Result<Vec<Check>, RenderError> {
        let half = self.powers(rig, choice, Choice::On)?;
        let whole = self.powers(rig, choice, Choice::Off)?;
        let mut checks = Vec::new();
        for place_mm in PLACES_MM {
            for (depth, depth_mm) in DEPTHS_MM.into_iter().enumerate() {
                let expected = level_db(place_mm, depth_mm);
                let ratio = there(&half[depth], place_mm) / there(&whole[depth], place_mm);
                let measured = 10.0 * ratio.max(1e-12).log10();
                let name = format!("half a face in contact, {place_mm:.0} mm from the edge, {depth_mm:.0} mm deep");
                checks.push(Check::new("Contact", name, "dB", expected, measured, TOLERANCE_DB));
            }
        }
        Ok(checks)
    }
}

impl Family for HalfContact {
    fn groups(&self) -> &'static [&'static str] {
        &["Contact"]
    }

    fn measure(&self, rig: &mut Rig) -> Result<Vec<Check>, RenderError> {
        self.compare(rig, Choice::On)
    }
}
