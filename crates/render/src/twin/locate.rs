//! Surfaces that each path starts inside, and the acoustic coupling of the face there.

use insonify_core::transducer::contact;
use rayon::prelude::*;

use super::inputs::{Inputs, Ray};
use super::surfaces::{Crossing, Membership, coincident, crossings};

/// Start of a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Launched {
    /// Surfaces that the path starts inside.
    pub inside: Membership,
    /// Amplitude, one way, that the face passes into the body, 0..=1.
    pub coupling: f64,
}

/// The start of each path `[paths]`.
///
/// The path's line is followed from outside the whole scene up to the face. Its crossings enter and leave the closed
/// surfaces on the way. A start outside all surfaces is coupled if gel reaches the first surface ahead.
pub fn locate(inputs: &Inputs) -> Vec<Launched> {
    let starts = (0..inputs.paths()).into_par_iter().map(|path| launched(inputs, &inputs.launch(path)));
    starts.collect()
}

fn launched(inputs: &Inputs, ray: &Ray) -> Launched {
    let mut inside = Membership::default();
    for coincident in coincident(&crossings(inputs, ray, -inputs.reach_mm, 0.0)) {
        inside.cross(coincident);
    }
    let ahead = crossings(inputs, ray, 0.0, f64::INFINITY);
    Launched { inside, coupling: coupling(inputs, ray, &inside, ahead.first()) }
}

/// One-way amplitude that the face passes to a ray, 0..=1. The ray starts inside the surfaces `inside`; its first
/// crossing is `ahead`.
pub(super) fn coupling(inputs: &Inputs, ray: &Ray, inside: &Membership, ahead: Option<&Crossing<'_>>) -> f64 {
    let Some(film_mm) = inputs.film_mm else { return 1.0 };
    if inside.highest().is_some() {
        return 1.0;
    }
    // Depth of the skin below the apex of the face.
    let skin_mm = ahead.map(|crossing| inputs.below_face_mm(ray.origin_mm + ray.direction * crossing.t_mm));
    skin_mm.map_or(0.0, |skin_mm| contact::coupling(skin_mm - film_mm))
}
