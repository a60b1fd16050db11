//! `insonify scene from-meshes`: makes a scene from meshes of organs.

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::Parser;
use glam::{DVec3, Vec3};
use insonify::anatomy::Mesh;
use insonify::segmentation::classes::{ClassTable, Role};
use insonify::segmentation::from_labels::{Made, Options};
use insonify::segmentation::from_meshes::{OrganMesh, remarks_on_organs, surfaces};
use insonify::segmentation::grid::CutPlane;
use insonify::segmentation::meanings::{Assignment, Meant, meanings};
use insonify::segmentation::mesh_files::placing::{
    Guess, MeshAxes, Unit, contradiction, guess_axes, guess_unit, organ_sizes,
};
use insonify::segmentation::mesh_files::{FileHints, NamedMesh, read_meshes};
use insonify::segmentation::repair::{RepairSettings, SurfaceRepair, repair};

use super::super::progress::Progress;
use super::super::{Classify, Failure};
use super::files::{OutputArgs, Source};
use super::positions::check_positions;
use super::repair::RepairArgs;

/// Make a scene from meshes of organs: STL, OBJ, PLY, VTK polydata (.vtk, .vtp) and glTF.
///
/// MEANING is a tissue (`insonify tissues`), the name of an organ, or `ignore`. Without MEANING, each mesh must be
/// named after its organ. In a file of several meshes, FILE#NAME=MEANING gives the meaning of one mesh by its name
/// (object, group, solid or material). FILE#*=MEANING applies to all other meshes of the file.
///
/// Unit and axes are taken from the file, or guessed from sizes and positions of organs. If the guess is uncertain, the
/// command asks for `--units` or `--axes`. Surfaces are repaired: holes closed, faces turned outward, doubled sheets
/// removed.
///
/// A mesh called body or skin is filled with skin, fat and soft tissue; without one a body is drawn around all organs.
#[derive(Debug, Parser)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Args {
    /// Meshes: FILE=MEANING; FILE#NAME=MEANING for one of several; FILE alone if its meshes are named after organs
    #[arg(required = true, value_name = "FILE[#NAME][=MEANING]")]
    meshes: Vec<String>,

    /// Unit of the files: mm, cm, m or in (inches)
    #[arg(long, value_name = "UNIT", value_parser = unit)]
    units: Option<Unit>,

    /// Axes of the files: lps (x left, y back, z up), ras (x right, y front, z up) or y-up (x left, y up, z front)
    #[arg(long, value_name = "AXES", value_parser = axes)]
    axes: Option<MeshAxes>,

    /// Move all meshes together so that their centre is the origin; needed beyond 100 m from it
    #[arg(long)]
    to_origin: bool,

    /// Thickness of the skin, mm, 0..=10; 0 for none
    #[arg(long, value_name = "MM", default_value_t = Options::default().skin_mm, value_parser = super::from_labels::skin, allow_negative_numbers = true)]
    skin_mm: f64,

    /// Thickness of the fat under the skin, mm, 0..=100
    #[arg(long, value_name = "MM", default_value_t = Options::default().fat_mm, value_parser = super::from_labels::fat, allow_negative_numbers = true)]
    fat_mm: f64,

    /// Keep the surfaces as they are, without repair
    #[arg(long, conflicts_with = "max_move_mm")]
    no_repair: bool,

    #[command(flatten)]
    repair: RepairArgs,

    #[command(flatten)]
    output: OutputArgs,
}

const AFTER_HELP: &str = "\
Examples:
  insonify scene from-meshes liver.stl=liver 'ribs.obj#*=bone_adult' kidney.ply=kidney_right --out patient.glb
  insonify scene from-meshes abdomen.obj#grp0=liver abdomen.obj#grp1=kidney_right --axes lps --out patient.glb
  insonify scene from-meshes Segmentation.obj --units mm --axes ras --out patient.glb
  insonify scene from-meshes torso.stl=body liver.stl=liver --axes lps --out patient.glb --report patient.html";

fn unit(text: &str) -> Result<Unit, String> {
    Unit::named(text).ok_or_else(|| format!("expected one of {}", Unit::NAMES.join(", ")))
}

fn axes(text: &str) -> Result<MeshAxes, String> {
    MeshAxes::named(text).ok_or_else(|| format!("expected one of {}", MeshAxes::NAMES.join(", ")))
}

