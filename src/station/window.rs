//! `[window]`: the native window.

use super::values::Values;
use crate::sink::window::Settings;

/// What the table `[window]` says.
pub(super) fn settings(values: &Values) -> Settings {
    Settings { full_screen: values.boolean("full_screen").unwrap_or(false) }
}
