//! `--quality`.

use std::str::FromStr;

use insonify::chooser::StillQuality;
use insonify::render::{FrameQuality, Preset, Quality};
use insonify::settings::SettingsGroup as _;

use super::input;

/// Help of `--quality`.
pub(crate) fn help(default: &str) -> String {
    format!("{} [default: {default}]", accepts())
}

/// Help of `--seed`.
pub(crate) fn seed_help() -> String {
    format!("{} [default: the station's own]", input::described::<Quality>("seed"))
}

/// Values of `--quality`.
fn accepts() -> String {
    let presets = Preset::NAMES.iter().zip(Preset::ALL).map(|(name, preset)| format!("{name} ({})", preset.quality()));
    let presets: Vec<String> = presets.collect();
    let [lq, hq] = [Quality::LQ, Quality::HQ].map(rays_layers);
    let [rays, layers] = ["rays", "layers"].map(input::range::<Quality>);
    format!("{}, lq ({lq}), hq ({hq}), or rays x layers: {rays} x {layers}", presets.join(", "))
}

/// Rays and layers as given on the command line: a preset, `lq`, `hq` or `RxL`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct RaysLayers(pub(crate) FrameQuality);

impl RaysLayers {
    /// The rays, then the layers.
    pub(crate) fn pair(self) -> [u32; 2] {
        [self.0.rays, self.0.layers]
    }

    /// These rays and layers with a seed.
    pub(crate) fn with_seed(self, seed: u32) -> Quality {
        Quality { rays: self.0.rays, layers: self.0.layers, seed }
    }
}

impl FromStr for RaysLayers {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let text = text.to_ascii_lowercase();
        if let Ok(preset) = text.parse::<Preset>() {
            return Ok(Self(preset.quality()));
        }
        match text.as_str() {
            "lq" => Ok(Self(rays_layers(Quality::LQ))),
            "hq" => Ok(Self(rays_layers(Quality::HQ))),
            other => {
                let given = input::product(other).map(|(rays, layers)| Self(FrameQuality::new(rays, layers)));
                let in_range = given.filter(|given| given.with_seed(0).validate().is_ok());
                in_range.ok_or_else(|| format!("expected {}, such as `8x1`", accepts()))
            }
        }
    }
}

/// Rays and layers of a quality.
fn rays_layers(quality: Quality) -> FrameQuality {
    FrameQuality::new(quality.rays, quality.layers)
}

/// Prints and returns the quality that a budget chose, with its time, its error and the time of the next one.
pub(crate) fn say_chosen(chosen: &StillQuality) -> String {
    let StillQuality { frame_budget_ms, quality, error, frame_ms, beyond } = chosen;
    let Some(ms) = frame_ms else {
        return warned(format!("{quality}, whose frames gave no time to hold against {frame_budget_ms} ms"));
    };
    if !chosen.fits() {
        return warned(format!(
            "nothing keeps {frame_budget_ms} ms here; {quality} is the least, and takes {ms:.1} ms"
        ));
    }
    let beyond = match beyond {
        None => String::new(),
        Some((next, Some(ms))) => format!("; {next} takes {ms:.1} ms"),
        Some((next, None)) => format!("; {next} is more than the device has room for"),
    };
    // The table has no errors of stills without the aperture.
    let off =
        if quality.aperture { format!(", {error:.1} grey levels off the converged picture") } else { String::new() };
    let chosen = format!("{quality}, {ms:.1} ms of {frame_budget_ms}{off}{beyond}");
    eprintln!("quality: {chosen}");
    chosen
}

fn warned(chosen: String) -> String {
    tracing::warn!("quality: {chosen}");
    chosen
}

/// The quality's short name in captions and tables.
pub(crate) fn name(quality: &Quality) -> String {
    let own = rays_layers(*quality);
    let named = [(Quality::LQ, "LQ"), (Quality::HQ, "HQ")].into_iter().find(|(known, _)| own == rays_layers(*known));
    named.map_or_else(|| own.to_string(), |(_, name)| name.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_products_are_understood() {
        let quality = |text: &str| text.parse::<RaysLayers>().map(|q| q.with_seed(7));
        assert_eq!(quality("lq"), Ok(Quality { seed: 7, ..Quality::LQ }));
        assert_eq!(quality("HQ"), Ok(Quality { seed: 7, ..Quality::HQ }));
        assert_eq!(quality("8x2"), Ok(Quality { rays: 8, layers: 2, seed: 7 }));
        for (text, rays, layers) in [("fast", 1, 1), ("Balanced", 2, 3), ("accurate", 32, 3), ("reference", 128, 3)] {
            assert_eq!(quality(text), Ok(Quality { rays, layers, seed: 7 }));
        }
        let error = quality("best").unwrap_err();
        assert!(error.contains("balanced (2x3)") && error.contains("hq (32x3)"), "{error}");
        assert!(error.contains("rays x layers: 1..=256 x 1..=33"), "{error}");
        for wrong in ["", "x", "8", "8x", "0x1", "1x0", "257x1", "1x34", "-1x1", "8x2x1", "mq"] {
            assert!(quality(wrong).is_err(), "{wrong}");
        }
        assert_eq!(name(&Quality { rays: 32, layers: 3, seed: 1 }), "HQ");
        assert_eq!(name(&Quality { rays: 8, layers: 1, seed: 0 }), "8x1");
    }
}
