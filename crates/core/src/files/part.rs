//! Partial files: outputs that are not yet finished.

use std::fs::{File, OpenOptions, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use thiserror::Error;

use super::FileError;

/// Tries to lock a file, and the time between them.
const LOCK_TRIES: usize = 5;
const LOCK_WAIT: Duration = Duration::from_millis(20);

/// Errors in partial files.
#[derive(Debug, Error)]
pub enum PartError {
    /// Another process writes the file.
    #[error("{path} is being written by another process")]
    Busy {
        /// Partial file.
        path: PathBuf,
    },
    /// The operating system refused.
    #[error(transparent)]
    File(#[from] FileError),
}

/// Names of an output file while it is written and after it is finished.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PartFile {
    /// Name of the finished file.
    pub path: PathBuf,
    /// Name while the file is written, in the same directory.
    pub part: PathBuf,
}

impl PartFile {
    /// Partial file with the name `NAME.part`.
    pub fn appended(path: &Path) -> Self {
        let mut part = path.as_os_str().to_owned();
        part.push(".part");
        Self { path: path.to_owned(), part: part.into() }
    }

    /// Partial file with the name `NAME.part.EXTENSION`, which programs open like the finished file.
    pub fn playable(path: &Path) -> Self {
        Self { path: path.to_owned(), part: with_word(path, "part") }
    }

    /// Creates the partial file, locked while it is open. It replaces a partial file that an interrupted process left.
    ///
    /// # Errors
    /// Another process writes the file, or it cannot be created.
    pub fn create(&self) -> Result<File, PartError> {
        self.take_over(|left, part| {
            drop(left);
            std::fs::remove_file(part)
        })
    }

    /// Creates the partial file like [`create`](Self::create), but renames an existing partial file that is not empty
    /// to `STEM.recovered-1.EXTENSION`, or to the next free number.
    ///
    /// # Errors
    /// Another process writes the file, or a file cannot be created or renamed.
    pub fn create_keeping(&self) -> Result<File, PartError> {
        self.take_over(|left, part| {
            if left.metadata()?.len() == 0 {
                return std::fs::remove_file(part);
            }
            let kept = self.recovered()?;
            std::fs::rename(part, &kept)?;
            tracing::warn!("{} was not finished; what was written is now {}", self.path.display(), kept.display());
            Ok(())
        })
    }

    fn take_over(&self, left_over: impl FnOnce(File, &Path) -> io::Result<()>) -> Result<File, PartError> {
        let failed = FileError::at("write", &self.part);
        match File::open(&self.part) {
            Ok(left) => {
                self.lock(&left)?;
                left_over(left, &self.part).map_err(failed)?;
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            Err(error) => return Err(failed(error).into()),
        }
        let file = OpenOptions::new().write(true).create_new(true).open(&self.part).map_err(failed)?;
        self.lock(&file)?;
        Ok(file)
    }

    /// Locks `file` against other processes. The lock ends with this process, even if it is killed.
    fn lock(&self, file: &File) -> Result<(), PartError> {
        // A process that this one is starting holds a copy of its files, and so their locks, for some milliseconds.
        for _ in 0..LOCK_TRIES {
            match file.try_lock() {
                Err(TryLockError::WouldBlock) => std::thread::sleep(LOCK_WAIT),
                // Some network file systems don't support locks; writing without a lock is better than not at all.
                Ok(()) | Err(TryLockError::Error(_)) => return Ok(()),
            }
        }
        Err(PartError::Busy { path: self.part.clone() })
    }

    /// Next free name for the content of an unfinished file.
    fn recovered(&self) -> io::Result<PathBuf> {
        for number in 1..u32::MAX {
            let name = with_word(&self.path, &format!("recovered-{number}"));
            if !name.try_exists()? {
                return Ok(name);
            }
        }
        Err(io::ErrorKind::AlreadyExists.into())
    }
}

/// `path` with its file name changed to `STEM.WORD.EXTENSION`.
fn with_word(path: &Path, word: &str) -> PathBuf {
    match path.extension() {
        Some(extension) => path.with_extension(format!("{word}.{}", extension.to_string_lossy())),
        None => path.with_extension(word),
    }
}
