//! Rules for contact with the skin, and for signals that the receiver adds.

use insonify_core::acoustics::decibel::db_from_amplitude;

use super::bound::Bound;
use super::rules::{Finding, Rules, finding};
use crate::receiver::CLUTTER_DB_CM;

impl Rules<'_> {
    /// Contact is called for by scenes with skin: bodies in air. Without skin the background conducts, as in a water
    /// bath or a phantom.
    pub(super) fn contact(&self) -> Finding {
        if !self.facts.skin {
            return finding("no surface is skin: what lies outside conducts", Bound::OnRequest);
        }
        let gel_mm = self.settings.contact.gel_mm;
        let reason = format!("the scene has skin: beyond {gel_mm} mm of gel lies air");
        finding(reason, Bound::none("air, where the face does not touch"))
    }

    pub(super) fn clutter(&self) -> Finding {
        self.added("clutter", self.settings.receiver.clutter_db, CLUTTER_DB_CM)
    }

    /// Multiples are simulated only on request: nothing in a scene says how well a probe's face is matched.
    pub(super) fn multiples(&self) -> Finding {
        finding("the station doesn't ask for echoes that the face reflects", Bound::OnRequest)
    }

    pub(super) fn noise(&self) -> Finding {
        self.added("noise", self.settings.receiver.noise_db, 0.0)
    }

    /// Rule for a signal, named `what`, that the receiver adds. Scenes with skin call for it if a display can show it.
    /// The signal has `level_db` at the face and falls by `fall_db_cm`.
    fn added(&self, what: &str, level_db: f64, fall_db_cm: f64) -> Finding {
        if !self.facts.skin {
            return finding(format!("no surface is skin: a specimen is shown without {what}"), Bound::OnRequest);
        }
        let shown_db = self.loudest_db(level_db, fall_db_cm);
        let range_db = self.settings.image.dynamic_range_db;
        // Peaks of Rayleigh statistics: one sample in 22,000 is 10 dB above the mean square.
        let peak_db = shown_db + 10.0;
        if peak_db <= -range_db {
            let reason =
                format!("{what} of {level_db} dB stays {:.0} dB below black with all gain", -range_db - shown_db);
            return finding(reason, Bound::Exact);
        }
        let reason = format!("{what} of {level_db} dB reaches {shown_db:.0} dB on the display");
        let bound = Bound::level(db_from_amplitude(1.0 + 10f64.powf((shown_db + range_db) / 20.0)), range_db);
        finding(reason, bound)
    }

    /// Highest level on the display, at any depth, of a signal with `level_db` at the face that falls by `fall_db_cm`,
    /// dB.
    fn loudest_db(&self, level_db: f64, fall_db_cm: f64) -> f64 {
        let image = &self.settings.image;
        // The level is linear between the sliders, so its maximum is at one of them.
        let at = |(i, slider_db): (usize, &f64)| {
            let depth_cm = 0.1 * self.probe.depth_mm * i as f64 / 7.0;
            level_db + image.gain_db + slider_db + (image.tgc_db_per_cm - fall_db_cm) * depth_cm
        };
        image.tgc_sliders_db.iter().enumerate().map(at).fold(f64::NEG_INFINITY, f64::max)
    }
}
