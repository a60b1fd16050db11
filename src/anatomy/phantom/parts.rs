//! Selected surfaces of the phantom.

use rayon::prelude::*;

use super::{Parameters, PhantomSurface, meshing, organs};

/// Surfaces called `names` of the phantom of `parameters`, with cells of `cell_mm` or smaller where needed; unknown
/// names are ignored. For measurements: finer than the complete phantom, and fast.
pub fn parts(parameters: &Parameters, names: &[&str], cell_mm: f32) -> Vec<PhantomSurface> {
    let wanted: Vec<_> = organs(parameters).into_iter().filter(|organ| names.contains(&organ.name)).collect();
    wanted
        .par_iter()
        .map(|organ| PhantomSurface {
            name: organ.name.into(),
            tissue: organ.tissue.into(),
            priority: organ.priority,
            mesh: meshing::mesh(&organ.solid, cell_mm.min(organ.coarsest_mm)),
        })
        .collect()
}
