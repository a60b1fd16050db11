//! The tracked needle in a frame: echoes of its shaft and bevel, its shadow, and its outline in the segmentation.
//!
//! Everything is analytic, for each scanline, from the needle's place relative to it. No path is spent on the needle.
//! [`NeedleFrame`] is computed once a frame, in f64. Three passes apply it: `needle_shadow` multiplies the transmission
//! of the scan plane, `needle_echo` adds echoes to the focused lines, `needle_map` draws the outline.
//!
//! | file | holds |
//! |---|---|
//! | `slice.rs` | beam across the slice: a needle beside the image plane is fainter |
//! | `beam.rs` | beam along the face: a tilted needle is fainter |
//! | `scanline.rs` | coordinates of a scanline |
//! | `shaft.rs` | mirror echo of the shaft with its reverberation, and its diffuse echo |
//! | `bevel.rs` | echo of the bevel's facet |
//! | `shadow.rs` | share of the slice that the shaft covers |
//! | `outline.rs` | cross-section of the shaft with the image plane |

mod beam;
mod bevel;
mod outline;
mod scanline;
mod shadow;
mod shaft;
mod slice;
#[cfg(test)]
mod tests;

use glam::DVec3;
use insonify_core::acoustics::wavelength_mm;
use insonify_core::needle::Needle;
use insonify_core::pose::Pose;
use insonify_core::settings::{NeedleKind, NeedleSettings};
use insonify_core::transducer::Probe;
use rayon::prelude::*;

pub(crate) use outline::Outline;
pub(crate) use shadow::Shadow;

use crate::aperture::ApertureTables;
use beam::ScanlineBeam;
use scanline::Scanline;
use slice::Slice;

/// Pressure reflection of steel in soft tissue: 45.7 and 1.63 MRayl.
const REFLECTION: f64 = 0.93;
/// Amplitude that a plain shaft scatters to all sides, over its mirror echo: −25 dB (assumed).
const DIFFUSE_PLAIN: f64 = 0.056_2;
/// Amplitude that an etched shaft scatters to all sides, over its mirror echo: −10 dB (assumed).
const DIFFUSE_ETCHED: f64 = 0.316;
/// Most echoes of a frame.
pub(crate) const NEEDLE_ECHOES_MAX: usize = 1 << 17;
/// Largest distance of two points of the diffuse echo, mm.
const POINTS_MM: f64 = 0.25;
/// Number of cells of the scan plane whose shadows one thread computes together.
const SHADOW_CELLS: usize = 64;
/// Distance of two points of the diffuse echo over the standard deviation of the pulse.
const POINTS_PER_SIGMA: f64 = 2.5;

/// One echo of the needle on a scanline.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(crate) struct NeedleEcho {
    /// Depth at which the sound meets the needle, mm along the scanline.
    pub(crate) depth_mm: f32,
    /// Length that reverberation adds to the range, mm. A value below 0 is minus the number of round trips between the
    /// face and the needle: range and loss then count as often.
    pub(crate) extra_mm: f32,
    /// Amplitude over a perfect plate's echo.
    pub(crate) amplitude: f32,
    /// Phase in addition to the range's, turns.
    pub(crate) turns: f32,
}

/// Tables of the needle for one probe, which don't change with its place.
#[derive(Debug, Clone)]
pub(crate) struct NeedleTables {
    settings: NeedleSettings,
    slice: Slice,
    beam: ScanlineBeam,
    /// Echo of a line over a plate's, mm: √(aλ/2) times the reflection, for the radius a. It is the high-frequency echo
    /// of a cylinder over that of as many lines as make a plate.
    strength_mm: f64,
    /// Amplitude of the diffuse echo over the mirror's.
    diffuse: f64,
    /// Distance of two points of the diffuse echo along the shaft, mm.
    points_mm: f64,
    /// Number of the needle's tissue in the segmentation; 0 if the scene's table lacks it.
    tissue: u32,
}

impl NeedleTables {
    /// Tables of a needle and a probe. `tissue` is the needle's number in the segmentation.
    pub(crate) fn new(settings: NeedleSettings, probe: &Probe, tissue: u32) -> Self {
        Self {
            settings,
            slice: Slice::new(probe),
            beam: ScanlineBeam::new(probe),
            strength_mm: REFLECTION * (0.5 * settings.radius_mm() * wavelength_mm(probe.returning_mhz())).sqrt(),
            diffuse: if settings.kind == NeedleKind::Etched { DIFFUSE_ETCHED } else { DIFFUSE_PLAIN },
            points_mm: POINTS_MM.min(POINTS_PER_SIGMA * probe.axial_sigma_mm()),
            tissue,
        }
    }

