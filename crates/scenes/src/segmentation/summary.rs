//! Summary of a scene made from a segmentation, as a table and as JSON.

use std::fmt;
use std::path::PathBuf;

use insonify_core::names::{counted, thousands};
use serde::Serialize;

use super::body::OutlineSource;
use super::from_labels::{Facts, Made};
use super::shape::pieces_ml;
use super::windows::WindowRow;

/// Names of the sides, in the order of [`Facts::cut`].
const SIDES: [&str; 6] = ["right", "left", "front", "back", "feet", "head"];

/// Table row of a surface of the scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// Name of the surface.
    pub name: String,
    /// Name of the tissue inside the surface.
    pub tissue: String,
    /// Priority: where surfaces overlap, the surface of highest priority determines the tissue.
    pub priority: i32,
    /// Number of triangles.
    pub triangles: usize,
    /// Volume within the surface, ml.
    pub mesh_ml: f64,
    /// Source volume, ml, as in [`Made::voxels_mm3`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub voxels_ml: Option<f64>,
}

impl From<&Made> for Row {
    fn from(made: &Made) -> Self {
        Self {
            name: made.name.clone(),
            tissue: made.tissue.clone(),
            priority: made.priority,
            triangles: made.mesh.triangles.len(),
            mesh_ml: made.mesh.signed_volume_mm3() * 1e-3,
            voxels_ml: made.voxels_mm3.map(|v| v * 1e-3),
        }
    }
}

/// Summary of a scene made from a segmentation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Path of the scene file.
    pub scene: PathBuf,
    /// Path of the segmentation, or of its first file.
    pub source: PathBuf,
    /// Surfaces, ascending in priority.
    pub surfaces: Vec<Row>,
    /// Facts about the generation of the scene; `None` for scenes made of meshes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub facts: Option<Facts>,
    /// Descriptions of the segments or files that were left out because their names are unknown.
    pub unmapped: Vec<String>,
    /// Repairs, one line each.
    pub repairs: Vec<String>,
    /// Table rows of the acoustic windows on the patient.
    pub windows: Vec<WindowRow>,
    /// Remarks on the scene.
    pub remarks: Vec<String>,
    /// Paths of the files written, the scene first.
    pub files: Vec<PathBuf>,
}

impl Summary {
    /// Number of triangles.
    pub fn triangles(&self) -> usize {
        self.surfaces.iter().map(|row| row.triangles).sum()
    }
}

/// Remark for a body outline that was drawn around the organs.
pub(super) fn remark_of_outline() -> &'static str {
    "the body's outline is a guess, a hull around all organs"
}

/// Organs of which a patient has one, in one piece.
const SINGLE: [&str; 11] = [
    "liver",
    "spleen",
    "pancreas",
    "stomach",
    "urinary_bladder",
    "gallbladder",
    "heart",
    "aorta",
    "brain",
    "uterus",
    "prostate",
];
/// Least volume of a second piece of such an organ that is reported, relative to the first.
const SECOND: f64 = 0.5;

/// Outer surfaces of organs.
fn organs(surfaces: &[Made]) -> impl Iterator<Item = &Made> {
    surfaces.iter().filter(|made| made.segment.is_some() && made.voxels_mm3.is_some())
}

/// Remarks on anatomy that a patient has and the scene hasn't, one line each.
pub fn remarks_of_missing(surfaces: &[Made]) -> Vec<String> {
    let mut remarks = Vec::new();
    let has = |word: &str| surfaces.iter().any(|made| made.tissue.starts_with(word));
    let is_trunk =
        organs(surfaces).any(|made| ["liver", "spleen", "heart"].iter().any(|organ| made.name.starts_with(organ)));
    if !has("bone") {
        remarks.push("no bone is given: the scene has no shadows of bone".to_owned());
    }
    if is_trunk && !has("lung") {
        remarks.push("no lung is given: where it lies is soft tissue".to_owned());
    }
    remarks
}

