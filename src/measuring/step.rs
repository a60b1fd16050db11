//! Progress of a measurement.

use super::{Check, Convergence, Point, PointError};

/// Progress of a measurement.
#[derive(Debug)]
#[non_exhaustive]
pub enum Step<'a> {
    /// The reference was rendered again with more paths.
    Reference(Convergence),
    /// The reference is finished.
    Converged(&'a Check),
    /// A point of a sweep has been measured.
    Point {
        /// The point.
        point: &'a Point,
        /// Number of the point, from 1.
        number: usize,
        /// Total number of points.
        total: usize,
        /// Remaining time for the other points, s.
        left_s: f64,
    },
    /// A point of the table of errors has been measured.
    Error(&'a PointError),
    /// Progress in a part of the measurement, counted in frames or comparisons.
    Part {
        /// Name of the part.
        what: &'static str,
        /// Number of completed steps.
        done: usize,
        /// Total number of steps.
        total: usize,
    },
}

/// Receiver of a measurement's progress.
pub type Progress<'a> = dyn Fn(Step<'_>) + 'a;

/// Receiver that reports the completed and the total number of steps of the part `what`.
pub(super) fn part<'a>(progress: &'a Progress<'_>, what: &'static str) -> impl Fn(usize, usize) + 'a {
    move |done, total| progress(Step::Part { what, done, total })
}
