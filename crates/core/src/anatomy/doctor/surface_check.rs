//! Checks of a single surface: its vertices, triangles, edges and parts.

use std::collections::{HashMap, HashSet};

use glam::Vec3;

use super::finding::{Defect, Finding, Region, Severity};
use super::tree::Tree;
use super::{crossing, edges};
use crate::anatomy::import::{RawMesh, RawSurface, is_usable, tissue_named};
use crate::anatomy::{Bounds, Mesh, TissueTable};
use crate::suggest::did_you_mean;

/// Height of a triangle below which rays from 150 mm may miss it, mm; equal to the tracer's edge tolerance.
const SLIVER_MM: f64 = 1e-4;

/// Slivers are reported if there is more than one sliver per this number of the surface's triangles. Rays that miss a
/// few slivers hit the neighbouring triangles.
const SLIVERS_ONE_IN: usize = 1000;

/// Number of corners at which a part is tested for being inside other parts. A single corner may nearly touch another
/// part.
const CORNERS_SAMPLED: usize = 9;

/// Largest total volume of fragments, mm³, and as a share of the surface's volume. Decimation folds fragments as small
/// as its triangles, so their orientation is arbitrary.
const FRAGMENTS_MM3: f64 = 1.0;
const FRAGMENTS_PART: f64 = 1e-4;

/// Advice on fragments.
const FRAGMENTS_REMEDY: &str = "delete them (Blender: Edit Mode, L over each, X), or decimate the surface less";

/// A surface under examination.
#[derive(Default)]
pub(super) struct SurfaceCheck {
    pub(super) name: String,
    /// Index of its glTF node.
    pub(super) node: usize,
    /// Tissue as named in the file.
    pub(super) tissue: Option<String>,
    pub(super) tissue_index: Option<usize>,
    pub(super) priority: i32,
    /// Mesh without copies, zero-area triangles and unusable vertices. It faces outward if it is closed.
    pub(super) mesh: Mesh,
    /// Whether the surface has an inside.
    pub(super) closed: bool,
    /// Whether the surface faced inward in the file.
    inverted: bool,
    /// Ends of each open edge, mm, in the direction of its triangle.
    pub(super) open_mm: Vec<[Vec3; 2]>,
    /// Bounds of all usable vertices, mm.
    pub(super) bounds_mm: Option<Bounds>,
    /// Bounds of all finite vertices, mm, however far away.
    pub(super) finite_mm: Option<Bounds>,
    /// Number of vertices that triangles use, and number of unusable ones among them.
    pub(super) vertices: [usize; 2],
    /// Number of triangles in the file.
    pub(super) triangles: usize,
    pub(super) findings: Vec<Finding>,
    /// Index of the part of each triangle.
    part: Vec<u32>,
}

impl SurfaceCheck {
    /// Runs all checks of a raw surface that need no spatial tree.
    pub(super) fn new(raw: RawSurface, tissues: &TissueTable) -> Self {
        let RawSurface { name, node, tissue, priority, mesh } = raw;
        let tissue_index = tissue.as_deref().and_then(|tissue| tissue_named(tissue, tissues));
        let mut check = Self { name, node, tissue_index, tissue, priority, ..Self::default() };
        check.check_tissue(tissues);
        match mesh {
            Ok(raw) => check.check_mesh(&raw),
            Err(error) => check.report(Finding::new(Defect::Unreadable, error.to_string())),
        }
        check
    }

    /// Adds a finding about this surface.
    pub(super) fn report(&mut self, finding: Finding) {
        self.findings.push(finding.of(&self.name, self.tissue.as_deref()));
    }

    fn check_tissue(&mut self, tissues: &TissueTable) {
        match &self.tissue {
            None => self.report(Finding::new(Defect::NoTissue, "neither its node nor its material names a tissue")),
            Some(tissue) if self.tissue_index.is_none() => {
                let suggestion = did_you_mean(tissue, tissues.names().iter().map(String::as_str));
                let what = format!("there is no tissue `{tissue}`{suggestion}");
                self.report(Finding::new(Defect::UnknownTissue, what));
            }
            Some(_) => {}
        }
    }

