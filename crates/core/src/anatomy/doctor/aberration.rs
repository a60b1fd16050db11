//! Aberration by the tissue in front of a probe's face: delays over an aperture, along straight parallel rays.
//!
//! The delay of a ray is relative to a path of equal length at [`ASSUMED_SPEED_M_S`]. The best-fit line of the delays
//! over an aperture is the tilt, which displaces an image; the remaining delays blur it. Rays start on the face, so
//! tissue into which the face is pressed does not count. The assumed speed applies outside all surfaces, and in media
//! that ultrasound does not pass in a straight line (bone, gas).

use std::fmt;

use glam::{DQuat, DVec3};
use rayon::prelude::*;
use serde::Serialize;

use super::tree::Tree;
use crate::acoustics::{ASSUMED_SPEED_M_S, HARD_SPEED};
use crate::anatomy::Scene;
use crate::anatomy::Wall;
use crate::pose::Pose;
use crate::statistics::{median, sorted};

/// Distance between neighbouring rays, mm.
const STEP_MM: f64 = 0.5;
/// Offset of all rays across the scan plane, mm. It avoids vertices, which meshes often have in a plane of symmetry.
const ASIDE_MM: f64 = 1.3e-3;
/// Median RMS delays that separate easy from average walls, and average from hard ones, ns.
const BOUNDS_NS: [f64; 2] = [30.0, 55.0];

/// Part of a probe's face that forms a beam, and depth to which the beam is followed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aperture {
    /// Width, mm.
    pub width_mm: f64,
    /// Radius of the face, mm; `None` for a flat one.
    pub face_radius_mm: Option<f64>,
    /// Depth below the middle of the aperture to which delays are accumulated, mm.
    pub depth_mm: f64,
}

/// Aberration over an aperture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Aberration {
    /// RMS delay about the best-fit line, ns.
    pub delay_rms_ns: f64,
    /// Tilt of the best-fit line, mrad: positive if delays grow along the lateral axis.
    pub tilt_mrad: f64,
    /// Full width at half maximum of the delays' autocorrelation, mm; `None` if all delays are zero.
    pub correlation_mm: Option<f64>,
}

/// Aberration over several apertures of a face.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Summary {
    /// Width of the apertures, mm.
    #[serde(skip)]
    pub width_mm: f64,
    /// Depth to which delays are accumulated, mm.
    pub depth_mm: f64,
    /// Median and maximum RMS delay, ns.
    pub delay_rms_ns: [f64; 2],
    /// Median and maximum magnitude of the tilt, mrad.
    pub tilt_mrad: [f64; 2],
    /// Median correlation length, mm; `None` if all delays are zero.
    pub correlation_mm: Option<f64>,
    /// Class of the wall by the median RMS delay: easy below 30 ns, hard above 55 ns.
    #[serde(serialize_with = "name_of")]
    pub wall: Wall,
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { width_mm, depth_mm, delay_rms_ns: [rms, most], tilt_mrad: [tilt, steepest], .. } = self;
        write!(
            f,
            "aberration to {depth_mm:.0} mm: delays {rms:.0} ns rms over {width_mm:.0} mm (at most {most:.0}), "
        )?;
        write!(f, "tilt {tilt:.1} mrad (at most {steepest:.1}), correlation length ")?;
        match self.correlation_mm {
            Some(mm) => write!(f, "{mm:.1} mm: {}", self.wall.name()),
            None => write!(f, "-: {}", self.wall.name()),
        }
    }
}

fn name_of<S: serde::Serializer>(wall: &Wall, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(wall.name())
}

/// Surfaces of a scene, for casting rays through them.
pub struct Caster<'s> {
    surfaces: Vec<(Tree<'s>, f64)>,
}

