//! MP4 through an `ffmpeg` that is installed here.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};

use tempfile::NamedTempFile;

use super::error::check_shape;
use super::{FrameRate, SinkError, file};

/// Bit rate, high enough that speckle survives.
const BIT_RATE: &str = "12M";

/// Most of `ffmpeg`'s complaint that an error carries, bytes.
const STDERR_MAX: u64 = 2000;

/// The `ffmpeg` that the PATH leads to, if any.
pub fn find_ffmpeg() -> Option<PathBuf> {
    let name = format!("ffmpeg{}", std::env::consts::EXE_SUFFIX);
    std::env::split_paths(&std::env::var_os("PATH")?).map(|d| d.join(&name)).find(|p| p.is_file())
}

/// A running `ffmpeg` that takes raw grey frames and writes an MP4.
///
/// The file gets its name in [`Mp4Writer::finish`]; dropped before that, it disappears and `ffmpeg` is ended.
pub struct Mp4Writer {
    program: PathBuf,
    path: PathBuf,
    file: Option<NamedTempFile>,
    child: Child,
    stdin: Option<ChildStdin>,
    stderr: File,
    shape: [usize; 2],
}

impl Mp4Writer {
    /// Starts `program` for a video of `width` × `height` pixels.
    ///
    /// # Errors
    /// The file cannot be created, or the program not be started.
    pub fn create(program: &Path, path: &Path, width: u32, height: u32, rate: FrameRate) -> Result<Self, SinkError> {
        let file = file::begin(path)?;
        // A file, not a pipe: nobody has to drain it while frames are written.
        let stderr = tempfile::tempfile().map_err(SinkError::io(path))?;
        let spawn_error = |source| SinkError::Spawn { program: program.to_owned(), source };
        let mut child = Command::new(program)
            .args(["-hide_banner", "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "gray"])
            .args(["-video_size", &format!("{width}x{height}")])
            .args(["-framerate", &format!("{}/{}", rate.numerator, rate.denominator), "-i", "-"])
            // 4:2:0 is what every player takes; it needs even sides.
            .args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p", "-b:v", BIT_RATE])
            .args(["-movflags", "+faststart", "-f", "mp4"])
            .arg(file.path())
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::from(stderr.try_clone().map_err(spawn_error)?))
            .spawn()
            .map_err(spawn_error)?;
        let stdin = child.stdin.take();
        let shape = [height as usize, width as usize];
        Ok(Self { program: program.to_owned(), path: path.to_owned(), file: Some(file), child, stdin, stderr, shape })
    }

    /// Appends a frame, `grey` [height × width].
    ///
    /// # Errors
    /// `grey` does not have that size, or `ffmpeg` gave up; the error carries what it said.
    pub fn push(&mut self, grey: &[u8]) -> Result<(), SinkError> {
        check_shape(&self.path, self.shape, grey.len())?;
        let written = self.stdin.as_mut().map_or(Err(std::io::ErrorKind::BrokenPipe.into()), |s| s.write_all(grey));
        match written {
            Ok(()) => Ok(()),
            // Why it closed its end is in its exit status and its stderr.
            Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => {
                self.wait().and_then(|()| Err(SinkError::io(&self.path)(e)))
            }
            Err(e) => Err(SinkError::io(&self.path)(e)),
        }
    }

    /// Completes the file, gives it its name and returns that.
    ///
    /// # Errors
    /// `ffmpeg` failed, or the file cannot be renamed.
    pub fn finish(mut self) -> Result<PathBuf, SinkError> {
        self.wait()?;
        if let Some(file) = self.file.take() {
            file::commit(file, &self.path)?;
        }
        Ok(self.path.clone())
    }

    /// Closes the input and waits for the program's end.
    fn wait(&mut self) -> Result<(), SinkError> {
        drop(self.stdin.take());
        let status = self.child.wait().map_err(SinkError::io(&self.path))?;
        if status.success() {
            return Ok(());
        }
        let stderr = self.complaint().unwrap_or_else(|e| format!("its messages are lost: {e}"));
        Err(SinkError::Encoder { program: self.program.clone(), path: self.path.clone(), status, stderr })
    }

    fn complaint(&mut self) -> std::io::Result<String> {
        let length = self.stderr.metadata()?.len();
        self.stderr.seek(SeekFrom::Start(length.saturating_sub(STDERR_MAX)))?;
        let mut bytes = Vec::new();
        self.stderr.read_to_end(&mut bytes)?;
        Ok(String::from_utf8_lossy(&bytes).trim().to_owned())
    }
}

impl Drop for Mp4Writer {
    fn drop(&mut self) {
        // Only a writer that was not finished still holds its file, and its program may wait for more.
        if self.file.is_some() {
            drop(self.stdin.take());
            // Both fail only if it has ended already, which is what they are for.
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    /// A stand-in for `ffmpeg`: a shell script whose last argument is the output file.
    fn script(dir: &Path, body: &str) -> PathBuf {
        let path = dir.join("ffmpeg");
        std::fs::write(&path, format!("#!/bin/sh\nfor out; do :; done\n{body}\n")).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
        path
    }

    #[test]
    fn every_frame_reaches_the_program() {
        let dir = tempfile::tempdir().unwrap();
        let program = script(dir.path(), "cat > \"$out\"");
        let path = dir.path().join("v.mp4");
        let mut writer = Mp4Writer::create(&program, &path, 2, 2, FrameRate::new(20.0).unwrap()).unwrap();
        writer.push(&[1, 2, 3, 4]).unwrap();
        assert!(writer.push(&[1]).is_err());
        writer.push(&[5, 6, 7, 8]).unwrap();
        assert_eq!(writer.finish().unwrap(), path);
        assert_eq!(std::fs::read(path).unwrap(), [1, 2, 3, 4, 5, 6, 7, 8]);
    }

    #[test]
    fn a_program_that_dies_is_an_error_with_its_words() {
        let dir = tempfile::tempdir().unwrap();
        let program = script(dir.path(), "echo 'no such codec' >&2\nexit 3");
        let path = dir.path().join("v.mp4");
        let mut writer = Mp4Writer::create(&program, &path, 100, 100, FrameRate::new(20.0).unwrap()).unwrap();
        let frame = vec![0; 10_000];
        let error = loop {
            if let Err(e) = writer.push(&frame) {
                break e.to_string();
            }
        };
        assert!(error.contains("no such codec") && error.contains("v.mp4") && error.contains('3'), "{error}");
        drop(writer);
        assert!(!path.exists());
    }

    #[test]
    fn a_program_that_fails_at_the_end_is_an_error() {
        let dir = tempfile::tempdir().unwrap();
        let program = script(dir.path(), "cat > /dev/null\necho 'muxer broke' >&2\nexit 1");
        let path = dir.path().join("v.mp4");
        let mut writer = Mp4Writer::create(&program, &path, 1, 1, FrameRate::new(20.0).unwrap()).unwrap();
        writer.push(&[0]).unwrap();
        assert!(writer.finish().unwrap_err().to_string().contains("muxer broke"));
        assert!(!path.exists());
    }

    #[test]
    fn a_missing_program_is_an_error() {
        let dir = tempfile::tempdir().unwrap();
        let program = dir.path().join("nowhere/ffmpeg");
        let made =
            Mp4Writer::create(&program, &dir.path().join("v.mp4"), 1, 1, FrameRate::new(20.0).unwrap()).map(drop);
        assert!(made.unwrap_err().to_string().contains("nowhere"));
    }
}
