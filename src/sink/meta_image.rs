//! Tracked sequences as PLUS and SlicerIGSIO read them: `.igs.mha`, a MetaImage whose header holds the time and
//! transforms of each image. [`recording::interchange::meta_image`](crate::recording::interchange::meta_image) reads
//! them back.
//!
//! Each image has a `ProbeToTrackerTransform` (our `scene_from_probe`) and an `ImageToProbeTransform` (pixels to mm;
//! the first pixel's centre is 0 0, x points right and y down). In a session with a needle it also has a
//! `NeedleTipToTrackerTransform` (our `scene_from_needle`: origin at the tip, z from the hub to the tip). Each has a status,
//! and is written row by row in mm.

use std::fmt::Write as _;
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use flate2::Compression;
use flate2::write::ZlibEncoder;
use glam::{DMat3, DVec3};
use tempfile::NamedTempFile;

use super::SinkError;
use super::error::check_shape;
use super::file::{begin, commit};
use crate::pose::Pose;
use crate::transducer::Sector;

/// Width of the header field for the compressed size, characters. The size is known only at the end.
const SIZE_WIDTH: usize = 20;

/// Time and pose of one image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImageTracking {
    /// Time, s.
    pub time_s: f64,
    /// `scene_from_probe`.
    pub pose: Pose,
    /// Whether the pose was measured; otherwise it is written as invalid.
    pub tracked: bool,
    /// `scene_from_needle`; none if it is unknown. If no image has one, none is written.
    pub needle: Option<Pose>,
    /// Whether that pose was measured; otherwise it is written as invalid.
    pub needle_tracked: bool,
}

/// Writer of a sequence of 8-bit images.
pub struct MetaImageWriter {
    out: Out,
    path: PathBuf,
    sector: Sector,
    images: usize,
    pushed: usize,
    /// File offsets of the compressed size field and of the pixels, bytes.
    size_at: u64,
    pixels_at: u64,
}

enum Out {
    Raw(BufWriter<NamedTempFile>),
    Zlib(ZlibEncoder<BufWriter<NamedTempFile>>),
}

impl Out {
    fn writer(&mut self) -> &mut dyn Write {
        match self {
            Self::Raw(out) => out,
            Self::Zlib(out) => out,
        }
    }
}

