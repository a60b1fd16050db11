//! Score of a session against a scene's standard planes.
//!
//! A plane is **found** when the image shows one of its views within the tolerances for at least [`HOLD_S`], without a
//! break and with the probe on the skin. The cost of a moment is the largest ratio of a deviation to its tolerance; the
//! **best second** has the smallest mean cost. Angles, distances and measurements refer to that second, even if the
//! plane was not found.
//!
//! Planes and skin refer to the scene at rest. Their motion under the probe (2 mm in the phantom, by the mother's
//! breathing) is not compensated. Generated sessions ignore it, too.
//!
//! Points per plane, 0..=100: 0 if it was not found, else 50, plus 20 for the angle, 20 for the distance and 10 for a
//! steady hold. Angle and distance score fully up to a quarter of the tolerance, and 0 at the tolerance. A hold scores
//! fully up to 0.5 mm RMS, and 0 from 3 mm. The weights are assumed. `docs/commands.md` says the same ("Points").

mod marks;
mod misplaced;
mod table;
mod track;
mod why_not;

use std::collections::BTreeMap;

use glam::DVec3;
use serde::Serialize;

use marks::MarkScores;
pub use marks::{CaliperScore, TextScore};
pub use misplaced::MisplacedTime;
pub use track::{Track, is_on_skin};
use track::{best_second, length_s, path_mm, stretches};

use super::measure::{Measured, measure};
use super::offset::Offset;
use crate::acoustics::pulse::FWHM_PER_SIGMA;
use crate::anatomy::planes::{Caliper, CaliperKind, StandardPlane, View};
use crate::anatomy::{Mesh, Skin};
use crate::pose::{Pose, TimedPose, angle_between};
use crate::recording::Event;
use crate::settings::ContactSettings;
use crate::transducer::{Probe, Sector};

/// Required hold of a plane, s.
pub const HOLD_S: f64 = 1.0;

/// Text for a mark whose picture shows no plane within its tolerances.
pub(crate) const NO_PLANE: &str = "no standard plane in this picture";

/// Explanation of the points, in one sentence.
pub(crate) const POINTS: &str = "Points of a plane that is found: 50, and up to 20 for the angle, 20 for the distance and 10 \
     for a steady hold, in the best second; 0 if it isn't found. The session has the mean of its planes. The weights are \
     assumed; docs/commands.md (Points) has the formula.";

/// Planes, skin and surfaces against which a session is scored, and the station's probe.
pub struct Reference<'a> {
    /// Planes that are scored.
    pub planes: Vec<&'a StandardPlane>,
    /// All planes of the scene. Measurements in the session are compared with the calipers of these planes.
    pub scene_planes: Vec<&'a StandardPlane>,
    /// Skin that the probe touches; without it, contact is assumed.
    pub skin: Option<&'a Skin>,
    /// Surfaces that the calipers name. Calipers whose surface is missing are not measured.
    pub surfaces: &'a BTreeMap<String, Mesh>,
    /// Gel and tolerance of the station.
    pub contact: &'a ContactSettings,
    /// Probe of the station.
    pub probe: &'a Probe,
    /// Image depth at each pose, mm. Poses after the end of the list have the probe's depth.
    pub depths_mm: &'a [f64],
}

impl Reference<'_> {
    /// Sentence on the source of the tolerances.
    pub fn tolerances(&self) -> String {
        let mut sources: Vec<&str> = Vec::new();
        for plane in &self.planes {
            let source = plane.tolerances.source.as_str();
            if !source.is_empty() && !sources.contains(&source) {
                sources.push(source);
            }
        }
        if sources.is_empty() {
            return "Tolerances are assumed, not published: see `insonify planes`.".to_owned();
        }
        format!("Tolerances: {}; see `insonify planes`.", sources.join("; "))
    }

    /// The station's probe, with the image depth at the pose with this index.
    pub fn probe_at(&self, index: usize) -> Probe {
        let depth_mm = self.depths_mm.get(index).copied().unwrap_or(self.probe.depth_mm);
        Probe { depth_mm, ..*self.probe }
    }
}

