//! Orientation of a scene's axes.

use glam::DVec3;

/// Meaning of a scene's axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Axes {
    /// z is the depth, as in the scenes of [`analytic`](super::analytic).
    #[default]
    Depth,
    /// x to the mother's left, y cranial, z anterior, as in the obstetric phantom.
    Anatomical,
    /// x to the patient's left, y posterior, z cranial: the patient axes of DICOM (LPS).
    Patient,
}

impl Axes {
    /// Value of `extras.axes` of a glTF scene.
    pub fn name(self) -> &'static str {
        match self {
            Self::Depth => "depth",
            Self::Anatomical => "anatomical",
            Self::Patient => "lps",
        }
    }

    /// Axes whose [`name`](Self::name) is `name`; `None` for an unknown name.
    pub fn named(name: &str) -> Option<Self> {
        [Self::Depth, Self::Anatomical, Self::Patient].into_iter().find(|axes| axes.name() == name)
    }

    /// Converts the point `lps` (x left, y posterior, z superior) to a scene with these axes. For [`Axes::Depth`],
    /// which has no patient, the point stays as it is.
    pub fn from_lps(self, lps: DVec3) -> DVec3 {
        match self {
            Self::Depth | Self::Patient => lps,
            Self::Anatomical => DVec3::new(lps.x, lps.z, -lps.y),
        }
    }

    /// Labels of the +x, +y and +z directions.
    pub fn labels(self) -> [&'static str; 3] {
        match self {
            Self::Depth => ["x", "y", "z depth"],
            Self::Anatomical => ["L", "cranial", "anterior"],
            Self::Patient => ["L", "posterior", "cranial"],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_the_patient_are_turned_into_the_axes_of_the_scene() {
        let lps = DVec3::new(1.0, 2.0, 3.0);
        assert_eq!(Axes::Patient.from_lps(lps), lps);
        // Left, cranial, anterior.
        assert_eq!(Axes::Anatomical.from_lps(lps), DVec3::new(1.0, 3.0, -2.0));
    }
}
