//! Bounded reads, and checks that there is enough memory for a volume.

use std::io::Read;
use std::path::Path;

use insonify_core::files::{NoMemory, memory_for};

use super::VolumeFault;

/// Largest number of voxels of a volume.
pub(super) const MAX_VOXELS: u64 = 1 << 30;

/// Largest number of bytes of a file, and of its decompressed voxels.
pub(super) const MAX_BYTES: u64 = 4 << 30;

/// Memory of one decoded label or value, bytes. The stored value is in memory at the same time.
const DECODED_BYTES: u64 = 4;

/// A stream of bytes, with the number of remaining bytes if it is known.
pub(super) struct Source<'a> {
    stream: Box<dyn Read + 'a>,
    left: Option<u64>,
    gzip: bool,
}

impl<'a> Source<'a> {
    /// Source of an uncompressed stream with `left` bytes.
    pub(super) fn plain(stream: impl Read + 'a, left: u64) -> Self {
        Self { stream: Box::new(stream), left: Some(left), gzip: false }
    }

    /// Source of the decompressed content of a gzip stream.
    pub(super) fn gzip(stream: impl Read + 'a) -> Self {
        Self { stream: Box::new(flate2::read::MultiGzDecoder::new(stream)), left: None, gzip: true }
    }

    /// Reads exactly `expected` bytes. `part` names them in errors.
    ///
    /// # Errors
    /// Fewer bytes, or a failed read.
    pub(super) fn take(&mut self, expected: u64, part: &'static str) -> Result<Vec<u8>, VolumeFault> {
        if let Some(found) = self.left.filter(|left| *left < expected) {
            return Err(VolumeFault::Truncated { part, expected, found });
        }
        let mut bytes = Vec::new();
        let length = usize::try_from(expected).unwrap_or(usize::MAX);
        bytes.try_reserve_exact(length).map_err(|_| NoMemory { bytes: expected })?;
        let read = (&mut self.stream).take(expected).read_to_end(&mut bytes);
        let found = bytes.len() as u64;
        match read {
            // A truncated gzip stream ends in `UnexpectedEof`.
            Err(error) if error.kind() != std::io::ErrorKind::UnexpectedEof => return Err(self.fault(error)),
            _ if found < expected => return Err(VolumeFault::Truncated { part, expected, found }),
            _ => {}
        }
        self.left = self.left.map(|left| left - expected);
        Ok(bytes)
    }

    /// Reads all remaining bytes; more than `limit` are an error. `what` names the number of bytes in the error.
    pub(super) fn rest(&mut self, limit: u64, what: &'static str) -> Result<Vec<u8>, VolumeFault> {
        let mut bytes = Vec::new();
        let read = (&mut self.stream).take(limit + 1).read_to_end(&mut bytes);
        read.map_err(|error| self.fault(error))?;
        if bytes.len() as u64 > limit {
            return Err(VolumeFault::TooLarge { what, found: bytes.len() as u64, limit });
        }
        self.left = self.left.map(|left| left.saturating_sub(bytes.len() as u64));
        Ok(bytes)
    }

    /// Reads up to `limit` bytes.
    pub(super) fn up_to(&mut self, limit: u64) -> Result<Vec<u8>, VolumeFault> {
        let mut bytes = Vec::new();
        match (&mut self.stream).take(limit).read_to_end(&mut bytes) {
            Err(error) if error.kind() != std::io::ErrorKind::UnexpectedEof => Err(self.fault(error)),
            _ => Ok(bytes),
        }
    }

    /// Skips `count` bytes. `part` names them in errors.
    pub(super) fn skip(&mut self, count: u64, part: &'static str) -> Result<(), VolumeFault> {
        let copied = std::io::copy(&mut (&mut self.stream).take(count), &mut std::io::sink());
        let found = copied.map_err(|error| self.fault(error))?;
        if found < count {
            return Err(VolumeFault::Truncated { part, expected: count, found });
        }
        self.left = self.left.map(|left| left.saturating_sub(count));
        Ok(())
    }

    /// Skips `count` lines.
    pub(super) fn skip_lines(&mut self, count: u64) -> Result<(), VolumeFault> {
        let (mut found, mut byte) = (0, [0]);
        while found < count {
            if self.stream.read(&mut byte).map_err(|error| self.fault(error))? == 0 {
                return Err(VolumeFault::Header(format!("line skip is {count}, and the data has {found} lines")));
            }
            self.left = self.left.map(|left| left.saturating_sub(1));
            found += u64::from(byte == *b"\n");
        }
        Ok(())
    }

    /// Source of the decompressed content of the gzip data that follow.
    pub(super) fn into_gzip(self) -> Self {
        Self::gzip(self.stream)
    }

