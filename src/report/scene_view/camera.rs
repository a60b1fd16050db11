//! Camera and cut of a picture.

use std::str::FromStr;

use glam::{DQuat, DVec3};

use super::ViewError;
use crate::anatomy::Axes;
use crate::pose::Pose;
use crate::suggest::did_you_mean;

/// Viewing direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// At right angles to the imaging plane, with the image's right on the right.
    Fan,
    /// From behind the probe, into the body.
    Probe,
    /// From the front: from anterior; or, in a scene without anatomical axes, with x to the right and depth
    /// downwards.
    Front,
    /// From the back, opposite to the front.
    Back,
    /// From +x.
    Left,
    /// From −x.
    Right,
    /// From cranial; or, in a scene without anatomical axes, from above the skin.
    Top,
    /// From the bottom, opposite to the top.
    Bottom,
}

impl Direction {
    /// Names that [`FromStr`] reads, with their directions.
    const NAMED: [(&str, Self); 12] = [
        ("fan", Self::Fan),
        ("probe", Self::Probe),
        ("front", Self::Front),
        ("back", Self::Back),
        ("left", Self::Left),
        ("right", Self::Right),
        ("top", Self::Top),
        ("bottom", Self::Bottom),
        ("anterior", Self::Front),
        ("posterior", Self::Back),
        ("cranial", Self::Top),
        ("caudal", Self::Bottom),
    ];

    /// Names that [`FromStr`] reads.
    pub fn names() -> [&'static str; 12] {
        Self::NAMED.map(|(name, _)| name)
    }
}

impl FromStr for Direction {
    type Err = ViewError;

    fn from_str(text: &str) -> Result<Self, ViewError> {
        let found = Self::NAMED.into_iter().find(|(name, _)| *name == text);
        found.map(|(_, direction)| direction).ok_or_else(|| {
            let suggestion = did_you_mean(text, Self::names());
            ViewError::Direction { text: text.to_owned(), suggestion }
        })
    }
}

/// Rotation of the viewer about the scene.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Orbit {
    /// Rotation to the right, degrees, −360..=360.
    pub azimuth_deg: f64,
    /// Rotation upwards, degrees, −90..=90.
    pub elevation_deg: f64,
}

impl FromStr for Orbit {
    type Err = ViewError;

    fn from_str(text: &str) -> Result<Self, ViewError> {
        let wrong = || ViewError::Orbit { text: text.to_owned() };
        let (azimuth, elevation) = text.split_once(',').ok_or_else(wrong)?;
        let number = |text: &str, limit: f64| text.trim().parse::<f64>().ok().filter(|v| v.abs() <= limit);
        match (number(azimuth, 360.0), number(elevation, 90.0)) {
            (Some(azimuth_deg), Some(elevation_deg)) => Ok(Self { azimuth_deg, elevation_deg }),
            _ => Err(wrong()),
        }
    }
}

/// A cut by a plane; everything in front of the plane is hidden.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cut {
    /// The imaging plane.
    Fan,
    /// Plane perpendicular to a scene axis (0 x, 1 y, 2 z), at a coordinate in mm.
    Axis(usize, f64),
}

impl FromStr for Cut {
    type Err = ViewError;

    fn from_str(text: &str) -> Result<Self, ViewError> {
        let wrong = || ViewError::Cut { text: text.to_owned() };
        if text == "fan" {
            return Ok(Self::Fan);
        }
        let (axis, at_mm) = text.split_once('=').ok_or_else(wrong)?;
        let axis = ["x", "y", "z"].iter().position(|&name| name == axis.trim()).ok_or_else(wrong)?;
        let at_mm = at_mm.trim().parse::<f64>().ok().filter(|mm| mm.abs() <= 1e5).ok_or_else(wrong)?;
        Ok(Self::Axis(axis, at_mm))
    }
}

/// A parallel projection with orthonormal axes in the scene.
#[derive(Debug, Clone, Copy)]
pub(super) struct Camera {
    pub(super) right: DVec3,
    pub(super) up: DVec3,
    /// Axis into the picture.
    pub(super) forward: DVec3,
    /// Scene point in the centre of the picture, mm.
    pub(super) centre_mm: DVec3,
    pub(super) mm_per_pixel: f64,
    /// Centre of the picture, pixels.
    pub(super) middle: (f64, f64),
}

