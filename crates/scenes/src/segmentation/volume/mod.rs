//! Label maps and images of patients, from NIfTI and NRRD files.
//!
//! Positions are in LPS, mm: x to the patient's left, y posterior, z superior. Voxels are stored with i fastest, and
//! whole indices are voxel centres.

mod canonical;
mod fault;
#[cfg(test)]
mod fixtures;
mod geometry;
mod label_names;
mod nifti;
mod nrrd;
mod raw;
mod read;
mod samples;
mod source;

use std::path::PathBuf;

use glam::DAffine3;
use insonify_core::names::named;

use super::grid::Grid;

pub use fault::{VolumeError, VolumeFault};
pub use geometry::PatientAxes;
pub use nifti::decode_nifti;
pub use nrrd::decode_nrrd;
pub use raw::RawVolume;
pub use read::{read_image, read_labels};

/// Value of voxels outside a CT image, HU: the radiodensity of air.
pub const OUTSIDE: f32 = -1024.0;

/// Choices of the reader.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ReadOptions {
    /// Axes of files that don't state theirs; files that do are not affected.
    pub assume_axes: Option<PatientAxes>,
    /// Placement of NIfTI files whose sform and qform contradict each other. Without it they are refused.
    pub prefer: Option<NiftiForm>,
}

/// Kind of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Modality {
    /// CT in HU.
    Ct,
    /// MR, or another image in which the body is bright.
    Mr,
}

named!(Modality { Ct = "ct", Mr = "mr" });

/// One of the two placements that a NIfTI file may have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NiftiForm {
    /// Affine of method 3.
    Sform,
    /// Quaternion and distances of method 2.
    Qform,
}

named!(NiftiForm { Sform = "sform", Qform = "qform" });

/// A segmentation.
#[derive(Debug, Clone, PartialEq)]
pub struct LabelMap {
    /// File.
    pub path: PathBuf,
    /// Voxels along i, j and k.
    pub size: [usize; 3],
    /// Transform from voxel index to patient position (LPS), mm.
    pub lps_from_voxel: DAffine3,
    /// Labels of each layer, i fastest; 0 is background. Segments of different layers may overlap.
    pub layers: Vec<Vec<u16>>,
    /// Segments: first those that the file names, in its order, then other labels that occur in the voxels, ascending.
    pub segments: Vec<Segment>,
    /// Assumptions and choices in reading, one sentence each.
    pub remarks: Vec<String>,
}

/// A region of a label map.
#[derive(Debug, Clone, PartialEq)]
pub struct Segment {
    /// Index of its layer.
    pub layer: usize,
    /// Its label there, at least 1.
    pub value: u16,
    /// Name in the file.
    pub name: Option<String>,
    /// Colour in the file, sRGB.
    pub colour: Option<[u8; 3]>,
    /// Meanings of its coded terms, such as `Kidney, Right`.
    pub terminology: Option<String>,
}

/// A scalar image, such as a CT.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// File.
    pub path: PathBuf,
    /// Voxels along i, j and k.
    pub size: [usize; 3],
    /// Transform from voxel index to patient position (LPS), mm.
    pub lps_from_voxel: DAffine3,
    /// Scaled values, i fastest; HU for a CT.
    pub values: Vec<f32>,
    /// Kind that the user states. Without it, the kind is judged by the values.
    pub stated: Option<Modality>,
    /// Assumptions and choices in reading, one sentence each.
    pub remarks: Vec<String>,
}

impl LabelMap {
    /// Grid of the voxels.
    pub fn grid(&self) -> Grid {
        Grid { size: self.size, lps_from_voxel: self.lps_from_voxel }
    }
}

impl Image {
    /// Grid of the voxels.
    pub fn grid(&self) -> Grid {
        Grid { size: self.size, lps_from_voxel: self.lps_from_voxel }
    }
}
