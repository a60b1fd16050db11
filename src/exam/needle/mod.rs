//! Exercises with a tracked needle: definition, score, and a simulated hand.
//!
//! [`Exercise`] says what is to be reached and what is to be spared. [`score`] judges [`Sample`]s of a session against it.
//! [`NeedleFollower`] takes them one by one, while the session goes on. [`NeedleWatch`] reports the events of the tip without
//! storing the session. [`hand`] makes samples of an expert or a novice, and [`Exercises`] records them.

mod elevation;
mod event;
mod exercise;
pub mod hand;
mod passes;
mod points;
mod sample;
mod score;
mod session;
mod slice;
mod target;
mod track;
mod watch;

pub use elevation::{ElevationalProfile, GaussianSlice};
pub use event::{NeedleEvent, NeedleEventKind, TIP_EVENT};
pub use exercise::{Approach, Exercise, ExerciseError, Region};
pub(crate) use points::POINTS;
pub use points::{Criterion, Deduction};
pub use sample::Sample;
pub use score::{NeedleScore, score};
pub use session::{Exercises, TRUTH_EVENT};
pub use slice::{SETTLED_S, TipInSlice};
pub use target::TargetDistance;
pub use track::{NeedleFollower, NeedleReference, NeedleTrack};
pub use watch::{Moment, NeedleWatch, TipState};

#[cfg(test)]
mod tests;