/// Score of a session.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Score {
    /// Mean of the planes' points, 0..=100; `None` if nothing could be judged.
    pub points: Option<f64>,
    /// Reason why nothing could be judged; `None` if something was.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub not_judged: Option<String>,
    /// Number of planes found.
    pub found: usize,
    /// Time from the first pose to the last, s.
    pub duration_s: f64,
    /// Path length of the probe's face, mm.
    pub path_mm: f64,
    /// Mean speed of the probe's face, mm/s.
    pub mean_speed_mm_s: f64,
    /// Share of poses with the probe on the skin, 0..=1.
    pub contact: f64,
    /// Mean part of the face in contact while the probe is on the skin, 0..=1.
    pub face_contact: f64,
    /// Scores of the planes.
    pub planes: Vec<PlaneScore>,
    /// Measurements made in the session itself, in their last state.
    pub calipers: Vec<CaliperScore>,
    /// Texts and body marks in the session, in their last state.
    pub texts: Vec<TextScore>,
    /// Events of marks that can't be read, with the reason.
    pub calipers_refused: Vec<String>,
}

/// Score of one plane.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct PlaneScore {
    /// Name of the plane.
    pub name: String,
    /// Display name.
    pub title: String,
    /// Name of the view nearest to the image; empty if the plane has only one view.
    pub view: String,
    /// Index of that view.
    #[serde(skip)]
    pub view_index: usize,
    /// Whether the plane was found.
    pub found: bool,
    /// Reason why the plane was not found; `None` if it was.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub why_not: Option<String>,
    /// Points, 0..=100; 0 if the plane was not found or not judged.
    pub points: f64,
    /// Start of the first hold, s since the start; `None` if the plane was not found.
    pub find_s: Option<f64>,
    /// Path length of the probe's face until the first hold, mm; `None` if the plane was not found.
    pub path_to_find_mm: Option<f64>,
    /// Longest hold, s.
    pub longest_hold_s: f64,
    /// Start of the best second, s since the start. If every second has a gap, this and all values of that second are
    /// `None`.
    pub best_s: Option<f64>,
    /// Pose at the best moment of the best second.
    #[serde(skip)]
    pub best_pose: Option<Pose>,
    /// Probe with its settings at the best moment.
    #[serde(skip)]
    pub best_probe: Option<Probe>,
    /// Offset from the plane, averaged over the best second.
    #[serde(flatten)]
    pub best: Option<Offset>,
    /// Number of landmarks of the view.
    pub landmarks: usize,
    /// RMS distance of the face from its mean position over the best second, mm.
    pub unsteady_mm: Option<f64>,
    /// Largest rotation relative to the best moment within the best second, degrees.
    pub unsteady_deg: Option<f64>,
    /// Mean depth of the face below the skin over the best second, mm; `None` off the skin.
    pub press_mm: Option<f64>,
    /// Measurements in the image of the best moment.
    pub measures: Vec<Measure>,
}

/// A measurement with its true value.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Measure {
    /// Name of the caliper.
    pub name: String,
    /// Display name.
    pub title: String,
    /// Measured length, mm; `None` if the image does not show enough.
    pub measured_mm: Option<f64>,
    /// True length, mm; `None` if it is unknown.
    pub true_mm: Option<f64>,
    /// Relative error: measured length over true length, minus one, percent; `None` if either is unknown.
    pub error_percent: Option<f64>,
    /// Points of the caliper in the image; `None` if the image does not show enough.
    #[serde(skip)]
    pub measured: Option<Measured>,
}

