//! Names of live sinks in station files and on the command line.

use std::collections::HashSet;
use std::str::FromStr;

use thiserror::Error;

use crate::suggest::did_you_mean;

/// A kind of live sink.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum LiveSinkKind {
    /// Shows nothing: for measurements.
    Null,
    /// One PNG per frame, with an index file.
    Png,
    /// An MP4 video.
    Video,
    /// The page in a browser.
    Browser,
    /// The native window.
    Window,
    /// The OpenIGTLink server.
    OpenIgtLink,
}

/// Unknown sink name.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error("unknown sink `{name}`{suggestion}; known: {known}")]
pub struct UnknownSink {
    /// Name looked up.
    pub name: String,
    /// Nearest known name, ready to print, or empty.
    pub suggestion: String,
    /// All names.
    pub known: String,
}

crate::names::named!(LiveSinkKind {
    Null = "null",
    Png = "png",
    Video = "video",
    Browser = "browser",
    Window = "window",
    OpenIgtLink = "openigtlink",
});

impl LiveSinkKind {
    /// `kinds` in the order of the enum, each once.
    pub fn each_once(mut kinds: Vec<Self>) -> Vec<Self> {
        let mut seen = HashSet::new();
        kinds.retain(|kind| seen.insert(*kind));
        kinds
    }

    /// File patterns that such a sink writes below the session's directory; a `*` stands for any characters.
    pub fn files(self) -> &'static [&'static str] {
        match self {
            Self::Png => &["png/index.jsonl", "png/*.png"],
            Self::Video => &["video.mp4", "video.part.mp4"],
            _ => &[],
        }
    }
}

impl FromStr for LiveSinkKind {
    type Err = UnknownSink;

    fn from_str(name: &str) -> Result<Self, UnknownSink> {
        Self::named(name).ok_or_else(|| UnknownSink {
            name: name.to_owned(),
            suggestion: did_you_mean(name, Self::NAMES.iter().copied()),
            known: Self::NAMES.join(", "),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_has_its_name_and_no_other_is_known() {
        for (kind, name) in LiveSinkKind::ALL.into_iter().zip(LiveSinkKind::NAMES) {
            assert_eq!((kind.name(), name.parse()), (*name, Ok(kind)));
        }
        let error = "vidoe".parse::<LiveSinkKind>().unwrap_err().to_string();
        assert!(error.contains("did you mean `video`"), "{error}");
    }
}
