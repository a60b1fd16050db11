//! Errors of images that are given with a label map.

use std::path::PathBuf;

use thiserror::Error;

/// An image that is refused.
#[derive(Debug, Error)]
pub enum ImageError {
    /// An image whose voxels all have the same value.
    #[error("{path}, given as --image, has the value {value} in all voxels: give the CT or MR that was segmented")]
    Constant {
        /// Path of the image.
        path: PathBuf,
        /// Value of all voxels.
        value: f32,
    },
    /// A CT whose values aren't HU.
    #[error(
        "{path}, given as --image, looks like a CT that isn't in HU: {seen}. {remedy}; or leave --image out and give the \
         body's outline with --body, or pass --image-type mr if it is an MR"
    )]
    NotHu {
        /// Path of the image.
        path: PathBuf,
        /// Values of air, fat, organs and bone in the image, as text.
        seen: String,
        /// Advice, as a sentence without a full stop.
        remedy: String,
    },
    /// An image with air at voxels that are labelled as soft tissue.
    #[error(
        "{path}, given as --image, doesn't fit the labels: {percent:.0} % of the soft tissue lies in {what} ({seen}). {hint}"
    )]
    InAir {
        /// Path of the image.
        path: PathBuf,
        /// Share of the soft tissue in air, %.
        percent: f64,
        /// Name of the dark material that the soft tissue lies in: air, or the background.
        what: &'static str,
        /// Value of the soft tissue, as text.
        seen: String,
        /// Likely cause and way out.
        hint: String,
    },
    /// An image whose mirror image fits the labels better than the image itself.
    #[error(
        "{path}, given as --image, fits the labels better when mirrored {direction}: borders of organs then stand out \
         {times:.1} times as much. Mirror its voxels and keep its affine, or give the image that was segmented"
    )]
    Mirrored {
        /// Path of the image.
        path: PathBuf,
        /// Direction, as `left to right`.
        direction: String,
        /// Quality of the mirror image relative to the image as given; quality is the ratio of edges at organs'
        /// borders to edges within organs.
        times: f64,
    },
}
