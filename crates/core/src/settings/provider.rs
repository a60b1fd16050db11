//! Execution provider of a model.

use std::fmt;
use std::str::FromStr;

use serde::Serialize;

use super::stored_word;

/// Execution provider of a model. An unavailable one is an error: there is no silent fallback to the CPU.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Provider {
    /// The processor.
    #[default]
    Cpu,
    /// An NVIDIA GPU with CUDA; needs ONNX Runtime's GPU library.
    Cuda,
    /// An NVIDIA GPU with TensorRT, and CUDA for unsupported parts; needs ONNX Runtime's GPU library and TensorRT 10.
    TensorRt,
}

crate::names::named!(Provider { Cpu = "cpu", Cuda = "cuda", TensorRt = "tensorrt" });
stored_word!(Provider);

impl Provider {
    /// Whether a run can be stopped midway. ONNX Runtime can stop between the nodes of a model; TensorRT turns the
    /// whole model into one node.
    pub fn can_stop(self) -> bool {
        self != Self::TensorRt
    }
}

impl fmt::Display for Provider {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Provider {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::named(text).ok_or_else(|| format!("unknown provider `{text}`; providers are {}", Self::NAMES.join(", ")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_the_list() {
        for name in Provider::NAMES {
            assert_eq!(name.parse::<Provider>().unwrap().to_string(), *name);
        }
        let error = "opencl".parse::<Provider>().unwrap_err();
        assert!(error.contains("opencl") && error.contains("tensorrt"), "{error}");
    }
}
