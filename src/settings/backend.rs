//! Rendering backend.

use std::fmt;
use std::str::FromStr;

use thiserror::Error;

use super::{settings, stored_word};

/// An unknown name of a backend.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error("`{found}` is no backend; they are {}", BackendChoice::NAMES.join(", "))]
pub struct UnknownBackend {
    /// Word found.
    pub found: String,
}

/// Choice of the rendering backend.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum BackendChoice {
    /// On a GPU if there is one, else on the host. Software Vulkan is no GPU.
    #[default]
    Auto,
    /// On the host's processors.
    Host,
    /// On a graphics device, software Vulkan included.
    Device,
}

crate::names::named!(BackendChoice { Auto = "auto", Host = "host", Device = "device" });
stored_word!(BackendChoice);

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
        /// Backend that renders frames: on a device (a GPU, else software Vulkan), on the host's processors, or auto: on a GPU if there is one, else on the host; INSONIFY_BACKEND and --backend override it.
        backend: BackendChoice = BackendChoice::Auto, "", 0.0..=2.0, Everything;
    }
}
