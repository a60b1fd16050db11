//! Probe pose that shows a view.

use super::View;
use crate::anatomy::Skin;
use crate::pose::Pose;

impl View {
    /// `scene_from_probe` of a probe on `skin` that shows the view, its face pressed in by `press_mm`; `None` if the
    /// line from the view's centre to the probe meets no skin.
    pub fn pose_on(&self, skin: &Skin, press_mm: f64) -> Option<Pose> {
        let contact = skin.exit(self.centre_mm, self.to_probe)?;
        Some(Pose::looking(contact - self.to_probe * press_mm, -self.to_probe, self.lateral))
    }
}
