//! Files made from a patient's data: scene, station, standard planes, recording, report.

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::builder::PossibleValuesParser;
use glam::DVec3;
use insonify::anatomy::doctor::{Defect, Severity};
use insonify::anatomy::export::{LabelledSurface, SceneExtras, write_scene_glb};
use insonify::anatomy::{Axes, Motion, Skin, TissueTable, import, planes};
use insonify::exam::slide;
use insonify::files::Outputs;
use insonify::names::{counted, printable};
use insonify::pose::csv::Named;
use insonify::report::segmentation as page;
use insonify::segmentation::details;
use insonify::segmentation::from_labels::{FASCIA_MM, Facts, Made};
use insonify::segmentation::gain::{Gain, Layer};
use insonify::segmentation::grid::CutPlane;
use insonify::segmentation::part_kinds::PART_KINDS;
use insonify::segmentation::skin_points;
use insonify::segmentation::start::Start;
use insonify::segmentation::station_text::station_text;
use insonify::segmentation::summary::{Row, Summary, remarks_of_missing, remarks_of_twins};
use insonify::sink::{write_json, write_text};
use insonify::station::{Examination, SceneFile};

use super::super::backend::BackendArgs;
use super::super::progress::Progress;
use super::super::{Classify, Failure, input, output};
use super::pictures;

/// Duration of the recorded slide over the first view, s, and its extent to each side, mm.
const SLIDE_S: f64 = 20.0;
const SLIDE_MM: f64 = 60.0;

/// Word for all parts in `--without`.
const ALL: &str = "all";

/// Options of all scenes of patients.
#[derive(Debug, clap::Args)]
pub(super) struct OutputArgs {
    /// Scene to write (.glb); station (.toml), planes (.planes.json) and skin points (.points.csv) go next to it
    #[arg(long, value_name = "FILE")]
    pub(super) out: PathBuf,

    /// Overwrite existing files
    #[arg(long)]
    pub(super) force: bool,

    /// Segment that the station's first view shows [default: that of the best acoustic window, else the largest]
    #[arg(long, value_name = "NAME")]
    pub(super) look_at: Option<String>,

    /// Leave out assumed parts that no label shows: capsule, gut_layers, pericardium, pleura, fascia, diaphragm, valves,
    /// kidney (pyramids and sinus), liver_vessels, or all
    #[arg(long, value_name = "PART", value_delimiter = ',', value_parser = part())]
    pub(super) without: Vec<String>,

    /// Recording (.mcap) to write, of a probe that slides across the first view
    #[arg(long, value_name = "FILE")]
    pub(super) probe_path: Option<PathBuf>,

    /// Page to write: pictures, volumes, repairs and missing anatomy (.html)
    #[arg(long, value_name = "FILE", value_parser = input::html)]
    pub(super) report: Option<PathBuf>,

    #[command(flatten)]
    pub(super) backend: BackendArgs,

    /// Print the summary as JSON
    #[arg(long)]
    pub(super) json: bool,
}

/// Surfaces of a scene, and their origin.
pub(super) struct Source {
    /// Path of the segmentation, or of its first file.
    pub(super) path: PathBuf,
    /// Surfaces by increasing priority.
    pub(super) surfaces: Vec<Made>,
    /// Planes at which the scan ends inside the body.
    pub(super) cuts: Vec<CutPlane>,
    pub(super) facts: Option<Facts>,
    pub(super) unmapped: Vec<String>,
    pub(super) repairs: Vec<String>,
    pub(super) remarks: Vec<String>,
}

/// Accepts the names of parts that can be left out.
fn part() -> PossibleValuesParser {
    PossibleValuesParser::new(PART_KINDS.iter().map(|part| part.name).chain([ALL]))
}

impl OutputArgs {
    /// Names of the parts that are left out.
    pub(super) fn left_out(&self) -> Vec<String> {
        let is_out = |name: &str| self.without.iter().any(|without| without == name || without == ALL);
        PART_KINDS.iter().filter(|part| is_out(part.name)).map(|part| part.name.to_owned()).collect()
    }

