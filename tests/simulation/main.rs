//! Tests of pictures against physics, wave theory, f64 twins of the passes, and stored sums.

mod frames;
mod hard_cases;
mod phantom;
mod physics;
mod truth;
mod twins;
mod walls;
