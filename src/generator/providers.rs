//! Options of ONNX Runtime's execution providers. CUDA and TensorRT are untested, for lack of hardware.

use std::path::{Path, PathBuf};

use ort::ep::{self, ArenaExtendStrategy, ExecutionProviderDispatch};

use super::{Precision, Provider};
use crate::files::cache_directory;

/// Name of TensorRT's folder in the cache directory.
const TENSORRT: &str = "tensorrt";
/// Number of digits of a model's SHA-256 that name its folder of compiled models.
const DIGITS: usize = 16;

/// Execution providers to request from ONNX Runtime for the model with the hash `sha256`; empty for the CPU.
pub(super) fn dispatch(provider: Provider, precision: Precision, sha256: &str) -> Vec<ExecutionProviderDispatch> {
    dispatch_with(provider, precision, || Cache::open(&cache_directory().join(TENSORRT), sha256))
}

/// Does [`dispatch`] with the cache that `open` returns. Only TensorRT needs `open`.
fn dispatch_with(
    provider: Provider,
    precision: Precision,
    open: impl FnOnce() -> Option<Cache>,
) -> Vec<ExecutionProviderDispatch> {
    let cuda = || cuda(precision).build().error_on_failure();
    match provider {
        Provider::Cpu => Vec::new(),
        Provider::Cuda => vec![cuda()],
        Provider::TensorRt => vec![tensorrt(precision, open().as_ref()).build().error_on_failure(), cuda()],
    }
}

/// Options of CUDA. Its memory grows by the requested amount instead of doubling, because the renderer needs memory as
/// well.
fn cuda(precision: Precision) -> ep::CUDA {
    ep::CUDA::default()
        .with_device_id(0)
        .with_arena_extend_strategy(ArenaExtendStrategy::SameAsRequested)
        .with_tf32(precision == Precision::Float16)
}

/// Options of TensorRT. Without a cache it compiles the model at each start, which takes minutes.
fn tensorrt(precision: Precision, cache: Option<&Cache>) -> ep::TensorRT {
    let options = ep::TensorRT::default().with_device_id(0).with_fp16(precision == Precision::Float16);
    match cache {
        None => options,
        Some(Cache { engines, timings }) => options
            .with_engine_cache(true)
            .with_engine_cache_path(engines.display())
            .with_timing_cache(true)
            .with_timing_cache_path(timings.display()),
    }
}

/// Folders in which TensorRT keeps files between starts.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Cache {
    /// Folder of one model's compiled files. ONNX Runtime names them by the graph's nodes, not by its weights, so
    /// models can't share a folder.
    engines: PathBuf,
    /// Folder of measured kernel times on this GPU, for all models.
    timings: PathBuf,
}

impl Cache {
    /// Opens the cache below `folder` and creates its folders. If that fails, logs a warning and returns `None`.
    fn open(folder: &Path, sha256: &str) -> Option<Self> {
        let cache = Self { engines: folder.join(sha256.get(..DIGITS).unwrap_or(sha256)), timings: folder.to_owned() };
        match std::fs::create_dir_all(&cache.engines) {
            Ok(()) => Some(cache),
            Err(error) => {
                let engines = cache.engines.display();
                tracing::warn!("TensorRT compiles its models at each start: {engines} can't be made: {error}");
                None
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether `options` contains `key` with `value`, as text.
    fn has(options: &str, key: &str, value: &str) -> bool {
        options.contains(&format!("{key:?}: {value:?}"))
    }

    #[test]
    fn tensorrt_keeps_its_engines_and_computes_in_float16_unless_float32_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let sum = "0123456789abcdef".repeat(4);
        let cache = Cache::open(folder.path(), &sum).unwrap();
        let engines = folder.path().join("0123456789abcdef");
        assert!(engines.is_dir());
        assert_eq!(cache, Cache { engines: engines.clone(), timings: folder.path().to_owned() });
        let options = format!("{:?}", tensorrt(Precision::Float16, Some(&cache)));
        for (key, value) in [
            ("device_id", "0"),
            ("trt_fp16_enable", "true"),
            ("trt_engine_cache_enable", "true"),
            ("trt_engine_cache_path", engines.to_str().unwrap()),
            ("trt_timing_cache_enable", "true"),
            ("trt_timing_cache_path", folder.path().to_str().unwrap()),
        ] {
            assert!(has(&options, key, value), "{key} = {value}: {options}");
        }
        let options = format!("{:?}", tensorrt(Precision::Float32, None));
        assert!(has(&options, "trt_fp16_enable", "false") && !options.contains("cache"), "{options}");
    }

    #[test]
    fn models_of_equal_graphs_do_not_share_engines() {
        let folder = tempfile::tempdir().unwrap();
        let [a, b] = ["a", "b"].map(|digit| Cache::open(folder.path(), &digit.repeat(64)).unwrap());
        assert!(a.engines != b.engines && a.timings == b.timings);
    }

    #[test]
    fn a_cache_that_cannot_be_made_is_left_out() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, "").unwrap();
        assert_eq!(Cache::open(&file.join("tensorrt"), &"0".repeat(64)), None);
    }

    #[test]
    fn cuda_rounds_products_only_where_float16_may_run_and_takes_no_more_memory_than_it_needs() {
        for (precision, tf32) in
            [(Precision::Float16, "true"), (Precision::Float32, "false"), (Precision::Int8, "false")]
        {
            let options = format!("{:?}", cuda(precision));
            assert!(has(&options, "use_tf32", tf32), "{options}");
            assert!(has(&options, "arena_extend_strategy", "kSameAsRequested"), "{options}");
        }
    }

    #[test]
    fn a_gpu_is_asked_for_by_its_provider_and_tensorrt_leaves_the_rest_to_cuda() {
        let names = |provider| -> Vec<_> {
            dispatch_with(provider, Precision::Float32, || None).iter().map(ExecutionProviderDispatch::name).collect()
        };
        assert!(names(Provider::Cpu).is_empty());
        assert_eq!(names(Provider::Cuda), ["CUDAExecutionProvider"]);
        assert_eq!(names(Provider::TensorRt), ["TensorrtExecutionProvider", "CUDAExecutionProvider"]);
    }
}
