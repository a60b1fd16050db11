//! Reading of grey images.

use std::io::{self, BufReader};
use std::path::{Path, PathBuf};

use image::ImageReader;
use thiserror::Error;

use super::{FileError, FileKind, open};

/// Error in reading a grey image.
#[derive(Debug, Error)]
pub enum GreyError {
    /// Failed file access, a file that is no image, or a damaged one.
    #[error(transparent)]
    File(#[from] FileError),
    /// An image with colours, or of another bit depth.
    #[error("{path} is not an 8-bit grey image")]
    Kind {
        /// Path of the file.
        path: PathBuf,
    },
}

/// Pixels of an 8-bit grey image, row by row from the top, and its width and height.
///
/// # Errors
/// A file that cannot be read, is not an image, or is not an 8-bit grey image.
pub fn read_grey(path: &Path) -> Result<(Vec<u8>, [u32; 2]), GreyError> {
    let failed = FileError::at("read", path);
    let file = BufReader::new(open(path, FileKind::Image).map_err(failed)?);
    let image = ImageReader::new(file).with_guessed_format().map_err(failed)?.decode();
    let image = image.map_err(|error| failed(io::Error::other(error)))?;
    if image.color() != image::ColorType::L8 {
        return Err(GreyError::Kind { path: path.to_owned() });
    }
    let size = [image.width(), image.height()];
    Ok((image.into_bytes(), size))
}
