//! Errors of volume files.

use std::path::{Path, PathBuf};

use thiserror::Error;

use insonify_core::files::NoMemory;

/// A volume file that can't be used, and why.
#[derive(Debug, Error)]
#[error("{}: {fault}", path.display())]
pub struct VolumeError {
    /// Path of the file.
    pub path: PathBuf,
    /// Fault in the file.
    pub fault: VolumeFault,
}

impl VolumeError {
    pub(super) fn new(path: &Path, fault: VolumeFault) -> Self {
        Self { path: path.to_owned(), fault }
    }
}

/// Faults of volume files; `VolumeError` adds the path.
#[derive(Debug, Error)]
pub enum VolumeFault {
    /// A file that the operating system can't read.
    #[error("can't be read: {0}")]
    Read(#[from] std::io::Error),
    /// Damaged compressed data.
    #[error("the gzip data is damaged: {0}")]
    Gzip(std::io::Error),
    /// A file of another kind.
    #[error(
        "{found}; label maps and images are read from NIfTI (.nii, .nii.gz, .hdr with .img) and NRRD (.nrrd, .nhdr, \
         .seg.nrrd) files{remedy}"
    )]
    Format {
        /// Description of the content.
        found: &'static str,
        /// Advice, starting with `; `, or empty.
        remedy: &'static str,
    },
    /// A header that contradicts itself or its format.
    #[error("header: {0}")]
    Header(String),
    /// An unsupported feature of the format.
    #[error("{what} can't be read; {remedy}")]
    Unsupported {
        /// Name of the feature.
        what: String,
        /// Advice to the user.
        remedy: &'static str,
    },
    /// A file that ends too early.
    #[error("truncated: {part}: {expected} bytes expected, {found} found")]
    Truncated {
        /// Part of the file that ends early.
        part: &'static str,
        /// Number of bytes that the header announces.
        expected: u64,
        /// Number of bytes found.
        found: u64,
    },
    /// More data than the header announces.
    #[error("the data is longer than the {expected} bytes that the header's sizes and type take; one of them is wrong")]
    Surplus {
        /// Number of bytes that the header announces.
        expected: u64,
    },
    /// A size over a limit.
    #[error("{what} is {found}; at most {limit} is read: crop the volume, or resample it to larger voxels")]
    TooLarge {
        /// Quantity that exceeds its limit.
        what: &'static str,
        /// Size found.
        found: u64,
        /// Largest accepted number.
        limit: u64,
    },
    /// A segmentation with too many layers.
    #[error(
        "it has {found} layers; at most {limit} are read: save fewer segments, or collapse the layers in 3D Slicer"
    )]
    Layers {
        /// Number of layers found.
        found: usize,
        /// Largest accepted number.
        limit: usize,
    },
    /// More voxels than there is memory for.
    #[error("{0}: crop the volume, or resample it to larger voxels")]
    Memory(#[from] NoMemory),
    /// A file that doesn't state its orientation.
    #[error(
        "the file doesn't state where its axes point ({found}); if you know, pass `--assume-axes lps` (x to the \
         patient's left, y posterior, z superior), `--assume-axes ras` (x right, y anterior, z superior) or `--assume-axes las` (x \
         left, y anterior, z superior)"
    )]
    NoAxes {
        /// Description of the header's missing fields or values.
        found: &'static str,
    },
    /// An sform and a qform that contradict each other.
    #[error(
        "its sform and qform contradict each other: {what}; if you know which one is right, pass `--prefer sform` (which \
         nibabel reads) or `--prefer qform`, else write the file anew with the program that made it"
    )]
    Forms {
        /// Description of the contradiction.
        what: String,
    },
    /// Voxels of impossible size or shape.
    #[error(
        "{what}; voxels of 0.01 mm to 50 mm are read, and a wrong unit of length in the header ({unit}) is the most \
         likely cause"
    )]
    Degenerate {
        /// Description of the size or shape.
        what: String,
        /// Unit of length that the header states.
        unit: &'static str,
    },
    /// Values that aren't labels.
    #[error(
        "looks like an image, not a label map: voxel {voxel:?} is {value}, and labels are whole numbers from 0 to \
         65535; pass it with `--image`, or if it is a label map, round it to whole numbers and save it as an integer \
         type"
    )]
    NotLabels {
        /// Indices i, j, k of the voxel.
        voxel: [usize; 3],
        /// Value of that voxel.
        value: f64,
    },
    /// A label outside 0..=65535.
    #[error(
        "voxel {voxel:?} has the label {value}; labels go from 0 to 65535: renumber them, or pass the file with \
         `--image` if it is an image"
    )]
    LabelRange {
        /// Indices i, j, k of the voxel.
        voxel: [usize; 3],
        /// Value of that voxel.
        value: String,
    },
    /// A value in an ASCII-encoded file that isn't a number of the stated type.
    #[error("value {index} of the text data is `{text}`, not a number of type {kind}")]
    Text {
        /// Index of the value in the file.
        index: usize,
        /// Text found.
        text: String,
        /// Type that the header states.
        kind: &'static str,
    },
    /// A fault in a separate file of voxels, which the header names.
    #[error("data file {}: {fault}", path.display())]
    DataFile {
        /// Path of the data file.
        path: PathBuf,
        /// Fault in that file.
        fault: Box<VolumeFault>,
    },
}
