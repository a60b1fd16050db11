//! Scene check ("doctor"): the defects of a scene, with their regions and remedies.
//!
//! [`examine`] reads a glTF file as written, before [`import`](super::import) mends or refuses anything, and lists all
//! defects. Coincident vertices count as one: exporters split them where normals or texture coordinates change.
//! Surfaces of different tissues may overlap or touch.
//!
//! Overlaps, hidden surfaces and thin sheets are found at sample points below at most 1024 triangles of each surface;
//! all other checks cover every triangle. Decimation typically leaves folds of neighbouring triangles and crossings of
//! less than 0.1 mm. Such triangles are reported if they are more than one in 25; slivers, if more than one in 1000.
//! A surface without an inside (an open one, for example) hides and overlaps nothing.

pub mod aberration;
pub mod crossing;
mod edges;
mod finding;
mod nesting;
mod patient;
mod probes;
mod size;
mod split;
mod surface_check;
pub mod tree;

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

pub use finding::{Defect, Finding, REGIONS_MAX, Region, Severity};
pub use size::{WrongSize, wrong_size};
use surface_check::SurfaceCheck;
use tree::Tree;

use super::bvh::PackedTriangle;
use super::import::{FindingKind, read_raw};
use super::scene::SURFACES_MAX;
use super::{Axes, Bounds, SceneError, TissueTable};
use crate::pose::Pose;

/// Distance below which the tracer treats two crossings as one, mm.
const RESOLUTION_MM: f64 = 1.0e-3;

/// Size of a storage buffer that every GPU can bind, bytes.
const BUFFER_BYTES: usize = 128 << 20;

/// Range of impedances of tissues that ultrasound passes, MRayl: between gas and bone.
const SEEN_THROUGH_MRAYL: [f64; 2] = [0.5, 2.6];

/// Context of an examination.
pub struct Settings<'a> {
    /// Tissues that the station knows.
    pub tissues: &'a TissueTable,
    /// Names of the tissues that the station file itself defines. Tissues that no surface uses are reported.
    pub own_tissues: &'a [String],
    /// Index in `tissues` of the background, if known.
    pub background: Option<usize>,
    /// Start pose `scene_from_probe` and image depth, mm; `None` leaves out the check of the start pose.
    pub start: Option<(Pose, f64)>,
}

/// Result of an examination.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DoctorReport {
    /// Number of surfaces in the file.
    pub surfaces: usize,
    /// Number of triangles of all surfaces.
    pub triangles: usize,
    /// Lowest and highest coordinates, mm, without stray vertices beyond ±1e5 mm; `None` if no vertex is finite.
    pub bounds_mm: Option<[[f32; 3]; 2]>,
    /// Findings, most severe first, then in the file's order.
    pub findings: Vec<Finding>,
}

impl DoctorReport {
    /// Number of findings of this severity.
    pub fn count(&self, severity: Severity) -> usize {
        self.findings.iter().filter(|f| f.severity == severity).count()
    }
}

