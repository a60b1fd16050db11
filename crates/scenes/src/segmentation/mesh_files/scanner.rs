//! Reading bytes, numbers and words of a file.

use super::super::numbers::{Number, Order};
use super::error::Fault;

/// Reading position in the bytes of a file.
#[derive(Debug, Clone)]
pub(super) struct Scanner<'b> {
    pub(super) bytes: &'b [u8],
    pub(super) at: usize,
    /// Last byte of a line end: a carriage return if the first line ends in a carriage return alone, else a line feed.
    line_end: u8,
}

impl<'b> Scanner<'b> {
    pub(super) fn new(bytes: &'b [u8]) -> Self {
        Self::from(bytes, 0)
    }

    /// A scanner that starts at byte `at`.
    pub(super) fn from(bytes: &'b [u8], at: usize) -> Self {
        let first = bytes.iter().position(|b| matches!(b, b'\n' | b'\r'));
        let is_bare = first.is_some_and(|end| bytes[end] == b'\r' && bytes.get(end + 1) != Some(&b'\n'));
        Self { bytes, at, line_end: if is_bare { b'\r' } else { b'\n' } }
    }

    /// Number of the current line, from 1.
    pub(super) fn line_number(&self) -> usize {
        1 + self.bytes[..self.at.min(self.bytes.len())].iter().filter(|b| **b == self.line_end).count()
    }

    /// A fault in the current line.
    pub(super) fn fault(&self, reason: impl Into<String>) -> Fault {
        Fault::line(self.line_number(), reason)
    }

    /// The next line without its end; `None` at the end of the file.
    pub(super) fn line(&mut self) -> Option<&'b [u8]> {
        let rest = self.bytes.get(self.at..).filter(|rest| !rest.is_empty())?;
        let end = rest.iter().position(|b| *b == self.line_end);
        self.at += end.map_or(rest.len(), |end| end + 1);
        let line = &rest[..end.unwrap_or(rest.len())];
        Some(line.strip_suffix(b"\r").unwrap_or(line))
    }

    /// The next word; `None` at the end of the file.
    pub(super) fn word(&mut self) -> Option<&'b [u8]> {
        let rest = self.bytes.get(self.at..)?;
        let start = rest.iter().position(|b| !b.is_ascii_whitespace())?;
        let end = rest[start..].iter().position(u8::is_ascii_whitespace).map_or(rest.len(), |end| start + end);
        self.at += end;
        Some(&rest[start..end])
    }

    /// The next word, without a change of position.
    pub(super) fn peek(&self) -> Option<&'b [u8]> {
        self.clone().word()
    }

    /// The next word as a finite number. `what` names it in the error.
    pub(super) fn number(&mut self, what: &str) -> Result<f64, Fault> {
        match self.word() {
            None => Err(self.fault(format!("the file ends where {what} should be: it is truncated"))),
            Some(word) => {
                finite(word).ok_or_else(|| self.fault(format!("{}; there should be {what}", not_a_number(word))))
            }
        }
    }

    /// The next word as an index or a count. `what` names it in the error.
    pub(super) fn count(&mut self, what: &str) -> Result<usize, Fault> {
        match self.word() {
            None => Err(self.fault(format!("the file ends where {what} should be: it is truncated"))),
            Some(word) => str::from_utf8(word)
                .ok()
                .and_then(|word| word.parse().ok())
                .ok_or_else(|| self.fault(format!("`{}` is not a count; there should be {what}", text(word)))),
        }
    }

    /// The next `length` bytes. `what` names them in the error.
    pub(super) fn take(&mut self, length: usize, what: &str) -> Result<&'b [u8], Fault> {
        let end = self.at.checked_add(length).filter(|end| *end <= self.bytes.len());
        let Some(end) = end else {
            let left = self.bytes.len() - self.at.min(self.bytes.len());
            return Err(Fault::byte(self.at, format!("truncated: {what} take {length} bytes, {left} are left")));
        };
        let taken = &self.bytes[self.at..end];
        self.at = end;
        Ok(taken)
    }

    /// The next `count` numbers of one type. `what` names them in the error.
    pub(super) fn numbers(
        &mut self,
        count: usize,
        number: Number,
        order: Order,
        what: &str,
    ) -> Result<Vec<f64>, Fault> {
        let bytes = self.take(count.saturating_mul(number.size()), what)?;
        Ok(bytes.chunks_exact(number.size()).map(|value| number.read(value, order)).collect())
    }
}

