//! Errors of generators.

use std::path::PathBuf;

use thiserror::Error;

use super::{Precision, Provider};
use crate::files::FileError;

/// Oldest minor version of ONNX Runtime 1 that generators can use.
pub(super) const ONNX_RUNTIME_MINOR: u32 = 24;

/// Failure to find or load ONNX Runtime.
#[derive(Debug, Error)]
pub enum RuntimeError {
    /// The build has no generators.
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
        /// Library.
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
        /// Manifest.
        path: PathBuf,
        /// Fault, and the expected value.
        reason: String,
    },
    /// The model's SHA-256 differs from the manifest's.
    #[error("{path} has sha256 {found}; its manifest is of a model with {expected}")]
    Sha256 {
        /// Model.
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
        /// Provider that was requested.
        provider: Provider,
        /// Message of ONNX Runtime.
        reason: String,
    },
    /// ONNX Runtime refuses the model.
    #[error("ONNX Runtime cannot use {path}: {reason}")]
    Model {
        /// Model.
        path: PathBuf,
        /// Message of ONNX Runtime.
        reason: String,
    },
    /// The model's weights lie in other files, which the manifest's hash doesn't cover.
    #[error(
        "{path} keeps its weights in {files}, and a generator is one file, so that its hash covers all of it; save it as \
         one: `torch.onnx.export(..., external_data=False)`, or `onnx.save(onnx.load(path), path)` with the Python package onnx"
    )]
    ExternalWeights {
        /// Model.
        path: PathBuf,
        /// Names of the other files.
        files: String,
    },
    /// The model has no file for the requested precision.
    #[error("{path} has no `{precision}`: its manifest names no such [[precision]]; use auto or float32")]
    NoPrecision {
        /// Model.
        path: PathBuf,
        /// Precision that was requested.
        precision: Precision,
    },
    /// The processor has no float16 arithmetic for models.
    #[error(
        "{path} cannot run in float16 on the processor; use auto, float32 or int8, or the provider cuda or tensorrt"
    )]
    NoFloat16 {
        /// Model.
        path: PathBuf,
    },
    /// The model's tensors differ from the manifest's.
    #[error("{path} does not fit its manifest: {reason}")]
    Signature {
        /// Model.
        path: PathBuf,
        /// Difference.
        reason: String,
    },
    /// The model has no class for a tissue of the station.
    #[error("{path} knows no class for the tissue `{tissue}`, and its manifest names none for others")]
    UnknownTissue {
        /// Model.
        path: PathBuf,
        /// Tissue of the station.
        tissue: String,
    },
    /// The parity pair cannot be read.
    #[error("parity pair of {path}: {reason}")]
    ParityPair {
        /// Manifest.
        path: PathBuf,
        /// Fault.
        reason: String,
    },
    /// The model does not reproduce its parity pair on this machine.
    #[error(
        "{path} is refused: on its parity pair it gives {found} at row {row}, column {column}, where {expected} is \
         expected; that is {difference} grey levels off, of {tolerance} allowed"
    )]
    Parity {
        /// Model.
        path: PathBuf,
        /// Greatest difference, grey levels.
        difference: f32,
        /// Row of the pixel with this difference.
        row: usize,
        /// Column of the pixel with this difference.
        column: usize,
        /// Grey level expected at the pixel.
        expected: f32,
        /// Grey level found at the pixel.
        found: f32,
        /// Difference allowed, grey levels.
        tolerance: f32,
    },
    /// A map of the input does not have the frame's size.
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
        /// Number found.
        number: u8,
        /// Greatest number in the table.
        greatest: usize,
    },
    /// The model's output is not finite everywhere. Such a picture is not shown.
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