    /// Thickness of the fascia under the fat, mm; 0 if it is left out.
    pub(super) fn fascia_mm(&self) -> f64 {
        if self.left_out().iter().any(|part| part == "fascia") { 0.0 } else { FASCIA_MM }
    }

    fn station_file(&self) -> PathBuf {
        self.out.with_extension("toml")
    }

    fn points_file(&self) -> PathBuf {
        skin_points::points_path(&self.out)
    }

    /// Checks that outputs have the right suffixes, may be written, and are none of `inputs`.
    pub(super) fn check(&self, inputs: &[&Path]) -> Result<(), Failure> {
        if self.out.extension().is_none_or(|extension| extension != "glb") {
            return Err(Failure::Input(anyhow!("--out is {}; a scene's name ends in .glb", self.out.display())));
        }
        if let Some(path) = self.probe_path.as_ref().filter(|path| path.extension().is_none_or(|e| e != "mcap")) {
            return Err(Failure::Input(anyhow!(
                "--probe-path is {}; a recording's name ends in .mcap",
                path.display()
            )));
        }
        let mut outputs = Outputs::apart_from(inputs)
            .file("--out", &self.out, self.force)?
            .file("--out", &self.station_file(), self.force)?
            .file("--out", &self.points_file(), self.force)?
            .file("--out", &planes::planes_path(&self.out), self.force)?;
        for (option, path) in [("--probe-path", &self.probe_path), ("--report", &self.report)] {
            if let Some(path) = path {
                outputs = outputs.file(option, path, self.force)?;
            }
        }
        Ok(())
    }

    /// Chooses the first view, writes all files and prints the summary. After an error, the files written so far are
    /// removed.
    pub(super) fn finish(&self, source: Source, progress: Progress) -> Result<(), Failure> {
        let mut files = Vec::new();
        let summary = self.write(source, progress, &mut files).inspect_err(|_| {
            // The first error is returned, even if a file can't be removed.
            files.iter().for_each(|file| drop(std::fs::remove_file(file)));
        })?;
        if self.json { output::json(&summary) } else { output::text(&summary) }
    }

