//! Which values a [`Control`] may carry.

use super::live::Control;
use crate::render::SettingsError;

/// Gain, dB.
pub const GAIN_DB: [f64; 2] = [-200.0, 200.0];
/// Dynamic range, dB.
pub const DYNAMIC_RANGE_DB: [f64; 2] = [1.0, 200.0];
/// TGC, dB/cm.
pub const TGC_DB_PER_CM: [f64; 2] = [0.0, 100.0];
/// A TGC slider, dB.
pub const TGC_SLIDER_DB: [f64; 2] = [-100.0, 100.0];
/// TGC sliders.
pub const TGC_SLIDERS: usize = 8;
/// Image depth, mm.
pub const DEPTH_MM: [f64; 2] = [1.0, 500.0];
/// Focal depth, mm.
pub const FOCUS_MM: [f64; 2] = [1.0, 1000.0];
/// Rays per scanline and layer.
pub const RAYS: [u32; 2] = [1, 256];
/// Elevational layers.
pub const LAYERS: [u32; 2] = [1, 33];

impl Control {
    /// Checks the values against the ranges of a station file, which are those of probe and render settings.
    ///
    /// # Errors
    /// The first value outside its range, NaN included.
    pub fn validate(&self) -> Result<(), SettingsError> {
        let check = |key, value: f64, [min, max]: [f64; 2]| {
            if value >= min && value <= max { Ok(()) } else { Err(SettingsError { key, value, min, max }) }
        };
        match *self {
            Self::Freeze(_) | Self::Enhance(_) | Self::Quit => Ok(()),
            Self::GainDb(db) => check("gain_db", db, GAIN_DB),
            Self::DynamicRangeDb(db) => check("dynamic_range_db", db, DYNAMIC_RANGE_DB),
            Self::TgcDbPerCm(db) => check("tgc_db_per_cm", db, TGC_DB_PER_CM),
            Self::TgcSlider { index, db } => {
                check("tgc_slider.index", index as f64, [0.0, (TGC_SLIDERS - 1) as f64])?;
                check("tgc_slider.db", db, TGC_SLIDER_DB)
            }
            Self::DepthMm(mm) => check("depth_mm", mm, DEPTH_MM),
            Self::FocusMm(mm) => check("focus_mm", mm, FOCUS_MM),
            Self::Quality { rays, layers } => {
                check("quality.rays", rays.into(), RAYS.map(f64::from))?;
                check("quality.layers", layers.into(), LAYERS.map(f64::from))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::{ImageSettings, Quality, RenderSettings};
    use crate::transducer::Probe;

    #[test]
    fn values_outside_of_their_range_are_refused_by_name() {
        let wrong = [
            (Control::GainDb(f64::NAN), "gain_db"),
            (Control::DynamicRangeDb(0.0), "dynamic_range_db"),
            (Control::TgcDbPerCm(-1.0), "tgc_db_per_cm"),
            (Control::TgcSlider { index: 8, db: 0.0 }, "tgc_slider.index"),
            (Control::TgcSlider { index: 7, db: 101.0 }, "tgc_slider.db"),
            (Control::DepthMm(f64::INFINITY), "depth_mm"),
            (Control::FocusMm(0.0), "focus_mm"),
            (Control::Quality { rays: 0, layers: 1 }, "quality.rays"),
            (Control::Quality { rays: 1, layers: 34 }, "quality.layers"),
        ];
        for (control, key) in wrong {
            assert_eq!(control.validate().unwrap_err().key, key, "{control:?}");
        }
        assert_eq!(Control::Quit.validate(), Ok(()));
    }

    #[test]
    fn the_ends_of_every_range_are_what_the_renderer_takes() {
        for end in 0..2 {
            let settings = RenderSettings {
                image: ImageSettings {
                    gain_db: GAIN_DB[end],
                    dynamic_range_db: DYNAMIC_RANGE_DB[end],
                    tgc_db_per_cm: TGC_DB_PER_CM[end],
                    tgc_sliders_db: [TGC_SLIDER_DB[end]; TGC_SLIDERS],
                    ..ImageSettings::default()
                },
                quality: Quality { rays: RAYS[end], layers: LAYERS[end], seed: 0 },
                ..RenderSettings::default()
            };
            settings.validate().unwrap();
            let probe = Probe { depth_mm: DEPTH_MM[end], focus_mm: FOCUS_MM[end], ..Probe::default() };
            probe.validate().unwrap();
        }
    }
}
