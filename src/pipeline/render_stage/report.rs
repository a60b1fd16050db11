//! Reports of the probe's contact and placement.

use super::RenderStage;
use super::device::Device;
use super::placement::PlacementChange;
use super::untouched::UntouchedChange;
use crate::transducer::Contact;
use crate::transducer::placement::Untouched;

impl RenderStage {
    /// Reports that the probe has left the skin, or touches it again.
    pub(super) fn report_contact(&mut self, contact: Option<Contact>) {
        let Some(contact) = contact else { return };
        if self.coupled.replace(contact.coupled()) == Some(contact.coupled()) {
            return;
        }
        self.parts.events.info(&match contact.coupled() {
            true => format!("contact: {:.0} % of the face", 100.0 * contact.part),
            false => "contact: none".to_owned(),
        });
    }

    /// Reports an impossible placement of the probe, or that the placement is possible again. The first message stays
    /// on the frames until the second.
    pub(super) fn report_placement(&self, change: PlacementChange) {
        let events = &self.parts.events;
        match change {
            PlacementChange::Wrong(misplaced) => events.warn_while_it_lasts(format!("pose: {misplaced}")),
            PlacementChange::Right => {
                events.end_lasting();
                events.info("pose: the probe is where a hand can hold it");
            }
        }
    }

    /// Reports once that the probe has never touched the skin. The summary keeps this until the probe touches it.
    pub(super) fn report_untouched(&self, change: UntouchedChange) {
        let untouched = match change {
            UntouchedChange::Never { good, extent_mm, pose } => {
                let away_mm = match &self.device {
                    Device::Ready(renderer) => renderer.skin_distance_mm(&pose),
                    Device::Lost { .. } => None,
                };
                Some(Untouched { good_s: good.as_secs_f64(), away_mm, extent_mm })
            }
            UntouchedChange::Touched => None,
        };
        if let Some(untouched) = untouched {
            self.parts.events.warn(format!("pose: {untouched}"));
        }
        self.parts.metrics.set_untouched(untouched);
    }
}
