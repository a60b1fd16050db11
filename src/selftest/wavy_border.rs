//! Images of wires beyond a wavy border between fat and muscle: lateral shift and width, compared with wave theory.

use std::f64::consts::TAU;

use glam::{DQuat, DVec2, DVec3};

use super::bench::{Bench, at, facing, linear, prism, silent, slab, small};
use super::fixture::fixture;
use super::measure::power_about;
use super::{Check, Family, Rig, Truth};
use crate::anatomy::Tissue;
use crate::render::{Choice, Effect, RenderError};
use crate::transducer::Probe;

/// Lateral positions of the wires, mm.
const WIRES_MM: [f64; 3] = [-15.0, 0.0, 15.0];
/// Depth of the wires, mm.
const DEPTH_MM: f64 = 95.0;
/// Sound speeds before and beyond the border, m/s.
const SPEEDS_M_S: [f64; 2] = [1450.0, 1580.0];
/// Mean depth, amplitude and period of the wavy border, mm.
const BORDER_MM: f64 = 20.0;
const HEIGHT_MM: f64 = 1.5;
const PERIOD_MM: f64 = 20.0;
/// Half of the border's length, and distance between its vertices, mm.
const HALF_MM: f64 = 45.0;
const STEP_MM: f64 = 0.25;
/// Side of the body that stands for a wire, mm. Only one scanline hits it.
const WIRE_MM: f64 = 0.3;
/// Largest lateral distance from a wire of the scanlines that show it, mm.
const REACH_MM: f64 = 7.5;
/// Half of the depth range in which a wire is shown, mm.
const AROUND_MM: f64 = 4.0;
/// Largest accepted errors: of a shift, mm, and of a width, as a fraction of it.
const SHIFT_MM: f64 = 0.2;
const WIDTH_PART: f64 = 0.2;
const LINES: u32 = 281;
const SPACING_MM: f64 = 0.25;

/// Expected shift and RMS width of a wire's image, mm, by diffraction sums.
fn expected_mm(wire_mm: f64) -> [f64; 2] {
    let table = include_str!("../../tests/truth/wires.csv");
    let value = |column: &str| fixture(table, &format!("{wire_mm},{DEPTH_MM}"), column);
    ["shift_mm", "spread_mm"].map(value)
}

/// Position of the wires beyond the wavy border.
pub(super) struct WavyBorder {
    place: DVec2,
}

impl WavyBorder {
    pub(super) fn new(bench: &mut Bench) -> Self {
        let place = bench.place();
        let [fat, muscle] = SPEEDS_M_S.map(|speed| bench.tissue(silent(speed, 1.5)));
        // Rough, so that it is visible at any angle.
        let wire = bench.tissue(Tissue { roughness: 0.5, ..silent(SPEEDS_M_S[1], 3.0) });
        bench.add(fat, 0, slab(place, HALF_MM, -1.0, 2.0 * BORDER_MM));
        let points = (2.0 * HALF_MM / STEP_MM) as u32;
        let xs: Vec<f64> = (0..=points).map(|i| f64::from(i) * STEP_MM - HALF_MM).collect();
        let border = |x: f64| BORDER_MM + HEIGHT_MM * (TAU * x / PERIOD_MM).sin();
        bench.add(muscle, 1, prism(place, &xs, border, |_| DEPTH_MM + 20.0));
        for across_mm in WIRES_MM {
            let point = place.extend(DEPTH_MM) + DVec3::new(across_mm, 0.0, 0.0);
            bench.add(wire, 2, facing(point, WIRE_MM, DQuat::IDENTITY));
        }
        Self { place }
    }

    /// Lateral shift and RMS width of each wire's image, mm.
    fn images_mm(&self, rig: &mut Rig, choice: Choice) -> Result<[[f64; 2]; WIRES_MM.len()], RenderError> {
        let probe = Probe {
            frequency_mhz: 8.0,
            aperture_mm: 20.0,
            focus_mm: 70.0,
            ..linear(LINES, SPACING_MM, 1536, DEPTH_MM + 10.0)
        };
        let mut settings = small(1, 1);
        settings.effects = settings.effects.with(Effect::Aperture, Choice::On).with(self.effect(), choice);
        let frame = rig.frame(&probe, &settings, &at(self.place.x, self.place.y, 0.0))?;
        // Lateral offset of each scanline near a wire, mm, and the power with which it shows the wire.
        let shown = |wire_mm: f64| {
            let x_mm = |number: u32| (f64::from(number) - f64::from(LINES / 2)) * SPACING_MM - wire_mm;
            let power = |number: u32| power_about(&probe, frame, number, DEPTH_MM, AROUND_MM);
            (0..LINES)
                .filter(|&number| x_mm(number).abs() <= REACH_MM)
                .map(|number| [x_mm(number), power(number)])
                .collect::<Vec<_>>()
        };
        Ok(WIRES_MM.map(|wire_mm| {
            let lines = shown(wire_mm);
            let mean = |of: &dyn Fn(f64) -> f64| {
                lines.iter().map(|&[x, power]| of(x) * power).sum::<f64>()
                    / lines.iter().map(|line| line[1]).sum::<f64>()
            };
            let shift_mm = mean(&|x| x);
            [shift_mm, mean(&|x| (x - shift_mm).powi(2)).sqrt()]
        }))
    }
}

impl Truth for WavyBorder {
    fn effect(&self) -> Effect {
        Effect::Refraction
    }

    fn quantity(&self) -> &'static str {
        "lateral place of wires behind a wavy border"
    }

    fn compare(&self, rig: &mut Rig, choice: Choice) -> Result<Vec<Check>, RenderError> {
        let images = self.images_mm(rig, choice)?;
        let check = |(wire_mm, [measured, _]): (f64, [f64; 2])| {
            let [expected, _] = expected_mm(wire_mm);
            let name = format!("wire {wire_mm:.0} mm off, behind a wavy border, shift");
            Check::new("Bent beams", name, "mm", expected, measured, SHIFT_MM)
        };
        Ok(WIRES_MM.into_iter().zip(images).map(check).collect())
    }
}

impl Family for WavyBorder {
    fn groups(&self) -> &'static [&'static str] {
        &["Bent beams"]
    }

    fn measure(&self, rig: &mut Rig) -> Result<Vec<Check>, RenderError> {
        let images = self.images_mm(rig, Choice::On)?;
        let checks = |(wire_mm, [shift, width]): (f64, [f64; 2])| {
            let [shift_mm, width_mm] = expected_mm(wire_mm);
            let name = |what: &str| format!("wire {wire_mm:.0} mm off, behind a wavy border, {what}");
            [
                Check::new("Bent beams", name("shift"), "mm", shift_mm, shift, SHIFT_MM),
                Check::new("Bent beams", name("RMS width"), "mm", width_mm, width, WIDTH_PART * width_mm),
            ]
        };
        Ok(WIRES_MM.into_iter().zip(images).flat_map(checks).collect())
    }
}
