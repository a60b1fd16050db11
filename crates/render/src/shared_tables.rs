//! Tables that renderers share.

use std::sync::Arc;

use insonify_core::anatomy::{Bvh, Scene};
use insonify_core::settings::RenderSettings;
use insonify_core::transducer::Probe;

use super::configuration::{Configuration, Media};
use super::error::RenderError;
use super::tables::Tables;

/// Tables of a probe and settings.
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

/// Makes tables for the renderers of a scene, before they need them.
#[derive(Debug)]
pub struct TableMaker {
    media: Media,
}

impl TableMaker {
    /// Makes no table yet: only what a scene and its hierarchy say of their media.
    pub fn new(scene: &Scene, bvh: &Bvh) -> Self {
        Self { media: Media::new(scene, bvh) }
    }

    /// Tables of a probe and settings. What `known` ones hold already is taken over.
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
