//! Probe pose that shows a view, and its serialisation as `[x, y, z, qw, qx, qy, qz]`.

use glam::DVec3;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

use super::View;
use crate::anatomy::Skin;
use crate::pose::Pose;

impl View {
    /// A view in the plane spanned by `lateral` and `to_probe`, which are perpendicular unit vectors. It has no
    /// outlines, landmarks or calipers.
    pub fn new(name: &str, centre_mm: DVec3, lateral: DVec3, to_probe: DVec3) -> Self {
        Self {
            name: name.to_owned(),
            centre_mm,
            normal: to_probe.cross(lateral),
            lateral,
            any_turn_about_lateral: false,
            to_probe,
            pose: None,
            outlines: Vec::new(),
            landmarks: Vec::new(),
            calipers: Vec::new(),
        }
    }

    /// `scene_from_probe` of a probe on `skin` that shows the view, with its face pressed in by `press_mm`. `None` if
    /// the line from the view's centre to the probe does not hit the skin.
    pub fn pose_on(&self, skin: &Skin, press_mm: f64) -> Option<Pose> {
        let contact = skin.exit(self.centre_mm, self.to_probe)?;
        Some(Pose::looking(contact - self.to_probe * press_mm, -self.to_probe, self.lateral))
    }
}

pub(super) fn serialize<S: Serializer>(pose: &Option<Pose>, serializer: S) -> Result<S::Ok, S::Error> {
    pose.as_ref().map(Pose::components).serialize(serializer)
}

pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Pose>, D::Error> {
    let components: Option<[f64; 7]> = Deserialize::deserialize(deserializer)?;
    components.map(|c| Pose::from_components(c).map_err(D::Error::custom)).transpose()
}