/// Contents of all mesh files.
#[derive(Default)]
struct Read {
    meshes: Vec<Meant>,
    /// Unit and axes that the files state.
    hints: FileHints,
    files: Vec<PathBuf>,
    /// Files that state no axes.
    silent: Vec<PathBuf>,
}

impl Read {
    /// Remarks on files that state no axes and are read in the other files' axes.
    fn remarks(&self, args: &Args) -> Vec<String> {
        let Some(axes) = self.hints.axes.filter(|_| args.axes.is_none()) else { return Vec::new() };
        let remark = |path: &PathBuf| format!("{} states no axes: taken in {axes}, as the others", path.display());
        self.silent.iter().map(remark).collect()
    }
}

/// Reads the meshes of all files and their meanings, and the unit and axes that the files state.
fn read(args: &Args) -> Result<Read, Failure> {
    let mut table = ClassTable::builtin("total-v2").input()?;
    table.leave_out(&args.output.left_out());
    let mut all = Read::default();
    let parse = |word: &String| Assignment::parse(word, |path| path.is_file());
    let assignments = args.meshes.iter().map(parse).collect::<Result<Vec<_>, _>>().input()?;
    for Assignment { file: path, .. } in &assignments {
        if all.files.contains(path) {
            continue;
        }
        let file = read_meshes(path).input()?;
        let own: Vec<Assignment> = assignments.iter().filter(|other| other.file == *path).cloned().collect();
        all.meshes.extend(meanings(&table, path, file.meshes, &own).input()?);
        if file.hints.axes.is_none() {
            all.silent.push(path.clone());
        }
        join(args, &mut all.hints, file.hints, path, all.files.is_empty())?;
        all.files.push(path.clone());
    }
    Ok(all)
}

/// Merges the unit and axes that the file at `path` states into `all`. If files contradict each other, an option has to
/// decide.
fn join(args: &Args, all: &mut FileHints, of: FileHints, path: &Path, is_first: bool) -> Result<(), Failure> {
    let path = path.display();
    if let (Some(a), Some(b)) = (all.axes, of.axes)
        && a != b
        && args.axes.is_none()
    {
        return Err(Failure::Input(anyhow!(
            "{path} is in {b}, another file in {a}: export them in the same axes, or give --axes if one of them is wrong"
        )));
    }
    if args.units.is_none() && !is_first && all.unit != of.unit {
        return Err(Failure::Input(anyhow!(
            "{path} and the files before it don't state the same unit: export them alike, or give --units"
        )));
    }
    all.of_format |= of.of_format;
    all.axes = all.axes.or(of.axes);
    all.unit = all.unit.or(of.unit);
    all.said = all.said.take().or(of.said);
    let of_file = |clause: String| format!("{path}: {clause}");
    all.unclear_axes = all.unclear_axes.take().or(of.unclear_axes.map(of_file));
    all.unclear_unit = all.unclear_unit.take().or(of.unclear_unit.map(of_file));
    Ok(())
}

/// The value `given`, else a certain guess. Without either, the error asks for `option`.
fn decided<T: Copy + std::fmt::Display>(
    given: Option<T>,
    guess: &Guess<T>,
    what: &str,
    option: &str,
    remarks: &mut Vec<String>,
) -> Result<T, Failure> {
    if let Some(value) = given {
        return Ok(value);
    }
    if !guess.certain {
        return Err(Failure::Input(anyhow!(
            "the {what} of the meshes cannot be told for certain (most likely {guess}); give {option} {}",
            guess.value
        )));
    }
    remarks.push(format!("{what} of the meshes: {guess}"));
    Ok(guess.value)
}

/// Plausible sizes of the meshes together, from a body's smallest parts to a body, mm.
const SIZES_MM: std::ops::RangeInclusive<f64> = 5.0..=2500.0;

/// Largest plausible ratio of an organ's size to its usual size: for a guessed unit, and for a unit given by the user.
/// The second is larger, because a mesh may be a fragment.
const OTHER_UNIT: f64 = 5.0;
const OTHER_UNIT_GIVEN: f64 = 30.0;

/// Lowest and highest corner of all meshes, in the meshes' unit.
fn bounds(meshes: &[NamedMesh]) -> (DVec3, DVec3) {
    let points = meshes.iter().flat_map(|mesh| &mesh.vertices);
    points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(a, b), &p| (a.min(p), b.max(p)))
}

