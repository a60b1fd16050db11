//! The bench: one device, made-up tissues, specimens side by side, and what is measured on a frame.

use std::sync::{Mutex, OnceLock};

use glam::{DQuat, DVec3, Vec3};
use insonify::anatomy::{Mesh, Scene, Surface, Tissue, TissueTable};
use insonify::pose::Pose;
use insonify::render::{Frame, Gpu, GpuOptions, ImageSettings, RenderSettings, Renderer};
use insonify::transducer::{Probe, ProbeKind};

/// The device that all tests share.
pub(crate) fn gpu() -> &'static Gpu {
    static GPU: OnceLock<Gpu> = OnceLock::new();
    GPU.get_or_init(|| Gpu::new(&GpuOptions::default()).unwrap())
}

/// A silent tissue without loss, of a speed and an impedance.
pub(crate) fn silent(speed_m_s: f64, impedance_mrayl: f64) -> Tissue {
    Tissue {
        speed_m_s,
        density_kg_m3: impedance_mrayl * 1e6 / speed_m_s,
        attenuation_db_cm_mhz: 0.0,
        attenuation_exponent: 1.0,
        scatterer_density: 0.0,
        scatterer_mean: 0.0,
        scatterer_deviation: 0.0,
        roughness: 0.0,
        thickness_mm: 0.0,
    }
}

/// Surfaces under construction; the first tissue is the background.
#[derive(Default)]
pub(crate) struct Bench {
    tissues: Vec<Tissue>,
    surfaces: Vec<Surface>,
}

impl Bench {
    /// A bench in `background`, which is tissue 0.
    pub(crate) fn new(background: Tissue) -> Self {
        Self { tissues: vec![background], surfaces: Vec::new() }
    }

    /// Adds a tissue and returns its index.
    pub(crate) fn tissue(&mut self, tissue: Tissue) -> usize {
        self.tissues.push(tissue);
        self.tissues.len() - 1
    }

    /// Adds a surface.
    pub(crate) fn add(&mut self, tissue: usize, priority: i32, mesh: Mesh) {
        assert!(mesh.unpaired_edges() == 0 && mesh.signed_volume_mm3() > 0.0);
        self.surfaces.push(Surface { name: String::new(), tissue, priority, mesh });
    }

    /// The scene. Tissue i keeps its index.
    pub(crate) fn scene(self) -> Scene {
        let named = self.tissues.into_iter().enumerate().map(|(i, t)| (format!("t{i:03}"), t));
        let mut scene = Scene {
            tissues: TissueTable::new(named).unwrap(),
            background: 0,
            surfaces: self.surfaces,
            motion: Default::default(),
        };
        scene.sort_by_priority();
        scene
    }
}

/// A probe with parallel lines `spacing_mm` apart.
pub(crate) fn linear(scanlines: u32, spacing_mm: f64, samples: u32, depth_mm: f64) -> Probe {
    let kind = ProbeKind::Linear { width_mm: spacing_mm * f64::from(scanlines) };
    Probe { kind, scanlines, samples, depth_mm, ..Probe::default() }
}

/// Settings that keep the lines, of a small image.
pub(crate) fn small(rays: u32, layers: u32) -> RenderSettings {
    let mut settings = RenderSettings { lines: true, ..RenderSettings::default() };
    settings.image = ImageSettings { width: 96, height: 64, ..ImageSettings::default() };
    (settings.quality.rays, settings.quality.layers) = (rays, layers);
    settings
}

/// The pose at a point, looking along +z with x to the side.
pub(crate) fn at(x: f64, y: f64, z: f64) -> Pose {
    Pose { position_mm: DVec3::new(x, y, z), orientation: DQuat::IDENTITY }
}

/// A renderer, and frames of it that are checked.
pub(crate) struct Rig {
    renderer: Renderer,
    /// Its probe.
    pub(crate) probe: Probe,
    settings: RenderSettings,
    tissues: usize,
}

impl Rig {
    /// Builds the renderer.
    pub(crate) fn new(scene: &Scene, probe: &Probe, settings: &RenderSettings) -> Self {
        // Software devices compile one renderer at a time as fast as several.
        static COMPILE: Mutex<()> = Mutex::new(());
        let _one = COMPILE.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let renderer = Renderer::new(gpu(), scene, probe, settings).unwrap();
        Self { renderer, probe: *probe, settings: *settings, tissues: scene.tissues.tissues().len() }
    }

    /// A frame, after the checks that every frame must pass.
    pub(crate) fn frame(&mut self, pose: &Pose) -> Frame {
        let mut frame = Frame::default();
        self.renderer.render(pose, &mut frame).unwrap();
        self.check(&frame);
        frame
    }

