//! Branches of the portal vein and of the hepatic veins within the liver.
//!
//! Each tree grows from its vein into the free parts of the liver (space colonisation, Runions 2007). Radii follow
//! Murray's law: the cube of a branch's radius is the sum of its children's cubes.

use std::collections::HashMap;

use glam::DVec3;
use insonify_core::anatomy::{Bounds, Mesh};
use insonify_core::random;

use super::field::{Field, Inside, surface};
use super::{Part, outer, spread};
use crate::segmentation::body::distances_mm;
use crate::segmentation::from_labels::Made;
use crate::segmentation::grid::Grid;
use crate::segmentation::voxels::voxels_within;

const LIVER: &str = "liver";
/// Veins from which the trees grow.
const PORTAL: &str = "portal_vein_and_splenic_vein";
const CAVA: &str = "inferior_vena_cava";

/// Voxels of the liver for the growth, mm.
const VOXEL_MM: f64 = 3.0;
/// Volume of the liver that one end of a tree supplies, mm³.
const SUPPLIED_MM3: f64 = 7000.0;
/// Least depth of a branch below the liver's surface, and its distance from branches of the other tree, mm.
const DEPTH_MM: f64 = 5.0;
const APART_MM: f64 = 9.0;
/// Length of a piece of a branch, and distance at which an end is reached, mm.
const STEP_MM: f64 = 3.5;
const REACHED_MM: f64 = 6.0;
/// Most lengths of the first piece, from a vein into the liver.
const ROOT_STEPS: u32 = 5;
/// Weight of a branch's direction against that to the ends it grows to.
const STRAIGHT: f64 = 0.7;
/// Most pieces of a tree.
const PIECES_MAX: usize = 6000;
/// Radius of the last branches, and of the widest, mm.
const RADII_MM: [f64; 2] = [1.2, 5.5];
/// Number of hepatic veins, and part of the vena cava along which they join it, mm.
const HEPATIC: usize = 3;
const HEPATIC_MM: f64 = 35.0;
/// Distance of the hepatic veins from each other where they join it, and of branches that leave the portal vein, mm.
const OSTIA_MM: f64 = 8.0;
const PORTAL_MM: f64 = 25.0;
/// Greatest distance of a vein from the liver, mm, and the depth to which vertices count as nearest to it.
const TOUCH_MM: f64 = 5.0;
const NEAREST_MM: f64 = 2.0;
/// Thickness of the bright sheath of portal branches, mm.
const SHEATH_MM: f64 = 0.8;
/// Voxels for the surfaces, mm, and distance from a branch up to which the field has its values, mm.
const FINE_MM: f64 = 0.7;
const FIELD_MM: f64 = 8.0;
/// Largest ratio of the radii at the ends of a piece: a thin branch leaves a wide one without a cone.
const TAPER: f64 = 1.25;
/// Side of the cells by which pieces are found, mm.
const CELL_MM: f64 = 8.0;

/// Portal branches with their sheaths, and hepatic veins, as far as the patient has the veins that they grow from.
pub(super) fn parts(surfaces: &[Made]) -> Vec<Part> {
    let Some(liver) = outer(surfaces, LIVER).and_then(|liver| Liver::of(&liver.mesh)) else { return Vec::new() };
    let mut trees: Vec<(&str, Tree)> = Vec::new();
    for (name, roots) in [
        ("hepatic_veins", outer(surfaces, CAVA).map(|cava| hepatic_roots(&cava.mesh, &liver))),
        ("portal_branches", outer(surfaces, PORTAL).map(|portal| portal_roots(&portal.mesh, &liver))),
    ] {
        let others: Vec<DVec3> = trees.iter().flat_map(|(_, tree)| tree.points_mm.iter().copied()).collect();
        trees.extend(roots.filter(|roots| !roots.is_empty()).map(|roots| (name, Tree::grown(&liver, &roots, &others))));
    }
    let mut parts = Vec::new();
    for (name, tree) in &trees {
        let Some(bounds) = tree.bounds() else { continue };
        let mut add = |name: String, tissue: &str, above, wider_mm: f64| {
            let pieces = Pieces::of(tree, wider_mm);
            let mesh = surface(&|at| pieces.depth_mm(at), bounds, FINE_MM);
            parts.push(Part { name, tissue: tissue.to_owned(), within: Some(LIVER.to_owned()), above, mesh });
        };
        if *name == "portal_branches" {
            add("portal_sheaths".to_owned(), "portal_tract", 0, SHEATH_MM);
        }
        add((*name).to_owned(), "blood", 1, 0.0);
    }
    parts
}

