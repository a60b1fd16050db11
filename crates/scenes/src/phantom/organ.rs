//! Organ: a closed surface before meshing.

use insonify_core::anatomy::sdf::Solid;

use super::PhantomSurface;
use super::meshing::mesh;

/// Body whose triangle budget includes a surface.
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
    /// Priority: where surfaces overlap, the surface of the highest priority determines the medium.
    pub priority: i32,
    /// Body whose triangle budget includes this surface.
    pub body: Body,
    /// Cell size relative to other surfaces of the same body: roughly the size in mm at scale 1.
    pub grain_mm: f32,
    /// Largest cell size that still resolves this surface, mm: about its smallest thickness.
    pub coarsest_mm: f32,
    /// The solid, scene frame.
    pub solid: Solid,
}

impl Body {
    /// An organ whose triangles belong to this body's budget.
    pub(super) fn organ(
        self,
        name: &'static str,
        tissue: &'static str,
        priority: i32,
        grain_mm: f32,
        coarsest_mm: f32,
        solid: Solid,
    ) -> Organ {
        Organ { name, tissue, priority, body: self, grain_mm, coarsest_mm, solid }
    }
}

impl Organ {
    /// The organ meshed with cells of `cell_mm`.
    pub(super) fn surface(&self, cell_mm: f32) -> PhantomSurface {
        let mesh = mesh(&self.solid, cell_mm);
        PhantomSurface { name: self.name.into(), tissue: self.tissue.into(), priority: self.priority, mesh }
    }
}
