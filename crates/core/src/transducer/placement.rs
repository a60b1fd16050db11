//! Probe placements that are impossible for a hand: deep in the body, or looking out of it.
//!
//! Such poses come from a wrong unit, a wrong order of the quaternion's components, or a missing calibration. The
//! picture looks like that of a coupled probe, so the user needs to be told.

use std::fmt;
use std::time::Duration;

use glam::{DQuat, DVec3};
use serde::Serialize;

use crate::anatomy::Skin;
use crate::pose::Pose;

/// Depth of the face below the skin beyond which a placement is impossible, mm (assumed limit of a hand's pressure).
pub const DEPTH_MAX_MM: f64 = 25.0;

/// Duration of a misplacement from which on it is reported: a probe may be turned in the air for a moment.
pub const MISPLACED_FOR: Duration = Duration::from_secs(2);

/// Distance ahead of the face, mm, at which there must be body if the probe looks into it.
const AHEAD_MM: f64 = 15.0;

/// Impossible placement of a probe.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Misplacement {
    /// Kind of impossible placement.
    #[serde(flatten)]
    pub fault: Fault,
    /// Likely cause; `None` if no usual mistake explains the placement.
    pub likely: Option<Cause>,
}

/// Kind of impossible placement.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(tag = "fault", rename_all = "snake_case")]
pub enum Fault {
    /// The face lies deeper in the body than a hand can press it.
    Deep {
        /// Smallest distance of the face's centre from the skin along the probe's axes, mm.
        depth_mm: f64,
    },
    /// The body lies behind the face, so the probe looks out of it.
    LooksOut,
}

/// Usual mistake that explains a misplacement: with the mistake corrected, the probe is on the skin and looks into the
/// body.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// Positions in m, taken as mm.
    Metres,
    /// Positions in cm, taken as mm.
    Centimetres,
    /// The quaternion's components in the order x, y, z, w, taken as w, x, y, z.
    ScalarLast,
    /// The quaternion's components in the order w, x, y, z, taken as x, y, z, w.
    ScalarFirst,
    /// Positions in m and a quaternion x, y, z, w.
    MetresScalarLast,
}

/// Summary of good poses of a probe that has never touched the skin.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Untouched {
    /// Total time with good poses, s.
    pub good_s: f64,
    /// Last distance of the face's centre from the skin, mm; `None` if it is unknown.
    pub away_mm: Option<f64>,
    /// Diagonal of the bounding box of all positions of the probe, mm.
    pub extent_mm: f64,
}

impl Cause {
    const ALL: [Self; 5] =
        [Self::Metres, Self::Centimetres, Self::ScalarLast, Self::ScalarFirst, Self::MetresScalarLast];

    /// `pose` with the mistake corrected.
    fn undone(self, pose: &Pose) -> Pose {
        let scaled = |factor: f64| pose.position_mm * factor;
        let DQuat { x, y, z, w } = pose.orientation;
        let scalar_last = DQuat::from_xyzw(w, x, y, z);
        let (position_mm, orientation) = match self {
            Self::Metres => (scaled(1e3), pose.orientation),
            Self::Centimetres => (scaled(10.0), pose.orientation),
            Self::ScalarLast => (pose.position_mm, scalar_last),
            Self::ScalarFirst => (pose.position_mm, DQuat::from_xyzw(y, z, w, x)),
            Self::MetresScalarLast => (scaled(1e3), scalar_last),
        };
        Pose { position_mm, orientation }
    }
}

/// Impossible placement of a probe's face at `pose`; `None` if a hand can hold it there, on the skin or in the air.
pub fn misplacement(skin: &Skin, pose: &Pose) -> Option<Misplacement> {
    let fault = fault(skin, pose)?;
    let likely = Cause::ALL.into_iter().find(|cause| {
        let undone = cause.undone(pose);
        self::fault(skin, &undone).is_none()
            && skin.press_mm(&undone).is_some_and(|mm| (-AHEAD_MM..=DEPTH_MAX_MM).contains(&mm))
    });
    Some(Misplacement { fault, likely })
}

