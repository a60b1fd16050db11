//! One setting: key, unit, range, default, documentation, and work that a change needs.

use serde_json::{Value, json};
use thiserror::Error;

use super::LiveControl;

/// A setting of a station file or of a live session.
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    /// Table and key: `image.gain_db`.
    pub path: &'static str,
    /// Table of the station file that has the setting.
    pub table: &'static str,
    /// Key in its table.
    pub key: &'static str,
    /// Unit, or empty.
    pub unit: &'static str,
    /// Type of the value.
    pub kind: Kind,
    /// Smallest accepted value; in a list, of each element.
    pub min: f64,
    /// Largest accepted value; in a list, of each element.
    pub max: f64,
    /// Default value; in a list, of each element.
    pub default: f64,
    /// Documentation of the setting: one sentence.
    pub doc: &'static str,
    /// Work that is needed before the next frame after a change of the setting.
    pub change: Change,
    /// Control on the live displays; `None` if the setting is fixed while a session runs.
    pub control: Option<LiveControl>,
}

/// Word of a setting that the program chooses.
pub const AUTO: &str = "auto";

/// Type of a setting's value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Any number.
    Number,
    /// A whole number.
    Whole,
    /// A whole number or the word [`AUTO`], which is stored as 0.
    WholeOrAuto,
    /// A list of this many numbers.
    Numbers(usize),
    /// On (1) or off (0).
    Switch,
    /// One of these words; the value is its index.
    Word(&'static [&'static str]),
}

/// Work that is needed before the next frame after a change of a setting. The variants ascend in cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Change {
    /// No work: the value is passed to each frame as a uniform.
    Nothing,
    /// Tables of the beam, the pulse and the depths are computed again.
    Tables,
    /// Tables, buffers and passes are rebuilt, since the frame's size, paths or passes change.
    Everything,
}

/// An invalid value, index or key of a setting.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum SettingsError {
    /// A value outside its range.
    #[error("{key} is {value}; it must lie in {min}..={max}")]
    Range {
        /// Table and key.
        key: &'static str,
        /// Value found.
        value: f64,
        /// Smallest accepted value.
        min: f64,
        /// Largest accepted value.
        max: f64,
    },
    /// A fraction where a whole number is needed.
    #[error("{key} is {value}; it must be a whole number")]
    Fraction {
        /// Table and key.
        key: &'static str,
        /// Value found.
        value: f64,
    },
    /// An index beyond the elements of the setting.
    #[error("{key}[{index}] does not exist; its elements are 0..={last}")]
    Element {
        /// Table and key.
        key: &'static str,
        /// Index found.
        index: usize,
        /// Index of the last element.
        last: usize,
    },
    /// A value within its range that the page doesn't offer.
    #[error("{key} is {value}; the page offers {offered}")]
    NotOffered {
        /// Table and key.
        key: &'static str,
        /// Value found.
        value: String,
        /// Values or range that the page offers.
        offered: String,
    },
    /// A key that belongs to no live setting.
    #[error("`{key}` is no live setting; they are {known}")]
    NotLive {
        /// Key found.
        key: String,
        /// Keys of all live settings.
        known: String,
    },
}

impl Setting {
    /// Number of values of the setting: 1, or the length of a list.
    pub const fn count(&self) -> usize {
        match self.kind {
            Kind::Numbers(count) => count,
            Kind::Number | Kind::Whole | Kind::WholeOrAuto | Kind::Switch | Kind::Word(_) => 1,
        }
    }

    /// Whether the picture of a frame depends on the setting. True for all settings except the switches of a session.
    pub fn is_of_picture(&self) -> bool {
        self.table != "session"
    }

    /// Checks one value against the range.
    ///
    /// # Errors
    /// A value outside the range, NaN included; a fraction where a whole number is needed.
    pub fn check(&self, value: f64) -> Result<(), SettingsError> {
        let &Self { path: key, min, max, .. } = self;
        if self.kind == Kind::WholeOrAuto && value == 0.0 {
            return Ok(());
        }
        if !(min..=max).contains(&value) {
            return Err(SettingsError::Range { key, value, min, max });
        }
        match self.kind {
            Kind::Whole | Kind::WholeOrAuto | Kind::Switch | Kind::Word(_) if value.fract() != 0.0 => {
                Err(SettingsError::Fraction { key, value })
            }
            _ => Ok(()),
        }
    }

    /// Smallest and largest value as text: `1..=256`.
    pub fn range(&self) -> String {
        format!("{}..={}", self.min, self.max)
    }

    /// Documentation and range of the setting in one line.
    pub fn described(&self) -> String {
        format!("{}, {}", self.doc.trim_end_matches('.'), self.range())
    }

    /// Checks every value of `stored` against the range.
    ///
    /// # Errors
    /// As [`Setting::check`].
    pub(crate) fn check_stored(&self, stored: &dyn Stored) -> Result<(), SettingsError> {
        (0..self.count()).try_for_each(|index| self.check(stored.get(index)))
    }

