//! MetaImage sequences (`.mha`, `.igs.mha`) as PLUS and SlicerIGSIO write them: a header of `Key = value` lines, then
//! pixels, raw or zlib, which are not read.
//!
//! The header's `Seq_FrameNNNN_KEY = value` lines belong to single images. The keys are a `Timestamp` in seconds,
//! transforms `AToBTransform` (sixteen numbers in row order: `b_from_a` in mm), and `AToBTransformStatus` (`OK` or
//! `INVALID`).
//!
//! Source: <https://plustoolkit.github.io/docs> (Sequence metafile), <https://itk.org/Wiki/ITK/MetaIO/Documentation>.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::path::Path;

use insonify_core::files::{self, FileError, FileKind};
use insonify_core::pose::table::quote;

use super::{InterchangeError, LinePosition, Lines};

/// Largest number of images of a sequence.
pub(crate) const IMAGES_MAX: u32 = 1_000_000;

/// Largest image, bytes.
pub(crate) const IMAGE_BYTES_MAX: u64 = 256 << 20;

/// Longest header, bytes: for example 500,000 images of 500 bytes each. All its fields are kept in memory.
const HEAD_BYTES_MAX: u64 = 256 << 20;

const FRAME_PREFIX: &str = "Seq_Frame";

/// A header value and its position in the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Field {
    /// Text after the `=`, trimmed.
    pub value: String,
    /// Position of its line in the file.
    pub position: LinePosition,
}

/// Fields of one image or of the header, by key.
pub type Fields = BTreeMap<String, Field>;

/// Header of a sequence.
#[derive(Debug, Clone, PartialEq)]
pub struct Head {
    /// Number of pixel columns.
    pub width: u32,
    /// Number of pixel rows.
    pub height: u32,
    /// Fields of each image, without `Seq_FrameNNNN_`.
    pub images: Vec<Fields>,
}

/// Reads the header of the sequence at `path`.
///
/// # Errors
/// The file cannot be opened, or an error of [`read`].
pub fn open(path: &Path) -> Result<Head, InterchangeError> {
    let file = files::open(path, FileKind::Sequence).map_err(FileError::at("read", path))?;
    read(BufReader::new(file), path)
}

/// Reads the header of a sequence up to its last line; errors name it `path`.
///
/// # Errors
/// The source cannot be read; a line is not `Key = value`; a key is missing, repeated or has a wrong value; the number
/// of images differs from the header's.
pub fn read(source: impl BufRead, path: &Path) -> Result<Head, InterchangeError> {
    let mut lines = Lines::new(source, path);
    let (mut fields, mut images) = (Fields::new(), BTreeMap::<u32, Fields>::new());
    loop {
        let Some((position, line)) = lines.next_line()? else {
            let reason = "it ends within its head, before `ElementDataFile`; is it a MetaImage (.mha) file?";
            return Err(InterchangeError::file(path, reason));
        };
        if position.byte > HEAD_BYTES_MAX {
            return Err(position.error(path, format!("its head is longer than {HEAD_BYTES_MAX} bytes")));
        }
        if line.trim().is_empty() {
            continue;
        }
        let Some((key, value)) = line.split_once('=') else {
            return Err(position.error(path, format!("{} is no line of a MetaImage head, `Key = value`", quote(line))));
        };
        let (key, value) = (key.trim(), value.trim());
        let field = Field { value: value.to_owned(), position };
        let (target, name) = match key.strip_prefix(FRAME_PREFIX) {
            None => (&mut fields, key),
            Some(rest) => {
                let (number, name) = rest.split_once('_').unwrap_or((rest, ""));
                let number = number.parse().ok().filter(|n| *n < IMAGES_MAX);
                let Some(number) = number.filter(|_| !name.is_empty()) else {
                    let reason = format!("{} is no `Seq_FrameNNNN_KEY` below {IMAGES_MAX}", quote(key));
                    return Err(position.error(path, reason));
                };
                (images.entry(number).or_default(), name)
            }
        };
        if let Some(earlier) = target.insert(name.to_owned(), field) {
            return Err(
                position.error(path, format!("{} is there twice, first in line {}", quote(key), earlier.position.line))
            );
        }
        // By the format, this key is in the last line of the header.
        if key == "ElementDataFile" {
            break;
        }
    }
    Keys { path, fields: &fields }.head(images)
}

/// The header's fields, with errors that name the file.
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
        if bytes.is_none_or(|bytes| bytes > IMAGE_BYTES_MAX) {
            return Err(self.wrong("DimSize", sizes, &format!("of images of at most {IMAGE_BYTES_MAX} bytes")));
        }
        if !self.flag("BinaryData", true)? {
            return Err(self.wrong("BinaryData", self.need("BinaryData")?, "True: pixels as text are not read"));
        }
        self.flag("CompressedData", false)?;
        self.need("ElementDataFile")?;
        let (found, last) = (images.len(), images.last_key_value().map(|(number, _)| *number));
        if found as u64 != u64::from(count) || last != Some(count - 1) {
            let reason = format!(
                "DimSize says {count} images, but there are `{FRAME_PREFIX}` fields of {found}{}",
                last.map_or_else(String::new, |last| format!(", the last of number {last}")),
            );
            return Err(sizes.position.error(self.path, reason));
        }
        Ok(Head { width, height, images: images.into_values().collect() })
    }

    fn need(&self, key: &str) -> Result<&Field, InterchangeError> {
        let missing = || InterchangeError::file(self.path, format!("its head has no `{key}`"));
        self.fields.get(key).ok_or_else(missing)
    }

    fn wrong(&self, key: &str, field: &Field, expected: &str) -> InterchangeError {
        field.position.error(self.path, format!("`{key}` is {}; it must be {expected}", quote(&field.value)))
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
