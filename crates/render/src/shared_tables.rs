//! Tables that several renderers share.

use std::sync::Arc;

use insonify_core::anatomy::{Bvh, Scene};
use insonify_core::settings::RenderSettings;
use insonify_core::transducer::Probe;

use super::configuration::{Configuration, Media};
use super::error::RenderError;
use super::tables::Tables;

/// Tables for one probe and one set of settings. Cloning shares them.
#[derive(Debug, Clone)]
pub struct SharedTables(Arc<Tables>);

impl SharedTables {
    pub(super) fn of(tables: &Arc<Tables>) -> Self {
        Self(tables.clone())
    }

    pub(super) fn tables(&self) -> Arc<Tables> {
        self.0.clone()
    }
}

/// Makes tables for renderers of a scene ahead of time.
#[derive(Debug)]
pub struct TableMaker {
    media: Media,
}

impl TableMaker {
    /// Reads the media of a scene; makes no table yet.
    pub fn new(scene: &Scene, bvh: &Bvh) -> Self {
        Self { media: Media::new(scene, bvh) }
    }

    /// Makes the tables for a probe and settings; tables of `known` that fit are reused.
    ///
    /// # Errors
    /// A value outside its range.
    pub fn make(
        &self,
        probe: &Probe,
        settings: &RenderSettings,
        known: &[SharedTables],
    ) -> Result<SharedTables, RenderError> {
        let known: Vec<Arc<Tables>> = known.iter().map(SharedTables::tables).collect();
        Ok(SharedTables(Configuration::new(&self.media, probe, settings, None, &known)?.tables))
    }
}
