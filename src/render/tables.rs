//! Tables computed once, in f64, and uploaded: ray directions, beam kernels, the pulse, pixel positions, tissues.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::DVec3;

use super::constants::{ACROSS_BITS, DENSITY_ONE, OUTSIDE, TILE_ROWS};
use super::kernels::Kernels;
use super::sheets::Sheets;
use crate::acoustics::attenuation::attenuation_np_mm;
use crate::acoustics::{ASSUMED_SPEED_M_S, wavelength_mm};
use crate::anatomy::Tissue;
use crate::settings::RenderSettings;
use crate::settings::{Effect, EffectSet};
use crate::transducer::{Probe, Sector};

/// Words of four pixels across a tile of the image.
const TILE_WORDS: u32 = 4;
/// Least number of map steps over the depth, even with few pixels: at an oblique boundary, the error of Σμ is a
/// fraction of the distance between map rays.
const MAP_STEPS_MIN: f64 = 1000.0;

/// `Tissue` of `shaders/shared/tissue.wgsl`.
#[derive(Debug, Clone, Copy, Pod, Zeroable, PartialEq)]
#[repr(C)]
pub(crate) struct PackedTissue {
    pub(crate) impedance_mrayl: f32,
    pub(crate) speed_ratio: f32,
    pub(crate) attenuation_np_mm: f32,
    pub(crate) roughness: f32,
    pub(crate) scatterer_density: u32,
    pub(crate) scatterer_mean: f32,
    pub(crate) scatterer_deviation: f32,
    pub(crate) thickness_mm: f32,
    pub(crate) coherence: f32,
    pub(crate) bending: f32,
    pub(crate) padding: [f32; 2],
}

impl PackedTissue {
    /// A tissue with the simulated effects; an effect that is off has the value that makes it do nothing.
    fn new(tissue: &Tissue, probe: &Probe, effects: EffectSet) -> Self {
        let of = |effect: Effect, value: f64, without: f64| if effects.has(effect) { value } else { without };
        let thickness_mm = of(Effect::Thickness, tissue.thickness_mm, 0.0);
        let exponent = of(Effect::FrequencyExponent, tissue.attenuation_exponent, 1.0);
        let loss_db_cm_mhz = of(Effect::Attenuation, tissue.attenuation_db_cm_mhz, 0.0);
        let loss_np_mm = 2.0 * attenuation_np_mm(loss_db_cm_mhz, exponent, probe.frequency_mhz);
        let speed_ratio = tissue.speed_m_s / ASSUMED_SPEED_M_S;
        // The sinc of the phase over the thickness, replaced by the Gaussian of the same curvature: never negative.
        let phase = std::f64::consts::TAU / wavelength_mm(probe.frequency_mhz) * thickness_mm;
        Self {
            impedance_mrayl: tissue.impedance_mrayl() as f32,
            speed_ratio: of(Effect::SpeedDisplacement, speed_ratio, 1.0) as f32,
            attenuation_np_mm: loss_np_mm as f32,
            roughness: of(Effect::Roughness, tissue.roughness, 0.0) as f32,
            scatterer_density: (of(Effect::Scatterers, tissue.scatterer_density, 0.0) * DENSITY_ONE) as u32,
            scatterer_mean: tissue.scatterer_mean as f32,
            scatterer_deviation: tissue.scatterer_deviation as f32,
            thickness_mm: thickness_mm as f32,
            coherence: (-phase * phase / 6.0).exp() as f32,
            bending: of(Effect::Refraction, speed_ratio, 1.0) as f32,
            padding: [0.0; 2],
        }
    }
}

/// Everything that doesn't change with the pose.
#[derive(Debug, Clone)]
pub(crate) struct Tables {
    /// Origin and direction, two vectors each: every ray of every scanline, then every scanline's axis.
    pub(crate) rays: Vec<[f32; 4]>,
    /// Origin and direction of each map ray.
    pub(crate) map_rays: Vec<[f32; 4]>,
    pub(crate) map_ray_count: u32,
    /// Number of depths per map ray, `map_step_mm` apart, from the face to beyond the deepest pixel.
    pub(crate) map_depths: u32,
    /// Spacing of those depths, and largest spacing of neighbouring map rays, mm.
    pub(crate) map_step_mm: f64,
    /// Of each layer: elevational offset at the face (mm), slope, weight, and length of its rays per mm of depth.
    pub(crate) layers: Vec<[f32; 4]>,
    pub(crate) tissues: Vec<PackedTissue>,
    /// The point-spread function.
    pub(crate) kernels: Kernels,
    /// Sheets of scatterers; none without the effect.
    pub(crate) sheets: Option<Sheets>,
    /// Packed place of each pixel [height × 4·row_words].
    pub(crate) pixels: Vec<u32>,
    /// Image indices of the words of four pixels that overlap the sector, tile by tile.
    pub(crate) sector_words: Vec<u32>,
    /// 255 inside the sector [height × width].
    pub(crate) mask: Arc<[u8]>,
    pub(crate) sector: Sector,
}

