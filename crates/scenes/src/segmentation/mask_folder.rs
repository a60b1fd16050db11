//! A folder of masks, one file per organ, as TotalSegmentator writes it by default.
//!
//! Files are read one after another into one label map, so that memory holds only the map and one mask. Organs share a
//! layer of the map. Where masks overlap, the class of higher priority gets the voxel. At equal priority, the file that
//! comes first by name gets the voxel. Body, skin and subcutaneous fat have layers of their own.

mod error;
#[cfg(test)]
mod tests;

use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

pub use error::MaskFolderError;
use insonify_core::files::FileError;
use insonify_core::names::{counted, listed, printable};

use super::classes::{
    Class, ClassTable, CommonWords, OrganInName, Role, VOLUME_SUFFIXES, common_words, organ_in_name, stem,
};
use super::naming::NamesFrom;
use super::volume::{LabelMap, ReadOptions, Segment, read_labels};

/// Largest distance, in voxels, between corresponding corners of two grids that count as equal.
const SAME_GRID_VOXELS: f64 = 0.05;

/// Most files in a message.
const LISTED_MAX: usize = 6;

/// A folder of masks, read as one label map.
#[derive(Debug, Clone, PartialEq)]
pub struct MaskFolder {
    /// Label map whose segments are named after their classes.
    pub labels: LabelMap,
    /// Origin of the names.
    pub names: NamesFrom,
    /// Descriptions of the files that were left out because their names are unknown.
    pub left_out: Vec<String>,
    /// Remarks on the masks, one line each.
    pub remarks: Vec<String>,
}

/// Mask file, and the class that its name stands for.
struct Mask {
    path: PathBuf,
    class: Class,
}

/// Reads the masks of a folder. `progress` receives the number of files read and their total.
///
/// # Errors
/// A folder without masks; an unknown name, unless `leave_out_unknown` and other names are known; two masks of one
/// organ; masks that are all ignored or all empty; files of several labels, on other grids, or that can't be read.
pub fn read_mask_folder(
    folder: &Path,
    table: &ClassTable,
    options: ReadOptions,
    leave_out_unknown: bool,
    progress: &dyn Fn(usize, usize),
) -> Result<MaskFolder, MaskFolderError> {
    let files = volume_files(folder)?;
    let stems: Vec<String> = files.iter().map(|file| stem(file)).collect();
    let common = common_words(&stems);
    let (mut masks, mut unknown): (Vec<Mask>, Vec<String>) = (Vec::new(), Vec::new());
    for (path, stem) in files.iter().zip(&stems) {
        match organ_in_name(stem, table, Some(&common)) {
            OrganInName::Is(name) => {
                let Some(class) = table.named(&name).cloned() else { continue };
                let other = masks.iter().find(|mask| mask.class.name == class.name && class.role != Role::Ignore);
                if let Some(other) = other {
                    let [first, second] = [&other.path, path].map(|path| file_name(path));
                    let (path, stem) = (folder.to_owned(), printable(stem).into_owned());
                    return Err(MaskFolderError::Twice { path, first, second, stem, organ: class.name });
                }
                masks.push(Mask { path: path.clone(), class });
            }
            OrganInName::Maybe(near) => unknown.push(unknown_name(stem, near)),
            OrganInName::No => unknown.push(unknown_name(stem, table.nearest(stem))),
        }
    }
    if !unknown.is_empty() && !leave_out_unknown {
        return Err(no_meaning(folder, &unknown));
    }
    let without = left_out_words(&stems, &common, table);
    masks.retain(|mask| mask.class.role != Role::Ignore);
    let count = masks.len();
    if count == 0 {
        return Err(match unknown.is_empty() {
            true => MaskFolderError::Ignored { path: folder.to_owned(), files: files.len() },
            false => no_meaning(folder, &unknown),
        });
    }
    let mut merged = Merged::default();
    for (done, mask) in masks.into_iter().enumerate() {
        progress(done, count);
        let map = read_labels(&mask.path, options)?;
        merged.add(mask, map)?;
    }
    progress(count, count);
    let remarks = merged.remarks();
    let labels =
        merged.labels(folder).ok_or_else(|| MaskFolderError::Empty { path: folder.to_owned(), files: count })?;
    Ok(MaskFolder { labels, names: NamesFrom::Folder { files: count, without }, left_out: unknown, remarks })
}

/// Reads the body's masks in a folder, as TotalSegmentator's task `body` writes them, into one label map. The map's
/// remarks name the files that were left out.
///
/// # Errors
/// As [`read_mask_folder`]; a folder without a mask of a body or skin.
pub fn read_body_folder(
    folder: &Path,
    table: &ClassTable,
    options: ReadOptions,
    progress: &dyn Fn(usize, usize),
) -> Result<LabelMap, MaskFolderError> {
    let MaskFolder { mut labels, left_out, remarks, .. } = read_mask_folder(folder, table, options, true, progress)?;
    labels.remarks.extend(remarks);
    labels.remarks.extend(left_out.into_iter().map(|name| format!("left out: {name}")));
    let found = labels.segments.iter().filter_map(|segment| segment.name.clone()).collect::<Vec<_>>().join(", ");
    let is_body = |segment: &Segment| {
        let role = table.class_of(segment).map(|class| class.role);
        matches!(role, Some(Role::Body | Role::Skin))
    };
    labels.segments.retain(is_body);
    let kept: Vec<usize> = labels.segments.iter().map(|segment| segment.layer).collect();
    // The voxels of each role are in a layer of their own.
    for (layer, voxels) in labels.layers.iter_mut().enumerate() {
        if !kept.contains(&layer) {
            voxels.fill(0);
        }
    }
    if kept.is_empty() { Err(MaskFolderError::NoBody { path: folder.to_owned(), found }) } else { Ok(labels) }
}

