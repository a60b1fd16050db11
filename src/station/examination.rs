//! Examination of a station: faults of its scene, tracker and calibration, and the aberration in front of its probe.

use std::fmt;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::Station;
use super::setup_check::{SetupFinding, check_setup};
use crate::anatomy::doctor::aberration::Summary;
use crate::anatomy::doctor::{DoctorReport, Settings, Severity, examine};
use crate::anatomy::{SceneError, TissueTable, import};
use crate::names::counted;
use crate::pose::Pose;
use crate::tracker::Transport;
use crate::tracker::devices::Devices;
use crate::transducer::{Probe, aberration};

/// Findings about a scene and its station. [`Display`](fmt::Display) lists them with their remedies.
#[derive(Debug, Serialize)]
pub struct Examination {
    /// File of the scene.
    pub path: PathBuf,
    /// Findings about the scene.
    #[serde(flatten)]
    pub report: DoctorReport,
    /// Findings about the station's tracker and calibration; empty without a station.
    pub setup: Vec<SetupFinding>,
    /// Aberration at several depths; empty without a pose, or if the scene has errors.
    pub aberration: Vec<Summary>,
    /// Path of the station file, if its tracker has a network address. Such a tracker is not contacted.
    #[serde(skip)]
    pub untried: Option<PathBuf>,
}

impl Examination {
    /// Examines the scene at `path` with the tissues, probe and pose of a station, or with the built-in ones. `pose`
    /// replaces the station's pose. `progress` receives the number of examined triangles and their total number, from
    /// several threads.
    ///
    /// # Errors
    /// Errors of [`examine`].
    pub fn of(
        path: &Path,
        station: Option<&Station>,
        pose: Option<Pose>,
        builtin: &TissueTable,
        progress: &(dyn Fn(usize, usize) + Sync),
    ) -> Result<Self, SceneError> {
        let tissues = station.map_or(builtin, |station| &station.tissues);
        let own = tissues.names().iter().filter(|name| builtin.index_of(name).is_none());
        // The background counts as a used tissue, although no surface has it.
        let own_tissues: Vec<String> =
            own.filter(|name| station.is_none_or(|station| station.background != **name)).cloned().collect();
        let probe = station.map_or_else(Probe::default, |station| station.probe);
        let pose = pose.or(station.and_then(|station| station.default_pose));
        let background = station.and_then(|station| tissues.index_of(&station.background));
        let start = pose.map(|pose| (pose, probe.depth_mm));
        let report = examine(path, &Settings { tissues, own_tissues: &own_tissues, background, start }, progress)?;
        let aberration = match pose.filter(|_| report.count(Severity::Error) == 0) {
            Some(pose) => aberration(&import::load(path, tissues, background.unwrap_or_default())?, &probe, &pose),
            None => Vec::new(),
        };
        let listed =
            |station: &Station| matches!(station.tracker.transport, Transport::Serial { .. } | Transport::Hid { .. });
        let devices = station.filter(|station| listed(station)).and_then(|_| Devices::list().ok());
        let setup = station.map_or_else(Vec::new, |station| check_setup(station, report.bounds_mm, devices.as_ref()));
        let is_remote =
            |station: &Station| matches!(station.tracker.transport, Transport::Tcp { .. } | Transport::Udp { .. });
        let untried = station.filter(|station| is_remote(station)).map(|station| station.path.clone());
        Ok(Self { path: path.to_owned(), report, setup, aberration, untried })
    }

    /// Number of findings of `severity`, about the scene and the station together.
    pub fn count(&self, severity: Severity) -> usize {
        self.report.count(severity) + self.setup.iter().filter(|finding| finding.severity == severity).count()
    }
}

impl fmt::Display for Examination {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { report, setup, aberration, untried, .. } = self;
        let of = format!("{}, {}", counted(report.surfaces, "surface"), counted(report.triangles, "triangle"));
        if report.findings.is_empty() && setup.is_empty() {
            writeln!(f, "nothing is wrong: {of}")?;
        } else {
            for finding in &report.findings {
                writeln!(f, "{:8} {finding}\n         {}", finding.severity.to_string(), finding.remedy)?;
            }
            setup.iter().try_for_each(|finding| writeln!(f, "{finding}"))?;
            let names = [(Severity::Error, "error"), (Severity::Warning, "warning"), (Severity::Note, "note")];
            let [errors, warnings, notes] = names.map(|(severity, name)| counted(self.count(severity), name));
            writeln!(f, "\n{errors}, {warnings}, {notes} in {of}")?;
        }
        aberration.iter().try_for_each(|summary| writeln!(f, "{summary}"))?;
        let Some(station) = untried else { return Ok(()) };
        writeln!(f, "the tracker was not tried: `insonify trackers {}` listens to it", station.display())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_line_tells_of_a_tracker_that_was_not_tried() {
        let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/scenes/sphere.glb");
        let builtin = TissueTable::builtin().unwrap();
        let last_line = |tracker: &str| {
            let text = format!("[scene]\npath = '{scene}'\nbackground = 'liver'\n[tracker]\n{tracker}");
            let parsed = Station::parse(&text, Path::new("")).unwrap();
            let station = Station { path: "s.toml".into(), ..parsed };
            let found = Examination::of(Path::new(scene), Some(&station), None, &builtin, &|_, _| ()).unwrap();
            found.to_string().lines().last().unwrap().to_owned()
        };
        let told = "the tracker was not tried: `insonify trackers s.toml` listens to it";
        assert_eq!(last_line("transport = 'tcp'\nprotocol = 'ascii-line'\naddress = 'h:1'\n"), told);
        assert!(last_line("transport = 'mock'\n").starts_with("nothing is wrong"));
    }
}
