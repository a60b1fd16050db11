//! Progress and errors of sweeps of quality settings.

use std::cell::RefCell;

use insonify::tradeoff::{SweepStep, TradeoffError};

use super::progress::Progress;
use super::{Failure, output};

/// The error with the option that it is about.
pub(super) fn of_options(error: TradeoffError) -> Failure {
    match error {
        TradeoffError::Damaged { path, source } => {
            let error = anyhow::Error::new(source);
            Failure::Input(error.context(format!("{} is damaged: run without --resume", path.display())))
        }
        error => error.into(),
    }
}

/// Progress of the current part of a sweep.
#[derive(Default)]
pub(super) struct SweepBar(RefCell<Option<(&'static str, Progress)>>);

impl SweepBar {
    pub(super) fn say(&self, step: SweepStep<'_>) {
        match step {
            SweepStep::Reference(found) => eprintln!("{found}"),
            SweepStep::Converged(check) => eprintln!("{check}"),
            SweepStep::Point { point, number, total, left_s } => {
                let left =
                    if number < total { format!(", about {} left", output::duration(left_s)) } else { String::new() };
                let (ms, rmse) = (point.time.median_ms, point.error.rmse);
                eprintln!("[{number}/{total}] {}: {ms:.1} ms, error {rmse:.2}{left}", point.name);
            }
            SweepStep::Theory { done, total } => self.set("wave theory", done, total),
            SweepStep::Costs { done, total } => self.set("measuring", done, total),
            SweepStep::Looks { done, total } => self.set("looks", done, total),
            SweepStep::LookCosts { done, total } => self.set("measuring looks", done, total),
            _ => {}
        }
    }

    /// Clears the bar, before a line is printed.
    pub(super) fn clear(&self) {
        *self.0.borrow_mut() = None;
    }

    /// Shows the part's progress.
    pub(super) fn set(&self, label: &'static str, done: usize, total: usize) {
        let mut shown = self.0.borrow_mut();
        if shown.as_ref().is_none_or(|(shown, _)| *shown != label) {
            // The last bar is cleared before the next is drawn.
            *shown = None;
            *shown = Some((label, Progress::new(label, 0)));
        }
        if let Some((_, progress)) = &*shown {
            progress.set(done, total);
        }
    }
}
