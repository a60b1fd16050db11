//! Conversion of label maps and their classes to labels on one grid, the inputs of a scene.

use std::collections::BTreeMap;
use std::path::Path;

use insonify_core::anatomy::scene::SURFACES_MAX;
use insonify_core::files::memory_for;
use rayon::prelude::*;

use super::classes::{ClassTable, MappedSegment, Role, Unmapped};
use super::cover::Labelled;
pub use super::gather_error::GatherError;
use super::grid::Grid;
use super::image;
use super::inputs::{Inputs, Organ};
use super::measure::Measure;
use super::volume::{Image, LabelMap};

/// Inputs of a scene from a label map with its measures, and the segments that were left out. All labels of `body`
/// count as body; `image` is the image that was segmented. `labels`, `body` and `image` may have different grids.
///
/// # Errors
/// - No labelled voxel; or segments without a meaning, unless `leave_out_unknown`.
/// - No organ at all, or more organs than a scene has surfaces.
/// - A body without a voxel. Unless `allow_implausible`, a body that leaves most of an organ outside or consists of the
///   organs alone.
/// - A body or an image of another scan; an image that is refused ([`ImageError`](super::image::ImageError)).
/// - More voxels than there is memory for.
pub fn gather(
    labels: LabelMap,
    measures: &BTreeMap<(usize, u16), Measure>,
    table: &ClassTable,
    body: Option<LabelMap>,
    image: Option<Image>,
    leave_out_unknown: bool,
    allow_implausible: bool,
) -> Result<(Inputs, Vec<Unmapped>), GatherError> {
    if measures.is_empty() {
        return Err(GatherError::Empty { path: labels.path });
    }
    let labels = labels.canonical();
    let mut remarks = remarks_of(&labels.path, &labels.remarks);
    let (mapped, unmapped) = table.map(&labels, measures);
    if !unmapped.is_empty() && !leave_out_unknown {
        let names = unmapped.iter().map(ToString::to_string).collect();
        return Err(GatherError::Unmapped { path: labels.path, names });
    }
    let organs: Vec<&MappedSegment> = mapped.iter().filter(|m| m.class.role == Role::Organ).collect();
    if organs.is_empty() {
        let found = match mapped.len() {
            0 => "it has no voxel of a known label".to_owned(),
            _ => format!("its labels are {}", mapped.iter().map(|m| m.name.as_str()).collect::<Vec<_>>().join(", ")),
        };
        return Err(GatherError::Nothing { path: labels.path, found });
    }
    if organs.len() > SURFACES_MAX {
        return Err(GatherError::TooMany { path: labels.path, found: organs.len(), limit: SURFACES_MAX });
    }
    let grid = labels.grid();
    let mask = |role: Role| -> Option<Vec<bool>> {
        let of: Vec<&MappedSegment> = mapped.iter().filter(|m| m.class.role == role).collect();
        let holds = |i: usize| of.iter().any(|m| labels.layers[m.layer][i] == m.value);
        (!of.is_empty()).then(|| (0..grid.len()).into_par_iter().map(holds).collect())
    };
    let fat = mask(Role::Fat);
    let merged = merged(&labels, &organs, &grid);
    let organs_found = organs_of(&organs);
    let labelled = Labelled { path: &labels.path, labels: &merged, grid: &grid, organs: &organs_found };
    let body = match body {
        Some(map) => {
            remarks.extend(remarks_of(&map.path, &map.remarks));
            let (body, remark) = labelled.body(map, allow_implausible)?;
            remarks.extend(remark);
            Some(body)
        }
        None => union(mask(Role::Body), mask(Role::Skin)),
    };
    let image = match image {
        Some(image) => {
            // The image's values are in memory twice: in canonical order, and on the labels' grid.
            let bytes = 4 * (image.values.len() + grid.len()) as u64;
            memory_for(bytes).map_err(|none| GatherError::Memory { path: image.path.clone(), none })?;
            let image = image.canonical();
            let volume = image.grid();
            let index = image::nearest(&grid, &volume);
            labelled.covered(&|i| index(i).is_some(), "--image", &image.path, &volume, &|_| true)?;
            remarks.extend(remarks_of(&image.path, &image.remarks));
            let checked = image::checked(&image, &grid, &merged, &organs_found)?;
            remarks.extend(checked.remarks.iter().cloned());
            Some(checked)
        }
        None => None,
    };
    let is_ct = image.as_ref().is_some_and(|checked| checked.is_ct);
    let image = image.map(|checked| checked.values);
    let inputs = Inputs { labels: merged, organs: organs_found, body, fat, image, is_ct, remarks, grid };
    let path = labels.path.clone();
    memory_for(inputs.working_bytes()).map_err(|none| GatherError::Memory { path, none })?;
    Ok((inputs, unmapped))
}