impl Camera {
    /// A camera that looks from `direction`, rotated by `orbit`. `None` if `direction` needs a probe and
    /// `scene_from_probe` is `None`.
    pub(super) fn new(direction: Direction, orbit: Orbit, axes: Axes, scene_from_probe: Option<Pose>) -> Option<Self> {
        let q = scene_from_probe.map_or(DQuat::IDENTITY, |pose| pose.orientation);
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        if matches!(direction, Direction::Fan | Direction::Probe) && scene_from_probe.is_none() {
            return None;
        }
        // Axes towards the viewer and upwards.
        let (back, up) = match (axes, direction) {
            (_, Direction::Fan) => (q * y, q * -z),
            (_, Direction::Probe) => (q * -z, q * -y),
            (Axes::Anatomical, Direction::Front) => (z, y),
            (Axes::Anatomical, Direction::Back) => (-z, y),
            (Axes::Anatomical, Direction::Left) => (x, y),
            (Axes::Anatomical, Direction::Right) => (-x, y),
            (Axes::Anatomical, Direction::Top) => (y, z),
            (Axes::Anatomical, Direction::Bottom) => (-y, z),
            (Axes::Patient, Direction::Front) => (-y, z),
            (Axes::Patient, Direction::Back) => (y, z),
            (Axes::Patient, Direction::Left) => (x, z),
            (Axes::Patient, Direction::Right) => (-x, z),
            (Axes::Patient, Direction::Top) => (z, -y),
            (Axes::Patient, Direction::Bottom) => (-z, -y),
            (Axes::Depth, Direction::Front) => (y, -z),
            (Axes::Depth, Direction::Back) => (-y, -z),
            (Axes::Depth, Direction::Left) => (x, -z),
            (Axes::Depth, Direction::Right) => (-x, -z),
            (Axes::Depth, Direction::Top) => (-z, -y),
            (Axes::Depth, Direction::Bottom) => (z, y),
        };
        let (sin_a, cos_a) = orbit.azimuth_deg.to_radians().sin_cos();
        let (sin_e, cos_e) = orbit.elevation_deg.to_radians().sin_cos();
        let level = back * cos_a + up.cross(back) * sin_a;
        let (back, up) = (level * cos_e + up * sin_e, up * cos_e - level * sin_e);
        Some(Self {
            right: up.cross(back).normalize(),
            up: up.normalize(),
            forward: -back.normalize(),
            centre_mm: DVec3::ZERO,
            mm_per_pixel: 1.0,
            middle: (0.0, 0.0),
        })
    }

    /// Moves and scales the projection so that `points_mm` fill a picture of `size` pixels, except for a margin. Its
    /// upper left corner is at (left, top).
    pub(super) fn fit(&mut self, points_mm: &[DVec3], (left, top): (f64, f64), size: (f64, f64)) {
        let low = DVec3::splat(f64::INFINITY);
        let (low, high) = points_mm.iter().fold((low, -low), |(low, high), &p| {
            let p = DVec3::new(p.dot(self.right), p.dot(self.up), p.dot(self.forward));
            (low.min(p), high.max(p))
        });
        if !low.is_finite() || !high.is_finite() {
            return;
        }
        let (middle, extent) = (0.5 * (low + high), (high - low).max(DVec3::splat(1e-3)));
        self.centre_mm = self.right * middle.x + self.up * middle.y + self.forward * middle.z;
        self.mm_per_pixel = (extent.x / (0.92 * size.0)).max(extent.y / (0.88 * size.1));
        self.middle = (left + 0.5 * size.0, top + 0.5 * size.1);
    }

    /// Pixel (column, row) of a scene point.
    pub(super) fn pixel(&self, point_mm: DVec3) -> (f64, f64) {
        let from_centre = (point_mm - self.centre_mm) / self.mm_per_pixel;
        (self.middle.0 + from_centre.dot(self.right), self.middle.1 - from_centre.dot(self.up))
    }

    /// Scene point of a pixel (column, row), in the plane through the centre.
    pub(super) fn point(&self, column: f64, row: f64) -> DVec3 {
        let (x, y) = ((column - self.middle.0) * self.mm_per_pixel, (self.middle.1 - row) * self.mm_per_pixel);
        self.centre_mm + self.right * x + self.up * y
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_orbits_and_planes_are_read_or_refused() {
        assert_eq!("cranial".parse(), Ok(Direction::Top));
        assert!("frnt".parse::<Direction>().unwrap_err().to_string().contains("did you mean `front`"));
        assert_eq!("30, -20".parse(), Ok(Orbit { azimuth_deg: 30.0, elevation_deg: -20.0 }));
        for wrong in ["30", "30,91", "NaN,0", "a,b", ""] {
            assert!(wrong.parse::<Orbit>().is_err(), "{wrong}");
        }
        assert_eq!("z=40.5".parse(), Ok(Cut::Axis(2, 40.5)));
        for wrong in ["z", "w=1", "z=inf", "fann"] {
            assert!(wrong.parse::<Cut>().is_err(), "{wrong}");
        }
        for name in Direction::names() {
            assert!(name.parse::<Direction>().is_ok(), "{name}");
        }
    }

    #[test]
    fn the_fan_is_seen_as_its_image_and_pixels_invert() {
        let mut camera = Camera::new(Direction::Fan, Orbit::default(), Axes::Depth, Some(Pose::IDENTITY)).unwrap();
        assert!((camera.right - DVec3::X).length() < 1e-12 && (camera.up + DVec3::Z).length() < 1e-12);
        camera.fit(&[DVec3::splat(-20.0), DVec3::splat(30.0)], (10.0, 0.0), (400.0, 300.0));
        let point = DVec3::new(4.0, camera.centre_mm.y, 9.0);
        let (column, row) = camera.pixel(point);
        assert!((camera.point(column, row) - point).length() < 1e-9);
        let below = camera.pixel(point + DVec3::Z);
        assert!(below.1 > row, "depth goes down");
        assert!(Camera::new(Direction::Probe, Orbit::default(), Axes::Depth, None).is_none());
        for direction in Direction::NAMED.map(|(_, direction)| direction) {
            for axes in [Axes::Depth, Axes::Anatomical, Axes::Patient] {
                let orbit = Orbit { azimuth_deg: 33.0, elevation_deg: -71.0 };
                let c = Camera::new(direction, orbit, axes, Some(Pose::IDENTITY)).unwrap();
                assert!((c.right.cross(c.up) + c.forward).length() < 1e-9, "{direction:?}");
            }
        }
    }
}
