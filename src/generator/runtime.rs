//! ONNX Runtime's library, loaded on first use.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock, PoisonError};

use ort::environment::Environment;
use ort::logging::LogLevel;

use super::RuntimeError;
use super::error::ONNX_RUNTIME_MINOR;

/// Environment variable with the path of the library. If it is set, no folder is searched.
const VARIABLE: &str = "ORT_DYLIB_PATH";
/// Folder in which `scripts/setup` installs the library, below the repository's root.
const FOLDER: &str = "third_party/onnxruntime";

const _: () = assert!(ort::MINOR_VERSION == ONNX_RUNTIME_MINOR, "messages name another version");

/// The loaded ONNX Runtime, one per process.
#[derive(Debug)]
pub struct Runtime {
    environment: Environment,
    library: PathBuf,
}

impl Runtime {
    /// Returns the runtime. The first call loads it; after an error, the next call tries again.
    ///
    /// If the environment variable `ORT_DYLIB_PATH` is set, it names the library's file. Otherwise the library is
    /// searched in `third_party/onnxruntime` of all folders above the program and of insonify's sources, then in the
    /// program's folder.
    ///
    /// # Errors
    /// The library is not found or can't be used. The message names the remedy.
    pub fn get() -> Result<&'static Self, RuntimeError> {
        static RUNTIME: OnceLock<Runtime> = OnceLock::new();
        static LOADING: Mutex<()> = Mutex::new(());
        if let Some(runtime) = RUNTIME.get() {
            return Ok(runtime);
        }
        let _one_at_a_time = LOADING.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(runtime) = RUNTIME.get() {
            return Ok(runtime);
        }
        let runtime = Self::load(find()?)?;
        Ok(RUNTIME.get_or_init(|| runtime))
    }

    fn load(library: PathBuf) -> Result<Self, RuntimeError> {
        let unusable = |reason: String| RuntimeError::Unusable { path: library.clone(), reason };
        let builder = ort::init_from(&library).map_err(|e| unusable(e.to_string()))?;
        let environment = builder.with_telemetry(false).build().map_err(|e| unusable(e.to_string()))?;
        // The library's default log level formats every event, although most are then dropped.
        environment.set_log_level(LogLevel::Warning);
        tracing::debug!("ONNX Runtime is {}", library.display());
        Ok(Self { environment, library })
    }

    /// Path of the loaded library.
    pub fn library(&self) -> &Path {
        &self.library
    }

    pub(super) fn environment(&self) -> &Environment {
        &self.environment
    }
}

fn find() -> Result<PathBuf, RuntimeError> {
    if let Some(path) = std::env::var_os(VARIABLE).filter(|v| !v.is_empty()) {
        // An absolute path, because the loader would search the system's folders for a bare file name.
        let path = PathBuf::from(path);
        let file = std::path::absolute(&path).unwrap_or_else(|_| path.clone());
        return if file.is_file() { Ok(file) } else { Err(RuntimeError::NoSuchFile { path }) };
    }
    let folders = folders();
    folders.iter().find_map(|folder| library_in(folder)).ok_or_else(|| RuntimeError::Missing {
        searched: folders.iter().map(|f| f.display().to_string()).collect::<Vec<_>>().join(", "),
    })
}

/// Folders in which the library is searched. The working directory is excluded, because others may be able to put
/// code there.
fn folders() -> Vec<PathBuf> {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join(FOLDER);
    let Ok(program) = std::env::current_exe() else { return vec![sources] };
    let above = program.ancestors().skip(1);
    let mut folders: Vec<_> = above.map(|folder| folder.join(FOLDER)).filter(|folder| folder.is_dir()).collect();
    if !folders.contains(&sources) {
        folders.push(sources);
    }
    folders.extend(program.parent().map(Path::to_owned));
    folders
}

/// Path of the newest library in a folder, for example `libonnxruntime.so.1.31.1`, `libonnxruntime.1.31.1.dylib` or
/// `onnxruntime.dll`.
fn library_in(folder: &Path) -> Option<PathBuf> {
    let entries = std::fs::read_dir(folder).ok()?.flatten();
    let mut found: Vec<_> = entries.map(|e| e.path()).filter(|path| is_library(path) && path.is_file()).collect();
    found.sort();
    found.pop()
}

fn is_library(path: &Path) -> bool {
    let Some(name) = path.file_name().and_then(|n| n.to_str()) else { return false };
    let suffix = std::env::consts::DLL_SUFFIX;
    let stem = format!("{}onnxruntime", std::env::consts::DLL_PREFIX);
    // Excludes the libraries of execution providers, whose names begin alike.
    name.strip_prefix(&stem).is_some_and(|rest| rest.starts_with('.') && rest.contains(suffix))
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn the_library_is_told_from_its_providers() {
        let dir = tempfile::tempdir().unwrap();
        let file = |name: &str| std::fs::write(dir.path().join(name), "").unwrap();
        assert_eq!(library_in(dir.path()), None);
        ["libonnxruntime_providers_shared.so", "wheel.sha256", "libonnxruntime.so.1.9.0"].into_iter().for_each(file);
        assert_eq!(library_in(dir.path()).unwrap().file_name().unwrap(), "libonnxruntime.so.1.9.0");
        assert_eq!(library_in(&dir.path().join("none")), None);
    }
}
