//! What an organ module hands over.

use super::sdf::Solid;

/// Whose triangles a surface counts as.
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
    /// Where surfaces overlap, the highest priority is the medium.
    pub priority: i32,
    /// Whose budget of triangles it draws on.
    pub body: Body,
    /// Cell size relative to that of other surfaces of the same body; about right in mm at scale 1.
    pub grain_mm: f32,
    /// Greatest cell size that still resolves it: about its least thickness, mm.
    pub coarsest_mm: f32,
    /// The solid, scene frame.
    pub solid: Solid,
}