    fn check_mesh(&mut self, raw: &RawMesh) {
        self.triangles = raw.triangles.len();
        let mut mesh = raw.welded();
        let vertices = || mesh.vertices_mm.iter().copied();
        self.finite_mm = Bounds::of(vertices().filter(|v| v.is_finite()));
        self.bounds_mm = Bounds::of(vertices().filter(|v| is_usable(*v)));
        self.vertices = [mesh.vertices_mm.len(), vertices().filter(|v| !is_usable(*v)).count()];
        if raw.left_over > 0 {
            let what = format!("the last {} indices make no whole triangle and are left out", raw.left_over);
            self.report(Finding::new(Defect::LeftOver, what));
        }
        let bad: Vec<usize> = raw.bad_vertices().collect();
        if let Some(&first) = bad.first() {
            let value = raw.vertices_mm[first].to_array();
            let what =
                format!("{} vertices are not finite or beyond ±100000 mm; vertex {first} is {value:?} mm", bad.len());
            self.report(Finding::new(Defect::BadCoordinates, what));
            mesh.triangles.retain(|t| t.iter().all(|&i| is_usable(mesh.vertices_mm[i as usize])));
            // A surface is open without its unusable vertices: no further check applies.
            self.mesh = mesh;
            return;
        }
        let fillers = self.drop_degenerate(&mut mesh);
        self.drop_copies(&mut mesh);
        self.mesh = mesh;
        if self.mesh.triangles.is_empty() {
            if self.findings.iter().all(|f| f.defect != Defect::ThinSheet) {
                self.report(Finding::new(Defect::Empty, "it has no triangle with an area and is left out"));
            }
            return;
        }
        self.check_slivers();
        let edges = self.edges(&fillers);
        edges.findings.into_iter().for_each(|finding| self.report(finding));
        let at = |i: u32| self.mesh.vertices_mm[i as usize];
        self.open_mm = edges.open.iter().map(|edge| edge.map(at)).collect();
        (self.closed, self.part) = (edges.closed, edges.part);
        // Import also turns surfaces outward. Points below a triangle are then inside.
        if self.closed && self.mesh.signed_volume_mm3() < 0.0 {
            self.inverted = true;
            self.mesh.flip();
        }
    }

    /// Examines the edges with and without the `fillers` of T-junctions. Returns the result with fewer unpaired edges.
    fn edges(&mut self, fillers: &[[u32; 3]]) -> edges::Edges {
        let without = edges::examine(&self.mesh);
        if without.closed || fillers.is_empty() {
            return without;
        }
        let count = self.mesh.triangles.len();
        self.mesh.triangles.extend(fillers);
        let mut with = edges::examine(&self.mesh);
        self.mesh.triangles.truncate(count);
        with.part.truncate(count);
        if with.unpaired < without.unpaired { with } else { without }
    }

    /// Removes zero-area triangles. Returns the removed triangles that may close T-junctions.
    fn drop_degenerate(&mut self, mesh: &mut Mesh) -> Vec<[u32; 3]> {
        let total = mesh.triangles.len();
        let first = mesh.first_flat();
        let fillers = mesh.drop_flat();
        // A surface that has only such triangles is empty and has its own finding.
        if let Some(corners) = first.filter(|_| !mesh.triangles.is_empty()) {
            let what = format!("{} triangles without area are left out, one of them", total - mesh.triangles.len());
            self.report(Finding::new(Defect::Degenerate, what).at([Region::of(corners)]));
        }
        fillers
    }

