//! Needle section of the page: points, values, events, and the tip's track from two sides.

use std::fmt::Write as _;

use glam::{DMat3, DQuat, DVec2, DVec3};

use super::tables::Table;
use crate::anatomy::section::Section;
use crate::exam::needle::{ElevationalProfile, NeedleReference, NeedleScore, NeedleTrack, Region};
use crate::pose::Pose;
use crate::report::html::{escape, points};
use crate::report::scene_view::border_mm;

/// Largest number of points of a track; a screen shows no more.
const POINTS_MAX: usize = 900;
/// Number of pieces of a track, each with one colour.
const PIECES: usize = 48;
/// Margin of a picture, mm.
const BORDER_MM: f64 = 6.0;
/// Level at the edge of the slice, dB, and largest half thickness that is searched, mm.
const EDGE_DB: f64 = -6.0;
const HALF_MAX_MM: f64 = 20.0;

/// A scored session with a needle.
#[derive(Clone, Copy)]
pub struct NeedleReport<'a> {
    /// The score.
    pub score: &'a NeedleScore,
    /// Way of the tip.
    pub track: &'a NeedleTrack,
    /// Exercise and scene.
    pub reference: &'a NeedleReference<'a>,
}

/// The section, as markup.
pub(super) fn section(report: &NeedleReport<'_>) -> String {
    let NeedleReport { score, track, reference } = report;
    let mark = match (score.points, score.not_judged) {
        (Some(points), _) => format!("<span class=\"good\">{points:.0} of 100 points</span>"),
        (None, why) => format!("<span class=\"bad\">not judged: {}</span>", escape(why.unwrap_or_default())),
    };
    let mut out = format!("<section><h2>{} {mark}</h2>\n", escape(&score.exercise));
    if score.points.is_none() {
        return out + "</section>\n";
    }
    out.push_str(&lost(score));
    let mut table = Table::new(["value of the needle", ""]);
    for (name, value) in score.numbers() {
        table.row("", [name.to_owned(), value]);
    }
    out.push_str(&table.end());
    out.push_str("<div class=\"row\">");
    out.push_str(&View::of_image(track, reference).figure(report));
    out.push_str(&View::from_above(track, reference).figure(report));
    out.push_str("</div>\n");
    out.push_str(&events(score));
    out + "</section>\n"
}

/// Table of the points that were lost.
fn lost(score: &NeedleScore) -> String {
    let note = format!("<p class=\"note\">{}</p>\n", escape(crate::exam::needle::POINTS));
    if score.deductions.is_empty() {
        return format!("<p class=\"good\">No points were lost.</p>\n{note}");
    }
    let mut table = Table::new(["points lost by", "points", "because"]);
    for deduction in &score.deductions {
        let cells =
            [deduction.criterion.name().to_owned(), format!("−{:.1}", deduction.points), escape(&deduction.reason)];
        table.row("", cells);
    }
    table.end() + &note
}

/// Table of the events on the tip's way.
fn events(score: &NeedleScore) -> String {
    if score.events.is_empty() {
        return String::new();
    }
    let mut table = Table::new(["event", "at", "place x, y, z in mm"]);
    for event in &score.events {
        let class = if event.is_forbidden_puncture() { "bad" } else { "" };
        let [x, y, z] = event.position_mm.to_array();
        let (what, at) = (escape(&event.to_string()), format!("{:.2} s", event.time_s));
        let cells = [what, at, format!("{x:.1}, {y:.1}, {z:.1}")];
        table.row(class, cells);
    }
    "<h2>Events on the way of the tip</h2>\n".to_owned() + &table.end()
}

/// Projection of the scene onto a plane.
struct View {
    /// Pose whose x is to the right in the picture, and whose z is down. Surfaces are cut with its plane y = 0.
    scene_from_view: Pose,
    /// Outline of the image or of the slice in the picture, mm.
    outline: Vec<DVec2>,
    caption: &'static str,
}

impl View {
    /// The image plane, with depth downwards.
    fn of_image(track: &NeedleTrack, reference: &NeedleReference<'_>) -> Self {
        let outline = border_mm(reference.probe, 24).map(|p| DVec2::new(p.x, p.z)).collect();
        let caption = "In the image plane: x to the right, depth z down; the outline is the image's";
        Self { scene_from_view: track.probe.unwrap_or_default(), outline, caption }
    }

