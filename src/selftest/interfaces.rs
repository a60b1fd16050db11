//! Echoes of plane interfaces: amplitudes compared with Fresnel's formula, ranges with times of flight, losses with
//! attenuation.

use glam::{DQuat, DVec2};

use super::bench::{Bench, at, facing, linear, silent, slab, small};
use super::measure::{Echo, echoes, line, magnitude};
use super::{Check, Family, Rig};
use crate::acoustics::ASSUMED_SPEED_M_S;
use crate::acoustics::attenuation::attenuation_db_mm;
use crate::acoustics::decibel::db_from_amplitude;
use crate::acoustics::interface::interface;
use crate::anatomy::Tissue;
use crate::render::RenderError;
use crate::statistics::slope;
use crate::transducer::Probe;

/// Depth of the interfaces at normal incidence, mm.
const NORMAL_MM: f64 = 37.3;
/// Names of the media before and beyond an interface, and their impedances, MRayl.
const NORMAL: [(&str, f64, f64); 4] = [
    ("water to bone", 1.48, 7.8),
    ("fat to muscle", 1.38, 1.65),
    ("muscle to liver", 1.65, 1.62),
    ("tissue to air", 1.65, 0.0004),
];
/// Speed (m/s) and impedance (MRayl) of the medium before oblique interfaces, the background.
const OBLIQUE_SPEED: f64 = 1540.0;
const OBLIQUE_IMPEDANCE: f64 = 1.5;
/// Depth of oblique interfaces, mm.
const OBLIQUE_MM: f64 = 30.0;
/// For each oblique interface: angle of incidence (degrees), then impedance (MRayl) and speed (m/s) of the second
/// medium.
const OBLIQUE: [(f64, f64, f64); 2] = [(20.0, 1.65, 1700.0), (20.0, 7.8, 4080.0)];
/// Name and speed (m/s) of each layer. Then the depths of its faces, and of the plate beyond it, mm.
const LAYERS: [(&str, f64); 2] = [("fat", 1450.0), ("bone", 4080.0)];
const LAYER_MM: (f64, f64) = (8.0, 20.0);
const BEHIND_MM: f64 = 35.0;
/// Attenuation of the medium before the plates (dB/cm/MHz), and depths of the plates, mm.
const ALPHA: f64 = 0.5;
const PLATES_MM: [f64; 3] = [5.0, 20.0, 41.0];

/// Positions of the specimens with plane interfaces.
pub(super) struct Interfaces {
    normal: Vec<DVec2>,
    /// For each case, a reference plate with the background's speed, and the plate of the case.
    oblique: Vec<[DVec2; 2]>,
    layers: Vec<DVec2>,
    plates: Vec<DVec2>,
}

impl Interfaces {
    pub(super) fn new(bench: &mut Bench) -> Self {
        let normal = NORMAL.map(|(_, z1, z2)| {
            let (first, second) = (bench.tissue(silent(1540.0, z1)), bench.tissue(silent(1540.0, z2)));
            let place = bench.place();
            bench.add(first, 1, slab(place, 20.0, -20.0, 60.0));
            bench.add(second, 2, slab(place, 19.0, NORMAL_MM, 80.0));
            place
        });
        let oblique = OBLIQUE.map(|(degrees, z2, c2)| {
            [OBLIQUE_SPEED, c2].map(|speed| {
                let tissue = bench.tissue(silent(speed, z2));
                let place = bench.place();
                let rotation = DQuat::from_rotation_y(degrees.to_radians());
                bench.add(tissue, 1, facing(place.extend(OBLIQUE_MM), 30.0, rotation));
                place
            })
        });
        let water = bench.tissue(silent(1480.0, 1.48));
        let wall = bench.tissue(silent(1480.0, 1.7));
        let layers = LAYERS.map(|(_, speed)| {
            let layer = bench.tissue(silent(speed, 1.6));
            let place = bench.place();
            bench.add(water, 1, slab(place, 22.0, -20.0, 80.0));
            bench.add(layer, 2, slab(place, 20.0, LAYER_MM.0, LAYER_MM.1));
            bench.add(wall, 2, slab(place, 20.0, BEHIND_MM, 70.0));
            place
        });
        let lossy = bench.tissue(Tissue { attenuation_db_cm_mhz: ALPHA, ..silent(1540.0, 1.6) });
        let wall = bench.tissue(silent(1540.0, 1.8));
        let plates = PLATES_MM.map(|depth| {
            let place = bench.place();
            bench.add(lossy, 1, slab(place, 22.0, -10.0, 70.0));
            bench.add(wall, 2, slab(place, 20.0, depth, 70.0));
            place
        });
        Self { normal: normal.into(), oblique: oblique.into(), layers: layers.into(), plates: plates.into() }
    }
}