/// Refuses meshes that can't be parts of a body in `unit`. Organs of unusual size only give a remark.
fn check_size(meshes: &[NamedMesh], unit: Unit, given: bool, remarks: &mut Vec<String>) -> Result<(), Failure> {
    let (low, high) = bounds(meshes);
    let size_mm = (high - low).max_element() * unit.mm();
    if !SIZES_MM.contains(&size_mm) {
        let longest = |mesh: &NamedMesh| {
            let (low, high) = bounds(std::slice::from_ref(mesh));
            (high - low).max_element() * unit.mm()
        };
        let fits = Unit::ALL.into_iter().find(|other| SIZES_MM.contains(&(size_mm * other.mm() / unit.mm())));
        let apart = meshes.len() > 1 && meshes.iter().all(|mesh| longest(mesh) < *SIZES_MM.end() / 2.0);
        let remedy = match fits {
            _ if apart && size_mm > *SIZES_MM.end() => {
                "each alone has the size of an organ, but they lie far apart: export all in the same frame".to_owned()
            }
            Some(other) => format!("try --units {other}"),
            None => "correct the files".to_owned(),
        };
        return Err(Failure::Input(anyhow!(
            "all meshes together are {size_mm:.0} mm long in {unit}; bodies and their parts have 5 to 2500 mm: {remedy}"
        )));
    }
    let organs = organ_sizes(meshes, unit);
    let has_usual = organs.iter().any(|organ| organ.ratio == 1.0);
    let (limit, remedy) = match given {
        false => (OTHER_UNIT, format!("export all files in one unit, or give --units {unit} if it is a fragment")),
        true => (OTHER_UNIT_GIVEN, "export all files in one unit".to_owned()),
    };
    for organ in organs.into_iter().filter(|organ| organ.ratio > 1.0) {
        if organ.ratio > limit && has_usual {
            let others = "others have their usual size";
            return Err(Failure::Input(anyhow!(
                "{organ}, and {others}: it may be in another unit than {unit}; {remedy}"
            )));
        }
        remarks.push(format!("unusual size: {organ}"));
    }
    Ok(())
}

/// Largest distance of a scene's points from the origin along an axis, mm.
const FARTHEST_MM: f64 = 1e5;

/// Shift in `unit` that moves all meshes to the origin; zero unless the user asks for it. Without a shift, meshes too
/// far from the origin are refused.
fn shift(args: &Args, meshes: &[NamedMesh], unit: Unit, remarks: &mut Vec<String>) -> Result<DVec3, Failure> {
    let (low, high) = bounds(meshes);
    let centre = 0.5 * (low + high);
    if args.to_origin {
        let [x, y, z] = (centre * unit.mm()).to_array();
        remarks.push(format!(
            "all meshes are moved by ({:.1}, {:.1}, {:.1}) mm of the file's axes, to the origin",
            -x, -y, -z
        ));
        return Ok(-centre);
    }
    let farthest_mm = low.abs().max(high.abs()).max_element() * unit.mm();
    if farthest_mm >= FARTHEST_MM {
        return Err(Failure::Input(anyhow!(
            "the meshes lie up to {:.1} m from the origin; a scene reaches 100 m: give --to-origin, or move them in the \
             modelling program",
            farthest_mm * 1e-3
        )));
    }
    Ok(DVec3::ZERO)
}

/// Refuses a file's axes if the positions of the organs contradict them. Axes given by the user only give a remark.
fn check_axes(args: &Args, meshes: &[NamedMesh], axes: MeshAxes, remarks: &mut Vec<String>) -> Result<(), Failure> {
    let Some((other, text)) = contradiction(axes, meshes) else { return Ok(()) };
    if args.axes.is_none() {
        return Err(Failure::Input(anyhow!("{text}: give --axes {other}, or --axes {axes} if the file is right")));
    }
    remarks.push(format!("the axes may be wrong: {text}"));
    Ok(())
}

