//! The effect plan: what it is for each scene, that a planned frame is the frame with all effects within the plan's bound,
//! and that effects which are easily missed are not.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

mod adversarial;
mod bench;
mod images;
mod rules;
mod scenes;
