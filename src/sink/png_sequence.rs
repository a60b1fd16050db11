//! One PNG per frame, with an index.

use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use super::SinkError;
use super::file::create;
use super::frame_line::FrameLine;
use super::live::LiveSink;
use super::png::{self, Effort};
use crate::presented::PresentedFrame;

/// File with a line for each image.
const INDEX: &str = "index.jsonl";

/// Writes `000000.png` and so on by frame number, and for each image a line in `index.jsonl`. Frames dropped by a
/// slow disk are gaps in both.
#[derive(Debug)]
pub struct PngSequence {
    directory: PathBuf,
    index: File,
}

impl PngSequence {
    /// Writes to `directory`, which is created if missing.
    ///
    /// # Errors
    /// The directory or its index cannot be written.
    pub fn create(directory: &Path) -> Result<Self, SinkError> {
        let index = create(&directory.join(INDEX))?;
        Ok(Self { directory: directory.to_owned(), index })
    }
}

impl LiveSink for PngSequence {
    fn name(&self) -> &str {
        "png"
    }

    fn present(&mut self, frame: &PresentedFrame) -> Result<(), SinkError> {
        let file = format!("{:06}.png", frame.number);
        png::write_grey(&self.directory.join(&file), frame.width, frame.height, &frame.image, Effort::Fast)?;
        // Each line is written at once: an image without its line would have no time.
        let path = self.directory.join(INDEX);
        let line = serde_json::to_string(&FrameLine { file: Some(&file), ..FrameLine::new(frame) });
        let line = line.map_err(|source| SinkError::Json { path: path.clone(), source })? + "\n";
        self.index.write_all(line.as_bytes()).map_err(SinkError::io(&path))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sink::live_video::tests::frame;

    #[test]
    fn every_frame_has_its_file_and_its_line() {
        let dir = tempfile::tempdir().unwrap();
        let mut sink = PngSequence::create(&dir.path().join("png")).unwrap();
        for (number, ms) in [(0, 10), (2, 110)] {
            sink.present(&frame(number, ms)).unwrap();
        }
        let index = std::fs::read_to_string(dir.path().join("png/index.jsonl")).unwrap();
        let lines: Vec<serde_json::Value> = index.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
        assert_eq!(lines.len(), 2);
        assert_eq!((&lines[1]["file"], &lines[1]["presented_ms"]), (&"000002.png".into(), &110.0.into()));
        assert_eq!(lines[1]["source"], "raw");
        let image = image::open(dir.path().join("png/000002.png")).unwrap();
        assert_eq!(image.into_bytes(), frame(2, 110).image);
        Box::new(sink).finish().unwrap();
    }
}
