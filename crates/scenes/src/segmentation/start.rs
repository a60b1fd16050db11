//! Start of an examination: acoustic windows of the patient, the first view, and a probe for that view.

use glam::DVec3;
use insonify_core::anatomy::planes::{StandardPlanes, View};
use insonify_core::anatomy::{Mesh, TissueTable};
use insonify_core::pose::csv::Named;
use insonify_core::suggest::did_you_mean;
use thiserror::Error;

use super::from_labels::Made;
use super::gain::PASSED_MRAYL;
use super::grid::CutPlane;
use super::probe_choice::{ProbeChoice, ProbeKind};
use super::skin_points::skin_points;
use super::windows::{BELOW_MM, Sight, WindowRow, look_at, windows};

/// Name of the window onto a lung.
const LUNG: &str = "lung";

/// Error if no probe position can be found.
#[derive(Debug, Error)]
pub enum StartError {
    /// No segment of the given name.
    #[error("--look-at {name}: the scene has no segment of that name{suggestion}; it has {known}")]
    Unknown {
        /// Name asked for.
        name: String,
        /// Nearest known name, as text to append, or empty.
        suggestion: String,
        /// Names of all segments.
        known: String,
    },
    /// No segment that could be shown.
    #[error("no segment becomes an organ: there is nothing to look at")]
    Nothing,
    /// An organ from which no line reaches the skin.
    #[error(
        "no line from `{name}` meets skin: the scan ends within the body around it, or the body's outline is wrong, as that of an \
         image whose values or kind were mistaken; use a scan of a larger part, or give the body's outline with --body"
    )]
    NoSkin {
        /// Name of the organ.
        name: String,
    },
}

/// Start of an examination: acoustic windows, first view and probe.
#[derive(Debug, Clone)]
pub struct Start {
    /// Standard planes with their acoustic windows on the patient; may be empty.
    pub planes: StandardPlanes,
    /// Table row of each window, with the hidden share of its target and the contact of the probe.
    pub windows: Vec<WindowRow>,
    /// Name of the segment in the first view.
    pub target: String,
    /// First view, including the probe's pose.
    pub view: View,
    /// Probe for the first view.
    pub probe: ProbeChoice,
    /// Points of the skin to touch with a stylus.
    pub points: Vec<Named<DVec3>>,
}

impl Start {
    /// Windows and first view of `surfaces`; `cuts` are the planes at which the scan ends. The view shows the segment
    /// `target`. Without `target`, the view shows the segment of the best window, or else the largest segment.
    ///
    /// # Errors
    /// A `target` that is no segment; no segment at all; a segment that can't be seen from any skin.
    pub fn of(
        surfaces: &[Made],
        cuts: Vec<CutPlane>,
        tissues: &TissueTable,
        target: Option<&str>,
    ) -> Result<Self, StartError> {
        let is_hard = |made: &Made| {
            let tissue = tissues.index_of(&made.tissue).and_then(|i| tissues.tissues().get(i));
            tissue.is_some_and(|t| !PASSED_MRAYL.contains(&t.impedance_mrayl()))
        };
        let no_skin = |name: &str| StartError::NoSkin { name: name.to_owned() };
        let segments: Vec<&Made> = surfaces.iter().filter(|s| s.segment.is_some() && s.voxels_mm3.is_some()).collect();
        let name = |made: &Made| made.segment.clone().unwrap_or_default();
        if let Some(target) = target
            && !segments.iter().any(|made| made.segment.as_deref() == Some(target))
        {
            let known: Vec<String> = segments.iter().map(|made| name(made)).collect();
            let suggestion = did_you_mean(target, known.iter().map(String::as_str));
            return Err(StartError::Unknown { name: target.to_owned(), suggestion, known: known.join(", ") });
        }
        if segments.is_empty() {
            return Err(StartError::Nothing);
        }
        let sight = Sight::new(surfaces, cuts, is_hard).ok_or(StartError::Nothing)?;
        let (planes, rows) = windows(surfaces, &sight);
        let target = match target {
            Some(target) => target.to_owned(),
            None => first_target(&planes, &rows, &segments),
        };
        let view = look_at(surfaces, &sight, &target).ok_or_else(|| no_skin(&target))?;
        let pose = view.pose.ok_or_else(|| no_skin(&target))?;
        let empty = Mesh::default();
        let mesh = segments.iter().find(|made| name(made) == target).map_or(&empty, |made| &made.mesh);
        let mut probe = ProbeChoice::for_organ(&pose, &target, mesh);
        if probe.kind == ProbeKind::Convex {
            let deepest_mm = rows.iter().map(|row| row.depth_mm).fold(0.0, f64::max);
            probe = ProbeChoice::of_depth(Some(probe.kind), probe.depth_mm.max(deepest_mm + BELOW_MM));
        }
        let points = skin_points(surfaces, &sight);
        Ok(Self { planes, windows: rows, target, view, probe, points })
    }
}

/// Name of the segment of the best window, or else of the largest segment.
fn first_target(planes: &StandardPlanes, rows: &[WindowRow], segments: &[&Made]) -> String {
    let unseen = |row: &WindowRow| row.hidden + (1.0 - row.touching);
    // A lung shows little: it is the last choice.
    let cost = |row: &WindowRow| if row.name == LUNG { 2.0 + unseen(row) } else { unseen(row) };
    let best = rows.iter().min_by(|a, b| cost(a).total_cmp(&cost(b)));
    let plane = best.and_then(|row| planes.planes.iter().find(|plane| plane.name == row.name));
    let outline = plane.and_then(|plane| plane.views.first()?.outlines.first().cloned());
    let of_outline = outline.and_then(|name| segments.iter().find(|made| made.name == name)?.segment.clone());
    let volume = |made: &&&Made| made.voxels_mm3.unwrap_or(0.0);
    let largest = || segments.iter().max_by(|a, b| volume(a).total_cmp(&volume(b)))?.segment.clone();
    of_outline.or_else(largest).unwrap_or_default()
}
