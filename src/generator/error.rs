//! Errors of generators.

use std::path::PathBuf;

use thiserror::Error;

use super::{Precision, Provider};
use crate::files::FileError;

/// Oldest minor version of ONNX Runtime 1 that generators can use: 1.24.
pub(super) const ONNX_RUNTIME_MINOR: u32 = 24;

/// Failure to find or load ONNX Runtime.
#[derive(Debug, Error)]
pub enum RuntimeError {
    /// This build has no support for generators.
    #[error("insonify was built without the feature `generator`, which generators need; build it with that feature")]
    NotBuilt,
    /// No library was found in the usual folders.
    #[error(
        "ONNX Runtime's library, which generators need, is not in {searched}; run scripts/setup, or set \
         ORT_DYLIB_PATH to the file of the library"
    )]
    Missing {
        /// Folders that were searched.
        searched: String,
    },
    /// The environment variable `ORT_DYLIB_PATH` names no file.
    #[error(
        "ORT_DYLIB_PATH names {path}, which is no file; set it to ONNX Runtime's library, or unset it and run \
         scripts/setup"
    )]
    NoSuchFile {
        /// Path in the variable.
        path: PathBuf,
    },
    /// The library could not be used.
    #[error(
        "{path} cannot be used as ONNX Runtime's library: {reason}; run scripts/setup, or set ORT_DYLIB_PATH to one \
         of version 1.{} or later",
        ONNX_RUNTIME_MINOR
    )]
    Unusable {
        /// Path of the library.
        path: PathBuf,
        /// Cause.
        reason: String,
    },
}

/// Reason why a model is refused, or a run gave no image.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum GeneratorError {
    /// There is no ONNX Runtime.
    #[error(transparent)]
    Runtime(#[from] RuntimeError),
    /// A file could not be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// A manifest that cannot be used.
    #[error("generator manifest {path}: {reason}")]
    Manifest {
        /// Path of the manifest.
        path: PathBuf,
        /// Description of the fault, and of the expected value.
        reason: String,
    },
    /// The SHA-256 of a model's file differs from the manifest's.
    #[error("{path} has sha256 {found}; its manifest is of a model with {expected}")]
    Sha256 {
        /// Path of the model.
        path: PathBuf,
        /// SHA-256 in the manifest.
        expected: String,
        /// SHA-256 of the file.
        found: String,
    },
    /// The execution provider is not available.
    #[error(
        "the provider `{provider}` is not available: {reason}; use another, or an ONNX Runtime library that has it \
         (ORT_DYLIB_PATH)"
    )]
    Provider {
        /// The requested provider.
        provider: Provider,
        /// Message of ONNX Runtime.
        reason: String,
    },
    /// ONNX Runtime refuses the model.
    #[error("ONNX Runtime cannot use {path}: {reason}")]
    Model {
        /// Path of the model.
        path: PathBuf,
        /// Message of ONNX Runtime.
        reason: String,
    },
    /// The model's weights lie in other files, which the hash in the manifest doesn't cover.
    #[error(
        "{path} keeps its weights in {files}, and a generator is one file, so that its hash covers all of it; save it as \
         one: `torch.onnx.export(..., external_data=False)`, or `onnx.save(onnx.load(path), path)` with the Python package onnx"
    )]
    ExternalWeights {
        /// Path of the model.
        path: PathBuf,
        /// Names of the other files.
        files: String,
    },
    /// The model has no file for the requested precision.
    #[error("{path} has no `{precision}`: its manifest names no such [[precision]]; use auto or float32")]
    NoPrecision {
        /// Path of the model.
        path: PathBuf,
        /// The requested precision.
        precision: Precision,
    },
    /// The processor has no float16 arithmetic for models.
    #[error(
        "{path} cannot run in float16 on the processor; use auto, float32 or int8, or the provider cuda or tensorrt"
    )]
    NoFloat16 {
        /// Path of the model.
        path: PathBuf,
    },
    /// The model's tensors differ from the manifest's.
    #[error("{path} does not fit its manifest: {reason}")]
    Signature {
        /// Path of the model.
        path: PathBuf,
        /// Description of the difference.
        reason: String,
    },
    /// The model has no class for a tissue of the station.
    #[error("{path} knows no class for the tissue `{tissue}`, and its manifest names none for others")]
    UnknownTissue {
        /// Path of the model.
        path: PathBuf,
        /// Name of the station's tissue.
        tissue: String,
    },
    /// The parity pair cannot be read.
    #[error("parity pair of {path}: {reason}")]
    ParityPair {
        /// Path of the manifest.
        path: PathBuf,
        /// Description of the fault.
        reason: String,
    },
    /// The model does not reproduce its parity pair on this machine.
    #[error(
        "{path} is refused: on its parity pair it gives {found} at row {row}, column {column}, where {expected} is \
         expected; that is {difference} grey levels off, of {tolerance} allowed"
    )]
    Parity {
        /// Path of the model.
        path: PathBuf,
        /// Greatest difference from the expected grey levels.
        difference: f32,
        /// Row of the pixel with the greatest difference.
        row: usize,
        /// Column of the pixel with the greatest difference.
        column: usize,
        /// Expected grey level of that pixel.
        expected: f32,
        /// Grey level that the model gave there.
        found: f32,
        /// Largest allowed difference, grey levels.
        tolerance: f32,
    },
    /// A map in the input doesn't have the frame's size.
    #[error("the {map} has {found} pixels; a frame of {width} x {height} has {expected}")]
    InputSize {
        /// Name of the map.
        map: &'static str,
        /// Width of the frame, pixels.
        width: u32,
        /// Height of the frame, pixels.
        height: u32,
        /// Number of pixels in the frame.
        expected: usize,
        /// Number of values in the map.
        found: usize,
    },
    /// The segmentation has a tissue number outside the station's table.
    #[error("the segmentation holds the number {number}; the station's tissues go to {greatest}")]
    TissueNumber {
        /// The tissue number found.
        number: u8,
        /// Greatest tissue number of the station's table.
        greatest: usize,
    },
    /// The model's output contains values that are not finite, so the picture is not shown.
    #[error("generator `{name}`: {count} values of its output are not finite, the first at row {row}, column {column}")]
    NotFinite {
        /// Name of the generator.
        name: String,
        /// Number of non-finite values.
        count: usize,
        /// Row of the first non-finite value.
        row: usize,
        /// Column of the first non-finite value.
        column: usize,
    },
    /// A model in beam coordinates got a picture whose scanline geometry is unknown.
    #[error(
        "generator `{name}` works in beam coordinates, and the scanlines of this picture of {width} x {height} are not known: \
         give it a frame of a renderer, or a directory that `insonify render` wrote"
    )]
    NoScanGeometry {
        /// Name of the generator.
        name: String,
        /// Width of the picture, pixels.
        width: u32,
        /// Height of the picture, pixels.
        height: u32,
    },
    /// The run was stopped by a [`Terminator`](super::Terminator).
    #[error("generator `{name}`: the run was stopped")]
    Terminated {
        /// Name of the generator.
        name: String,
    },
    /// The run failed.
    #[error("generator `{name}`: {reason}")]
    Inference {
        /// Name of the generator.
        name: String,
        /// Message of ONNX Runtime.
        reason: String,
    },
}