    /// The sector in the image.
    pub(crate) fn sector(&self) -> insonify::transducer::Sector {
        *self.renderer.sector()
    }

    /// Sizes, ranges, finiteness, and that nothing overflowed.
    fn check(&self, frame: &Frame) {
        let (width, height) = (self.settings.image.width, self.settings.image.height);
        let pixels = (width * height) as usize;
        assert_eq!((frame.width, frame.height, frame.overflows), (width, height, 0));
        assert_eq!((frame.bmode.len(), frame.segmentation.len()), (pixels, pixels));
        assert_eq!((frame.attenuation.len(), frame.mask.len()), (pixels, pixels));
        for i in 0..pixels {
            let (level, tissue, inside) = (frame.attenuation[i], usize::from(frame.segmentation[i]), frame.mask[i]);
            assert!((0.0..=1.0).contains(&level), "{level}");
            if inside == 255 {
                assert!((1..=self.tissues).contains(&tissue), "{tissue}");
            } else {
                assert_eq!((inside, frame.bmode[i], tissue, level), (0, 0, 0, 0.0));
            }
        }
        assert!((0.0..=1.0).contains(&frame.attenuation_p98), "{}", frame.attenuation_p98);
        let samples = if self.settings.lines { (self.probe.scanlines * self.probe.samples) as usize } else { 0 };
        assert_eq!(frame.lines.len(), samples);
        assert!(frame.lines.iter().flatten().all(|v| v.is_finite() && v.abs() < 1e3));
    }

    /// The samples of a scanline.
    pub(crate) fn line<'a>(&self, frame: &'a Frame, line: u32) -> &'a [[f32; 2]] {
        let samples = self.probe.samples as usize;
        &frame.lines[line as usize * samples..][..samples]
    }

    /// Echoes of a scanline stronger than `threshold`, by range.
    pub(crate) fn echoes(&self, frame: &Frame, line: u32, threshold: f64) -> Vec<Echo> {
        echoes(&self.probe, self.line(frame, line), threshold)
    }
}

/// Magnitude of a sample.
pub(crate) fn magnitude(sample: [f32; 2]) -> f64 {
    f64::from(sample[0]).hypot(f64::from(sample[1]))
}

/// A peak of the envelope.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Echo {
    /// Range of the sample that peaks, mm.
    pub(crate) peak_mm: f64,
    /// Envelope at the peak.
    pub(crate) amplitude: f64,
    /// Phase at the peak, turns.
    turns: f64,
    turns_per_mm: f64,
}

impl Echo {
    /// Range by the phase, mm, of an echo whose reflection has the sign of `sign`; the peak tells the period.
    pub(crate) fn range_mm(&self, sign: f64) -> f64 {
        let shift = if sign < 0.0 { 0.5 } else { 0.0 };
        // Phase is −turns_per_mm·z.
        let off = -(self.turns - shift) - self.turns_per_mm * self.peak_mm;
        self.peak_mm + (off - off.round()) / self.turns_per_mm
    }
}

/// Local maxima of the envelope above `threshold`.
pub(crate) fn echoes(probe: &Probe, line: &[[f32; 2]], threshold: f64) -> Vec<Echo> {
    let envelope: Vec<f64> = line.iter().map(|&s| magnitude(s)).collect();
    let peak = |i: usize| {
        let before = if i > 0 { envelope[i - 1] } else { 0.0 };
        let after = envelope.get(i + 1).copied().unwrap_or(0.0);
        envelope[i] > threshold && envelope[i] >= before && envelope[i] > after
    };
    (0..line.len())
        .filter(|&i| peak(i))
        .map(|i| Echo {
            peak_mm: (i as f64 + 0.5) * probe.sample_spacing_mm(),
            amplitude: envelope[i],
            turns: f64::from(line[i][1]).atan2(f64::from(line[i][0])) / std::f64::consts::TAU,
            turns_per_mm: probe.phase_turns_per_mm(),
        })
        .collect()
}

/// A box about (x, y = 0) from depth `top` to `bottom`.
pub(crate) fn slab(x: f64, half_width: f64, top: f64, bottom: f64) -> Mesh {
    let half = half_width as f32;
    let x = x as f32;
    insonify::anatomy::analytic::cuboid(
        Vec3::new(x - half, -half, top as f32),
        Vec3::new(x + half, half, bottom as f32),
    )
}

/// Asserts |got/want − 1| ≤ `part`.
#[track_caller]
pub(crate) fn assert_part(got: f64, want: f64, part: f64, what: &str) {
    assert!((got / want - 1.0).abs() <= part, "{what}: {got}, expected {want}: off by {:.3e}", got / want - 1.0);
}
