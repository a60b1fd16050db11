//! Pixels of a sequence, image by image.

use std::io::{BufRead, ErrorKind, Read, Take};
use std::path::{Path, PathBuf};

use flate2::bufread::ZlibDecoder;

use super::InterchangeError;
use super::meta_image::{Head, data_file};

/// Images are read in pieces of this size, bytes, so that a header with a false size allocates no memory.
const PIECE: usize = 1 << 20;

pub(super) struct Pixels<R> {
    source: Source<R>,
    path: PathBuf,
    image_bytes: usize,
    count: u32,
    next: u32,
}

enum Source<R> {
    Raw(R),
    Zlib(Box<ZlibDecoder<Take<R>>>),
    /// In the file of this name.
    Elsewhere(PathBuf),
}

impl<R: BufRead> Pixels<R> {
    pub(super) fn new(source: R, path: &Path, head: &Head) -> Self {
        let source = match (head.local, head.compressed) {
            (false, _) => Source::Elsewhere(data_file(head)),
            (true, false) => Source::Raw(source),
            (true, true) => {
                let limited = source.take(head.compressed_bytes.unwrap_or(u64::MAX));
                Source::Zlib(Box::new(ZlibDecoder::new(limited)))
            }
        };
        let count = u32::try_from(head.images.len()).unwrap_or(u32::MAX);
        Self { source, path: path.to_owned(), image_bytes: head.image_bytes, count, next: 0 }
    }

    pub(super) fn next_image(&mut self, image: &mut Vec<u8>) -> Result<bool, InterchangeError> {
        image.clear();
        if self.next == self.count {
            return Ok(false);
        }
        let read = match &mut self.source {
            Source::Raw(source) => fill(source, image, self.image_bytes),
            Source::Zlib(source) => fill(source, image, self.image_bytes),
            Source::Elsewhere(file) => {
                let reason = format!("its pixels are in {}; only those behind the head are read", file.display());
                return Err(InterchangeError::File { path: self.path.clone(), reason });
            }
        };
        let reason = match read {
            Ok(()) => {
                self.next += 1;
                return Ok(true);
            }
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => {
                format!("they end early; {} images of {} bytes are missing", self.count - self.next, self.image_bytes)
            }
            Err(error) if matches!(self.source, Source::Zlib(_)) && error.raw_os_error().is_none() => {
                format!("they are no zlib stream: {error}")
            }
            Err(source) => return Err(InterchangeError::Read { path: self.path.clone(), source }),
        };
        let byte = u64::from(self.next) * self.image_bytes as u64 + image.len() as u64;
        Err(InterchangeError::Pixels { path: self.path.clone(), image: self.next, byte, reason })
    }
}

/// Appends `length` bytes to `image`.
fn fill(source: &mut impl Read, image: &mut Vec<u8>, length: usize) -> std::io::Result<()> {
    while image.len() < length {
        let piece = PIECE.min(length - image.len());
        let read = source.take(piece as u64).read_to_end(image)?;
        if read == 0 {
            return Err(ErrorKind::UnexpectedEof.into());
        }
    }
    Ok(())
}