/// Examines the `.glb` or `.gltf` file at `path`.
///
/// `progress` receives the number of triangles examined and their total, from several threads.
///
/// # Errors
/// A file that cannot be read, or is not complete, valid glTF. Everything else is a finding.
pub fn examine(
    path: &Path,
    settings: &Settings<'_>,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<DoctorReport, SceneError> {
    let raw = read_raw(path)?;
    let mut findings: Vec<Finding> =
        raw.problems.iter().map(|problem| Finding::new(Defect::Refused, problem.to_string())).collect();
    findings.extend(raw.findings.iter().map(|finding| {
        let defect = match finding.kind {
            FindingKind::Skin => Defect::Skin,
            FindingKind::NotInScene { .. } => Defect::NotInScene,
            _ => Defect::NotTriangles,
        };
        Finding::new(defect, finding.to_string())
    }));
    let axes = raw.extras.axes;
    let mut checks: Vec<SurfaceCheck> =
        raw.surfaces.into_par_iter().map(|surface| SurfaceCheck::new(surface, settings.tissues)).collect();
    split::find(&mut checks);
    let done = AtomicUsize::new(0);

    // The trees borrow the meshes, while findings are added to the other fields.
    let meshes: Vec<_> = checks.iter_mut().map(|p| std::mem::take(&mut p.mesh)).collect();
    let total = meshes.iter().map(|mesh| mesh.triangles.len()).sum();
    let trees: Vec<Option<Tree<'_>>> = meshes.par_iter().map(Tree::new).collect();
    checks.par_iter_mut().zip(&trees).for_each(|(check, tree)| {
        let Some(tree) = tree else { return };
        check.check_with(tree);
        let count = tree.mesh.triangles.len();
        progress(done.fetch_add(count, Ordering::Relaxed) + count, total);
    });
    let among = nesting::examine(&checks, &trees);
    among.into_iter().for_each(|(index, finding)| checks[index].report(finding));

    let bounds = bounds(&checks);
    if axes == Axes::Patient {
        let surfaces = checks.iter().zip(&meshes).filter(|(check, _)| check.closed);
        findings.extend(patient::examine(surfaces.map(|(check, mesh)| (check.name.as_str(), mesh)), bounds));
    }
    findings.extend(whole(&checks, bounds));
    findings.extend(unused(&checks, settings));
    if let Some((start, depth_mm)) = settings.start {
        findings.extend(starts(&start, depth_mm, bounds, &checks, &trees, settings));
    }
    let (surfaces, triangles) = (checks.len(), checks.iter().map(|p| p.triangles).sum());
    let wrong_unit = findings.iter().any(|f| f.defect == Defect::WrongUnit);
    let of_surfaces = checks.into_iter().flat_map(|check| check.findings);
    // Findings that compare sizes with lengths in mm are meaningless if the unit is wrong.
    let by_size = [
        Defect::Sliver,
        Defect::ThinSheet,
        Defect::BadCoordinates,
        Defect::StartsFar,
        Defect::UnusualVolume,
        Defect::UnusualPosition,
    ];
    findings.extend(of_surfaces);
    findings
        .retain(|f| !wrong_unit || !by_size.contains(&f.defect) || f.what.contains("NaN") || f.what.contains("inf"));
    findings.dedup();
    findings.sort_by_key(|f| f.severity);
    let bounds_mm = bounds.map(|b| [b.min.to_array(), b.max.to_array()]);
    Ok(DoctorReport { surfaces, triangles, bounds_mm, findings })
}

/// Findings about a mesh alone, for tests of its repair.
#[cfg(any(test, feature = "test-hooks"))]
pub fn findings(mesh: &super::Mesh) -> Vec<Finding> {
    let raw = super::import::RawMesh {
        vertices_mm: mesh.vertices_mm.clone(),
        triangles: mesh.triangles.clone(),
        left_over: 0,
    };
    let raw = super::import::RawSurface {
        name: "a surface".into(),
        node: 0,
        tissue: Some("water".into()),
        priority: 0,
        mesh: Ok(raw),
    };
    let mut check = SurfaceCheck::new(raw, &TissueTable::builtin().unwrap_or_default());
    let mesh = std::mem::take(&mut check.mesh);
    if let Some(tree) = Tree::new(&mesh) {
        check.check_with(&tree);
    }
    check.findings
}

/// Bounds of the scene, mm. A few vertices out of range are ignored as strays; if most are out of range, the unit is
/// wrong.
fn bounds(checks: &[SurfaceCheck]) -> Option<Bounds> {
    let over = |of: fn(&SurfaceCheck) -> Option<Bounds>| checks.iter().filter_map(of).reduce(Bounds::hull);
    let [vertices, bad] = [0, 1].map(|i| checks.iter().map(|p| p.vertices[i]).sum::<usize>());
    let usable = over(|p| p.bounds_mm).filter(|_| 2 * bad <= vertices);
    usable.or_else(|| over(|p| p.finite_mm))
}

