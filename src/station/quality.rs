//! `[image]` and `[quality]`: post-processing of a frame, and its rays and layers.

use super::StationError;
use super::values::Values;
use crate::render::{Preset, RenderSettings};

/// Settings from checked values. With a time budget, rays and layers keep their defaults until the budget chooses
/// them.
pub(super) fn settings(image_values: &Values, values: &Values) -> Result<RenderSettings, StationError> {
    if values.has("frame_budget_ms") {
        values.refuse(
            &["preset", "rays", "layers", "coarse_samples"],
            "`quality.frame_budget_ms` chooses rays, layers and samples; give one or the other",
        )?;
    }
    let mut settings = RenderSettings::default();
    if let Some(preset) = values.text("preset").and_then(|name| name.parse::<Preset>().ok()) {
        values.refuse(&["rays", "layers"], "`quality.preset` says rays and layers; give one or the other")?;
        let quality = preset.quality();
        (settings.quality.rays, settings.quality.layers) = (quality.rays, quality.layers);
    }
    image_values.set_group(&mut settings.image);
    values.set_group(&mut settings);
    Ok(settings)
}

#[cfg(test)]
mod tests {
    use crate::render::Quality;
    use crate::station::tests::{assert_refused, parse};

    #[test]
    fn a_preset_sets_rays_and_layers_and_a_budget_leaves_them_open() {
        let station = |lines: &str| parse(&format!("[quality]\n{lines}")).unwrap();
        let quality = |lines: &str| station(lines).settings.quality;
        assert_eq!(quality("preset = \"fast\""), Quality::LQ);
        assert_eq!(quality("preset = \"balanced\"\nseed = 7"), Quality { rays: 2, layers: 3, seed: 7 });
        assert_eq!(quality("preset = \"accurate\""), Quality::HQ);
        assert_eq!(quality("preset = \"reference\""), Quality { rays: 128, layers: 3, seed: 0 });
        let with_budget = station("frame_budget_ms = 40\nseed = 7");
        assert_eq!((with_budget.frame_budget_ms, with_budget.settings.quality.seed), (Some(40.0), 7));
        assert_eq!(station("rays = 2").frame_budget_ms, None);
    }

    #[test]
    fn mistakes_are_named_with_what_would_be_right() {
        let lines = [
            ("preset = \"fast\"\nrays = 2", ["`quality.rays`", "`quality.preset`"]),
            ("layers = 3\npreset = \"fast\"", ["`quality.layers`", "`quality.preset`"]),
            ("frame_budget_ms = 40\nrays = 2", ["`quality.rays`", "`quality.frame_budget_ms`"]),
            ("frame_budget_ms = 40\ncoarse_samples = true", ["`quality.coarse_samples`", "`quality.frame_budget_ms`"]),
            ("frame_budget_ms = 40\nlayers = 1", ["`quality.layers`", "`quality.frame_budget_ms`"]),
            ("frame_budget_ms = 40\npreset = \"fast\"", ["`quality.preset`", "`quality.frame_budget_ms`"]),
            ("preset = \"acurate\"", ["quality.preset", "did you mean `accurate`?"]),
            ("frame_budget_ms = 0.5", ["quality.frame_budget_ms", "1..=10000"]),
            ("frame_budget_ms = nan", ["quality.frame_budget_ms", "1..=10000"]),
            ("frame_budget_ms = \"40\"", ["quality.frame_budget_ms", "a number"]),
            ("frame_budget = 40", ["frame_budget", "did you mean `frame_budget_ms`?"]),
        ];
        assert_refused("quality", &lines);
    }

    #[test]
    fn coarse_samples_are_for_an_automatic_number() {
        let coarse = "[quality]\ncoarse_samples = true\n[probe]\nsamples = ";
        assert!(parse(&format!("{coarse}\"auto\"")).unwrap().settings.coarse_samples);
        let error = parse(&format!("{coarse}3072")).unwrap_err().to_string();
        assert!(error.contains("`quality.coarse_samples`") && error.contains("`probe.samples`"), "{error}");
        assert!(parse("[quality]\ncoarse_samples = false\n[probe]\nsamples = 3072").is_ok());
    }
}
