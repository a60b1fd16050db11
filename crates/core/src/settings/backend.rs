//! Choice of the rendering backend.

use std::fmt;
use std::str::FromStr;

use thiserror::Error;

use super::{settings, stored_word};
use crate::names::word_in_environment;

/// An unknown name of a backend.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error("`{found}` is no backend; they are {}", BackendChoice::NAMES.join(", "))]
pub struct UnknownBackend {
    /// Word found.
    pub found: String,
}

/// Environment variable that names a backend.
const VARIABLE: &str = "INSONIFY_BACKEND";

/// An unknown name of a backend in the environment variable.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error("INSONIFY_BACKEND: {0}")]
pub struct UnknownBackendVariable(UnknownBackend);

/// Choice of the rendering backend.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum BackendChoice {
    /// On a GPU if there is one, else on the host's processors. Software Vulkan is no GPU.
    #[default]
    Auto,
    /// On the host's processors.
    Host,
    /// On a graphics device, software Vulkan included.
    Device,
}

crate::names::named!(BackendChoice { Auto = "auto", Host = "host", Device = "device" });
stored_word!(BackendChoice);

impl BackendChoice {
    /// The choice in the environment variable `INSONIFY_BACKEND`; `None` if it is unset or empty.
    ///
    /// # Errors
    /// A word that names no backend.
    pub fn from_environment() -> Result<Option<Self>, UnknownBackendVariable> {
        word_in_environment(VARIABLE).map(|word| word.parse().map_err(UnknownBackendVariable)).transpose()
    }
}

impl FromStr for BackendChoice {
    type Err = UnknownBackend;

    fn from_str(text: &str) -> Result<Self, UnknownBackend> {
        Self::named(text).ok_or_else(|| UnknownBackend { found: text.to_owned() })
    }
}

impl fmt::Display for BackendChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

settings! {
    /// The `[render]` of a station.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub struct BackendSettings in "render" {
        /// GPU or software Vulkan (device), CPU (host), GPU else CPU (auto); INSONIFY_BACKEND, --backend override it.
        backend: BackendChoice = BackendChoice::Auto, "", BackendChoice::RANGE, Everything;
    }
}
