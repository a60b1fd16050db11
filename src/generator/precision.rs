//! Choice of a model's precision on this machine.

use std::path::{Path, PathBuf};

use super::load_options::LoadOptions;
use super::manifest::{Manifest, ParityManifest};
use super::{GeneratorError, Precision, Provider};

/// Lower limit of the parity check's tolerance in float16, grey levels. The 11-bit significand rounds by up to half a
/// level in each layer.
const FLOAT16_TOLERANCE: f32 = 1.0;

/// A model's file in one precision, with its expected parity output and tolerance.
#[derive(Debug)]
pub(super) struct Stored {
    pub(super) precision: Precision,
    pub(super) path: PathBuf,
    pub(super) sha256: String,
    pub(super) parity: ParityManifest,
}

impl Stored {
    /// File for the precision in `options`. [`Precision::Auto`] takes int8 where it is faster than float32, float16 on
    /// a GPU, and float32 otherwise.
    ///
    /// # Errors
    /// The model or the provider does not have the precision.
    pub(super) fn choose(path: &Path, manifest: &Manifest, options: &LoadOptions) -> Result<Self, GeneratorError> {
        let wanted = match options.precision {
            Precision::Auto if options.provider == Provider::Cpu && multiplies_bytes() => Precision::Int8,
            Precision::Auto if options.provider != Provider::Cpu => Precision::Float16,
            Precision::Auto => Precision::Float32,
            Precision::Float16 if options.provider == Provider::Cpu => {
                return Err(GeneratorError::NoFloat16 { path: path.to_owned() });
            }
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
            None => Ok(Self::as_trained(path, manifest).in_precision(wanted)),
        }
    }

    /// Returns the same file, to be computed in `precision`.
    fn in_precision(mut self, precision: Precision) -> Self {
        if precision == Precision::Float16 {
            self.precision = precision;
            self.parity.tolerance = self.parity.tolerance.max(FLOAT16_TOLERANCE);
        }
        self
    }

    /// The model's file in float32, as it was trained.
    pub(super) fn as_trained(path: &Path, manifest: &Manifest) -> Self {
        Self {
            precision: Precision::Float32,
            path: path.to_owned(),
            sha256: manifest.sha256.clone(),
            parity: manifest.parity.clone(),
        }
    }
}

/// Whether the processor sums products of bytes in one instruction. Without it, int8 is no faster than float32, and
/// sums of two products may overflow 16 bits.
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

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = include_str!("../../tests/data/generators/weighted_maps.toml");

    #[test]
    fn a_gpu_computes_in_float16_unless_another_precision_is_named() {
        let manifest = Manifest::parse(TEXT).unwrap();
        let path = Path::new("weighted_maps.onnx");
        let chosen = |provider, precision| {
            let options = LoadOptions { provider, precision, ..LoadOptions::default() };
            Stored::choose(path, &manifest, &options)
        };
        let own = manifest.parity.tolerance;
        assert!(own < FLOAT16_TOLERANCE);
        for (provider, precision, expected, tolerance) in [
            (Provider::Cpu, Precision::Auto, Precision::Float32, own),
            (Provider::Cpu, Precision::Float32, Precision::Float32, own),
            (Provider::Cuda, Precision::Auto, Precision::Float16, FLOAT16_TOLERANCE),
            (Provider::TensorRt, Precision::Auto, Precision::Float16, FLOAT16_TOLERANCE),
            (Provider::TensorRt, Precision::Float16, Precision::Float16, FLOAT16_TOLERANCE),
            (Provider::TensorRt, Precision::Float32, Precision::Float32, own),
        ] {
            let stored = chosen(provider, precision).unwrap();
            assert_eq!((stored.precision, stored.parity.tolerance), (expected, tolerance), "{provider} {precision}");
            assert_eq!((&*stored.path, &stored.sha256), (path, &manifest.sha256), "the file is the same");
        }
        let error = chosen(Provider::Cpu, Precision::Float16).unwrap_err().to_string();
        assert!(error.contains("weighted_maps.onnx") && error.contains("cuda"), "{error}");
    }
}
