//! Comparison of the passes that move the scene with their twins. Without motion there is nothing to compare.

use insonify::render::{Snapshot, twin};

use crate::twins::compare::{Mismatch, Tally};

/// Passes that move the scene.
pub(crate) const MOTION_PASSES: [&str; 3] = ["displace", "assemble", "refit"];

pub(crate) fn displace(s: &Snapshot) -> Result<(), Mismatch> {
    let Some(motion) = &s.inputs.motion else { return Ok(()) };
    let mut tally = Tally::new("displace", "vertices", 0.0);
    for (found, twin) in s.displaced_mm.iter().zip(twin::displace(motion)) {
        // Coordinates reach 300 mm: a few roundings of 2·10⁻⁵ mm.
        tally.add((*found - twin).length() / 1.0e-4);
    }
    tally.finish()
}

pub(crate) fn assemble(s: &Snapshot) -> Result<(), Mismatch> {
    let Some(motion) = &s.inputs.motion else { return Ok(()) };
    let twins = twin::assemble(motion, &s.displaced_mm, &s.inputs.triangles);
    let mut tally = Tally::new("assemble", "triangles", 0.0);
    for (found, twin) in s.inputs.triangles[motion.first_triangle..].iter().zip(&twins) {
        let places = [
            found.corner_mm - twin.corner_mm,
            found.edge1_mm - twin.edge1_mm,
            found.edge2_mm - twin.edge2_mm,
            found.displacement_mm - twin.displacement_mm,
        ];
        let place = places.map(|error| error.length() / 1.0e-4).into_iter().fold(0.0, f64::max);
        tally.add(place.max((found.tolerance - twin.tolerance).abs() / (1.0e-3 * twin.tolerance + 1.0e-10)));
    }
    tally.finish()
}

/// Checks that boxes enclose what they should, and are larger by at most a quantisation step.
pub(crate) fn refit(s: &Snapshot) -> Result<(), Mismatch> {
    let Some(motion) = &s.inputs.motion else { return Ok(()) };
    let twins = twin::refit(&s.nodes, &s.inputs.triangles);
    let mut tally = Tally::new("refit", "boxes", 0.0);
    let rounding_mm = 1.0e-4;
    for &node in &motion.refitted {
        let slack_mm = s.nodes[node].step_mm + rounding_mm;
        for (found, [low_mm, high_mm]) in s.nodes[node].children.iter().zip(&twins[node]) {
            for outside_mm in [*low_mm - found.low_mm, found.high_mm - *high_mm] {
                tally.add(
                    outside_mm
                        .cmplt(slack_mm)
                        .all()
                        .then_some(-outside_mm.min_element() / rounding_mm)
                        .map_or(f64::NAN, |e| e.max(0.0)),
                );
            }
        }
    }
    // The root joins boxes of trees, which are up to a step of theirs larger.
    for (found, [low_mm, high_mm]) in s.nodes[0].children.iter().zip(&twins[0]) {
        let twin::Below::Node(tree) = found.below else { panic!("the root holds triangles") };
        let slack_mm = (s.nodes[0].step_mm + s.nodes[tree].step_mm).max_element() + rounding_mm;
        for outside_mm in [*low_mm - found.low_mm, found.high_mm - *high_mm] {
            let within =
                (-rounding_mm..=slack_mm).contains(&outside_mm.min_element()) && outside_mm.max_element() <= slack_mm;
            tally.add(if within { 0.0 } else { f64::NAN });
        }
    }
    tally.finish()
}