    /// Writes all files. `files` receives the paths of files that were begun, for removal after an error.
    fn write(&self, source: Source, progress: Progress, files: &mut Vec<PathBuf>) -> Result<Summary, Failure> {
        let tissues = TissueTable::builtin().other()?;
        let Source { path, mut surfaces, cuts, facts, unmapped, repairs, mut remarks } = source;
        // Names of meshes and segments come from files, so they may hold any characters.
        for made in &mut surfaces {
            made.name = printable(&made.name).into_owned();
            made.segment = made.segment.take().map(|segment| printable(&segment).into_owned());
        }
        remarks.extend(details::add(&mut surfaces, &self.left_out()));
        progress.set(97, 100);
        let start = Start::of(&surfaces, cuts, &tissues, self.look_at.as_deref()).input()?;
        let slide = match &self.probe_path {
            Some(_) => {
                let corners: Vec<_> = surfaces.iter().flat_map(|s| s.mesh.corners_mm()).collect();
                let skin = Skin::of_triangles(corners).other()?;
                Some(slide::slide(&start.view, &skin, SLIDE_MM, SLIDE_S)?)
            }
            None => None,
        };
        remarks.extend(remarks_of_missing(&surfaces));
        // Meshes of several pieces are remarked on when they are read.
        remarks.extend(facts.as_ref().map(|_| remarks_of_twins(&surfaces)).unwrap_or_default());
        let rows: Vec<Row> = surfaces.iter().map(Row::from).collect();
        let tissue = |made: &Made| tissues.tissues().get(tissues.index_of(&made.tissue)?);
        let layers: Vec<Layer> =
            surfaces.iter().filter_map(|made| Some((&made.mesh, made.priority, tissue(made)?))).collect();
        let pose = start.view.pose.unwrap_or_default();
        let gain = Gain::of(&layers, &start.probe, &pose);
        let labelled: Vec<LabelledSurface> = surfaces.into_iter().map(labelled).collect();
        for path in [Some(&self.out), self.probe_path.as_ref(), self.report.as_ref()].into_iter().flatten() {
            output::make_parent(path)?;
        }
        files.push(self.out.clone());
        let source = path.file_name().map(|name| name.to_string_lossy().into_owned());
        let extras = SceneExtras { motion: Motion::default(), axes: Axes::Patient, source };
        write_scene_glb(&labelled, &extras, &self.out)?;
        drop(labelled);
        files.push(self.station_file());
        let scene_name = self.out.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let what = format!("A patient's scene, made from {}: first view of {}.", path.display(), start.target);
        write_text(&self.station_file(), &station_text(&scene_name, &what, &start.probe, &pose, &gain))?;
        write_text(&self.points_file(), &points_text(&start.points))?;
        files.push(self.points_file());
        let planes_file = planes::planes_path(&self.out);
        if start.planes.planes.is_empty() {
            // Existing planes belong to an earlier scene and would name missing surfaces.
            let _ = std::fs::remove_file(&planes_file);
        } else {
            write_json(&planes_file, &start.planes)?;
            files.push(planes_file);
        }
        if let (Some(path), Some(session)) = (&self.probe_path, &slide) {
            files.push(path.clone());
            session.write(path, &scene_name)?;
        }
        if start.planes.planes.is_empty() {
            remarks
                .push("no standard plane: none of liver, kidneys, aorta, bladder, heart and lung is seen".to_owned());
        }
        if let Some(facts) = &facts {
            remarks.extend(facts.remarks());
        }
        remarks.extend(self.findings(&tissues)?);
        let windows = start.windows.clone();
        let source = path;
        let scene = self.out.clone();
        let mut summary =
            Summary { scene, source, surfaces: rows, facts, unmapped, repairs, windows, remarks, files: files.clone() };
        if let Some(path) = &self.report {
            progress.set(98, 100);
            let scene = import::load(&self.out, &tissues, tissues.index_of("gel").unwrap_or_default())?;
            let pictures = pictures::of(&scene, &start, &self.out, &self.backend)?;
            files.push(path.clone());
            page::write(path, &summary, &pictures.scene, &pictures.bmode)?;
            summary.files.push(path.clone());
        }
        drop(progress);
        Ok(summary)
    }

    /// Errors and warnings that `insonify doctor` finds in the scene, one line each.
    fn findings(&self, tissues: &TissueTable) -> Result<Vec<String>, Failure> {
        let file = SceneFile::Given(self.out.clone());
        let found = Examination::of(file.path(), None, None, tissues, &|_, _| ())?;
        let worse = found.report.findings.iter().filter(|f| f.severity != Severity::Note);
        // Unusual organs are due to the patient or the labels, so they are listed apart from faults of the scene.
        let (organs, scene): (Vec<_>, Vec<_>) =
            worse.partition(|f| matches!(f.defect, Defect::UnusualVolume | Defect::UnusualPosition));
        let mut lines: Vec<String> = organs.iter().map(|finding| format!("look again: {}", finding.what)).collect();
        if !scene.is_empty() {
            lines.push(format!("the doctor has {} about the scene", counted(scene.len(), "finding")));
            lines.extend(scene.iter().map(|finding| format!("doctor: {finding}")));
        }
        Ok(lines)
    }
}

fn points_text(points: &[Named<DVec3>]) -> String {
    let line = |p: &Named<DVec3>| format!("{:.2},{:.2},{:.2},{}\n", p.value.x, p.value.y, p.value.z, p.name);
    let head = "# points of the skin, mm in the scene: x left, y posterior, z superior\nx,y,z,name\n".to_owned();
    points.iter().fold(head, |text, point| text + &line(point))
}

fn labelled(made: Made) -> LabelledSurface {
    LabelledSurface { name: made.name, tissue: made.tissue, priority: made.priority, mesh: made.mesh }
}
