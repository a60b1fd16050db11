//! Small scenes that each call for another set of effects: what a user measures, learns or shows on.
//!
//! | scene | effects |
//! |---|---|
//! | [`qa_phantom`] | point-spread function, speckle levels, attenuation |
//! | [`vessel_needle`] | a mirror at an angle, reverberation within the needle, anechoic blood |
//! | [`gallbladder_stones`] | shadows behind stones, enhancement behind fluid, refraction at the wall |
//! | [`lung_air`] | total reflection, A-lines between pleura and probe, shadows of ribs |
//!
//! x is lateral, y elevational and z the depth from the skin, which lies at z = 0.

mod gallbladder;
mod lung;
mod needle;
pub mod qa;

pub use gallbladder::gallbladder_stones;
pub use lung::lung_air;
pub use needle::{vessel_needle, vessel_needle_at};
pub use qa::qa_phantom;

use glam::Vec3;

use super::analytic::{self, Part};

/// A layer over the whole scene from depth `top_mm` to `bottom_mm`, `half_mm` (x, y) wide to either side.
fn layer(
    name: &'static str,
    tissue: &'static str,
    priority: i32,
    half_mm: (f32, f32),
    (top_mm, bottom_mm): (f32, f32),
) -> Part {
    let half = Vec3::new(half_mm.0, half_mm.1, 0.0);
    let mesh = analytic::cuboid(Vec3::Z * top_mm - half, Vec3::Z * bottom_mm + half);
    Part { name, tissue, priority, mesh }
}
