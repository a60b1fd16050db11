//! Files of a data set, as they are written.

use std::collections::{HashMap, HashSet};
use std::fs::{File, OpenOptions, TryLockError};
use std::io::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::stations::read_station;
use super::tuple_renderer::RenderedTuple;
use super::{Dataset, DatasetError, HEADER_FILE, Header, PLANES, Row, Shard, Split, manifests, read_rows};
use crate::sink::npy::header_of_u8;
use crate::sink::{SinkError, create_dir, write_bytes, write_json, write_text};
use crate::station::Station;

/// The directory of a data set, and the manifest of one of its shards.
#[derive(Debug)]
pub(super) struct Store {
    directory: PathBuf,
    /// Path of the shard's manifest.
    pub(super) path: PathBuf,
    manifest: File,
    /// Indices of the complete tuples of all shards.
    done: HashSet<usize>,
    /// Rows of this shard's tuples that must be rendered again, because their files are missing or cut short.
    pub(super) lost: HashMap<usize, Row>,
    /// Indices of this shard's tuples.
    ours: Range<usize>,
    /// Last row of this shard. If this shard has none, a row of another shard.
    pub(super) last: Option<Row>,
    masks: HashSet<String>,
    /// Numbers of complete training and test tuples of this shard.
    pub(super) splits: (usize, usize),
    /// Total size of this shard's complete tuples, bytes.
    pub(super) bytes: u64,
}

impl Store {
    /// Opens or creates the data set of `header` in `directory`, to render the missing tuples of `ours`. Refuses a
    /// directory that holds another data set, and tuples that another run is writing.
    pub(super) fn open(
        directory: &Path,
        header: &Header,
        stations: &[Station],
        shard: Shard,
        ours: Range<usize>,
    ) -> Result<Self, DatasetError> {
        for folder in ["tuples", "masks", "stations"] {
            create_dir(&directory.join(folder))?;
        }
        let path = directory.join(HEADER_FILE);
        if path.exists() {
            let found = Header::load(directory)?;
            if let Some(difference) = difference(&found, header) {
                return Err(DatasetError::OtherDataset { directory: directory.to_owned(), difference });
            }
        } else {
            for (station, kept) in stations.iter().zip(&header.stations) {
                write_text(&directory.join(&kept.file), &read_station(&station.path)?)?;
            }
            // Written last: its presence marks a complete set-up.
            write_json(&path, header)?;
        }
        let name = match shard.of {
            1 => "manifest.jsonl".to_owned(),
            of => format!("manifest.{:05}-of-{of:05}.jsonl", shard.number),
        };
        let path = directory.join(name);
        let manifest = OpenOptions::new().create(true).append(true).open(&path).map_err(SinkError::io(&path))?;
        // On file systems without locks, two simultaneous runs go unnoticed.
        if let Err(TryLockError::WouldBlock) = manifest.try_lock() {
            return Err(DatasetError::Busy { manifest: path });
        }
        let (_, whole) = read_rows(&path)?;
        // Removes the incomplete last row that a killed run left.
        manifest.set_len(whole).map_err(SinkError::io(&path))?;
        // Shards of the same total share no tuples. A shard of a different total may be writing the same tuples.
        for other in manifests(directory)?.into_iter().filter(|other| shards_of(other) != shards_of(&path)) {
            let file = File::open(&other).map_err(SinkError::io(&other))?;
            if let Err(TryLockError::WouldBlock) = file.try_lock_shared() {
                return Err(DatasetError::Busy { manifest: other });
            }
        }
        let mut store = Self {
            directory: directory.to_owned(),
            path,
            manifest,
            done: HashSet::new(),
            lost: HashMap::new(),
            ours,
            last: None,
            masks: HashSet::new(),
            splits: (0, 0),
            bytes: 0,
        };
        let rows = Dataset::open(directory)?.rows;
        let own: Vec<&Row> = rows.iter().filter(|row| store.ours.contains(&row.index)).collect();
        store.lost = lost(directory, &own);
        rows.iter().for_each(|row| store.count(row));
        Ok(store)
    }

