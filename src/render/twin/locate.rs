//! Surfaces that each path starts inside.

use rayon::prelude::*;

use super::inputs::{Inputs, Ray};
use super::surfaces::{Membership, crossings, places};

/// The surfaces that each path starts inside `[paths]`.
///
/// The path's line is followed from outside the whole scene up to the face. Its crossings enter and leave the closed
/// surfaces on the way.
pub fn locate(inputs: &Inputs) -> Vec<Membership> {
    let starts = (0..inputs.paths()).into_par_iter().map(|path| inside_at_start(inputs, &inputs.launch(path)));
    starts.collect()
}

fn inside_at_start(inputs: &Inputs, ray: &Ray) -> Membership {
    let mut inside = Membership::default();
    for place in places(&crossings(inputs, ray, -inputs.reach_mm, 0.0)) {
        inside.cross(place);
    }
    inside
}
