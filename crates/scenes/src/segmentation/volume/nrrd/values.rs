//! Stored values of NRRD files, by encoding and type.

use insonify_core::files::memory_for;

use super::super::super::numbers::Number;
use super::super::VolumeFault;
use super::super::samples::Samples;
use super::super::source::{MAX_BYTES, Source, room_for, within};
use super::header::Header;

/// Reads `count` values from `source`, which starts at the data.
///
/// # Errors
/// An encoding or type that isn't read; missing or surplus bytes.
pub(super) fn read(header: &Header, count: u64, mut source: Source<'_>) -> Result<Samples, VolumeFault> {
    let kind = sample_type(header.required("type")?)?;
    let expected = count * kind.size() as u64;
    within(expected, MAX_BYTES, "the size of the voxels in bytes")?;
    room_for(count, kind.size() as u64)?;
    let line_skip: u64 = header.number("line skip")?.unwrap_or(0);
    let byte_skip: i64 = header.number("byte skip")?.unwrap_or(0);
    if byte_skip < -1 {
        return Err(VolumeFault::Header(format!("`byte skip: {byte_skip}` must be at least -1")));
    }
    within(byte_skip.max(0).unsigned_abs(), MAX_BYTES, "`byte skip`")?;
    let encoding = header.required("encoding")?.to_ascii_lowercase();
    let is_text = matches!(encoding.as_str(), "ascii" | "text" | "txt");
    let big_endian = if is_text { false } else { big_endian(header, kind)? };
    source.skip_lines(line_skip)?;
    let bytes = match encoding.as_str() {
        "raw" => {
            let left = source.left().unwrap_or(0);
            // A byte skip of −1 means that the data are the last bytes of the file.
            let skip = if byte_skip == -1 { left.saturating_sub(expected) } else { byte_skip.unsigned_abs() };
            source.skip(skip, "the bytes to skip")?;
            take(&mut source, expected)?
        }
        "gzip" | "gz" if byte_skip >= 0 => {
            let mut inflated = source.into_gzip();
            inflated.skip(byte_skip.unsigned_abs(), "the bytes to skip")?;
            take(&mut inflated, expected)?
        }
        "gzip" | "gz" => {
            return Err(VolumeFault::Header("`byte skip: -1` is defined for `encoding: raw` alone".to_owned()));
        }
        _ if is_text => {
            source.skip(byte_skip.max(0).unsigned_abs(), "the bytes to skip")?;
            // Text and decoded numbers are in memory at the same time.
            memory_for(source.left().unwrap_or(0).saturating_add(count.saturating_mul(8)))?;
            let text = source.rest(MAX_BYTES, "the size of the text data in bytes")?;
            return text_values(&text, count, kind);
        }
        "hex" | "bzip2" | "bz2" => {
            let what = format!("`encoding: {encoding}`");
            return Err(VolumeFault::Unsupported { what, remedy: "save the file with raw or gzip encoding" });
        }
        _ => return Err(VolumeFault::Header(format!("`encoding: {encoding}` isn't known; raw, gzip and text are"))),
    };
    Ok(Samples { kind, big_endian, bytes, scale: None })
}

/// Reads exactly `expected` bytes. Further bytes are an error.
fn take(source: &mut Source<'_>, expected: u64) -> Result<Vec<u8>, VolumeFault> {
    let bytes = source.take(expected, "the voxels")?;
    if source.has_more()? { Err(VolumeFault::Surplus { expected }) } else { Ok(bytes) }
}

fn big_endian(header: &Header, kind: Number) -> Result<bool, VolumeFault> {
    match header.field("endian").map(str::to_ascii_lowercase).as_deref() {
        Some("little") => Ok(false),
        Some("big") => Ok(true),
        None if kind.size() == 1 => Ok(false),
        None => Err(VolumeFault::Header("the field `endian` is missing, and values take several bytes".to_owned())),
        Some(other) => Err(VolumeFault::Header(format!("`endian: {other}` must be little or big"))),
    }
}

fn sample_type(name: &str) -> Result<Number, VolumeFault> {
    Ok(match name.to_ascii_lowercase().as_str() {
        "signed char" | "int8" | "int8_t" => Number::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => Number::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => Number::I16,
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => Number::U16,
        "int" | "signed int" | "int32" | "int32_t" => Number::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => Number::U32,
        "longlong"
        | "long long"
        | "long long int"
        | "signed long long"
        | "signed long long int"
        | "int64"
        | "int64_t" => Number::I64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => Number::U64,
        "float" => Number::F32,
        "double" => Number::F64,
        "block" => {
            let remedy = "save the volume as integers, or as 32-bit floats";
            return Err(VolumeFault::Unsupported { what: "`type: block`".to_owned(), remedy });
        }
        _ => return Err(VolumeFault::Header(format!("`type: {name}` isn't a type of NRRD"))),
    })
}

/// Numbers separated by spaces, commas or line ends, as 64-bit integers or floats.
fn text_values(bytes: &[u8], count: u64, kind: Number) -> Result<Samples, VolumeFault> {
    let name = if kind.is_float() { "float" } else { "integer" };
    let words = bytes.split(|byte| byte.is_ascii_whitespace() || *byte == b',').filter(|word| !word.is_empty());
    let mut values = Vec::new();
    for (index, word) in words.enumerate() {
        if index as u64 == count {
            return Err(VolumeFault::Header(format!("the text data has more values than the {count} of `sizes`")));
        }
        let text = String::from_utf8_lossy(word);
        let fault = || VolumeFault::Text { index, text: text.chars().take(40).collect(), kind: name };
        values.extend(if kind.is_float() {
            text.parse::<f64>().map_err(|_| fault())?.to_le_bytes()
        } else {
            text.parse::<i64>().map_err(|_| fault())?.to_le_bytes()
        });
    }
    let found = (values.len() / 8) as u64;
    if found < count {
        return Err(VolumeFault::Header(format!("the text data has {found} values, and `sizes` make {count}")));
    }
    let kind = if kind.is_float() { Number::F64 } else { Number::I64 };
    Ok(Samples { kind, big_endian: false, bytes: values, scale: None })
}
