//! How good an image is.

pub mod levels;
pub mod qa_phantom;