impl<'s> Caster<'s> {
    /// Caster for `scene`, whose surfaces are in ascending priority.
    pub fn of(scene: &'s Scene) -> Self {
        let excess = |speed_m_s: f64| {
            let passed = (speed_m_s / ASSUMED_SPEED_M_S - 1.0).abs() <= HARD_SPEED;
            if passed { 1e6 / speed_m_s - 1e6 / ASSUMED_SPEED_M_S } else { 0.0 }
        };
        let surface = |surface: &'s crate::anatomy::Surface| {
            let tissue = scene.tissues.tissues().get(surface.tissue)?;
            Some((Tree::new(&surface.mesh)?, excess(tissue.speed_m_s)))
        };
        Self { surfaces: scene.surfaces.par_iter().filter_map(surface).collect() }
    }

    /// Delay along a ray of `length_mm` from `from_mm` along the unit `direction`, ns.
    fn delay_ns(&self, from_mm: DVec3, direction: DVec3, length_mm: f64) -> f64 {
        // Crossings with all surfaces, from the end of the ray to its start. Beyond the farthest one, the ray is
        // outside.
        let mut crossings = Vec::new();
        for (surface, (tree, _)) in self.surfaces.iter().enumerate() {
            tree.crossings(from_mm, direction, |c| crossings.push((c.t_mm, surface, if c.leaves { 1 } else { -1 })));
        }
        crossings.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut winding = vec![0; self.surfaces.len()];
        let excess = |winding: &[i32]| {
            let medium = winding.iter().rposition(|&turns| turns != 0);
            medium.map_or(0.0, |surface| self.surfaces[surface].1)
        };
        let (mut end_mm, mut sum_ns) = (f64::INFINITY, 0.0);
        for (t_mm, surface, turn) in crossings {
            sum_ns += excess(&winding) * (end_mm.min(length_mm) - t_mm.min(length_mm));
            winding[surface] += turn;
            end_mm = t_mm;
        }
        sum_ns + excess(&winding) * end_mm.min(length_mm)
    }

    /// Delays over `aperture`, ns, at positions at most 0.5 mm apart. The beam's frame has its origin in the middle of
    /// the aperture, z along the beam and x along the face.
    pub(crate) fn delays_ns(&self, scene_from_beam: &Pose, aperture: &Aperture) -> Vec<f64> {
        let count = (aperture.width_mm / STEP_MM).ceil().max(4.0) as usize;
        let direction = scene_from_beam.transform_vector(DVec3::Z);
        let delay = |i: usize| {
            let x = ((i as f64 + 0.5) / count as f64 - 0.5) * aperture.width_mm;
            let sag = aperture.face_radius_mm.map_or(0.0, |r| r - (r * r - x * x).max(0.0).sqrt());
            let from = scene_from_beam.transform_point(DVec3::new(x, ASIDE_MM, -sag));
            self.delay_ns(from, direction, aperture.depth_mm + sag)
        };
        (0..count).into_par_iter().map(delay).collect()
    }

    /// Aberration over `aperture`. The beam's frame has its origin in the middle of the aperture, z along the beam and
    /// x along the face.
    pub fn aberration(&self, scene_from_beam: &Pose, aperture: &Aperture) -> Aberration {
        of_delays(&self.delays_ns(scene_from_beam, aperture), aperture.width_mm)
    }

    /// Aberration of a probe at `pose`, over apertures of the size `aperture` about the origins of `beams`. A beam is
    /// given by its origin (mm) and direction in the scan plane, probe frame. `None` without beams.
    pub fn summary(&self, pose: &Pose, beams: &[(DVec3, DVec3)], aperture: &Aperture) -> Option<Summary> {
        let of_beam = |&(origin_mm, direction): &(DVec3, DVec3)| {
            let turn = DQuat::from_rotation_y(direction.x.atan2(direction.z));
            self.aberration(&(*pose * Pose { position_mm: origin_mm, orientation: turn }), aperture)
        };
        summary(&beams.iter().map(of_beam).collect::<Vec<_>>(), aperture)
    }
}

