//! Frames from poses: one interface for all backends, with up to two frames in flight.

mod frames;
mod many;

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;
use insonify_core::anatomy::scene::SURFACES_MAX;
use insonify_core::anatomy::{Bvh, Scene, Skin};
use insonify_core::needle::Needle;
use insonify_core::pose::Pose;
use insonify_core::settings::{Effect, RenderSettings, SettingsGroup as _};
use insonify_core::transducer::{Probe, Sector};

use super::angle_order::AngleOrder;
use super::backend::Backend;
use super::compounding::Compounding;
use super::compute_device::ComputeDevice;
use super::configuration::{Configuration, FrameInputs, Media};
use super::constants::TISSUES_MAX;
use super::error::RenderError;
use super::frame::{FRAMES_IN_FLIGHT, Frame};
use super::hooks::TestHooks;
use super::kept::Kept;
use super::maker::FrameMaker;
use super::plan::EffectPlan;
use super::shared_tables::SharedTables;
use super::tables::Tables;
use frames::InFlight;
pub use many::Job;

/// Renders frames of one scene.
#[derive(Debug)]
pub struct Renderer {
    bvh: Arc<Bvh>,
    media: Arc<Media>,
    active: Configuration,
    /// The configurations that are not active.
    kept: Kept<Configuration>,
    /// Skin that the face can touch, at rest; `None` until the effect `contact` is first simulated.
    skin: Option<Arc<Skin>>,
    maker: Box<dyn FrameMaker>,
    on_host: bool,
    compute_device: ComputeDevice,
    /// Whether the next frames have an image.
    image: bool,
    /// Time of the scene, s.
    time_s: f64,
    /// The needle of the next frames; `None` if there is none, or if its place is unknown.
    needle: Option<Needle>,
    /// Duration of the scene's motion since the last submission, ms.
    motion_ms: f64,
    /// Pictures of all steering angles; `None` without compounding.
    compounding: Option<Compounding>,
    /// Pictures of the configurations that are not active.
    kept_pictures: Kept<Option<Compounding>>,
    /// Order in which live frames take the steering angles.
    order: AngleOrder,
    /// Counts restarts of compounding: only pictures of the same count are averaged.
    generation: u64,
    in_flight: VecDeque<InFlight>,
    /// Renderers that make frames at the same time as this one, reused by later calls.
    beside: Vec<Self>,
}

impl Renderer {
    /// Builds the BVH, the tables and the passes, and renders a first frame to warm them up.
    ///
    /// # Errors
    /// A value outside its range, a scene without triangles, too little memory, or a device that fails or is too small.
    pub fn new(
        backend: &Backend,
        scene: &Scene,
        probe: &Probe,
        settings: &RenderSettings,
    ) -> Result<Self, RenderError> {
        Self::with_bvh(backend, scene, Bvh::build(scene)?, probe, settings)
    }

