//! `[filter]`: how the poses of a live tracker are filtered.

use super::values::Values;
use crate::pose::FilterSettings;

pub(super) fn settings(values: &Values) -> FilterSettings {
    let mut filter = FilterSettings::default();
    values.set("min_cutoff_hz", &mut filter.min_cutoff_hz);
    values.set("beta", &mut filter.beta);
    values.set("rotation_min_cutoff_hz", &mut filter.rotation_min_cutoff_hz);
    values.set("rotation_beta", &mut filter.rotation_beta);
    values.set("speed_cutoff_hz", &mut filter.speed_cutoff_hz);
    values.set("prediction_ms", &mut filter.prediction_ms);
    // The ranges of these three touch but don't overlap: they always ascend.
    values.set("held_ms", &mut filter.held_ms);
    values.set("stale_ms", &mut filter.stale_ms);
    values.set("lost_ms", &mut filter.lost_ms);
    values.set("stuck_ms", &mut filter.stuck_ms);
    values.set("max_speed_mm_s", &mut filter.max_speed_mm_s);
    values.set("max_speed_deg_s", &mut filter.max_speed_deg_s);
    values.set("puck_mm_s", &mut filter.puck_mm_s);
    values.set("puck_deg_s", &mut filter.puck_deg_s);
    filter
}