    /// Keeps one triangle of each set of equally wound copies, and none of a pair that lies back to back.
    fn drop_copies(&mut self, mesh: &mut Mesh) {
        let mut keys: Vec<([u32; 3], i32, u32)> = mesh.triangles.iter().zip(0..).map(|(t, i)| keyed(*t, i)).collect();
        keys.sort_unstable();
        let mut gone = vec![false; mesh.triangles.len()];
        let (mut copies, mut backs) = (Vec::new(), Vec::new());
        for group in keys.chunk_by(|a, b| a.0 == b.0).filter(|group| group.len() > 1) {
            let balance: i32 = group.iter().map(|(_, turn, _)| turn).sum();
            let kept = group.iter().find(|(_, turn, _)| *turn == balance.signum()).map(|(_, _, index)| *index);
            let alike = group.len() == balance.unsigned_abs() as usize;
            if alike { &mut copies } else { &mut backs }.push(group[0].2);
            group.iter().filter(|(_, _, i)| Some(*i) != kept).for_each(|(_, _, i)| gone[*i as usize] = true);
        }
        let all = |of: &[u32]| Region::of(of.iter().flat_map(|&i| mesh.corners_of(i)));
        let mut found = Vec::new();
        if !copies.is_empty() {
            let what = format!("{} triangles are there more than once", copies.len());
            found.push(Finding::new(Defect::Duplicate, what).at([all(&copies)]));
        }
        let (backs_at, walls) = (all(&backs), backs.iter().map(|&i| mesh.triangles[i as usize]).collect::<Vec<_>>());
        let mut gone = gone.into_iter();
        mesh.triangles.retain(|_| !gone.next().unwrap_or(false));
        if !backs.is_empty() {
            let (defect, meaning) = match is_inner_wall(&walls, mesh) {
                true => (Defect::NonManifold, "a wall between joined parts"),
                false => (Defect::ThinSheet, "a sheet without thickness"),
            };
            let what = format!("{} pairs of triangles lie back to back: {meaning}", backs.len());
            found.push(Finding::new(defect, what).at([backs_at]));
        }
        found.into_iter().for_each(|finding| self.report(finding));
    }

    fn check_slivers(&mut self) {
        let height = |[a, b, c]: [Vec3; 3]| {
            let [a, b, c] = [a, b, c].map(|v| v.as_dvec3());
            (b - a).cross(c - a).length() / a.distance(b).max(b.distance(c)).max(c.distance(a))
        };
        let slivers: Vec<_> = self.mesh.corners_mm().filter(|corners| height(*corners) < SLIVER_MM).collect();
        if slivers.len() * SLIVERS_ONE_IN > self.mesh.triangles.len() {
            let what = format!("{} triangles are lower than {SLIVER_MM} mm: rays may miss them", slivers.len());
            self.report(Finding::new(Defect::Sliver, what).at(slivers.into_iter().map(Region::of)));
        }
    }

    /// Runs the checks that need a spatial tree: for crossing triangles, and for parts that face the wrong way.
    pub(super) fn check_with(&mut self, tree: &Tree<'_>) {
        let found = crossing::find(tree, &self.part);
        let is_crumpled = found.is_crumpled(tree.mesh.triangles.len());
        let crossing::Crossings { overlaps, folds, regions } = found;
        if overlaps > 0 {
            let what = format!("{overlaps} pairs of its triangles pass through each other");
            self.report(Finding::new(Defect::SelfIntersection, what).at(regions));
        } else if is_crumpled {
            let what = format!("{folds} pairs of neighbouring triangles fold through each other");
            self.report(Finding::new(Defect::Crumpled, what).at(regions));
        }
        if self.closed {
            self.check_parts(tree);
        }
    }

    fn check_parts(&mut self, tree: &Tree<'_>) {
        let parts = parts(tree.mesh, &self.part);
        if self.inverted {
            self.report(Finding::new(Defect::Inverted, "it faces inward; it is turned over while loading"));
        }
        let (mut inward, mut nested) = (Vec::new(), Vec::new());
        for (index, part) in parts.iter().enumerate() {
            let outward = part.volume_mm3 > 0.0;
            // An inward part inside an outward one is a cavity.
            match (is_within_others(index, &parts, &self.part, tree), outward) {
                (false, false) => inward.push(part),
                (true, true) => nested.push(part),
                _ => {}
            }
        }
        if !inward.is_empty() {
            let what = format!("{} of its {} parts face inward", inward.len(), parts.len());
            self.report(of_parts(Defect::MixedOrientation, what, &inward, &parts));
        }
        if !nested.is_empty() {
            let what = format!(
                "{} of its {} parts lie within another part: their border is taken for the end of both",
                nested.len(),
                parts.len()
            );
            self.report(of_parts(Defect::NestedPart, what, &nested, &parts));
        }
    }
}

