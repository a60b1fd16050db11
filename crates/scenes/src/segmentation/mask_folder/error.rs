//! Errors of folders of masks.

use std::path::PathBuf;

use insonify_core::files::FileError;
use thiserror::Error;

use super::super::volume::VolumeError;

/// A folder of masks that can't be read as one label map.
#[derive(Debug, Error)]
pub enum MaskFolderError {
    /// A folder that the operating system can't read.
    #[error(transparent)]
    File(#[from] FileError),
    /// A folder without a volume file.
    #[error(
        "{path} has no masks: {found}. A folder is read if it holds one NIfTI or NRRD file per organ, as TotalSegmentator \
         writes it (its option --ml writes one file for all organs){remedy}"
    )]
    NoMasks {
        /// Path of the folder.
        path: PathBuf,
        /// Content of the folder, as text.
        found: String,
        /// Advice, starting with a semicolon, or empty.
        remedy: String,
    },
    /// Files whose names are not names of organs.
    #[error(
        "{path}: {names}; give them a meaning with --map NAME=TISSUE (or =CLASS, or =ignore), or leave them out with \
         --leave-out-unknown; a file of several organs is given alone"
    )]
    Unknown {
        /// Path of the folder.
        path: PathBuf,
        /// Descriptions of the files' names, with the nearest known ones.
        names: String,
    },
    /// Two files of one organ.
    #[error(
        "{path}: `{first}` and `{second}` are both `{organ}`: move one of them away, or leave it out with --map {stem}=ignore"
    )]
    Twice {
        /// Path of the folder.
        path: PathBuf,
        /// First file.
        first: String,
        /// Second file.
        second: String,
        /// Name of the second file without its suffixes.
        stem: String,
        /// Class that both names stand for.
        organ: String,
    },
    /// A file that can't be read as a label map.
    #[error(transparent)]
    Volume(#[from] VolumeError),
    /// A file with several labels.
    #[error(
        "{path} has the labels {values}, and the files of a folder have one organ each: give that file alone, or move it away"
    )]
    SeveralLabels {
        /// Path of the file.
        path: PathBuf,
        /// The first labels.
        values: String,
    },
    /// A file on another grid than the first one.
    #[error(
        "{path} has {found}, and {first} has {expected}: the masks of a folder share one grid; resample that file to the others, or \
         move it away"
    )]
    OtherGrid {
        /// Path of the file.
        path: PathBuf,
        /// Description of the file's grid.
        found: String,
        /// Path of the file that was read first.
        first: PathBuf,
        /// Description of the first file's grid.
        expected: String,
    },
    /// No mask of a body.
    #[error("{path}, given as --body, has no mask that is called body or skin; it has {found}")]
    NoBody {
        /// Path of the folder.
        path: PathBuf,
        /// Names of the masks in the folder.
        found: String,
    },
    /// Masks without a voxel.
    #[error("{path}: {} empty", all_masks(*files))]
    Empty {
        /// Path of the folder.
        path: PathBuf,
        /// Number of files.
        files: usize,
    },
    /// Masks that are all left out of the scene.
    #[error("{path}: {} ignored; give one a meaning with --map NAME=TISSUE (or =CLASS)", all_masks(*files))]
    Ignored {
        /// Path of the folder.
        path: PathBuf,
        /// Number of files.
        files: usize,
    },
}

/// Subject and verb of a sentence about all masks of a folder.
fn all_masks(files: usize) -> String {
    if files == 1 { "its one mask is".to_owned() } else { format!("all {files} masks are") }
}
