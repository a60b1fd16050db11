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

/// Value for voxels outside a CT image, HU: about that of air.
pub const OUTSIDE: f32 = -1024.0;

/// Choices by the user in reading volumes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ReadOptions {
    /// Axes that are assumed for files that state no axes; ignored for other files.
    pub assume_axes: Option<PatientAxes>,
    /// Preferred form of NIfTI files whose sform and qform contradict each other. If `None`, such files are refused.
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
    /// Affine, NIfTI's method 3.
    Sform,
    /// Quaternion and voxel distances, NIfTI's method 2.
    Qform,
}

named!(NiftiForm { Sform = "sform", Qform = "qform" });

/// Label map: a segmentation on a grid of voxels.
#[derive(Debug, Clone, PartialEq)]
pub struct LabelMap {
    /// Path of the file.
    pub path: PathBuf,
    /// Number of voxels along i, j and k.
    pub size: [usize; 3],
    /// Transform from voxel index to patient position (LPS), mm.
    pub lps_from_voxel: DAffine3,
    /// Labels of each layer, i fastest; 0 is background. A voxel has a label in each layer, so segments of different
    /// layers may overlap.
    pub layers: Vec<Vec<u16>>,
    /// Segments: first the segments that the file names, in its order; then the other labels that occur in the voxels,
    /// ascending.
    pub segments: Vec<Segment>,
    /// Assumptions and choices in reading, one sentence each.
    pub remarks: Vec<String>,
}

/// Segment: the voxels of a label map that have one label in one layer.
#[derive(Debug, Clone, PartialEq)]
pub struct Segment {
    /// Index of the segment's layer.
    pub layer: usize,
    /// Label of the segment in that layer, at least 1.
    pub value: u16,
    /// Name in the file, if it has one.
    pub name: Option<String>,
    /// Colour in the file, sRGB, if it has one.
    pub colour: Option<[u8; 3]>,
    /// Meanings of the file's coded terms for the segment, such as `Kidney, Right`.
    pub terminology: Option<String>,
}

/// A scalar image, such as a CT.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// Path of the file.
    pub path: PathBuf,
    /// Number of voxels along i, j and k.
    pub size: [usize; 3],
    /// Transform from voxel index to patient position (LPS), mm.
    pub lps_from_voxel: DAffine3,
    /// Values after slope and intercept, i fastest; HU for a CT.
    pub values: Vec<f32>,
    /// Kind of the image as stated by the user. If `None`, the kind is determined from the values.
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
