//! `--backend`.

use insonify::render::{Backend, BackendChoice};

use super::Failure;

/// Where frames are made.
#[derive(Debug, clap::Args)]
pub(crate) struct BackendArgs {
    /// Where frames are made: auto (on a GPU if there is one, else on the processors), host (on the processors) or device
    /// (on a GPU, else by software Vulkan) [default: INSONIFY_BACKEND, else the station's]
    #[arg(long, value_name = "WHERE")]
    backend: Option<BackendChoice>,
}

impl BackendArgs {
    /// Opens the backend: of the flag, else of `INSONIFY_BACKEND`, else `of_station`.
    pub(crate) fn open(&self, of_station: BackendChoice) -> Result<Backend, Failure> {
        let choice = match self.backend {
            Some(choice) => choice,
            None => BackendChoice::from_environment()?.unwrap_or(of_station),
        };
        Ok(Backend::open(choice)?)
    }
}
