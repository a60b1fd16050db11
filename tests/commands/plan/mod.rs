//! Tests of the effect plan: its choice of effects for each scene, the equality of planned and complete frames within
//! the plan's bound, and effects that are easily missed.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

mod adversarial;
mod bench;
mod images;
mod rules;
mod scenes;
