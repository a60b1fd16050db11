//! NRRD files with attached or detached data, including segmentations of 3D Slicer.

mod header;
mod segments;
mod values;

use std::io::{BufRead, BufReader};
use std::path::Path;

use glam::{DAffine3, DMat3, DVec3};
use insonify_core::files::{self, FileKind, inside};

use self::header::{Header, header_bytes};
use super::geometry::{PatientAxes, lps_mm};
use super::raw::{Layers, RawVolume};
use super::source::{Source, file_length, in_data_file, voxel_count};
use super::{ReadOptions, VolumeFault};

/// Largest number of layers of a segmentation, since each layer needs a table of labels in memory.
const LAYERS_MAX: usize = 512;

/// Volume from the bytes of a header, up to its blank line, and the bytes of its data, attached or detached.
///
/// # Errors
/// A header that can't be used, or missing or surplus bytes.
pub fn decode_nrrd(header: &[u8], data: &[u8], options: ReadOptions) -> Result<RawVolume, VolumeFault> {
    Plan::of(&Header::parse(header)?, options)?.read(Source::plain(data, data.len() as u64))
}

/// Volume in a stream of `length` bytes. The header may name a data file, which must be in `folder`, the file's folder.
pub(super) fn read_nrrd(
    mut stream: impl BufRead,
    length: u64,
    folder: &Path,
    options: ReadOptions,
) -> Result<RawVolume, VolumeFault> {
    let bytes = header_bytes(&mut stream)?;
    let header = Header::parse(&bytes)?;
    let plan = Plan::of(&header, options)?;
    let Some(name) = header.field("data file") else {
        return plan.read(Source::plain(stream, length.saturating_sub(bytes.len() as u64)));
    };
    if name.starts_with("LIST") || name.contains('%') {
        return Err(VolumeFault::Unsupported {
            what: format!("data in several files (`data file: {name}`)"),
            remedy: "open the file in 3D Slicer and save it as one .nrrd file",
        });
    }
    let data = || {
        let path = inside(folder, name)?;
        let length = file_length(&path)?;
        plan.read(Source::plain(BufReader::new(files::open(&path, FileKind::Volume)?), length))
    };
    data().map_err(|fault| in_data_file(&folder.join(name), unquoted(fault)))
}

/// The fault without text from the data file, since a header may name a private file.
fn unquoted(fault: VolumeFault) -> VolumeFault {
    match fault {
        VolumeFault::Text { index, kind, .. } => {
            VolumeFault::Header(format!("value {index} of the text data is not a number of type {kind}"))
        }
        fault => fault,
    }
}

/// Plan for reading the data that a header describes.
struct Plan<'a> {
    header: &'a Header,
    size: [usize; 3],
    count: usize,
    layers: Layers,
    lps_from_voxel: DAffine3,
}

impl<'a> Plan<'a> {
    fn of(header: &'a Header, options: ReadOptions) -> Result<Self, VolumeFault> {
        let dimension: usize = header.number("dimension")?.unwrap_or(0);
        let sizes: Vec<u64> = header.numbers("sizes")?.unwrap_or_default();
        if sizes.len() != dimension {
            let reason = format!("`sizes` has {} numbers and `dimension` is {dimension}", sizes.len());
            return Err(VolumeFault::Header(reason));
        }
        if !(3..=4).contains(&dimension) {
            let what = format!("an NRRD file of {dimension} axes");
            return Err(VolumeFault::Unsupported { what, remedy: "save one volume of three axes" });
        }
        let count = voxel_count(&sizes)?;
        let list = list_axis(header, dimension)?;
        let spatial: Vec<usize> = (0..dimension).filter(|axis| Some(*axis) != list).collect();
        let &[x, y, z] = &spatial[..] else {
            let what = format!("an NRRD file of {} axes of space", spatial.len());
            return Err(VolumeFault::Unsupported { what, remedy: "save each volume as a file of its own" });
        };
        let layers = list.map_or(Layers::ONE, |axis| Layers {
            count: sizes[axis] as usize,
            inner: sizes[..axis].iter().product::<u64>() as usize,
        });
        if layers.count > LAYERS_MAX {
            return Err(VolumeFault::Layers { found: layers.count, limit: LAYERS_MAX });
        }
        let lps_from_voxel = placement(header, &spatial, dimension, options)?;
        Ok(Self { header, size: [x, y, z].map(|axis| sizes[axis] as usize), count, layers, lps_from_voxel })
    }

    fn read(&self, source: Source<'_>) -> Result<RawVolume, VolumeFault> {
        Ok(RawVolume {
            size: self.size,
            lps_from_voxel: self.lps_from_voxel,
            samples: values::read(self.header, self.count as u64, source)?,
            layers: self.layers,
            segments: segments::segments(&self.header.pairs)?,
            remarks: self.header.remarks.clone(),
        })
    }
}

