//! Range of frames to replay.

use std::str::FromStr;

/// Frames of a recording: all by default.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct FrameRange {
    /// Index of the first frame.
    pub start: usize,
    /// End of the range, exclusive; none: all frames from `start`.
    pub end: Option<usize>,
}

impl FromStr for FrameRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |part: &str, absent| if part.is_empty() { Some(absent) } else { part.parse().ok().map(Some) };
        let parts = text.split_once("..").and_then(|(a, b)| Some((number(a, Some(0))?, number(b, None)?)));
        match parts {
            Some((start, end)) if end.is_none_or(|end| end > start.unwrap_or(0)) => {
                Ok(Self { start: start.unwrap_or(0), end })
            }
            _ => Err("expected a..b with a < b, a.. or ..b".to_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_understood() {
        let range = |text: &str| text.parse::<FrameRange>().map(|r| (r.start, r.end));
        assert_eq!(range("3..7"), Ok((3, Some(7))));
        assert_eq!(range("3.."), Ok((3, None)));
        assert_eq!(range("..7"), Ok((0, Some(7))));
        assert_eq!(range(".."), Ok((0, None)));
        for wrong in ["", "3", "7..3", "3..3", "..0", "a..b", "-1..3", "1...3"] {
            assert!(range(wrong).is_err(), "{wrong}");
        }
    }
}
