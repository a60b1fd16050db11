//! Status of a running session: a line that is overwritten on a terminal, else a line now and then.

use indicatif::ProgressBar;

use super::terminal;

/// Time between two lines where there is no terminal, s.
const LINE_INTERVAL_S: f64 = 5.0;

/// The line, on stderr.
pub(crate) struct StatusLine {
    bar: Option<ProgressBar>,
    next_line_s: f64,
}

impl StatusLine {
    /// Nothing said yet.
    pub(crate) fn new() -> Self {
        Self { bar: terminal::show(ProgressBar::new_spinner(), "{msg}"), next_line_s: LINE_INTERVAL_S }
    }

    /// Says `line`, which is only made where it is shown, at `elapsed_s` since the start.
    pub(crate) fn set(&mut self, elapsed_s: f64, line: impl FnOnce() -> String) {
        match &self.bar {
            Some(bar) => bar.set_message(line()),
            None if elapsed_s >= self.next_line_s => {
                self.next_line_s = elapsed_s + LINE_INTERVAL_S;
                eprintln!("{}", line());
            }
            None => {}
        }
    }
}

impl Drop for StatusLine {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
