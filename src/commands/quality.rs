//! Options `--quality` and `--seed`.

use insonify::chooser::StillQuality;
use insonify::render::{FrameQuality, Quality};
use insonify::settings::{Setting, SettingsGroup as _};

/// Help text of `--quality`.
pub(crate) fn help(default: &str) -> String {
    format!("{} [default: {default}]", FrameQuality::accepted())
}

/// Help text of `--seed`.
pub(crate) fn seed_help() -> String {
    format!("{} [default: the station's own]", Quality::setting("seed").map_or_else(String::new, Setting::described))
}

/// Prints the quality that was chosen for a frame budget.
pub(crate) fn say_chosen(chosen: &StillQuality) {
    match chosen.fits() {
        true => eprintln!("quality: {chosen}"),
        false => tracing::warn!("quality: {chosen}"),
    }
}
