//! Image position of a point beyond a tilted boundary between two sound speeds, compared with a full-wave simulation.

use glam::{DQuat, DVec2, DVec3};

use super::bench::{Bench, at, facing, linear, silent, slab, small};
use super::fixture::fixture;
use super::measure::{line, magnitude};
use super::{Check, Family, Rig, Truth};
use crate::anatomy::Tissue;
use crate::render::{Choice, Effect, RenderError};
use crate::transducer::Probe;

/// A tilted boundary, and a point beyond it.
struct Case {
    /// Sound speeds before and beyond the boundary, m/s.
    speeds_m_s: [f64; 2],
    /// Depth of the boundary on the probe's axis (mm), and its tilt (degrees). It is deeper at positive lateral
    /// positions.
    depth_mm: f64,
    tilt_deg: f64,
    /// Lateral position and depth of the point, mm.
    point_mm: [f64; 2],
}

const CASES: [Case; 4] = [
    case([1450.0, 1580.0], 25.0, 20.0, [0.0, 60.0]),
    case([1450.0, 1580.0], 25.0, 30.0, [0.0, 49.92]),
    case([1600.0, 1450.0], 25.0, 20.0, [0.0, 60.0]),
    case([1450.0, 1600.0], 15.0, 20.0, [3.04, 69.92]),
];
/// Largest accepted error of an image position, mm. The simulation's grid has cells of 0.16 mm.
const TOLERANCE_MM: f64 = 0.1;
/// Side of the body that stands for the point, mm.
const POINT_MM: f64 = 0.4;
/// The array is wider than the aperture and the displacement need.
const LINES: u32 = 257;
const SPACING_MM: f64 = 0.15;

const fn case(speeds_m_s: [f64; 2], depth_mm: f64, tilt_deg: f64, point_mm: [f64; 2]) -> Case {
    Case { speeds_m_s, depth_mm, tilt_deg, point_mm }
}

impl Case {
    /// Lateral position and depth at which a scanner shows the point, mm, from the k-Wave simulation.
    fn shown_mm(&self) -> [f64; 2] {
        let ([near, far], [across, depth]) = (self.speeds_m_s, self.point_mm);
        let key = format!("2.5,20,{near},{far},{},{},{across},{depth}", self.depth_mm, self.tilt_deg);
        let table = include_str!("../../tests/truth/full_wave_refraction.csv");
        ["shown_lateral_mm", "shown_depth_mm"].map(|column| fixture(table, &key, column))
    }
}

/// Direction of an image displacement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Axis {
    /// Across the scanlines, because beams bend.
    Lateral,
    /// Along the scanlines, by the time of flight.
    Depth,
}

/// Positions of the points beyond tilted boundaries, and the compared direction.
pub(super) struct TiltedFace {
    places: [DVec2; CASES.len()],
    axis: Axis,
}

impl TiltedFace {
    pub(super) fn new(bench: &mut Bench, axis: Axis) -> Self {
        let places = CASES.each_ref().map(|case| {
            let place = bench.place();
            let [near, far] = case.speeds_m_s.map(|speed| bench.tissue(silent(speed, 1.5)));
            // Rough, so that it is visible at any angle.
            let point = bench.tissue(Tissue { roughness: 0.5, ..silent(case.speeds_m_s[1], 3.0) });
            bench.add(near, 0, slab(place, 40.0, -1.0, 50.0));
            let turn = DQuat::from_rotation_y(-case.tilt_deg.to_radians());
            bench.add(far, 1, facing(place.extend(case.depth_mm), 70.0, turn));
            let [across_mm, depth_mm] = case.point_mm;
            let target = place.extend(depth_mm) + DVec3::new(across_mm, 0.0, 0.0);
            bench.add(point, 2, facing(target, POINT_MM, DQuat::IDENTITY));
            place
        });
        Self { places, axis }
    }

