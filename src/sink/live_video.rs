//! Video of a live session.

use std::path::{Path, PathBuf};
use std::time::Duration;

use super::live::LiveSink;
use super::{FrameRate, SinkError, Video};
use crate::presented::PresentedFrame;

/// Longest pause in the video, s. Longer pauses of the session are cut to this length.
const PAUSE_MAX_S: u64 = 10;

/// Writes frames into a video of fixed rate, by their presentation times. A frame that is shown for several video
/// frames is repeated. If several frames fall into one video frame, the last one is kept.
pub(crate) struct LiveVideo {
    stem: PathBuf,
    rate: FrameRate,
    video: Option<Video>,
    /// Session time at the start of the video, plus the time cut from pauses so far.
    origin: Duration,
    /// Frame that is currently shown, and its index in the video.
    shown: Vec<u8>,
    index: u64,
}

impl LiveVideo {
    /// A video at `stem` + `.mp4`, opened with the first frame.
    pub(crate) fn new(stem: &Path, rate: FrameRate) -> Self {
        Self { stem: stem.to_owned(), rate, video: None, origin: Duration::ZERO, shown: Vec::new(), index: 0 }
    }
}

impl LiveSink for LiveVideo {
    fn name(&self) -> &str {
        "video"
    }

    fn present(&mut self, frame: &PresentedFrame) -> Result<(), SinkError> {
        let time = frame.info.timeline.presented;
        let Some(video) = &mut self.video else {
            self.video = Some(Video::create_keeping(&self.stem, frame.width, frame.height, self.rate)?);
            self.origin = time;
            self.shown.clone_from(&frame.image);
            return Ok(());
        };
        let since = time.saturating_sub(self.origin);
        let mut due = (since.as_secs_f64() * self.rate.fps()).round() as u64;
        let longest = (PAUSE_MAX_S as f64 * self.rate.fps()).ceil() as u64;
        if due > self.index + longest {
            let cut = (due - self.index - longest) as f64 / self.rate.fps();
            self.origin += Duration::from_secs_f64(cut);
            due = self.index + longest;
        }
        while self.index < due {
            self.index += 1;
            // After an error the frame still waits to be written.
            video.push(&self.shown)?;
        }
        self.shown.clone_from(&frame.image);
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<(), SinkError> {
        let Some(mut video) = self.video else { return Ok(()) };
        video.push(&self.shown)?;
        video.finish()?;
        Ok(())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::presented::{FrameInfo, FrameTimeline};

    /// Difference of grey levels between frames, well above the encoder's loss.
    const LEVELS: u8 = 36;

    /// A frame of 4 × 2 pixels whose grey level is its number.
    pub(crate) fn frame(number: u64, ms: u64) -> PresentedFrame {
        PresentedFrame {
            number,
            info: FrameInfo {
                timeline: FrameTimeline { presented: Duration::from_millis(ms), ..FrameTimeline::default() },
                ..FrameInfo::default()
            },
            width: 4,
            height: 2,
            pixel_mm: 0.5,
            image: vec![number as u8; 8],
            segmentation: vec![1; 8],
            attenuation: vec![0.5; 8],
            mask: [255; 8].into(),
            ..PresentedFrame::default()
        }
    }

    #[test]
    fn frames_keep_their_times() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("v.mp4");
        let mut sink = LiveVideo::new(&dir.path().join("v"), FrameRate::new(10.0).unwrap());
        let mut show = |number: u64, ms| {
            let grey = vec![LEVELS * number as u8; 8];
            sink.present(&PresentedFrame { image: grey, ..frame(number, ms) }).unwrap();
        };
        show(1, 5000);
        // A frame that is a little late, two frames within one video frame, a gap of three, and a pause of an hour
        // that is cut to ten seconds.
        for (number, ms) in [(2, 5110), (3, 5190), (4, 5210), (5, 5500), (6, 3_605_500)] {
            show(number, ms);
        }
        Box::new(sink).finish().unwrap();
        let (frames, ..) = crate::sink::mp4::tests::decode(&path);
        let levels: Vec<u8> = frames.iter().map(|frame| (frame[0] + LEVELS / 2) / LEVELS).collect();
        assert_eq!(levels[..5], [1, 2, 4, 4, 4]);
        assert_eq!(levels[5..105], [5; 100]);
        assert_eq!(levels[105..], [6]);
    }
}