/// Index of the axis that counts layers, if there is one.
fn list_axis(header: &Header, dimension: usize) -> Result<Option<usize>, VolumeFault> {
    let kinds = header.words("kinds").unwrap_or_default();
    let kind = |axis: usize| kinds.get(axis).map_or("???", String::as_str);
    let is_space = |axis: usize| matches!(kind(axis).to_ascii_lowercase().as_str(), "domain" | "space");
    let list = if let Some(directions) = header.vectors("space directions")? {
        if directions.len() != dimension {
            let reason = format!("`space directions` has {} and `dimension` is {dimension}", directions.len());
            return Err(VolumeFault::Header(reason));
        }
        directions.iter().position(Option::is_none)
    } else if dimension == 4 && !kinds.is_empty() {
        (0..dimension).find(|axis| !is_space(*axis))
    } else if dimension == 4 {
        // An axis whose spacing isn't a number is no axis of space.
        let spacings: Vec<f64> = header.numbers("spacings")?.unwrap_or_default();
        spacings.iter().position(|spacing| spacing.is_nan())
    } else {
        None
    };
    let Some(axis) = list else { return Ok(None) };
    let segmented = header.pairs.iter().any(|(key, _)| key.starts_with("Segment0_"));
    if !segmented && !matches!(kind(axis), "list" | "???" | "none" | "scalar" | "stub") {
        let what = format!("axis {axis} of kind {}", kind(axis));
        return Err(VolumeFault::Unsupported { what, remedy: "save one volume of three axes" });
    }
    Ok(Some(axis))
}

fn placement(
    header: &Header,
    spatial: &[usize],
    dimension: usize,
    options: ReadOptions,
) -> Result<DAffine3, VolumeFault> {
    let unit = unit(header)?;
    let stated = header.field("space").map(space).transpose()?.flatten();
    if let Some(directions) = header.vectors("space directions")? {
        let axes = stated.or(options.assume_axes);
        let axes = axes.ok_or(VolumeFault::NoAxes { found: "no `space` of patient axes" })?;
        let columns: Vec<DVec3> = spatial.iter().filter_map(|axis| directions[*axis]).collect();
        let &[x, y, z] = &columns[..] else {
            return Err(VolumeFault::Header("`space directions` needs three vectors".to_owned()));
        };
        let origin = match header.vectors("space origin")?.as_deref() {
            None => DVec3::ZERO,
            Some([Some(origin)]) => *origin,
            Some(_) => return Err(VolumeFault::Header("`space origin` needs one vector".to_owned())),
        };
        return lps_mm(DAffine3::from_mat3_translation(DMat3::from_cols(x, y, z), origin), axes, unit);
    }
    let spacings: Option<Vec<f64>> = header.numbers("spacings")?;
    let found = match &spacings {
        Some(_) => "`spacings`, but no `space directions`",
        None => "neither `space directions` nor `spacings`",
    };
    let axes = options.assume_axes.ok_or(VolumeFault::NoAxes { found })?;
    let spacings = spacings.unwrap_or_default();
    if spacings.len() != dimension {
        let reason = format!("`spacings` has {} numbers and `dimension` is {dimension}", spacings.len());
        return Err(VolumeFault::Header(reason));
    }
    let spacing = DVec3::new(spacings[spatial[0]], spacings[spatial[1]], spacings[spatial[2]]);
    lps_mm(DAffine3::from_scale(spacing), axes, unit)
}

/// Patient axes of the value of `space`; `None` for a space that doesn't refer to a patient.
fn space(name: &str) -> Result<Option<PatientAxes>, VolumeFault> {
    Ok(Some(match name.to_ascii_lowercase().as_str() {
        "lps" | "left-posterior-superior" => PatientAxes::Lps,
        "ras" | "right-anterior-superior" => PatientAxes::Ras,
        "las" | "left-anterior-superior" => PatientAxes::Las,
        "scanner-xyz" | "3d-right-handed" | "3d-left-handed" => return Ok(None),
        _ => {
            let reason = format!(
                "`space: {name}` isn't known; left-posterior-superior (LPS), right-anterior-superior (RAS) and \
                 left-anterior-superior (LAS) are"
            );
            return Err(VolumeFault::Header(reason));
        }
    }))
}

/// Name of the unit of length, and its length in mm.
fn unit(header: &Header) -> Result<(&'static str, f64), VolumeFault> {
    let Some(words) = header.words("space units") else { return Ok(("none stated, mm assumed", 1.0)) };
    let mut units = words.iter().map(|word| match word.to_lowercase().as_str() {
        "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" | "" => Ok(("mm", 1.0)),
        "cm" | "centimeter" | "centimeters" => Ok(("cm", 10.0)),
        "m" | "meter" | "meters" | "metre" | "metres" => Ok(("metres", 1000.0)),
        "um" | "µm" | "μm" | "micron" | "microns" | "micrometer" | "micrometers" => Ok(("microns", 0.001)),
        _ => Err(VolumeFault::Header(format!("`space units` has `{word}`; mm, cm, m and um are known"))),
    });
    let first = units.next().unwrap_or(Ok(("mm", 1.0)))?;
    for other in units {
        if other? != first {
            return Err(VolumeFault::Header(format!("`space units` differ among the axes: {}", words.join(" "))));
        }
    }
    Ok(first)
}

#[cfg(test)]
mod tests;
