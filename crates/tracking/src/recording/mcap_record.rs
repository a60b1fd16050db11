//! MCAP records whose lengths are checked before memory is allocated.

use mcap::records::{Record, op};

/// Parses the content of a chunk, channel, message or metadata record.
///
/// The crate `mcap` allocates as much as a string's length field states, up to 4 GB, before it reads the string.
///
/// # Errors
/// A length that exceeds the record, or a malformed record.
pub(super) fn parse(opcode: u8, data: &[u8]) -> Result<Record<'_>, String> {
    let mut rest = Lengths { data, offset: 0 };
    match opcode {
        // Skipped: times of the first and the last message, size, CRC. Compression is a string; the records follow.
        op::CHUNK => rest.skip(28)?.string()?,
        // Skipped: numbers of channel and schema. Topic and encoding are strings; the metadata follow.
        op::CHANNEL => rest.skip(4)?.string()?.string()?.map()?,
        // The name is a string; the metadata follow.
        op::METADATA => rest.string()?.map()?,
        _ => &mut rest,
    };
    mcap::parse_record(opcode, data).map_err(|error| error.to_string())
}

/// Remaining content of a record, from `offset` on.
struct Lengths<'a> {
    data: &'a [u8],
    offset: usize,
}

impl Lengths<'_> {
    fn skip(&mut self, bytes: usize) -> Result<&mut Self, String> {
        let left = self.data.len() - self.offset;
        if bytes > left {
            return Err(format!(
                "{bytes} bytes are announced at byte {} of its content, and {left} follow",
                self.offset
            ));
        }
        self.offset += bytes;
        Ok(self)
    }

    fn length(&mut self) -> Result<usize, String> {
        let start = self.offset;
        self.skip(4)?;
        let mut bytes = [0; 4];
        bytes.copy_from_slice(&self.data[start..self.offset]);
        usize::try_from(u32::from_le_bytes(bytes)).map_err(|error| error.to_string())
    }

    fn string(&mut self) -> Result<&mut Self, String> {
        let length = self.length()?;
        self.skip(length)
    }

    /// Skips pairs of strings, which are preceded by their length in bytes.
    fn map(&mut self) -> Result<&mut Self, String> {
        let length = self.length()?;
        let end = self.offset + length;
        while self.offset < end {
            self.string()?;
        }
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn string(length: u32, text: &str) -> Vec<u8> {
        [&length.to_le_bytes()[..], text.as_bytes()].concat()
    }

    #[test]
    fn lengths_beyond_the_record_are_refused() {
        let channel = |length, map: &[u8]| [&[1, 0, 0, 0][..], &string(length, "/raw"), &string(0, ""), map].concat();
        let one = [&16_u32.to_le_bytes()[..], &string(4, "left"), &string(4, "over")].concat();
        assert!(
            matches!(parse(op::CHANNEL, &channel(4, &one)), Ok(Record::Channel(c)) if c.metadata["left"] == "over")
        );
        let said = parse(op::CHANNEL, &channel(0xF900_0000, &one)).unwrap_err();
        assert_eq!(said, "4177526784 bytes are announced at byte 8 of its content, and 28 follow");
        let long = [&16_u32.to_le_bytes()[..], &string(4, "left"), &string(0xEE00_0000, "over")].concat();
        assert!(parse(op::CHANNEL, &channel(4, &long)).unwrap_err().starts_with("3992977408 bytes"));
        let metadata = [string(4, "name"), string(u32::MAX, "")].concat();
        assert!(parse(op::METADATA, &metadata).unwrap_err().contains("0 follow"));
        let chunk = [&[0; 28][..], &string(0xEE00_0000, ""), &[0; 8]].concat();
        assert!(parse(op::CHUNK, &chunk).unwrap_err().starts_with("3992977408 bytes"));
        assert!(parse(op::CHUNK, &[0; 20]).unwrap_err().starts_with("28 bytes"));
    }
}
