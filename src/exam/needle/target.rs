//! Distance of the tip from the target.

use std::sync::Arc;

use glam::DVec3;

use super::exercise::Region;
use crate::anatomy::{Bvh, BvhError, Scene, Skin};

/// Measures distances from a region of the scene, whose surfaces are at rest.
#[derive(Debug)]
pub enum TargetDistance {
    /// Distance from a ball.
    Ball {
        /// Centre in the scene, mm.
        centre_mm: DVec3,
        /// Radius, mm.
        radius_mm: f64,
    },
    /// Distance from the inside of surfaces.
    Surfaces {
        /// Tree of the scene, at rest.
        bvh: Arc<Bvh>,
        /// Whether each surface of the scene is one of the region's.
        chosen: Vec<bool>,
        /// The region's surfaces.
        border: Skin,
    },
}

impl TargetDistance {
    /// Distance from `region` in `scene`.
    ///
    /// # Errors
    /// The scene lacks the region's surface, or has no tree.
    pub fn of(region: &Region, scene: &Scene) -> Result<Self, BvhError> {
        match region {
            &Region::Ball { centre_mm, radius_mm } => Ok(Self::Ball { centre_mm, radius_mm }),
            Region::Surface(_) => Self::with_bvh(region, scene, Arc::new(Bvh::build(scene)?)),
        }
    }

    /// Distance from `region` in `scene`, whose tree is `bvh`, at rest.
    ///
    /// # Errors
    /// The scene lacks the region's surface.
    pub fn with_bvh(region: &Region, scene: &Scene, bvh: Arc<Bvh>) -> Result<Self, BvhError> {
        if let &Region::Ball { centre_mm, radius_mm } = region {
            return Ok(Self::Ball { centre_mm, radius_mm });
        }
        let chosen: Vec<bool> = scene.surfaces.iter().map(|surface| region.is_surface(&surface.name)).collect();
        let surfaces = scene.surfaces.iter().filter(|surface| region.is_surface(&surface.name));
        let border = Skin::of_triangles(surfaces.flat_map(|surface| surface.mesh.corners_mm()))?;
        Ok(Self::Surfaces { bvh, chosen, border })
    }

    /// Distance of a point from the region, mm; 0 inside.
    pub fn distance_mm(&self, point_mm: DVec3) -> f64 {
        match self {
            Self::Ball { centre_mm, radius_mm } => (point_mm.distance(*centre_mm) - radius_mm).max(0.0),
            Self::Surfaces { bvh, chosen, border } => {
                let windings = bvh.windings(point_mm, chosen.len());
                let is_inside = chosen.iter().zip(windings).any(|(&chosen, winding)| chosen && winding != 0);
                if is_inside { 0.0 } else { border.distance_mm(point_mm) }
            }
        }
    }
}
