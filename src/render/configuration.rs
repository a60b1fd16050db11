//! What a renderer has for one probe and one set of settings, beside device, scene and compiled passes.

use std::sync::Arc;

use super::device::buffers::{BatchPlan, Buffers, SceneBuffers};
use super::device::gpu::Gpu;
use super::device::passes::{Constants, Pass, Pipelines};
use super::device::readback::{Contents, Shape, Slot};
use super::host::{HostFrame, StagingRing, StagingSize};
use super::params::Params;
use super::plan::{Effect, EffectPlan, SceneFacts};
use super::renderer::{FRAMES_IN_FLIGHT, RenderError};
use super::tables::Tables;
use super::{ClippedKernel, RenderSettings};
use crate::anatomy::{Bvh, Scene, Tissue};
use crate::transducer::Probe;

/// Set in the word of a surface that moves, beside its tissue.
pub(super) const MOVES: u32 = 1 << 16;

/// What tables need of a scene.
#[derive(Debug)]
pub(super) struct Media {
    tissues: Vec<Tissue>,
    background: u32,
    /// Tissue of each surface, with [`MOVES`] where it moves.
    pub(super) surface_words: Vec<u32>,
    moving: bool,
    /// What the plan is decided by.
    facts: SceneFacts,
}

impl Media {
    pub(super) fn new(scene: &Scene, bvh: &Bvh) -> Self {
        Self {
            tissues: scene.tissues.tissues().to_vec(),
            background: scene.background as u32,
            surface_words: scene
                .surfaces
                .iter()
                .map(|s| s.tissue as u32 | if scene.motion.moves(&s.name) { MOVES } else { 0 })
                .collect(),
            moving: !bvh.displacements().is_empty(),
            facts: SceneFacts::new(scene),
        }
    }

    /// The plan of a probe and settings in this scene.
    pub(super) fn plan(&self, probe: &Probe, settings: &RenderSettings) -> EffectPlan {
        EffectPlan::of(&self.facts, probe, settings)
    }
}

/// Tables, buffers and passes of one probe and one set of settings.
#[derive(Debug)]
pub(super) struct Configuration {
    pub(super) probe: Probe,
    /// What was asked for; frames are made with what the plan leaves of it.
    pub(super) settings: RenderSettings,
    /// Which effects frames are made of.
    pub(super) effects: EffectPlan,
    pub(super) params: Params,
    pub(super) tables: Tables,
    pub(super) plan: BatchPlan,
    pub(super) buffers: Buffers,
    /// Where the host writes paths, if it follows them.
    pub(super) staging: Option<StagingRing>,
    /// Where the host makes frames, if it makes all of them; then there are no passes.
    pub(super) host_frame: Option<HostFrame>,
    pub(super) path_passes: Vec<Pass>,
    pub(super) image_passes: Vec<Pass>,
    /// The last of `image_passes` where no maps are wanted.
    image_alone: Option<Pass>,
    pub(super) slots: [Arc<Slot>; FRAMES_IN_FLIGHT],
}

impl Configuration {
    /// Makes all that differs from `previous`, and takes the rest from it. Nothing of `previous` changes before
    /// [`Configuration::fill`].
    ///
    /// # Errors
    /// A value outside its range, or more than the device has.
    pub(super) fn new(
        gpu: &Gpu,
        scene: (&SceneBuffers, &Media),
        pipelines: &mut Pipelines,
        probe: &Probe,
        settings: &RenderSettings,
        previous: Option<&Self>,
    ) -> Result<Self, RenderError> {
        probe.validate()?;
        settings.validate()?;
        let (scene, media) = scene;
        let effects = media.plan(probe, settings);
        let on = effects.effects();
        let planned = effects.settings(settings);
        let tables = Tables::new(&media.tissues, probe, &planned, on);
        let params = Params::new(media.background, probe, &planned, &tables, on);
        let plan = BatchPlan::new(probe.scanlines, planned.quality.rays, planned.quality.layers);
        let buffers = Buffers::new(gpu, &tables, &params, &plan, settings.lines, previous.map(|p| &p.buffers))?;

        let mut pass = |name, groups, constants: Constants<'_>| {
            Pass::new(gpu, pipelines, (scene, &buffers), name, groups, constants)
        };
        let paths = params.paths(plan.layers_per_batch);
        let samples_by = |run: u32| [params.row_samples.div_ceil(64 * run), params.scanlines, 1];
        let pixels = [params.sector_words.div_ceil(128), 1, 1];
        let flag = |on: bool| f64::from(u8::from(on));
        let keep = [("KEEP_LINES", flag(settings.lines))];
        let trace = [
            ("MOVING", flag(media.moving && on.has(Effect::Motion))),
            ("REFRACTION", flag(on.has(Effect::Refraction))),
            ("INTERFACE_ECHOES", flag(on.has(Effect::InterfaceEchoes))),
            ("ROUGHNESS", flag(on.has(Effect::Roughness))),
            ("REFLECTIONS", flag(on.has(Effect::Reflections))),
        ];
        let mut path_passes = Vec::new();
        let host_frame =
            if gpu.host_image { Some(HostFrame::new(gpu, &tables, &params, &plan, settings.lines)?) } else { None };
        let staging = if gpu.host_image {
            None
        } else if gpu.host_trace {
            Some(StagingRing::new(gpu, StagingSize { paths, hint_words: params.hint_words })?)
        } else {
            path_passes.push(pass("locate", [paths.div_ceil(64), 1, 1], &[])?);
            path_passes.push(pass("trace", [paths.div_ceil(64), 1, 1], &trace)?);
            None
        };
        if on.has(Effect::Scatterers) && !gpu.host_image {
            path_passes.push(pass("march", samples_by(8), &[])?);
        }
        if on.has(Effect::InterfaceEchoes) && !gpu.host_image {
            path_passes.push(pass("echo", [params.scanlines.div_ceil(16), 1, 1], &[])?);
        }
        let image_passes = if gpu.host_image {
            Vec::new()
        } else {
            vec![
                pass("lateral", [params.row_samples.div_ceil(256), params.scanlines.div_ceil(4), 1], &[])?,
                pass("detect", samples_by(8), &keep)?,
                pass("section", [params.map_rays.div_ceil(32), 1, 1], &[])?,
                pass("percentile", [1, 1, 1], &[])?,
                pass("scan_convert", pixels, &[("MAPS", 1.0)])?,
            ]
        };
        let image_alone = if gpu.host_image { None } else { Some(pass("scan_convert", pixels, &[("MAPS", 0.0)])?) };

