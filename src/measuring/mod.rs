//! Measurement of frames: their times, and their errors against converged reference pictures.
//!
//! - [`Sweep`] measures operating points of a station: time, error, Pareto front, noise, and effects against theory.
//! - [`measure_errors`] makes the table of errors ([`ErrorTable`]) that live sessions choose from.
//! - [`bench`](mod@bench) times frames and passes; [`PlanCosts`] times each effect and each post-processing step.
//! - [`evaluation`] compares images and generators with their targets.
//!
//! One harness renders and times all operating points, and runs their generators. Uncounted frames come before timed
//! ones ([`timed`]).

pub mod bench;
mod convergence;
mod effect_cost;
mod effect_error;
mod error;
mod error_table;
mod estimate;
pub mod evaluation;
#[cfg(feature = "plots")]
pub mod figure;
mod harness;
mod knobs;
mod look_cost;
mod measured_errors;
mod needle;
mod plan_costs;
mod planned;
mod point;
mod point_times;
mod pose_error;
mod reference;
mod step;
mod store;
mod sweep;
#[cfg(feature = "plots")]
mod sweep_files;
mod table;
mod timing;

pub use convergence::{Check, Convergence};

pub use effect_cost::{EffectCosts, effect_costs};
pub use effect_error::{EffectError, effects_csv, effects_markdown};
pub use error::MeasuringError;
pub use error_table::{
    ErrorMeasure, ErrorTable, ErrorTableError, ExpectedErrors, GeneratorKey, PointError, StationErrors, scene_name,
};
pub use knobs::Knobs;
pub use look_cost::{LookCost, look_costs};
pub use measured_errors::{ANGLES, ErrorSettings, RAYS_LAYERS, measure_errors};
pub use needle::timed_needle;
pub use plan_costs::{PlanCosts, PlanTable};
pub use planned::{Planned, planned_points};
pub use point::{ClassError, Errors, PassMs, Point, Time};
pub use step::{Progress, Step};
pub use sweep::{Machine, Sweep, SweepReport, SweepSettings};
#[cfg(feature = "plots")]
pub use sweep_files::SWEEP_FILES;
pub use table::{csv, markdown};
pub use timing::{Cost, TimedFrame, timed};
