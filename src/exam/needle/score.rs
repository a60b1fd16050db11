//! Score of a session with a needle.

use std::fmt;

use glam::DVec3;
use serde::Serialize;

use super::event::NeedleEvent;
use super::exercise::Region;
use super::passes::{Passes, passes};
use super::points::{Deduction, POINTS, Values, deductions, points};
use super::sample::Sample;
use super::target::TargetDistance;
use super::track::{NeedleReference, NeedleTrack};
use super::watch::Moment;
use crate::anatomy::BvhError;

/// Interval over which positions are averaged before paths are measured, s. It suppresses tremor.
const PATH_STEP_S: f64 = 0.1;

/// Time around the end of the last pass in which a visible tip counts, s.
const END_S: f64 = 0.5;

/// Score of a session with a needle.
///
/// The **attempt** is the time from the entry to the target. If the target isn't reached, it ends at the deepest
/// position of the last pass. Times are since the session's start, positions in the scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NeedleScore {
    /// Display name of the exercise.
    pub exercise: String,
    /// Points, 0..=100; `None` if nothing could be judged.
    pub points: Option<f64>,
    /// Reason why nothing could be judged; `None` if something was.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub not_judged: Option<&'static str>,
    /// Points lost, by criterion.
    pub deductions: Vec<Deduction>,
    /// Entry into the first surface.
    pub entry: Option<Moment>,
    /// Name of that surface, if the crossing was seen.
    pub entry_surface: Option<String>,
    /// Whether the entry was where the exercise wants it; `None` without an entry or such a wish.
    pub right_entry: Option<bool>,
    /// Moment at which the target was first reached; `None` if it never was.
    pub reached: Option<Moment>,
    /// Time from the entry to the target, s.
    pub time_to_target_s: Option<f64>,
    /// Time of the tip in tissue in the whole session, s.
    pub tissue_s: f64,
    /// Path length of the tip in tissue in the attempt, mm.
    pub path_mm: f64,
    /// Distance between the ends of that path over its length, 0..=1.
    pub straightness: f64,
    /// Mean angle between the shaft and the image plane in the attempt, degrees; `None` without an image.
    pub angle_deg: Option<f64>,
    /// Mean distance of the tip from the image plane in the attempt, mm; `None` without an image.
    pub offset_mm: Option<f64>,
    /// Share of the attempt with the tip visible, 0..=1.
    pub visible: f64,
    /// Whether the tip was visible at the deepest position of the last pass, or within half a second of it.
    pub visible_at_end: bool,
    /// Number of passes in the attempt: 1, and one for each withdrawal and new advance of more than 5 mm.
    pub passes: usize,
    /// Largest distance of the tip in the attempt from the line through entry and target, mm.
    pub sideways_mm: f64,
    /// Distance between the target and the deepest position of the last pass, mm; 0 in the target.
    pub final_mm: f64,
    /// Events of the whole session.
    pub events: Vec<NeedleEvent>,
}

impl NeedleScore {
    /// Judges the way of the tip in a session, which may still go on.
    ///
    /// # Errors
    /// The scene has no triangles, or too many coincident ones.
    pub fn of(track: &NeedleTrack, reference: &NeedleReference<'_>) -> Result<Self, BvhError> {
        let mut score = Self {
            exercise: reference.exercise.name.clone(),
            points: None,
            not_judged: None,
            deductions: Vec::new(),
            entry: track.entry,
            entry_surface: None,
            right_entry: None,
            reached: track.reached,
            time_to_target_s: None,
            tissue_s: (0..track.time_s.len())
                .filter(|&i| track.in_tissue[i])
                .fold(0.0, |all, i| all + track.lasts_s(i)),
            path_mm: 0.0,
            straightness: 1.0,
            angle_deg: None,
            offset_mm: None,
            visible: 0.0,
            visible_at_end: false,
            passes: 0,
            sideways_mm: 0.0,
            final_mm: 0.0,
            events: track.events.clone(),
        };
        match track.entry {
            None if track.time_s.is_empty() => score.not_judged = Some("the session has no pose of the needle"),
            None => score.not_judged = Some("the tip of the needle was never in a surface of the scene"),
            Some(entry) => judge(&mut score, track, entry, reference)?,
        }
        Ok(score)
    }

