//! Choice of a model's precision on this machine.

use std::path::{Path, PathBuf};

use super::load_options::LoadOptions;
use super::manifest::{Manifest, ParityManifest};
use super::{GeneratorError, Precision, Provider};

/// A model's file in one precision, and what it must give.
#[derive(Debug)]
pub(super) struct Stored {
    pub(super) precision: Precision,
    pub(super) path: PathBuf,
    pub(super) sha256: String,
    pub(super) parity: ParityManifest,
}

impl Stored {
    /// The model at `path` in the precision of the options: [`Precision::Auto`] takes int8 where it is quicker.
    ///
    /// # Errors
    /// A precision that the model does not have.
    pub(super) fn choose(path: &Path, manifest: &Manifest, options: &LoadOptions) -> Result<Self, GeneratorError> {
        let wanted = match options.precision {
            Precision::Auto if options.provider == Provider::Cpu && multiplies_bytes() => Precision::Int8,
            Precision::Auto => Precision::Float32,
            named => named,
        };
        match manifest.quantised(wanted) {
            Some(other) => Ok(Self {
                precision: wanted,
                path: path.with_file_name(&other.model),
                sha256: other.sha256.clone(),
                parity: ParityManifest {
                    output: other.output.clone(),
                    tolerance: other.tolerance,
                    ..manifest.parity.clone()
                },
            }),
            None if options.precision == Precision::Int8 => {
                Err(GeneratorError::NoPrecision { path: path.to_owned(), precision: options.precision })
            }
            None => Ok(Self::as_trained(path, manifest)),
        }
    }

    /// The model in float32.
    pub(super) fn as_trained(path: &Path, manifest: &Manifest) -> Self {
        Self {
            precision: Precision::Float32,
            path: path.to_owned(),
            sha256: manifest.sha256.clone(),
            parity: manifest.parity.clone(),
        }
    }
}

/// Whether the processor sums products of bytes in one instruction. Without it, int8 is no quicker than float32, and sums of
/// two products may overflow 16 bits.
fn multiplies_bytes() -> bool {
    #[cfg(target_arch = "x86_64")]
    {
        is_x86_feature_detected!("avx512vnni") || is_x86_feature_detected!("avxvnni")
    }
    #[cfg(target_arch = "aarch64")]
    {
        std::arch::is_aarch64_feature_detected!("dotprod")
    }
    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    {
        false
    }
}
