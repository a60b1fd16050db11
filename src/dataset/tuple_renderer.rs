//! Renders tuples from their rows.

use std::path::Path;
use std::sync::Arc;

use super::stations::{class_of, sha256, station_of};
use super::step::{Progress, Step};
use super::{ATTENUATION_POWER, DatasetError, Header, RollingRow, Row};
use crate::anatomy::Scene;
use crate::anatomy::bvh::Bvh;
use crate::phantom;
use crate::pose::Pose;
use crate::render::{Backend, Frame, Quality, RenderError, RenderSettings, Renderer};
use crate::sink::npy::bytes_of_u8;
use crate::station::Station;

/// A rendered tuple.
pub(super) struct RenderedTuple {
    /// Bytes of its file.
    pub(super) bytes: Vec<u8>,
    /// Bytes of its mask's file.
    pub(super) mask: Vec<u8>,
    /// Width, height.
    pub(super) size: [u32; 2],
}

/// A scene and its renderers, each made when first needed.
struct SceneRenderers {
    /// Station of the scene.
    station: Station,
    scene: Scene,
    bvh: Option<Arc<Bvh>>,
    /// Renderers of low and of high quality.
    renderers: [Option<Renderer>; 2],
    /// Class of each number of the frames.
    class_of: Vec<u8>,
}

/// Renders tuples. Keeps the last scene: rows of one scene follow each other.
pub(crate) struct TupleRenderer<'a> {
    backend: &'a Backend,
    progress: &'a Progress<'a>,
    classes: Vec<String>,
    scene: Option<SceneRenderers>,
    frames: [Frame; 2],
    planes: [Vec<u8>; 2],
}

impl<'a> TupleRenderer<'a> {
    /// A renderer of tuples with these classes. `progress` receives the steps in building a phantom.
    pub(crate) fn new(backend: &'a Backend, classes: Vec<String>, progress: &'a Progress<'a>) -> Self {
        Self { backend, progress, classes, scene: None, frames: Default::default(), planes: Default::default() }
    }

    /// The scene of `station`.
    pub(super) fn scene(&mut self, station: &Station) -> Result<&Scene, DatasetError> {
        Ok(&self.prepared(station)?.scene)
    }

    fn prepared(&mut self, station: &Station) -> Result<&mut SceneRenderers, DatasetError> {
        // The last scene is dropped before another is built: memory may not hold both.
        let set = match self.scene.take().filter(|set| set.station == *station) {
            Some(set) => set,
            None => {
                let step = |p: phantom::Progress| (self.progress)(Step::Phantom { done: p.done, total: p.total });
                let scene = station.load_scene(&step)?;
                let class_of = class_of(&self.classes, scene.tissues.names())?;
                SceneRenderers { station: station.clone(), scene, bvh: None, renderers: [None, None], class_of }
            }
        };
        Ok(self.scene.insert(set))
    }

    /// The renderer of low (0) or high (1) quality, with the settings and the time of `row`.
    fn renderer(&mut self, quality: usize, station: &Station, row: &Row) -> Result<&mut Renderer, DatasetError> {
        let backend = self.backend;
        let (probe, settings) = row.settings.apply(&station.probe, &station.settings);
        let [rays, layers] = [row.lq, row.hq][quality];
        // Both qualities have the same maps; the second frame needs none.
        let maps = settings.maps && quality == 0;
        let settings = RenderSettings {
            quality: Quality { rays, layers, seed: row.seed },
            look: row.look.of(quality),
            maps,
            ..settings
        };
        let set = self.prepared(station)?;
        let renderer = match &mut set.renderers[quality] {
            Some(renderer) => renderer,
            empty => {
                let bvh = match &set.bvh {
                    Some(bvh) => bvh.clone(),
                    None => Arc::new(Bvh::build(&set.scene).map_err(RenderError::from)?),
                };
                set.bvh = Some(bvh.clone());
                empty.insert(Renderer::with_bvh(backend, &set.scene, bvh, &probe, &settings)?)
            }
        };
        renderer.reconfigure(&probe, &settings)?;
        renderer.set_time_s(row.time_s);
        Ok(renderer)
    }

    /// Renders the high quality of `row` with `seed`, over `station`, that of the row ([`Dataset::station`](super::Dataset::station)).
    /// Returns grey levels.
    ///
    /// # Errors
    /// A scene that cannot be loaded, has a tissue without a class, or cannot be rendered.
    pub(crate) fn high_quality(&mut self, station: &Station, row: &Row, seed: u32) -> Result<&[u8], DatasetError> {
        self.render(1, station, &Row { seed, ..row.clone() })?;
        Ok(&self.frames[1].bmode)
    }

    /// Renders the frame of low (0) or high (1) quality of `row`.
    fn render(&mut self, quality: usize, station: &Station, row: &Row) -> Result<(), DatasetError> {
        let mut frame = std::mem::take(&mut self.frames[quality]);
        let renderer = self.renderer(quality, station, row)?;
        match row.rolling.as_ref().filter(|_| quality == 0) {
            Some(rolling) => renderer.render_live(way(row, rolling), &mut frame)?,
            None => renderer.render(&Pose::from(&row.pose), &mut frame)?,
        }
        self.frames[quality] = frame;
        Ok(())
    }

    /// Whether rendering reproduces the tuple of `row` of the data set in `directory`, bit for bit.
    pub(super) fn agrees(&mut self, directory: &Path, header: &Header, row: &Row) -> Result<bool, DatasetError> {
        let station = station_of(directory, header, row)?;
        Ok(sha256(&self.tuple(&station, row, None)?.bytes) == row.sha256)
    }

    /// Renders the tuple of `row`; none of its files need exist. A high quality that is there already is taken over.
    pub(super) fn tuple(
        &mut self,
        station: &Station,
        row: &Row,
        high_quality: Option<Vec<u8>>,
    ) -> Result<RenderedTuple, DatasetError> {
        self.render(0, station, row)?;
        match high_quality {
            Some(image) => self.frames[1].bmode = image,
            None => self.render(1, station, row)?,
        }
        let class_of = self.prepared(station)?.class_of.clone();
        let [lq, hq] = &self.frames;
        let [segmentation, attenuation] = &mut self.planes;
        let class = |&number: &u8| class_of.get(usize::from(number)).copied();
        segmentation.clear();
        for number in &lq.segmentation {
            segmentation.push(class(number).ok_or(DatasetError::Number { number: *number })?);
        }
        attenuation.clear();
        attenuation.extend(lq.attenuation.iter().map(|a| (a.powf(ATTENUATION_POWER) * 255.0).round() as u8));
        let shape = [lq.height as usize, lq.width as usize];
        let path = Path::new(&row.file);
        Ok(RenderedTuple {
            bytes: bytes_of_u8(path, shape, &[&lq.bmode, &hq.bmode, segmentation, attenuation])?,
            mask: bytes_of_u8(path, shape, &[&lq.mask])?,
            size: [lq.width, lq.height],
        })
    }
}

/// Times and poses of the frames of `row` in a live session.
fn way(row: &Row, rolling: &RollingRow) -> impl Iterator<Item = (f64, Pose)> {
    let before = (1..=rolling.poses.len()).rev().zip(&rolling.poses);
    let before =
        before.map(|(back, pose)| ((row.time_s - back as f64 / rolling.frame_rate_hz).max(0.0), Pose::from(pose)));
    before.chain([(row.time_s, Pose::from(&row.pose))])
}
