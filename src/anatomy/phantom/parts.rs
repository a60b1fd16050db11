//! Some surfaces of the phantom without the others.

use rayon::prelude::*;

use super::{Parameters, PhantomSurface, meshing, organs};

/// The surfaces of the phantom of `parameters` called `names` with cells of `cell_mm`, or as small as each needs; names that the phantom lacks are left
/// out. Finer than the whole phantom and quick: what is measured needs a few surfaces only.
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