/// Aberration from the delays at equally spaced positions over `width_mm`.
fn of_delays(delays_ns: &[f64], width_mm: f64) -> Aberration {
    let count = delays_ns.len();
    let step_mm = width_mm / count as f64;
    let x = |i: usize| (i as f64 + 0.5) * step_mm - 0.5 * width_mm;
    let mean = delays_ns.iter().sum::<f64>() / count as f64;
    let moment: f64 = (0..count).map(|i| x(i) * x(i)).sum();
    let slope = delays_ns.iter().enumerate().map(|(i, d)| x(i) * d).sum::<f64>() / moment;
    let residual: Vec<f64> = delays_ns.iter().enumerate().map(|(i, d)| d - mean - slope * x(i)).collect();
    let product = |lag: usize| residual.iter().zip(&residual[lag..]).map(|(a, b)| a * b).sum::<f64>();
    let power = product(0);
    let half = (1..count).find(|&lag| product(lag) < 0.5 * power).filter(|_| power > 1e-9 * count as f64);
    let correlation_mm = half.map(|lag| {
        let (before, after) = (product(lag - 1), product(lag));
        2.0 * step_mm * ((lag - 1) as f64 + (before - 0.5 * power) / (before - after))
    });
    // Units: 1 ns/mm · 1 m/s is 1e-6, which is 1e-3 mrad.
    let tilt_mrad = slope * ASSUMED_SPEED_M_S * 1e-3;
    Aberration { delay_rms_ns: (power / count as f64).sqrt(), tilt_mrad, correlation_mm }
}