fn fault(skin: &Skin, pose: &Pose) -> Option<Fault> {
    let face_mm = pose.position_mm;
    let into_body = pose.orientation * DVec3::Z;
    let handle_mm = face_mm - DEPTH_MAX_MM * into_body;
    let body = skin.body();
    // In nearly all poses there is no skin behind the handle, and the function returns here.
    body.way_out_mm(handle_mm, -into_body)?;
    let depth_mm = |from_mm: DVec3| body.depth_mm(from_mm, pose.orientation);
    depth_mm(handle_mm)?;
    match (depth_mm(face_mm), depth_mm(face_mm + AHEAD_MM * into_body)) {
        (_, None) => Some(Fault::LooksOut),
        (Some(depth_mm), Some(_)) if depth_mm > DEPTH_MAX_MM => Some(Fault::Deep { depth_mm }),
        _ => None,
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Deep { depth_mm } => write!(f, "the probe's face lies {depth_mm:.0} mm deep in the body"),
            Self::LooksOut => write!(f, "the probe looks out of the body: its handle would be in it"),
        }
    }
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Metres => "positions in metres: times 1000 they would be on the skin",
            Self::Centimetres => "positions in centimetres: times 10 they would be on the skin",
            Self::ScalarLast => "a quaternion in the order x, y, z, w: read so, the probe would look into the body",
            Self::ScalarFirst => "a quaternion in the order w, x, y, z: read so, the probe would look into the body",
            Self::MetresScalarLast => "positions in metres and a quaternion in the order x, y, z, w",
        })
    }
}

impl fmt::Display for Misplacement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}; likely cause: ", self.fault)?;
        match self.likely {
            Some(cause) => write!(f, "{cause}"),
            None => write!(
                f,
                "no calibration, or one of another set-up (`insonify calibrate landmarks` makes it); else the tracker's \
                 unit, axes or order of the quaternion"
            ),
        }
    }
}

impl fmt::Display for Untouched {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { good_s, away_mm, extent_mm } = self;
        write!(f, "the probe has not touched the skin in {good_s:.0} s of good poses: it ")?;
        if let Some(away_mm) = away_mm {
            write!(f, "is {away_mm:.0} mm from it and ")?;
        }
        write!(
            f,
            "moved within {extent_mm:.1} mm; are positions in metres, is the quaternion's order x, y, z, w, or is a \
             calibration missing?"
        )
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::anatomy::{TissueTable, analytic, sdf};

    /// A body 200 mm thick with an organ in it; its front skin is at z = 80 mm.
    fn body() -> Skin {
        skin(false)
    }

    /// The body, with or without an arm 150 mm in front of it.
    fn skin(arm: bool) -> Skin {
        let cuboid = |name, from: [f32; 3], to: [f32; 3]| analytic::Part {
            name,
            tissue: "skin",
            priority: 1,
            mesh: analytic::cuboid(Vec3::from(from), Vec3::from(to)),
        };
        let mut parts = vec![
            cuboid("body", [-150.0, -200.0, -120.0], [150.0, 200.0, 80.0]),
            cuboid("organ", [-40.0, -40.0, -40.0], [40.0, 40.0, 40.0]),
        ];
        if arm {
            parts.push(cuboid("arm", [-150.0, 20.0, 230.0], [150.0, 100.0, 300.0]));
        }
        Skin::of_scene(&analytic::scene(parts, &TissueTable::builtin().unwrap(), "gel").unwrap()).unwrap()
    }

    /// A pose that looks along −z into the body, tilted by `tilt_deg`.
    fn held(z_mm: f64, tilt_deg: f64) -> Pose {
        let (sin, cos) = tilt_deg.to_radians().sin_cos();
        Pose::looking(DVec3::new(3.0, 58.0, z_mm), DVec3::new(sin, 0.0, -cos), DVec3::X)
    }

    fn likely(pose: Pose) -> (Fault, Option<Cause>) {
        let found = misplacement(&body(), &pose).unwrap();
        (found.fault, found.likely)
    }

    #[test]
    fn probes_in_a_hand_are_no_fault() {
        for skin in [skin(false), skin(true)] {
            for (z_mm, tilt_deg) in
                [(80.0, 0.0), (78.0, 60.0), (60.0, 20.0), (84.0, 0.0), (150.0, 0.0), (150.0, 180.0), (900.0, 90.0)]
            {
                assert_eq!(misplacement(&skin, &held(z_mm, tilt_deg)), None, "{z_mm} mm, {tilt_deg} degrees");
            }
        }
    }

