//! MetaImage sequences (`.mha`, `.igs.mha`) as PLUS and SlicerIGSIO write them: a header of `Key = value` lines, then
//! pixels, raw or zlib. [`Sequence`] reads the header at once and the pixels image by image.
//!
//! The header's `Seq_FrameNNNN_KEY = value` lines belong to single images: a `Timestamp` in seconds, transforms
//! `AToBTransform` (sixteen numbers in row order: `b_from_a` in mm) and their `AToBTransformStatus` (`OK` or
//! `INVALID`).
//!
//! Source: <https://plustoolkit.github.io/docs> (Sequence metafile), <https://itk.org/Wiki/ITK/MetaIO/Documentation>.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use super::pixels::Pixels;
use super::{InterchangeError, Lines, Place, quote};

/// Most images of a sequence.
pub const IMAGES_MAX: u32 = 1_000_000;

/// Largest image, bytes.
pub const IMAGE_BYTES_MAX: u64 = 256 << 20;

/// Longest header, bytes.
const HEAD_BYTES_MAX: u64 = 2 << 30;

const FRAME_PREFIX: &str = "Seq_Frame";

/// A header value and its place in the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Field {
    /// Text behind the `=`, trimmed.
    pub value: String,
    /// Its line.
    pub place: Place,
}

/// Fields by key.
pub type Fields = BTreeMap<String, Field>;

/// Header of a sequence.
#[derive(Debug, Clone, PartialEq)]
pub struct Head {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Bytes of one image, uncompressed.
    pub image_bytes: usize,
    /// Whether the pixels are compressed by zlib.
    pub compressed: bool,
    /// Bytes of the compressed pixels, if the header gives them.
    pub compressed_bytes: Option<u64>,
    /// Whether the pixels follow the header; otherwise they are in a separate file.
    pub local: bool,
    /// Fields of the whole sequence.
    pub fields: Fields,
    /// Fields of each image, without `Seq_FrameNNNN_`.
    pub images: Vec<Fields>,
}

/// A sequence being read.
pub struct Sequence<R> {
    head: Head,
    pixels: Pixels<R>,
}

impl Sequence<BufReader<File>> {
    /// Opens the file at `path` and reads its header.
    ///
    /// # Errors
    /// As [`from_source`](Self::from_source), and a file that cannot be opened.
    pub fn open(path: &Path) -> Result<Self, InterchangeError> {
        match File::open(path) {
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
        let pixels = Pixels::new(lines.source, path, &head);
        Ok(Self { head, pixels })
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
        self.pixels.next_image(image)
    }
}

fn read_head(lines: &mut Lines<impl BufRead>) -> Result<Head, InterchangeError> {
    let path = lines.path.clone();
    let (mut fields, mut images) = (Fields::new(), BTreeMap::<u32, Fields>::new());
    loop {
        let Some((place, line)) = lines.next_line()? else {
            let reason = "it ends within its head, before `ElementDataFile`; is it a MetaImage (.mha) file?";
            return Err(InterchangeError::File { path, reason: reason.to_owned() });
        };
        if place.byte > HEAD_BYTES_MAX {
            return Err(place.error(&path, format!("its head is longer than {HEAD_BYTES_MAX} bytes")));
        }
        if line.trim().is_empty() {
            continue;
        }
        let Some((key, value)) = line.split_once('=') else {
            return Err(place.error(&path, format!("{} is no line of a MetaImage head, `Key = value`", quote(line))));
        };
        let (key, value) = (key.trim(), value.trim());
        let field = Field { value: value.to_owned(), place };
        let (target, name) = match key.strip_prefix(FRAME_PREFIX) {
            None => (&mut fields, key),
            Some(rest) => {
                let (number, name) = rest.split_once('_').unwrap_or((rest, ""));
                let number = number.parse().ok().filter(|n| *n < IMAGES_MAX);
                let Some(number) = number.filter(|_| !name.is_empty()) else {
                    let reason = format!("{} is no `Seq_FrameNNNN_KEY` below {IMAGES_MAX}", quote(key));
                    return Err(place.error(&path, reason));
                };
                (images.entry(number).or_default(), name)
            }
        };
        if let Some(earlier) = target.insert(name.to_owned(), field) {
            return Err(
                place.error(&path, format!("{} is there twice, first in line {}", quote(key), earlier.place.line))
            );
        }
        // The format makes this the last line of a header.
        if key == "ElementDataFile" {
            break;
        }
    }
    Keys { path: &path, fields: &fields }.head(images)
}

/// Parser of the fields of a whole sequence.
struct Keys<'a> {
    path: &'a Path,
    fields: &'a Fields,
}

