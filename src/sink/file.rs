//! Files that are written completely or not at all.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use serde::Serialize;
use tempfile::NamedTempFile;

use super::SinkError;

/// Makes a directory and its parents.
///
/// # Errors
/// The directory cannot be made; the error names it.
pub fn create_dir(path: &Path) -> Result<(), SinkError> {
    std::fs::create_dir_all(path).map_err(SinkError::io(path))
}

/// Removes a file, if it is there.
///
/// # Errors
/// It is there and cannot be removed.
pub fn remove(path: &Path) -> Result<(), SinkError> {
    match std::fs::remove_file(path) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(()),
        removed => removed.map_err(SinkError::io(path)),
    }
}

/// Creates an empty file at `path` for incremental writing, and its directory if missing.
pub(crate) fn create(path: &Path) -> Result<File, SinkError> {
    create_dir(directory_of(path))?;
    File::create(path).map_err(SinkError::io(path))
}

fn directory_of(path: &Path) -> &Path {
    path.parent().filter(|d| !d.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Creates a temporary file in the directory of `path`, for [`commit`] once it is written.
pub(crate) fn begin(path: &Path) -> Result<NamedTempFile, SinkError> {
    let directory = directory_of(path);
    create_dir(directory)?;
    let suffix = path.extension().map(|e| format!(".part.{}", e.to_string_lossy())).unwrap_or_else(|| ".part".into());
    let mut builder = tempfile::Builder::new();
    builder.prefix(".insonify-").suffix(&suffix);
    // A temporary file is private by default, but the final file must follow the umask.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(directory).map_err(SinkError::io(path))
}

/// Renames a finished file to `path`, replacing an existing file.
pub(crate) fn commit(file: NamedTempFile, path: &Path) -> Result<(), SinkError> {
    file.persist(path).map(drop).map_err(|e| SinkError::io(path)(e.error))
}

/// Writes a file through `write`, and renames it to `path` once complete. Makes the directory if it is missing.
///
/// # Errors
/// The error of `write`, or an I/O error that names `path`. An earlier file at `path` then stays unchanged.
pub(crate) fn write_with(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), SinkError>,
) -> Result<(), SinkError> {
    let mut file = begin(path)?;
    let mut writer = BufWriter::with_capacity(1 << 18, file.as_file_mut());
    write(&mut writer)?;
    writer.flush().map_err(SinkError::io(path))?;
    drop(writer);
    commit(file, path)
}

/// Writes `text` as it is.
///
/// # Errors
/// An I/O error.
pub fn write_text(path: &Path, text: &str) -> Result<(), SinkError> {
    write_bytes(path, text.as_bytes())
}

/// Writes `bytes` as they are.
///
/// # Errors
/// An I/O error.
pub(crate) fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), SinkError> {
    write_with(path, |w| w.write_all(bytes).map_err(SinkError::io(path)))
}

/// Writes `value` as indented JSON with a line break at the end.
///
/// # Errors
/// An I/O error, or a value that JSON cannot hold.
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<(), SinkError> {
    write_with(path, |w| {
        serde_json::to_writer_pretty(&mut *w, value)
            .map_err(|source| SinkError::Json { path: path.to_owned(), source })?;
        w.write_all(b"\n").map_err(SinkError::io(path))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_nothing_and_keeps_what_was_there() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("deep/er/value.json");
        write_json(&path, &[1, 2]).unwrap();
        let failed = write_with(&path, |w| {
            w.write_all(b"half").map_err(SinkError::io(&path))?;
            Err(SinkError::FrameRate { fps: 0.0 })
        });
        assert!(failed.is_err());
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "[\n  1,\n  2\n]\n");
        assert_eq!(std::fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);
    }

    #[test]
    fn an_error_names_the_path() {
        let dir = tempfile::tempdir().unwrap();
        let blocker = dir.path().join("file");
        write_json(&blocker, &0).unwrap();
        let error = write_json(&blocker.join("x.json"), &0).unwrap_err().to_string();
        assert!(error.contains(&*blocker.to_string_lossy()), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn files_are_readable_as_the_umask_allows() {
        use std::os::unix::fs::PermissionsExt;
        let dir = tempfile::tempdir().unwrap();
        let (ours, plain) = (dir.path().join("ours"), dir.path().join("plain"));
        write_json(&ours, &0).unwrap();
        std::fs::write(&plain, "0").unwrap();
        let mode = |p| std::fs::metadata(p).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&plain));
    }
}
