//! Directions of refracted paths compared with Snell's law. Paths bend only after they have reflected, so a mirror
//! reflects them first.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use glam::{DMat3, DQuat, DVec2, DVec3};

use super::bench::{Bench, at, facing, linear, silent, slab, small};
use super::measure::{echoes, line};
use super::{Check, Family, Rig};
use crate::acoustics::ASSUMED_SPEED_M_S;
use crate::acoustics::interface::refracted;
use crate::anatomy::Tissue;
use crate::render::RenderError;

/// For each case: speeds before and beyond the refracting plane (m/s), then angle of incidence and azimuth of the
/// plane's slope, degrees.
const CASES: [(f64, f64, f64, f64); 2] = [(1450.0, 1578.0, 45.0, 30.0), (1480.0, 4080.0, 15.0, 180.0)];
/// Tilts and azimuths of the three target planes that measure the refracted path, degrees.
const PLANES: [(f64, f64); 3] = [(35.0, 20.0), (30.0, 140.0), (40.0, 260.0)];
/// Depth of the mirror, which turns the path from +z to +x, mm.
const MIRROR_MM: f64 = 10.0;
/// Length of the path up to the refracting plane, and distance of the target planes beyond it, mm.
const ENTRY_MM: f64 = 20.0;
const BEYOND_MM: f64 = 12.0;
/// Impedance of the medium before the refracting plane, MRayl.
const IMPEDANCE: f64 = 1.5;

/// A target plane beyond a refracting plane. Points and normals are in axes in which the arriving path runs along z.
struct Plane {
    /// Lateral and elevational position of the probe above the specimen, mm.
    place: DVec2,
    /// A point of the target plane, relative to where the path enters the refracting plane, mm.
    point: DVec3,
    /// Normal of the target plane.
    normal: DVec3,
}

/// Three target planes for each refracting plane.
pub(super) struct Refraction {
    planes: Vec<[Plane; 3]>,
}

/// Rotation of z by `tilt` degrees towards the azimuth `about`.
fn turned((tilt, about): (f64, f64)) -> DQuat {
    DQuat::from_rotation_z(about.to_radians()) * DQuat::from_rotation_y(tilt.to_radians())
}

/// Normal of a case's refracting plane, and direction of the refracted path.
fn bent(&(c1, c2, incidence, azimuth): &(f64, f64, f64, f64)) -> (DVec3, DVec3) {
    let normal = turned((incidence, azimuth)) * DVec3::NEG_Z;
    (normal, refracted(c1, c2, normal, DVec3::Z).unwrap_or(DVec3::Z))
}

impl Refraction {
    pub(super) fn new(bench: &mut Bench) -> Self {
        let gas = bench.tissue(silent(343.0, 0.0004));
        let of_case = |case: &(f64, f64, f64, f64)| {
            let &(c1, c2, incidence, azimuth) = case;
            let (normal, direction) = bent(case);
            // Impedances near total transmission, so that every path is transmitted.
            let z2 = 1.1 * IMPEDANCE * -direction.dot(normal) / incidence.to_radians().cos();
            let first = bench.tissue(silent(c1, IMPEDANCE));
            let second = bench.tissue(silent(c2, z2));
            // Rough, so that it is visible at any angle.
            let plane = bench.tissue(Tissue { roughness: 0.5, ..silent(c2, 1.2 * z2) });
            PLANES.map(|tilt| {
                let place = bench.place();
                let mirror = place.extend(MIRROR_MM);
                bench.add(first, 0, slab(place, 45.0, -35.0, 55.0));
                bench.add(gas, 3, facing(mirror, 6.0, DQuat::from_rotation_y(-FRAC_PI_4)));
                // After the mirror, the path runs along x.
                let turn = DQuat::from_rotation_y(FRAC_PI_2);
                let entry = mirror + (ENTRY_MM - MIRROR_MM) * DVec3::X;
                bench.add(second, 1, facing(entry, 45.0, turn * turned((incidence, azimuth))));
                let rotation = DQuat::from_rotation_arc(DVec3::Z, direction) * turned(tilt);
                let point = BEYOND_MM * direction;
                bench.add(plane, 2, facing(entry + turn * point, 20.0, turn * rotation));
                Plane { place, point, normal: rotation * DVec3::NEG_Z }
            })
        };
        Self { planes: CASES.iter().map(of_case).collect() }
    }
}

impl Family for Refraction {
    fn groups(&self) -> &'static [&'static str] {
        &["Snell"]
    }

    fn measure(&self, rig: &mut Rig) -> Result<Vec<Check>, RenderError> {
        let probe = linear(1, 1.0, 4096, 60.0);
        let mut checks = Vec::new();
        for (case, planes) in CASES.iter().zip(&self.planes) {
            let &(c1, c2, incidence, _) = case;
            let entered_mm = ENTRY_MM * ASSUMED_SPEED_M_S / c1;
            let mut parts = [f64::NAN; 3];
            for (part, plane) in parts.iter_mut().zip(planes) {
                let frame = rig.frame(&probe, &small(1, 1), &at(plane.place.x, plane.place.y, 0.0))?;
                let echoes = echoes(&probe, line(&probe, frame, 0), 1e-9);
                let echo = echoes.iter().find(|e| e.peak_mm > entered_mm + 2.0);
                let path_mm = echo.map_or(f64::NAN, |e| (e.range_mm(1.0) - entered_mm) * c2 / ASSUMED_SPEED_M_S);
                // The path ends on the target plane: normal · direction · path length = normal · point.
                *part = plane.normal.dot(plane.point) / path_mm;
            }
            let normals = DMat3::from_cols(planes[0].normal, planes[1].normal, planes[2].normal).transpose();
            let measured = normals.inverse() * DVec3::from_array(parts);
            let (normal, direction) = bent(case);
            let name = format!("{c1:.0} to {c2:.0} m/s under {incidence:.0}°, refracted angle");
            let want = (-direction).angle_between(normal).to_degrees();
            let got = (-measured).angle_between(normal).to_degrees();
            checks.push(Check::new("Snell", name, "°", want, got, 0.05));
            // The direction solved from three lengths is a unit vector only if all three are right.
            let name = format!("{c1:.0} to {c2:.0} m/s under {incidence:.0}°, off its plane and length");
            checks.push(Check::zero("Snell", name, (measured - direction).length(), 2e-3));
        }
        Ok(checks)
    }
}