    /// The default value as TOML.
    pub fn default_toml(&self) -> String {
        match self.kind {
            Kind::Number => format!("{:?}", self.default),
            Kind::WholeOrAuto if self.default == 0.0 => format!("{AUTO:?}"),
            Kind::Whole | Kind::WholeOrAuto => self.default.to_string(),
            Kind::Numbers(count) => format!("[{}]", vec![self.default.to_string(); count].join(", ")),
            Kind::Switch => (self.default > 0.0).to_string(),
            Kind::Word(words) => format!("{:?}", word(words, self.default)),
        }
    }

    /// The value in `stored` as JSON: a number, a list of numbers, true or false, or a word.
    pub fn to_json(&self, stored: &dyn Stored) -> Value {
        match self.kind {
            Kind::Number => json!(stored.get(0)),
            Kind::WholeOrAuto if stored.get(0) == 0.0 => json!(AUTO),
            Kind::Whole | Kind::WholeOrAuto => json!(stored.get(0) as i64),
            Kind::Numbers(count) => (0..count).map(|index| stored.get(index)).collect(),
            Kind::Switch => json!(stored.get(0) > 0.0),
            Kind::Word(words) => json!(word(words, stored.get(0))),
        }
    }

    /// Reads JSON in the form of [`Setting::to_json`] into `stored`. Ranges are not checked.
    ///
    /// # Errors
    /// A value of another type.
    pub fn read_json(&self, value: &Value, stored: &mut dyn Stored) -> Result<(), String> {
        let (numbers, expected): (Option<Vec<f64>>, _) = match self.kind {
            Kind::Number => (value.as_f64().map(|number| vec![number]), "a number".to_owned()),
            Kind::WholeOrAuto if value.as_str() == Some(AUTO) => (Some(vec![0.0]), String::new()),
            Kind::Whole | Kind::WholeOrAuto => {
                // 0 stands for the word.
                let (least, or_auto) = match self.kind {
                    Kind::WholeOrAuto => (1, format!(" above 0, or \"{AUTO}\"")),
                    _ => (0, String::new()),
                };
                let whole = value.as_u64().and_then(|whole| u32::try_from(whole).ok()).filter(|&whole| whole >= least);
                (whole.map(|whole| vec![whole.into()]), format!("a whole number{or_auto}"))
            }
            Kind::Switch => (value.as_bool().map(|on| vec![on.into()]), "true or false".to_owned()),
            Kind::Word(words) => {
                let index = value.as_str().and_then(|found| words.iter().position(|word| *word == found));
                (index.map(|index| vec![index as f64]), format!("one of \"{}\"", words.join("\", \"")))
            }
            Kind::Numbers(count) => {
                let numbers = value.as_array().and_then(|values| values.iter().map(Value::as_f64).collect());
                (numbers.filter(|numbers: &Vec<f64>| numbers.len() == count), format!("{count} numbers"))
            }
        };
        let numbers = numbers.ok_or_else(|| format!("`{}` is {value}; it must be {expected}", self.key))?;
        numbers.iter().enumerate().for_each(|(index, number)| stored.set(index, *number));
        Ok(())
    }
}

/// Word with this index; empty if there is none.
fn word(words: &'static [&'static str], index: f64) -> &'static str {
    words.get(index as usize).copied().unwrap_or_default()
}

/// Storage of a setting's value.
pub trait Stored {
    /// Type of the value.
    fn kind(&self) -> Kind;

    /// The value as a number; in a list, the element at `index`.
    fn get(&self, index: usize) -> f64;

    /// Stores the value; in a list, at `index`. The caller has checked the range.
    fn set(&mut self, index: usize, value: f64);
}

macro_rules! stored {
    ($($type:ty: $kind:ident, $value:ident => $from:expr;)+) => {$(
        impl Stored for $type {
            fn kind(&self) -> Kind {
                Kind::$kind
            }

            fn get(&self, _index: usize) -> f64 {
                (*self).into()
            }

            fn set(&mut self, _index: usize, $value: f64) {
                *self = $from;
            }
        }
    )+};
}

stored! {
    f64: Number, value => value;
    u16: Whole, value => value as u16;
    u32: Whole, value => value as u32;
    bool: Switch, value => value > 0.0;
}

/// Implements `Stored` for an enum defined by `named!`; its value is an index into the names of the enum.
macro_rules! stored_word {
    ($type:ty) => {
        impl $type {
            /// Range of the index into the names.
            pub const RANGE: std::ops::RangeInclusive<f64> = 0.0..=(Self::NAMES.len() - 1) as f64;
        }

        impl $crate::settings::Stored for $type {
            fn kind(&self) -> $crate::settings::Kind {
                $crate::settings::Kind::Word(Self::NAMES)
            }

            fn get(&self, _index: usize) -> f64 {
                f64::from(*self as u8)
            }

            fn set(&mut self, _index: usize, value: f64) {
                *self = Self::ALL.get(value as usize).copied().unwrap_or_default();
            }
        }
    };
}
pub(crate) use stored_word;

impl<const N: usize> Stored for [f64; N] {
    fn kind(&self) -> Kind {
        Kind::Numbers(N)
    }

    fn get(&self, index: usize) -> f64 {
        self[index]
    }

    fn set(&mut self, index: usize, value: f64) {
        self[index] = value;
    }
}