/// Strongest echo of a scanline with an amplitude above `threshold`; `None` if there is none.
fn strongest(probe: &Probe, samples: &[[f32; 2]], threshold: f64) -> Option<Echo> {
    echoes(probe, samples, threshold).into_iter().max_by(|a, b| a.amplitude.total_cmp(&b.amplitude))
}

impl Family for Interfaces {
    fn groups(&self) -> &'static [&'static str] {
        &["Fresnel", "Time of flight", "Attenuation"]
    }

    fn measure(&self, rig: &mut Rig) -> Result<Vec<Check>, RenderError> {
        let mut checks = Vec::new();
        let probe = linear(8, 0.5, 2048, 50.0);
        for (&(what, z1, z2), &place) in NORMAL.iter().zip(&self.normal) {
            let frame = rig.frame(&probe, &small(1, 1), &at(place.x, place.y, 0.0))?;
            let r = interface(z1, z2, 1540.0, 1540.0, 1.0).pressure_reflection;
            // The probe's face is inside the first medium, so only the interface gives an echo.
            let amplitude = strongest(&probe, line(&probe, frame, 4), 1e-5).map_or(f64::NAN, |e| e.amplitude);
            let name = format!("{what} at normal incidence, |r|");
            checks.push(Check::new("Fresnel", name, "", r.abs(), amplitude, 2e-3 * r.abs()));
        }
        let single = linear(1, 1.0, 1024, 50.0);
        for (&(degrees, z2, c2), pair) in OBLIQUE.iter().zip(&self.oblique) {
            let mut amplitude = |place: DVec2| {
                let frame = rig.frame(&single, &small(1, 1), &at(place.x, place.y, 0.0))?;
                let echo = echoes(&single, line(&single, frame, 0), 1e-16).into_iter().next();
                Ok::<_, RenderError>(echo.map_or(f64::NAN, |e| e.amplitude))
            };
            // Both plates have the same angle, so the aperture's factor is the same in both echoes and cancels.
            let ratio = amplitude(pair[1])? / amplitude(pair[0])?;
            let cos = degrees.to_radians().cos();
            let r = |c: f64| interface(OBLIQUE_IMPEDANCE, z2, OBLIQUE_SPEED, c, cos).pressure_reflection;
            let want = (r(c2) / r(OBLIQUE_SPEED)).abs();
            let name = format!("{c2:.0} against {OBLIQUE_SPEED:.0} m/s under {degrees:.0}°, ratio of |r|");
            checks.push(Check::new("Fresnel", name, "", want, ratio, 5e-3 * want));
        }
        for (&(what, speed), &place) in LAYERS.iter().zip(&self.layers) {
            let frame = rig.frame(&probe, &small(1, 1), &at(place.x, place.y, 0.0))?;
            let thickness = LAYER_MM.1 - LAYER_MM.0;
            let want = ASSUMED_SPEED_M_S * ((BEHIND_MM - thickness) / 1480.0 + thickness / speed);
            // The plate gives the deepest echo.
            let range = echoes(&probe, line(&probe, frame, 4), 1e-3).last().map_or(f64::NAN, |e| e.range_mm(1.0));
            let name = format!("plate behind {thickness:.0} mm of {what}, range by the phase");
            checks.push(Check::new("Time of flight", name, "mm", want, range, 2e-3));
        }
        let mut points = Vec::new();
        for (depth, place) in PLATES_MM.iter().zip(&self.plates) {
            let frame = rig.frame(&probe, &small(1, 1), &at(place.x, place.y, 0.0))?;
            let peak = line(&probe, frame, 4).iter().map(|&s| magnitude(s)).fold(0.0, f64::max);
            points.push((0.1 * depth, db_from_amplitude(peak)));
        }
        let want = -20.0 * attenuation_db_mm(ALPHA, 1.0, probe.frequency_mhz);
        checks.push(Check::new("Attenuation", "of plates, two-way slope", "dB/cm", want, slope(&points).0, 0.02));
        Ok(checks)
    }
}
