//! Names of enum variants and names from files; counts and lists in words.

use std::borrow::Cow;

/// Defines `ALL`, `NAMES`, `name` and `named` for a fieldless enum from one table of variants and names.
#[macro_export]
macro_rules! named {
    ($type:ident { $($variant:ident = $name:literal),+ $(,)? }) => {
        impl $type {
            /// All variants, in order.
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$variant),+];

            /// Names of all variants, in the same order.
            pub const NAMES: &'static [&'static str] = &[$($name),+];

            /// Name of the variant in files, on the command line and in messages.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name),+
                }
            }

            /// Variant called `name`; `None` if there is none.
            pub fn named(name: &str) -> Option<Self> {
                Self::ALL.into_iter().find(|variant| variant.name() == name)
            }
        }
    };
}

pub use named;

/// Word in an environment variable; `None` if the variable is unset or empty.
pub fn word_in_environment(variable: &str) -> Option<String> {
    let word = std::env::var_os(variable).filter(|word| !word.is_empty())?;
    Some(word.to_string_lossy().into_owned())
}

/// A whole number in digits with thousands separators.
pub fn thousands(n: usize) -> String {
    if n < 1000 { n.to_string() } else { format!("{},{:03}", thousands(n / 1000), n % 1000) }
}

/// A count with its noun, for example `1 error` or `3 errors`.
pub fn counted(n: usize, name: &str) -> String {
    format!("{} {name}{}", thousands(n), if n == 1 { "" } else { "s" })
}

/// The first `most` of `words`, joined by `separator`; if there are more, their number follows, as in `and 3 more`.
pub fn listed(words: &[String], most: usize, separator: &str) -> String {
    let mut shown = words[..words.len().min(most)].to_vec();
    if words.len() > most {
        shown.push(format!("and {} more", words.len() - most));
    }
    shown.join(separator)
}

/// Largest number of characters of a name that comes from a file.
const NAME_CHARS_MAX: usize = 200;

/// Whether a character is not allowed in a name: line breaks and other control characters (including terminal
/// sequences), marks of the writing direction, invisible characters.
fn is_hidden(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{200b}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}')
}

/// Whether a name can be shown on one line unchanged.
pub fn is_printable(name: &str) -> bool {
    !name.chars().any(is_hidden)
}

/// A text on one line: each run of line breaks, control characters or marks of the writing direction becomes a space.
pub fn one_line(text: &str) -> Cow<'_, str> {
    if is_printable(text) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::new();
    for c in text.chars() {
        match is_hidden(c) {
            true if shown.ends_with(' ') => {}
            true => shown.push(' '),
            false => shown.push(c),
        }
    }
    Cow::Owned(shown.trim().to_owned())
}

/// A name on one line, as by [`one_line`], cut to at most 200 characters.
pub fn printable(name: &str) -> Cow<'_, str> {
    let line = one_line(name);
    match line.char_indices().nth(NAME_CHARS_MAX) {
        Some((end, _)) => Cow::Owned(line[..end].to_owned()),
        None => line,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thousands_are_apart() {
        assert_eq!([0, 999, 1000, 675_012, 1_234_567].map(thousands), ["0", "999", "1,000", "675,012", "1,234,567"]);
        assert_eq!([1, 2000].map(|n| counted(n, "error")), ["1 error", "2,000 errors"]);
    }

    #[test]
    fn long_lists_are_cut_and_say_so() {
        let words = ["a", "b", "c"].map(str::to_owned);
        assert_eq!([1, 2, 3].map(|most| listed(&words, most, "; ")), ["a; and 2 more", "a; b; and 1 more", "a; b; c"]);
        assert_eq!(listed(&[], 3, ", "), "");
    }

    #[test]
    fn names_from_files_fit_one_line_and_command_no_terminal() {
        for name in ["liver", "Leber, re.", "肝臓", "a \"b\" <c>", ""] {
            assert!(is_printable(name) && printable(name) == name, "{name}");
        }
        assert_eq!(printable("li\u{1b}[31mver\"}\r\n[x]\t"), "li [31mver\"} [x]");
        assert_eq!(printable("a\u{202e}b\u{2028}c\u{0}"), "a b c");
        assert_eq!(printable(&"x".repeat(5000)).len(), 200);
    }
}
