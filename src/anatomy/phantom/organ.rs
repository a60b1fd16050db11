//! Organ: a closed surface before meshing.

use super::sdf::Solid;

/// Body whose triangle budget a surface draws on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Body {
    /// Mother, placenta, cord and fluid.
    Mother,
    /// Fetus.
    Fetus,
}

/// One closed surface before it is meshed.
#[derive(Clone)]
pub struct Organ {
    /// Name of the surface, unique in the phantom.
    pub name: &'static str,
    /// Name of its tissue in `assets/tissues.toml`.
    pub tissue: &'static str,
    /// Priority: where surfaces overlap, the highest is the medium.
    pub priority: i32,
    /// Body whose triangle budget it draws on.
    pub body: Body,
    /// Cell size relative to other surfaces of the same body; about right in mm at scale 1.
    pub grain_mm: f32,
    /// Largest cell size that still resolves it: about its smallest thickness, mm.
    pub coarsest_mm: f32,
    /// The solid, scene frame.
    pub solid: Solid,
}