/// Findings about numbers of surfaces and triangles, and about the size and position of the scene.
fn whole(checks: &[SurfaceCheck], bounds: Option<Bounds>) -> Vec<Finding> {
    let mut findings = Vec::new();
    if checks.len() > SURFACES_MAX {
        let what = format!("{} surfaces; at most {SURFACES_MAX} are traced", checks.len());
        findings.push(Finding::new(Defect::TooManySurfaces, what));
    }
    let triangles: usize = checks.iter().map(|p| p.triangles).sum();
    if triangles == 0 {
        findings.push(Finding::new(Defect::EmptyScene, "the scene holds no triangles"));
    }
    let bytes = triangles * size_of::<PackedTriangle>();
    if bytes > BUFFER_BYTES {
        let (needed, bound) = (bytes >> 20, BUFFER_BYTES >> 20);
        let what =
            format!("{triangles} triangles take {needed} MiB in one buffer; not every GPU binds more than {bound}");
        findings.push(Finding::new(Defect::TooLarge, what));
    }
    let Some(bounds) = bounds else { return findings };
    let at = 0.5 * bounds.min + 0.5 * bounds.max;
    let size = size::diagonal_mm(bounds);
    if let Some(finding) = size::wrong_unit(bounds) {
        findings.push(finding);
    } else if at.length() > (10.0 * size).max(2000.0) {
        let what = format!("the scene, {size:.0} mm across, is {:.0} mm from the origin", at.length());
        findings.push(Finding::new(Defect::FarFromOrigin, what).at([Region { at_mm: at.to_array(), size_mm: size }]));
    }
    findings
}

/// Findings about unused tissues of the station.
fn unused(checks: &[SurfaceCheck], settings: &Settings<'_>) -> Vec<Finding> {
    let used = |name: &String| {
        let index = settings.tissues.index_of(name);
        checks.iter().any(|p| p.tissue_index == index)
    };
    let unused = settings.own_tissues.iter().filter(|name| !used(name));
    unused.map(|name| Finding::new(Defect::UnusedTissue, format!("no surface is of the tissue `{name}`"))).collect()
}

/// Findings about the probe's start pose.
fn starts(
    start: &Pose,
    depth_mm: f64,
    bounds: Option<Bounds>,
    checks: &[SurfaceCheck],
    trees: &[Option<Tree<'_>>],
    settings: &Settings<'_>,
) -> Option<Finding> {
    let face = start.position_mm + start.orientation * DVec3::Z * 0.01;
    let region = Region { at_mm: start.position_mm.as_vec3().to_array(), size_mm: 0.0 };
    let bounds = bounds?;
    let away = face.distance(face.clamp(bounds.min.as_dvec3(), bounds.max.as_dvec3()));
    if away > depth_mm {
        let what = format!("the probe starts {away:.0} mm from the scene, whose image is {depth_mm:.0} mm deep");
        return Some(Finding::new(Defect::StartsFar, what).at([region]));
    }
    let surface = nesting::medium(face, checks, trees).map(|index| &checks[index]);
    let tissue = surface.map_or(settings.background, |surface| surface.tissue_index)?;
    let impedance = settings.tissues.tissues().get(tissue)?.impedance_mrayl();
    let [least, most] = SEEN_THROUGH_MRAYL;
    let what = if impedance > most { "bone or another hard solid" } else { "gas" };
    (!(least..=most).contains(&impedance)).then(|| match surface {
        Some(surface) => {
            let what = format!("the probe starts in it, which is {what}");
            Finding::new(Defect::StartsInside, what).at([region]).of(&surface.name, surface.tissue.as_deref())
        }
        None => {
            let name = settings.tissues.names().get(tissue).map_or("", String::as_str);
            let what = format!("the probe starts off every surface, in the background `{name}`, which is {what}");
            Finding::new(Defect::StartsInside, what).at([region])
        }
    })
}
