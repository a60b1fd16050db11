//! Uncompressed video: Y4M, 8-bit grey.

use std::fs::File;
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use super::error::check_shape;
use super::{FrameRate, SinkError, file};

/// A growing Y4M file of grey frames, `Cmono` at full range: the grey levels are stored as they are.
///
/// The file gets its name in [`Y4mWriter::finish`]; dropped before that, it disappears.
pub struct Y4mWriter {
    path: PathBuf,
    file: NamedTempFile,
    // Unbuffered: the encoder cannot be flushed, and a frame is one large write anyway.
    encoder: y4m::Encoder<File>,
    shape: [usize; 2],
}

impl Y4mWriter {
    /// Opens a video of `width` × `height` pixels.
    ///
    /// # Errors
    /// The file cannot be created.
    pub fn create(path: &Path, width: u32, height: u32, rate: FrameRate) -> Result<Self, SinkError> {
        let file = file::begin(path)?;
        let handle = file.as_file().try_clone().map_err(SinkError::io(path))?;
        let (width, height) = (width as usize, height as usize);
        // Without this extension players take luma as 16..=235.
        let range = y4m::VendorExtensionString::new(b"COLORRANGE=FULL".to_vec()).map_err(to_io(path))?;
        let encoder = y4m::encode(width, height, y4m::Ratio::new(rate.numerator as usize, rate.denominator as usize))
            .with_colorspace(y4m::Colorspace::Cmono)
            .append_vendor_extension(range)
            .write_header(handle)
            .map_err(to_io(path))?;
        Ok(Self { path: path.to_owned(), file, encoder, shape: [height, width] })
    }

    /// Appends a frame, `grey` [height × width].
    ///
    /// # Errors
    /// `grey` does not have that size, or the disk is full.
    pub fn push(&mut self, grey: &[u8]) -> Result<(), SinkError> {
        check_shape(&self.path, self.shape, grey.len())?;
        self.encoder.write_frame(&y4m::Frame::new([grey, &[], &[]], None)).map_err(to_io(&self.path))
    }

    /// Completes the file, gives it its name and returns that.
    ///
    /// # Errors
    /// The file cannot be renamed.
    pub fn finish(self) -> Result<PathBuf, SinkError> {
        let Self { path, file, .. } = self;
        file::commit(file, &path)?;
        Ok(path)
    }
}

fn to_io(path: &Path) -> impl FnOnce(y4m::Error) -> SinkError {
    let path = path.to_owned();
    move |error| {
        let source = match error {
            y4m::Error::IoError(source) => source,
            other => std::io::Error::other(other.to_string()),
        };
        SinkError::Io { path, source }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_come_back_as_they_went() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("v.y4m");
        let frames: Vec<Vec<u8>> = (0..3).map(|n| (0..7 * 5).map(|i| (i * 7 + n * 50) as u8).collect()).collect();
        let mut writer = Y4mWriter::create(&path, 7, 5, FrameRate::new(12.5).unwrap()).unwrap();
        for frame in &frames {
            writer.push(frame).unwrap();
        }
        assert!(!path.exists(), "the name appears only when the file is whole");
        assert_eq!(writer.finish().unwrap(), path);
        let mut decoder = y4m::decode(File::open(&path).unwrap()).unwrap();
        assert_eq!((decoder.get_width(), decoder.get_height()), (7, 5));
        let rate = decoder.get_framerate();
        assert_eq!((rate.num, rate.den), (25, 2));
        for frame in &frames {
            assert_eq!(decoder.read_frame().unwrap().get_y_plane(), &frame[..]);
        }
        assert!(matches!(decoder.read_frame(), Err(y4m::Error::EOF)));
    }

    #[test]
    fn an_unfinished_video_disappears() {
        let dir = tempfile::tempdir().unwrap();
        let mut writer = Y4mWriter::create(&dir.path().join("v.y4m"), 2, 1, FrameRate::new(20.0).unwrap()).unwrap();
        writer.push(&[0, 1]).unwrap();
        assert!(writer.push(&[0]).is_err());
        drop(writer);
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    }
}