/// Planes perpendicular to the patient's axes at which the scan seems to end. There, repaired surfaces have flat caps.
fn cuts(reports: &[SurfaceRepair], surfaces: &[Made]) -> Vec<CutPlane> {
    let given = surfaces.iter().filter(|s| s.segment.is_some() || s.name == "skin");
    let bounds = given.filter_map(|s| s.mesh.bounds_mm());
    let Some(bounds) = bounds.reduce(|a, b| a.with(b.min).with(b.max)) else { return Vec::new() };
    let caps: Vec<DVec3> = reports
        .iter()
        .flat_map(|report| &report.cuts)
        .map(|place| DVec3::from_array(place.at_mm.map(f64::from)))
        .collect();
    let mut cuts = Vec::new();
    for axis in 0..3 {
        for side in [bounds.min, bounds.max] {
            let side = f64::from(side[axis]);
            if caps.iter().any(|cap| (cap[axis] - side).abs() < 1.0) {
                let normal = DVec3::from_array(std::array::from_fn(|n| if n == axis { 1.0 } else { 0.0 }));
                cuts.push(CutPlane { point_mm: normal * side, normal });
            }
        }
    }
    cuts
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    // Existing outputs are refused before any file is read; outputs that are inputs are refused afterwards.
    args.output.check(&[])?;
    let read = read(args)?;
    let mut remarks = read.remarks(args);
    let Read { meshes: mut given, hints, files, .. } = read;
    let paths: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    args.output.check(&paths)?;
    given.retain(|given| given.class.role != Role::Ignore);
    if given.is_empty() {
        return Err(Failure::Input(anyhow!("all meshes are ignored: there is nothing to make a scene of")));
    }
    // Meshes with the names of their organs, whose sizes and positions can be checked.
    let named: Vec<NamedMesh> =
        given.iter().map(|g| NamedMesh { name: g.class.name.clone(), ..g.mesh.clone() }).collect();
    let unit = decided(args.units, &guess_unit(&hints, &named), "unit", "--units", &mut remarks)?;
    let axes = decided(args.axes, &guess_axes(&hints, &named), "axes", "--axes", &mut remarks)?;
    check_size(&named, unit, args.units.is_some(), &mut remarks)?;
    check_axes(args, &named, axes, &mut remarks)?;
    if args.axes.is_none() {
        check_positions(&named, axes, unit)?;
    }
    let shift = shift(args, &named, unit, &mut remarks)?;
    drop(named);

    let progress = Progress::new("scene", 100);
    let lps_from_file = axes.lps_from_file() * unit.mm();
    let (organs, repairs, reports) = repaired(args, given, &progress, |v| (lps_from_file * (v + shift)).as_vec3())?;
    remarks.extend(remarks_on_organs(&organs));
    progress.set(80, 100);
    let (skin_mm, fat_mm, fascia_mm) = (args.skin_mm, args.fat_mm, args.output.fascia_mm());
    let options = Options { skin_mm, fat_mm, fascia_mm, ..Options::default() };
    let (surfaces, more) = surfaces(organs, &options);
    remarks.extend(more);
    let path = files.into_iter().next().unwrap_or_default();
    let cuts = cuts(&reports, &surfaces);
    let source = Source { path, surfaces, cuts, facts: None, unmapped: Vec::new(), repairs, remarks };
    args.output.finish(source, progress)
}

/// Repaired meshes of organs, text about each repair, and the repair reports.
type Repaired = (Vec<OrganMesh>, Vec<String>, Vec<SurfaceRepair>);

/// Moves all meshes into the scene by `scene_mm`, then repairs them.
fn repaired(
    args: &Args,
    given: Vec<Meant>,
    progress: &Progress,
    scene_mm: impl Fn(DVec3) -> Vec3,
) -> Result<Repaired, Failure> {
    let settings = RepairSettings { max_move_mm: args.repair.max_move_mm, ..RepairSettings::default() };
    let (mut organs, mut repairs, mut reports) = (Vec::new(), Vec::new(), Vec::new());
    let count = given.len();
    for (done, Meant { class, mesh }) in given.into_iter().enumerate() {
        progress.set(80 * done / count.max(1), 100);
        let name = distinct(&class.name, &organs);
        let vertices_mm = mesh.vertices.iter().map(|&v| scene_mm(v)).collect();
        let mut mesh = Mesh { vertices_mm, triangles: mesh.triangles };
        if !args.no_repair {
            let report: SurfaceRepair;
            (mesh, report) = repair(&name, mesh, &settings);
            if !report.was_sound() {
                repairs.push(report.to_string());
            }
            reports.push(report);
        }
        if mesh.triangles.is_empty() {
            return Err(Failure::Input(anyhow!("`{name}` encloses no volume: export it again as a closed surface")));
        }
        organs.push(OrganMesh { name, class, mesh });
    }
    Ok((organs, repairs, reports))
}

/// `name`, with a number appended if another organ already has this name.
fn distinct(name: &str, organs: &[OrganMesh]) -> String {
    let numbered = (1..).map(|n| if n == 1 { name.to_owned() } else { format!("{name}_{n}") });
    let taken = |name: &String| organs.iter().any(|o| o.name == *name);
    numbered.into_iter().find(|name| !taken(name)).unwrap_or_else(|| name.to_owned())
}