    /// Counts the tuple of `row`, unless its files are lost.
    fn count(&mut self, row: &Row) {
        let ours = self.ours.contains(&row.index);
        if ours || self.last.is_none() {
            self.last = Some(row.clone());
        }
        if self.lost.contains_key(&row.index) {
            return;
        }
        self.done.insert(row.index);
        if !ours {
            return;
        }
        self.bytes += 4 * u64::from(row.size[0]) * u64::from(row.size[1]);
        match row.split {
            Split::Train => self.splits.0 += 1,
            Split::Test => self.splits.1 += 1,
        }
    }

    /// Writes the mask and then the row of a tuple whose array is already written. Completes the row's size, mask and
    /// checksum. The row of a lost tuple is already in the manifest.
    pub(super) fn keep(&mut self, row: Row, tuple: RenderedTuple) -> Result<(), DatasetError> {
        let RenderedTuple { sha256, mask, size } = tuple;
        if !self.masks.contains(&mask.file) {
            write_bytes(&self.directory.join(&mask.file), &mask.bytes)?;
            self.masks.insert(mask.file.clone());
        }
        let row = Row { size, mask: mask.file, sha256, ..row };
        match self.lost.remove(&row.index) {
            Some(known) if known.mask != row.mask => {
                return Err(DatasetError::OtherMachine { directory: self.directory.clone(), index: row.index });
            }
            Some(_) => {}
            None => self.append(&row)?,
        }
        self.count(&row);
        Ok(())
    }

    /// Appends a row to the manifest.
    fn append(&mut self, row: &Row) -> Result<(), SinkError> {
        let mut line = serde_json::to_vec(row).map_err(|source| SinkError::Json { path: self.path.clone(), source })?;
        line.push(b'\n');
        self.manifest.write_all(&line).map_err(SinkError::io(&self.path))
    }

    /// The indices in `tuples` of incomplete tuples.
    pub(super) fn missing(&self, tuples: Range<usize>) -> Vec<usize> {
        tuples.filter(|index| !self.done.contains(index)).collect()
    }

    /// Number of this shard's complete tuples.
    pub(super) fn done(&self) -> usize {
        self.splits.0 + self.splits.1
    }
}

/// Rows of tuples that must be rendered again, by tuple index: the array is missing or has another size. A lost mask
/// counts only for the first tuple that uses it.
fn lost(directory: &Path, rows: &[&Row]) -> HashMap<usize, Row> {
    let there: Vec<bool> = rows.par_iter().map(|row| is_there(directory, &row.file, row.size, PLANES.len())).collect();
    let (mut lost, mut masks) = (HashMap::new(), HashSet::new());
    for (row, there) in rows.iter().copied().zip(there) {
        let mask_is_lost = masks.insert(row.mask.as_str()) && !is_there(directory, &row.mask, row.size, 1);
        if !there || mask_is_lost {
            lost.insert(row.index, row.clone());
        }
    }
    lost
}

/// Whether `file` has the length of a `uint8` array of this size. Its content is not read.
fn is_there(directory: &Path, file: &str, size: [u32; 2], planes: usize) -> bool {
    let (path, mut head) = (directory.join(file), Vec::new());
    let [width, height] = size;
    if header_of_u8(&path, [height as usize, width as usize], planes, &mut head).is_err() {
        return false;
    }
    let values = (planes as u64).saturating_mul(u64::from(width) * u64::from(height));
    let length = values.saturating_add(head.len() as u64);
    std::fs::metadata(&path).is_ok_and(|found| found.is_file() && found.len() == length)
}

/// Number of shards in a manifest's file name; `None` if there is only one.
fn shards_of(manifest: &Path) -> Option<String> {
    let name = manifest.file_name()?.to_string_lossy().into_owned();
    name.split_once("-of-").map(|(_, of)| of.to_owned())
}

/// Description of the first difference between two headers; `None` if they are equal.
fn difference(found: &Header, wanted: &Header) -> Option<String> {
    let fields = |header: &Header| -> Vec<(String, String)> {
        let value = serde_json::to_value(header).unwrap_or_default();
        let fields = value.as_object().cloned().unwrap_or_default();
        fields.into_iter().map(|(key, value)| (key, value.to_string())).collect()
    };
    let pairs = fields(found).into_iter().zip(fields(wanted));
    let differing = pairs.into_iter().find(|(found, wanted)| found != wanted);
    differing.map(|((key, found), (_, wanted))| format!("{key} is {found}, not {wanted}"))
}
