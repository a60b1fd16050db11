//! Scenes whose size is impossible for a body.

use super::finding::{Defect, Finding, Region};
use crate::anatomy::{Bounds, Scene};

/// Range of scene diagonals, mm: from a wire to a whole body.
const SIZE_MM: [f32; 2] = [5.0, 3000.0];

/// Diagonal of a box, mm.
pub(super) fn diagonal_mm(bounds: Bounds) -> f32 {
    (bounds.max.as_dvec3() - bounds.min.as_dvec3()).length() as f32
}

/// Finding about a scene with these bounds; `None` if its size is possible.
pub(super) fn wrong_unit(bounds: Bounds) -> Option<Finding> {
    let (size, [least, most]) = (diagonal_mm(bounds), SIZE_MM);
    let would_fit = |factor: f32| (least..=most).contains(&(size * factor));
    let what = if size > most {
        let factor = if would_fit(1e-3) { ": 1000 times too large, if it was drawn in mm" } else { "" };
        let across = if size < 1e6 { format!("{:.1} m", size * 1e-3) } else { format!("{:.1} km", size * 1e-6) };
        format!("the scene is {across} across{factor}")
    } else if size > 0.0 && size < least {
        let factor = if would_fit(1e3) { ": 1000 times too small, if it was drawn in m and scaled to mm" } else { "" };
        format!("the scene is {size} mm across{factor}")
    } else {
        return None;
    };
    let region = Region { at_mm: (0.5 * bounds.min + 0.5 * bounds.max).to_array(), size_mm: size };
    Some(Finding::new(Defect::WrongUnit, what).at([region]))
}

/// A loaded scene of impossible size.
#[derive(Debug, Clone, PartialEq)]
pub struct WrongSize {
    /// The finding that [`examine`](super::examine) would report.
    pub finding: Finding,
    /// Smallest extent of any surface along an axis, mm.
    pub thinnest_mm: f32,
}

/// Checks the size of a loaded scene, as [`examine`](super::examine) does; `None` if it is possible.
pub fn wrong_size(scene: &Scene) -> Option<WrongSize> {
    let of_surfaces: Vec<Bounds> = scene.surfaces.iter().filter_map(|surface| surface.mesh.bounds_mm()).collect();
    let finding = wrong_unit(of_surfaces.iter().copied().reduce(Bounds::hull)?)?;
    let thinnest_mm = of_surfaces.iter().map(|bounds| bounds.size().min_element()).fold(f32::INFINITY, f32::min);
    Some(WrongSize { finding, thinnest_mm })
}
