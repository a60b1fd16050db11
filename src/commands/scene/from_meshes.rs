//! `insonify scene from-meshes`: a scene from meshes of organs.

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::Parser;
use glam::DVec3;
use insonify::anatomy::Mesh;
use insonify::segmentation::classes::{Class, ClassTable, Role};
use insonify::segmentation::from_labels::{Made, Options};
use insonify::segmentation::from_meshes::{OrganMesh, surfaces};
use insonify::segmentation::grid::CutPlane;
use insonify::segmentation::mesh_files::placing::{Guess, MeshAxes, Unit, guess_axes, guess_unit};
use insonify::segmentation::mesh_files::{FileHints, NamedMesh, read_meshes};
use insonify::segmentation::repair::{ActionKind, RepairSettings, SurfaceRepair, repair};

use super::super::progress::Progress;
use super::super::{Classify, Failure};
use super::files::{OutputArgs, Source};
use super::repair::RepairArgs;

/// Make a scene from meshes of organs: STL, OBJ, PLY, VTK polydata (.vtk, .vtp) and glTF.
///
/// MEANING is a tissue (`insonify tissues`) or the name of an organ; without it the names of the meshes in the file are
/// organs' names. Unit and axes are what the file says, else they are guessed from sizes and places of organs; if
/// the guess is not certain, the command asks for `--units` or `--axes`. Surfaces are repaired: holes closed, faces turned outward, doubled sheets removed.
///
/// A mesh called body or skin is filled with skin, fat and soft tissue; without one a body is drawn around all organs.
#[derive(Debug, Parser)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Args {
    /// Meshes: FILE=MEANING, or FILE alone where its meshes have names of organs
    #[arg(required = true, value_name = "FILE[=MEANING]")]
    meshes: Vec<String>,

    /// Unit of the files: mm, cm or m
    #[arg(long, value_name = "UNIT", value_parser = unit)]
    units: Option<Unit>,

    /// Axes of the files: lps (x left, y back, z up), ras (x right, y front, z up) or y-up (x left, y up, z front)
    #[arg(long, value_name = "AXES", value_parser = axes)]
    axes: Option<MeshAxes>,

    /// Thickness of the skin, mm, 0..=10; 0 for none
    #[arg(long, value_name = "MM", default_value_t = Options::default().skin_mm, value_parser = super::from_labels::skin, allow_negative_numbers = true)]
    skin_mm: f64,

    /// Thickness of the fat beneath it, mm, 0..=100
    #[arg(long, value_name = "MM", default_value_t = Options::default().fat_mm, value_parser = super::from_labels::fat, allow_negative_numbers = true)]
    fat_mm: f64,

    /// Take the surfaces as they are
    #[arg(long, conflicts_with = "max_move_mm")]
    no_repair: bool,

    #[command(flatten)]
    repair: RepairArgs,

    #[command(flatten)]
    output: OutputArgs,
}

const AFTER_HELP: &str = "\
Examples:
  insonify scene from-meshes liver.stl=liver ribs.obj=bone_adult kidney.ply=kidney_right --out patient.glb
  insonify scene from-meshes Segmentation.obj --units mm --axes ras --out patient.glb
  insonify scene from-meshes torso.stl=body liver.stl=liver --out patient.glb --report patient.html";

fn unit(text: &str) -> Result<Unit, String> {
    Unit::named(text).ok_or_else(|| format!("expected one of {}", Unit::NAMES.join(", ")))
}

fn axes(text: &str) -> Result<MeshAxes, String> {
    MeshAxes::named(text).ok_or_else(|| format!("expected one of {}", MeshAxes::NAMES.join(", ")))
}

/// A mesh of a file, and what it is.
struct Given {
    class: Class,
    mesh: NamedMesh,
}

/// Meshes of all files with their meanings, what the files say, and the files.
fn read(args: &Args) -> Result<(Vec<Given>, FileHints, Vec<PathBuf>), Failure> {
    let table = ClassTable::builtin("total-v2").input()?;
    let (mut given, mut hints, mut files) = (Vec::new(), FileHints::default(), Vec::new());
    for word in &args.meshes {
        // A file's own name may hold a `=`.
        let (path, meaning) = match word.rsplit_once('=') {
            Some((path, meaning)) if !Path::new(word).exists() => (PathBuf::from(path), Some(meaning)),
            _ => (PathBuf::from(word), None),
        };
        let file = read_meshes(&path).input()?;
        let count = file.meshes.len();
        for mesh in file.meshes {
            let class = class_of(&table, &mesh.name, meaning, count == 1)
                .map_err(|why| Failure::Input(anyhow!("{}: {why}", path.display())))?;
            given.push(Given { class, mesh });
        }
        if let (Some(a), Some(b)) = (hints.axes, file.hints.axes)
            && a != b
            && args.axes.is_none()
        {
            let path = path.display();
            return Err(Failure::Input(anyhow!(
                "{path} is in {b}, another file in {a}: export them in the same axes, or give --axes if one of them is wrong"
            )));
        }
        if args.units.is_none() && !files.is_empty() && hints.unit != file.hints.unit {
            let path = path.display();
            return Err(Failure::Input(anyhow!(
                "{path} and the files before it don't state the same unit: export them alike, or give --units"
            )));
        }
        hints.of_format |= file.hints.of_format;
        hints.axes = hints.axes.or(file.hints.axes);
        hints.unit = hints.unit.or(file.hints.unit);
        hints.said = hints.said.or(file.hints.said);
        files.push(path);
    }
    Ok((given, hints, files))
}

