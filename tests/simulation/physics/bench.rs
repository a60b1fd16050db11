//! Test bench of the physics tests: one backend, the specimens of the self-test, and checks of every frame.

use std::sync::{Mutex, OnceLock};

use glam::DVec2;
use insonify::anatomy::{Mesh, Scene};
use insonify::pose::Pose;
use insonify::render::{Backend, BackendChoice, Frame, RenderSettings, Renderer};
use insonify::selftest::bench;
use insonify::selftest::measure::{self, Echo};
use insonify::transducer::Probe;

pub(crate) use insonify::selftest::bench::{Bench, at, facing, grainy, linear, post, silent, small};
pub(crate) use insonify::selftest::measure::{half_width, magnitude, mean_square};

/// The backend that all tests share, chosen by `INSONIFY_BACKEND`.
pub(crate) fn backend() -> &'static Backend {
    static BACKEND: OnceLock<Backend> = OnceLock::new();
    BACKEND.get_or_init(|| Backend::open(BackendChoice::from_environment().unwrap().unwrap_or_default()).unwrap())
}

/// A box about (`x`, y = 0) from depth `top` to depth `bottom`, mm.
pub(crate) fn slab(x: f64, half_width: f64, top: f64, bottom: f64) -> Mesh {
    bench::slab(DVec2::new(x, 0.0), half_width, top, bottom)
}

/// A renderer that checks all its frames.
pub(crate) struct Rig {
    renderer: Renderer,
    /// Probe of the renderer.
    pub(crate) probe: Probe,
    settings: RenderSettings,
    tissues: usize,
}

impl Rig {
    /// Builds the renderer.
    pub(crate) fn new(scene: &Scene, probe: &Probe, settings: &RenderSettings) -> Self {
        // Software devices compile one renderer at a time as fast as several.
        static COMPILE: Mutex<()> = Mutex::new(());
        let sound = |mesh: &Mesh| mesh.unpaired_edges() == 0 && mesh.signed_volume_mm3() > 0.0;
        assert!(scene.surfaces.iter().all(|s| sound(&s.mesh)));
        let _one = COMPILE.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let renderer = Renderer::new(backend(), scene, probe, settings).unwrap();
        Self { renderer, probe: *probe, settings: *settings, tissues: scene.tissues.tissues().len() }
    }

    /// Renders a frame and checks it.
    pub(crate) fn frame(&mut self, pose: &Pose) -> Frame {
        let mut frame = Frame::default();
        self.renderer.render(pose, &mut frame).unwrap();
        self.check(&frame);
        frame
    }

    /// Renders one angle of a compounded picture, without maps.
    pub(crate) fn angle(&mut self, pose: &Pose, angle: usize) -> Frame {
        let snapshot = self.renderer.snapshot_of_angle(pose, angle).unwrap();
        let (width, height) = (self.settings.image.width, self.settings.image.height);
        Frame { width, height, bmode: snapshot.bmode, ..Frame::default() }
    }

    /// Renders `frames` frames at one pose, as a live session does; returns the last.
    pub(crate) fn rolling(&mut self, pose: &Pose, frames: u32) -> Frame {
        let mut frame = Frame::default();
        for _ in 0..frames {
            self.renderer.submit(pose).unwrap();
            self.renderer.receive(&mut frame).unwrap();
        }
        frame
    }

    /// Moves the scene to a time.
    pub(crate) fn set_time_s(&mut self, time_s: f64) {
        self.renderer.set_time_s(time_s);
    }

    /// Sector of the image.
    pub(crate) fn sector(&self) -> insonify::transducer::Sector {
        *self.renderer.sector()
    }

    /// Checks sizes, ranges, finiteness, and that nothing overflowed.
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
        let samples = if self.settings.lines { (self.probe.scanlines * self.probe.sample_count()) as usize } else { 0 };
        assert_eq!(frame.lines.len(), samples);
        assert!(frame.lines.iter().flatten().all(|v| v.is_finite() && v.abs() < 1e3));
    }

    /// Samples of a scanline.
    pub(crate) fn line<'a>(&self, frame: &'a Frame, line: u32) -> &'a [[f32; 2]] {
        measure::line(&self.probe, frame, line)
    }

    /// Echoes of a scanline with amplitudes above `threshold`, in order of range.
    pub(crate) fn echoes(&self, frame: &Frame, line: u32, threshold: f64) -> Vec<Echo> {
        measure::echoes(&self.probe, self.line(frame, line), threshold)
    }
}

/// Asserts that `got` deviates from `want` by at most the fraction `part`.
#[track_caller]
pub(crate) fn assert_part(got: f64, want: f64, part: f64, what: &str) {
    assert!((got / want - 1.0).abs() <= part, "{what}: {got}, expected {want}: off by {:.3e}", got / want - 1.0);
}
