//! Conversion of labels on a grid to the closed surfaces of a scene.

use std::collections::{BTreeMap, HashMap};

use glam::{DAffine3, DMat3, DVec3};
use insonify_core::anatomy::Mesh;
use rayon::prelude::*;
use serde::Serialize;

use super::body::{self, Gas, OutlineSource, distances_mm, gas_of, without_fragments};
use super::classes::Wall;
use super::grid::{CutPlane, Grid};
pub use super::inputs::{Inputs, Organ};
use super::meshing::{Complex, NONE, Net, Part, make_well_composed};

/// Fewest voxels of a separate part of a label; smaller parts are fragments.
const FRAGMENT_VOXELS: usize = 8;
/// Shares of the triangles, 0..=1: for each side of the skin, and for the inner border of the fat.
const BODY_SHARE: f64 = 0.06;
const FAT_SHARE: f64 = 0.10;
/// Largest error of mesh decimation, in voxels.
const ERROR_VOXELS: f64 = 0.35;
/// Wall thickness, in voxels, from which the inner side of a wall is meshed from voxels. The inner side of a thinner
/// wall is its outer surface moved inward.
const THICK_VOXELS: f64 = 2.0;
/// Largest distance that a surface is moved to restore a label's volume, in voxels.
const VOLUME_VOXELS: f64 = 0.4;

/// Thickness of the fascia that covers the muscles of the trunk, mm (assumed: the rectus sheath has about 1 mm).
pub const FASCIA_MM: f64 = 1.0;

/// Options for making a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Thickness of the skin, mm; 0 for none.
    pub skin_mm: f64,
    /// Thickness of the fat beneath the skin, mm, where neither labels nor an image show it.
    pub fat_mm: f64,
    /// Thickness of the fascia between fat and soft tissue, mm; 0 for none.
    pub fascia_mm: f64,
    /// Approximate number of triangles.
    pub triangles: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self { skin_mm: 2.0, fat_mm: 12.0, fascia_mm: FASCIA_MM, triangles: 600_000 }
    }
}

/// Surface of a scene, with the segment that it was made from.
#[derive(Debug, Clone, PartialEq)]
pub struct Made {
    /// Name of the surface.
    pub name: String,
    /// Name of the tissue inside the surface.
    pub tissue: String,
    /// Priority in the scene.
    pub priority: i32,
    /// Closed surface, LPS, mm.
    pub mesh: Mesh,
    /// Name of its segment; `None` for skin, fat and soft tissue.
    pub segment: Option<String>,
    /// Source volume, mm³: of the segment, or of the body for the outermost surface. `None` for inner layers and gas.
    pub voxels_mm3: Option<f64>,
}

/// Surfaces of a scene, and facts about their generation.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// Surfaces, ascending in priority.
    pub surfaces: Vec<Made>,
    /// Sides on which the scan cuts the body.
    pub cuts: Vec<CutPlane>,
    /// Facts for the report.
    pub facts: Facts,
}

/// Processing facts for the report.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Facts {
    /// Origin of the body's outline.
    pub outline: OutlineSource,
    /// Whether the scan cuts the body on each side: right, left, front, back, feet, head.
    pub cut: [bool; 6],
    /// Number of fragments, parts of fewer than eight voxels, that were added to neighbouring labels.
    #[serde(rename = "crumbs")]
    pub fragments: usize,
    /// Number of voxels whose label was changed because a surface would have touched itself along an edge.
    pub untangled: usize,
    /// Segments that have no voxel left after processing.
    pub empty: Vec<String>,
}

