//! Device that each execution provider uses.

use std::path::Path;

use super::Provider;
use crate::render::{ComputeDevice, NVIDIA, PciAddress};

/// Folder in which NVIDIA's driver for Linux lists its GPUs, one entry each, by their addresses.
const NVIDIA_GPUS: &str = "/proc/driver/nvidia/gpus";

/// Device that runs models with `provider`. CUDA takes the first GPU; the GPU's address is known only on machines with
/// a single GPU.
pub(crate) fn compute_device_of(provider: Provider) -> ComputeDevice {
    match provider {
        Provider::Cpu => ComputeDevice::Processors,
        Provider::Cuda | Provider::TensorRt => {
            ComputeDevice::Gpu { vendor: Some(NVIDIA), address: only_gpu(Path::new(NVIDIA_GPUS)) }
        }
    }
}

/// Address of the only GPU listed in `folder`; `None` if there are none or several.
fn only_gpu(folder: &Path) -> Option<PciAddress> {
    let mut entries = std::fs::read_dir(folder).ok()?.flatten();
    let only = entries.next()?;
    if entries.next().is_some() {
        return None;
    }
    PciAddress::parse(&only.file_name().to_string_lossy())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_address_of_a_single_gpu_is_known() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(only_gpu(&folder.path().join("missing")), None);
        assert_eq!(only_gpu(folder.path()), None);
        std::fs::create_dir(folder.path().join("0000:1a:00.0")).unwrap();
        assert_eq!(only_gpu(folder.path()), PciAddress::parse("0000:1a:00.0"));
        std::fs::create_dir(folder.path().join("0000:1b:00.0")).unwrap();
        assert_eq!(only_gpu(folder.path()), None);
    }

    #[test]
    fn models_on_the_processors_share_them_with_frames_made_there() {
        let of_amd = ComputeDevice::Gpu { vendor: Some(0x1002), address: None };
        for (provider, [processors, gpu, amd]) in [
            (Provider::Cpu, [true, false, false]),
            (Provider::Cuda, [false, true, false]),
            (Provider::TensorRt, [false, true, false]),
        ] {
            let device = compute_device_of(provider);
            assert_eq!(device.shares_with(ComputeDevice::Processors), processors, "{provider}");
            assert_eq!(device.shares_with(ComputeDevice::UNKNOWN_GPU), gpu, "{provider}");
            assert_eq!(device.shares_with(of_amd), amd, "{provider}");
        }
    }
}
