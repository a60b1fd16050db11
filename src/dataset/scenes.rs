//! Scenes of the tuples, shared by parallel renderers (lanes).

use std::sync::Arc;

use super::DatasetError;
use super::stations::class_of;
use super::step::{Progress, Step};
use crate::anatomy::Scene;
use crate::anatomy::bvh::Bvh;
use crate::phantom;
use crate::render::{RenderError, TableMaker};
use crate::station::Station;

/// A station's scene, ready to be rendered.
#[derive(Debug)]
pub(crate) struct TupleScene {
    /// Station, with its tuples' phantom as scene.
    pub(super) station: Station,
    pub(super) scene: Scene,
    /// BVH of the scene at rest.
    pub(super) bvh: Arc<Bvh>,
    pub(super) tables: TableMaker,
    /// Class index of each tissue number in the frames.
    pub(super) class_of: Vec<u8>,
}

/// Loads scenes and keeps the last one, because tuples of one scene are consecutive.
pub(crate) struct Scenes<'a> {
    progress: &'a Progress<'a>,
    classes: Vec<String>,
    last: Option<Arc<TupleScene>>,
}

impl<'a> Scenes<'a> {
    /// Loader of scenes for a data set with these classes. `progress` receives the steps of building phantoms.
    pub(crate) fn new(classes: Vec<String>, progress: &'a Progress<'a>) -> Self {
        Self { progress, classes, last: None }
    }

    /// The scene of `station`. Meanwhile, renderers may still hold the previous scene.
    ///
    /// # Errors
    /// The scene can't be loaded, has no triangles, or has a tissue without a class.
    pub(crate) fn of(&mut self, station: &Station) -> Result<Arc<TupleScene>, DatasetError> {
        if let Some(last) = self.last.take_if(|last| last.station == *station) {
            return Ok(self.last.insert(last).clone());
        }
        self.last = None;
        let step = |p: phantom::Progress| (self.progress)(Step::Phantom { done: p.done, total: p.total });
        let scene = station.load_scene(&step)?;
        let class_of = class_of(&self.classes, scene.tissues.names())?;
        let bvh = Arc::new(Bvh::build(&scene).map_err(RenderError::from)?);
        let tables = TableMaker::new(&scene, &bvh);
        Ok(self.last.insert(Arc::new(TupleScene { station: station.clone(), scene, bvh, tables, class_of })).clone())
    }
}
