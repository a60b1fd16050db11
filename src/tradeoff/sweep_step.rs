//! Progress of a sweep.

use super::Point;
use super::reference::{Check, Convergence};

/// Progress of a sweep.
#[derive(Debug)]
#[non_exhaustive]
pub enum SweepStep<'a> {
    /// The reference has been rendered with more paths.
    Reference(Convergence),
    /// The reference is finished.
    Converged(&'a Check),
    /// A point is measured.
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
    /// Comparisons of effects with wave theory.
    Theory {
        /// Completed steps.
        done: usize,
        /// Total steps.
        total: usize,
    },
    /// Frames to measure costs of effects.
    Costs {
        /// Completed steps.
        done: usize,
        /// Total steps.
        total: usize,
    },
    /// Comparisons of looks with a perfect picture.
    Looks {
        /// Completed steps.
        done: usize,
        /// Total steps.
        total: usize,
    },
    /// Frames to measure costs of looks.
    LookCosts {
        /// Completed steps.
        done: usize,
        /// Total steps.
        total: usize,
    },
}

/// Receiver of a sweep's progress.
pub(crate) type SweepProgress<'a> = dyn Fn(SweepStep<'_>) + 'a;
