//! Helpers for HTML text.

use std::fmt::Write as _;

/// Start of a page up to its body. `title` is markup.
pub(super) fn head(title: &str, style: &str) -> String {
    format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{title}</title>\
         <meta name=\"viewport\" content=\"width=device-width\"><style>{style}</style></head><body>\n"
    )
}

/// Coordinates of a line for the SVG attribute `points`.
pub(super) fn points(all: impl IntoIterator<Item = (f64, f64)>) -> String {
    all.into_iter().fold(String::new(), |mut out, (x, y)| {
        // Writing to a string cannot fail.
        let _ = write!(out, "{x:.1},{y:.1} ");
        out
    })
}

/// `text` with the characters of markup escaped, for elements and for quoted attributes.
pub(super) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