/// Makes the surfaces of a scene. `progress` receives the name of the step and the share of the work that is done,
/// 0..=1.
pub fn make(mut inputs: Inputs, options: &Options, progress: &(dyn Fn(&'static str, f64) + Sync)) -> Outcome {
    progress("cleaning the labels", 0.0);
    if inputs.organs.iter().any(|organ| organ.name.starts_with("heart_ventricle")) {
        // What the chambers leave of a label of the whole heart is their walls.
        for heart in inputs.organs.iter_mut().filter(|organ| organ.name == "heart") {
            (heart.tissue, heart.wall) = ("heart".to_owned(), Vec::new());
        }
    }
    inputs = inputs.with_margin(options.skin_mm, options.fat_mm);
    let fragments = without_fragments(&mut inputs.labels, inputs.grid.size, FRAGMENT_VOXELS);
    let counts = count(&inputs.labels);
    let priorities: Vec<i32> = inputs.organs.iter().map(|o| o.priority).collect();
    // Ranks of labels are distinct: labels of equal priority rank in ascending order.
    let rank = |label: u16| match priorities.get(usize::from(label).wrapping_sub(1)) {
        Some(&priority) => (u64::from(priority.wrapping_sub(i32::MIN) as u32) << 16 | u64::from(label)) + 1,
        None => 0,
    };
    let untangled = make_well_composed(&mut inputs.labels, inputs.grid.size, &rank);

    progress("finding the body", 0.08);
    let (outline, body_mask) = outline(&inputs, options);
    let cut = cut_sides(&body_mask, &inputs.grid);
    let soft = soft_tissue(&inputs, &body_mask, options);

    let new = || Builder { grid: &inputs.grid, surfaces: Vec::new() };
    let (mut layers, mut organs) = (new(), new());
    progress("meshing the body and the organs", 0.3);
    let has_fat = options.fat_mm > 0.0 || inputs.fat.is_some() || inputs.ct().is_some();
    rayon::join(
        || layers.body(body_mask, soft, has_fat, options),
        || organs.organs(&inputs, &counts, options, progress),
    );
    progress("done", 1.0);
    let mut surfaces = layers.surfaces;
    surfaces.append(&mut organs.surfaces);
    surfaces.retain(|s| !s.mesh.triangles.is_empty());
    surfaces.sort_by_key(|s| s.priority);
    let has = |organ: &&Organ| !surfaces.iter().any(|s| s.segment.as_deref() == Some(&organ.name));
    let empty = inputs.organs.iter().filter(has).map(|o| o.name.clone()).collect();
    let fragments = fragments.values().sum();
    let cuts = cut_planes(&cut, &inputs.grid);
    Outcome { surfaces, cuts, facts: Facts { outline, cut, fragments, untangled, empty } }
}

fn count(labels: &[u16]) -> HashMap<u16, usize> {
    let mut counts = vec![0usize; usize::from(u16::MAX) + 1];
    labels.iter().for_each(|&l| counts[usize::from(l)] += 1);
    (0..=u16::MAX).zip(counts).filter(|&(l, n)| l != NONE && n > 0).collect()
}

fn outline(inputs: &Inputs, options: &Options) -> (OutlineSource, Vec<bool>) {
    let grid = &inputs.grid;
    let (source, mut mask) = match (&inputs.body, &inputs.image) {
        (Some(body), _) => (OutlineSource::Label, body.clone()),
        (None, Some(image)) => (OutlineSource::Image, body::from_image(image, grid, inputs.is_ct)),
        (None, None) => {
            let margin_mm = body::hull_margin_mm(options.skin_mm, options.fat_mm);
            (OutlineSource::Labels, body::from_labels(&inputs.labels, grid, margin_mm))
        }
    };
    // Labelled voxels belong to the body.
    mask.par_iter_mut().zip(&inputs.labels).for_each(|(inside, label)| *inside |= *label != NONE);
    (source, body::from_mask(mask, grid, |i| inputs.labels[i] != NONE))
}

/// Whether the body reaches each side of the grid: low x, high x, low y, high y, low z, high z.
fn cut_sides(body: &[bool], grid: &Grid) -> [bool; 6] {
    let inside = body.par_iter().enumerate().filter(|(_, inside)| **inside);
    let sides = inside.map(|(i, _)| {
        let at = grid.at(i);
        std::array::from_fn::<bool, 6, _>(|n| at[n / 2] == if n % 2 == 0 { 0 } else { grid.size[n / 2] - 1 })
    });
    sides.reduce(|| [false; 6], |a, b| std::array::from_fn(|n| a[n] | b[n]))
}

/// Planes of the sides of the grid that cut the body; `cut` has the order of [`Facts::cut`].
fn cut_planes(cut: &[bool; 6], grid: &Grid) -> Vec<CutPlane> {
    let matrix = grid.lps_from_voxel.matrix3;
    let plane = |side: usize| {
        let axis = side / 2;
        let normal = matrix.col((axis + 1) % 3).cross(matrix.col((axis + 2) % 3)).normalize_or(DVec3::Z);
        let mut voxel = DVec3::ZERO;
        voxel[axis] = if side.is_multiple_of(2) { -0.5 } else { grid.size[axis] as f64 - 0.5 };
        CutPlane { point_mm: grid.lps_from_voxel.transform_point3(voxel), normal }
    };
    (0..6).filter(|&side| cut[side]).map(plane).collect()
}

/// Voxels of the body that are neither skin nor the fat beneath it.
fn soft_tissue(inputs: &Inputs, body: &[bool], options: &Options) -> Vec<bool> {
    let grid = &inputs.grid;
    let outside: Vec<bool> = body.par_iter().map(|&b| !b).collect();
    let border_mm = body::BORDER_VOXELS * grid.voxel_mm().min_element();
    let depth_mm = distances_mm(&outside, grid.size, grid.voxel_mm());
    let deeper = |i: usize, mm: f64| f64::from(depth_mm[i]) - border_mm > mm;
    let fat = inputs.fat.clone().or_else(|| fat_of_image(inputs, &depth_mm));
    let soft = |i: usize| {
        let below = match &fat {
            Some(fat) => !fat[i] && deeper(i, options.skin_mm),
            None => deeper(i, options.skin_mm + options.fat_mm),
        };
        body[i] && (below || inputs.labels[i] != NONE)
    };
    let soft: Vec<bool> = (0..body.len()).into_par_iter().map(soft).collect();
    body::from_mask(soft, grid, |i| inputs.labels[i] != NONE)
}

/// Large connected parts of a CT's fat, −200 to −20 HU, and the outermost 4 mm of the body. `None` without a CT.
fn fat_of_image(inputs: &Inputs, depth_mm: &[f32]) -> Option<Vec<bool>> {
    let image = inputs.ct()?;
    let is_fat = |i: usize| depth_mm[i] > 0.0 && (-200.0..-20.0).contains(&image[i]) && inputs.labels[i] == NONE;
    let mut fat: Vec<bool> =
        (0..image.len()).into_par_iter().map(|i| is_fat(i) || (depth_mm[i] > 0.0 && depth_mm[i] < 4.0)).collect();
    body::large_components(&mut fat, inputs.grid.size, |_| false);
    Some(fat)
}

/// Distance of the priorities of organs, which leaves room for the surfaces within them.
const ROOM: i32 = 10;
/// Priorities above that of an organ's outer surface: of its gas, and of parts that no label shows.
const GAS: i32 = 6;
pub(super) const PARTS: i32 = 7;

/// Priority of the outer surface of an organ, by the number of organs below it.
pub(super) fn nth_priority(below: usize) -> i32 {
    100 + ROOM * below as i32
}

/// Names of the surfaces of an organ's wall and of what it holds, from outside to inside, with the depth of each below
/// the organ's surface, mm, and its tissue. The first is the organ's own surface.
///
/// A hollow organ's name is that of its lumen, within `..._wall`. An organ in a capsule keeps its name outside, around
/// `..._parenchyma`.
pub(super) fn shells<'a>(name: &str, tissue: &'a str, wall: &'a [Wall]) -> Vec<(String, f64, &'a str)> {
    if let [capsule] = wall
        && capsule.part.is_some()
    {
        let parenchyma = (format!("{name}_parenchyma"), capsule.mm, tissue);
        return vec![(name.to_owned(), 0.0, capsule.tissue.as_str()), parenchyma];
    }
    let mut depth_mm = 0.0;
    let mut shells = Vec::new();
    for (number, layer) in wall.iter().enumerate() {
        let is_wall = |layer: &Wall| layer.part.is_none();
        let layer_name = match wall[..number].iter().filter(|layer| is_wall(layer)).count() {
            _ if !is_wall(layer) => layer.tissue.clone(),
            0 => "wall".to_owned(),
            before => format!("wall_{}", before + 1),
        };
        shells.push((format!("{name}_{layer_name}"), depth_mm, layer.tissue.as_str()));
        depth_mm += layer.mm;
    }
    shells.push((name.to_owned(), depth_mm, tissue));
    shells
}

/// Priority of a label's outer surface.
fn priority_of(organs: &[Organ], label: u16) -> i32 {
    let rank = |label: u16| (organs.get(usize::from(label).wrapping_sub(1)).map_or(0, |o| o.priority), label);
    let below = (1..=organs.len() as u16).filter(|&other| rank(other) < rank(label)).count();
    nth_priority(below)
}

struct Builder<'a> {
    grid: &'a Grid,
    surfaces: Vec<Made>,
}