    /// Punctures of forbidden surfaces.
    pub fn forbidden(&self) -> impl Iterator<Item = &NeedleEvent> {
        self.events.iter().filter(|event| event.is_forbidden_puncture())
    }
}

/// Judges a session with a needle. `samples` are in ascending time. Also returns the way of the tip.
///
/// # Errors
/// The scene has no triangles, or too many coincident ones.
pub fn score(samples: &[Sample], reference: &NeedleReference<'_>) -> Result<(NeedleScore, NeedleTrack), BvhError> {
    let track = NeedleTrack::of(samples, reference)?;
    Ok((NeedleScore::of(&track, reference)?, track))
}

/// Fills in all values that need an entry.
fn judge(
    score: &mut NeedleScore,
    track: &NeedleTrack,
    entry: Moment,
    reference: &NeedleReference<'_>,
) -> Result<(), BvhError> {
    let first = track.time_s.partition_point(|&time_s| time_s < entry.time_s);
    let deepest = first + passes(&track.advance_mm[first..]).deepest;
    let deepest = deepest.min(track.time_s.len().saturating_sub(1));
    let last_pass = Moment { time_s: track.time_s[deepest], position_mm: track.tip_mm[deepest] };
    // A target before the entry is one outside all surfaces.
    let reached = track.reached.filter(|reached| reached.time_s >= entry.time_s);
    let end = reached.unwrap_or(last_pass);
    let attempt = first..track.time_s.partition_point(|&time_s| time_s <= end.time_s).max(first);
    let Passes { count, .. } = passes(&track.advance_mm[attempt.clone()]);
    score.passes = count;
    score.reached = reached;
    score.time_to_target_s = reached.map(|reached| reached.time_s - entry.time_s);

    let way = way(track, attempt.clone(), entry, end);
    score.path_mm = way.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
    let chord_mm = entry.position_mm.distance(end.position_mm);
    score.straightness = if score.path_mm > 0.0 { (chord_mm / score.path_mm).min(1.0) } else { 1.0 };
    let aim_mm = match (&reference.exercise.target, reached) {
        (_, Some(reached)) => reached.position_mm,
        (Region::Ball { centre_mm, .. }, None) => *centre_mm,
        (Region::Surface(_), None) => end.position_mm,
    };
    score.sideways_mm = way.iter().map(|point| from_line_mm(*point, entry.position_mm, aim_mm)).fold(0.0, f64::max);
    let target = TargetDistance::of(&reference.exercise.target, reference.scene)?;
    score.final_mm = target.distance_mm(last_pass.position_mm);

    let whole_s: f64 = attempt.clone().map(|i| track.lasts_s(i)).sum();
    let seen = |i: usize| Some((track.lasts_s(i), (*track.slice.get(i)?)?));
    let shown: Vec<_> = attempt.filter_map(seen).collect();
    let shown_s: f64 = shown.iter().map(|(s, _)| s).sum();
    let mean = |value: &dyn Fn(usize) -> f64| {
        (shown_s > 0.0).then(|| (0..shown.len()).map(|i| shown[i].0 * value(i)).sum::<f64>() / shown_s)
    };
    score.angle_deg = mean(&|i| shown[i].1.angle_deg);
    score.offset_mm = mean(&|i| shown[i].1.offset_mm);
    let visible_s = shown.iter().filter(|(_, slice)| slice.visible).fold(0.0, |all, (s, _)| all + s);
    score.visible = if whole_s > 0.0 { visible_s / whole_s } else { 0.0 };
    let near_end = |i: &usize| (track.time_s[*i] - last_pass.time_s).abs() <= END_S;
    let is_visible = |i: usize| track.slice[i].is_some_and(|slice| slice.visible);
    score.visible_at_end = (0..track.time_s.len()).filter(near_end).any(is_visible);

    let entered = track.events.iter().find(|event| event.kind.is_entry() && event.time_s == entry.time_s);
    score.entry_surface = entered.and_then(|event| event.surface.clone());
    score.right_entry = reference.exercise.entry.as_ref().map(|region| match region {
        surface @ Region::Surface(_) => score.entry_surface.as_ref().is_some_and(|name| surface.is_surface(name)),
        Region::Ball { centre_mm, radius_mm } => entry.position_mm.distance(*centre_mm) <= *radius_mm,
    });
    score.deductions = deductions(&Values {
        approach: reference.exercise.approach,
        allowed_s: reference.exercise.time_s,
        time_to_target_s: score.time_to_target_s,
        final_mm: score.final_mm,
        visible: score.visible,
        visible_at_end: score.visible_at_end,
        angle_deg: score.angle_deg,
        straightness: score.straightness,
        passes: score.passes,
        sideways_mm: score.sideways_mm,
        right_entry: score.right_entry.unwrap_or(true),
        forbidden: score.forbidden().count(),
    });
    score.points = Some(points(&score.deductions));
    Ok(())
}

