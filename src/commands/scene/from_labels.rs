//! `insonify scene from-labels`: makes a scene from a label map.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::Parser;
use insonify::segmentation::classes::{ClassTable, Mappable, check_mappings, stem};
use insonify::segmentation::conventions::plausibility;
use insonify::segmentation::from_labels::{Options, make};
use insonify::segmentation::gather::gather;
use insonify::segmentation::mask_folder::{MaskFolder, read_body_folder, read_mask_folder};
use insonify::segmentation::measure::{Measure, measure};
use insonify::segmentation::naming::{NameTable, name_labels};
use insonify::segmentation::volume::{
    LabelMap, Modality, NiftiForm, PatientAxes, ReadOptions, read_image, read_labels,
};

use super::super::progress::Progress;
use super::super::{Classify, Failure};
use super::files::{OutputArgs, Source};

/// Make a scene of closed surfaces from a label map of a CT or MR (NIfTI, or NRRD as 3D Slicer writes it), or from a
/// folder of masks, one file per organ.
///
/// Names of segments come from the file; if it has none, numbers are looked up in the table of --names. A mask without
/// names, and the masks of a folder, are named by their files. The summary states the source. Volumes and positions of
/// organs are compared with those of humans: impossible ones are refused, unlikely ones reported. All labels are meshed
/// on one grid, so neighbours share their border. Unlabelled space inside the body becomes soft tissue, under fat and
/// skin; surfaces are closed where the scan ends. Vessels and hollow organs get walls; stomach and bowel get gas.
///
/// A station file with a probe on the skin is written next to the scene. So are standard planes for `exam` and `score`,
/// if the labels suffice.
#[derive(Debug, Parser)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Args {
    /// Label map (.nii, .nii.gz, .nrrd, .nhdr, .seg.nrrd), or a folder of masks named after their organs
    labels: PathBuf,

    /// Table of names and numbers: total-v2, total-v1, total-mr, body, tissue-types (TotalSegmentator), btcv, amos, flare22,
    /// abdomenct-1k, word, chaos-mr, lits, kits, freesurfer, or a file (.toml) [default: total-v2]
    #[arg(long, value_name = "TABLE")]
    names: Option<String>,

    /// Meaning of a name or number: NAME=TISSUE, NAME=CLASS or NAME=ignore
    #[arg(long = "map", value_name = "NAME=MEANING")]
    maps: Vec<String>,

    /// Leave out segments with unknown names, instead of refusing the file
    #[arg(long)]
    leave_out_unknown: bool,

    /// Accept organs whose volumes or sides no human has, or that lie outside --body: situs inversus, animals, phantoms
    #[arg(long)]
    allow_implausible: bool,

    /// Label map in which every label is body, or a folder with masks of body and skin; its outline becomes the skin
    /// (TotalSegmentator's task body)
    #[arg(long, value_name = "FILE")]
    body: Option<PathBuf>,

    /// Image that was segmented (CT or MR): gives the body's outline, and from a CT the fat
    #[arg(long, value_name = "FILE")]
    image: Option<PathBuf>,

    /// Kind of that image, if its values don't show it: ct (in HU) or mr
    #[arg(long, value_name = "KIND", value_parser = modality, requires = "image")]
    image_type: Option<Modality>,

    /// Placement of NIfTI files whose sform and qform contradict each other: sform or qform
    #[arg(long, value_name = "FORM", value_parser = form)]
    prefer: Option<NiftiForm>,

    /// Axes of files that don't state theirs: lps, ras or las
    #[arg(long, value_name = "AXES", value_parser = axes)]
    assume_axes: Option<PatientAxes>,

    /// Thickness of the skin, mm, 0..=10; 0 for none
    #[arg(long, value_name = "MM", default_value_t = Options::default().skin_mm, value_parser = skin, allow_negative_numbers = true)]
    skin_mm: f64,

    /// Thickness of the fat under the skin, mm, 0..=100, used if neither labels nor a CT show the fat
    #[arg(long, value_name = "MM", default_value_t = Options::default().fat_mm, value_parser = fat, allow_negative_numbers = true)]
    fat_mm: f64,

    /// Approximate number of triangles, without assumed parts of organs, 10000..=5000000
    #[arg(long, value_name = "N", default_value_t = Options::default().triangles, value_parser = triangles)]
    triangles: usize,

    #[command(flatten)]
    output: OutputArgs,
}

const AFTER_HELP: &str = "\
Examples:
  insonify scene from-labels segmentation.nii.gz --out patient.glb --report patient.html
  insonify scene from-labels segmentations/ --out patient.glb
  insonify scene from-labels total.nii.gz --body body.nii.gz --image ct.nii.gz --look-at liver --out patient.glb
  insonify scene from-labels Segmentation.seg.nrrd --map tumour=cyst --map grid=ignore --out patient.glb";

fn axes(text: &str) -> Result<PatientAxes, String> {
    PatientAxes::named(text).ok_or_else(|| format!("expected one of {}", PatientAxes::NAMES.join(", ")))
}

fn modality(text: &str) -> Result<Modality, String> {
    Modality::named(text).ok_or_else(|| format!("expected one of {}", Modality::NAMES.join(", ")))
}

fn form(text: &str) -> Result<NiftiForm, String> {
    NiftiForm::named(text).ok_or_else(|| format!("expected one of {}", NiftiForm::NAMES.join(", ")))
}

fn within(text: &str, most: f64) -> Result<f64, String> {
    let value = text.parse().ok().filter(|mm| (0.0..=most).contains(mm));
    value.ok_or_else(|| format!("expected mm, 0..={most}"))
}

