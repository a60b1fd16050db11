//! Rules for the loss along a path.

use insonify_core::acoustics::decibel::db_from_amplitude;
use insonify_core::settings::{Choice, Effect};

use super::bound::{Bound, GREY_ALLOWED};
use super::facts::Medium;
use super::rules::{Finding, Rules, decided, finding, most};

/// Amplitude, relative to the RMS, of the weakest speckle that a bound includes: 0.25 % of samples are weaker.
const NULL_AMPLITUDE: f64 = 0.05;
impl Rules<'_> {
    /// Least two-way loss that a frame may have in a medium, dB per mm of range. The echoes' rule needs it before
    /// attenuation is decided.
    pub(super) fn least_loss_db_mm(&self, medium: &Medium) -> f64 {
        let choice = self.settings.effects.of(Effect::Attenuation);
        if !decided(choice, !self.attenuation().bound.negligible()) {
            return 0.0;
        }
        let of = |exponent| self.loss_by_exponent_db_mm(medium, exponent);
        match self.settings.effects.of(Effect::FrequencyExponent) {
            Choice::On => of(medium.tissue.attenuation_exponent),
            Choice::Off => of(1.0),
            Choice::Auto => of(medium.tissue.attenuation_exponent).min(of(1.0)),
        }
    }

    /// Two-way loss in a medium, dB per mm of range.
    pub(super) fn loss_db_mm(&self, medium: &Medium) -> f64 {
        let forced_off = self.settings.effects.of(Effect::FrequencyExponent) == Choice::Off;
        let exponent = if forced_off { 1.0 } else { medium.tissue.attenuation_exponent };
        self.loss_by_exponent_db_mm(medium, exponent)
    }

    fn loss_by_exponent_db_mm(&self, medium: &Medium, exponent: f64) -> f64 {
        let loss_db_cm_mhz = medium.tissue.attenuation_db_cm_mhz;
        self.probe.two_way_loss_db_mm(loss_db_cm_mhz, exponent) * self.speed_ratio(medium)
    }

    /// Error bound of frames without the loss `of` (dB per mm of range). Includes the largest loss over the image's
    /// depth (dB) and its medium; `None` if no medium has any. `map_db_mm` is the same two-way loss per mm of path, as
    /// in the attenuation map.
    fn loss_bound(
        &self,
        of: impl Fn(&Medium) -> f64,
        map_db_mm: impl Fn(&Medium) -> f64,
    ) -> Option<(f64, &Medium, Bound)> {
        let over_the_depth = |m: &&Medium| of(m) * self.probe.depth_mm;
        let (db, medium) = most(self.facts.media.iter(), over_the_depth).filter(|(db, _)| *db > 0.0)?;
        if self.settings.lines {
            return Some((db, medium, Bound::none("the loss in lines.npy")));
        }
        let one_loss = self.facts.media.windows(2).all(|pair| of(&pair[0]) as f32 == of(&pair[1]) as f32);
        // Echoes cancel in a speckle null, but no longer if their losses differ.
        let level_db =
            if one_loss { db } else { db_from_amplitude(1.0 + (10f64.powf(db / 20.0) - 1.0) / NULL_AMPLITUDE) };
        let bound = Bound::level(level_db, self.settings.image.dynamic_range_db);
        // The one-way loss counts twice: the percentile that divides the map has it, too. Any frame may need its maps.
        let map_db = self.facts.media.iter().map(map_db_mm).fold(0.0, f64::max) * self.probe.depth_mm;
        let map_off = 1.0 - 10f64.powf(-map_db / 20.0);
        if bound.negligible() && map_off > GREY_ALLOWED / 255.0 {
            return Some((db, medium, Bound::none(format!("{map_off:.4} of the attenuation map"))));
        }
        Some((db, medium, bound))
    }

    pub(super) fn attenuation(&self) -> Finding {
        let depth_mm = self.probe.depth_mm;
        let loss = |m: &Medium| self.loss_db_mm(m);
        let Some((db, medium, bound)) = self.loss_bound(loss, |m| self.loss_db_mm(m) / self.speed_ratio(m)) else {
            return finding("no medium attenuates", Bound::Exact);
        };
        finding(format!("{} takes {db:.3} dB over {depth_mm} mm to and fro", medium.name), bound)
    }

    pub(super) fn frequency_exponent(&self) -> Finding {
        if !self.on.has(Effect::Attenuation) {
            return finding("nothing attenuates", Bound::Exact);
        }
        let frequency_mhz = self.probe.frequency_mhz;
        if frequency_mhz == 1.0 {
            return finding("every power of 1 MHz is 1", Bound::Exact);
        }
        // Difference of a medium's loss from one proportional to the frequency, dB per mm of range.
        let off = |m: &Medium| {
            let of = |exponent| self.loss_by_exponent_db_mm(m, exponent);
            (of(m.tissue.attenuation_exponent) - of(1.0)).abs()
        };
        let Some((_, medium, bound)) = self.loss_bound(off, |m| off(m) / self.speed_ratio(m)) else {
            let reason = "every medium that attenuates does so in proportion to the frequency";
            return finding(reason, Bound::Exact);
        };
        let y = medium.tissue.attenuation_exponent;
        finding(format!("{} goes by f^{y} at {frequency_mhz} MHz", medium.name), bound)
    }
}
