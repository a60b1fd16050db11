//! Trade-off between accuracy and time: measured points, their data, the Pareto front, the noise threshold, the errors of
//! effects against theory, and the output files. Rendering and measuring are done by `insonify tradeoff`.

mod effect_truth;
mod front;
mod knobs;
#[cfg(feature = "plots")]
mod labels;
#[cfg(feature = "plots")]
mod panel;
mod plan;
#[cfg(feature = "plots")]
pub mod plot;
mod point;
#[cfg(feature = "plots")]
mod style;
mod table;

pub use effect_truth::{EffectTruth, effects_csv, effects_markdown};
pub use front::{mark_front, mark_noise};
pub use knobs::Knobs;
pub use plan::{Planned, plan};
pub use point::{ClassError, Errors, PassMs, Point, Time};
pub use table::{csv, csv_field, markdown};
