//! What the aperture sees past obstacles: its gain along each scanline, and its receive beams.

pub(super) mod beams;
pub(super) mod fourier;
pub(super) mod gain;
pub(super) mod profiles;
pub(super) mod propagate;
pub(super) mod transmission;
pub(super) mod visibility;
