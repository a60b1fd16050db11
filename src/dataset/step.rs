//! Progress of long tasks on data sets.

/// Completed part of a task. The calls about a phantom come from several threads, and may arrive out of order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// Steps in building the phantom of the next tuples.
    Phantom {
        /// Number of completed steps.
        done: usize,
        /// Total number of steps.
        total: usize,
    },
    /// Frames of a sequence.
    Frames {
        /// Number of completed frames.
        done: usize,
        /// Total number of frames.
        total: usize,
    },
    /// Tuples.
    Tuples {
        /// Number of completed tuples.
        done: usize,
        /// Total number of tuples.
        total: usize,
    },
}

/// Receiver of progress.
pub type Progress<'a> = dyn Fn(Step) + Sync + 'a;