/// Remarks on a file, each preceded by the file's name.
fn remarks_of(path: &Path, remarks: &[String]) -> Vec<String> {
    let name = path.file_name().unwrap_or(path.as_os_str()).display();
    remarks.iter().map(|remark| format!("{name}: {remark}")).collect()
}

fn union(a: Option<Vec<bool>>, b: Option<Vec<bool>>) -> Option<Vec<bool>> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.into_iter().zip(b).map(|(a, b)| a || b).collect()),
        (a, b) => a.or(b),
    }
}

/// Label of each voxel: 0, or 1 + index of its organ. Where segments of several layers overlap, the organ of the
/// highest priority wins.
fn merged(map: &LabelMap, organs: &[&MappedSegment], grid: &Grid) -> Vec<u16> {
    // For each layer and stored value: 0, or 1 + index of the organ.
    let mut organ_of = vec![vec![0u16; 1 << 16]; map.layers.len()];
    for (number, organ) in (1..=u16::MAX).zip(organs) {
        organ_of[organ.layer][usize::from(organ.value)] = number;
    }
    let priority = |organ: u16| organs.get(usize::from(organ).wrapping_sub(1)).and_then(|o| o.class.priority);
    let label = |i: usize| {
        let found = map.layers.iter().zip(&organ_of).map(|(layer, organ_of)| organ_of[usize::from(layer[i])]);
        found.filter(|&organ| organ != 0).max_by_key(|&organ| priority(organ)).unwrap_or(0)
    };
    (0..grid.len()).into_par_iter().map(label).collect()
}

/// Organs with distinct names: the names of their classes, with numbers where several segments share a class.
fn organs_of(mapped: &[&MappedSegment]) -> Vec<Organ> {
    let mut names: Vec<String> = Vec::new();
    let organ = |m: &&MappedSegment| {
        let base = m.class.name.clone();
        let name = (1..).map(|n| if n == 1 { base.clone() } else { format!("{base}_{n}") });
        let name = name.into_iter().find(|name| !names.contains(name)).unwrap_or(base);
        names.push(name.clone());
        Organ {
            name,
            tissue: m.class.tissue.clone().unwrap_or_default(),
            priority: m.class.priority.unwrap_or(50),
            wall: m.class.wall.clone(),
            gas: m.class.gas.as_ref().map(|g| (g.tissue.clone(), g.share)),
        }
    };
    mapped.iter().map(organ).collect()
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::super::measure::measure;
    use super::super::volume::Segment;
    use super::*;

    #[test]
    fn a_map_of_background_alone_is_refused_by_that() {
        let labels = LabelMap {
            path: "a.nrrd".into(),
            size: [2, 1, 1],
            lps_from_voxel: DAffine3::IDENTITY,
            layers: vec![vec![0, 0]],
            segments: Vec::new(),
            remarks: Vec::new(),
        };
        let table = ClassTable::builtin("total-v2").unwrap();
        let found = gather(labels, &BTreeMap::new(), &table, None, None, false, false);
        let error = found.map(|_| ()).unwrap_err().to_string();
        assert!(error.starts_with("a.nrrd: all voxels are 0"), "{error}");
    }

    #[test]
    fn more_organs_than_a_scene_has_surfaces_are_refused() {
        let of = |count: u16| {
            let name = || Some("liver".to_owned());
            let segment = |value: u16| Segment { layer: 0, value, name: name(), colour: None, terminology: None };
            let labels = LabelMap {
                path: "a.nrrd".into(),
                size: [usize::from(count), 1, 1],
                lps_from_voxel: DAffine3::IDENTITY,
                layers: vec![(1..=count).collect()],
                segments: (1..=count).map(segment).collect(),
                remarks: Vec::new(),
            };
            let measures = measure(&labels);
            gather(labels, &measures, &ClassTable::builtin("total-v2").unwrap(), None, None, false, false)
        };
        assert_eq!(of(256).unwrap().0.organs.len(), 256);
        let error = of(257).unwrap_err().to_string();
        assert!(error.contains("a.nrrd has 257 organs, and a scene has at most 256 surfaces"), "{error}");
    }
}