/// Summary of `aberrations`, each over an aperture like `aperture`; `None` if there are none.
pub fn summary(aberrations: &[Aberration], aperture: &Aperture) -> Option<Summary> {
    let of = |value: fn(&Aberration) -> Option<f64>| sorted(aberrations.iter().filter_map(value));
    let middle_and_last = |values: &[f64]| Some([median(values)?, *values.last()?]);
    let delay_rms_ns = middle_and_last(&of(|a| Some(a.delay_rms_ns)))?;
    let tilt_mrad = middle_and_last(&of(|a| Some(a.tilt_mrad.abs())))?;
    let correlation_mm = median(&of(|a| a.correlation_mm));
    let [easy, average] = BOUNDS_NS;
    let wall = match delay_rms_ns[0] {
        rms if rms < easy => Wall::Easy,
        rms if rms <= average => Wall::Average,
        _ => Wall::Hard,
    };
    let Aperture { width_mm, depth_mm, .. } = *aperture;
    Some(Summary { width_mm, depth_mm, delay_rms_ns, tilt_mrad, correlation_mm, wall })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use glam::Vec3;

    use super::*;
    use crate::anatomy::analytic::{cuboid, sphere};
    use crate::anatomy::{Axes, Mesh, Motion, Surface, TissueTable};

    const APERTURE: Aperture = Aperture { width_mm: 30.0, face_radius_mm: None, depth_mm: 60.0 };

    fn scene(parts: Vec<(&str, Mesh)>) -> Scene {
        let tissues = TissueTable::builtin().unwrap();
        let surface = |(priority, (tissue, mesh)): (i32, (&str, Mesh))| Surface {
            name: tissue.into(),
            tissue: tissues.index_of(tissue).unwrap(),
            priority,
            mesh,
        };
        let surfaces = (0..).zip(parts).map(surface).collect();
        let background = tissues.index_of("gel").unwrap();
        Scene { surfaces, background, motion: Motion::default(), axes: Axes::default(), tissues }
    }

    fn slab(from_mm: f32, to_mm: f32) -> Mesh {
        cuboid(Vec3::new(-300.0, -300.0, from_mm), Vec3::new(300.0, 300.0, to_mm))
    }

    /// Delay per mm of a medium relative to the assumed speed, ns.
    fn ns_per_mm(speed_m_s: f64) -> f64 {
        1e6 / speed_m_s - 1e6 / ASSUMED_SPEED_M_S
    }

    #[test]
    fn a_ray_takes_the_medium_of_highest_priority() {
        // The face is inside the fat. Bone counts as a medium of the assumed speed.
        let parts = vec![("fat", slab(-10.0, 40.0)), ("muscle", slab(12.0, 19.0)), ("bone_adult", slab(30.0, 33.0))];
        let scene = scene(parts);
        let delays = Caster::of(&scene).delays_ns(&Pose::IDENTITY, &APERTURE);
        let expected = 30.0 * ns_per_mm(1450.0) + 7.0 * ns_per_mm(1580.0);
        assert!(delays.iter().all(|d| (d - expected).abs() < 1e-3), "{expected}: {delays:?}");
        let short = Aperture { depth_mm: 15.0, ..APERTURE };
        let expected = 12.0 * ns_per_mm(1450.0) + 3.0 * ns_per_mm(1580.0);
        assert!((Caster::of(&scene).delays_ns(&Pose::IDENTITY, &short)[7] - expected).abs() < 1e-3);
    }

    #[test]
    fn a_wedge_tilts_and_a_ball_blurs() {
        // The beam is 10° off the normal of a fat layer around the probe's face: the path in fat is longer on one side.
        let wedge = scene(vec![("fat", slab(-100.0, 30.0))]);
        let turn = 10f64.to_radians();
        let pose = Pose { position_mm: DVec3::ZERO, orientation: DQuat::from_rotation_y(turn) };
        let found = Caster::of(&wedge).aberration(&pose, &APERTURE);
        let expected = turn.tan() * ns_per_mm(1450.0) * ASSUMED_SPEED_M_S * 1e-3;
        assert!((found.tilt_mrad - expected).abs() < 1e-3, "{found:?}, expected a tilt of {expected}");
        assert!(found.delay_rms_ns < 1e-3 && found.correlation_mm.is_none(), "{found:?}");

        let ball = scene(vec![("muscle", sphere(Vec3::new(0.0, 0.0, 30.0), 6.0, 5))]);
        let found = Caster::of(&ball).aberration(&Pose::IDENTITY, &APERTURE);
        let most = 12.0 * ns_per_mm(1580.0).abs();
        assert!(found.tilt_mrad.abs() < 0.05 && (0.2..0.5).contains(&(found.delay_rms_ns / most)), "{found:?}, {most}");
    }

    #[test]
    fn a_curved_face_sees_what_lies_beside_its_middle() {
        // The slab ends 1 mm before the middle of the curved face, so rays from the sides of the face start in the
        // slab.
        let scene = scene(vec![("fat", slab(-50.0, -1.0))]);
        let flat = Caster::of(&scene).delays_ns(&Pose::IDENTITY, &APERTURE);
        assert!(flat.iter().all(|&d| d == 0.0));
        let curved = Aperture { face_radius_mm: Some(40.0), ..APERTURE };
        let delays = Caster::of(&scene).delays_ns(&Pose::IDENTITY, &curved);
        let sag = 40.0 - (40.0f64 * 40.0 - 14.75 * 14.75).sqrt();
        assert!((delays[0] - (sag - 1.0) * ns_per_mm(1450.0)).abs() < 1e-2 && delays[30] == 0.0, "{delays:?}");
    }

    #[test]
    fn waves_have_their_rms_their_tilt_and_a_third_of_their_length() {
        let wave = |x: f64| 40.0 * (std::f64::consts::TAU * x / 15.0).cos() + 2.0 * x;
        let delays: Vec<f64> = (0..600).map(|i| wave((f64::from(i) + 0.5) * 0.5 - 150.0)).collect();
        let found = of_delays(&delays, 300.0);
        assert!((found.delay_rms_ns - 40.0 / 2f64.sqrt()).abs() < 0.05, "{found:?}");
        assert!((found.tilt_mrad - 3.08).abs() < 0.01, "{found:?}");
        assert!((found.correlation_mm.unwrap() - 5.0).abs() < 0.1, "{found:?}");
    }

    #[test]
    fn the_median_decides_how_hard_a_wall_is() {
        let of = |rms: &[f64]| {
            let one = |&delay_rms_ns: &f64| Aberration { delay_rms_ns, tilt_mrad: -2.0, correlation_mm: None };
            summary(&rms.iter().map(one).collect::<Vec<_>>(), &APERTURE)
        };
        assert_eq!(of(&[]), None);
        let walls = [[5.0, 20.0, 200.0], [31.0, 10.0, 54.0], [56.0, 20.0, 90.0]].map(|rms| of(&rms).unwrap().wall);
        assert_eq!(walls, [Wall::Easy, Wall::Average, Wall::Hard]);
        let summary = of(&[1.0, 9.0, 4.0]).unwrap();
        assert_eq!((summary.delay_rms_ns, summary.tilt_mrad, summary.correlation_mm), ([4.0, 9.0], [2.0, 2.0], None));
    }
}
