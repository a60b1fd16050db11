//! Progress of long tasks on data sets.

/// Completed part of a task. Reports about a phantom come from several threads and may arrive out of order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// Progress in building the phantom of the next tuples.
    Phantom {
        /// Number of completed steps.
        done: usize,
        /// Total number of steps.
        total: usize,
    },
    /// Progress in rendering the frames of a sequence.
    Frames {
        /// Number of completed frames.
        done: usize,
        /// Total number of frames.
        total: usize,
    },
    /// Progress in processing tuples.
    Tuples {
        /// Number of completed tuples.
        done: usize,
        /// Total number of tuples.
        total: usize,
    },
}

/// Receiver of the progress of a task.
pub type Progress<'a> = dyn Fn(Step) + Sync + 'a;
