//! Echoes of scatterers and of interfaces, summed over the paths of each scanline.
//!
//! `march.rs` goes along the samples. The power of all paths (`power.rs`, by medium: `media.rs`) sets how strong the
//! scatterers are. The axial path sets which scatterers they are (`speckle.rs`), and the tissue's texture
//! (`texture.rs`) varies them. `echo.rs` adds the interfaces.

pub(super) mod echo;
pub(super) mod march;
mod media;
mod power;
pub(super) mod speckle;
pub(super) mod texture;
