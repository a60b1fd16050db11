//! Shared test bench: one device, small stations and scenes, and differences of frames.

use std::path::Path;
use std::sync::{LazyLock, Mutex};

use glam::{DVec3, Vec3};
use insonify::anatomy::analytic::{self, Part, cuboid};
use insonify::anatomy::{Mesh, Scene, Tissue, TissueTable};
use insonify::pose::Pose;
use insonify::render::{
    Backend, BackendChoice, Choice, Effect, EffectChoices, EffectPlan, Frame, ImageSettings, RenderSettings, Renderer,
};
pub(crate) use insonify::selftest::bench::silent;
use insonify::station::Station;
use insonify::transducer::{Probe, ProbeKind};

static BACKEND: LazyLock<Backend> =
    LazyLock::new(|| Backend::open(BackendChoice::from_environment().unwrap().unwrap_or_default()).unwrap());

/// A scene, a probe in it, and settings.
pub(crate) struct Case {
    pub(crate) scene: Scene,
    pub(crate) probe: Probe,
    pub(crate) settings: RenderSettings,
    pub(crate) pose: Pose,
}

/// Reads the station file `configs/NAME.toml`.
pub(crate) fn station(name: &str) -> Station {
    Station::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("configs/{name}.toml"))).unwrap()
}

impl Case {
    /// The station of `configs/NAME.toml`, reduced to few scanlines, samples and pixels, and at most 4 rays.
    pub(crate) fn station(name: &str) -> Self {
        let station = station(name);
        let scene = station.load_scene_from(station.scene_file().unwrap()).unwrap();
        let mut case = Self {
            scene,
            probe: station.probe,
            settings: station.settings,
            pose: station.default_pose.unwrap_or(Pose::IDENTITY),
        };
        (case.probe.scanlines, case.probe.samples) = (64, 1024.into());
        (case.settings.image.width, case.settings.image.height) = (240, 240);
        case.settings.quality.rays = case.settings.quality.rays.min(4);
        case
    }

    /// `parts` within the tissue `background`, below a linear probe 20 mm wide and 40 mm deep at 5 MHz.
    pub(crate) fn of(parts: Vec<Part>, tissues: &[(&str, Tissue)], background: &str) -> Self {
        let named = tissues.iter().map(|(name, tissue)| ((*name).to_owned(), tissue.clone()));
        let table = TissueTable::new(named).unwrap();
        let kind = ProbeKind::Linear { width_mm: 20.0 };
        let beam = Probe { focus_mm: 20.0, aperture_mm: 8.0, frequency_mhz: 5.0, ..Probe::default() };
        let probe = Probe { kind, depth_mm: 40.0, scanlines: 64, samples: 1024.into(), ..beam };
        let image =
            ImageSettings { width: 160, height: 320, tgc_db_per_cm: 0.0, gain_db: 20.0, ..ImageSettings::default() };
        let settings = RenderSettings { image, ..RenderSettings::default() };
        let scene = analytic::scene(parts, &table, background).unwrap();
        // No scanline is in a face of the scatterer lattice, where rounding decides the cell.
        let pose = Pose { position_mm: DVec3::new(0.0, 0.07, 0.0), ..Pose::IDENTITY };
        Self { scene, probe, settings, pose }
    }

    pub(crate) fn asking(mut self, rays: u32, layers: u32) -> Self {
        (self.settings.quality.rays, self.settings.quality.layers) = (rays, layers);
        self
    }

    pub(crate) fn with(mut self, effect: Effect, choice: Choice) -> Self {
        self.settings.effects = self.settings.effects.with(effect, choice);
        self
    }

    pub(crate) fn plan(&self) -> EffectPlan {
        EffectPlan::new(&self.scene, &self.probe, &self.settings)
    }

    /// Names of the active effects.
    pub(crate) fn on(&self) -> Vec<&'static str> {
        self.plan().effects().iter().map(Effect::name).collect()
    }

    /// A frame with the planned effects, and one with every effect.
    pub(crate) fn planned_and_whole(&self) -> (Frame, Frame) {
        let all = RenderSettings { effects: EffectChoices::ALL_ON, ..self.settings };
        (self.frame(&self.settings), self.frame(&all))
    }

    /// A frame with the planned effects, and one without `effect`.
    pub(crate) fn planned_and_without(&self, effect: Effect) -> (Frame, Frame) {
        let effects = self.settings.effects.with(effect, Choice::Off);
        (self.frame(&self.settings), self.frame(&RenderSettings { effects, ..self.settings }))
    }

    pub(crate) fn renderer(&self, settings: &RenderSettings) -> Renderer {
        Renderer::new(&BACKEND, &self.scene, &self.probe, settings).unwrap()
    }

    pub(crate) fn frame(&self, settings: &RenderSettings) -> Frame {
        // Software devices compile one renderer at a time as fast as several.
        static ONE: Mutex<()> = Mutex::new(());
        let _one = ONE.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let mut renderer = self.renderer(settings);
        assert_eq!(*renderer.plan(), EffectPlan::new(&self.scene, &self.probe, settings));
        let mut frame = Frame::default();
        renderer.set_time_s(0.3);
        renderer.render(&self.pose, &mut frame).unwrap();
        assert_eq!(frame.overflows, 0);
        frame
    }
}

/// [`silent`] tissue with speckle of the given deviation.
pub(crate) fn speckled(speed_m_s: f64, impedance_mrayl: f64, deviation: f64) -> Tissue {
    Tissue { scatterer_density: 0.9, scatterer_deviation: deviation, ..silent(speed_m_s, impedance_mrayl) }
}

pub(crate) fn part(name: &'static str, tissue: &'static str, mesh: Mesh) -> Part {
    Part { name, tissue, priority: 1, mesh }
}

/// A wide slab between two depths, which are not on faces of the scatterer lattice.
pub(crate) fn slab(from_mm: f32, to_mm: f32) -> Mesh {
    cuboid(Vec3::new(-50.05, -40.05, from_mm), Vec3::new(50.05, 40.05, to_mm))
}

/// Difference of two images inside the sector.
#[derive(Debug)]
pub(crate) struct Difference {
    /// Largest difference, grey levels.
    pub(crate) most: u8,
    /// Fraction of the pixels that differ by more than one grey level.
    pub(crate) part: f64,
    /// Mean grey level of the first image; `mean_off` is the second image's mean minus it.
    pub(crate) mean: f64,
    pub(crate) mean_off: f64,
}

pub(crate) fn difference(a: &Frame, b: &Frame) -> Difference {
    let inside: Vec<usize> = (0..a.mask.len()).filter(|&i| a.mask[i] == 255).collect();
    let off = |&i: &usize| a.bmode[i].abs_diff(b.bmode[i]);
    let count = inside.len() as f64;
    let mean = |frame: &Frame| inside.iter().map(|&i| f64::from(frame.bmode[i])).sum::<f64>() / count;
    Difference {
        most: inside.iter().map(off).max().unwrap(),
        part: inside.iter().filter(|i| off(i) > 1).count() as f64 / count,
        mean: mean(a),
        mean_off: mean(b) - mean(a),
    }
}