    /// The plane across the beam at the depth where the tip was last, with the elevational axis downwards.
    fn from_above(track: &NeedleTrack, reference: &NeedleReference<'_>) -> Self {
        let probe = track.probe.unwrap_or_default();
        let last_mm = deepest_mm(track).unwrap_or(probe.position_mm);
        let depth_mm = probe.inverse().transform_point(last_mm).z;
        let turned = DQuat::from_mat3(&DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y));
        let scene_from_view = Pose {
            position_mm: probe.transform_point(DVec3::Z * depth_mm),
            orientation: (probe.orientation * turned).normalize(),
        };
        let border: Vec<f64> = border_mm(reference.probe, 24).map(|p| p.x).collect();
        let reach_mm = border.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let half_mm = half_slice_mm(reference.profile, depth_mm);
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let outline = corners.map(|(x, y)| DVec2::new(x * reach_mm, y * half_mm)).to_vec();
        let caption =
            "From the probe, at the depth of the target: x to the right, y down; the outline is the slice's, to −6 dB";
        Self { scene_from_view, outline, caption }
    }

    fn flat(&self, point_mm: DVec3) -> DVec2 {
        let local = self.scene_from_view.inverse().transform_point(point_mm);
        DVec2::new(local.x, local.z)
    }

    fn figure(&self, NeedleReport { score, track, reference }: &NeedleReport<'_>) -> String {
        let tissue: Vec<DVec2> =
            (0..track.tip_mm.len()).filter(|&i| track.in_tissue[i]).map(|i| self.flat(track.tip_mm[i])).collect();
        let ball = match &reference.exercise.target {
            Region::Ball { centre_mm, radius_mm } => Some((self.flat(*centre_mm), *radius_mm)),
            Region::Surface(_) => None,
        };
        let corners = ball.iter().flat_map(|&(centre, radius)| [centre - radius, centre + radius]);
        let all = || tissue.iter().copied().chain(corners.clone()).chain(self.outline.iter().copied());
        let low = all().fold(DVec2::INFINITY, DVec2::min) - BORDER_MM;
        let size = all().fold(DVec2::NEG_INFINITY, DVec2::max) + BORDER_MM - low;
        let mut out = format!(
            "<figure><svg viewBox=\"{:.1} {:.1} {:.1} {:.1}\" style=\"max-height:420px\"><polygon class=\"sector\" points=\"{}\"/>",
            low.x,
            low.y,
            size.x,
            size.y,
            points(self.outline.iter().map(|&p| p.into()))
        );
        for surface in &reference.scene.surfaces {
            let class = match (
                reference.exercise.target.is_surface(&surface.name),
                reference.exercise.forbids(&surface.name),
            ) {
                (true, _) => "surface measured",
                (false, true) => "caliper",
                (false, false) => continue,
            };
            let path = path(&Section::of(&surface.mesh, &self.scene_from_view, 0.0), low, low + size);
            let _ = write!(
                out,
                "<path class=\"line {class}\" d=\"{path}\"><title>{}</title></path>",
                escape(&surface.name)
            );
        }
        if let Some((centre, radius)) = ball {
            let DVec2 { x, y } = centre;
            let _ =
                write!(out, "<circle class=\"line surface measured\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius:.1}\"/>");
        }
        out.push_str(&coloured(&tissue));
        let mut dot = |point_mm: DVec3, colour: &str, title: &str| {
            let DVec2 { x, y } = self.flat(point_mm);
            let (radius, title) = (0.012 * size.x, escape(title));
            let _ = write!(
                out,
                "<circle style=\"fill:var(--{colour})\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius:.1}\"><title>{title}</title></circle>"
            );
        };
        for event in score.forbidden() {
            dot(event.position_mm, "bad", &format!("{event}, at {:.1} s", event.time_s));
        }
        if let Some(entry) = score.entry {
            dot(entry.position_mm, "d", "entry");
        }
        if let Some(reached) = score.reached {
            dot(reached.position_mm, "good", "target reached");
        }
        let _ = write!(
            out,
            "</svg><figcaption>{}, {:.0} mm wide. The tip's track in tissue from blue over red to orange; dots: entry (blue), \
             target reached (green), forbidden punctures (red); solid: target, dashed: forbidden</figcaption></figure>",
            self.caption, size.x
        );
        out
    }
}

/// Position of the tip where the target was reached, or where it was last in tissue.
fn deepest_mm(track: &NeedleTrack) -> Option<DVec3> {
    let last = track.in_tissue.iter().rposition(|&inside| inside);
    track.reached.map(|reached| reached.position_mm).or(last.map(|i| track.tip_mm[i]))
}

/// Half of the slice's thickness at a depth, mm, by bisection.
fn half_slice_mm(profile: &dyn ElevationalProfile, depth_mm: f64) -> f64 {
    let (mut low, mut high) = (0.0, HALF_MAX_MM);
    for _ in 0..30 {
        let middle = 0.5 * (low + high);
        if profile.level_db(middle, depth_mm) >= EDGE_DB { low = middle } else { high = middle }
    }
    low
}

/// A track in pieces with one colour each, from blue at the start to orange at the end.
fn coloured(track: &[DVec2]) -> String {
    let thin: Vec<_> = track.iter().copied().step_by(track.len().div_ceil(POINTS_MAX).max(1)).collect();
    let pieces = PIECES.min(thin.len());
    let mut out = String::new();
    for piece in 0..pieces {
        let (first, last) = (piece * thin.len() / pieces, ((piece + 1) * thin.len() / pieces).min(thin.len() - 1));
        let hue = 215.0 + 170.0 * piece as f64 / pieces as f64;
        let all = points(thin[first..=last.max(first)].iter().map(|&p| p.into()));
        let _ = write!(out, "<polyline class=\"line\" style=\"stroke:hsl({hue:.0} 70% 50%)\" points=\"{all}\"/>");
    }
    out
}

/// Segments of a section with an end in the picture, as an SVG path.
fn path(section: &Section, low: DVec2, high: DVec2) -> String {
    let is_in = |p: DVec2| p.cmpge(low).all() && p.cmple(high).all();
    let shown = section.segments_mm.iter().filter(|[a, b]| is_in(*a) || is_in(*b));
    shown.fold(String::new(), |mut out, [a, b]| {
        let _ = write!(out, "M{:.1} {:.1}L{:.1} {:.1}", a.x, a.y, b.x, b.y);
        out
    })
}
