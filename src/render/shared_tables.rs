//! Tables that renderers share.

use std::sync::Arc;

use super::configuration::{Configuration, Media};
use super::error::RenderError;
use super::tables::Tables;
use crate::anatomy::{Bvh, Scene};
use crate::settings::RenderSettings;
use crate::transducer::Probe;

/// Tables of a probe and settings.
#[derive(Debug, Clone)]
pub(crate) struct SharedTables(Arc<Tables>);

impl SharedTables {
    pub(super) fn of(tables: &Arc<Tables>) -> Self {
        Self(tables.clone())
    }

    pub(super) fn tables(&self) -> Arc<Tables> {
        self.0.clone()
    }
}

/// Makes tables for the renderers of a scene, before they need them.
#[derive(Debug)]
pub(crate) struct TableMaker {
    media: Media,
}

impl TableMaker {
    pub(crate) fn new(scene: &Scene, bvh: &Bvh) -> Self {
        Self { media: Media::new(scene, bvh) }
    }

    /// Tables of a probe and settings. What `known` ones hold already is taken over.
    ///
    /// # Errors
    /// A value outside its range.
    pub(crate) fn make(
        &self,
        probe: &Probe,
        settings: &RenderSettings,
        known: &[SharedTables],
    ) -> Result<SharedTables, RenderError> {
        let known: Vec<Arc<Tables>> = known.iter().map(SharedTables::tables).collect();
        Ok(SharedTables(Configuration::new(&self.media, probe, settings, None, &known)?.tables))
    }
}