/// The liver as voxels.
struct Liver {
    grid: Grid,
    /// Depth of each voxel below the liver's surface, mm; 0 outside.
    depth_mm: Vec<f32>,
    inside: Inside,
}

impl Liver {
    fn of(mesh: &Mesh) -> Option<Self> {
        let (grid, inside) = voxels_within(&[mesh], VOXEL_MM, 2)?;
        let outside: Vec<bool> = inside.iter().map(|&inside| !inside).collect();
        let depth_mm = distances_mm(&outside, grid.size, grid.voxel_mm());
        Some(Self { grid, depth_mm, inside: Inside::of([mesh]) })
    }

    /// Depth at a point, mm; 0 outside of the liver.
    fn depth_mm(&self, at_mm: DVec3) -> f64 {
        let voxel = self.grid.lps_from_voxel.inverse().transform_point3(at_mm).round();
        let size = self.grid.size;
        if (0..3).any(|n| voxel[n] < 0.0 || voxel[n] >= size[n] as f64) {
            return 0.0;
        }
        let [x, y, z] = voxel.to_array().map(|v| v as usize);
        f64::from(self.depth_mm[(z * size[1] + y) * size[0] + x])
    }

    /// Ends that a tree shall reach: scattered over the liver, one for each [`SUPPLIED_MM3`]. Each tree has its own.
    fn ends(&self, tree: u64) -> Vec<DVec3> {
        let share = self.grid.voxel_mm3() / SUPPLIED_MM3;
        let deep = (0..self.grid.len()).filter(|&i| f64::from(self.depth_mm[i]) > DEPTH_MM);
        let is_end = |&i: &usize| random::at(tree, i as u64) < share;
        let place =
            |i: usize| self.grid.lps_from_voxel.transform_point3(DVec3::from_array(self.grid.at(i).map(|v| v as f64)));
        deep.filter(is_end).map(place).collect()
    }
}

/// Vertices of a vein that are nearest to the liver or within it; none if the vein doesn't touch it.
fn touching(vein: &Mesh, liver: &Liver) -> Vec<DVec3> {
    let vertices = vein.vertices_mm.iter().map(|v| v.as_dvec3());
    let depths_mm: Vec<(DVec3, f64)> = vertices.map(|v| (v, liver.inside.depth_mm(v))).collect();
    let most_mm = depths_mm.iter().map(|(_, mm)| *mm).fold(-TOUCH_MM, f64::max).min(0.0);
    depths_mm.into_iter().filter(|(_, mm)| *mm > most_mm - NEAREST_MM && *mm > -TOUCH_MM).map(|(v, _)| v).collect()
}

/// Places where the hepatic veins join the vena cava: at its upper part that touches the liver.
fn hepatic_roots(cava: &Mesh, liver: &Liver) -> Vec<DVec3> {
    let touching = touching(cava, liver);
    let top_mm = touching.iter().map(|v| v.z).fold(f64::NEG_INFINITY, f64::max);
    let upper: Vec<DVec3> = touching.into_iter().filter(|v| v.z > top_mm - HEPATIC_MM).collect();
    let mut roots = spread(&upper, OSTIA_MM);
    roots.truncate(HEPATIC);
    roots
}

/// Places where branches leave the portal vein: along its part at the liver.
fn portal_roots(portal: &Mesh, liver: &Liver) -> Vec<DVec3> {
    spread(&touching(portal, liver), PORTAL_MM)
}

/// A tree of vessels: points, and for each its parent and radius. Roots are their own parents.
struct Tree {
    points_mm: Vec<DVec3>,
    parents: Vec<usize>,
    radii_mm: Vec<f64>,
}

