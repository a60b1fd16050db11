//! Metadata of version 2 messages: whether a transform is valid.
//!
//! PLUS sends tools that are out of view as identities with `TransformStatus` or `TransformValid`, unless
//! `SendValidTransformsOnly` is set.

use super::{NAME_LENGTH, Reason};

/// Length of an entry in the metadata's header: key length, encoding, value length.
const ENTRY: usize = 8;

/// Values of `Status` that mean there is no pose (PLUS `ToolStatus`).
const INVALID: [&str; 9] = [
    "INVALID",
    "MISSING",
    "OUT_OF_VIEW",
    "OUT_OF_VOLUME",
    "TOOL_OUT_OF_VIEW",
    "TOOL_MISSING",
    "TOOL_INVALID",
    "UNKNOWN",
    "TOOL_UNKNOWN",
];

/// Suffixes of keys that state whether a transform is valid. The name of the transform, or nothing, precedes them.
const VALID: &str = "TransformValid";
const STATUS: &str = "TransformStatus";

/// Keys and values of a message.
#[derive(Debug, Clone, Copy)]
pub(super) struct Metadata<'a> {
    header: &'a [u8],
    text: &'a [u8],
}

impl<'a> Metadata<'a> {
    /// Metadata with the entries' lengths in `header` and their keys and values in `text`.
    ///
    /// # Errors
    /// The lengths of the entries do not add up.
    pub(super) fn new(header: &'a [u8], text: &'a [u8]) -> Result<Self, Reason> {
        let metadata = Self { header, text };
        let wrong = || Reason::Metadata { header: header.len(), text: text.len() };
        if header.is_empty() && text.is_empty() {
            return Ok(metadata);
        }
        let count = header.get(..2).map(|b| usize::from(u16::from_be_bytes([b[0], b[1]]))).ok_or_else(wrong)?;
        let lengths = metadata.lengths().map(|(key, value)| key as u64 + value as u64);
        let fits = header.len() == 2 + count * ENTRY && lengths.sum::<u64>() == text.len() as u64;
        if fits { Ok(metadata) } else { Err(wrong()) }
    }

    /// Lengths of keys and values.
    fn lengths(self) -> impl Iterator<Item = (usize, usize)> + 'a {
        self.header.get(2..).unwrap_or_default().chunks_exact(ENTRY).map(|entry| {
            let key = u16::from_be_bytes([entry[0], entry[1]]);
            let value = u32::from_be_bytes([entry[4], entry[5], entry[6], entry[7]]);
            (usize::from(key), value as usize)
        })
    }

    /// Keys and values.
    fn entries(self) -> impl Iterator<Item = (&'a [u8], &'a [u8])> {
        let mut rest = self.text;
        self.lengths().map(move |(key, value)| {
            let (key, after) = rest.split_at_checked(key).unwrap_or_default();
            let (value, after) = after.split_at_checked(value).unwrap_or_default();
            rest = after;
            (key, value)
        })
    }

    /// Whether the message marks the transform of `tool` as valid; true if it says nothing about it.
    pub(super) fn is_valid(self, tool: &str) -> bool {
        self.entries().all(|(key, value)| {
            let (Ok(key), Ok(value)) = (std::str::from_utf8(key), std::str::from_utf8(value)) else { return true };
            let value = value.trim_matches(['\0', ' ']);
            // A key contains the complete name; `tool` may be only its first bytes.
            let is_tool = |of: &str| of == tool || (tool.len() == NAME_LENGTH && of.starts_with(tool));
            let is_of_tool = |suffix: &str| key.strip_suffix(suffix).is_some_and(|of| of.is_empty() || is_tool(of));
            if is_of_tool(VALID) {
                return !["false", "0", "no"].iter().any(|no| value.eq_ignore_ascii_case(no));
            }
            if is_of_tool(STATUS) {
                return value.eq_ignore_ascii_case("OK") || value.eq_ignore_ascii_case("TOOL_OK");
            }
            key != "Status" || !INVALID.iter().any(|invalid| value.eq_ignore_ascii_case(invalid))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_valid(entries: &[(&str, &str)]) -> bool {
        is_valid_of("ProbeToTracker", entries)
    }

    fn is_valid_of(tool: &str, entries: &[(&str, &str)]) -> bool {
        let mut header = (entries.len() as u16).to_be_bytes().to_vec();
        let mut text = Vec::new();
        for (key, value) in entries {
            header.extend((key.len() as u16).to_be_bytes());
            header.extend(3_u16.to_be_bytes());
            header.extend((value.len() as u32).to_be_bytes());
            text.extend([key.as_bytes(), value.as_bytes()].concat());
        }
        Metadata::new(&header, &text).unwrap().is_valid(tool)
    }

    #[test]
    fn validity_is_read_from_the_keys_of_plus() {
        assert!(is_valid(&[]) && is_valid(&[("TransformStatus", "OK"), ("TransformValid", "True")]));
        for status in ["INVALID", "OUT_OF_VIEW", "MISSING", "UNKNOWN", ""] {
            assert!(!is_valid(&[("Frame", "7"), ("TransformStatus", status)]), "{status}");
        }
        assert!(!is_valid(&[("TransformValid", "False")]) && !is_valid(&[("TransformValid", "0")]));
        assert!(!is_valid(&[("Status", "OUT_OF_VIEW")]) && is_valid(&[("Status", "RUNNING"), ("Color", "INVALID")]));
        // If a message has several tools, each has its own key.
        assert!(!is_valid(&[("ProbeToTrackerTransformStatus", "INVALID")]));
        assert!(is_valid(&[("StylusToTrackerTransformStatus", "INVALID")]));
    }

    #[test]
    fn keys_with_a_long_name_are_those_of_the_name_as_far_as_the_wire_holds_it() {
        let long = "ProbeToTrackerOfPatient";
        let is_valid_by = |name: &str| {
            let key = format!("{name}TransformStatus");
            is_valid_of(&long[..20], &[(key.as_str(), "INVALID")])
        };
        assert!(!is_valid_by(long) && !is_valid_by(&long[..20]) && !is_valid_by(""));
        assert!(is_valid_by("ProbeToTracker") && is_valid_by("StylusToTrackerOfPatient"));
        // A name that was not truncated is compared as a whole.
        assert!(is_valid(&[("ProbeToTrackerOfPatientTransformValid", "False")]));
    }

    #[test]
    fn lengths_that_do_not_add_up_are_refused() {
        for (header, text) in [(&[0][..], &b""[..]), (&[0, 1], b""), (&[0, 0, 0], b""), (&[0, 0], b"x"), (&[], b"x")] {
            assert!(Metadata::new(header, text).is_err(), "{header:?}");
        }
        let header = [0, 1, 0, 1, 0, 3, 0, 0, 0, 9];
        assert!(Metadata::new(&header, b"avv").is_err());
    }
}
