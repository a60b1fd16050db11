//! Errors of gathering labels, body and image.

use std::path::PathBuf;

use insonify_core::files::NoMemory;
use insonify_core::names::listed;
use thiserror::Error;

use super::image::ImageError;

/// Most unknown segments in a message.
const LISTED_MAX: usize = 5;
/// Number of unknown segments above which the file is likely an image instead of a label map.
const IMAGE_VALUES: usize = 20;

/// Error in making the inputs of a scene from a label map, a body and an image.
#[derive(Debug, Error)]
pub enum GatherError {
    /// Segments without a known meaning.
    #[error(
        "{path}: {}; give them a meaning with --map NAME=TISSUE (or =CLASS, or =ignore), or leave them out with \
         --leave-out-unknown{}",
        listed(names, LISTED_MAX, "; "),
        if names.len() > IMAGE_VALUES { "; with so many values it may be an image: that goes to --image" } else { "" }
    )]
    Unmapped {
        /// Path of the label map.
        path: PathBuf,
        /// Descriptions of the segments, each with its number, its voxels and the nearest known names.
        names: Vec<String>,
    },
    /// A map that contains only background.
    #[error("{path}: all voxels are 0: it labels nothing. Give the file that the segmentation was written to")]
    Empty {
        /// Path of the label map.
        path: PathBuf,
    },
    /// A label map without any organ.
    #[error(
        "{path} has no segment that becomes an organ: {found}; --names chooses the table of names, --map adds to it"
    )]
    Nothing {
        /// Path of the label map.
        path: PathBuf,
        /// Segments found instead of organs.
        found: String,
    },
    /// More organs than a scene has surfaces.
    #[error(
        "{path} has {found} organs, and a scene has at most {limit} surfaces: leave some out with --map NAME=ignore, or join \
         labels of one tissue"
    )]
    TooMany {
        /// Path of the label map.
        path: PathBuf,
        /// Number of segments that are organs.
        found: usize,
        /// Largest number of organs.
        limit: usize,
    },
    /// A body or an image that seems to be of another scan.
    #[error(
        "{path}, given as {option}, holds only {percent:.0} % of the labelled voxels of {labels}: is it of the same \
         scan?{hint}"
    )]
    OtherScan {
        /// Path of the body or image.
        path: PathBuf,
        /// Command-line option that named the file.
        option: &'static str,
        /// Path of the label map.
        labels: PathBuf,
        /// Share of the labelled voxels within the body or image, %.
        percent: f64,
        /// Suggested change of the file's affine, as a sentence after a space, or empty.
        hint: String,
    },
    /// A body that leaves an organ mostly outside.
    #[error(
        "{path}, given as --body, leaves most of an organ of {labels} outside: {organs} of the voxels; is it of the same scan? \
         --allow-implausible makes them part of the body"
    )]
    OrganOutside {
        /// Path of the body's label map.
        path: PathBuf,
        /// Path of the label map.
        labels: PathBuf,
        /// Names of the organs, each with the share outside the body.
        organs: String,
    },
    /// A body that consists of the organs alone.
    #[error(
        "{path}, given as --body, holds only the organs that {labels} labels, no body around them: give the body's outline, as \
         TotalSegmentator's task body writes it, or leave --body out; --allow-implausible takes it all the same"
    )]
    OnlyOrgans {
        /// Path of the body's label map.
        path: PathBuf,
        /// Path of the label map.
        labels: PathBuf,
    },
    /// A volume too large for the available memory.
    #[error("{path}: {none}: crop the volume, or resample it to larger voxels")]
    Memory {
        /// Path of the label map or image.
        path: PathBuf,
        /// Size of the missing memory.
        none: NoMemory,
    },
    /// An image that doesn't fit the labels, or isn't of the expected kind.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A label map of the body that contains only background.
    #[error("{path}, given as --body, labels nothing but background")]
    NoBody {
        /// Path of the label map.
        path: PathBuf,
    },
}
