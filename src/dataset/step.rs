//! Progress of long tasks on data sets.

/// Completed part of a task. Calls about a phantom come from several threads and may overtake each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// Steps in building the phantom of the next tuples.
    Phantom {
        /// Completed steps.
        done: usize,
        /// Total steps.
        total: usize,
    },
    /// Frames of a sequence.
    Frames {
        /// Completed frames.
        done: usize,
        /// Total frames.
        total: usize,
    },
    /// Tuples.
    Tuples {
        /// Completed tuples.
        done: usize,
        /// Total tuples.
        total: usize,
    },
}

/// Receiver of progress.
pub type Progress<'a> = dyn Fn(Step) + Sync + 'a;
