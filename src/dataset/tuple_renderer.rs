//! Rendering of tuples from the rows of a manifest.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::levels::{Levels, extend_by_classes};
use super::read::MASK_DIGITS;
use super::scenes::TupleScene;
use super::sum::sha256;
use super::{DatasetError, RollingRow, Row};
use crate::lanes::lane_count;
use crate::pose::Pose;
use crate::render::{Backend, Frame, Quality, RenderSettings, Renderer, SharedTables};
use crate::sink::npy::{bytes_of_u8, header_of_u8};
use crate::sink::{SinkError, check_shape, write_bytes};
use crate::station::Station;
use crate::transducer::Probe;

/// Indices of a renderer's configurations for low and high quality.
const LOW: usize = 0;
const HIGH: usize = 1;

/// Largest number of lanes (parallel renderers) on a device. Each needs a renderer's memory there.
const DEVICE_LANES_MAX: usize = 4;

/// A mask file to be written.
#[derive(Debug, Clone)]
pub(super) struct MaskFile {
    /// Path below the data set's directory. A hash of the content names the file.
    pub(super) file: String,
    pub(super) bytes: Arc<[u8]>,
}

/// A rendered tuple's checksum, mask and size. Its array is in [`TupleRenderer`].
#[derive(Debug, Clone)]
pub(super) struct RenderedTuple {
    pub(super) sha256: String,
    pub(super) mask: MaskFile,
    /// Width and height of the frames, pixels.
    pub(super) size: [u32; 2],
}

/// Renders the tuples of one lane. Keeps its renderer while the scene stays the same.
pub(crate) struct TupleRenderer<'a> {
    backend: &'a Backend,
    kept: Option<(Arc<TupleScene>, Renderer)>,
    /// Precomputed tables of the next tuple.
    tables: Vec<SharedTables>,
    frames: [Frame; 2],
    levels: Levels,
    /// Last mask [height × width], and its file.
    mask: Option<(Arc<[u8]>, MaskFile)>,
    /// Content of the last tuple's array file.
    bytes: Vec<u8>,
}

impl<'a> TupleRenderer<'a> {
    pub(crate) fn new(backend: &'a Backend) -> Self {
        let frames = Default::default();
        let tables = Vec::new();
        Self { backend, kept: None, tables, frames, levels: Levels::new(), mask: None, bytes: Vec::new() }
    }

    /// One renderer for each lane. A device has up to four lanes, because a GPU renders a tuple in a fraction of the
    /// time that encoding takes.
    pub(crate) fn lanes(backend: &'a Backend) -> Vec<Self> {
        let lanes = if backend.on_host() { lane_count() } else { lane_count().min(DEVICE_LANES_MAX) };
        (0..lanes).map(|_| Self::new(backend)).collect()
    }

    /// The renderer with the configuration for low (0) or high (1) quality, and the settings of `row`.
    fn renderer(&mut self, quality: usize, scene: &Arc<TupleScene>, row: &Row) -> Result<&mut Renderer, DatasetError> {
        let (probe, settings) = configured(&scene.station, row, quality);
        // Frees another scene's renderer before a new one is made.
        let kept = self.kept.take_if(|(of, _)| Arc::ptr_eq(of, scene));
        self.kept = None;
        let kept = match kept {
            Some(kept) => kept,
            None => {
                let (tree, frames_of) = (scene.bvh.clone(), &scene.scene);
                (scene.clone(), Renderer::with_tables(self.backend, frames_of, tree, &probe, &settings, &self.tables)?)
            }
        };
        let (_, renderer) = self.kept.insert(kept);
        renderer.set_needle(scene.station.standing_needle());
        renderer.select(quality)?;
        renderer.reconfigure_with(&probe, &settings, &self.tables)?;
        Ok(renderer)
    }

    /// Renders the high-quality frame of `row` with another `seed`. Returns its grey levels.
    ///
    /// # Errors
    /// The scene can't be rendered.
    pub(crate) fn high_quality(
        &mut self,
        scene: &Arc<TupleScene>,
        row: &Row,
        seed: u32,
    ) -> Result<&[u8], DatasetError> {
        self.render(HIGH, scene, &Row { seed, ..row.clone() })?;
        Ok(&self.frames[HIGH].bmode)
    }

    /// Renders the low- (0) or high-quality (1) frame of `row`.
    fn render(&mut self, quality: usize, scene: &Arc<TupleScene>, row: &Row) -> Result<(), DatasetError> {
        let mut frame = std::mem::take(&mut self.frames[quality]);
        let renderer = self.renderer(quality, scene, row)?;
        match row.rolling.as_ref().filter(|_| quality == LOW) {
            Some(rolling) => renderer.render_live(live_frames(row, rolling), &mut frame)?,
            None => {
                renderer.set_time_s(row.time_s);
                renderer.render(&Pose::from(&row.pose), &mut frame)?;
            }
        }
        self.frames[quality] = frame;
        Ok(())
    }

    /// Renders both frames of `row`, each with one steering angle. A device works on both at once.
    fn render_both(&mut self, scene: &Arc<TupleScene>, row: &Row) -> Result<(), DatasetError> {
        let [mut low, mut high] = std::mem::take(&mut self.frames);
        self.renderer(LOW, scene, row)?;
        let renderer = self.renderer(HIGH, scene, row)?;
        let pose = Pose::from(&row.pose);
        renderer.select(LOW)?;
        renderer.set_time_s(row.time_s);
        renderer.submit(&pose)?;
        renderer.select(HIGH)?;
        renderer.set_time_s(row.time_s);
        renderer.submit(&pose)?;
        renderer.receive(&mut low)?;
        renderer.receive(&mut high)?;
        self.frames = [low, high];
        Ok(())
    }

