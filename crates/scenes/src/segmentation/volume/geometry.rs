//! Patient axes, and conversion of voxel grids to LPS.

use glam::{DAffine3, DMat3, DVec3};
use insonify_core::names::named;

use super::VolumeFault;

/// Directions of a file's x, y and z axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PatientAxes {
    /// x to the patient's left, y posterior, z superior.
    Lps,
    /// x to the patient's right, y anterior, z superior.
    Ras,
    /// x to the patient's left, y anterior, z superior.
    Las,
}

named!(PatientAxes { Lps = "lps", Ras = "ras", Las = "las" });

impl PatientAxes {
    /// Rotation or reflection that converts coordinates in these axes to LPS.
    pub(super) fn lps_from_axes(self) -> DMat3 {
        DMat3::from_diagonal(match self {
            Self::Lps => DVec3::new(1.0, 1.0, 1.0),
            Self::Ras => DVec3::new(-1.0, -1.0, 1.0),
            Self::Las => DVec3::new(1.0, -1.0, 1.0),
        })
    }
}

/// Accepted distances between neighbouring voxels, mm.
const VOXEL_MM: std::ops::RangeInclusive<f64> = 0.01..=50.0;

/// Smallest volume of a voxel, relative to that of a box with the same edge lengths.
const LEAST_VOLUME: f64 = 1e-3;

/// Converts `affine` from `axes` to LPS, and from the header's `unit` to mm. `unit_mm` is the length of the unit in mm.
///
/// # Errors
/// Non-finite numbers; flat voxels; voxel sizes outside 0.01 mm to 50 mm.
pub(super) fn lps_mm(
    affine: DAffine3,
    axes: PatientAxes,
    (unit, unit_mm): (&'static str, f64),
) -> Result<DAffine3, VolumeFault> {
    let degenerate = |what: String| VolumeFault::Degenerate { what, unit };
    let lps_from_axes = axes.lps_from_axes();
    let edges = affine.matrix3 * unit_mm;
    let (matrix, origin) = (lps_from_axes * edges, lps_from_axes * (affine.translation * unit_mm));
    if !matrix.is_finite() || !origin.is_finite() {
        return Err(degenerate("the affine has values that aren't finite".to_owned()));
    }
    let lengths = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(DVec3::length);
    if let Some((axis, length)) = lengths.iter().enumerate().find(|(_, length)| !VOXEL_MM.contains(*length)) {
        return Err(degenerate(format!("voxels are {length} mm apart along axis {}", ["i", "j", "k"][axis])));
    }
    let relative = matrix.determinant().abs() / lengths.iter().product::<f64>();
    if relative < LEAST_VOLUME {
        return Err(degenerate("the affine's axes lie in one plane: its determinant is near zero".to_owned()));
    }
    // Adding zero turns -0 into 0, so that equal placements are also printed alike.
    let clean = |v: DVec3| v + DVec3::ZERO;
    let matrix = DMat3::from_cols(clean(matrix.x_axis), clean(matrix.y_axis), clean(matrix.z_axis));
    Ok(DAffine3::from_mat3_translation(matrix, clean(origin)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scaled(x: f64, unit: (&'static str, f64)) -> Result<DAffine3, VolumeFault> {
        lps_mm(DAffine3::from_scale(DVec3::new(x, 1.0, 1.0)), PatientAxes::Ras, unit)
    }

    #[test]
    fn ras_is_turned_about_the_vertical() {
        let affine = DAffine3::from_translation(DVec3::new(1.0, 2.0, 3.0));
        let lps = lps_mm(affine, PatientAxes::Ras, ("mm", 1.0)).unwrap();
        assert_eq!(lps.transform_point3(DVec3::new(1.0, 1.0, 1.0)), DVec3::new(-2.0, -3.0, 4.0));
        let las = lps_mm(affine, PatientAxes::Las, ("cm", 10.0)).unwrap();
        assert_eq!(las.transform_point3(DVec3::new(1.0, 1.0, 1.0)), DVec3::new(20.0, -30.0, 40.0));
    }

    #[test]
    fn impossible_voxels_are_refused_with_their_unit() {
        for (x, unit, says) in [
            (0.001, ("m", 1000.0), "1000 mm apart along axis j"),
            (0.0, ("mm", 1.0), "0 mm apart along axis i"),
            (60.0, ("mm", 1.0), "60 mm apart along axis i"),
            (f64::NAN, ("mm", 1.0), "aren't finite"),
        ] {
            let error = scaled(x, unit).unwrap_err().to_string();
            assert!(error.contains(says) && error.contains(&format!("({})", unit.0)), "{error}");
        }
        let flat = DAffine3::from_mat3(DMat3::from_cols(DVec3::X, DVec3::X, DVec3::Z));
        assert!(lps_mm(flat, PatientAxes::Lps, ("mm", 1.0)).unwrap_err().to_string().contains("in one plane"));
        assert!(scaled(0.5, ("mm", 1.0)).is_ok());
    }
}