impl Tree {
    /// A tree from `roots` to ends in the liver, away from the points `others`.
    fn grown(liver: &Liver, roots: &[DVec3], others: &[DVec3]) -> Self {
        let is_free = |at: DVec3| others.iter().all(|other| other.distance_squared(at) > APART_MM * APART_MM);
        let mut ends: Vec<DVec3> =
            liver.ends(others.len() as u64 + 1).into_iter().filter(|&end| is_free(end)).collect();
        let (mut points_mm, mut parents) = (roots.to_vec(), (0..roots.len()).collect::<Vec<_>>());
        // The nearest point of the tree to each end.
        let mut nearest: Vec<(f64, usize)> = vec![(f64::INFINITY, 0); ends.len()];
        let mut seen = 0;
        while !ends.is_empty() && points_mm.len() < PIECES_MAX {
            for (end, nearest) in ends.iter().zip(&mut nearest) {
                for (n, point) in points_mm.iter().enumerate().skip(seen) {
                    let away_mm = point.distance(*end);
                    if away_mm < nearest.0 {
                        *nearest = (away_mm, n);
                    }
                }
            }
            seen = points_mm.len();
            let is_left: Vec<bool> = nearest.iter().map(|(away_mm, _)| *away_mm > REACHED_MM).collect();
            let mut left = is_left.iter();
            ends.retain(|_| *left.next().unwrap_or(&false));
            let mut left = is_left.iter();
            nearest.retain(|_| *left.next().unwrap_or(&false));
            let mut pulls: HashMap<usize, DVec3> = HashMap::new();
            for (end, (_, n)) in ends.iter().zip(&nearest) {
                *pulls.entry(*n).or_default() += (*end - points_mm[*n]).normalize_or_zero();
            }
            let mut pulls: Vec<(usize, DVec3)> = pulls.into_iter().collect();
            pulls.sort_by_key(|(n, _)| *n);
            for (n, pull) in pulls {
                let ahead = (points_mm[n] - points_mm[parents[n]]).normalize_or_zero();
                let way = (pull.normalize_or_zero() + STRAIGHT * ahead).normalize_or_zero();
                let is_root = parents[n] == n;
                let deep_mm = DEPTH_MM.min(liver.depth_mm(points_mm[n]) + 0.5);
                let is_right = |to_mm: &DVec3| {
                    let is_new = points_mm.iter().all(|point| point.distance(*to_mm) > 0.4 * STEP_MM);
                    liver.depth_mm(*to_mm) > deep_mm && is_new && is_free(*to_mm)
                };
                // A root lies outside of the liver or at its border: its first piece may be longer.
                let from_mm = points_mm[n];
                let most = if is_root { ROOT_STEPS } else { 1 };
                let next = (1..=most).map(|steps| from_mm + f64::from(steps) * STEP_MM * way).find(is_right);
                if let Some(to_mm) = next {
                    points_mm.push(to_mm);
                    parents.push(n);
                }
            }
            if points_mm.len() == seen {
                break;
            }
        }
        let radii_mm = radii_mm(&parents);
        Self { points_mm, parents, radii_mm }
    }

    fn bounds(&self) -> Option<Bounds> {
        let mut points = self.points_mm.iter().map(|p| p.as_vec3());
        let first = points.next()?;
        let widest = (RADII_MM[1] + SHEATH_MM) as f32;
        let bounds = points.fold(Bounds { min: first, max: first }, Bounds::with);
        Some(Bounds { min: bounds.min - widest, max: bounds.max + widest })
    }
}

/// Radii by Murray's law from the ends of the tree. A point comes after its parent.
fn radii_mm(parents: &[usize]) -> Vec<f64> {
    let mut cubes = vec![0.0; parents.len()];
    for (n, &parent) in parents.iter().enumerate().rev() {
        if cubes[n] == 0.0 {
            cubes[n] = RADII_MM[0].powi(3);
        }
        if parent != n {
            cubes[parent] += cubes[n];
        }
    }
    cubes.into_iter().map(|cube: f64| cube.cbrt().min(RADII_MM[1])).collect()
}

/// Pieces of a tree's branches by cells.
struct Pieces {
    /// Ends of each piece, mm, and the radius at each, mm.
    pieces: Vec<[(DVec3, f64); 2]>,
    cells: HashMap<[i32; 3], Vec<u32>>,
}

fn cell_of(at_mm: DVec3) -> [i32; 3] {
    (at_mm / CELL_MM).floor().to_array().map(|v| v as i32)
}

