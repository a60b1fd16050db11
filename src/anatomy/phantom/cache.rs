//! The phantom's file, made on first use.

use std::path::{Path, PathBuf};

use thiserror::Error;

use super::{PhantomError, PhantomOptions, Progress, build};
use crate::anatomy::export::{ExportError, write_glb};

/// Raised whenever the generator's output changes, so that an old file is not taken for a new one.
const GENERATOR: &str = "obstetric-4";

/// Why the phantom's file could not be had.
#[derive(Debug, Error)]
pub enum CacheError {
    /// The phantom could not be built.
    #[error(transparent)]
    Build(#[from] PhantomError),
    /// The file could not be written.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// The folder could not be made.
    #[error("cannot make the cache folder {path}: {source}")]
    Folder {
        /// Folder.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
}

/// The phantom at `scale` as a .glb in `cache_dir`, built unless this version of the generator has done so before.
///
/// `progress` is only called where the phantom is built. Two processes may build at once: each renames a whole file
/// into place, and both are the same.
///
/// # Errors
/// The phantom cannot be built at this scale, or the folder or file cannot be written.
pub fn cached(cache_dir: &Path, scale: f64, progress: &(dyn Fn(Progress) + Sync)) -> Result<PathBuf, CacheError> {
    let path = cache_dir.join(file_name(scale));
    if path.is_file() {
        return Ok(path);
    }
    let surfaces = build(&PhantomOptions { scale }, progress)?;
    std::fs::create_dir_all(cache_dir).map_err(|source| CacheError::Folder { path: cache_dir.to_owned(), source })?;
    write_glb(&surfaces, &path)?;
    Ok(path)
}

fn file_name(scale: f64) -> String {
    // FNV-1a: small, and the same on every machine and Rust version.
    let hash =
        GENERATOR.bytes().fold(0xcbf2_9ce4_8422_2325u64, |h, b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3));
    format!("phantom-{scale}-{hash:016x}.glb")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_have_files_of_their_own() {
        assert_ne!(file_name(1.0), file_name(0.5));
    }
}
