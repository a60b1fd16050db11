//! `insonify cache`: the folder of generated scenes.

use std::path::PathBuf;

use anyhow::Context;
use etcetera::BaseStrategy;

use super::{Classify, Failure};

/// `$INSONIFY_CACHE`, else `insonify/` in the user's cache directory.
pub(crate) fn directory() -> Result<PathBuf, Failure> {
    match std::env::var_os("INSONIFY_CACHE").filter(|v| !v.is_empty()) {
        Some(directory) => Ok(directory.into()),
        None => etcetera::choose_base_strategy()
            .map(|strategy| strategy.cache_dir().join("insonify"))
            .context("there is no home directory to keep generated scenes in; set INSONIFY_CACHE to a directory")
            .input(),
    }
}