impl Pieces {
    /// The branches of a tree, wider by `wider_mm`.
    fn of(tree: &Tree, wider_mm: f64) -> Self {
        let end = |n: usize| (tree.points_mm[n], tree.radii_mm[n] + wider_mm);
        let branches = tree.parents.iter().enumerate().filter(|(n, parent)| n != *parent);
        let piece = |(n, &parent): (usize, &usize)| {
            let ((from_mm, wide_mm), (to_mm, radius_mm)) = (end(parent), end(n));
            [(from_mm, wide_mm.min(TAPER * radius_mm)), (to_mm, radius_mm)]
        };
        let pieces: Vec<[(DVec3, f64); 2]> = branches.map(piece).collect();
        let mut cells: HashMap<[i32; 3], Vec<u32>> = HashMap::new();
        for (number, [(a, r), (b, s)]) in (0u32..).zip(&pieces) {
            let reach_mm = FIELD_MM + r.max(*s);
            let (low, high) = (cell_of(a.min(*b) - reach_mm), cell_of(a.max(*b) + reach_mm));
            for z in low[2]..=high[2] {
                for y in low[1]..=high[1] {
                    for x in low[0]..=high[0] {
                        cells.entry([x, y, z]).or_default().push(number);
                    }
                }
            }
        }
        Self { pieces, cells }
    }

    /// Depth below the branches' surface, mm, at least `-FIELD_MM`.
    fn depth_mm(&self, at_mm: DVec3) -> f64 {
        let near = self.cells.get(&cell_of(at_mm)).map_or(&[][..], Vec::as_slice);
        let depth = |&number: &u32| {
            let [(a, r), (b, s)] = self.pieces[number as usize];
            let along = ((at_mm - a).dot(b - a) / a.distance_squared(b).max(1e-12)).clamp(0.0, 1.0);
            r + (s - r) * along - a.lerp(b, along).distance(at_mm)
        };
        near.iter().map(depth).fold(-FIELD_MM, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use insonify_core::anatomy::analytic::sphere;

    use super::*;
    use crate::segmentation::details::tests::organ;

    #[test]
    fn radii_obey_murrays_law() {
        // A root with two children, one of which has two ends.
        let radii = radii_mm(&[0, 0, 0, 1, 1]);
        let end = RADII_MM[0];
        assert!((radii[3] - end).abs() < 1e-12 && (radii[2] - end).abs() < 1e-12);
        assert!((radii[1] - end * 2f64.cbrt()).abs() < 1e-12 && (radii[0] - end * 3f64.cbrt()).abs() < 1e-12);
    }

    #[test]
    fn branches_fill_the_liver_and_hardly_meet_those_of_the_other_tree() {
        let liver = organ(LIVER, "liver", sphere(Vec3::ZERO, 60.0, 5));
        let cava = organ(CAVA, "blood", sphere(Vec3::new(0.0, 56.0, 30.0), 10.0, 4));
        let portal = organ(PORTAL, "blood", sphere(Vec3::new(0.0, 15.0, -52.0), 7.0, 4));
        let parts = parts(&[liver.clone(), cava, portal]);
        let part = |name: &str| &parts.iter().find(|part| part.name == name).unwrap().mesh;
        let (sheaths, branches, hepatic) = (part("portal_sheaths"), part("portal_branches"), part("hepatic_veins"));
        for mesh in [sheaths, branches, hepatic] {
            assert_eq!(mesh.unpaired_edges(), 0);
            let share = mesh.signed_volume_mm3() / liver.mesh.signed_volume_mm3();
            assert!((0.002..0.2).contains(&share), "{share}");
        }
        assert!(sheaths.signed_volume_mm3() > 1.3 * branches.signed_volume_mm3());
        let of_portal = Inside::of([branches]);
        let meets = hepatic.vertices_mm.iter().filter(|v| of_portal.depth_mm(v.as_dvec3()) > -0.5).count();
        assert!(meets * 100 < hepatic.vertices_mm.len(), "{meets} of {}", hepatic.vertices_mm.len());
        // The trees leave the liver at their roots alone.
        let skin = Inside::of([&liver.mesh]);
        for field in [branches, hepatic] {
            let out = field.vertices_mm.iter().filter(|v| skin.depth_mm(v.as_dvec3()) < 0.0).count();
            assert!(out * 20 < field.vertices_mm.len(), "{out}");
        }
    }

    #[test]
    fn a_liver_without_veins_gets_no_tree() {
        let liver = organ(LIVER, "liver", sphere(Vec3::ZERO, 40.0, 4));
        assert!(parts(std::slice::from_ref(&liver)).is_empty());
        let cava = organ(CAVA, "blood", sphere(Vec3::new(0.0, 42.0, 20.0), 9.0, 3));
        assert!(!parts(&[liver, cava]).is_empty());
    }
}
