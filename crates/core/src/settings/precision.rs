//! Precision of a model's arithmetic.

use std::fmt;
use std::str::FromStr;

use serde::Serialize;

use super::stored_word;

/// Precision of a model's arithmetic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Precision {
    /// int8 on the processor, if the model has it and the processor has instructions for its dot products; float16 on
    /// a GPU; otherwise float32.
    #[default]
    Auto,
    /// The model as trained, in float32.
    Float32,
    /// 8-bit weights and values; an error if the model has none.
    Int8,
    /// The model as trained, computed by a GPU with 11-bit significands: float16 with TensorRT, TF32 with CUDA.
    Float16,
}

crate::names::named!(Precision { Auto = "auto", Float32 = "float32", Int8 = "int8", Float16 = "float16" });
stored_word!(Precision);

impl fmt::Display for Precision {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Precision {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::named(text)
            .ok_or_else(|| format!("unknown precision `{text}`; precisions are {}", Self::NAMES.join(", ")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_the_list() {
        for name in Precision::NAMES {
            assert_eq!(name.parse::<Precision>().unwrap().to_string(), *name);
        }
        let error = "int4".parse::<Precision>().unwrap_err();
        assert!(error.contains("int4") && error.contains("float32"), "{error}");
    }
}
