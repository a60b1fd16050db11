//! Progress and errors of measurements, for the user.

use std::cell::RefCell;

use insonify::measuring::{MeasuringError, Step};

use super::progress::Progress;
use super::{Failure, output};

/// Converts an error. For damaged stored results, it names the option `--resume`.
pub(super) fn of_options(error: MeasuringError) -> Failure {
    match error {
        MeasuringError::Damaged { path, source } => {
            let error = anyhow::Error::new(source);
            Failure::Input(error.context(format!("{} is damaged: run without --resume", path.display())))
        }
        error => error.into(),
    }
}

/// Progress bar of the current part of a sweep.
#[derive(Default)]
pub(super) struct SweepBar(RefCell<Option<(&'static str, Progress)>>);

impl SweepBar {
    /// Shows or prints a step.
    pub(super) fn say(&self, step: Step<'_>) {
        match step {
            Step::Reference(found) => eprintln!("{found}"),
            Step::Converged(check) => eprintln!("{check}"),
            Step::Point { point, number, total, left_s } => {
                let left =
                    if number < total { format!(", about {} left", output::duration(left_s)) } else { String::new() };
                let (ms, error) = (point.time.median_ms, point.error.seen.whole);
                eprintln!("[{number}/{total}] {}: {ms:.1} ms, seen error {error:.2}{left}", point.name);
            }
            Step::Error(point) => {
                // Removes the bar before the line is printed.
                *self.0.borrow_mut() = None;
                eprintln!("{point}");
            }
            Step::Part { what, done, total } => self.set(what, done, total),
            _ => {}
        }
    }

    /// Shows the progress of the part `label`.
    fn set(&self, label: &'static str, done: usize, total: usize) {
        let mut shown = self.0.borrow_mut();
        if shown.as_ref().is_none_or(|(shown, _)| *shown != label) {
            // Removes the previous part's bar before a new one is drawn.
            *shown = None;
            *shown = Some((label, Progress::new(label, 0)));
        }
        if let Some((_, progress)) = &*shown {
            progress.set(done, total);
        }
    }
}