    /// Reads one byte, and returns whether there was one. At the end of gzip data, this also verifies the checksum.
    pub(super) fn has_more(&mut self) -> Result<bool, VolumeFault> {
        match self.stream.read(&mut [0]) {
            Ok(count) => Ok(count > 0),
            Err(error) => Err(self.fault(error)),
        }
    }

    /// Number of bytes left, if known.
    pub(super) fn left(&self) -> Option<u64> {
        self.left
    }

    fn fault(&self, error: std::io::Error) -> VolumeFault {
        if self.gzip { VolumeFault::Gzip(error) } else { VolumeFault::Read(error) }
    }
}

/// Number of voxels of a volume with these sizes.
///
/// # Errors
/// A size of zero, or more than [`MAX_VOXELS`] voxels.
pub(super) fn voxel_count(sizes: &[u64]) -> Result<usize, VolumeFault> {
    if sizes.contains(&0) {
        return Err(VolumeFault::Header(format!("sizes {sizes:?}: each must be at least 1")));
    }
    let count = sizes.iter().try_fold(1_u64, |product, size| product.checked_mul(*size)).unwrap_or(u64::MAX);
    within(count, MAX_VOXELS, "the number of voxels")?;
    usize::try_from(count).map_err(|_| too_large(count, MAX_VOXELS, "the number of voxels"))
}

/// Checks that there is memory for `count` voxels of `stored` bytes each, and their decoded values.
///
/// # Errors
/// A volume too large for this process.
pub(super) fn room_for(count: u64, stored: u64) -> Result<(), VolumeFault> {
    Ok(memory_for(count.saturating_mul(stored + DECODED_BYTES))?)
}

/// Refuses a number `found` above `limit`. `what` names it in the error.
pub(super) fn within(found: u64, limit: u64, what: &'static str) -> Result<(), VolumeFault> {
    if found > limit { Err(too_large(found, limit, what)) } else { Ok(()) }
}

fn too_large(found: u64, limit: u64, what: &'static str) -> VolumeFault {
    VolumeFault::TooLarge { what, found, limit }
}

/// `fault`, attributed to the separate file of voxels at `path`.
pub(super) fn in_data_file(path: &Path, fault: VolumeFault) -> VolumeFault {
    VolumeFault::DataFile { path: path.to_owned(), fault: Box::new(fault) }
}

/// Length of a regular file in bytes.
///
/// # Errors
/// Folders, devices, and files longer than [`MAX_BYTES`].
pub(super) fn file_length(path: &Path) -> Result<u64, VolumeFault> {
    let metadata = std::fs::metadata(path)?;
    if !metadata.is_file() {
        let remedy = if metadata.is_dir() { "; convert a DICOM folder to .nii.gz with dcm2niix" } else { "" };
        return Err(VolumeFault::Format { found: "not a file", remedy });
    }
    within(metadata.len(), MAX_BYTES, "the size of the file in bytes")?;
    Ok(metadata.len())
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::gzipped;
    use super::*;

    #[test]
    fn a_known_length_is_checked_before_allocation() {
        let error = Source::plain(&[1_u8, 2][..], 2).take(1 << 50, "the data").unwrap_err().to_string();
        assert_eq!(error, format!("truncated: the data: {} bytes expected, 2 found", 1_u64 << 50));
    }

    #[test]
    fn data_beyond_the_memory_is_refused_before_it_is_read() {
        let fault = Source::gzip(&gzipped(&[7; 1000])[..]).take(1 << 60, "the data").unwrap_err();
        assert!(matches!(fault, VolumeFault::Memory(_)) && fault.to_string().contains("crop the volume"), "{fault}");
        assert!(room_for(1 << 50, 8).is_err() && room_for(1 << 10, 8).is_ok());
    }

    #[test]
    fn a_short_or_cut_gzip_stream_is_truncated() {
        let whole = gzipped(&[7; 1000]);
        for (bytes, found) in [(&whole[..], 1000), (&whole[..12], 0)] {
            let fault = Source::gzip(bytes).take(1 << 20, "the data").unwrap_err();
            assert!(matches!(fault, VolumeFault::Truncated { found: f, .. } if f >= found), "{fault}");
        }
    }

    #[test]
    fn a_wrong_checksum_is_found_at_the_end() {
        let mut whole = gzipped(&[7; 1000]);
        let crc = whole.len() - 8;
        whole[crc] ^= 1;
        let mut source = Source::gzip(&whole[..]);
        source.take(1000, "the data").unwrap();
        assert!(matches!(source.has_more(), Err(VolumeFault::Gzip(_))));
    }

    #[test]
    fn counts_that_overflow_are_refused() {
        assert!(voxel_count(&[u64::MAX, 3, 2]).unwrap_err().to_string().contains("at most 1073741824"));
        assert!(voxel_count(&[4, 0, 2]).is_err());
        assert_eq!(voxel_count(&[4, 3, 2]).unwrap(), 24);
    }
}