/// Remarks on organs of which a patient has one and the scene two, one line each.
pub fn remarks_of_twins(surfaces: &[Made]) -> Vec<String> {
    let mut remarks = Vec::new();
    for (made, name) in organs(surfaces).filter_map(|made| Some((made, made.segment.as_deref()?))) {
        if !SINGLE.contains(&name) {
            continue;
        }
        let pieces = pieces_ml(&made.mesh);
        if let [first, second, ..] = pieces[..]
            && second >= SECOND * first
        {
            remarks.push(format!(
                "`{name}` has two pieces of like size ({first:.0} and {second:.0} ml): are there two patients?"
            ));
        }
    }
    remarks
}

impl Facts {
    /// Remarks on parts of the body that are missing or guessed, one line each.
    pub fn remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        match self.outline {
            OutlineSource::Label => {}
            OutlineSource::Image => remarks.push("the body's outline was found in the image".to_owned()),
            OutlineSource::Labels => {
                remarks.push(format!("{}: give --body or --image for the real one", remark_of_outline()))
            }
        }
        let cut: Vec<&str> = SIDES.iter().zip(self.cut).filter_map(|(side, cut)| cut.then_some(*side)).collect();
        if !cut.is_empty() {
            remarks.push(format!("the scan ends within the body at: {}; surfaces are closed there", cut.join(", ")));
        }
        if self.fragments > 0 {
            let fragments = counted(self.fragments, "fragment");
            remarks.push(format!("{fragments} of fewer than 8 voxels became part of what is around"));
        }
        if !self.empty.is_empty() {
            remarks.push(format!("segments without a surface: {}", self.empty.join(", ")));
        }
        remarks
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{:28} {:22} {:>9} {:>11} {:>11}", "surface", "tissue", "triangles", "voxels, ml", "mesh, ml")?;
        for Row { name, tissue, triangles, mesh_ml, voxels_ml, .. } in &self.surfaces {
            let voxels = voxels_ml.map_or_else(|| "-".to_owned(), |ml| format!("{ml:.1}"));
            writeln!(f, "{name:28} {tissue:22} {:>9} {voxels:>11} {mesh_ml:>11.1}", thousands(*triangles))?;
        }
        let surfaces = counted(self.surfaces.len(), "surface");
        writeln!(f, "{surfaces}, {} triangles", thousands(self.triangles()))?;
        for window in &self.windows {
            let WindowRow { name, title, depth_mm, .. } = window;
            writeln!(f, "window {name}: {title}, {depth_mm:.0} mm deep{}", window.faults())?;
        }
        for line in self.repairs.iter().chain(&self.remarks) {
            writeln!(f, "{line}")?;
        }
        for name in &self.unmapped {
            writeln!(f, "left out: {name}")?;
        }
        for file in &self.files {
            writeln!(f, "{}", file.display())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use insonify_core::anatomy::Mesh;
    use insonify_core::anatomy::analytic::sphere;

    use super::*;

    fn made(name: &str, tissue: &str, mesh: Mesh) -> Made {
        let (segment, voxels_mm3) = (Some(name.to_owned()), Some(mesh.signed_volume_mm3()));
        Made { name: name.to_owned(), tissue: tissue.to_owned(), priority: 0, mesh, segment, voxels_mm3 }
    }

    #[test]
    fn missing_anatomy_and_a_second_liver_are_said() {
        let one = sphere(Vec3::ZERO, 50.0, 4);
        let mut two = one.clone();
        let first = two.vertices_mm.len() as u32;
        two.vertices_mm.extend(one.vertices_mm.iter().map(|v| *v + Vec3::X * 300.0));
        two.triangles.extend(one.triangles.iter().map(|t| t.map(|v| v + first)));
        let words = |surfaces: &[Made]| [remarks_of_missing(surfaces), remarks_of_twins(surfaces)].concat().join("; ");
        let said = words(&[made("liver", "liver", two.clone())]);
        assert!(said.contains("no bone") && said.contains("no lung") && said.contains("two patients"), "{said}");
        let mut walled = made("urinary_bladder", "urine", two);
        walled.name = "urinary_bladder_wall".to_owned();
        let said = words(&[walled]);
        assert!(said.contains("`urinary_bladder` has two pieces"), "{said}");
        let whole = [
            made("liver", "liver", one.clone()),
            made("ribs", "bone_adult", one.clone()),
            made("lung_left", "lung_aerated", one),
        ];
        assert_eq!(words(&whole), "");
    }
}
