//! Gain of the aperture along each scanline, and the aperture's beams, which diffract past obstacles.
//!
//! From the loss and the speed along all paths, `transmission.rs` makes a mask of the scan plane. `propagate.rs` sends
//! waves through the mask, `beams.rs` sums the waves to beams. From the beams, `profiles.rs` makes the weights that
//! `lateral` uses, and `visibility.rs` the gain. `gain.rs` looks up the gain for later passes. `fourier.rs` holds the
//! transform.

pub(super) mod beams;
pub(super) mod fourier;
pub(super) mod gain;
pub(super) mod profiles;
pub(super) mod propagate;
pub(super) mod transmission;
pub(super) mod visibility;