/// Class that a mesh has by its given meaning, else by its own name.
fn class_of(table: &ClassTable, mesh: &str, meaning: Option<&str>, alone: bool) -> Result<Class, String> {
    let mut table = table.clone();
    match meaning {
        Some(meaning) => {
            // A tissue: the mesh's name stays. An organ: its name, where the file holds that alone.
            let known = table.named(meaning).cloned();
            table.add(&format!("{mesh}={meaning}")).map_err(|e| e.to_string())?;
            let class = known.filter(|_| alone).or_else(|| table.named(mesh).cloned());
            class.ok_or_else(|| format!("`{mesh}` has no meaning"))
        }
        None => table.named(mesh).cloned().ok_or_else(|| {
            let near = table.nearest(mesh);
            let near = if near.is_empty() { String::new() } else { format!(" (did you mean {}?)", near.join(", ")) };
            format!("`{mesh}` is no known organ{near}: give its tissue or organ as FILE=MEANING")
        }),
    }
}

/// The value given, else a certain guess; an error asks for `option`.
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
            "the {what} of the meshes cannot be told for certain (most likely {guess}); give {option}"
        )));
    }
    remarks.push(format!("{what} of the meshes: {guess}"));
    Ok(guess.value)
}

/// Sizes of bodies and of their smallest parts, mm.
const SIZES_MM: std::ops::RangeInclusive<f64> = 5.0..=2500.0;

/// Refuses meshes that are no body's in `unit`.
fn check_size(given: &[Given], unit: Unit) -> Result<(), Failure> {
    let points = given.iter().flat_map(|g| &g.mesh.vertices);
    let (low, high) = points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(a, b), &p| (a.min(p), b.max(p)));
    let size_mm = (high - low).max_element() * unit.mm();
    if SIZES_MM.contains(&size_mm) {
        return Ok(());
    }
    let fits = Unit::ALL.into_iter().find(|other| SIZES_MM.contains(&(size_mm * other.mm() / unit.mm())));
    let remedy = fits.map_or_else(|| "correct the files".to_owned(), |other| format!("try --units {other}"));
    Err(Failure::Input(anyhow!(
        "all meshes together are {size_mm:.0} mm long in {unit}; bodies and their parts have 5 to 2500 mm: {remedy}"
    )))
}

/// Sides of all surfaces, along the patient's axes, at which the scan seems to end: a flat cap lies there.
fn cuts(reports: &[SurfaceRepair], surfaces: &[Made]) -> Vec<CutPlane> {
    let given = surfaces.iter().filter(|s| s.segment.is_some() || s.name == "skin");
    let bounds = given.filter_map(|s| s.mesh.bounds_mm());
    let Some(bounds) = bounds.reduce(|a, b| a.with(b.min).with(b.max)) else { return Vec::new() };
    let caps: Vec<DVec3> = reports
        .iter()
        .flat_map(|report| &report.actions)
        .filter(|action| matches!(action.kind, ActionKind::PlanarCap | ActionKind::BentCap))
        .flat_map(|action| &action.places)
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
    // Existing outputs are refused before files are read, inputs among the outputs after.
    args.output.check(&[])?;
    let (mut given, hints, files) = read(args)?;
    let paths: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    args.output.check(&paths)?;
    given.retain(|given| given.class.role != Role::Ignore);
    // Names of organs tell sizes and places.
    let named: Vec<NamedMesh> =
        given.iter().map(|g| NamedMesh { name: g.class.name.clone(), ..g.mesh.clone() }).collect();
    let mut remarks = Vec::new();
    let unit = decided(args.units, &guess_unit(&hints, &named), "unit", "--units", &mut remarks)?;
    let axes = decided(args.axes, &guess_axes(&hints, &named), "axes", "--axes", &mut remarks)?;
    drop(named);

    check_size(&given, unit)?;
    let progress = Progress::new("scene", 100);
    let lps_from_file = axes.lps_from_file() * unit.mm();
    let settings = RepairSettings { max_move_mm: args.repair.max_move_mm, ..RepairSettings::default() };
    let (mut organs, mut repairs, mut reports) = (Vec::new(), Vec::new(), Vec::new());
    let count = given.len();
    for (done, Given { class, mesh }) in given.into_iter().enumerate() {
        progress.set(80 * done / count.max(1), 100);
        let name = distinct(&class.name, &organs);
        let vertices_mm = mesh.vertices.iter().map(|&v: &DVec3| (lps_from_file * v).as_vec3()).collect();
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
    progress.set(80, 100);
    let options = Options { skin_mm: args.skin_mm, fat_mm: args.fat_mm, ..Options::default() };
    let (surfaces, more) = surfaces(organs, &options);
    remarks.extend(more);
    let path = files.into_iter().next().unwrap_or_default();
    let cuts = cuts(&reports, &surfaces);
    let source = Source { path, surfaces, cuts, facts: None, unmapped: Vec::new(), repairs, remarks };
    args.output.finish(source, progress)
}

/// `name`, numbered where an organ has it already.
fn distinct(name: &str, organs: &[OrganMesh]) -> String {
    let numbered = (1..).map(|n| if n == 1 { name.to_owned() } else { format!("{name}_{n}") });
    let taken = |name: &String| organs.iter().any(|o| o.name == *name);
    numbered.into_iter().find(|name| !taken(name)).unwrap_or_else(|| name.to_owned())
}