    /// Whether this machine renders the tuple of `row` exactly as its checksum states.
    pub(super) fn agrees(&mut self, scene: &Arc<TupleScene>, row: &Row) -> Result<bool, DatasetError> {
        Ok(self.tuple(scene, row, None)?.sha256 == row.sha256)
    }

    /// Renders the tuple of `row` and writes its array below `directory`. `tables` come from [`tables_of`]. If
    /// `high_quality` is given, it is not rendered. If the row already has a checksum, another one is refused.
    pub(super) fn write(
        &mut self,
        scene: &Arc<TupleScene>,
        tables: Vec<SharedTables>,
        row: &Row,
        high_quality: Option<Vec<u8>>,
        directory: &Path,
    ) -> Result<RenderedTuple, DatasetError> {
        self.tables = tables;
        let tuple = self.tuple(scene, row, high_quality)?;
        if !row.sha256.is_empty() && tuple.sha256 != row.sha256 {
            return Err(DatasetError::OtherMachine { directory: directory.to_owned(), index: row.index });
        }
        write_bytes(&directory.join(&row.file), &self.bytes)?;
        Ok(tuple)
    }

    /// Renders the tuple of `row` into `bytes`; none of its files need exist. If `high_quality` is given, it is not
    /// rendered.
    fn tuple(
        &mut self,
        scene: &Arc<TupleScene>,
        row: &Row,
        high_quality: Option<Vec<u8>>,
    ) -> Result<RenderedTuple, DatasetError> {
        match high_quality {
            Some(image) => {
                self.render(LOW, scene, row)?;
                self.frames[HIGH].bmode = image;
            }
            None if row.rolling.is_none() && [LOW, HIGH].iter().all(|&q| row.look.of(q).angles == 1) => {
                self.render_both(scene, row)?;
            }
            None => {
                self.render(LOW, scene, row)?;
                self.render(HIGH, scene, row)?;
            }
        }
        let [low, high] = &self.frames;
        let (path, shape) = (PathBuf::from(&row.file), [low.height as usize, low.width as usize]);
        for plane in [low.bmode.len(), high.bmode.len(), low.segmentation.len(), low.attenuation.len()] {
            check_shape(&path, shape, plane)?;
        }
        self.bytes.clear();
        header_of_u8(&path, shape, 4, &mut self.bytes)?;
        self.bytes.extend_from_slice(&low.bmode);
        self.bytes.extend_from_slice(&high.bmode);
        extend_by_classes(&mut self.bytes, &low.segmentation, &scene.class_of)?;
        self.levels.extend(&mut self.bytes, &low.attenuation);
        let (mask, size) = (low.mask.clone(), [low.width, low.height]);
        Ok(RenderedTuple { sha256: sha256(&self.bytes), mask: self.mask_file(&path, shape, &mask)?, size })
    }

    /// File for a mask. Consecutive tuples with the same mask share a file.
    fn mask_file(&mut self, path: &Path, shape: [usize; 2], mask: &Arc<[u8]>) -> Result<MaskFile, SinkError> {
        if let Some((_, file)) = self.mask.as_ref().filter(|(of, _)| Arc::ptr_eq(of, mask)) {
            return Ok(file.clone());
        }
        let bytes: Arc<[u8]> = bytes_of_u8(path, shape, &[mask])?.into();
        let [height, width] = shape;
        let file = MaskFile { file: format!("masks/{width}x{height}_{}.npy", &sha256(&bytes)[..MASK_DIGITS]), bytes };
        Ok(self.mask.insert((mask.clone(), file)).1.clone())
    }
}

/// Probe and settings for the low-quality (0) or high-quality (1) frame of `row`.
fn configured(station: &Station, row: &Row, quality: usize) -> (Probe, RenderSettings) {
    let (probe, settings) = row.settings.apply(&station.probe, &station.settings);
    let [rays, layers] = [row.lq, row.hq][quality];
    // Both qualities have the same maps, so only the low-quality frame contains them.
    let maps = settings.maps && quality == LOW;
    let quality_of = Quality { rays, layers, seed: row.seed };
    (probe, RenderSettings { quality: quality_of, look: row.look.of(quality), maps, ..settings })
}

/// Tables for both frames of `row`, shared by all lanes. Tables in `known` that fit are reused.
///
/// # Errors
/// The settings are outside their ranges.
pub(super) fn tables_of(
    scene: &TupleScene,
    row: &Row,
    known: &[SharedTables],
) -> Result<Vec<SharedTables>, DatasetError> {
    let mut made: Vec<SharedTables> = Vec::new();
    for quality in [LOW, HIGH] {
        let (probe, settings) = configured(&scene.station, row, quality);
        let known: Vec<SharedTables> = made.iter().chain(known).cloned().collect();
        made.push(scene.tables.make(&probe, &settings, &known)?);
    }
    Ok(made)
}

/// Times (s) and poses of the live session's frames that `row` compounds, its own frame last.
fn live_frames(row: &Row, rolling: &RollingRow) -> impl Iterator<Item = (f64, Pose)> {
    let before = (1..=rolling.poses.len()).rev().zip(&rolling.poses);
    let before =
        before.map(|(back, pose)| ((row.time_s - back as f64 / rolling.frame_rate_hz).max(0.0), Pose::from(pose)));
    before.chain([(row.time_s, Pose::from(&row.pose))])
}
