//! Offset of an image from a standard plane.

use glam::{DVec2, DVec3, Vec3Swizzles};
use serde::Serialize;

use crate::anatomy::planes::{StandardPlane, Tolerances, View};
use crate::pose::Pose;
use crate::transducer::{Probe, Sector};

/// Cost of a landmark outside the sector: just above 1, the limit.
const HIDDEN: f64 = 1.0 + 1e-6;

/// Offset of an image from a view of a standard plane.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Offset {
    /// Angle between the image plane and the plane of the view, degrees, 0..=90. For a view that may rotate freely
    /// about its lateral line, the angle between that line and the image plane.
    pub angle_deg: f64,
    /// Distance of the view's centre from the image plane, mm.
    pub distance_mm: f64,
    /// Angle in the image between the view's lateral direction and the horizontal, degrees, 0..=90.
    pub in_plane_deg: f64,
    /// Distance of the view's centre from the image's middle line, mm.
    pub centring_mm: f64,
    /// Depth of the view's centre below the probe's face, mm; negative if the centre is on the other side of the face.
    pub depth_mm: f64,
    /// Number of the view's landmarks that are in the image's sector and close enough to the image plane. Shadows of
    /// bone are ignored.
    pub landmarks_seen: usize,
    /// Largest ratio of a deviation to its tolerance; at most 1 if the image shows the view.
    pub cost: f64,
}

impl Offset {
    /// Offset of the image of `probe` at `pose` from `view`.
    pub fn of(view: &View, tolerances: &Tolerances, probe: &Probe, pose: &Pose) -> Self {
        let probe_from_scene = pose.inverse();
        let turned = |v: DVec3| probe_from_scene.transform_vector(v);
        let (normal, lateral) = (turned(view.normal), turned(view.lateral));
        let angle = if view.any_turn_about_lateral {
            lateral.y.abs().atan2(lateral.xz().length())
        } else {
            normal.xz().length().atan2(normal.y.abs())
        };
        let in_plane = lateral.z.abs().atan2(lateral.x.abs());
        let centre = probe_from_scene.transform_point(view.centre_mm);
        let in_sector = |p: DVec3| Sector::polar(probe, DVec2::new(p.x, p.z)).is_some();
        let mut landmarks_seen = 0;
        let mut landmark_cost: f64 = if in_sector(centre) { 0.0 } else { HIDDEN };
        for landmark in &view.landmarks {
            let p = probe_from_scene.transform_point(landmark.position_mm);
            let off = landmark.within_mm.map_or(0.0, |within_mm| p.y.abs() / within_mm);
            landmarks_seen += usize::from(in_sector(p) && off <= 1.0);
            landmark_cost = landmark_cost.max(if in_sector(p) { off } else { off.max(HIDDEN) });
        }

        let [least, greatest] = tolerances.depth_mm;
        // 1 at the limit, plus 1 for every 10 mm outside the accepted depths.
        let too_far = (least - centre.z).max(centre.z - greatest).max(0.0);
        let depth_cost = if too_far > 0.0 { 1.0 + 0.1 * too_far } else { 0.0 };
        let (angle_deg, in_plane_deg) = (angle.to_degrees(), in_plane.to_degrees());
        let (distance_mm, centring_mm) = (centre.y.abs(), centre.x.abs());
        let cost = [
            angle_deg / tolerances.angle_deg,
            distance_mm / tolerances.distance_mm,
            tolerances.in_plane_deg.map_or(0.0, |limit| in_plane_deg / limit),
            centring_mm / tolerances.centring_mm,
            depth_cost,
            landmark_cost,
        ]
        .into_iter()
        .fold(0.0, f64::max);
        Self { angle_deg, distance_mm, in_plane_deg, centring_mm, depth_mm: centre.z, landmarks_seen, cost }
    }

    /// Index of the view of `plane` that is nearest to the image, and its offset; `None` for a plane without views.
    pub fn nearest(plane: &StandardPlane, probe: &Probe, pose: &Pose) -> Option<(usize, Self)> {
        let offsets = plane.views.iter().map(|view| Self::of(view, &plane.tolerances, probe, pose));
        offsets.enumerate().min_by(|a, b| a.1.cost.total_cmp(&b.1.cost))
    }

    /// Conditions that the image fails, each with its value and limit; empty if the image shows the view.
    pub(crate) fn faults(&self, view: &View, tolerances: &Tolerances, probe: &Probe, pose: &Pose) -> Vec<String> {
        // Rounds away from the limit, so that a value just above it is never shown as equal to it.
        let up = |value: f64| (10.0 * value).ceil() / 10.0;
        let mut faults = Vec::new();
        let mut beyond = |value: f64, limit: f64, what: &dyn Fn(f64) -> String| {
            if value > limit {
                faults.push(format!("{} (at most {limit})", what(up(value))));
            }
        };
        beyond(self.angle_deg, tolerances.angle_deg, &|deg| format!("tilted off the plane by {deg:.1}°"));
        beyond(self.distance_mm, tolerances.distance_mm, &|mm| format!("{mm:.1} mm beside the plane"));
        if let Some(limit) = tolerances.in_plane_deg {
            beyond(self.in_plane_deg, limit, &|deg| format!("turned in the picture by {deg:.1}°"));
        }
        beyond(self.centring_mm, tolerances.centring_mm, &|mm| format!("{mm:.1} mm off the picture's middle line"));
        let [least, greatest] = tolerances.depth_mm;
        if self.depth_mm < least || self.depth_mm > greatest {
            faults.push(format!("{:.1} mm below the face ({least} to {greatest})", self.depth_mm));
        }
        let probe_from_scene = pose.inverse();
        let in_sector = |p: DVec3| Sector::polar(probe, DVec2::new(p.x, p.z)).is_some();
        let mut unseen = Vec::new();
        if !in_sector(probe_from_scene.transform_point(view.centre_mm)) {
            unseen.push("the plane's centre");
        }
        for landmark in &view.landmarks {
            let p = probe_from_scene.transform_point(landmark.position_mm);
            match landmark.within_mm.filter(|within_mm| p.y.abs() > *within_mm) {
                _ if !in_sector(p) => unseen.push(&landmark.name),
                Some(within_mm) => {
                    let (off_mm, name) = (up(p.y.abs()), &landmark.name);
                    faults.push(format!("{off_mm:.1} mm beside {name} (at most {within_mm})"));
                }
                None => {}
            }
        }
        if !unseen.is_empty() {
            faults.push(format!("not in the picture of {} mm depth: {}", probe.depth_mm, unseen.join(", ")));
        }
        faults
    }

    /// Whether the image shows the view.
    pub(crate) fn is_within(&self) -> bool {
        self.cost <= 1.0
    }
}
