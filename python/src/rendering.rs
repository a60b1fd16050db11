//! Renderers of stations.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};
use std::time::{Duration, Instant};

use insonify::chooser::{StillFrame, StillJob, render_still_with, render_stills_with};
use insonify::measuring::PlanTable;
use insonify::render::{Backend, BackendChoice, EffectPlan, FrameQuality, RenderSettings, Renderer};
use insonify::transducer::Probe;

use crate::described::Described;
use crate::errors::{Failure, Kind};
use crate::frame::FrameRequest;
use crate::scene::{Loaded, SceneKey};
use crate::work::on_pool;

/// Longest wait of a forked process for a lock that a thread of its parent may hold.
const FORK_LOCK_TIMEOUT: Duration = Duration::from_secs(20);

/// A renderer with its scene, reused from frame to frame.
pub(crate) struct Rendering {
    loaded: Arc<Loaded>,
    choice: BackendChoice,
    pub(crate) backend: Backend,
    renderer: Renderer,
    /// Identifier of the process that made this renderer.
    process: u32,
    /// Probe and settings whose warnings were logged last; `None` before the first warning.
    warned: Option<(Probe, RenderSettings)>,
}

/// Slot for a renderer, shared by threads.
pub(crate) type Slot = Mutex<Option<Rendering>>;

/// Open backends, one for each process and choice.
static OPEN: Mutex<Vec<(u32, BackendChoice, Backend)>> = Mutex::new(Vec::new());

fn after_fork() -> Failure {
    let text = "a graphics device can't be used after a fork; start processes by `spawn`, or render on the host";
    Failure::new(Kind::Backend, text)
}

/// Opens a backend, or returns the one that this process already has.
fn open(choice: BackendChoice) -> Result<Backend, Failure> {
    let process = std::process::id();
    let mut open = OPEN.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, _, backend)) = open.iter().find(|(by, known, _)| (*by, *known) == (process, choice)) {
        return Ok(backend.clone());
    }
    if choice != BackendChoice::Host && open.iter().any(|(by, _, backend)| *by != process && !backend.on_host()) {
        return Err(after_fork());
    }
    let backend = Backend::open(choice)?;
    open.push((process, choice, backend.clone()));
    Ok(backend)
}

