//! Reading of volume files by path.

use std::io::{BufReader, Read as _, Seek as _};
use std::path::{Path, PathBuf};

use insonify_core::files::{self, FileKind};

use super::raw::RawVolume;
use super::source::{Source, file_length, in_data_file};
use super::{Image, LabelMap, ReadOptions, VolumeError, VolumeFault, nifti, nrrd};

/// Number of bytes at the start of a file that suffice to recognise the format.
const START_BYTES: u64 = 352;

/// Advice for other volume formats.
const CONVERT: &str = "; open it in 3D Slicer and save it as .nrrd";

/// Label map in the file at `path`, NIfTI or NRRD as its content shows.
///
/// # Errors
/// A file that can't be read, isn't a volume, states no axes (unless `options` do), or has values that aren't labels.
pub fn read_labels(path: &Path, options: ReadOptions) -> Result<LabelMap, VolumeError> {
    let labels = read(path, options).and_then(|raw| raw.into_labels(path));
    labels.map_err(|fault| VolumeError::new(path, fault))
}

/// Image in the file at `path`, NIfTI or NRRD as its content shows.
///
/// # Errors
/// A file that can't be read, isn't a volume, or states no axes (unless `options` do).
pub fn read_image(path: &Path, options: ReadOptions) -> Result<Image, VolumeError> {
    let image = read(path, options).and_then(|raw| raw.into_image(path));
    image.map_err(|fault| VolumeError::new(path, fault))
}

fn read(path: &Path, options: ReadOptions) -> Result<RawVolume, VolumeFault> {
    let header = if suffix(path).is_some_and(|(_, suffix)| suffix.starts_with(".img")) {
        sibling(path, [".hdr", ".hdr.gz"]).ok_or(VolumeFault::Unsupported {
            what: "an .img file without its .hdr file".to_owned(),
            remedy: "give the two files the same name in one folder",
        })?
    } else {
        path.to_owned()
    };
    let (mut source, compressed) = open(&header)?;
    let start = source.up_to(START_BYTES)?;
    drop(source);
    match format(&start)? {
        Format::Nrrd if compressed => Err(VolumeFault::Unsupported {
            what: "a compressed NRRD file".to_owned(),
            remedy: "decompress it with gunzip (NRRD compresses its voxels inside the file)",
        }),
        Format::Nrrd => {
            let file = files::open(&header, FileKind::Volume)?;
            let length = file.metadata()?.len();
            nrrd::read_nrrd(BufReader::new(file), length, header.parent().unwrap_or(Path::new("")), options)
        }
        Format::Nifti { single: true } => nifti::read_nifti(&mut open(&header)?.0, None, options),
        Format::Nifti { single: false } => {
            let Some(image) = sibling(&header, [".img", ".img.gz"]) else {
                return nifti::read_nifti(&mut open(&header)?.0, None, options);
            };
            let (voxels, _) = open(&image).map_err(|fault| in_data_file(&image, fault))?;
            nifti::read_nifti(&mut open(&header)?.0, Some(voxels), options)
        }
    }
}

/// Content of a file, decompressed if necessary, and whether the file is gzip data.
fn open(path: &Path) -> Result<(Source<'static>, bool), VolumeFault> {
    let length = file_length(path)?;
    let mut magic = Vec::new();
    let mut file = files::open(path, FileKind::Volume)?;
    file.by_ref().take(2).read_to_end(&mut magic)?;
    file.rewind()?;
    let file = BufReader::new(file);
    let compressed = magic == [0x1f, 0x8b];
    Ok((if compressed { Source::gzip(file) } else { Source::plain(file, length) }, compressed))
}

/// Stem, and lower-case suffix, of a file of a NIfTI pair (header or image); `None` for other files.
fn suffix(path: &Path) -> Option<(String, String)> {
    let name = path.file_name()?.to_str()?;
    let lower = name.to_ascii_lowercase();
    let suffix = [".hdr", ".img", ".hdr.gz", ".img.gz"].into_iter().find(|suffix| lower.ends_with(suffix))?;
    Some((name[..name.len() - suffix.len()].to_owned(), suffix.to_owned()))
}

fn sibling(path: &Path, suffixes: [&str; 2]) -> Option<PathBuf> {
    let (stem, _) = suffix(path)?;
    suffixes.into_iter().map(|suffix| path.with_file_name(format!("{stem}{suffix}"))).find(|path| path.is_file())
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Nifti { single: bool },
    Nrrd,
}

/// Format of a file that starts with these bytes.
fn format(start: &[u8]) -> Result<Format, VolumeFault> {
    if start.starts_with(b"NRRD") {
        return Ok(Format::Nrrd);
    }
    let other = |found, remedy| Err(VolumeFault::Format { found, remedy });
    match nifti::version(start) {
        // A truncated header is reported by the reader.
        Some(_) if start.len() < 348 => return Ok(Format::Nifti { single: true }),
        Some((1, _)) => match &start[344..348] {
            b"n+1\0" => return Ok(Format::Nifti { single: true }),
            b"ni1\0" => return Ok(Format::Nifti { single: false }),
            _ => return other("an ANALYZE 7.5 file, which doesn't state where its axes point", CONVERT),
        },
        Some(_) => return Ok(Format::Nifti { single: !start[4..].starts_with(b"ni2") }),
        None => {}
    }
    match start {
        [] => other("an empty file", ""),
        _ if start.get(128..132) == Some(b"DICM") => {
            other("a DICOM file", "; convert a series to .nii.gz with dcm2niix, or open a DICOM SEG in 3D Slicer")
        }
        [b'P', b'K', 3, 4, ..] => other("a ZIP archive", "; unpack it first"),
        [0, 0, 0, 1, ..] => other("perhaps a FreeSurfer .mgh file", "; convert it with `mri_convert`"),
        _ if start.starts_with(b"ObjectType") || start.starts_with(b"NDims") => other("a MetaImage file", CONVERT),
        _ => other("neither a NIfTI nor an NRRD file", ""),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_formats_are_named_with_a_way_out() {
        let mut dicom = vec![0; 128];
        dicom.extend(b"DICM");
        let mut analyze = 348_i32.to_le_bytes().to_vec();
        analyze.resize(352, 0);
        for (bytes, says) in [
            (dicom, "dcm2niix"),
            (analyze, "ANALYZE 7.5"),
            (b"ObjectType = Image\n".to_vec(), "MetaImage"),
            (b"PK\x03\x04....".to_vec(), "unpack"),
            (Vec::new(), "an empty file"),
            (b"hello".to_vec(), "neither"),
        ] {
            let error = format(&bytes).unwrap_err().to_string();
            assert!(error.contains(says) && error.contains(".nii.gz"), "{error}");
        }
    }

    #[test]
    fn a_missing_file_and_a_folder_are_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("none.nii");
        let error = read_labels(&missing, ReadOptions::default()).unwrap_err().to_string();
        assert!(error.contains("none.nii: can't be read"), "{error}");
        let error = read_labels(folder.path(), ReadOptions::default()).unwrap_err().to_string();
        assert!(error.contains("not a file"), "{error}");
    }
}