pub(super) fn skin(text: &str) -> Result<f64, String> {
    within(text, 10.0)
}

pub(super) fn fat(text: &str) -> Result<f64, String> {
    within(text, 100.0)
}

fn triangles(text: &str) -> Result<usize, String> {
    let value = text.parse().ok().filter(|n| (10_000..=5_000_000).contains(n));
    value.ok_or_else(|| "expected a number, 10000..=5000000".to_owned())
}

/// Name table used without `--names`.
const DEFAULT_NAMES: &str = "total-v2";

/// Loads the built-in table or the table file called `names`, adds the user's mappings, and leaves out the layers of walls
/// that are called as one of `without`.
fn table(names: Option<&str>, maps: &[String], without: &[String]) -> Result<NameTable, Failure> {
    let called = names.unwrap_or(DEFAULT_NAMES);
    let is_file = called.ends_with(".toml");
    let mut table = if is_file { ClassTable::load(Path::new(called)) } else { ClassTable::builtin(called) }.input()?;
    for map in maps {
        table.add(map).map_err(|e| Failure::Input(anyhow!("--map: {e}")))?;
    }
    table.leave_out(without);
    Ok(NameTable { table, called: called.to_owned(), is_chosen: names.is_some() })
}

/// Labels with their names, measures of each label (by layer and number), omitted files, and remarks.
struct Read {
    labels: LabelMap,
    measures: BTreeMap<(usize, u16), Measure>,
    left_out: Vec<String>,
    remarks: Vec<String>,
}

/// File names without suffixes that may be names of labels: of the masks in folders, or of a label map.
fn stems(args: &Args) -> Vec<String> {
    let mut stems = Vec::new();
    for path in [Some(&args.labels), args.body.as_ref()].into_iter().flatten() {
        match std::fs::read_dir(path) {
            Ok(entries) => stems.extend(entries.flatten().map(|entry| stem(&entry.path()))),
            Err(_) => stems.push(stem(path)),
        }
    }
    stems.sort_unstable();
    stems
}

/// Reads the label map or the folder of masks, and checks whether its organs are possible in a human.
fn read(args: &Args, names: &NameTable, options: ReadOptions, progress: &Progress) -> Result<Read, Failure> {
    let (read, from) = if args.labels.is_dir() {
        let done = |done: usize, of: usize| progress.set(5 * done / of.max(1), 100);
        let folder = read_mask_folder(&args.labels, &names.table, options, args.leave_out_unknown, &done).input()?;
        let MaskFolder { labels, names, left_out, remarks } = folder;
        let measures = measure(&labels);
        (Read { labels, measures, left_out, remarks }, names)
    } else {
        let mut labels = read_labels(&args.labels, options).input()?;
        let measures = measure(&labels);
        let from = name_labels(&mut labels, &measures, names).input()?;
        (Read { labels, measures, left_out: Vec::new(), remarks: Vec::new() }, from)
    };
    let Read { labels, measures, left_out, remarks } = read;
    if !measures.is_empty() && !args.maps.is_empty() {
        let stems = stems(args);
        let has_numbers = !args.labels.is_dir();
        let of = Mappable { path: &args.labels, labels: &labels, stems: &stems, has_numbers };
        check_mappings(&args.maps, &table(args.names.as_deref(), &[], &[])?.table, &of).input()?;
    }
    let found = plausibility(&labels, &measures, names, &from);
    if !args.allow_implausible {
        found.check(&labels, names, &from).input()?;
    }
    let remarks = std::iter::once(from.to_string()).chain(remarks).chain(found.remarks(names, args.allow_implausible));
    Ok(Read { labels, measures, left_out, remarks: remarks.collect() })
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let inputs: Vec<&Path> = [Some(&args.labels), args.body.as_ref(), args.image.as_ref()]
        .into_iter()
        .flatten()
        .map(PathBuf::as_path)
        .collect();
    args.output.check(&inputs)?;
    let names = table(args.names.as_deref(), &args.maps, &args.output.left_out())?;
    let options = ReadOptions { assume_axes: args.assume_axes, prefer: args.prefer };
    let progress = Progress::new("scene", 100);
    progress.set(0, 100);
    let Read { labels, measures, mut left_out, mut remarks } = read(args, &names, options, &progress)?;
    let body = match &args.body {
        Some(path) if path.is_dir() => Some(read_body_folder(path, &names.table, options, &|_, _| ()).input()?),
        Some(path) => Some(read_labels(path, options).input()?),
        None => None,
    };
    let mut image = args.image.as_ref().map(|path| read_image(path, options)).transpose().input()?;
    if let Some(image) = &mut image {
        image.stated = args.image_type;
    }
    progress.set(5, 100);
    let gathered = gather(labels, &measures, &names.table, body, image, args.leave_out_unknown, args.allow_implausible);
    let (mut inputs, unmapped) = gathered.input()?;
    left_out.extend(unmapped.iter().map(ToString::to_string));
    let (skin_mm, fat_mm, fascia_mm) = (args.skin_mm, args.fat_mm, args.output.fascia_mm());
    let options = Options { skin_mm, fat_mm, fascia_mm, triangles: args.triangles };
    remarks.append(&mut inputs.remarks);
    let outcome = make(inputs, &options, &|_, share| progress.set(5 + (90.0 * share) as usize, 100));
    let source = Source {
        path: args.labels.clone(),
        surfaces: outcome.surfaces,
        cuts: outcome.cuts,
        facts: Some(outcome.facts),
        unmapped: left_out,
        repairs: Vec::new(),
        remarks,
    };
    args.output.finish(source, progress)
}
