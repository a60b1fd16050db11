//! Marks that a watcher puts on a picture: measurements, texts and body marks.
//!
//! Points are (x, z) in the probe frame, mm: x to the right from the image's middle line, z down from the centre of the
//! probe's face.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Largest number of characters of a text on a picture.
pub const TEXT_CHARS_MAX: usize = 60;

/// Largest number of characters of the name of a measurement or a body mark.
pub const NAME_CHARS_MAX: usize = 24;

/// Largest number of characters of an identifier.
pub const ID_CHARS_MAX: usize = 32;

/// Largest number of marks that one request removes.
pub const REMOVED_MAX: usize = 64;

/// Largest magnitude of a coordinate, mm.
pub const COORDINATE_LIMIT_MM: f64 = 1e4;

/// A mark on the picture of one frame. A later mark with the same identifier replaces it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mark {
    /// Identifier of the mark: letters, digits and `-`.
    pub id: String,
    /// Number of the marked frame.
    pub frame: u64,
    /// Time at which the frame's pose was sampled, ms since the start of the session.
    pub sampled_ms: f64,
    /// `scene_from_probe` of the frame: x, y, z in mm, qw, qx, qy, qz; `None` if it had no pose.
    pub pose: Option<[f64; 7]>,
    /// Content of the mark.
    pub content: MarkContent,
}

/// Content of a mark.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum MarkContent {
    /// Distance between two points.
    Distance {
        /// Name of the measure, for example `BPD`; may be empty.
        measure: String,
        /// Both ends of the distance, mm.
        points_mm: [[f64; 2]; 2],
    },
    /// Ellipse, given by the ends of its axes.
    Ellipse {
        /// Name of the measure, for example `HC`; may be empty.
        measure: String,
        /// Both ends of the first axis, then of the second, mm.
        points_mm: [[f64; 2]; 4],
    },
    /// Angle between two lines.
    Angle {
        /// Name of the measure; may be empty.
        measure: String,
        /// End of the first line, corner, end of the second line; mm.
        points_mm: [[f64; 2]; 3],
    },
    /// Text on the picture.
    Text {
        /// The text.
        text: String,
        /// Position of the text's left end, mm.
        at_mm: [f64; 2],
    },
    /// Small outline of a body with a symbol of the probe on it.
    BodyMark {
        /// Name of the outline; empty for no body mark.
        name: String,
        /// Angle by which the probe is turned on the outline, degrees.
        turn_deg: f64,
    },
}

/// Faults of a mark.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum MarkError {
    /// An identifier in an invalid form.
    #[error("a mark's id is `{found}`; it must be 1 to {ID_CHARS_MAX} letters, digits and `-`")]
    Id {
        /// Identifier found, without control characters.
        found: String,
    },
    /// A number that is not finite, or beyond its limit.
    #[error("`{key}` of a mark is {found}; it must be within ±{limit}")]
    Number {
        /// Key of the number.
        key: &'static str,
        /// Number found.
        found: f64,
        /// Largest accepted magnitude.
        limit: f64,
    },
    /// A text that is too long.
    #[error("`{key}` of a mark has {found} characters; it may have {most}")]
    Long {
        /// Key of the text.
        key: &'static str,
        /// Number of characters found.
        found: usize,
        /// Largest accepted number of characters.
        most: usize,
    },
    /// A text without a visible character.
    #[error("the text of a mark is empty")]
    Empty,
    /// Too many marks to remove at once.
    #[error("{found} marks are to be removed at once; {REMOVED_MAX} may be")]
    Many {
        /// Number of marks to remove.
        found: usize,
    },
}

impl Mark {
    /// Checks the mark; returns it with texts trimmed and free of control characters.
    ///
    /// # Errors
    /// An identifier, a number or a text outside its limits.
    pub fn checked(self) -> Result<Self, MarkError> {
        check_id(&self.id)?;
        // The limit is one year.
        check("sampled_ms", self.sampled_ms, 3.2e10)?;
        self.pose.iter().flatten().try_for_each(|&x| check("pose", x, 1e6))?;
        Ok(Self { content: self.content.checked()?, ..self })
    }
}

impl MarkContent {
    /// Checks the content; returns it with texts trimmed and free of control characters.
    ///
    /// # Errors
    /// A number or a text outside its limits.
    pub fn checked(mut self) -> Result<Self, MarkError> {
        let key = if matches!(self, Self::Text { .. }) { "at_mm" } else { "points_mm" };
        self.points_mm().iter().flatten().try_for_each(|&x| check(key, x, COORDINATE_LIMIT_MM))?;
        if let Self::BodyMark { turn_deg, .. } = self {
            check("turn_deg", turn_deg, 360.0)?;
        }
        match &mut self {
            Self::Distance { measure, .. } | Self::Ellipse { measure, .. } | Self::Angle { measure, .. } => {
                *measure = text("measure", measure, NAME_CHARS_MAX)?;
            }
            Self::Text { text: written, .. } => {
                *written = text("text", written, TEXT_CHARS_MAX)?;
                if written.is_empty() {
                    return Err(MarkError::Empty);
                }
            }
            Self::BodyMark { name, .. } => *name = text("name", name, NAME_CHARS_MAX)?,
        }
        Ok(self)
    }

