//! Periodic pictures of a live session.

use std::path::{Path, PathBuf};
use std::time::Duration;

use super::live::LiveSink;
use super::{SinkError, png, remove};
use crate::presented::PresentedFrame;

/// Writes a PNG every `period`, named by presentation time and frame source.
pub struct Stills {
    directory: PathBuf,
    period: Duration,
    next: Duration,
    /// Number of pictures left to write.
    left: u32,
}

impl Stills {
    /// Writes at most `count` pictures into `directory`.
    pub fn new(directory: &Path, period: Duration, count: u32) -> Self {
        Self { directory: directory.to_owned(), period, next: period, left: count }
    }

    /// Removes the pictures of an earlier session.
    ///
    /// # Errors
    /// A picture can't be removed.
    pub fn remove_from(directory: &Path) -> Result<(), SinkError> {
        let files = std::fs::read_dir(directory).into_iter().flatten().flatten().map(|file| file.path());
        let is_still = |path: &PathBuf| {
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or("");
            name.contains("_s_") && name.ends_with(".png")
        };
        files.filter(is_still).try_for_each(|path| remove(&path))
    }
}

impl LiveSink for Stills {
    fn name(&self) -> &str {
        "stills"
    }

    fn present(&mut self, frame: &PresentedFrame) -> Result<(), SinkError> {
        let shown = frame.info.timeline.presented;
        if shown < self.next || self.left == 0 {
            return Ok(());
        }
        // Advances to the next period, past periods without a frame.
        while self.next <= shown {
            self.next += self.period;
        }
        self.left -= 1;
        let path = self.directory.join(format!("{:04.1}_s_{}.png", shown.as_secs_f64(), frame.source.name()));
        png::write_grey(&path, frame.width, frame.height, &frame.image, png::Effort::Fast)
    }
}
