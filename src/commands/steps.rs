//! Progress bars of the library's long tasks. Each phantom that has to be built has a bar of its own.

use std::sync::Mutex;

use insonify::dataset::Step;

use super::progress::Progress;

/// Progress of a task, and of the phantom that is being built.
pub(super) struct Steps {
    task: Progress,
    phantom: Mutex<Option<Progress>>,
}

impl Steps {
    /// Progress bars of `task`.
    pub(super) fn new(task: Progress) -> Self {
        Self { task, phantom: Mutex::new(None) }
    }

    /// Shows the progress of a step.
    pub(super) fn set(&self, step: Step) {
        let Ok(mut phantom) = self.phantom.lock() else { return };
        match step {
            Step::Phantom { done, total } => {
                phantom.get_or_insert_with(|| Progress::new("phantom", 0)).set(done, total);
            }
            Step::Tuples { done, total } | Step::Frames { done, total } => {
                *phantom = None;
                self.task.set(done, total);
            }
        }
    }
}
