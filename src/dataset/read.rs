//! Reading of a data set.

use std::path::{Path, PathBuf};

use super::sum::sha256;
use super::{ATTENUATION_POWER, DatasetError, FORMAT, HEADER_FILE, Header, PLANES, Row, Split};
use crate::files::{self, FileError, FileKind};

/// Number of digits of a mask's SHA-256 in its file name.
pub(super) const MASK_DIGITS: usize = 16;

/// A data set on disk. Header and rows are in memory; arrays are read on demand.
#[derive(Debug, Clone, PartialEq)]
pub struct Dataset {
    /// Directory of the data set.
    pub directory: PathBuf,
    /// Content of `dataset.json`.
    pub header: Header,
    /// Rows of all manifests, sorted by index.
    pub rows: Vec<Row>,
}

/// Arrays of a tuple, each [height × width], row by row; the first row is the nearest to the probe.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Tuple {
    /// Width and height, pixels.
    pub size: [usize; 2],
    /// Grey levels of the low-quality frame.
    pub lq: Vec<u8>,
    /// Grey levels of the high-quality frame.
    pub hq: Vec<u8>,
    /// Tissue classes: indices in [`Header::classes`].
    pub segmentation: Vec<u8>,
    /// 255 × the attenuation map to the power of [`ATTENUATION_POWER`](super::ATTENUATION_POWER).
    pub attenuation: Vec<u8>,
    /// 255 inside the sector, 0 outside.
    pub mask: Vec<u8>,
}

impl Tuple {
    /// The attenuation map in the form that frames have, 0..=1.
    pub fn attenuation_map(&self) -> Vec<f32> {
        let levels: [f32; 256] = std::array::from_fn(|byte| (byte as f32 / 255.0).powf(ATTENUATION_POWER.recip()));
        self.attenuation.iter().map(|&byte| levels[usize::from(byte)]).collect()
    }
}

impl Header {
    /// Reads `dataset.json` of `directory`.
    ///
    /// # Errors
    /// The header is missing or invalid, or has another format version.
    pub fn load(directory: &Path) -> Result<Self, DatasetError> {
        let path = directory.join(HEADER_FILE);
        let text = files::read(&path, FileKind::DatasetHeader).map_err(FileError::at("read", &path))?;
        let header: Self =
            serde_json::from_slice(&text).map_err(|source| DatasetError::Header { path: path.clone(), source })?;
        if header.format != FORMAT {
            return Err(DatasetError::Format { path, found: header.format, expected: FORMAT });
        }
        Ok(header)
    }
}

impl Dataset {
    /// Reads header and manifests. The truncated last line that a killed run leaves in its manifest is ignored.
    ///
    /// # Errors
    /// The header is missing or invalid; the directory or a manifest can't be read; a row is invalid; or an index
    /// occurs twice.
    pub fn open(directory: &Path) -> Result<Self, DatasetError> {
        let header = Header::load(directory)?;
        let mut rows: Vec<Row> = Vec::new();
        for path in &manifests(directory)? {
            rows.extend(read_rows(path)?.0);
        }
        rows.sort_by_key(|row| row.index);
        if let Some([row, _]) = rows.array_windows().find(|[a, b]| a.index == b.index) {
            return Err(DatasetError::Array {
                path: directory.to_owned(),
                reason: format!("tuple {} is in its manifests twice", row.index),
            });
        }
        Ok(Self { directory: directory.to_owned(), header, rows })
    }

    /// Rows of the training or test split.
    pub fn of(&self, split: Split) -> impl Iterator<Item = &Row> {
        self.rows.iter().filter(move |row| row.split == split)
    }

