//! Renders tuples from their rows.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, anyhow};
use insonify::anatomy::Scene;
use insonify::anatomy::bvh::Bvh;
use insonify::dataset::{ATTENUATION_POWER, Dataset, Header, RollingRow, Row};
use insonify::pose::Pose;
use insonify::render::{Backend, BackendChoice, Frame, Quality, RenderSettings, Renderer};
use insonify::sink::npy::bytes_of_u8;
use insonify::station::{SceneSource, Station};
use serde::Serialize;

use super::super::backend::BackendArgs;
use super::super::progress::Progress;
use super::super::{Classify, Failure, output, session};
use super::store::{RenderedTuple, open_station, sha256};

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
pub(in crate::commands) struct TupleRenderer<'a> {
    backend: &'a Backend,
    classes: Vec<String>,
    scene: Option<SceneRenderers>,
    frames: [Frame; 2],
    planes: [Vec<u8>; 2],
}

impl<'a> TupleRenderer<'a> {
    pub(in crate::commands) fn new(backend: &'a Backend, classes: Vec<String>) -> Self {
        Self { backend, classes, scene: None, frames: Default::default(), planes: Default::default() }
    }

    /// The scene of `station`.
    pub(super) fn scene(&mut self, station: &Station) -> Result<&Scene, Failure> {
        Ok(&self.prepared(station)?.scene)
    }

    fn prepared(&mut self, station: &Station) -> Result<&mut SceneRenderers, Failure> {
        if self.scene.as_ref().is_none_or(|set| set.station != *station) {
            // Dropped before the next is built: memory may not hold both.
            self.scene = None;
            let scene = session::load_scene(station)?;
            let class_of = class_of(&self.classes, scene.tissues.names())?;
            self.scene =
                Some(SceneRenderers { station: station.clone(), scene, bvh: None, renderers: [None, None], class_of });
        }
        self.scene.as_mut().ok_or_else(|| Failure::Other(anyhow!("no scene")))
    }

    /// The renderer of low (0) or high (1) quality, with the settings and the time of `row`.
    fn renderer(&mut self, quality: usize, station: &Station, row: &Row) -> Result<&mut Renderer, Failure> {
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
                    None => Arc::new(Bvh::build(&set.scene).map_err(insonify::render::RenderError::from)?),
                };
                set.bvh = Some(bvh.clone());
                empty.insert(Renderer::with_bvh(backend, &set.scene, bvh, &probe, &settings)?)
            }
        };
        renderer.reconfigure(&probe, &settings)?;
        renderer.set_time_s(row.time_s);
        Ok(renderer)
    }

    /// Renders the high quality of `row` with `seed`. Returns grey levels.
    pub(in crate::commands) fn high_quality(
        &mut self,
        station: &Station,
        row: &Row,
        seed: u32,
    ) -> Result<&[u8], Failure> {
        self.render(1, station, &Row { seed, ..row.clone() })?;
        Ok(&self.frames[1].bmode)
    }

    /// Renders the frame of low (0) or high (1) quality of `row`.
    fn render(&mut self, quality: usize, station: &Station, row: &Row) -> Result<(), Failure> {
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
    pub(super) fn agrees(&mut self, directory: &Path, header: &Header, row: &Row) -> Result<bool, Failure> {
        let station = station_of(directory, header, row)?;
        Ok(sha256(&self.tuple(&station, row, None)?.bytes) == row.sha256)
    }

    /// Renders the tuple of `row`; none of its files need exist. A high quality that is there already is taken over.
    pub(super) fn tuple(
        &mut self,
        station: &Station,
        row: &Row,
        high_quality: Option<Vec<u8>>,
    ) -> Result<RenderedTuple, Failure> {
        self.render(0, station, row)?;
        match high_quality {
            Some(image) => self.frames[1].bmode = image,
            None => self.render(1, station, row)?,
        }
        let Some(set) = &self.scene else { return Err(Failure::Other(anyhow!("no scene"))) };
        let [lq, hq] = &self.frames;
        let [segmentation, attenuation] = &mut self.planes;
        let class = |&number: &u8| set.class_of.get(usize::from(number)).copied();
        segmentation.clear();
        for number in &lq.segmentation {
            let class = class(number).ok_or_else(|| Failure::Other(anyhow!("tissue number {number} has no class")))?;
            segmentation.push(class);
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

/// The class of each tissue number: 0 is outside, number i + 1 is the scene's tissue i.
fn class_of(classes: &[String], tissues: &[String]) -> Result<Vec<u8>, Failure> {
    let class = |name: &str| {
        let found = classes.iter().position(|class| class == name).and_then(|at| u8::try_from(at).ok());
        found.ok_or_else(|| Failure::Input(anyhow!("the data set has no class `{name}`")))
    };
    std::iter::once("outside").chain(tissues.iter().map(String::as_str)).map(class).collect()
}

#[derive(Serialize)]
struct Verified {
    tuples: usize,
    differ: Vec<usize>,
}

/// The station of a tuple of the data set in `directory`, with the tuple's phantom.
pub(in crate::commands) fn station_of(directory: &Path, header: &Header, row: &Row) -> Result<Station, Failure> {
    let mut station = open_station(directory, header, &row.station)?;
    if let (SceneSource::ObstetricPhantom(options), Some(phantom)) = (&mut station.scene, &row.phantom) {
        phantom.parameters.validate().with_context(|| format!("tuple {}", row.index)).input()?;
        *options = *phantom;
    }
    Ok(station)
}

/// Renders `count` tuples of the data set in `directory` again, spread over it, and compares them; 0 is all.
pub(super) fn verify(directory: &Path, backend: &BackendArgs, count: usize, json: bool) -> Result<(), Failure> {
    let data = Dataset::open(directory)?;
    let total = if count == 0 { data.rows.len() } else { count.min(data.rows.len()) };
    if total == 0 {
        return Err(Failure::Input(anyhow!("{} holds no tuple yet", directory.display())));
    }
    let backend = backend.open(BackendChoice::Auto)?;
    let mut renderer = TupleRenderer::new(&backend, data.header.classes.clone());
    let progress = Progress::new("verify", total);
    let mut differ = Vec::new();
    for (done, index) in insonify::statistics::evenly(total, data.rows.len()).enumerate() {
        progress.set(done, total);
        let row = &data.rows[index];
        if !renderer.agrees(directory, &data.header, row)? {
            differ.push(row.index);
        }
    }
    drop(progress);
    let verified = Verified { tuples: total, differ };
    if json {
        output::json(&verified)?;
    } else {
        output::line(format!("{} of {total} tuples are the same, bit for bit", total - verified.differ.len()))?;
    }
    match verified.differ.as_slice() {
        [] => Ok(()),
        differ => Err(Failure::Other(anyhow!(
            "{} of {total} tuples differ from the data set ({differ:?}): another device, driver or version made them, or a file changed",
            differ.len()
        ))),
    }
}