impl Tables {
    pub(crate) fn new(tissues: &[Tissue], probe: &Probe, settings: &RenderSettings, effects: EffectSet) -> Self {
        let sector = Sector::fit(probe, settings.image.width, settings.image.height);
        let map_step_mm = sector.pixel_mm.min(probe.depth_mm / MAP_STEPS_MIN);
        let map_ray_count = map_ray_count(probe, map_step_mm);
        let (pixels, mask) = pixels(probe, &sector);
        let inside = |word: &[u32]| word.iter().any(|&pixel| pixel != OUTSIDE);
        let mut sector_words: Vec<u32> =
            (0u32..).zip(pixels.chunks_exact(4)).filter(|(_, w)| inside(w)).map(|(i, _)| i).collect();
        let row_words = settings.image.width.div_ceil(4);
        // Tile by tile: pixels near each other read the same part of the scanlines and of the maps.
        sector_words.sort_by_key(|&i| (i / row_words / TILE_ROWS, i % row_words / TILE_WORDS, i));
        let sheets = effects.has(Effect::ElevationalSpeckle).then(|| Sheets::new(probe));
        Self {
            rays: rays(probe, settings.quality.rays),
            map_rays: fan(probe, map_ray_count),
            map_ray_count,
            map_depths: (probe.depth_mm / map_step_mm).ceil() as u32 + 2,
            map_step_mm,
            layers: layers(probe, settings.quality.layers),
            tissues: tissues.iter().map(|t| PackedTissue::new(t, probe, effects)).collect(),
            kernels: Kernels::new(probe, settings, sheets.as_ref()),
            sheets,
            pixels,
            sector_words,
            mask: mask.into(),
            sector,
        }
    }
}

fn push_ray(into: &mut Vec<[f32; 4]>, (origin, direction): (DVec3, DVec3)) {
    into.push(origin.as_vec3().extend(0.0).to_array());
    into.push(direction.as_vec3().extend(0.0).to_array());
}

/// `count` rays spread evenly over the sector.
fn fan(probe: &Probe, count: u32) -> Vec<[f32; 4]> {
    let mut table = Vec::with_capacity(2 * count as usize);
    for i in 0..count {
        let fraction = (f64::from(i) + 0.5) / f64::from(count);
        push_ray(&mut table, probe.ray(probe.lateral_coordinate(fraction)));
    }
    table
}

/// Rays of all scanlines, spread evenly over each one's share of the sector, then the scanlines' axes.
fn rays(probe: &Probe, rays_per_line: u32) -> Vec<[f32; 4]> {
    let mut table = fan(probe, probe.scanlines * rays_per_line);
    table.extend(fan(probe, probe.scanlines));
    table
}

/// Number of map rays: at most a step apart at the deepest arc, and at most 16,384.
fn map_ray_count(probe: &Probe, map_step_mm: f64) -> u32 {
    let arc_mm = probe.line_spacing_mm(probe.depth_mm) * f64::from(probe.scanlines);
    ((arc_mm / map_step_mm).ceil() as u32).clamp(1, 16384)
}