/// Finding about the parts `wrong`, which are some of `parts`.
fn of_parts(defect: Defect, what: String, wrong: &[&Part], parts: &[Part]) -> Finding {
    let volume_mm3 = |parts: &mut dyn Iterator<Item = &Part>| parts.map(|p| p.volume_mm3.abs()).sum::<f64>();
    let (of_wrong, of_all) = (volume_mm3(&mut wrong.iter().copied()), volume_mm3(&mut parts.iter()));
    let mut finding = Finding::new(defect, what).at(wrong.iter().map(|part| Region::of(part.bounds.corners())));
    if of_wrong <= FRAGMENTS_MM3.min(FRAGMENTS_PART * of_all) {
        finding.what += &format!("; they are crumbs of {of_wrong:.1e} mm³ in all");
        (finding.severity, finding.remedy) = (Severity::Warning, FRAGMENTS_REMEDY);
    }
    finding
}

/// Whether the `sheets` have a rim that lies wholly on edges of the `rest` of the surface, so that they divide its
/// inside.
fn is_inner_wall(sheets: &[[u32; 3]], rest: &Mesh) -> bool {
    let edges = |&[a, b, c]: &[u32; 3]| [(a, b), (b, c), (c, a)].map(|(a, b)| [a.min(b), a.max(b)]);
    let mut count = HashMap::<[u32; 2], usize>::new();
    sheets.iter().flat_map(edges).for_each(|edge| *count.entry(edge).or_default() += 1);
    let mut rim: HashSet<[u32; 2]> = count.into_iter().filter(|(_, n)| *n == 1).map(|(edge, _)| edge).collect();
    let has_rim = !rim.is_empty();
    for edge in rest.triangles.iter().flat_map(edges) {
        rim.remove(&edge);
    }
    has_rim && rim.is_empty()
}

/// Part of a surface: a component connected over edges.
struct Part {
    bounds: Bounds,
    /// Some corners of the part, spread evenly over its triangles.
    corners: Vec<Vec3>,
    triangles: usize,
    volume_mm3: f64,
}

fn parts(mesh: &Mesh, part_of: &[u32]) -> Vec<Part> {
    let mut counts = vec![0usize; part_of.iter().max().map_or(0, |&last| last as usize + 1)];
    part_of.iter().for_each(|&index| counts[index as usize] += 1);
    let empty = |_: &usize| Part { bounds: Bounds::EMPTY, corners: Vec::new(), triangles: 0, volume_mm3: 0.0 };
    let mut parts: Vec<Part> = counts.iter().map(empty).collect();
    let centre = mesh.vertices_mm.first().copied().unwrap_or_default().as_dvec3();
    for (corners, &index) in mesh.corners_mm().zip(part_of) {
        let part = &mut parts[index as usize];
        part.bounds = corners.into_iter().fold(part.bounds, Bounds::with);
        if part.triangles.is_multiple_of(counts[index as usize].div_ceil(CORNERS_SAMPLED)) {
            part.corners.push(corners[0]);
        }
        part.triangles += 1;
        let [a, b, c] = corners.map(|v| v.as_dvec3() - centre);
        part.volume_mm3 += a.dot(b.cross(c)) / 6.0;
    }
    parts
}

/// Whether most sampled corners of a part are inside an odd number of other parts.
fn is_within_others(index: usize, parts: &[Part], part_of: &[u32], tree: &Tree<'_>) -> bool {
    let part = &parts[index];
    let meets = |other: usize| parts[other].bounds.meets(part.bounds);
    let others: Vec<usize> = (0..parts.len()).filter(|&other| other != index && meets(other)).collect();
    let around = |corner: &Vec3| {
        let holds = |other: usize| tree.winding(corner.as_dvec3(), |t| part_of[t as usize] as usize == other) != 0;
        others.iter().filter(|&&other| holds(other)).count()
    };
    let odd = part.corners.iter().filter(|corner| !around(corner).is_multiple_of(2)).count();
    2 * odd > part.corners.len()
}

/// Key that finds copies of a triangle: its vertex indices sorted, its winding (±1), and its own index.
fn keyed([a, b, c]: [u32; 3], index: u32) -> ([u32; 3], i32, u32) {
    let mut sorted = [a, b, c];
    sorted.sort_unstable();
    // Even permutations keep the winding.
    let even = [[a, b, c], [b, c, a], [c, a, b]].contains(&sorted);
    (sorted, if even { 1 } else { -1 }, index)
}
