//! Vector instructions of the processor, and the widest that vectorised loops may use.

use std::str::FromStr;
use std::sync::atomic::{AtomicU8, Ordering};

use thiserror::Error;

use crate::names::word_in_environment;

/// Environment variable that sets the widest instructions.
const VARIABLE: &str = "INSONIFY_SIMD";

/// Sets of vector instructions, from narrow to wide. All give the same bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Instructions {
    /// Instructions that every processor of the architecture has.
    Portable = 1,
    /// AVX2.
    Avx2,
    /// AVX-512 with the parts F, BW, DQ and VL.
    Avx512,
}

crate::names::named!(Instructions { Portable = "portable", Avx2 = "avx2", Avx512 = "avx512" });

/// Widest instructions in use, as a number of [`Instructions`]; 0 before the first question.
static WIDEST: AtomicU8 = AtomicU8::new(0);

/// Error: a value of `INSONIFY_SIMD` that this processor can't follow.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
pub enum WrongInstructions {
    /// A word that names no instructions.
    #[error("INSONIFY_SIMD: `{found}` names no instructions; they are {}", Instructions::NAMES.join(", "))]
    Unknown {
        /// The value that was found.
        found: String,
    },
    /// Instructions that the processor lacks.
    #[error("INSONIFY_SIMD: this processor has no {}; its widest are {}", .wanted.name(), .widest.name())]
    Missing {
        /// The instructions that were asked for.
        wanted: Instructions,
        /// The widest instructions of the processor.
        widest: Instructions,
    },
}

impl FromStr for Instructions {
    type Err = WrongInstructions;

    fn from_str(text: &str) -> Result<Self, WrongInstructions> {
        Self::named(text).ok_or_else(|| WrongInstructions::Unknown { found: text.to_owned() })
    }
}

impl Instructions {
    /// The widest instructions that the processor has.
    pub fn of_processor() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512bw")
                && is_x86_feature_detected!("avx512dq")
                && is_x86_feature_detected!("avx512vl")
            {
                return Self::Avx512;
            }
            if is_x86_feature_detected!("avx2") {
                return Self::Avx2;
            }
        }
        Self::Portable
    }

    /// The widest instructions that vectorised loops use. The processor has them.
    #[inline]
    pub fn widest() -> Self {
        match WIDEST.load(Ordering::Relaxed) {
            1 => Self::Portable,
            2 => Self::Avx2,
            3 => Self::Avx512,
            _ => {
                let widest = Self::of_processor();
                WIDEST.store(widest as u8, Ordering::Relaxed);
                widest
            }
        }
    }

    /// Lets the whole process use no wider instructions than these.
    ///
    /// # Errors
    /// The processor lacks them.
    pub fn limit(self) -> Result<(), WrongInstructions> {
        let widest = Self::of_processor();
        if self > widest {
            return Err(WrongInstructions::Missing { wanted: self, widest });
        }
        WIDEST.store(self as u8, Ordering::Relaxed);
        Ok(())
    }

    /// Limits the whole process as the environment variable `INSONIFY_SIMD` says. If it is unset or empty, nothing
    /// changes.
    ///
    /// # Errors
    /// A word that names no instructions; instructions that the processor lacks.
    pub fn limit_by_environment() -> Result<(), WrongInstructions> {
        word_in_environment(VARIABLE).map_or(Ok(()), |word| word.parse::<Self>()?.limit())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instructions_are_limited_to_those_of_the_processor() {
        let of_processor = Instructions::of_processor();
        for wanted in Instructions::ALL {
            let limited = wanted.limit();
            assert_eq!(limited.is_ok(), wanted <= of_processor, "{limited:?}");
            if limited.is_ok() {
                assert_eq!(Instructions::widest(), wanted);
            }
        }
        of_processor.limit().unwrap();
        let error = WrongInstructions::Missing { wanted: Instructions::Avx512, widest: Instructions::Avx2 };
        assert_eq!(error.to_string(), "INSONIFY_SIMD: this processor has no avx512; its widest are avx2");
        let error = "sse".parse::<Instructions>().unwrap_err().to_string();
        assert_eq!(error, "INSONIFY_SIMD: `sse` names no instructions; they are portable, avx2, avx512");
    }
}
