//! Parts of a body that a segmentation doesn't label: outline, skin, fat beneath the skin, gas.

mod components;
mod distance;
mod gas;
mod outline;

pub(crate) use components::large_components;
pub use components::without_fragments;
pub(crate) use distance::BORDER_VOXELS;
pub use distance::distances_mm;
pub use gas::{Gas, gas_of};
pub(crate) use outline::hull_margin_mm;
pub use outline::{OutlineSource, from_image, from_labels, from_mask};