impl Keys<'_> {
    fn head(&self, images: BTreeMap<u32, Fields>) -> Result<Head, InterchangeError> {
        let dims = self.need("NDims")?;
        let sizes = self.need("DimSize")?;
        let wanted = match dims.value.as_str() {
            "3" => 3,
            "4" => 4,
            other => return Err(self.wrong("NDims", dims, &format!("3 or 4, not {}", quote(other)))),
        };
        let numbers: Option<Vec<u32>> = sizes.value.split_whitespace().map(|n| n.parse().ok()).collect();
        let numbers = numbers.filter(|n| n.len() == wanted && n.iter().all(|&n| n > 0));
        let Some(numbers) = numbers else {
            return Err(self.wrong("DimSize", sizes, &format!("{wanted} whole numbers from 1")));
        };
        let (width, height, depth) = (numbers[0], numbers[1], if wanted == 4 { numbers[2] } else { 1 });
        let count = numbers[wanted - 1];
        if count > IMAGES_MAX {
            return Err(self.wrong("DimSize", sizes, &format!("of at most {IMAGES_MAX} images")));
        }
        let channels = self.number("ElementNumberOfChannels", 1)?;
        let bytes = [width, height, depth, channels]
            .into_iter()
            .map(u64::from)
            .try_fold(self.element_bytes()?, u64::checked_mul);
        let image_bytes = bytes.filter(|bytes| *bytes <= IMAGE_BYTES_MAX).and_then(|bytes| usize::try_from(bytes).ok());
        let Some(image_bytes) = image_bytes else {
            return Err(self.wrong("DimSize", sizes, &format!("of images of at most {IMAGE_BYTES_MAX} bytes")));
        };
        if !self.flag("BinaryData", true)? {
            return Err(self.wrong("BinaryData", self.need("BinaryData")?, "True: pixels as text are not read"));
        }
        let compressed = self.flag("CompressedData", false)?;
        let compressed_bytes = match self.fields.get("CompressedDataSize") {
            Some(field) if compressed => {
                Some(field.value.parse().map_err(|_| self.wrong("CompressedDataSize", field, "a whole number"))?)
            }
            _ => None,
        };
        let local = self.need("ElementDataFile")?.value.eq_ignore_ascii_case("LOCAL");
        let (found, last) = (images.len(), images.last_key_value().map(|(number, _)| *number));
        if found as u64 != u64::from(count) || last != Some(count - 1) {
            let reason = format!(
                "DimSize says {count} images, but there are `{FRAME_PREFIX}` fields of {found}{}",
                last.map_or_else(String::new, |last| format!(", the last of number {last}")),
            );
            return Err(sizes.place.error(self.path, reason));
        }
        Ok(Head {
            width,
            height,
            image_bytes,
            compressed,
            compressed_bytes,
            local,
            fields: self.fields.clone(),
            images: images.into_values().collect(),
        })
    }

    fn need(&self, key: &str) -> Result<&Field, InterchangeError> {
        let missing =
            || InterchangeError::File { path: self.path.to_owned(), reason: format!("its head has no `{key}`") };
        self.fields.get(key).ok_or_else(missing)
    }

    fn wrong(&self, key: &str, field: &Field, expected: &str) -> InterchangeError {
        field.place.error(self.path, format!("`{key}` is {}; it must be {expected}", quote(&field.value)))
    }

    fn number(&self, key: &str, default: u32) -> Result<u32, InterchangeError> {
        let Some(field) = self.fields.get(key) else { return Ok(default) };
        let number = field.value.parse().ok().filter(|n| *n > 0);
        number.ok_or_else(|| self.wrong(key, field, "a whole number from 1"))
    }

    fn flag(&self, key: &str, default: bool) -> Result<bool, InterchangeError> {
        let Some(field) = self.fields.get(key) else { return Ok(default) };
        match field.value.to_ascii_lowercase().as_str() {
            "true" => Ok(true),
            "false" => Ok(false),
            _ => Err(self.wrong(key, field, "True or False")),
        }
    }

    fn element_bytes(&self) -> Result<u64, InterchangeError> {
        let field = self.need("ElementType")?;
        match field.value.as_str() {
            "MET_CHAR" | "MET_UCHAR" => Ok(1),
            "MET_SHORT" | "MET_USHORT" => Ok(2),
            "MET_INT" | "MET_UINT" | "MET_FLOAT" => Ok(4),
            "MET_DOUBLE" => Ok(8),
            _ => Err(self.wrong("ElementType", field, "MET_UCHAR or another of 1, 2, 4 or 8 bytes")),
        }
    }
}

/// Name of the file with the pixels, if they don't follow the header.
pub(super) fn data_file(head: &Head) -> PathBuf {
    head.fields.get("ElementDataFile").map(|field| PathBuf::from(&field.value)).unwrap_or_default()
}