        let of_paths = (0..plan.batches).flat_map(|_| &path_passes);
        let shape = Shape {
            width: params.width,
            height: params.height,
            row_words: params.row_words,
            lines: if settings.lines { params.scanlines } else { 0 },
            samples: params.samples,
            row_samples: params.row_samples,
            passes: of_paths.chain(&image_passes).map(|pass| pass.name).collect(),
        };
        let slots = match previous {
            Some(previous) if *previous.slots[0].shape() == shape => previous.slots.clone(),
            _ => [Arc::new(Slot::new(gpu, &shape)?), Arc::new(Slot::new(gpu, &shape)?)],
        };
        Ok(Self {
            probe: *probe,
            settings: *settings,
            effects,
            params,
            tables,
            plan,
            buffers,
            staging,
            host_frame,
            path_passes,
            image_passes,
            image_alone,
            slots,
        })
    }

    /// Brings the tables to the device. From now on `previous` can't be rendered with.
    pub(super) fn fill(&self, gpu: &Gpu, previous: Option<&Self>) {
        self.buffers.fill(gpu, &self.tables, previous.map(|p| &p.buffers));
        if self.tables.sector_words.is_empty() {
            tracing::warn!(
                "the sector is thinner than a pixel and the image stays black: widen it (probe.width_mm, probe.fov_deg) or take more pixels (image.width, image.height)"
            );
        }
        let known = |clipped: &ClippedKernel| previous.is_some_and(|p| p.tables.kernels.clipped.contains(clipped));
        for clipped in self.tables.kernels.clipped.iter().filter(|clipped| !known(clipped)) {
            tracing::warn!("{clipped}");
        }
    }

    /// Whether `probe` and `settings` need no other tables, buffers or passes: gain, dynamic range, TGC, seed,
    /// reflections and maps are uniforms, or chosen for each frame, as long as the plan stays.
    pub(super) fn has_tables_of(&self, media: &Media, probe: &Probe, settings: &RenderSettings) -> bool {
        let mut like_these = *settings;
        let (image, mine) = (&mut like_these.image, &self.settings.image);
        image.dynamic_range_db = mine.dynamic_range_db;
        image.gain_db = mine.gain_db;
        image.tgc_db_per_cm = mine.tgc_db_per_cm;
        image.tgc_sliders_db = mine.tgc_sliders_db;
        like_these.quality.seed = self.settings.quality.seed;
        like_these.reflections_max = self.settings.reflections_max;
        like_these.maps = self.settings.maps;
        if *probe != self.probe || like_these != self.settings {
            return false;
        }
        let apart_from_maps = |plan: &EffectPlan| plan.effects().without(Effect::Maps);
        apart_from_maps(&media.plan(probe, settings)) == apart_from_maps(&self.effects)
    }

    /// Takes settings of which [`Configuration::has_tables_of`] holds.
    pub(super) fn take(&mut self, media: &Media, settings: &RenderSettings) {
        self.settings = *settings;
        self.effects = media.plan(&self.probe, settings);
        let planned = self.effects.settings(settings);
        self.params = Params::new(media.background, &self.probe, &planned, &self.tables, self.effects.effects());
    }

    /// Clears what passes read and none writes: the samples, where nothing scatters.
    pub(super) fn clear_unwritten(&self, encoder: &mut wgpu::CommandEncoder) {
        if !self.effects.has(Effect::Scatterers) {
            encoder.clear_buffer(&self.buffers.baseband, 0, None);
        }
    }

    /// Passes after those of the paths, in their order.
    pub(super) fn image_passes(&self, contents: Contents) -> impl Iterator<Item = &Pass> {
        let taken = self.image_passes.iter().filter(move |pass| contents.takes(pass.name));
        taken.map(move |pass| match &self.image_alone {
            Some(alone) if !contents.maps && pass.name == alone.name => alone,
            _ => pass,
        })
    }

    /// Says what reads the paths that the host wrote last.
    pub(super) fn submitted(&mut self, submission: &wgpu::SubmissionIndex) {
        if let Some(ring) = &mut self.staging {
            ring.submitted(submission);
        }
    }
}
