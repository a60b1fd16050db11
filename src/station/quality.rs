//! `[image]` and `[quality]`: what a frame looks like, and how much work goes into it.

use super::StationError;
use super::values::Values;
use crate::render::{ImageSettings, Preset, Quality, RenderSettings};

/// The settings of checked values. A budget leaves rays and layers at their least until they are measured.
pub(super) fn settings(image_values: &Values, quality_values: &Values) -> Result<RenderSettings, StationError> {
    let mut image = ImageSettings::default();
    image_values.set_integer("width", &mut image.width);
    image_values.set_integer("height", &mut image.height);
    image_values.set("dynamic_range_db", &mut image.dynamic_range_db);
    image_values.set("gain_db", &mut image.gain_db);
    image_values.set("tgc_db_per_cm", &mut image.tgc_db_per_cm);
    if let Some(sliders) = image_values.numbers("tgc_sliders_db") {
        image.tgc_sliders_db = sliders;
    }
    let quality = quality(quality_values)?;
    let mut settings = RenderSettings { image, quality, ..RenderSettings::default() };
    quality_values.set_integer("reflections_max", &mut settings.reflections_max);
    quality_values.set_integer("beam_taps_max", &mut settings.beam_taps_max);
    quality_values.set_integer("pulse_taps_max", &mut settings.pulse_taps_max);
    settings.validate()?;
    Ok(settings)
}

fn quality(values: &Values) -> Result<Quality, StationError> {
    if values.has("budget_ms") {
        values.refuse(
            &["preset", "rays", "layers"],
            "`quality.budget_ms` chooses rays and layers; give one or the other",
        )?;
    }
    let mut quality = Quality::default();
    if let Some(preset) = values.text("preset").and_then(|name| name.parse::<Preset>().ok()) {
        values.refuse(&["rays", "layers"], "`quality.preset` says rays and layers; give one or the other")?;
        quality = preset.point().with_seed(quality.seed);
    }
    values.set_integer("rays", &mut quality.rays);
    values.set_integer("layers", &mut quality.layers);
    values.set_integer("seed", &mut quality.seed);
    Ok(quality)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::render::Quality;
    use crate::station::{Station, StationError};

    fn parse(table: &str) -> Result<Station, StationError> {
        let text = format!("[scene]\npath = \"a.glb\"\n[quality]\n{table}");
        Station::parse(&text, Path::new("/station"))
    }

    #[test]
    fn a_preset_says_rays_and_layers_and_a_budget_leaves_them_open() {
        let quality = |table: &str| parse(table).unwrap().settings.quality;
        assert_eq!(quality("preset = \"fast\""), Quality::LQ);
        assert_eq!(quality("preset = \"balanced\"\nseed = 7"), Quality { rays: 2, layers: 3, seed: 7 });
        assert_eq!(quality("preset = \"accurate\""), Quality::HQ);
        assert_eq!(quality("preset = \"reference\""), Quality { rays: 128, layers: 3, seed: 0 });
        let station = parse("budget_ms = 40\nseed = 7").unwrap();
        assert_eq!((station.quality_budget_ms, station.settings.quality.seed), (Some(40.0), 7));
        assert_eq!(parse("rays = 2").unwrap().quality_budget_ms, None);
    }

    #[test]
    fn what_is_wrong_is_named_with_what_would_be_right() {
        for (table, words) in [
            ("preset = \"fast\"\nrays = 2", ["`quality.rays`", "`quality.preset`"]),
            ("layers = 3\npreset = \"fast\"", ["`quality.layers`", "`quality.preset`"]),
            ("budget_ms = 40\nrays = 2", ["`quality.rays`", "`quality.budget_ms`"]),
            ("budget_ms = 40\nlayers = 1", ["`quality.layers`", "`quality.budget_ms`"]),
            ("budget_ms = 40\npreset = \"fast\"", ["`quality.preset`", "`quality.budget_ms`"]),
            ("preset = \"acurate\"", ["quality.preset", "did you mean `accurate`?"]),
            ("budget_ms = 0.5", ["quality.budget_ms", "1..=10000"]),
            ("budget_ms = nan", ["quality.budget_ms", "1..=10000"]),
            ("budget_ms = \"40\"", ["quality.budget_ms", "a number"]),
            ("budget = 40", ["budget", "did you mean `budget_ms`?"]),
        ] {
            let error = parse(table).unwrap_err().to_string();
            assert!(words.iter().all(|word| error.contains(word)), "{table}: {error}");
        }
    }
}