    /// As [`Renderer::new`], with a ready BVH, which renderers may share.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn with_bvh(
        backend: &Backend,
        scene: &Scene,
        bvh: impl Into<Arc<Bvh>>,
        probe: &Probe,
        settings: &RenderSettings,
    ) -> Result<Self, RenderError> {
        Self::build(backend, scene, bvh.into(), probe, settings, &TestHooks::default(), &[])
    }

    /// As [`Renderer::with_bvh`]; tables of `known` that fit are reused.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn with_tables(
        backend: &Backend,
        scene: &Scene,
        bvh: Arc<Bvh>,
        probe: &Probe,
        settings: &RenderSettings,
        known: &[SharedTables],
    ) -> Result<Self, RenderError> {
        Self::build(backend, scene, bvh, probe, settings, &TestHooks::default(), known)
    }

    /// As [`Renderer::with_bvh`], with passes that a test has changed. Changed shaders apply to a device, changed
    /// constants to the host.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    #[cfg(feature = "test-hooks")]
    pub fn with_hooks(
        backend: &Backend,
        scene: &Scene,
        bvh: impl Into<Arc<Bvh>>,
        probe: &Probe,
        settings: &RenderSettings,
        hooks: &TestHooks,
    ) -> Result<Self, RenderError> {
        Self::build(backend, scene, bvh.into(), probe, settings, hooks, &[])
    }

    fn build(
        backend: &Backend,
        scene: &Scene,
        bvh: Arc<Bvh>,
        probe: &Probe,
        settings: &RenderSettings,
        hooks: &TestHooks,
        known: &[SharedTables],
    ) -> Result<Self, RenderError> {
        // A value outside its range is reported before faults of the scene.
        probe.validate()?;
        settings.validate()?;
        check_scene(scene, &bvh)?;
        let media = Arc::new(Media::new(scene, &bvh));
        let known: Vec<Arc<Tables>> = known.iter().map(SharedTables::tables).collect();
        let active = Configuration::new(&media, probe, settings, None, &known)?;
        let inputs = FrameInputs { bvh: &bvh, media: &media, configuration: &active, angle: 0 };
        let mut maker = backend.maker(inputs, hooks)?;
        active.warn(None);
        maker.take_cold();
        let in_flight = VecDeque::with_capacity(FRAMES_IN_FLIGHT);
        let mut renderer = Self {
            bvh,
            media,
            active,
            kept: Kept::default(),
            skin: None,
            maker,
            on_host: backend.on_host(),
            compute_device: backend.compute_device(),
            image: true,
            time_s: 0.0,
            needle: None,
            motion_ms: 0.0,
            compounding: None,
            kept_pictures: Kept::default(),
            order: AngleOrder::default(),
            generation: 0,
            in_flight,
            beside: Vec::new(),
        };
        renderer.prepare_compounding();
        renderer.prepare_skin()?;
        // If tables were made ahead, nobody waits for the first frame, and the host compiles nothing.
        let warm: &[bool] = if renderer.on_host && !known.is_empty() { &[] } else { &[true, false] };
        renderer.warm_up(warm)?;
        Ok(renderer)
    }

    /// Changes the probe and settings. The scene and compiled passes are kept:
    ///
    /// - gain, dynamic range, TGC, seed, reflections and maps apply to the next frame and cost nothing, as long as the
    ///   plan has the same effects. A compounded picture then takes as many frames as it has angles to follow;
    /// - all other settings rebuild the tables, and the buffers whose sizes change. A new pass (kept lines) is compiled
    ///   and warmed up by an extra frame.
    ///
    /// Frames in flight stay as they were submitted and are received in their order, with their own size and maps.
    /// While old and new buffers are held, the memory of both is used.
    ///
    /// # Errors
    /// A value outside its range, or too little memory: the renderer is then unchanged. A device that fails in the
    /// warm-up.
    pub fn reconfigure(&mut self, probe: &Probe, settings: &RenderSettings) -> Result<(), RenderError> {
        self.reconfigure_with(probe, settings, &[])
    }

    /// As [`Renderer::reconfigure`]; tables of `known` that fit are reused.
    ///
    /// # Errors
    /// As [`Renderer::reconfigure`].
    pub fn reconfigure_with(
        &mut self,
        probe: &Probe,
        settings: &RenderSettings,
        known: &[SharedTables],
    ) -> Result<(), RenderError> {
        probe.validate()?;
        settings.validate()?;
        if self.active.has_tables_of(&self.media, probe, settings) {
            let (before, after) = (self.active.settings, *settings);
            self.active.set_uniforms(&self.media, settings);
            // After a change of gain, older angles are replaced one by one, so that moving a slider doesn't bring back
            // their speckle.
            let range_db = |settings: &RenderSettings| settings.image.dynamic_range_db;
            if (range_db(&before), before.quality.seed) != (range_db(&after), after.quality.seed) {
                self.restart_compounding();
            }
            return Ok(());
        }
        let kept = self.kept.others().map(|kept| kept.tables.clone());
        let known: Vec<Arc<Tables>> = kept.chain(known.iter().map(SharedTables::tables)).collect();
        let next = Configuration::new(&self.media, probe, settings, Some(&self.active), &known)?;
        self.maker.configure(FrameInputs { bvh: &self.bvh, media: &self.media, configuration: &next, angle: 0 })?;
        next.warn(Some(&self.active));
        let moved = self.active.effects.has(Effect::Motion);
        self.active = next;
        self.prepare_skin()?;
        self.prepare_compounding();
        self.rest(moved);
        // If frames are in flight, no warm-up frame fits, and the next frame compiles new passes.
        if self.maker.take_cold() && self.in_flight.is_empty() { self.warm_up(&[settings.maps]) } else { Ok(()) }
    }

    /// Makes configuration `number` the active one; 0 is the first. A new number starts with the probe and settings of
    /// the active configuration. [`Renderer::reconfigure`] and all other methods concern the active configuration. Each
    /// keeps its own tables and buffers, so switching costs nothing. All share the scene and its time.
    ///
    /// Frames in flight stay as they were submitted, but no longer join a compounded picture.
    ///
    /// # Errors
    /// Too little memory for a new configuration, or a device that fails; nothing has changed then.
    pub fn select(&mut self, number: usize) -> Result<(), RenderError> {
        if number == self.kept.active() {
            return Ok(());
        }
        let next = self.kept.get(number).unwrap_or(&self.active);
        let inputs = FrameInputs { bvh: &self.bvh, media: &self.media, configuration: next, angle: 0 };
        self.maker.select(number, inputs)?;
        let (is_new, moved) = (!self.kept.has(number), self.active.effects.has(Effect::Motion));
        let new = is_new.then(|| self.active.clone());
        self.kept.swap(number, &mut self.active, new);
        self.kept_pictures.swap(number, &mut self.compounding, is_new.then_some(None));
        if is_new {
            self.prepare_compounding();
        } else {
            self.restart_compounding();
        }
        self.rest(moved);
        Ok(())
    }

    /// Puts the scene back to rest if the active configuration has no motion. `moved`: whether the previous one had.
    fn rest(&mut self, moved: bool) {
        if moved && !self.active.effects.has(Effect::Motion) && self.bvh.moves() {
            self.move_to(0.0);
        }
    }

    /// Prepares the skin when the effect `contact` is first simulated.
    fn prepare_skin(&mut self) -> Result<(), RenderError> {
        if self.skin.is_some() || !self.active.effects.has(Effect::Contact) {
            return Ok(());
        }
        let touched = |surface: u32| self.media.touched.get(surface as usize).copied().unwrap_or(false);
        let triangles = self.bvh.triangles.iter().filter(|triangle| touched(triangle.surface));
        let skin = Skin::of_triangles(triangles.map(|triangle| self.bvh.corners_mm(triangle)))?;
        let all = self.bvh.triangles.iter().map(|triangle| self.bvh.corners_mm(triangle));
        self.skin = Some(Arc::new(skin.within(all)));
        Ok(())
    }

    /// Distance of the face's centre from the skin at rest, mm; `None` if contact was never simulated.
    pub fn skin_distance_mm(&self, pose: &Pose) -> Option<f64> {
        self.skin.as_ref().map(|skin| skin.distance_mm(pose.position_mm))
    }

    /// Allocates the pictures of the steering angles, if the active configuration compounds.
    fn prepare_compounding(&mut self) {
        let tables = &self.active.tables;
        let range_db = self.active.settings.image.dynamic_range_db;
        let several = tables.angles.len() > 1;
        let new =
            || Compounding::new(tables.sector, tables.mask.clone(), tables.covered(), tables.angles.len(), range_db);
        self.compounding = several.then(new);
        self.restart_compounding();
    }

    /// Starts a new compounded picture with the next frame, which renders the straight angle: it alone shows the whole
    /// sector.
    pub fn restart_compounding(&mut self) {
        self.generation += 1;
        let angles = self.active.tables.angles.len();
        self.order.restart(angles);
        if let Some(compounding) = &mut self.compounding {
            compounding.restart(self.active.settings.image.dynamic_range_db);
        }
    }

    /// Renders one frame for each entry of `with_maps`, which says whether the frame has maps. Drivers compile at the
    /// first dispatch, and memory is mapped at the first write; neither may delay a user's first frame.
    fn warm_up(&mut self, with_maps: &[bool]) -> Result<(), RenderError> {
        let (maps, image) = (self.active.settings.maps, std::mem::replace(&mut self.image, true));
        // The poses are away from the scene, where frames take the least time.
        let beside_mm = self.bvh.centre_mm + 2.0 * self.bvh.radius_mm * DVec3::Z;
        let away = Pose { position_mm: beside_mm, orientation: glam::DQuat::IDENTITY };
        let mut rendered = Ok(());
        for &with in with_maps {
            self.active.settings.maps = with;
            let mut warmed = || {
                self.submit(&away)?;
                self.receive(&mut Frame::default())
            };
            rendered = rendered.and_then(|()| warmed());
        }
        (self.active.settings.maps, self.image) = (maps, image);
        self.restart_compounding();
        rendered
    }

    /// Sets whether the next frames have segmentation and attenuation. It is [`Renderer::reconfigure`] with
    /// [`RenderSettings::maps`], but free, so it may be called for each frame.
    pub fn set_maps(&mut self, maps: bool) {
        if maps != self.active.settings.maps {
            self.active.settings.maps = maps;
            self.active.effects = self.media.plan(&self.active.probe, &self.active.settings);
        }
    }

    /// Sets whether the next frames have their B-mode image. Without it [`Frame::bmode`] is empty and its passes are
    /// skipped, for a generator that needs only maps. Frames without maps, and frames with lines, always have an image.
    /// The call is free; frames in flight stay as they were submitted.
    pub fn set_image(&mut self, image: bool) {
        self.image = image;
    }

    /// Moves the scene to `time_s`, for frames submitted from now on. A new renderer shows time 0, with everything at
    /// rest.
    ///
    /// Only corners and boxes that changed are updated; a scene that does not move costs nothing. Each scene time has
    /// its own receiver noise.
    pub fn set_time_s(&mut self, time_s: f64) {
        self.time_s = time_s;
        if self.bvh.moves() && self.active.effects.has(Effect::Motion) {
            let started = Instant::now();
            self.move_to(time_s);
            self.motion_ms += started.elapsed().as_secs_f64() * 1e3;
        }
    }

    /// Sets the place of the needle for frames submitted from now on; `None`: they show none. Without
    /// [`RenderSettings::needle`], or with a pointer, it has no effect.
    ///
    /// A compounded picture starts over when the needle appears or is lost.
    pub fn set_needle(&mut self, needle: Option<Needle>) {
        if self.active.needle.is_some() && self.needle.is_some() != needle.is_some() {
            self.restart_compounding();
        }
        self.needle = needle;
    }

    /// Moves the scene to `time_s`, even if the plan excludes motion.
    fn move_to(&mut self, time_s: f64) {
        // Renderers may share one tree until it moves; then each gets its own copy.
        self.maker.move_scene(Arc::make_mut(&mut self.bvh), time_s);
    }

    /// Active settings.
    pub fn settings(&self) -> &RenderSettings {
        &self.active.settings
    }

    /// Decision on each effect, with its reason.
    pub fn plan(&self) -> &EffectPlan {
        &self.active.effects
    }

    /// Active probe.
    pub fn probe(&self) -> &Probe {
        &self.active.probe
    }

    /// Whether the host renderer makes the frames, within [`Renderer::submit`].
    pub fn on_host(&self) -> bool {
        self.on_host
    }

    /// Device that renders the frames.
    pub fn compute_device(&self) -> ComputeDevice {
        self.compute_device
    }

    /// Number of frames that were submitted and not yet received.
    pub fn frames_in_flight(&self) -> usize {
        self.in_flight.len()
    }

    /// Position and size of the sector in the image.
    pub fn sector(&self) -> &Sector {
        &self.active.tables.sector
    }
}

/// Checks every index that passes use unchecked, and the numbers of surfaces and tissues.
fn check_scene(scene: &Scene, bvh: &Bvh) -> Result<(), RenderError> {
    let (surfaces, tissues) = (scene.surfaces.len(), scene.tissues.tissues().len());
    let fail = |what: String| Err(RenderError::Scene { what });
    if surfaces > SURFACES_MAX {
        return fail(format!("{surfaces} surfaces; at most {SURFACES_MAX} are traced"));
    }
    if tissues > TISSUES_MAX as usize {
        return fail(format!("{tissues} tissues; at most {TISSUES_MAX} are numbered"));
    }
    if let Some(index) = scene.surfaces.iter().map(|s| s.tissue).chain([scene.background]).find(|&i| i >= tissues) {
        return fail(format!("tissue {index} of a table of {tissues}"));
    }
    match bvh.triangles.iter().find(|t| t.surface as usize >= surfaces) {
        Some(triangle) => fail(format!("its BVH names surface {} of {surfaces}", triangle.surface)),
        None => Ok(()),
    }
}
