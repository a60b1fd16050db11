//! Progress of a measurement.

use super::{Check, Convergence, Point, PointError};

/// Progress of a measurement.
#[derive(Debug)]
#[non_exhaustive]
pub enum Step<'a> {
    /// The reference has been rendered with more paths.
    Reference(Convergence),
    /// The reference is finished.
    Converged(&'a Check),
    /// A point of a sweep is measured.
    Point {
        /// The point.
        point: &'a Point,
        /// Its number, from 1.
        number: usize,
        /// Total number of points.
        total: usize,
        /// Remaining time for the others, s.
        left_s: f64,
    },
    /// A point of the table of errors is finished.
    Error(&'a PointError),
    /// Part of a measurement whose frames or comparisons are counted.
    Part {
        /// Name of the part.
        what: &'static str,
        /// Completed steps.
        done: usize,
        /// Total steps.
        total: usize,
    },
}

/// Receiver of a measurement's progress.
pub type Progress<'a> = dyn Fn(Step<'_>) + 'a;

/// Receiver of the completed and the total steps of the part `what`.
pub(super) fn part<'a>(progress: &'a Progress<'_>, what: &'static str) -> impl Fn(usize, usize) + 'a {
    move |done, total| progress(Step::Part { what, done, total })
}
