//! Rendering of the QA phantom's images.

use glam::DVec3;
use thiserror::Error;

use super::{QaMeasurements, measure, suits};
use crate::anatomy::Scene;
use crate::anatomy::specimens::qa;
use crate::pose::Pose;
use crate::quality::levels::Levels;
use crate::render::{Backend, RenderError, RenderSettings, Renderer};
use crate::settings::{ImageSettings, ProbeKind};
use crate::transducer::{Probe, Sector};

/// Length of the range along the targets over which images are spread, mm.
const ALONG_MM: f64 = 40.0;

/// Reason why the QA phantom can't be measured.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum QaError {
    /// The probe or the image does not suit the phantom.
    #[error(
        "the QA phantom is measured by a linear probe at least 58 mm wide, to a depth of 60 mm or more, on pixels of at most 0.25 mm; here: kind {kind:?}, depth_mm {depth_mm}, pixels of {pixel_mm:.2} mm. configs/qa_phantom.toml has a probe that suits"
    )]
    Probe {
        /// Kind of the probe.
        kind: ProbeKind,
        /// Image depth, mm.
        depth_mm: f64,
        /// Side of a pixel, mm.
        pixel_mm: f64,
    },
    /// The scene is not the QA phantom.
    #[error(
        "the scene isn't the QA phantom (it lacks the surface \"wires\" or the \"target\" surfaces); use assets/scenes/qa_phantom.glb"
    )]
    Scene,
}

/// Checks that the probe and its image suit the phantom.
///
/// # Errors
/// [`QaError::Probe`] if it does not suit.
pub fn check_probe(probe: &Probe, image: &ImageSettings) -> Result<(), QaError> {
    let sector = Sector::fit(probe, image.width, image.height);
    let (kind, depth_mm, pixel_mm) = (probe.kind, probe.depth_mm, sector.pixel_mm);
    if suits(probe, &sector) { Ok(()) } else { Err(QaError::Probe { kind, depth_mm, pixel_mm }) }
}

/// Checks that the scene is the phantom, by the names of its surfaces.
///
/// # Errors
/// [`QaError::Scene`] if it is another scene.
pub fn check_scene(scene: &Scene) -> Result<(), QaError> {
    let wires = scene.surfaces.iter().any(|s| s.name == "wires");
    let targets = scene.surfaces.iter().filter(|s| s.name.starts_with("target ")).count();
    if wires && targets == qa::CONTRAST.len() { Ok(()) } else { Err(QaError::Scene) }
}

/// Renders `images` images of the phantom, evenly spaced along the targets from −20 mm to 20 mm, and measures their
/// mean levels. Also returns the first image [height × width]. `progress` receives the number of finished images.
///
/// # Errors
/// An image that can't be rendered.
pub fn image_and_measure(
    backend: &Backend,
    scene: &Scene,
    probe: &Probe,
    settings: &RenderSettings,
    images: u16,
    progress: &dyn Fn(usize),
) -> Result<(QaMeasurements, Vec<u8>), RenderError> {
    let settings = RenderSettings { maps: false, ..*settings };
    let mut renderer = Renderer::new(backend, scene, probe, &settings)?;
    let mut levels = Levels::new(*renderer.sector(), settings.image.dynamic_range_db);
    let mut first = Vec::new();
    let last = f64::from(images.max(2) - 1);
    let start_mm = if images == 1 { 0.0 } else { -0.5 * ALONG_MM };
    let pose = |i| Pose { position_mm: DVec3::Y * (start_mm + ALONG_MM * f64::from(i) / last), ..Pose::IDENTITY };
    let poses: Vec<Pose> = (0..images).map(pose).collect();
    renderer.render_each(
        &poses,
        |_| (0.0, None),
        |index, frame| {
            if index == 0 {
                first.clone_from(&frame.bmode);
            }
            levels.add(&frame.bmode);
            progress(index + 1);
            Ok::<(), RenderError>(())
        },
    )?;
    Ok((measure(&levels, probe), first))
}
