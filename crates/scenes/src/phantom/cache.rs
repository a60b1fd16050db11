//! Cache of phantom files, built on first use.

use std::path::{Path, PathBuf};

use insonify_core::anatomy::export::{ExportError, write_moving_glb};
use insonify_core::files::FileError;
use tempfile::TempDir;
use thiserror::Error;

use super::{PhantomError, PhantomOptions, PhantomSurface, Progress, build, movement};

/// Version of the generator's output, hashed into each file's name. Every change of the output raises it, so old files
/// are no longer used.
const GENERATOR: &str = "obstetric-9";

/// Action that failed, in an error message.
const MAKE_FOLDER: &str = "make the cache folder";

/// Errors in obtaining a phantom file.
#[derive(Debug, Error)]
pub enum CacheError {
    /// The phantom could not be built.
    #[error(transparent)]
    Build(#[from] PhantomError),
    /// The file could not be written.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// The folder could not be created.
    #[error(transparent)]
    File(#[from] FileError),
}

/// Path of the .glb file of the phantom of `options` in `cache_dir`. The file is built if this generator version has
/// not written it yet.
///
/// `progress` is called only during a build. Two processes may build at once: each renames a complete file into place,
/// and both files are the same.
///
/// # Errors
/// The phantom cannot be built with these options, or the folder or file cannot be written.
pub fn cached(
    cache_dir: &Path,
    options: &PhantomOptions,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<PathBuf, CacheError> {
    let path = cache_dir.join(file_name(options));
    if !path.is_file() {
        write(&build(options, progress)?, options, cache_dir)?;
    }
    Ok(path)
}

/// File of a phantom. A file outside the cache is deleted when this value is dropped.
#[derive(Debug)]
pub struct PhantomFile {
    /// Path of the .glb file.
    pub path: PathBuf,
    _temporary: Option<TempDir>,
}

/// Like [`cached`], but if the cache cannot be written, warns and writes to the system's temporary folder.
///
/// # Errors
/// The phantom cannot be built with these options, or neither folder can be written.
pub fn cached_or_temporary(
    cache_dir: &Path,
    options: &PhantomOptions,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<PhantomFile, CacheError> {
    let path = cache_dir.join(file_name(options));
    if path.is_file() {
        return Ok(PhantomFile { path, _temporary: None });
    }
    let surfaces = build(options, progress)?;
    let Err(error) = write(&surfaces, options, cache_dir) else {
        return Ok(PhantomFile { path, _temporary: None });
    };
    tracing::warn!("the generated scene is not kept, and will be built again: {error}");
    let folder = tempfile::tempdir().map_err(FileError::at(MAKE_FOLDER, &std::env::temp_dir()))?;
    let path = write(&surfaces, options, folder.path())?;
    Ok(PhantomFile { path, _temporary: Some(folder) })
}

/// Writes a phantom into `folder`, which is made if missing.
fn write(surfaces: &[PhantomSurface], options: &PhantomOptions, folder: &Path) -> Result<PathBuf, CacheError> {
    let path = folder.join(file_name(options));
    std::fs::create_dir_all(folder).map_err(FileError::at(MAKE_FOLDER, folder))?;
    write_moving_glb(surfaces, &movement(&options.parameters), &path)?;
    Ok(path)
}

fn file_name(options: &PhantomOptions) -> String {
    let PhantomOptions { scale, parameters: p } = options;
    let what = format!(
        "{GENERATOR} {} {} {} {} {} {} {} {} {} {}",
        p.gestational_weeks,
        p.lie.name(),
        p.roll_deg,
        p.flexion,
        p.placenta.name(),
        p.fluid_index_mm,
        p.maternal_fat_mm,
        p.wall.name(),
        p.recti_lens,
        p.seed
    );
    // FNV-1a: small, and the same on every machine and Rust version.
    let hash = what.bytes().fold(0xcbf2_9ce4_8422_2325u64, |h, b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3));
    format!("phantom-{scale}-{}w-{}-{hash:016x}.glb", p.gestational_weeks, p.lie.name())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantom::{Lie, Parameters, PlacentaSite, Wall};

    #[test]
    fn different_options_have_different_files() {
        let p = Parameters::default();
        let options = [
            PhantomOptions::default(),
            PhantomOptions { scale: 0.5, ..PhantomOptions::default() },
            PhantomOptions { parameters: Parameters { gestational_weeks: 28.0, ..p }, scale: 1.0 },
            PhantomOptions { parameters: Parameters { lie: Lie::Breech, ..p }, scale: 1.0 },
            PhantomOptions { parameters: Parameters { roll_deg: 10.0, ..p }, scale: 1.0 },
            PhantomOptions { parameters: Parameters { flexion: 0.7, ..p }, scale: 1.0 },
            PhantomOptions { parameters: Parameters { placenta: PlacentaSite::Fundal, ..p }, scale: 1.0 },
            PhantomOptions { parameters: Parameters { fluid_index_mm: 99.0, ..p }, scale: 1.0 },
            PhantomOptions { parameters: Parameters { maternal_fat_mm: 30.0, ..p }, scale: 1.0 },
            PhantomOptions { parameters: Parameters { wall: Wall::Hard, ..p }, scale: 1.0 },
            PhantomOptions { parameters: Parameters { recti_lens: true, ..p }, scale: 1.0 },
            PhantomOptions { parameters: Parameters { seed: 1, ..p }, scale: 1.0 },
        ];
        let names: std::collections::BTreeSet<_> = options.iter().map(file_name).collect();
        assert_eq!(names.len(), options.len(), "{names:?}");
    }
}