/// Compares a session with the reference. `poses` are `scene_from_probe`, in ascending time; `events` may include
/// marks.
///
/// Also returns the deviations at each pose.
pub fn score(poses: &[TimedPose], events: &[Event], reference: &Reference<'_>) -> (Score, Track) {
    let track = Track::of(poses, reference);
    let path = path_mm(&track);
    let planes: Vec<_> = reference
        .planes
        .iter()
        .zip(&track.offsets)
        .map(|(plane, offsets)| plane_score(plane, offsets, poses, &track, &path, reference))
        .collect();
    let MarkScores { calipers, texts, refused } = marks::marks(poses, events, reference);
    let duration_s = track.time_s.last().copied().unwrap_or(0.0);
    let path_mm = path.last().copied().unwrap_or(0.0);
    let mean = |sum: f64, count: usize| if count > 0 { sum / count as f64 } else { 0.0 };
    let touching: Vec<f64> =
        track.face.iter().zip(&track.contact).filter(|(_, contact)| **contact).map(|(part, _)| *part).collect();
    let not_judged = why_not::not_judged(&track.time_s);
    let points = mean(planes.iter().map(|p| p.points).sum(), planes.len());
    let score = Score {
        points: not_judged.is_none().then_some(points),
        not_judged,
        found: planes.iter().filter(|p| p.found).count(),
        duration_s,
        path_mm,
        mean_speed_mm_s: if duration_s > 0.0 { path_mm / duration_s } else { 0.0 },
        contact: mean(touching.len() as f64, track.contact.len()),
        face_contact: mean(touching.iter().sum(), touching.len()),
        planes,
        calipers,
        texts,
        calipers_refused: refused,
    };
    (score, track)
}

fn plane_score(
    plane: &StandardPlane,
    offsets: &[Offset],
    poses: &[TimedPose],
    track: &Track,
    path: &[f64],
    reference: &Reference<'_>,
) -> PlaneScore {
    let time_s = &track.time_s[..offsets.len()];
    let shown = |i: usize| track.contact[i] && offsets[i].is_within();
    let held = stretches(time_s, shown);
    let first_hold = held.iter().find(|s| length_s(time_s, s) >= HOLD_S - 1e-6);
    // Without skin contact there is no image, so the cost grows by one tolerance.
    let cost: Vec<f64> =
        offsets.iter().zip(&track.contact).map(|(o, contact)| o.cost + f64::from(u8::from(!contact))).collect();
    let window = best_second(time_s, &cost);
    let result = PlaneScore {
        name: plane.name.clone(),
        title: plane.title.clone(),
        found: first_hold.is_some(),
        find_s: first_hold.map(|&(first, _)| time_s[first]),
        path_to_find_mm: first_hold.map(|&(first, _)| path[first]),
        longest_hold_s: held.iter().map(|s| length_s(time_s, s)).fold(0.0, f64::max),
        ..PlaneScore::default()
    };
    let Some((start, end)) = window else {
        return PlaneScore { why_not: Some(why_not::NO_SECOND.to_owned()), ..result };
    };
    let held_s = result.longest_hold_s;
    let why_not =
        (!result.found).then(|| why_not::why_not(plane, offsets, poses, track, (start, end), held_s, reference));
    let result = PlaneScore { why_not, ..result };
    let Some(moment) = (start..=end).min_by(|&a, &b| cost[a].total_cmp(&cost[b])) else { return result };
    let pose = poses[moment].pose;
    let probe = reference.probe_at(moment);
    let Some((view_index, _)) = Offset::nearest(plane, &probe, &pose) else { return result };
    let Some(view) = plane.views.get(view_index) else { return result };

    let count = (end - start + 1) as f64;
    let mean_of = |f: fn(&Offset) -> f64| offsets[start..=end].iter().map(f).sum::<f64>() / count;
    let best = Offset {
        angle_deg: mean_of(|o| o.angle_deg),
        distance_mm: mean_of(|o| o.distance_mm),
        in_plane_deg: mean_of(|o| o.in_plane_deg),
        centring_mm: mean_of(|o| o.centring_mm),
        depth_mm: mean_of(|o| o.depth_mm),
        landmarks_seen: offsets[moment].landmarks_seen,
        cost: mean_of(|o| o.cost),
    };
    let window = &poses[start..=end];
    let mean = window.iter().map(|p| p.pose.position_mm).sum::<DVec3>() / count;
    let square = window.iter().map(|p| p.pose.position_mm.distance_squared(mean)).sum::<f64>() / count;
    let turn = window.iter().map(|p| angle_between(p.pose.orientation, pose.orientation)).fold(0.0, f64::max);
    let presses: Option<Vec<f64>> =
        reference.skin.and_then(|skin| window.iter().map(|p| skin.press_mm(&p.pose)).collect());

    let t = &plane.tolerances;
    let points = 50.0
        + 20.0 * falling(best.angle_deg / t.angle_deg, 0.25, 1.0)
        + 20.0 * falling(best.distance_mm / t.distance_mm, 0.25, 1.0)
        + 10.0 * falling(square.sqrt(), 0.5, 3.0);
    let measured = |c: &Caliper| measured(c, view, &pose, best.depth_mm, &probe, reference);
    PlaneScore {
        view: view.name.clone(),
        view_index,
        points: if result.found { points } else { 0.0 },
        best_s: Some(time_s[start]),
        best_pose: Some(pose),
        best_probe: Some(probe),
        landmarks: view.landmarks.len(),
        unsteady_mm: Some(square.sqrt()),
        unsteady_deg: Some(turn.to_degrees()),
        press_mm: presses.map(|all| all.iter().sum::<f64>() / count),
        measures: view.calipers.iter().map(measured).collect(),
        best: Some(best),
        ..result
    }
}