    /// Standard deviations of the beam at a depth along the face and across the slice, mm.
    fn sigmas_mm(&self, depth_mm: f64) -> [f64; 2] {
        [self.beam.sigma_mm(depth_mm), self.slice.sigma_mm(depth_mm).max(1e-3)]
    }
}

/// The needle in the probe's frame.
#[derive(Debug, Clone, Copy)]
struct Placed {
    /// Point of the shaft's axis nearest to the tip, mm. The tip of a bevel lies on the outer surface of the shaft.
    axis_mm: DVec3,
    /// Unit vector from the hub to the tip.
    direction: DVec3,
    /// Unit vector to the side that the bevel faces; `None` if it is unknown.
    bevel: Option<DVec3>,
}

impl Placed {
    fn new(settings: &NeedleSettings, scene_from_probe: &Pose, needle: &Needle) -> Self {
        let probe_from_needle = scene_from_probe.inverse() * needle.scene_from_needle;
        let side = probe_from_needle.transform_vector(DVec3::X);
        let bevel = (needle.bevel_known && settings.bevel_deg < 90.0).then_some(side);
        let tip_mm = probe_from_needle.position_mm;
        Self {
            axis_mm: bevel.map_or(tip_mm, |side| tip_mm + settings.radius_mm() * side),
            direction: probe_from_needle.transform_vector(DVec3::Z),
            bevel,
        }
    }
}

/// The needle of one frame, for the passes.
#[derive(Debug, Clone, Default)]
pub(crate) struct NeedleFrame {
    /// Index in `echoes` of each scanline's first echo; then the number of all `[scanlines + 1]`.
    pub(crate) starts: Vec<u32>,
    pub(crate) echoes: Vec<NeedleEcho>,
    /// Cells of the scan plane behind the needle, each once.
    pub(crate) shadows: Vec<Shadow>,
    pub(crate) outline: Outline,
    /// Reused memory for the echoes of each scanline, and for the shadows of each group of cells.
    lines: Vec<Vec<NeedleEcho>>,
    cells: Vec<Vec<Shadow>>,
}

/// What a frame's needle depends on, apart from its place.
#[derive(Debug, Clone, Copy)]
pub(crate) struct View<'a> {
    pub(crate) probe: &'a Probe,
    pub(crate) aperture: Option<&'a ApertureTables>,
    pub(crate) sector: &'a insonify_core::transducer::Sector,
    pub(crate) scene_from_probe: &'a Pose,
    /// Steering angle of the scanlines, radians.
    pub(crate) steer_rad: f64,
}

impl NeedleFrame {
    /// A frame of a probe without a needle.
    pub(crate) fn without_needle(probe: &Probe) -> Self {
        Self { starts: vec![0; probe.scanlines as usize + 1], ..Self::default() }
    }

    /// Computes the needle of a frame; `None`: there is none.
    pub(crate) fn place(&mut self, tables: &NeedleTables, view: View<'_>, needle: Option<&Needle>) {
        let scanlines = view.probe.scanlines as usize;
        self.starts.clear();
        self.starts.resize(scanlines + 1, 0);
        self.echoes.clear();
        self.shadows.clear();
        self.outline = Outline::default();
        let Some(needle) = needle else { return };
        let placed = Placed::new(&tables.settings, view.scene_from_probe, needle);
        self.lines.resize_with(scanlines, Vec::new);
        self.lines.par_iter_mut().enumerate().with_min_len(16).for_each(|(line, echoes)| {
            echoes.clear();
            let fraction = (line as f64 + 0.5) / scanlines as f64;
            let scanline = Scanline::at(view.probe, fraction, view.steer_rad);
            tables.add_shaft(&placed, &scanline, view.probe, echoes);
            tables.add_bevel(&placed, &scanline, view.probe.depth_mm, echoes);
        });
        for (start, line) in self.starts.iter_mut().skip(1).zip(&self.lines) {
            // `add_shaft` leaves room for every scanline; the bound holds in any case.
            let room = NEEDLE_ECHOES_MAX - self.echoes.len();
            self.echoes.extend_from_slice(&line[..line.len().min(room)]);
            *start = self.echoes.len() as u32;
        }
        if let Some(aperture) = view.aperture {
            self.cells.resize_with(aperture.sampling.cells.div_ceil(SHADOW_CELLS), Vec::new);
            self.cells.par_iter_mut().enumerate().for_each(|(group, shadows)| {
                shadows.clear();
                let first = group * SHADOW_CELLS;
                let cells = first..(first + SHADOW_CELLS).min(aperture.sampling.cells);
                tables.add_shadow(&placed, view, aperture, cells, shadows);
            });
            self.cells.iter().for_each(|shadows| self.shadows.extend_from_slice(shadows));
        }
        self.outline = Outline::new(tables, &placed, view.sector);
    }
}