/// Lines of a text, each with its number from 1. A line ends in a line feed, a carriage return, or both.
pub(super) fn lines(bytes: &[u8]) -> impl Iterator<Item = (usize, &[u8])> {
    let mut rest = Some(bytes);
    let line = move || {
        let text = rest?;
        let end = text.iter().position(|b| matches!(b, b'\n' | b'\r'));
        let Some(end) = end else {
            rest = None;
            return Some(text);
        };
        let size = if text[end..].starts_with(b"\r\n") { 2 } else { 1 };
        rest = Some(&text[end + size..]);
        Some(&text[..end])
    };
    (1..).zip(std::iter::from_fn(line))
}

/// Message about a word that is not a finite number.
pub(super) fn not_a_number(word: &[u8]) -> String {
    not_a("number", word)
}

/// Message about a word that should be a finite number. `what` names the expected value, such as `coordinate of a
/// vertex`. If the word has a decimal comma, the message says so.
pub(super) fn not_a(what: &str, word: &[u8]) -> String {
    let with_point: Vec<u8> = word.iter().map(|b| if *b == b',' { b'.' } else { *b }).collect();
    let has_comma = word.iter().filter(|b| **b == b',').count() == 1 && !word.ends_with(b",");
    if has_comma && finite(&with_point).is_some() {
        let word = text(word);
        return format!("`{word}` has a decimal comma; export the mesh with decimal points (English number format)");
    }
    format!("`{}` is not a {what}", text(word))
}

/// A word as a finite number; `None` for other words.
pub(super) fn finite(word: &[u8]) -> Option<f64> {
    str::from_utf8(word).ok()?.parse().ok().filter(|value: &f64| value.is_finite())
}

/// A word as text for a message: its first 40 characters.
pub(super) fn text(word: &[u8]) -> String {
    String::from_utf8_lossy(word).chars().take(40).collect()
}

/// A number as an index below `length`; `None` for fractions and numbers out of range.
pub(super) fn index(value: f64, length: usize) -> Option<u32> {
    (value >= 0.0 && value.fract() == 0.0 && value < length as f64 && value < f64::from(u32::MAX))
        .then_some(value as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_lines_and_numbers_are_read_in_order() {
        let mut scanner = Scanner::new(b"one 2\r\nthree\n\x01\x02\x03");
        assert_eq!((scanner.word(), scanner.count("two").unwrap()), (Some(&b"one"[..]), 2));
        assert_eq!((scanner.line(), scanner.line()), (Some(&b""[..]), Some(&b"three"[..])));
        assert_eq!(scanner.numbers(1, Number::U16, Order::Big, "numbers").unwrap(), [258.0]);
        let fault = scanner.take(2, "numbers").unwrap_err();
        assert_eq!(fault.reason, "truncated: numbers take 2 bytes, 1 are left");
        assert!(index(3.0, 3).is_none() && index(-1.0, 3).is_none() && index(0.5, 3).is_none());
        assert!(finite(b"nan").is_none() && finite(b"-1e3") == Some(-1000.0));
    }

    #[test]
    fn lines_end_in_any_of_the_three_ways() {
        let all: Vec<_> = lines(b"a\nb\r\nc\rd\r\re").collect();
        let expected: [(usize, &[u8]); 6] = [(1, b"a"), (2, b"b"), (3, b"c"), (4, b"d"), (5, b""), (6, b"e")];
        assert_eq!(all, expected);
        let mut bare = Scanner::new(b"ply\rend\r\n1");
        assert_eq!((bare.line(), bare.line(), bare.line_number()), (Some(&b"ply"[..]), Some(&b"end"[..]), 3));
        assert_eq!(bare.bytes[bare.at..], *b"\n1", "data of a binary file may begin with a line feed");
    }

    #[test]
    fn decimal_commas_are_named() {
        assert!(not_a_number(b"1,5").contains("decimal comma"));
        assert_eq!(not_a_number(b"1,5,2"), "`1,5,2` is not a number");
        assert_eq!(not_a_number(b"5,"), "`5,` is not a number");
    }
}
