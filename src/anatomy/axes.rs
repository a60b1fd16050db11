//! Orientation of a scene's axes.

/// Meaning of a scene's axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Axes {
    /// z is the depth, as in the analytic scenes.
    #[default]
    Depth,
    /// x to the mother's left, y cranial, z anterior, as in the obstetric phantom.
    Anatomical,
}

impl Axes {
    /// Names of +x, +y and +z.
    pub fn labels(self) -> [&'static str; 3] {
        match self {
            Self::Depth => ["x", "y", "z depth"],
            Self::Anatomical => ["L", "cranial", "anterior"],
        }
    }
}
