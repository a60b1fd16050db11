//! Headers of NRRD files: their fields and key/value pairs, and the values of both.

use std::borrow::Cow;
use std::collections::HashMap;
use std::io::BufRead;

use glam::DVec3;

use super::super::VolumeFault;

/// Largest number of bytes of a header.
const MAX_BYTES: u64 = 64 << 20;

/// Content of a header.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Header {
    /// Values of the fields, by field names in lower case without spaces.
    fields: HashMap<String, String>,
    /// Key/value pairs, in the order of the file.
    pub pairs: Vec<(String, String)>,
    /// Assumptions in reading, one sentence each.
    pub remarks: Vec<String>,
}

/// Bytes of a header, including the blank line that ends it; all bytes if there is no blank line.
pub(super) fn header_bytes(stream: &mut impl BufRead) -> Result<Vec<u8>, VolumeFault> {
    let mut bytes = Vec::new();
    loop {
        let left = MAX_BYTES + 1 - bytes.len() as u64;
        let length = std::io::Read::take(&mut *stream, left).read_until(b'\n', &mut bytes)?;
        if bytes.len() as u64 > MAX_BYTES {
            let (what, found) = ("the size of the header in bytes", bytes.len() as u64);
            return Err(VolumeFault::TooLarge { what, found, limit: MAX_BYTES });
        }
        let line = &bytes[bytes.len() - length..];
        if matches!(line, [] | b"\n" | b"\r\n") {
            return Ok(bytes);
        }
    }
}

impl Header {
    /// Fields and pairs of a header.
    ///
    /// # Errors
    /// A first line that isn't `NRRD000` and a version; a line that is neither a comment, a field nor a pair; a field
    /// that occurs twice with different values.
    pub(super) fn parse(bytes: &[u8]) -> Result<Self, VolumeFault> {
        let mut remarks = Vec::new();
        let text = match std::str::from_utf8(bytes) {
            Ok(text) => Cow::Borrowed(text),
            // Older programs write names of segments in other encodings than UTF-8. They are read as Latin-1, in which
            // each byte is a character.
            Err(error) => {
                let byte = error.valid_up_to();
                remarks.push(format!("its header isn't UTF-8 (byte {byte}): names were read as Latin-1"));
                Cow::Owned(bytes.iter().copied().map(char::from).collect())
            }
        };
        let mut lines = text.lines().enumerate();
        let magic = lines.next().map_or("", |(_, line)| line);
        if !matches!(magic.trim_end(), "NRRD0001" | "NRRD0002" | "NRRD0003" | "NRRD0004" | "NRRD0005") {
            return Err(VolumeFault::Header(format!("the first line is `{magic}`; it must be NRRD0001 to NRRD0005")));
        }
        let mut header = Self { remarks, ..Self::default() };
        for (index, line) in lines {
            if line.starts_with('#') {
                continue;
            }
            if line.is_empty() {
                break;
            }
            match (line.find(": "), line.find(":=")) {
                (field, Some(pair)) if field.is_none_or(|field| pair < field) => {
                    header.pairs.push((unescaped(&line[..pair]), unescaped(&line[pair + 2..])));
                }
                (Some(field), _) => header.set(&line[..field], &line[field + 2..])?,
                // A field without a value.
                _ if line.ends_with(':') => header.set(&line[..line.len() - 1], "")?,
                _ => {
                    let reason = format!("line {} is `{line}`, neither `field: value` nor `key:=value`", index + 1);
                    return Err(VolumeFault::Header(reason));
                }
            }
        }
        Ok(header)
    }

    fn set(&mut self, field: &str, value: &str) -> Result<(), VolumeFault> {
        let value = value.trim();
        match self.fields.insert(field.to_ascii_lowercase().replace(' ', ""), value.to_owned()) {
            Some(earlier) if earlier != value => Err(VolumeFault::Header(format!(
                "the field `{field}` stands there twice, as `{earlier}` and as `{value}`; delete the wrong one"
            ))),
            _ => Ok(()),
        }
    }

    /// Value of the field called `name`.
    pub(super) fn field(&self, name: &str) -> Option<&str> {
        self.fields.get(&name.replace(' ', "")).map(String::as_str)
    }

    /// Value of a field that a file must have.
    pub(super) fn required(&self, name: &str) -> Result<&str, VolumeFault> {
        self.field(name).ok_or_else(|| VolumeFault::Header(format!("the field `{name}` is missing")))
    }

    /// A field's value as a number; `None` without the field.
    pub(super) fn number<T: std::str::FromStr>(&self, name: &str) -> Result<Option<T>, VolumeFault> {
        let number = |value: &str| value.parse().map_err(|_| bad(name, value, "a number"));
        self.field(name).map(number).transpose()
    }