fn file_name(path: &Path) -> String {
    printable(&path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()).into_owned()
}

fn unknown_name(stem: &str, near: Vec<String>) -> String {
    let near: Vec<String> = near.iter().map(|name| format!("`{}`", printable(name))).collect();
    let near = if near.is_empty() { String::new() } else { format!(" (did you mean {}?)", near.join(", ")) };
    format!("the name of `{}` is no known class{near}", printable(stem))
}

fn no_meaning(folder: &Path, names: &[String]) -> MaskFolderError {
    MaskFolderError::Unknown { path: folder.to_owned(), names: listed(names, LISTED_MAX, "; ") }
}

/// Words shared by all file names that were left out in finding the classes, as text. Empty if every name is known
/// with these words.
fn left_out_words(stems: &[String], common: &CommonWords, table: &ClassTable) -> String {
    let none = CommonWords::default();
    if stems.iter().all(|stem| matches!(organ_in_name(stem, table, Some(&none)), OrganInName::Is(_))) {
        return String::new();
    }
    let shared: Vec<&str> = common.start.iter().chain(&common.end).map(String::as_str).collect();
    printable(&shared.join(" ")).into_owned()
}

/// Volume files of a folder, sorted by name.
fn volume_files(folder: &Path) -> Result<Vec<PathBuf>, MaskFolderError> {
    let fault = FileError::at("read the folder", folder);
    let (mut volumes, mut folders, mut others, mut has_dicom) = (Vec::new(), Vec::new(), 0usize, false);
    for entry in std::fs::read_dir(folder).map_err(fault)? {
        let path = entry.map_err(fault)?.path();
        let name = path.file_name().map(|name| name.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        // macOS writes a hidden file `._liver.nii.gz` next to `liver.nii.gz` on foreign disks.
        if name.starts_with('.') {
            continue;
        }
        let metadata = std::fs::metadata(&path).map_err(fault)?;
        if metadata.is_dir() {
            folders.push(path);
        } else if metadata.is_file() && VOLUME_SUFFIXES.iter().any(|suffix| name.ends_with(suffix)) {
            volumes.push(path);
        } else {
            others += 1;
            has_dicom |= metadata.is_file() && is_dicom(&path);
        }
    }
    volumes.sort_unstable();
    if !volumes.is_empty() {
        return Ok(volumes);
    }
    folders.sort_unstable();
    let is_volume =
        |entry: std::fs::DirEntry| VOLUME_SUFFIXES.iter().any(|s| entry.file_name().to_string_lossy().ends_with(s));
    let within = folders.iter().find(|folder| {
        std::fs::read_dir(folder).is_ok_and(|mut entries| entries.any(|entry| entry.is_ok_and(is_volume)))
    });
    let (found, remedy) = match (within, has_dicom, others) {
        (Some(within), ..) => ("its files lie deeper".to_owned(), format!("; {} has some", within.display())),
        (None, true, _) => (
            format!("{} of DICOM or another kind", counted(others, "file")),
            "; convert a DICOM series to .nii.gz with dcm2niix, and open a DICOM SEG in 3D Slicer".to_owned(),
        ),
        (None, false, 0) => ("it is empty".to_owned(), String::new()),
        (None, false, _) => (format!("{} of other kinds", counted(others, "file")), String::new()),
    };
    Err(MaskFolderError::NoMasks { path: folder.to_owned(), found, remedy })
}

fn is_dicom(path: &Path) -> bool {
    let mut start = Vec::new();
    let read = File::open(path).and_then(|file| file.take(132).read_to_end(&mut start));
    read.is_ok() && start.get(128..132) == Some(b"DICM")
}

/// Path and grid of the first mask.
struct Placed {
    path: PathBuf,
    size: [usize; 3],
    lps_from_voxel: DAffine3,
}

/// Label map that the masks are merged into.
#[derive(Default)]
struct Merged {
    grid: Option<Placed>,
    /// Layers, each with the role of its classes and its labels.
    layers: Vec<(Role, Vec<u16>)>,
    segments: Vec<Segment>,
    /// Priority of each label, by label − 1.
    priorities: Vec<i32>,
    empty: usize,
    shared_voxels: usize,
    /// Remarks of the volume reader, without duplicates.
    read: Vec<String>,
}

impl Merged {
    fn add(&mut self, mask: Mask, map: LabelMap) -> Result<(), MaskFolderError> {
        let mut map = map.canonical();
        map.remarks.retain(|remark| !self.read.contains(remark));
        self.read.append(&mut map.remarks);
        let values: Vec<u16> = {
            let mut values: Vec<u16> = map.segments.iter().map(|segment| segment.value).collect();
            values.retain(|value| map.layers.iter().any(|layer| layer.par_iter().any(|label| label == value)));
            values.sort_unstable();
            values.dedup();
            values
        };
        if values.len() > 1 || map.layers.len() > 1 {
            let values = values.iter().take(LISTED_MAX).map(u16::to_string).collect::<Vec<_>>().join(", ");
            return Err(MaskFolderError::SeveralLabels { path: mask.path, values });
        }
        self.check_grid(&mask.path, &map)?;
        let Some(voxels) = map.layers.into_iter().next().filter(|_| !values.is_empty()) else {
            self.empty += 1;
            return Ok(());
        };
        let label = self.segments.len() as u16 + 1;
        let role = mask.class.role;
        let layer = self.layers.iter().position(|(other, _)| *other == role).unwrap_or_else(|| {
            self.layers.push((role, vec![0; voxels.len()]));
            self.layers.len() - 1
        });
        let priority = mask.class.priority.unwrap_or(50);
        let priorities = &self.priorities;
        let of = |label: u16| priorities.get(usize::from(label).wrapping_sub(1)).copied().unwrap_or(i32::MIN);
        let put = |(to, from): (&mut u16, &u16)| {
            if *from == 0 {
                return 0;
            }
            let taken = *to != 0;
            if !taken || of(*to) < priority {
                *to = label;
            }
            usize::from(taken)
        };
        self.shared_voxels += self.layers[layer].1.par_iter_mut().zip(&voxels).map(put).sum::<usize>();
        self.priorities.push(priority);
        let name = Some(mask.class.name);
        self.segments.push(Segment { layer, value: label, name, colour: None, terminology: None });
        Ok(())
    }

    fn check_grid(&mut self, path: &Path, map: &LabelMap) -> Result<(), MaskFolderError> {
        let Some(first) = &self.grid else {
            self.grid = Some(Placed { path: path.to_owned(), size: map.size, lps_from_voxel: map.lps_from_voxel });
            return Ok(());
        };
        let corners = (0..8).map(|n| {
            let corner = |axis: usize| if n >> axis & 1 == 0 { 0.0 } else { map.size[axis] as f64 };
            DVec3::new(corner(0), corner(1), corner(2))
        });
        let apart =
            corners.map(|at| (map.lps_from_voxel.transform_point3(at), first.lps_from_voxel.transform_point3(at)));
        let apart_mm = apart.map(|(a, b)| a.distance(b)).fold(0.0, f64::max);
        let step_mm = (0..3).map(|n| first.lps_from_voxel.matrix3.col(n).length()).fold(f64::INFINITY, f64::min);
        if map.size == first.size && apart_mm <= SAME_GRID_VOXELS * step_mm {
            return Ok(());
        }
        let words = |[x, y, z]: [usize; 3], placed: DAffine3| {
            let at = placed.translation;
            let m = placed.matrix3;
            let [a, b, c] = [m.x_axis, m.y_axis, m.z_axis].map(DVec3::length);
            format!(
                "{x} × {y} × {z} voxels of {a:.3} × {b:.3} × {c:.3} mm from ({:.1}, {:.1}, {:.1}) mm on",
                at.x, at.y, at.z
            )
        };
        Err(MaskFolderError::OtherGrid {
            path: path.to_owned(),
            found: words(map.size, map.lps_from_voxel),
            first: first.path.clone(),
            expected: words(first.size, first.lps_from_voxel),
        })
    }

    fn remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        if self.empty > 0 {
            remarks.push(format!("{} without a voxel", counted(self.empty, "mask")));
        }
        if self.shared_voxels > 0 {
            let voxels = counted(self.shared_voxels, "voxel");
            remarks.push(format!(
                "{voxels} in several masks: kept by the class of higher priority, or else by the first file by name"
            ));
            remarks.extend(self.covered().into_iter().map(|name| {
                format!("no voxel of `{}` is left: other masks hold them all, as a copy would", printable(name))
            }));
        }
        remarks
    }

    /// Names of masks whose voxels all went to other masks.
    fn covered(&self) -> Vec<&str> {
        let mut left = vec![false; self.segments.len() + 1];
        for (_, layer) in &self.layers {
            layer.iter().for_each(|label| left[usize::from(*label)] = true);
        }
        let is_covered = |segment: &&Segment| !left[usize::from(segment.value)];
        self.segments.iter().filter(is_covered).filter_map(|segment| segment.name.as_deref()).collect()
    }

    fn labels(self, folder: &Path) -> Option<LabelMap> {
        let Placed { size, lps_from_voxel, .. } = self.grid.filter(|_| !self.segments.is_empty())?;
        let layers = self.layers.into_iter().map(|(_, layer)| layer).collect();
        Some(LabelMap {
            path: folder.to_owned(),
            size,
            lps_from_voxel,
            layers,
            segments: self.segments,
            remarks: self.read,
        })
    }
}