impl MetaImageWriter {
    /// Writes the header of a sequence of `images.len()` images with the size of `sector`. If `compress` is set, zlib
    /// compresses the pixels.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn create(path: &Path, sector: &Sector, images: &[ImageTracking], compress: bool) -> Result<Self, SinkError> {
        let io = || SinkError::io(path);
        let mut out = BufWriter::with_capacity(1 << 18, begin(path)?);
        let (before, behind) = head(sector, images.len(), compress);
        let size_at = before.len() as u64;
        out.write_all(before.as_bytes()).map_err(io())?;
        if compress {
            write!(out, "{:SIZE_WIDTH$}", "").map_err(io())?;
        }
        out.write_all(behind.as_bytes()).map_err(io())?;
        let image_to_probe = row_by_row(&image_to_probe(sector));
        let has_needle = images.iter().any(|image| image.needle.is_some());
        let mut text = String::new();
        for (number, image) in images.iter().enumerate() {
            text.clear();
            let status = if image.tracked { "OK" } else { "INVALID" };
            let to_tracker = |pose: &Pose| row_by_row(&(DMat3::from_quat(pose.orientation), pose.position_mm));
            let probe_to_tracker = to_tracker(&image.pose);
            let needle_to_tracker = to_tracker(&image.needle.unwrap_or(Pose::IDENTITY));
            let needle_status = if image.needle.is_some() && image.needle_tracked { "OK" } else { "INVALID" };
            let of_needle = [
                ("NeedleTipToTrackerTransform", &needle_to_tracker as &dyn std::fmt::Display),
                ("NeedleTipToTrackerTransformStatus", &needle_status),
            ];
            let fields = [
                ("FrameNumber", &number as &dyn std::fmt::Display),
                ("ImageStatus", &"OK"),
                ("ImageToProbeTransform", &image_to_probe),
                ("ImageToProbeTransformStatus", &"OK"),
                ("ProbeToTrackerTransform", &probe_to_tracker),
                ("ProbeToTrackerTransformStatus", &status),
                ("Timestamp", &image.time_s),
                ("UnfilteredTimestamp", &image.time_s),
            ];
            for (key, value) in fields.into_iter().chain(of_needle.into_iter().filter(|_| has_needle)) {
                // Writing to a string cannot fail.
                let _ = writeln!(text, "Seq_Frame{number:04}_{key} = {value}");
            }
            out.write_all(text.as_bytes()).map_err(io())?;
        }
        out.write_all(b"ElementDataFile = LOCAL\n").map_err(io())?;
        out.flush().map_err(io())?;
        let pixels_at = out.get_mut().stream_position().map_err(io())?;
        let out = match compress {
            true => Out::Zlib(ZlibEncoder::new(out, Compression::fast())),
            false => Out::Raw(out),
        };
        Ok(Self { out, path: path.to_owned(), sector: *sector, images: images.len(), pushed: 0, size_at, pixels_at })
    }

    /// Appends the next image, grey levels [height × width].
    ///
    /// # Errors
    /// It does not have the sector's size, or the file cannot be written.
    pub fn push(&mut self, image: &[u8]) -> Result<(), SinkError> {
        check_shape(&self.path, [self.sector.height as usize, self.sector.width as usize], image.len())?;
        self.pushed += 1;
        self.out.writer().write_all(image).map_err(SinkError::io(&self.path))
    }

    /// Completes the file and renames it to its path.
    ///
    /// # Errors
    /// The number of images differs from the header's, or the file cannot be written.
    pub fn finish(self) -> Result<(), SinkError> {
        let io = || SinkError::io(&self.path);
        if self.pushed != self.images {
            let reason = format!("{} images came; its head says {}", self.pushed, self.images);
            return Err(io()(std::io::Error::new(std::io::ErrorKind::InvalidInput, reason)));
        }
        let (out, compressed) = match self.out {
            Out::Raw(out) => (out, false),
            Out::Zlib(out) => (out.finish().map_err(io())?, true),
        };
        let mut file = out.into_inner().map_err(|error| io()(error.into_error()))?;
        if compressed {
            let size = file.stream_position().map_err(io())? - self.pixels_at;
            file.seek(SeekFrom::Start(self.size_at)).map_err(io())?;
            write!(file, "{size:<SIZE_WIDTH$}").map_err(io())?;
        }
        commit(file, &self.path)
    }
}

/// Header before the lines of single images, as two parts between which the compressed size is written.
fn head(sector: &Sector, images: usize, compress: bool) -> (String, String) {
    let compressed = if compress { "True\nCompressedDataSize = " } else { "False" };
    let before = format!(
        "ObjectType = Image\nNDims = 3\nAnatomicalOrientation = RAI\nBinaryData = True\n\
         BinaryDataByteOrderMSB = False\nCenterOfRotation = 0 0 0\nCompressedData = {compressed}"
    );
    let behind = format!(
        "\nDimSize = {} {} {images}\nElementNumberOfChannels = 1\nElementSpacing = 1 1 1\nElementType = MET_UCHAR\n\
         Kinds = domain domain list\nOffset = 0 0 0\nTransformMatrix = 1 0 0 0 1 0 0 0 1\n\
         UltrasoundImageOrientation = MFA\nUltrasoundImageType = BRIGHTNESS\n",
        sector.width, sector.height
    );
    (before, behind)
}

/// Transform from pixels to the probe frame: linear part, mm per pixel, and offset, mm. Right in the image is the
/// probe's x, down is its z.
fn image_to_probe(sector: &Sector) -> (DMat3, DVec3) {
    let first = sector.pixel_centre_mm(0, 0);
    // Right-handed, like every transform that PLUS writes.
    let axes = DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y) * sector.pixel_mm;
    (axes, DVec3::new(first.x, 0.0, first.y))
}

/// Row-major 4 × 4 matrix as PLUS writes it: sixteen numbers.
fn row_by_row((linear, offset): &(DMat3, DVec3)) -> String {
    let mut text = String::new();
    for row in 0..3 {
        let [a, b, c] = linear.row(row).to_array();
        let _ = write!(text, "{a} {b} {c} {} ", offset[row]);
    }
    text + "0 0 0 1"
}
