//! Progress of long tasks on stderr: a bar on a terminal, otherwise a line every 5 s.

use std::sync::{Mutex, OnceLock};
use std::time::{Duration, Instant};

use indicatif::ProgressBar;

use super::{output, terminal};

/// Time between two printed lines without a terminal.
const LINE_INTERVAL: Duration = Duration::from_secs(5);

/// Progress of one task. Several threads may report it.
pub(crate) struct Progress {
    label: &'static str,
    bar: Option<ProgressBar>,
    last_line: Mutex<Instant>,
    /// Time of the first report, and number of steps that were done by then.
    began: OnceLock<(Instant, usize)>,
}

impl Progress {
    /// Progress of a task with `total` steps, or 0 if their number is unknown.
    pub(crate) fn new(label: &'static str, total: usize) -> Self {
        let bar = ProgressBar::new(total as u64).with_message(label);
        let bar = terminal::show(bar, "{msg:12} {wide_bar:.cyan/blue} {pos}/{len} {elapsed} (left: {eta})");
        Self { label, bar, last_line: Mutex::new(Instant::now()), began: OnceLock::new() }
    }

    /// Reports that `done` of `total` steps are done.
    pub(crate) fn set(&self, done: usize, total: usize) {
        let &(began, first) = self.began.get_or_init(|| (Instant::now(), done));
        if let Some(bar) = &self.bar {
            bar.set_length(total as u64);
            // Threads may report out of order, but the bar must only move forward.
            bar.set_position(bar.position().max(done as u64));
            return;
        }
        let Ok(mut last) = self.last_line.lock() else { return };
        if last.elapsed() >= LINE_INTERVAL {
            *last = Instant::now();
            eprintln!(
                "{}: {done} of {total}{}",
                self.label,
                left(began.elapsed(), done.saturating_sub(first), total, done)
            );
        }
    }
}

/// Estimated remaining time as text; empty until enough steps are done.
fn left(elapsed: Duration, steps: usize, total: usize, done: usize) -> String {
    if steps == 0 || elapsed < LINE_INTERVAL {
        return String::new();
    }
    let left_s = elapsed.as_secs_f64() / steps as f64 * total.saturating_sub(done) as f64;
    format!(" (left: {})", output::duration(left_s))
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
