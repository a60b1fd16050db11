//! Status of a running session: a line overwritten in place on a terminal, otherwise a line every 5 s.

use indicatif::ProgressBar;

use super::terminal;

/// Time between two printed lines without a terminal, s.
const LINE_INTERVAL_S: f64 = 5.0;

/// Status line on stderr.
pub(crate) struct StatusLine {
    bar: Option<ProgressBar>,
    next_line_s: f64,
}

impl StatusLine {
    /// Status line without text.
    pub(crate) fn new() -> Self {
        Self { bar: terminal::show(ProgressBar::new_spinner(), "{msg}"), next_line_s: LINE_INTERVAL_S }
    }

    /// Shows `line` at `elapsed_s` after the start. `line` is called only if its text is shown.
    pub(crate) fn set(&mut self, elapsed_s: f64, line: impl FnOnce() -> String) {
        match &self.bar {
            Some(bar) => bar.set_message(line()),
            None if elapsed_s >= self.next_line_s => {
                self.next_line_s = elapsed_s + LINE_INTERVAL_S;
                terminal::say(&line());
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