impl Rendering {
    /// Locks a slot. In a forked process, the lock may be held by a thread of the parent, which never releases it
    /// here.
    pub(crate) fn lock(slot: &Slot) -> Result<MutexGuard<'_, Option<Self>>, Failure> {
        if !crate::process::is_forked() {
            return Ok(slot.lock().unwrap_or_else(PoisonError::into_inner));
        }
        let started = Instant::now();
        loop {
            match slot.try_lock() {
                Ok(guard) => return Ok(guard),
                Err(TryLockError::Poisoned(poisoned)) => return Ok(poisoned.into_inner()),
                Err(TryLockError::WouldBlock) if started.elapsed() < FORK_LOCK_TIMEOUT => {
                    std::thread::sleep(Duration::from_millis(1));
                }
                Err(TryLockError::WouldBlock) => {
                    let text = "the station was rendering when this process was forked; make a new one here, or start processes by `spawn`";
                    return Err(Failure::new(Kind::Render, text));
                }
            }
        }
    }

    /// Runs `work` with a renderer of the described scene. The renderer is made if it is missing.
    pub(crate) fn with<T: Send>(
        slot: &Slot,
        described: &Described,
        settings: &RenderSettings,
        work: impl FnOnce(&mut Self) -> Result<T, Failure> + Send,
    ) -> Result<T, Failure> {
        let choice = match described.backend {
            Some(choice) => choice,
            None => BackendChoice::from_environment()?.unwrap_or(described.station.backend),
        };
        let key = SceneKey::of(&described.station, described.arrays.clone());
        let mut guard = Self::lock(slot)?;
        let mut kept = guard.take();
        if let Some(lost) = kept.take_if(|kept| kept.process != std::process::id() && !kept.backend.on_host()) {
            // The threads of its driver don't exist in this process, so closing it would wait forever.
            std::mem::forget(lost);
            return Err(after_fork());
        }
        let rendering = match kept.filter(|kept| kept.choice == choice && kept.loaded.key.same_scene(&key)) {
            Some(kept) => kept,
            None => Self::new(key.load()?, choice, &described.station.probe, settings)?,
        };
        let rendering = guard.insert(rendering);
        let done = on_pool(|| work(rendering));
        if let Err(failure) = &done
            && matches!(failure.kind(), Kind::Internal | Kind::Backend)
        {
            // A renderer that failed half-way, or whose device is lost, is not used again.
            *guard = None;
            let mine = std::process::id();
            OPEN.lock()
                .unwrap_or_else(PoisonError::into_inner)
                .retain(|(by, known, _)| (*by, *known) != (mine, choice));
        }
        done
    }

    fn new(
        loaded: Arc<Loaded>,
        choice: BackendChoice,
        probe: &Probe,
        settings: &RenderSettings,
    ) -> Result<Self, Failure> {
        let backend = open(choice)?;
        let renderer =
            on_pool(|| Ok(Renderer::with_bvh(&backend, &loaded.scene, loaded.bvh.clone(), probe, settings)?))?;
        Ok(Self { loaded, choice, backend, renderer, process: std::process::id(), warned: None })
    }

    /// Renders a frame as `insonify render` does. If a budget chooses a quality, it is stored in `chosen`. A quality
    /// that is already in `chosen` is used instead.
    pub(crate) fn still(
        slot: &Slot,
        described: &Described,
        request: &FrameRequest,
        chosen: &mut Option<FrameQuality>,
    ) -> Result<StillFrame, Failure> {
        let mut settings = request.settings(described);
        let mut budget_ms = described.station.frame_budget_ms.filter(|_| request.quality.is_none());
        if let Some(quality) = chosen.filter(|_| budget_ms.is_some()) {
            settings.quality = quality.with_seed(settings.quality.seed);
            budget_ms = None;
        }
        let still = Self::with(slot, described, &settings, |rendering| {
            rendering.warn(&described.station.probe, &settings);
            let Self { renderer, backend, .. } = rendering;
            let at = request.at(&described.station);
            Ok(render_still_with(renderer, backend, &described.station, settings, at, budget_ms)?)
        })?;
        if let Some(found) = &still.chosen {
            *chosen = Some(found.quality);
        }
        Ok(still)
    }

    /// Number of frames that are rendered in parallel.
    pub(crate) fn at_once() -> usize {
        on_pool(|| Ok(rayon::current_num_threads())).unwrap_or(1)
    }

    /// Renders frames as [`Rendering::still`] does, several in parallel. `each` receives them in order.
    pub(crate) fn stills(
        slot: &Slot,
        described: &Described,
        requests: &[FrameRequest],
        chosen: Option<FrameQuality>,
        mut each: impl FnMut(StillFrame) -> Result<(), Failure> + Send,
    ) -> Result<(), Failure> {
        let job = |request: &FrameRequest| {
            let mut settings = request.settings(described);
            if let Some(quality) = chosen.filter(|_| request.quality.is_none()) {
                settings.quality = quality.with_seed(settings.quality.seed);
            }
            StillJob { settings, at: request.at(&described.station) }
        };
        let jobs: Vec<StillJob> = requests.iter().map(job).collect();
        let Some(first) = jobs.first() else { return Ok(()) };
        Self::with(slot, described, &first.settings, |rendering| {
            jobs.iter().for_each(|job| rendering.warn(&described.station.probe, &job.settings));
            let Self { renderer, backend, .. } = rendering;
            render_stills_with(renderer, backend, &described.station, &jobs, |_, still| each(still))
        })
    }

    /// Logs the warnings and notices of the effect plan, once for each kind of frame.
    fn warn(&mut self, probe: &Probe, settings: &RenderSettings) {
        let mut seedless = *settings;
        seedless.quality.seed = 0;
        if self.warned == Some((*probe, seedless)) {
            return;
        }
        self.warned = Some((*probe, seedless));
        let plan = EffectPlan::new(&self.loaded.scene, probe, settings);
        plan.warnings().for_each(|warning| tracing::warn!("{warning}"));
        plan.notices().for_each(|notice| tracing::info!("{notice}"));
    }
}

/// Decisions of the effect plan, as JSON and as a text table.
pub(crate) fn plan(described: &Described, quality: Option<FrameQuality>) -> Result<(String, String), Failure> {
    let station = &described.station;
    let mut settings = station.settings;
    if let Some(quality) = quality {
        settings.quality = quality.with_seed(settings.quality.seed);
    }
    let loaded = SceneKey::of(station, described.arrays.clone()).load()?;
    let plan = on_pool(|| Ok(EffectPlan::new(&loaded.scene, &station.probe, &settings)))?;
    let json = serde_json::to_string(plan.decisions()).map_err(|error| Failure::of(Kind::Internal, &error))?;
    Ok((json, PlanTable { plan: &plan, measured: None }.to_string()))
}
