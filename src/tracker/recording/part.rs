//! Partial file of an unfinished recording.

use std::fs::{File, OpenOptions, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use super::RecordingError;

/// `NAME.part`: path of the recording `NAME` until it is finished.
pub fn part_path(path: &Path) -> PathBuf {
    with_suffix(path, ".part")
}

/// Creates the `.part` of `path`, locked while it is open.
///
/// An existing one from an interrupted recording is renamed to `NAME.recovered-1.mcap`, or the next free number.
pub(super) fn create(path: &Path) -> Result<File, RecordingError> {
    let part = part_path(path);
    let write = |error: io::Error| RecordingError::Write { path: part.clone(), reason: error.to_string() };
    match File::open(&part) {
        Ok(left) => {
            lock(&left, &part)?;
            let kept = recovered(path).map_err(write)?;
            std::fs::rename(&part, &kept).map_err(write)?;
            tracing::warn!("an earlier recording was not finished; what was written of it is now {}", kept.display());
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => {}
        Err(error) => return Err(write(error)),
    }
    let file = OpenOptions::new().write(true).create_new(true).open(&part).map_err(write)?;
    lock(&file, &part)?;
    Ok(file)
}

/// Locks the file. The lock ends with the process, even if it is killed.
fn lock(file: &File, part: &Path) -> Result<(), RecordingError> {
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => Err(RecordingError::Busy { path: part.to_owned() }),
        // Some network file systems don't support locks; recording without a lock is better than none.
        Ok(()) | Err(TryLockError::Error(_)) => Ok(()),
    }
}

/// Next free name for a recovered recording in the directory of `path`.
fn recovered(path: &Path) -> io::Result<PathBuf> {
    let stem = path.with_extension("");
    for number in 1..u32::MAX {
        let name = with_suffix(&stem, &format!(".recovered-{number}.mcap"));
        if !name.try_exists()? {
            return Ok(name);
        }
    }
    Err(io::ErrorKind::AlreadyExists.into())
}

fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(suffix);
    name.into()
}
