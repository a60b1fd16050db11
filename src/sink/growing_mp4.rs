//! An MP4 file that plays at every moment while it grows.
//!
//! Until it is finished it is a fragmented MP4: a description, then a `moof` and an `mdat` for each second. Finishing
//! appends the index of a plain MP4, and turns everything before that index into the content of one `mdat`.

use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};

use shiguredo_mp4::TrackKind;
use shiguredo_mp4::boxes::SampleEntry;
use shiguredo_mp4::mux::{Fmp4SegmentMuxer, Mp4FileMuxer, Sample};

use super::{FrameRate, SinkError, create_dir};
use crate::files::{PartError, PartFile};

/// Longest time between fragments, s. An interrupted video loses at most this.
const FRAGMENT_S: f64 = 1.0;

/// Placeholder box as large as the header of the finished file's `mdat`, which replaces it.
const MDAT_PLACEHOLDER: [u8; 16] = [0, 0, 0, 16, b'f', b'r', b'e', b'e', 0, 0, 0, 0, 0, 0, 0, 0];

/// A growing MP4 with one video track. It is called `NAME.part.mp4` until it is finished. If dropped unfinished, the
/// file stays under that name, unless it holds no picture.
pub(super) struct GrowingMp4 {
    names: PartFile,
    file: File,
    rate: FrameRate,
    /// Index of the finished file, completed as pictures are written.
    index: Mp4FileMuxer,
    /// File position after the last indexed picture, bytes.
    indexed: u64,
    fragments: Fmp4SegmentMuxer,
    /// Coded pictures of the current fragment, and their byte ranges in it.
    payload: Vec<u8>,
    samples: Vec<Sample>,
    /// Number of pictures in a fragment.
    fragment_len: usize,
    /// Buffer for a fragment.
    block: Vec<u8>,
    /// Length of the file, bytes.
    length: u64,
    finished: bool,
}

impl GrowingMp4 {
    /// Creates the file `path`. A file that an interrupted process left is kept under another name if `keep` is set,
    /// else replaced.
    pub(super) fn create(path: &Path, rate: FrameRate, keep: bool) -> Result<Self, SinkError> {
        if let Some(directory) = path.parent().filter(|directory| !directory.as_os_str().is_empty()) {
            create_dir(directory)?;
        }
        let names = PartFile::playable(path);
        let file = if keep { names.create_keeping() } else { names.create() };
        let file = file.map_err(|error| match error {
            PartError::Busy { path } => SinkError::Busy { path },
            PartError::File(error) => error.into(),
        })?;
        let index = Mp4FileMuxer::new().map_err(failed(path))?;
        Ok(Self {
            indexed: index.initial_boxes_bytes().len() as u64,
            index,
            fragments: Fmp4SegmentMuxer::new().map_err(failed(path))?,
            names,
            file,
            rate,
            payload: Vec::new(),
            samples: Vec::new(),
            fragment_len: (rate.fps() * FRAGMENT_S).max(1.0) as usize,
            block: Vec::new(),
            length: 0,
            finished: false,
        })
    }

    /// Appends a coded picture; the first picture needs `entry`, the description of the stream.
    pub(super) fn push(&mut self, coded: &[u8], is_key: bool, entry: Option<SampleEntry>) -> Result<(), SinkError> {
        self.samples.push(Sample {
            track_kind: TrackKind::Video,
            sample_entry: entry,
            keyframe: is_key,
            timescale: NonZeroU32::MIN.saturating_add(self.rate.numerator.saturating_sub(1)),
            duration: self.rate.denominator,
            composition_time_offset: None,
            data_offset: self.payload.len() as u64,
            data_size: coded.len(),
        });
        self.payload.extend_from_slice(coded);
        if self.samples.len() >= self.fragment_len { self.write_fragment() } else { Ok(()) }
    }

    /// Writes the waiting pictures as a fragment. After an error they still wait, and the file is as before.
    fn write_fragment(&mut self) -> Result<(), SinkError> {
        if self.samples.is_empty() {
            return Ok(());
        }
        let failed = || failed(&self.names.part);
        let mut fragments = self.fragments.clone();
        let head = fragments.create_media_segment_metadata(&self.samples).map_err(failed())?;
        self.block.clear();
        if self.length == 0 {
            let start = self.index.initial_boxes_bytes();
            self.block.extend_from_slice(&start[..start.len() - MDAT_PLACEHOLDER.len()]);
            self.block.extend_from_slice(&MDAT_PLACEHOLDER);
            let described = fragments.init_segment_bytes().map_err(failed())?;
            // Skips the description's `ftyp` box, whose length is in its first bytes.
            let ftyp = described.first_chunk().map_or(0, |length| u32::from_be_bytes(*length) as usize);
            self.block.extend_from_slice(described.get(ftyp..).unwrap_or_default());
        }
        self.block.extend_from_slice(&head);
        let payload_at = self.length + self.block.len() as u64;
        self.block.extend_from_slice(&self.payload);
        let written = self.file.seek(SeekFrom::Start(self.length)).and_then(|_| self.file.write_all(&self.block));
        if let Err(source) = written {
            // Removes a fragment that was cut short, so that the next fragment follows a complete one.
            let _ = self.file.set_len(self.length);
            return Err(SinkError::io(&self.names.part)(source));
        }
        self.length += self.block.len() as u64;
        self.index.advance_position(payload_at - self.indexed).map_err(failed())?;
        for sample in self.samples.drain(..) {
            let sample = Sample { data_offset: payload_at + sample.data_offset, ..sample };
            self.index.append_sample(&sample).map_err(failed())?;
        }
        self.indexed = self.length;
        self.fragments = fragments;
        self.payload.clear();
        Ok(())
    }

    /// Completes the file, renames it to its final path, and returns the path.
    pub(super) fn finish(mut self) -> Result<PathBuf, SinkError> {
        self.write_fragment()?;
        let PartFile { path, part } = &self.names;
        let boxes = self.index.finalize().map_err(failed(part))?;
        let mut pieces: Vec<_> = boxes.offset_and_bytes_pairs().collect();
        // The index is written first: until the last piece is written, the file is still a valid fragmented MP4.
        pieces.sort_unstable_by_key(|(offset, _)| std::cmp::Reverse(*offset));
        let written = pieces.into_iter().try_for_each(|(offset, bytes)| {
            self.file.seek(SeekFrom::Start(offset))?;
            self.file.write_all(bytes)
        });
        written.map_err(SinkError::io(part))?;
        std::fs::rename(part, path).map_err(SinkError::io(path))?;
        self.finished = true;
        Ok(self.names.path.clone())
    }
}

impl Drop for GrowingMp4 {
    fn drop(&mut self) {
        if self.finished {
            return;
        }
        // Best effort: an error was already returned to the caller.
        let _ = self.write_fragment();
        if self.length == 0 {
            let _ = std::fs::remove_file(&self.names.part);
        }
    }
}

/// Wraps an error of the encoder or of the box writer, and names the file.
pub(super) fn failed<E: ToString>(path: &Path) -> impl FnOnce(E) -> SinkError {
    let path = path.to_owned();
    move |error| SinkError::Encoder { path, reason: error.to_string() }
}