/// Positions of the tip in tissue from `entry` to `end`, averaged over [`PATH_STEP_S`] between these two.
fn way(track: &NeedleTrack, attempt: std::ops::Range<usize>, entry: Moment, end: Moment) -> Vec<DVec3> {
    let mut way = vec![entry.position_mm];
    let step = |i: usize| ((track.time_s[i] - entry.time_s) / PATH_STEP_S) as i64;
    let inside: Vec<usize> = attempt.filter(|&i| track.in_tissue[i]).collect();
    for together in inside.chunk_by(|&a, &b| step(a) == step(b)) {
        let sum: DVec3 = together.iter().map(|&i| track.tip_mm[i]).sum();
        way.push(sum / together.len() as f64);
    }
    way.push(end.position_mm);
    way
}

/// Distance of a point from the line through two points, mm; from the first one if they coincide.
fn from_line_mm(point: DVec3, a: DVec3, b: DVec3) -> f64 {
    let from_a = point - a;
    (b - a).try_normalize().map_or(from_a.length(), |along| from_a.reject_from_normalized(along).length())
}

impl fmt::Display for NeedleScore {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(points) = self.points else {
            return writeln!(f, "{}: not judged: {}", self.exercise, self.not_judged.unwrap_or_default());
        };
        writeln!(f, "{}: {points:.0} of 100 points", self.exercise)?;
        self.numbers().iter().try_for_each(|(name, value)| writeln!(f, "{name:28} {value}"))?;
        if !self.deductions.is_empty() {
            writeln!(f, "\npoints lost:")?;
        }
        for Deduction { criterion, points, reason } in &self.deductions {
            writeln!(f, "{:28} -{points:<6.1} {reason}", criterion.name())?;
        }
        if !self.events.is_empty() {
            writeln!(f, "\nevents on the way of the tip:")?;
        }
        for event in &self.events {
            let [x, y, z] = event.position_mm.to_array();
            writeln!(f, "{:7.2} s  at [{x:.1}, {y:.1}, {z:.1}] mm  {event}", event.time_s)?;
        }
        writeln!(f, "({POINTS})")
    }
}

impl NeedleScore {
    /// Names and values for a list, in words.
    pub fn numbers(&self) -> Vec<(&'static str, String)> {
        let or_dash =
            |value: Option<f64>, unit: &str| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.1}{unit}"));
        let reached = self.reached.map_or_else(|| "no".to_owned(), |reached| format!("at {:.1} s", reached.time_s));
        vec![
            ("target reached", reached),
            ("time from entry to target", or_dash(self.time_to_target_s, " s")),
            ("distance at the end", format!("{:.1} mm", self.final_mm)),
            ("time in tissue", format!("{:.1} s", self.tissue_s)),
            ("path of the tip in tissue", format!("{:.1} mm", self.path_mm)),
            ("straightness", format!("{:.2}", self.straightness)),
            ("tip visible", format!("{:.0} % of the time", 100.0 * self.visible)),
            ("tip visible at the end", if self.visible_at_end { "yes" } else { "no" }.to_owned()),
            ("shaft to image plane", or_dash(self.angle_deg, "°")),
            ("tip to image plane", or_dash(self.offset_mm, " mm")),
            ("passes", self.passes.to_string()),
            ("sideways sweep", format!("{:.1} mm", self.sideways_mm)),
            ("forbidden punctures", self.forbidden().count().to_string()),
        ]
    }
}
