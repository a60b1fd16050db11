//! Orientation of a scene's axes.

/// Meaning of a scene's axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Axes {
    /// z is the depth, as in the analytic scenes.
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

    /// Axes with this name.
    pub fn named(name: &str) -> Option<Self> {
        [Self::Depth, Self::Anatomical, Self::Patient].into_iter().find(|axes| axes.name() == name)
    }

    /// Names of +x, +y and +z.
    pub fn labels(self) -> [&'static str; 3] {
        match self {
            Self::Depth => ["x", "y", "z depth"],
            Self::Anatomical => ["L", "cranial", "anterior"],
            Self::Patient => ["L", "posterior", "cranial"],
        }
    }
}
