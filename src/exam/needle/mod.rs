//! Exercises with a tracked needle: definition, score, and a simulated hand.
//!
//! [`Exercise`] says what is to be reached and what is to be spared. [`score`] judges [`Sample`]s of a session against it;
//! [`NeedleFollower`] takes them one by one, while the session goes on. [`hand`] makes samples of an expert or a novice.

mod elevation;
mod exercise;
pub mod hand;
mod passes;
mod points;
mod sample;
mod score;
mod target;
mod track;

pub use elevation::{ElevationalProfile, GaussianSlice};
pub use exercise::{Approach, Exercise, ExerciseError, Region};
pub(crate) use points::POINTS;
pub use points::{Criterion, Deduction};
pub use sample::Sample;
pub use score::{NeedleScore, score};
pub use target::TargetDistance;
pub use track::{Moment, NeedleEvent, NeedleFollower, NeedleReference, NeedleTrack, TipInSlice};

#[cfg(test)]
mod tests;
