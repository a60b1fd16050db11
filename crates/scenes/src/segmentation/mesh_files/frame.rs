//! Units and axes of mesh files.

use std::fmt;

use glam::{DMat3, DVec3};

use insonify_core::names::named;

/// Unit of a file's coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// Millimetres.
    Mm,
    /// Centimetres.
    Cm,
    /// Metres.
    M,
    /// Inches.
    In,
}

named!(Unit { Mm = "mm", Cm = "cm", M = "m", In = "in" });

impl Unit {
    /// Length of the unit, mm.
    pub fn mm(self) -> f64 {
        match self {
            Self::Mm => 1.0,
            Self::Cm => 10.0,
            Self::M => 1000.0,
            Self::In => 25.4,
        }
    }
}

/// Directions of a file's axes. All variants are right-handed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MeshAxes {
    /// x to the patient's left, y posterior, z cranial: DICOM, ITK, files of 3D Slicer; also figures in Blender, which
    /// face −y.
    Lps,
    /// x to the patient's right, y anterior, z cranial: NIfTI, the scene of 3D Slicer.
    Ras,
    /// x to the patient's left, y cranial, z anterior: glTF, and figures in programs whose y axis points up.
    YUp,
}

named!(MeshAxes { Lps = "lps", Ras = "ras", YUp = "y-up" });

impl MeshAxes {
    /// Rotation from the file's axes to LPS.
    pub fn lps_from_file(self) -> DMat3 {
        match self {
            Self::Lps => DMat3::IDENTITY,
            Self::Ras => DMat3::from_diagonal(DVec3::new(-1.0, -1.0, 1.0)),
            Self::YUp => DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y),
        }
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl fmt::Display for MeshAxes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}
