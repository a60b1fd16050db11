//! Echoes of scatterers and of interfaces, summed over the paths of each scanline.

pub(super) mod echo;
pub(super) mod march;
mod media;
mod power;
pub(super) mod speckle;
pub(super) mod texture;
