//! The program's cache directory.

use std::path::PathBuf;

use etcetera::BaseStrategy;

/// Directory for generated scenes and measured times: `$INSONIFY_CACHE`, else `insonify/` in the user's cache
/// directory. Without a home directory, it is in the temporary folder and a warning says so.
pub fn cache_directory() -> PathBuf {
    if let Some(directory) = std::env::var_os("INSONIFY_CACHE").filter(|v| !v.is_empty()) {
        return directory.into();
    }
    match etcetera::choose_base_strategy() {
        Ok(strategy) => strategy.cache_dir().join("insonify"),
        Err(_) => {
            tracing::warn!(
                "there is no home directory: generated scenes are kept in the temporary folder; INSONIFY_CACHE names another"
            );
            std::env::temp_dir().join("insonify")
        }
    }
}