    /// Points that define the mark, mm.
    pub fn points_mm(&self) -> &[[f64; 2]] {
        match self {
            Self::Distance { points_mm, .. } => points_mm,
            Self::Ellipse { points_mm, .. } => points_mm,
            Self::Angle { points_mm, .. } => points_mm,
            Self::Text { at_mm, .. } => std::slice::from_ref(at_mm),
            Self::BodyMark { .. } => &[],
        }
    }

    /// Name of the content's kind, as in messages and files.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Distance { .. } => "distance",
            Self::Ellipse { .. } => "ellipse",
            Self::Angle { .. } => "angle",
            Self::Text { .. } => "text",
            Self::BodyMark { .. } => "body_mark",
        }
    }
}

/// Checks the form of an identifier.
///
/// # Errors
/// An invalid form.
pub fn check_id(id: &str) -> Result<(), MarkError> {
    let letters = id.chars().all(|c| c.is_ascii_alphanumeric() || c == '-');
    if letters && (1..=ID_CHARS_MAX).contains(&id.len()) {
        return Ok(());
    }
    Err(MarkError::Id { found: clean(id).chars().take(ID_CHARS_MAX).collect() })
}

/// Checks the identifiers of marks to remove.
///
/// # Errors
/// Too many identifiers, or an invalid one.
pub fn check_removed(ids: &[String]) -> Result<(), MarkError> {
    if ids.len() > REMOVED_MAX {
        return Err(MarkError::Many { found: ids.len() });
    }
    ids.iter().try_for_each(|id| check_id(id))
}

fn check(key: &'static str, found: f64, limit: f64) -> Result<(), MarkError> {
    if found.abs() <= limit { Ok(()) } else { Err(MarkError::Number { key, found, limit }) }
}

fn text(key: &'static str, text: &str, most: usize) -> Result<String, MarkError> {
    let cleaned = clean(text);
    let found = cleaned.chars().count();
    if found > most { Err(MarkError::Long { key, found, most }) } else { Ok(cleaned) }
}

/// `text` trimmed and on one line, without control characters and marks of writing direction.
pub fn clean(text: &str) -> String {
    let is_hidden = |c: char| {
        let directions = matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
        c.is_control() || directions || matches!(c, '\u{2028}' | '\u{2029}' | '\u{feff}')
    };
    let spaced: String = text.chars().map(|c| if is_hidden(c) { ' ' } else { c }).collect();
    spaced.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mark(content: MarkContent) -> Mark {
        Mark { id: "a1-2".into(), frame: 7, sampled_ms: 12.5, pose: None, content }
    }

    fn line(measure: &str, x: f64) -> MarkContent {
        MarkContent::Distance { measure: measure.into(), points_mm: [[x, 0.0], [0.0, 0.0]] }
    }

    #[test]
    fn texts_are_cleaned() {
        assert_eq!(clean(" a\u{1b}[2Jb\n\tc \u{202e}d\u{2028}e\r\n"), "a [2Jb c d e");
        let text = |text: &str| mark(MarkContent::Text { text: text.into(), at_mm: [0.0; 2] }).checked();
        assert_eq!(
            text("four\nchambers").unwrap().content,
            MarkContent::Text { text: "four chambers".into(), at_mm: [0.0; 2] }
        );
        assert_eq!(text("\u{7}\n"), Err(MarkError::Empty));
        assert_eq!(text(&"ä".repeat(60)).map(|_| ()), Ok(()), "characters, not bytes");
        assert_eq!(text(&"ä".repeat(61)), Err(MarkError::Long { key: "text", found: 61, most: 60 }));
    }

    #[test]
    fn numbers_and_names_beyond_their_limits_are_refused() {
        assert!(mark(line("BPD", 1e4)).checked().is_ok());
        for x in [1.1e4, f64::NAN, f64::INFINITY] {
            assert!(matches!(mark(line("", x)).checked(), Err(MarkError::Number { key: "points_mm", .. })), "{x}");
        }
        let far = MarkContent::Text { text: "a".into(), at_mm: [0.0, 2e4] };
        assert!(matches!(mark(far).checked(), Err(MarkError::Number { key: "at_mm", .. })));
        assert!(matches!(mark(line(&"x".repeat(25), 0.0)).checked(), Err(MarkError::Long { key: "measure", .. })));
        let turned = MarkContent::BodyMark { name: "abdomen".into(), turn_deg: 361.0 };
        assert!(matches!(mark(turned).checked(), Err(MarkError::Number { key: "turn_deg", .. })));
        let late = Mark { sampled_ms: f64::NAN, ..mark(line("", 0.0)) };
        assert!(matches!(late.checked(), Err(MarkError::Number { key: "sampled_ms", .. })));
        let thrown = Mark { pose: Some([f64::INFINITY; 7]), ..mark(line("", 0.0)) };
        assert!(matches!(thrown.checked(), Err(MarkError::Number { key: "pose", .. })));
        for id in ["", "a b", "\u{1b}[2J", &"a".repeat(33)] {
            assert!(matches!(check_id(id), Err(MarkError::Id { .. })), "{id}");
        }
        assert_eq!(check_removed(&vec!["a".to_owned(); 65]), Err(MarkError::Many { found: 65 }));
    }
}