impl Builder<'_> {
    /// Transform from mm along the grid's axes to the patient frame (LPS), mm.
    fn lps_from_grid_mm(&self) -> DAffine3 {
        let from_mm = DAffine3::from_mat3(DMat3::from_diagonal(self.grid.voxel_mm().recip()));
        self.grid.lps_from_voxel * from_mm
    }

    fn add(&mut self, name: &str, tissue: &str, priority: i32, part: &Part, from: Option<(&str, Option<usize>)>) {
        let mesh = part.mesh(&self.lps_from_grid_mm());
        let voxel_mm3 = self.grid.voxel_mm3();
        self.surfaces.push(Made {
            name: name.to_owned(),
            tissue: tissue.to_owned(),
            priority,
            mesh,
            segment: from.map(|(segment, _)| segment.to_owned()),
            voxels_mm3: from.and_then(|(_, count)| count).map(|count| count as f64 * voxel_mm3),
        });
    }

    /// Smoothed surfaces of `labels`, without decimation.
    fn complex(&self, labels: &[u16]) -> Complex {
        let mut net = Net::of(labels, self.grid.size);
        net.smooth();
        Complex::of(&net, self.grid.voxel_mm())
    }

    /// Decimates to `triangles`, then restores each label's volume: its number of `voxels` times the volume of a voxel.
    fn simplify(&self, complex: &mut Complex, triangles: usize, voxels: &HashMap<u16, usize>, done: &dyn Fn(f64)) {
        let voxel_mm = self.grid.voxel_mm();
        complex.decimate(triangles, ERROR_VOXELS * voxel_mm.min_element(), done);
        let wanted_mm3 = voxels.iter().map(|(&label, &n)| (label, n as f64 * voxel_mm.element_product())).collect();
        complex.restore_volumes(&wanted_mm3, VOLUME_VOXELS * voxel_mm.min_element());
    }

    /// Surface around the voxels of a mask, with about `triangles` triangles; `None` for an empty mask.
    fn mask_part(&self, mask: &[bool], triangles: usize) -> Option<Part> {
        let mut labels: Vec<u16> = mask.par_iter().map(|&inside| u16::from(inside)).collect();
        make_well_composed(&mut labels, self.grid.size, &|label| u64::from(label));
        let mut complex = self.complex(&labels);
        self.simplify(&mut complex, triangles, &count(&labels), &|_| ());
        complex.parts().remove(&1)
    }

    fn body(&mut self, body: Vec<bool>, soft: Vec<bool>, has_fat: bool, options: &Options) {
        let share = |share: f64| (share * options.triangles as f64) as usize;
        let (outer, soft) =
            rayon::join(|| self.mask_part(&body, share(BODY_SHARE)), || self.mask_part(&soft, share(FAT_SHARE)));
        if let Some(part) = outer {
            let voxels = body.iter().filter(|&&b| b).count();
            let inner = if options.skin_mm > 0.0 {
                self.add("skin", "skin", 0, &part, None);
                part.inward(options.skin_mm)
            } else {
                part
            };
            if has_fat {
                self.add("fat", "fat", 1, &inner, None);
            }
            let voxel_mm3 = self.grid.voxel_mm3();
            if let Some(first) = self.surfaces.first_mut() {
                first.voxels_mm3 = Some(voxels as f64 * voxel_mm3);
            }
        }
        if let Some(part) = soft {
            let inner = if has_fat && options.fascia_mm > 0.0 {
                self.add("fascia", "fascia", 2, &part, None);
                part.inward(options.fascia_mm)
            } else {
                part
            };
            self.add("soft_tissue", "soft_tissue_maternal", 3, &inner, None);
        }
    }

    fn organs(
        &mut self,
        inputs: &Inputs,
        counts: &HashMap<u16, usize>,
        options: &Options,
        progress: &(dyn Fn(&'static str, f64) + Sync),
    ) {
        let organ_of = |label: u16| inputs.organs.get(usize::from(label).wrapping_sub(1));
        let mut complex = self.complex(&inputs.labels);
        // A triangle belongs to the surfaces of the two labels that it separates. A label with a wall also has a copy
        // of the triangle on the wall's inner side.
        let copies = |label: &u16| organ_of(*label).map_or(0, |o| 1 + o.wall.len());
        let all: usize = complex.triangles.iter().flat_map(|t| &t.sides).map(copies).sum();
        let budget = (1.0 - 2.0 * BODY_SHARE - FAT_SHARE) * options.triangles as f64;
        let share = (budget / all.max(1) as f64).min(1.0);
        let wanted = (share * complex.triangles.len() as f64) as usize;
        progress("simplifying the organs", 0.5);
        self.simplify(&mut complex, wanted, counts, &|done| progress("simplifying the organs", 0.5 + 0.35 * done));
        progress("walls and gas", 0.85);
        let step_mm = self.grid.voxel_mm().min_element();
        // A thick wall's inner side is meshed from voxels; a thin wall's inner side is its outer surface moved inward.
        let is_thick = |mm: f64| mm >= THICK_VOXELS * step_mm;
        let shells_of = |organ: &'_ Organ| -> Vec<f64> {
            shells(&organ.name, &organ.tissue, &organ.wall).into_iter().map(|(_, depth_mm, _)| depth_mm).collect()
        };
        let most = inputs.organs.iter().map(|organ| organ.wall.len()).max().unwrap_or(0);
        // Meshes from voxels, by the number of the layers outside of them and by label.
        let mut thick: Vec<BTreeMap<u16, Part>> = (0..=most)
            .map(|outside| {
                self.inner_parts(inputs, share, |label, organ| match shells_of(organ).get(outside) {
                    Some(&mm) if is_thick(mm) => gas_of(&inputs.labels, self.grid, label, mm, Gas::Share(1.0)),
                    _ => Vec::new(),
                })
            })
            .collect();
        for (label, part) in complex.parts() {
            let Some(organ) = organ_of(label) else { continue };
            let from = Some((organ.name.as_str(), counts.get(&label).copied()));
            let priority = priority_of(&inputs.organs, label);
            let shells = shells(&organ.name, &organ.tissue, &organ.wall);
            for ((number, (name, depth_mm, tissue)), thick) in (0..).zip(shells).zip(&mut thick) {
                match thick.remove(&label) {
                    _ if number == 0 => self.add(&name, tissue, priority, &part, from),
                    Some(inner) => self.add(&name, tissue, priority + number, &inner, Some((&organ.name, None))),
                    None => {
                        let is_capsule = organ.wall.iter().all(|layer| layer.part.is_some());
                        // Nothing within the organ has the organ's capsule.
                        let inner = if is_capsule { part.outside_inward(depth_mm) } else { part.inward(depth_mm) };
                        self.add(&name, tissue, priority + number, &inner, Some((&organ.name, None)));
                    }
                }
            }
        }
        self.gas(inputs, share);
    }

    /// Meshes of regions within organs, such as lumens, by label. `voxels_of` gives the voxel indices of the region
    /// of a label and its organ. `share` is the share of the triangles that decimation keeps, 0..=1.
    fn inner_parts(
        &self,
        inputs: &Inputs,
        share: f64,
        voxels_of: impl Fn(u16, &Organ) -> Vec<usize>,
    ) -> BTreeMap<u16, Part> {
        let regions = (1..=u16::MAX).zip(&inputs.organs).map(|(label, organ)| (label, voxels_of(label, organ)));
        let regions: Vec<(u16, Vec<usize>)> = regions.filter(|(_, voxels)| !voxels.is_empty()).collect();
        if regions.is_empty() {
            return BTreeMap::new();
        }
        let mut labels = vec![NONE; inputs.labels.len()];
        for (label, voxels) in regions {
            voxels.into_iter().for_each(|i| labels[i] = label);
        }
        without_fragments(&mut labels, self.grid.size, FRAGMENT_VOXELS);
        make_well_composed(&mut labels, self.grid.size, &|label| u64::from(label));
        let counts = count(&labels);
        if counts.is_empty() {
            return BTreeMap::new();
        }
        let mut complex = self.complex(&labels);
        let wanted = (share * complex.triangles.len() as f64) as usize;
        self.simplify(&mut complex, wanted, &counts, &|_| ());
        complex.parts()
    }

    fn gas(&mut self, inputs: &Inputs, share: f64) {
        let ct = inputs.ct();
        let parts = self.inner_parts(inputs, share, |label, organ| {
            let Some((_, share)) = &organ.gas else { return Vec::new() };
            let gas = ct.map_or(Gas::Share(*share), Gas::Seen);
            let wall_mm = organ.wall_mm();
            // The gas begins half a voxel below the wall: the wall's inner side is smoother than the gas.
            let within_mm = wall_mm + 0.5 * self.grid.voxel_mm().min_element();
            gas_of(&inputs.labels, self.grid, label, within_mm, gas)
        });
        for (label, part) in parts {
            let Some(organ) = inputs.organs.get(usize::from(label).wrapping_sub(1)) else { continue };
            if let Some((tissue, _)) = &organ.gas {
                let from = Some((organ.name.as_str(), None));
                self.add(&format!("{}_gas", organ.name), tissue, priority_of(&inputs.organs, label) + GAS, &part, from);
            }
        }
    }
}
