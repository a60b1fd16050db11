//! Reader of sequences: the whole header first, then the pixels image by image.

use std::fs::File;
use std::io::{BufRead, BufReader, ErrorKind, Read, Take};
use std::path::{Path, PathBuf};

use flate2::bufread::ZlibDecoder;
use insonify_core::files::{self, FileKind};

use super::meta_image::{Head, PixelStorage, read_head};
use super::{InterchangeError, Lines};

/// Size of the pieces in which images are read, bytes: a wrong size in a header must not allocate much memory.
const PIECE: usize = 1 << 20;

/// A sequence being read.
pub struct Sequence<R> {
    path: PathBuf,
    head: Head,
    source: Source<R>,
    /// Number of images read.
    next: usize,
}

enum Source<R> {
    Raw(R),
    Zlib(Box<ZlibDecoder<Take<R>>>),
    /// Pixels in the file of this name.
    Elsewhere(PathBuf),
}

impl Sequence<BufReader<File>> {
    /// Opens the file at `path` and reads its header.
    ///
    /// # Errors
    /// The file cannot be opened, or an error of [`from_source`](Self::from_source).
    pub fn open(path: &Path) -> Result<Self, InterchangeError> {
        match files::open(path, FileKind::Sequence) {
            Ok(file) => Self::from_source(BufReader::new(file), path),
            Err(source) => Err(InterchangeError::Read { path: path.to_owned(), source }),
        }
    }
}

impl<R: BufRead> Sequence<R> {
    /// Reads the header of a sequence; errors name it `path`.
    ///
    /// # Errors
    /// The source cannot be read; a line is not `Key = value`; a key is missing, repeated or has a wrong value; the
    /// number of images differs from the header's.
    pub fn from_source(source: R, path: &Path) -> Result<Self, InterchangeError> {
        let mut lines = Lines::new(source, path);
        let head = read_head(&mut lines)?;
        let source = match &head.pixels {
            PixelStorage::Raw => Source::Raw(lines.source),
            PixelStorage::Zlib { bytes } => {
                let limited = lines.source.take(bytes.unwrap_or(u64::MAX));
                Source::Zlib(Box::new(ZlibDecoder::new(limited)))
            }
            PixelStorage::File(path) => Source::Elsewhere(path.clone()),
        };
        Ok(Self { path: path.to_owned(), head, source, next: 0 })
    }

    /// Header of the sequence.
    pub fn head(&self) -> &Head {
        &self.head
    }

    /// Reads the next image into `image`, replacing its content; false after the last one.
    ///
    /// # Errors
    /// The pixels are in another file, end early, or are not a zlib stream.
    pub fn next_image(&mut self, image: &mut Vec<u8>) -> Result<bool, InterchangeError> {
        image.clear();
        let (left, image_bytes) = (self.head.images.len() - self.next, self.head.image_bytes);
        if left == 0 {
            return Ok(false);
        }
        let read = match &mut self.source {
            Source::Raw(source) => fill(source, image, image_bytes),
            Source::Zlib(source) => fill(source, image, image_bytes),
            Source::Elsewhere(file) => {
                let reason = format!("its pixels are in {}; only those behind the head are read", file.display());
                return Err(InterchangeError::file(&self.path, reason));
            }
        };
        let reason = match read {
            Ok(()) => {
                self.next += 1;
                return Ok(true);
            }
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => {
                format!("they end early; {left} images of {image_bytes} bytes are missing")
            }
            Err(error) if matches!(self.source, Source::Zlib(_)) && error.raw_os_error().is_none() => {
                format!("they are no zlib stream: {error}")
            }
            Err(source) => return Err(InterchangeError::Read { path: self.path.clone(), source }),
        };
        let byte = self.next as u64 * image_bytes as u64 + image.len() as u64;
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