/// Elevational layers at Gauss–Hermite nodes, whose weights integrate the beam's Gaussian profile.
///
/// A layer is a plane of straight rays: the least-squares line, over the depth, of node × beam width. Usually layers
/// cross at the lens's focus: the width's sign changes there. If the beam has hardly a waist, they don't cross: the
/// sign stays. The line that is nearer to the width is taken.
pub(crate) fn layers(probe: &Probe, count: u32) -> Vec<[f32; 4]> {
    const STEPS: u32 = 64;
    let depths = || (0..STEPS).map(|i| probe.depth_mm * (f64::from(i) + 0.5) / f64::from(STEPS));
    let width = |crosses: bool, depth: f64| {
        let side = if crosses && depth > probe.elevational_focus_mm { -1.0 } else { 1.0 };
        side * probe.elevational_sigma_mm(depth)
    };
    let fit = |crosses: bool| {
        let (start, slope) = line_through(depths().map(|depth| (depth, width(crosses, depth))));
        let off = |depth: f64| ((start + slope * depth).abs() - probe.elevational_sigma_mm(depth)).powi(2);
        (depths().map(off).sum::<f64>(), start, slope)
    };
    let (crossing, parallel) = (fit(true), fit(false));
    let (_, start, slope) = if crossing.0 < parallel.0 { crossing } else { parallel };
    gauss_hermite(count)
        .into_iter()
        .map(|(node, weight)| [node * start, node * slope, weight, (node * slope).hypot(1.0)].map(|v| v as f32))
        .collect()
}

/// Start and slope of the least-squares line through points.
fn line_through(points: impl Iterator<Item = (f64, f64)> + Clone) -> (f64, f64) {
    let n = points.clone().count() as f64;
    let mean = points.clone().fold((0.0, 0.0), |m, (x, y)| (m.0 + x / n, m.1 + y / n));
    let (xy, xx) =
        points.fold((0.0, 0.0), |sum, (x, y)| (sum.0 + (x - mean.0) * (y - mean.1), sum.1 + (x - mean.0).powi(2)));
    let slope = xy / xx;
    (mean.1 - slope * mean.0, slope)
}

/// Nodes (in standard deviations, ascending) and weights (sum 1) that integrate a standard normal exactly up to
/// degree 2·count − 1: the roots of the probabilists' Hermite polynomial, found by bisection
/// (Press et al., *Numerical Recipes*, section 4.6).
fn gauss_hermite(count: u32) -> Vec<(f64, f64)> {
    let n = count as usize;
    // Orthonormal Hermite functions keep the recurrence within range: p_k = He_k/√k!.
    let evaluate = |x: f64| {
        let (mut previous, mut current) = (0.0, 1.0);
        for k in 0..n {
            let k = k as f64;
            let next = (x * current - k.sqrt() * previous) / (k + 1.0).sqrt();
            (previous, current) = (current, next);
        }
        (current, previous)
    };
    // A fine scan separates all roots: they are at least 1/√n apart.
    let reach = 2.0 * (count as f64).sqrt() + 2.0;
    let steps = 4000;
    let mut nodes = Vec::with_capacity(n);
    let mut x0 = -reach;
    let mut y0 = evaluate(x0).0;
    for i in 1..=steps {
        let x1 = -reach + 2.0 * reach * f64::from(i) / f64::from(steps);
        let y1 = evaluate(x1).0;
        if y0 == 0.0 || y0 * y1 < 0.0 {
            let (mut low, mut high, sign) = (x0, x1, y0);
            for _ in 0..80 {
                let middle = 0.5 * (low + high);
                if evaluate(middle).0 * sign > 0.0 { low = middle } else { high = middle }
            }
            let root = if y0 == 0.0 { x0 } else { 0.5 * (low + high) };
            let previous = evaluate(root).1;
            nodes.push((if root.abs() < 1e-9 { 0.0 } else { root }, 1.0 / (n as f64 * previous * previous)));
        }
        (x0, y0) = (x1, y1);
    }
    nodes
}

/// Place of every pixel, rows padded to whole words, and the mask.
fn pixels(probe: &Probe, sector: &Sector) -> (Vec<u32>, Vec<u8>) {
    let stride = sector.width.div_ceil(4) * 4;
    let mut places = Vec::with_capacity((stride * sector.height) as usize);
    let mut mask = Vec::with_capacity((sector.width * sector.height) as usize);
    for row in 0..sector.height {
        for column in 0..stride {
            let polar =
                if column < sector.width { Sector::polar(probe, sector.pixel_centre_mm(column, row)) } else { None };
            places.push(polar.map_or(OUTSIDE, |(across, depth_mm)| pack_place(across, depth_mm / probe.depth_mm)));
            if column < sector.width {
                mask.push(if polar.is_some() { 255 } else { 0 });
            }
        }
    }
    (places, mask)
}

/// Fractions of the sector's width and depth in one word, rounded to within 1/65,532 and 1/262,140.
fn pack_place(across: f64, depth: f64) -> u32 {
    let (across_max, depth_max) = place_scales();
    let across = (across.clamp(0.0, 1.0) * across_max).round() as u32;
    let depth = (depth.clamp(0.0, 1.0) * depth_max).round() as u32;
    across | depth << ACROSS_BITS
}

