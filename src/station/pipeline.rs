//! `[pipeline]`: rate, budget and choice of a live session.

use super::values::Values;
use crate::pipeline::Settings;

pub(super) fn settings(values: &Values) -> Settings {
    let mut settings = Settings::default();
    values.set("frame_rate_hz", &mut settings.frame_rate_hz);
    values.set("budget_ms", &mut settings.budget_ms);
    values.set("hold_mm", &mut settings.choice.hold_mm);
    values.set("hold_deg", &mut settings.choice.hold_deg);
    values.set_integer("steady_frames", &mut settings.choice.steady_frames);
    values.set("hang_ms", &mut settings.hang_ms);
    values.set("finish_ms", &mut settings.finish_ms);
    settings
}