    /// Image position of the point, mm: lateral centre of its echo, weighted by power, and mean range of the echo's
    /// front.
    fn shown_mm(&self, rig: &mut Rig, case: &Case, place: DVec2, choice: Choice) -> Result<[f64; 2], RenderError> {
        let probe = Probe { frequency_mhz: 2.5, aperture_mm: 20.0, ..linear(LINES, SPACING_MM, 4096, 85.0) };
        let mut settings = small(1, 1);
        settings.effects = settings.effects.with(Effect::Aperture, Choice::On).with(self.effect(), choice);
        // The middle scanline passes through the image position of the simulation.
        let [middle_mm, _] = case.shown_mm();
        let frame = rig.frame(&probe, &settings, &at(place.x + middle_mm, place.y, 0.0))?;
        let sample = |mm: f64| (mm / probe.sample_spacing_mm()) as usize;
        let from = sample(case.point_mm[1] - 4.0);
        let (mut peaks, mut weights, mut ranges) = (0.0, 0.0, 0.0);
        for number in 0..LINES {
            let echo = line(&probe, frame, number).get(from..sample(case.point_mm[1] + 4.0)).unwrap_or_default();
            let heights: Vec<f64> = echo.iter().map(|&s| magnitude(s)).collect();
            // The first high peak is the front of the body; its back gives a later one.
            let greatest = heights.iter().copied().fold(0.0, f64::max);
            let is_front = |pair: &[f64]| pair[0] >= 0.5 * greatest && pair[0] >= pair[1];
            let Some(at) = heights.windows(2).position(is_front) else { continue };
            let height = heights[at];
            let weight = height * height;
            weights += weight;
            peaks += weight * (f64::from(number) - f64::from(LINES / 2)) * SPACING_MM;
            ranges += weight * ((from + at) as f64 + 0.5) * probe.sample_spacing_mm();
        }
        Ok([middle_mm + peaks / weights, ranges / weights])
    }

    fn both_axes(&self, rig: &mut Rig, choice: Choice) -> Result<Vec<(Axis, Check)>, RenderError> {
        let mut checks = Vec::new();
        for (case, &place) in CASES.iter().zip(&self.places) {
            let shown = self.shown_mm(rig, case, place, choice)?;
            let [near, far] = case.speeds_m_s;
            for ((axis, expected), measured) in [Axis::Lateral, Axis::Depth].into_iter().zip(case.shown_mm()).zip(shown)
            {
                let name = format!("{near:.0} to {far:.0} m/s under {:.0}°, {} of a point", case.tilt_deg, axis.name());
                checks.push((axis, Check::new("Full wave", name, "mm", expected, measured, TOLERANCE_MM)));
            }
        }
        Ok(checks)
    }
}

impl Axis {
    fn name(self) -> &'static str {
        match self {
            Self::Lateral => "lateral place",
            Self::Depth => "depth",
        }
    }
}

impl Truth for TiltedFace {
    fn effect(&self) -> Effect {
        match self.axis {
            Axis::Lateral => Effect::Refraction,
            Axis::Depth => Effect::SpeedDisplacement,
        }
    }

    fn quantity(&self) -> &'static str {
        match self.axis {
            Axis::Lateral => "lateral place of a point behind a tilted face",
            Axis::Depth => "depth of a point behind a tilted face",
        }
    }

    fn compare(&self, rig: &mut Rig, choice: Choice) -> Result<Vec<Check>, RenderError> {
        let both = self.both_axes(rig, choice)?;
        Ok(both.into_iter().filter(|(axis, _)| *axis == self.axis).map(|(_, check)| check).collect())
    }
}

impl Family for TiltedFace {
    fn groups(&self) -> &'static [&'static str] {
        &["Full wave"]
    }

    fn measure(&self, rig: &mut Rig) -> Result<Vec<Check>, RenderError> {
        Ok(self.both_axes(rig, Choice::On)?.into_iter().map(|(_, check)| check).collect())
    }
}