    #[test]
    fn poses_in_metres_are_deep_in_the_body() {
        let pose = held(78.0, 10.0);
        let metres = Pose { position_mm: pose.position_mm / 1e3, ..pose };
        let (fault, cause) = likely(metres);
        assert!(matches!(fault, Fault::Deep { depth_mm } if (79.0..90.0).contains(&depth_mm)), "{fault:?}");
        assert_eq!(cause, Some(Cause::Metres));
        let centimetres = Pose { position_mm: pose.position_mm / 10.0, ..pose };
        assert_eq!(likely(centimetres).1, Some(Cause::Centimetres));
    }

    #[test]
    fn another_order_of_the_quaternion_looks_out_of_the_body() {
        let pose = held(79.0, 12.0);
        let DQuat { x, y, z, w } = pose.orientation;
        // A quaternion was sent as x, y, z, w but read as w, x, y, z.
        let mixed = Pose { orientation: DQuat::from_xyzw(y, z, w, x), ..pose };
        assert_eq!(likely(mixed), (Fault::LooksOut, Some(Cause::ScalarLast)));
        let both = Pose { position_mm: pose.position_mm / 1e3, ..mixed };
        assert!(matches!(likely(both), (Fault::Deep { .. }, Some(Cause::MetresScalarLast))));
        let outward = Pose { orientation: pose.orientation * DQuat::from_rotation_x(std::f64::consts::PI), ..pose };
        assert_eq!(misplacement(&body(), &outward).map(|found| found.fault), Some(Fault::LooksOut));
    }

    #[test]
    fn what_no_usual_mistake_explains_names_the_calibration() {
        let deep = Pose::looking(DVec3::new(60.0, 60.0, -20.0), DVec3::NEG_Z, DVec3::X);
        let found = misplacement(&body(), &deep).unwrap();
        assert_eq!(found.likely, None);
        assert!(found.to_string().contains("calibrate landmarks"), "{found}");
    }

    #[test]
    fn a_slab_of_skin_over_other_tissues_is_a_body_too() {
        let slab = analytic::cuboid(Vec3::new(-140.0, -60.0, 0.0), Vec3::new(140.0, 60.0, 2.0));
        let below = analytic::cuboid(Vec3::new(-140.0, -60.0, 1.6), Vec3::new(140.0, 60.0, 160.0));
        let alone = || Skin::of_triangles(slab.corners_mm()).unwrap();
        let skin = alone().within(slab.corners_mm().chain(below.corners_mm()));
        let at = |z: f64, into: DVec3| Pose::looking(DVec3::Z * z, into, DVec3::X);
        let fault = |pose: Pose| misplacement(&skin, &pose).map(|found| found.fault);
        let deep = fault(at(60.0, DVec3::Z));
        assert!(matches!(deep, Some(Fault::Deep { depth_mm }) if (59.0..61.0).contains(&depth_mm)), "{deep:?}");
        assert_eq!(fault(at(6.0, DVec3::NEG_Z)), Some(Fault::LooksOut));
        for pose in [at(1.0, DVec3::Z), at(12.0, DVec3::Z), at(-100.0, DVec3::Z), at(-100.0, DVec3::NEG_Z)] {
            assert_eq!(fault(pose), None, "{pose:?}");
        }
        assert_eq!(misplacement(&alone(), &at(60.0, DVec3::Z)), None, "nothing says on which side the body is");
        // A skin that surrounds the scene needs no other surfaces.
        let whole = body().within([&slab; 3].into_iter().flat_map(|mesh| mesh.corners_mm()));
        assert!(std::ptr::eq(whole.body(), &whole));
    }

    #[test]
    fn solids_and_shells_are_bodies_too() {
        let solid = Skin::of_solid(sdf::sphere(Vec3::ZERO, 100.0));
        let shell = [100.0, 96.0].map(|radius| analytic::sphere(Vec3::ZERO, radius, 5));
        let corners: Vec<_> = shell.iter().flat_map(|mesh| mesh.corners_mm()).collect();
        for skin in [solid, Skin::of_triangles(corners).unwrap()] {
            let at = |z: f64, into: DVec3| misplacement(&skin, &Pose::looking(DVec3::Z * z, into, DVec3::X));
            assert_eq!(at(98.0, DVec3::NEG_Z), None);
            assert!(matches!(at(10.0, DVec3::NEG_Z).unwrap().fault, Fault::Deep { depth_mm } if depth_mm > 85.0));
            assert_eq!(at(98.0, DVec3::Z).unwrap().fault, Fault::LooksOut);
            assert_eq!(at(102.0, DVec3::Z).unwrap().fault, Fault::LooksOut);
        }
    }
}
