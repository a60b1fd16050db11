//! Option `--backend`.

use insonify::render::{Backend, BackendChoice};

use super::Failure;

/// Choice of the rendering backend.
#[derive(Debug, clap::Args)]
pub(crate) struct BackendArgs {
    /// Rendering backend: auto (a GPU, or without one the processors), host (the processors) or device (a GPU, or
    /// without one software Vulkan) [default: INSONIFY_BACKEND, else the station's]
    #[arg(long, value_name = "WHERE")]
    backend: Option<BackendChoice>,
}

impl BackendArgs {
    /// Opens the backend named by the option, else by the variable `INSONIFY_BACKEND`, else `of_station`.
    pub(crate) fn open(&self, of_station: BackendChoice) -> Result<Backend, Failure> {
        let choice = match self.backend {
            Some(choice) => choice,
            None => BackendChoice::from_environment()?.unwrap_or(of_station),
        };
        Ok(Backend::open(choice)?)
    }
}