    /// Reads the arrays of the tuple of `row`.
    ///
    /// # Errors
    /// A file can't be read, does not have the type or shape in its row, has changed since it was made, or has an
    /// unknown class.
    pub fn tuple(&self, row: &Row) -> Result<Tuple, DatasetError> {
        let [width, height] = row.size.map(|n| n as usize);
        let path = self.directory.join(&row.file);
        let (all, mask) = (self.planes(row)?, self.mask(row)?);
        let mut planes = all.chunks_exact((width * height).max(1)).map(<[u8]>::to_vec);
        let mut next = || planes.next().unwrap_or_default();
        let tuple =
            Tuple { size: [width, height], lq: next(), hq: next(), segmentation: next(), attenuation: next(), mask };
        let classes = self.header.classes.len();
        match tuple.segmentation.iter().find(|&&class| usize::from(class) >= classes) {
            Some(class) => {
                let reason = format!("holds class {class}; the data set has {classes}");
                Err(DatasetError::Array { path, reason })
            }
            None => Ok(tuple),
        }
    }

    /// Planes of the tuple of `row`, one after another.
    pub(super) fn planes(&self, row: &Row) -> Result<Vec<u8>, DatasetError> {
        let [width, height] = row.size.map(|n| n as usize);
        read(&self.directory.join(&row.file), &[PLANES.len(), height, width], &row.sha256)
    }

    /// Mask of the tuple of `row`.
    pub(super) fn mask(&self, row: &Row) -> Result<Vec<u8>, DatasetError> {
        let [width, height] = row.size.map(|n| n as usize);
        read(&self.directory.join(&row.mask), &[height, width], digits_of(&row.mask))
    }
}

/// Digits of the SHA-256 in the mask's file name; empty if there are none.
fn digits_of(mask: &str) -> &str {
    let digits = mask.strip_suffix(".npy").and_then(|name| name.rsplit_once('_')).map_or("", |(_, digits)| digits);
    let is_sum = digits.len() == MASK_DIGITS && digits.bytes().all(|digit| digit.is_ascii_hexdigit());
    if is_sum { digits } else { "" }
}

/// Paths of the manifests of the data set in `directory`, sorted by name: one in total, or one per shard.
///
/// # Errors
/// The directory cannot be read.
pub fn manifests(directory: &Path) -> Result<Vec<PathBuf>, DatasetError> {
    let failed = FileError::at("read", directory);
    let mut manifests = Vec::new();
    for entry in std::fs::read_dir(directory).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        if name.starts_with("manifest") && name.ends_with(".jsonl") {
            manifests.push(path);
        }
    }
    manifests.sort();
    Ok(manifests)
}

/// Rows of a manifest, and its length in bytes up to the end of the last complete row.
///
/// # Errors
/// The file cannot be read, or a complete line is not a row.
pub fn read_rows(path: &Path) -> Result<(Vec<Row>, u64), DatasetError> {
    let text = files::read(path, FileKind::DatasetRows).map_err(FileError::at("read", path))?;
    let (mut rows, mut whole) = (Vec::new(), 0);
    for (number, line) in text.split_inclusive(|&byte| byte == b'\n').enumerate() {
        let is_last_and_cut = !line.ends_with(b"\n");
        if is_last_and_cut {
            break;
        }
        let row = serde_json::from_slice(line).map_err(|e| DatasetError::Row {
            path: path.to_owned(),
            line: number + 1,
            reason: e.to_string(),
        })?;
        rows.push(row);
        whole += line.len() as u64;
    }
    Ok((rows, whole))
}

/// Bytes of the `uint8` array file at `path`. It must have the shape `shape`, and its SHA-256 must start with `digits`.
fn read(path: &Path, shape: &[usize], digits: &str) -> Result<Vec<u8>, DatasetError> {
    let failed = FileError::at("read", path);
    let bytes = files::read(path, FileKind::Array).map_err(failed)?;
    let npy = files::npy(&bytes).map_err(failed)?;
    let found: Vec<usize> = npy.shape().iter().map(|&n| n as usize).collect();
    if found != shape || npy.order() != npyz::Order::C {
        let reason = format!("is an array {found:?}; its row says {shape:?}");
        return Err(DatasetError::Array { path: path.to_owned(), reason });
    }
    let values = npy
        .into_vec::<u8>()
        .map_err(|e| DatasetError::Array { path: path.to_owned(), reason: format!("is not of bytes: {e}") })?;
    if !sha256(&bytes).starts_with(digits) {
        return Err(DatasetError::Damaged { path: path.to_owned() });
    }
    Ok(values)
}
