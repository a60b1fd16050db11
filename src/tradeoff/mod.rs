//! What accuracy costs in time: which points are measured, what a measured point holds, the Pareto front, what is noise,
//! and the files that come out. Rendering and measuring themselves are `insonify tradeoff`'s.

mod front;
mod knobs;
mod labels;
mod plan;
pub mod plot;
mod point;
mod table;

pub use front::{mark_front, mark_noise};
pub use knobs::Knobs;
pub use plan::{Planned, plan};
pub use point::{ClassError, Errors, PassMs, Point, Time};
pub use table::{csv, markdown};
