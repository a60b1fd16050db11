//! Cache of the measured times of `trace`, by adapter, driver and version of insonify.

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use insonify_core::files::{self, FileKind};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use super::trace_times::TraceTimes;

/// Measured times, and the device and version that they hold for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Entry {
    /// Version of insonify.
    version: String,
    adapter: String,
    /// Driver with its version.
    driver: String,
    #[serde(flatten)]
    times: TraceTimes,
}

/// Reads the times of `adapter` and `driver` from the directory `cache`. A file that is missing, unreadable, or of
/// another device or version is replaced by the result of `measure`. `None` if `measure` fails.
pub(super) fn known_or_measured(
    cache: &Path,
    [adapter, driver]: [&str; 2],
    measure: impl FnOnce() -> Option<TraceTimes>,
) -> Option<TraceTimes> {
    let version = env!("CARGO_PKG_VERSION");
    let path = path(cache, [version, adapter, driver]);
    let kept = files::read(&path, FileKind::Stored).ok().and_then(|text| serde_json::from_slice::<Entry>(&text).ok());
    if let Some(kept) = kept.filter(|e| [&e.version[..], &e.adapter, &e.driver] == [version, adapter, driver]) {
        return Some(kept.times);
    }
    let times = measure()?;
    let entry = Entry { version: version.to_owned(), adapter: adapter.to_owned(), driver: driver.to_owned(), times };
    if let Err(error) = write(cache, &path, &entry) {
        tracing::debug!("{}: times of trace are not kept: {error}", path.display());
    }
    Some(times)
}

/// Path of the file for a version, an adapter and a driver.
fn path(cache: &Path, key: [&str; 3]) -> PathBuf {
    let sum = Sha256::digest(key.join("\0"));
    cache.join(format!("trace-{}.json", files::hex(&sum[..8])))
}

/// Replaces the file as a whole, so that other processes never read a part of it.
fn write(cache: &Path, path: &Path, entry: &Entry) -> io::Result<()> {
    std::fs::create_dir_all(cache)?;
    let mut file = tempfile::NamedTempFile::new_in(cache)?;
    file.write_all(&serde_json::to_vec(entry)?)?;
    file.persist(path)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIMES: TraceTimes = TraceTimes { few_ms: [0.66, 0.4], many_ms: [1.99, 1.5] };
    const DEVICE: [&str; 2] = ["NVIDIA H200", "NVIDIA 580.159 (Vulkan)"];

    fn never() -> Option<TraceTimes> {
        panic!("measured again")
    }

    #[test]
    fn times_are_measured_once_for_each_adapter_and_driver() {
        let folder = tempfile::tempdir().unwrap();
        let cache = folder.path().join("insonify");
        assert_eq!(known_or_measured(&cache, DEVICE, || Some(TIMES)), Some(TIMES));
        assert_eq!(known_or_measured(&cache, DEVICE, never), Some(TIMES));
        let slower = TraceTimes { few_ms: [1.0, 2.0], ..TIMES };
        for other in [["NVIDIA H200", "NVIDIA 590.1 (Vulkan)"], ["NVIDIA H100", DEVICE[1]]] {
            assert_eq!(known_or_measured(&cache, other, || Some(slower)), Some(slower));
            assert_eq!(known_or_measured(&cache, other, never), Some(slower));
        }
        assert_eq!(known_or_measured(&cache, DEVICE, never), Some(TIMES));
    }

    #[test]
    fn a_file_that_is_damaged_or_of_another_device_is_measured_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = path(folder.path(), [env!("CARGO_PKG_VERSION"), DEVICE[0], DEVICE[1]]);
        let strange = Entry { version: "0".into(), adapter: "a".into(), driver: "d".into(), times: TIMES };
        for damage in
            [b"".to_vec(), b"{\"few_ms\": [1]}".to_vec(), vec![0xff; 40], serde_json::to_vec(&strange).unwrap()]
        {
            std::fs::write(&path, damage).unwrap();
            let other = TraceTimes { many_ms: [3.0, 4.0], ..TIMES };
            assert_eq!(known_or_measured(folder.path(), DEVICE, || Some(other)), Some(other));
            assert_eq!(known_or_measured(folder.path(), DEVICE, never), Some(other));
        }
    }

    #[test]
    fn a_cache_that_cannot_be_written_is_no_error() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, b"").unwrap();
        assert_eq!(known_or_measured(&file, DEVICE, || Some(TIMES)), Some(TIMES));
        // A failed measurement is not stored.
        assert_eq!(known_or_measured(folder.path(), DEVICE, || None), None);
        assert_eq!(known_or_measured(folder.path(), DEVICE, || Some(TIMES)), Some(TIMES));
    }
}
