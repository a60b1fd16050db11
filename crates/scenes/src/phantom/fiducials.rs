//! Touchable points on the mother's skin, for registering a tracker.

use glam::DVec3;
use insonify_core::pose::csv::Named;

use super::{Parameters, skin};

/// Directions of the obstetric phantom's fiducials from inside the uterus: x mother's left, y cranial, z anterior. They
/// surround the belly and are not coplanar.
const DIRECTIONS: [(&str, [f64; 3]); 7] = [
    ("BELLY_TOP", [0.0, 0.0, 1.0]),
    ("UPPER_MIDLINE", [0.0, 0.6, 0.8]),
    ("LOWER_MIDLINE", [0.0, -0.6, 0.8]),
    ("LEFT_FLANK", [1.0, 0.0, 0.0]),
    ("RIGHT_FLANK", [-1.0, 0.0, 0.0]),
    ("LEFT_ILIAC", [0.64, -0.48, 0.6]),
    ("RIGHT_ILIAC", [-0.64, -0.48, 0.6]),
];

/// Fiducials of the obstetric phantom, scene frame, mm: points where straight lines from the middle of the uterus
/// leave the skin.
pub fn fiducials(parameters: &Parameters) -> Vec<Named<DVec3>> {
    let skin = skin(parameters);
    let point = |(name, direction): (&str, [f64; 3])| {
        let value = skin.exit(DVec3::ZERO, DVec3::from_array(direction).normalize())?;
        Some(Named { name: name.to_owned(), value })
    };
    DIRECTIONS.into_iter().filter_map(point).collect()
}

#[cfg(test)]
mod tests {
    use insonify_core::pose::registration::{PointPair, register};

    use super::*;

    #[test]
    fn the_phantoms_points_register_a_tracker() {
        let points = fiducials(&Parameters::default());
        assert_eq!(points.len(), DIRECTIONS.len());
        let pairs: Vec<_> =
            points.iter().map(|p| PointPair { scene_mm: p.value, tracker_mm: p.value + DVec3::X * 300.0 }).collect();
        let found = register(&pairs).unwrap();
        assert!(found.rms_mm < 1e-9 && !found.coplanar, "{found:?}");
        // A reversed axis is detected.
        let mirrored: Vec<_> =
            pairs.iter().map(|p| PointPair { tracker_mm: p.tracker_mm * DVec3::new(1.0, 1.0, -1.0), ..*p }).collect();
        assert!(register(&mirrored).unwrap_err().to_string().contains("mirror image"));
    }
}
