//! Pictures against physics, wave theory, twins and stored sums.

mod frames;
mod hard_cases;
mod phantom;
mod physics;
mod truth;
mod twins;
mod walls;
