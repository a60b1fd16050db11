//! A video of frames, in the best format that this machine can write.

use std::path::{Path, PathBuf};

use super::mp4::{self, Mp4Writer};
use super::y4m::Y4mWriter;
use super::{FrameRate, SinkError};

/// A frame of half the width and height, rounded down to even numbers, each pixel the mean of four.
///
/// `grey` is [height × width]; returns the frame, its width and its height.
pub fn halved(grey: &[u8], width: u32, height: u32) -> (Vec<u8>, u32, u32) {
    let (half_width, half_height) = (width / 4 * 2, height / 4 * 2);
    let at = |x: u32, y: u32| u32::from(grey[(y * width + x) as usize]);
    let mean = |x: u32, y: u32| (at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1) + 2) / 4;
    let pixels = (0..half_height).flat_map(|y| (0..half_width).map(move |x| mean(2 * x, 2 * y) as u8)).collect();
    (pixels, half_width, half_height)
}

/// A growing video of grey frames: MP4 where `ffmpeg` is found, else Y4M.
pub enum Video {
    /// Through `ffmpeg`.
    Mp4(Mp4Writer),
    /// Uncompressed.
    Y4m(Y4mWriter),
}

impl Video {
    /// Opens `stem` + `.mp4` if `ffmpeg` is on the PATH, else `stem` + `.y4m`.
    ///
    /// # Errors
    /// The file cannot be created, or `ffmpeg` cannot be started.
    pub fn create(stem: &Path, width: u32, height: u32, rate: FrameRate) -> Result<Self, SinkError> {
        match mp4::find_ffmpeg() {
            Some(program) => {
                Mp4Writer::create(&program, &stem.with_extension("mp4"), width, height, rate).map(Self::Mp4)
            }
            None => Y4mWriter::create(&stem.with_extension("y4m"), width, height, rate).map(Self::Y4m),
        }
    }

    /// Appends a frame, `grey` [height × width].
    ///
    /// # Errors
    /// `grey` does not have that size, the disk is full, or `ffmpeg` gave up.
    pub fn push(&mut self, grey: &[u8]) -> Result<(), SinkError> {
        match self {
            Self::Mp4(writer) => writer.push(grey),
            Self::Y4m(writer) => writer.push(grey),
        }
    }

    /// Completes the video and returns its path.
    ///
    /// # Errors
    /// As [`Video::push`].
    pub fn finish(self) -> Result<PathBuf, SinkError> {
        match self {
            Self::Mp4(writer) => writer.finish(),
            Self::Y4m(writer) => writer.finish(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_halved_frame_is_the_mean_of_four_pixels() {
        let grey: Vec<u8> = (0..7 * 5).collect();
        let (half, width, height) = halved(&grey, 7, 5);
        assert_eq!((width, height), (2, 2));
        // The first block is 0, 1, 7, 8.
        assert_eq!(half, [4, 6, 18, 20]);
    }

    #[test]
    fn frame_rates_are_in_lowest_terms() {
        let pair = |fps| FrameRate::new(fps).map(|r| (r.numerator, r.denominator));
        assert_eq!(pair(15.0).unwrap(), (15, 1));
        assert_eq!(pair(29.97).unwrap(), (2997, 100));
        assert_eq!(pair(0.1).unwrap(), (1, 10));
        for fps in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e9] {
            assert!(pair(fps).is_err(), "{fps}");
        }
    }
}
