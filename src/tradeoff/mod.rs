//! Trade-off between accuracy and time: measured points, their data, the Pareto front, the noise threshold, the errors of
//! effects against theory, and their tables and figure. [`Sweep`] measures all of it; [`effect_costs`] and [`look_costs`]
//! measure what effects and steps of a look cost.

pub(crate) mod bench;
mod cost;
mod effect_truth;
mod effects;
mod error;
mod estimate;
mod front;
pub(crate) mod identity;
mod knobs;
#[cfg(feature = "plots")]
mod labels;
mod look_cost;
mod measured_plan;
#[cfg(feature = "plots")]
mod panel;
mod plan;
#[cfg(feature = "plots")]
pub mod plot;
mod point;
mod pose_error;
pub(crate) mod reference;
pub(crate) mod store;
#[cfg(feature = "plots")]
mod style;
mod sweep;
#[cfg(feature = "plots")]
mod sweep_files;
mod sweep_step;
mod table;
mod times;
pub(crate) mod truth;

pub use cost::{Cost, Costs, TimedFrame, effect_costs};
pub use effect_truth::{EffectTruth, effects_csv, effects_markdown};
pub use error::TradeoffError;
pub(crate) use front::{mark_front, mark_noise};
pub use knobs::Knobs;
pub use look_cost::{LookCost, look_costs};
pub use measured_plan::{PlanCosts, PlanTable};
pub use plan::{Planned, plan};
pub use point::{ClassError, Errors, PassMs, Point, Time};
pub use reference::{Check, Convergence};
pub use sweep::{Sweep, SweepReport, SweepSettings};
#[cfg(feature = "plots")]
pub use sweep_files::SWEEP_FILES;
pub use sweep_step::SweepStep;
pub(crate) use table::csv_field;
pub use table::{csv, markdown};