/// The fractions of a packed place; none outside the sector.
pub(crate) fn unpack_place(word: u32) -> Option<[f64; 2]> {
    let (across_max, depth_max) = place_scales();
    let across = word & ((1 << ACROSS_BITS) - 1);
    (word != OUTSIDE).then(|| [f64::from(across) / across_max, f64::from(word >> ACROSS_BITS) / depth_max])
}

/// Codes of a fraction of 1: one less than the bits hold, so no place equals [`OUTSIDE`].
fn place_scales() -> (f64, f64) {
    (f64::from((1u32 << ACROSS_BITS) - 2), f64::from((1u32 << (32 - ACROSS_BITS)) - 2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_layers_are_the_textbook_nodes() {
        let nodes = gauss_hermite(3);
        let root3 = 3f64.sqrt();
        for (got, want) in nodes.iter().zip([(-root3, 1.0 / 6.0), (0.0, 2.0 / 3.0), (root3, 1.0 / 6.0)]) {
            assert!((got.0 - want.0).abs() < 1e-9 && (got.1 - want.1).abs() < 1e-9, "{got:?}");
        }
    }

    #[test]
    fn layer_weights_sum_to_one_and_reproduce_the_variance() {
        for count in 1..=33 {
            let nodes = gauss_hermite(count);
            assert_eq!(nodes.len(), count as usize);
            let sum: f64 = nodes.iter().map(|n| n.1).sum();
            assert!((sum - 1.0).abs() < 1e-9, "{count}: {sum}");
            if count > 1 {
                let variance: f64 = nodes.iter().map(|n| n.1 * n.0 * n.0).sum();
                assert!((variance - 1.0).abs() < 1e-6, "{count}: {variance}");
            }
        }
    }

    #[test]
    fn layers_follow_the_lens_through_its_focus() {
        let probe = Probe::default();
        let [below, middle, above] = layers(&probe, 3)[..] else { panic!("three layers") };
        assert_eq!(middle, [0.0, 0.0, middle[2], 1.0]);
        for depth in (0..=150).map(f64::from) {
            let want = 3f64.sqrt() * probe.elevational_sigma_mm(depth);
            for [offset, slope, ..] in [below, above].map(|l| l.map(f64::from)) {
                // Straight rays have no waist, so they differ from the beam at the focus.
                let got = (offset + slope * depth).abs();
                assert!((got - want).abs() < 0.9, "{got} mm, not {want}, at {depth} mm");
            }
        }
        let crossing = f64::from(-above[0] / above[1]);
        assert!((crossing - probe.elevational_focus_mm).abs() < 1.0, "{crossing}");
    }

    #[test]
    fn layers_of_a_lens_without_a_waist_do_not_cross() {
        // A low frequency, with the beam nearly as wide at the focus as at the face; and a focus just within the image.
        let lenses = [
            Probe { frequency_mhz: 2.5, elevational_focus_mm: 80.0, depth_mm: 160.0, ..Probe::default() },
            Probe { depth_mm: 75.0, ..Probe::default() },
        ];
        for probe in lenses {
            let [_, _, [offset, slope, ..]] = layers(&probe, 3)[..] else { panic!("three layers") };
            for depth in [0.0, 0.5 * probe.depth_mm, probe.depth_mm] {
                let want = 3f64.sqrt() * probe.elevational_sigma_mm(depth);
                let got = f64::from(offset) + f64::from(slope) * depth;
                assert!((got - want).abs() < 0.45, "{got} mm, not {want}, at {depth} mm");
            }
        }
    }

    #[test]
    fn layers_of_a_lens_focused_beyond_the_image_never_cross() {
        let probe = Probe { depth_mm: 50.0, ..Probe::default() };
        let [_, _, [offset, slope, ..]] = layers(&probe, 3)[..] else { panic!("three layers") };
        let ends = [f64::from(offset), f64::from(offset + 50.0 * slope)];
        for (got, depth) in ends.into_iter().zip([0.0, 50.0]) {
            let want = 3f64.sqrt() * probe.elevational_sigma_mm(depth);
            assert!((got - want).abs() < 0.1, "{got} mm, not {want}, at {depth} mm");
        }
    }
}