    /// A field's value as numbers separated by spaces; `None` without the field.
    pub(super) fn numbers<T: std::str::FromStr>(&self, name: &str) -> Result<Option<Vec<T>>, VolumeFault> {
        let numbers = |value: &str| {
            value
                .split_whitespace()
                .map(|n| n.parse().map_err(|_| bad(name, value, "numbers with spaces between them")))
                .collect()
        };
        self.field(name).map(numbers).transpose()
    }

    /// A field's value as vectors of three numbers. The text `none`, or a vector of NaN, as some programs write, gives
    /// `None`.
    pub(super) fn vectors(&self, name: &str) -> Result<Option<Vec<Option<DVec3>>>, VolumeFault> {
        let expected = "vectors of three numbers, as (1,0,0), or `none` for an axis that isn't one of space";
        self.field(name).map(|value| vectors(value).ok_or_else(|| bad(name, value, expected))).transpose()
    }

    /// A field's value as words without quotes; `None` without the field.
    pub(super) fn words(&self, name: &str) -> Option<Vec<String>> {
        self.field(name).map(|value| value.split_whitespace().map(|word| word.trim_matches('"').to_owned()).collect())
    }
}

fn bad(name: &str, value: &str, expected: &str) -> VolumeFault {
    VolumeFault::Header(format!("`{name}: {value}` can't be read; it must be {expected}"))
}

fn vectors(mut text: &str) -> Option<Vec<Option<DVec3>>> {
    let mut vectors = Vec::new();
    loop {
        text = text.trim_start();
        if text.is_empty() {
            return Some(vectors);
        }
        if let Some(rest) = text.strip_prefix("none") {
            (text, _) = (rest, vectors.push(None));
            continue;
        }
        let (inside, rest) = text.strip_prefix('(')?.split_once(')')?;
        let numbers: Option<Vec<f64>> = inside.split(',').map(|number| number.trim().parse().ok()).collect();
        let vector = DVec3::from(<[f64; 3]>::try_from(numbers?).ok()?);
        let is_none = vector.to_array().iter().all(|number| number.is_nan());
        (text, _) = (rest, vectors.push((!is_none).then_some(vector)));
    }
}

/// `text` with escapes replaced by the line feeds and backslashes that they stand for.
fn unescaped(text: &str) -> String {
    let (mut out, mut chars) = (String::with_capacity(text.len()), text.chars().peekable());
    while let Some(c) = chars.next() {
        let next = if c == '\\' { chars.next_if(|next| matches!(next, 'n' | '\\')) } else { None };
        out.push(match next {
            Some('n') => '\n',
            _ => c,
        });
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_pairs_and_comments_are_told_apart() {
        let text = "NRRD0004\r\n# a comment: x\r\nDataFile: a: b.raw\r\nspace directions: none (1,0,0) (0, 1 ,0)(0,0,-2e1)\r\n\
                    Name:=a: b\\nc\\\\d\\q\r\nkey: odd:=no\r\ncontent:\r\n\r\nbytes";
        let header = Header::parse(text.as_bytes()).unwrap();
        assert_eq!(header.field("data file"), Some("a: b.raw"));
        assert_eq!(header.field("key"), Some("odd:=no"));
        assert_eq!(header.field("content"), Some(""));
        assert_eq!(header.pairs, [("Name".to_owned(), "a: b\nc\\d\\q".to_owned())]);
        let directions = header.vectors("space directions").unwrap().unwrap();
        assert_eq!(directions, [None, Some(DVec3::X), Some(DVec3::Y), Some(DVec3::Z * -20.0)]);
    }

    #[test]
    fn lines_that_are_nothing_are_named() {
        let error = Header::parse(b"NRRD0004\nwhat\n\n").unwrap_err().to_string();
        assert!(error.contains("line 2 is `what`"), "{error}");
        assert!(Header::parse(b"NRRD0009\n").unwrap_err().to_string().contains("`NRRD0009`"));
        let header = Header::parse(b"NRRD0005\nsizes: 3 x\nspace origin: (1,2)\n").unwrap();
        assert!(header.numbers::<u64>("sizes").unwrap_err().to_string().contains("`sizes: 3 x` can't be read"));
        assert!(header.vectors("space origin").is_err());
    }

    #[test]
    fn the_blank_line_ends_the_header() {
        let mut stream = &b"NRRD0004\ntype: uchar\n\n\n\x01"[..];
        assert_eq!(header_bytes(&mut stream).unwrap(), b"NRRD0004\ntype: uchar\n\n");
        assert_eq!(stream, b"\n\x01");
        let mut detached = &b"NRRD0004\r\ntype: uchar"[..];
        assert_eq!(header_bytes(&mut detached).unwrap(), b"NRRD0004\r\ntype: uchar");
    }
}