/// 1 up to `full`, 0 from `none` on, linear between them.
fn falling(value: f64, full: f64, none: f64) -> f64 {
    ((none - value) / (none - full)).clamp(0.0, 1.0)
}

/// Measurement of `caliper` in the image at `pose`, with its true value.
fn measured(
    caliper: &Caliper,
    view: &View,
    pose: &Pose,
    depth_mm: f64,
    probe: &Probe,
    reference: &Reference<'_>,
) -> Measure {
    let measured = cut(caliper, pose, depth_mm, reference).filter(|m| is_in_sector(caliper.kind, m, probe));
    let measured_mm = measured.as_ref().map(|m| m.length_mm);
    let true_mm = true_length_mm(caliper, view, reference);
    Measure {
        name: caliper.name.clone(),
        title: caliper.title.clone(),
        measured_mm,
        true_mm,
        error_percent: error_percent(measured_mm, true_mm),
        measured,
    }
}

/// Whether the image shows the measured structure: both ends of a line, or most of an ellipse.
fn is_in_sector(kind: CaliperKind, measured: &Measured, probe: &Probe) -> bool {
    const ELLIPSE_LEAST: f64 = 0.6;
    let inside = measured.points_mm.iter().filter(|p| Sector::polar(probe, **p).is_some()).count() as f64;
    let all = measured.points_mm.len() as f64;
    match kind {
        CaliperKind::Line => inside == all,
        CaliperKind::Ellipse => inside >= ELLIPSE_LEAST * all,
    }
}

fn cut(caliper: &Caliper, pose: &Pose, depth_mm: f64, reference: &Reference<'_>) -> Option<Measured> {
    let surface = reference.surfaces.get(&caliper.surface)?;
    let far = match &caliper.far_surface {
        Some(name) => Some(reference.surfaces.get(name)?),
        None => None,
    };
    measure(caliper, surface, far, pose, slice_mm(reference.probe, depth_mm))
}

/// Thickness of the image slice at `depth_mm`, mm: the two-way −6 dB width of the elevational beam.
pub fn slice_mm(probe: &Probe, depth_mm: f64) -> f64 {
    probe.elevational_sigma_mm(depth_mm.max(0.0)) * FWHM_PER_SIGMA
}

/// True length of `caliper`, mm: the value given in the plane, or else the length measured on the surfaces in the exact
/// plane. `None` if they can't be measured.
pub(crate) fn true_length_mm(caliper: &Caliper, view: &View, reference: &Reference<'_>) -> Option<f64> {
    /// Depth of the plane's centre below the probe that is assumed in the exact plane, mm.
    const DEPTH_MM: f64 = 70.0;
    caliper.true_mm.or_else(|| {
        let pose = Pose::looking(view.centre_mm + view.to_probe * DEPTH_MM, -view.to_probe, view.lateral);
        Some(cut(caliper, &pose, DEPTH_MM, reference)?.length_mm)
    })
}

fn error_percent(measured_mm: Option<f64>, true_mm: Option<f64>) -> Option<f64> {
    Some(100.0 * (measured_mm? / true_mm? - 1.0))
}
