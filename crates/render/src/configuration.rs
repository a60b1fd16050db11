//! Tables and uniforms of a renderer for one probe and one set of settings, on any backend.

use std::sync::Arc;

use insonify_core::anatomy::tissue::NEEDLE;
use insonify_core::anatomy::{Bvh, Scene, Tissue};
use insonify_core::settings::Effect;
use insonify_core::settings::RenderSettings;
use insonify_core::settings::{Change, Samples, SettingsGroup as _};
use insonify_core::transducer::Probe;

use super::constants::{FIRST_TISSUE, MOVES};
use super::error::RenderError;
use super::kernels::ClippedKernel;
use super::needle::NeedleFrame;
use super::params::{Outside, Params};
use super::plan::{AIR, EffectPlan, SKIN, SceneFacts};
use super::tables::Tables;

/// Tissues and surfaces of a scene, in the form that the tables need.
#[derive(Debug)]
pub(super) struct Media {
    tissues: Vec<Tissue>,
    outside: Outside,
    /// Tissue index of each surface, combined with [`MOVES`] if the surface moves.
    pub(super) surface_words: Vec<u32>,
    /// For each surface, whether the probe can touch it: the skin, or all surfaces of a scene without skin.
    pub(super) touched: Vec<bool>,
    /// Number of the needle's tissue in the segmentation; 0 if the scene's table lacks it.
    needle: u32,
    /// Whether any triangle moves.
    pub(super) moving: bool,
    /// Scene properties that decide the effect plan.
    facts: SceneFacts,
}

impl Media {
    pub(super) fn new(scene: &Scene, bvh: &Bvh) -> Self {
        let skin = scene.tissues.index_of(SKIN);
        let has_skin = scene.surfaces.iter().any(|s| Some(s.tissue) == skin && !s.mesh.triangles.is_empty());
        let moves = |name: &str| if scene.motion.moves(name) { MOVES } else { 0 };
        Self {
            tissues: scene.tissues.tissues().to_vec(),
            outside: Outside {
                background: scene.background as u32,
                air: scene.tissues.index_of(AIR).unwrap_or(scene.background) as u32,
            },
            surface_words: scene.surfaces.iter().map(|s| s.tissue as u32 | moves(&s.name)).collect(),
            touched: scene.surfaces.iter().map(|s| !has_skin || Some(s.tissue) == skin).collect(),
            needle: scene.tissues.index_of(NEEDLE).map_or(0, |index| index as u32 + FIRST_TISSUE),
            moving: !bvh.displacements().is_empty(),
            facts: SceneFacts::new(scene),
        }
    }

    /// Effect plan of a probe and settings in this scene.
    pub(super) fn plan(&self, probe: &Probe, settings: &RenderSettings) -> EffectPlan {
        EffectPlan::of(&self.facts, probe, settings)
    }
}

/// Inputs of a frame's passes.
#[derive(Debug, Clone, Copy)]
pub(super) struct FrameInputs<'a> {
    pub(super) bvh: &'a Bvh,
    pub(super) media: &'a Media,
    pub(super) configuration: &'a Configuration,
    /// Index of the steering angle.
    pub(super) angle: usize,
}

/// Tables and uniforms for one probe and one set of settings.
#[derive(Debug, Clone)]
pub(super) struct Configuration {
    pub(super) probe: Probe,
    /// Settings as requested; the plan may reduce rays and layers for the frames.
    pub(super) settings: RenderSettings,
    /// Effects that frames simulate.
    pub(super) effects: EffectPlan,
    pub(super) params: Params,
    pub(super) tables: Arc<Tables>,
    /// The needle of the next frame; `None` without the effect `needle`.
    pub(super) needle: Option<NeedleFrame>,
}

impl Configuration {
    /// Checks probe and settings, and makes the tables. If only `settings.look` differs from `before`, all its other
    /// tables are reused. Otherwise, single tables of `before` and `known` that still fit are reused.
    ///
    /// # Errors
    /// A value outside its range.
    pub(super) fn new(
        media: &Media,
        probe: &Probe,
        settings: &RenderSettings,
        before: Option<&Self>,
        known: &[Arc<Tables>],
    ) -> Result<Self, RenderError> {
        probe.validate()?;
        settings.validate()?;
        settings.needle.iter().try_for_each(|needle| needle.validate())?;
        let effects = media.plan(probe, settings);
        let planned = effects.settings(settings);
        let sampled = probe.sampled(settings.coarse_samples);
        let with_its_look = |before: &&Self| RenderSettings { look: before.settings.look, ..*settings };
        let tables = match before.filter(|before| before.has_tables_of(media, probe, &with_its_look(before))) {
            Some(before) => Arc::new(before.tables.with_angles(&sampled, &planned)),
            None => {
                let known = before.map(|before| &before.tables).into_iter().chain(known);
                Tables::new((&media.tissues, media.needle), &sampled, &planned, effects.effects(), known)
            }
        };
        let params = Params::new(media.outside, &sampled, &planned, &tables, effects.effects());
        let needle = tables.needle.as_ref().map(|_| NeedleFrame::without_needle(probe));
        Ok(Self { probe: *probe, settings: *settings, effects, params, tables, needle })
    }

    /// Warns if no pixel lies in the sector, and of each clipped kernel that `previous` did not have.
    pub(super) fn warn(&self, previous: Option<&Self>) {
        if self.tables.sector_words.is_empty() {
            tracing::warn!(
                "the sector is thinner than a pixel and the image stays black: widen it (probe.width_mm, probe.fov_deg) or take more pixels (image.width, image.height)"
            );
        }
        let needed = self.probe.samples_needed();
        let most = self.probe.sample_count();
        let told = previous.is_some_and(|p| (p.probe.samples_needed(), p.probe.sample_count()) == (needed, most));
        if self.probe.samples == Samples::Auto && most < needed && !told {
            tracing::warn!(
                "the pulse needs {needed} samples per scanline and {} are made, so speckle is coarser than the pulse: lower probe.depth_mm, probe.frequency_mhz or probe.fractional_bandwidth",
                self.params.samples
            );
        }
        let known = |clipped: &ClippedKernel| previous.is_some_and(|p| p.tables.kernels.clipped.contains(clipped));
        for clipped in self.tables.kernels.clipped.iter().filter(|clipped| !known(clipped)) {
            tracing::warn!("{clipped}");
        }
    }

    /// Whether the present tables, buffers and passes serve `probe` and `settings`, too. Then every changed setting is
    /// a uniform or is chosen per frame, and the effect plan is the same except for maps.
    pub(super) fn has_tables_of(&self, media: &Media, probe: &Probe, settings: &RenderSettings) -> bool {
        if self.probe.change_to(probe).max(self.settings.change_to(settings)) > Change::Nothing {
            return false;
        }
        let apart_from_maps = |plan: &EffectPlan| plan.effects().without(Effect::Maps);
        apart_from_maps(&media.plan(probe, settings)) == apart_from_maps(&self.effects)
    }

    /// Applies settings for which [`Configuration::has_tables_of`] holds.
    pub(super) fn set_uniforms(&mut self, media: &Media, settings: &RenderSettings) {
        self.settings = *settings;
        self.effects = media.plan(&self.probe, settings);
        let planned = self.effects.settings(settings);
        let sampled = self.probe.sampled(settings.coarse_samples);
        self.params = Params::new(media.outside, &sampled, &planned, &self.tables, self.effects.effects());
    }
}
