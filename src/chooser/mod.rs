//! Operating points of a station on a machine, and the choice among them. A point has rays, layers, steering angles and
//! maybe a generator, with an error and a time.
//!
//! Errors come from a shipped table ([`ErrorTable`](crate::measuring::ErrorTable)). Times are measured once on the
//! machine and kept in the cache.
//!
//! [`choose`] picks the first point of a session; [`PointController`] follows the load and the probe's speed from there
//! on. [`choose_still`] picks the quality of stills.

mod candidates;
mod control;
mod starting_point;
mod still;
mod still_frame;
mod times;
mod translation;

pub use control::{Candidate, FrameBudget, PointChange, PointController, PointSummary, Switch};
pub use starting_point::{StartingPoint, choose};
pub use still::{StillQuality, choose_still};
pub use still_frame::{StillFrame, StillJob, StillPoses, render_still, render_still_with, render_stills_with};
pub use translation::{Translation, TranslationReport};
