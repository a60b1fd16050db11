//! Tables that don't change with the pose: ray directions, kernels, pulse, pixel positions, tissues. They are computed
//! once, in f64.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::{DVec2, DVec3};
use insonify_core::acoustics::decibel::NEPER_PER_DB;
use insonify_core::acoustics::{ASSUMED_SPEED_M_S, wavelength_mm};
use insonify_core::anatomy::Tissue;
use insonify_core::settings::{Effect, EffectSet, LookSettings, Quality, RenderSettings};
use insonify_core::transducer::{Probe, Sector};
use rayon::prelude::*;

use super::aperture::ApertureTables;
use super::compounding::steering;
use super::constants::{ACROSS_BITS, DENSITY_ONE, HARD_SPEED, OUTSIDE, TEXTURE_SHIFT, TILE_ROWS};
use super::elevation::elevations;
use super::kernels::Kernels;
use super::needle::NeedleTables;
use super::receiver::NearField;
use super::sheets::Sheets;
use super::texture::PackedTexture;

/// Width of a tile of the image, words of four pixels.
const TILE_WORDS: u32 = 4;
/// Least number of map steps over the depth, even for small images. At an oblique boundary, the error of Σμ grows with
/// the spacing of map rays, which follows the step.
const MAP_STEPS_MIN: f64 = 1000.0;

/// A tissue as the passes need it: `Tissue` of `shaders/shared/tissue.wgsl`.
#[derive(Debug, Clone, Copy, Pod, Zeroable, PartialEq)]
#[repr(C)]
pub(crate) struct PackedTissue {
    pub(crate) impedance_mrayl: f32,
    pub(crate) speed_ratio: f32,
    pub(crate) attenuation_np_mm: f32,
    pub(crate) roughness: f32,
    /// Scatterer density in 1/131072, and the texture's number from bit [`TEXTURE_SHIFT`] on.
    pub(crate) scatterers: u32,
    pub(crate) scatterer_mean: f32,
    pub(crate) scatterer_deviation: f32,
    pub(crate) thickness_mm: f32,
    pub(crate) coherence: f32,
    pub(crate) bending: f32,
    pub(crate) aperture_speed_ratio: f32,
    pub(crate) padding: u32,
}

impl PackedTissue {
    /// Packs a tissue. An effect that is not simulated gets the value with which its arithmetic does nothing.
    fn new(number: usize, tissue: &Tissue, probe: &Probe, effects: EffectSet) -> Self {
        let of = |effect: Effect, value: f64, without: f64| if effects.has(effect) { value } else { without };
        let thickness_mm = of(Effect::Thickness, tissue.thickness_mm, 0.0);
        let exponent = of(Effect::FrequencyExponent, tissue.attenuation_exponent, 1.0);
        let loss_db_cm_mhz = of(Effect::Attenuation, tissue.attenuation_db_cm_mhz, 0.0);
        let loss_np_mm = probe.two_way_loss_db_mm(loss_db_cm_mhz, exponent) * NEPER_PER_DB;
        let speed_ratio = tissue.speed_m_s / ASSUMED_SPEED_M_S;
        let aperture_ratio = if (speed_ratio - 1.0).abs() > HARD_SPEED { 1.0 } else { speed_ratio };
        // The sinc of the phase over the thickness, replaced by the Gaussian of the same curvature, which is never
        // negative.
        let phase = std::f64::consts::TAU / wavelength_mm(probe.frequency_mhz) * thickness_mm;
        let textured = effects.has(Effect::Texture) && PackedTexture::is_of(tissue);
        let texture = if textured { (number as u32 + 1) << TEXTURE_SHIFT } else { 0 };
        let density = (of(Effect::Scatterers, tissue.scatterer_density, 0.0) * DENSITY_ONE) as u32;
        Self {
            impedance_mrayl: tissue.impedance_mrayl() as f32,
            speed_ratio: of(Effect::SpeedDisplacement, speed_ratio, 1.0) as f32,
            attenuation_np_mm: loss_np_mm as f32,
            roughness: of(Effect::Roughness, tissue.roughness, 0.0) as f32,
            scatterers: density | texture,
            scatterer_mean: tissue.scatterer_mean as f32,
            scatterer_deviation: tissue.scatterer_deviation as f32,
            thickness_mm: thickness_mm as f32,
            coherence: (-phase * phase / 6.0).exp() as f32,
            bending: of(Effect::Refraction, speed_ratio, 1.0) as f32,
            aperture_speed_ratio: of(Effect::SpeedDisplacement, aperture_ratio, 1.0) as f32,
            padding: 0,
        }
    }
}

/// A steering angle of a compounded picture, and the positions of pixels on its scanlines.
#[derive(Debug, Clone)]
pub(crate) struct SteeredAngle {
    /// Steering angle, radians.
    pub(crate) steer_rad: f64,
    /// Packed position of each pixel on the steered scanlines [height × 4·row_words]; empty for the straight angle.
    pub(crate) pixels: Arc<[u32]>,
}

/// All tables of a configuration, which don't change with the pose.
#[derive(Debug, Clone)]
pub(crate) struct Tables {
    /// Origin and direction, one vector each, of every ray of every scanline, then of every scanline's axis.
    pub(crate) rays: Vec<[f32; 4]>,
    /// Origin and direction, one vector each, of every map ray.
    pub(crate) map_rays: Vec<[f32; 4]>,
    pub(crate) map_ray_count: u32,
    /// Number of depths on each map ray, `map_step_mm` apart, from the face to beyond the deepest pixel.
    pub(crate) map_depths: u32,
    /// Spacing of the depths, and largest spacing of neighbouring map rays, mm.
    pub(crate) map_step_mm: f64,
    /// Spacing of neighbouring scanlines at the face, mm.
    pub(crate) face_spacing_mm: f64,
    /// Elevational offsets of the paths of a scanline [angles × layers × rays], the straight angle first. Each entry
    /// holds the offset at the face (mm), the slope, the path's length per mm of depth, and 0.
    pub(crate) elevations: Vec<[f32; 4]>,
    pub(crate) tissues: Vec<PackedTissue>,
    /// Texture of each tissue; empty without the effect `texture`.
    pub(crate) textures: Vec<PackedTexture>,
    /// Kernels of the point-spread function.
    pub(crate) kernels: Kernels,
    /// Tables of the aperture; `None` if the effect `aperture` is off.
    pub(crate) aperture: Option<ApertureTables>,
    /// Sheets of scatterers; `None` if the effect `elevational_speckle` is off.
    pub(crate) sheets: Option<Sheets>,
    /// Beams at the needle; `None` if the effect `needle` is off.
    pub(crate) needle: Option<NeedleTables>,
    /// Clutter and reverberation near the face. `None` unless effect `contact` or `clutter` is on.
    pub(crate) near_field: Option<NearField>,
    /// Packed position of each pixel on the straight scanlines [height × 4·row_words].
    pub(crate) pixels: Arc<[u32]>,
    /// Indices of the image's words of four pixels that overlap the sector, in the order of tiles.
    pub(crate) sector_words: Arc<[u32]>,
    /// Steering angles in the order in which they are rendered, the straight angle last. Without compounding, there is
    /// only the straight angle.
    pub(crate) angles: Vec<SteeredAngle>,
    /// 255 inside the sector [height × width].
    pub(crate) mask: Arc<[u8]>,
    pub(crate) sector: Sector,
    made_for: MadeFor,
}

/// Probe, settings and effects that tables were made for.
#[derive(Debug, Clone, Copy, PartialEq)]
struct MadeFor {
    probe: Probe,
    settings: RenderSettings,
    effects: EffectSet,
}

impl MadeFor {
    fn new(probe: &Probe, settings: &RenderSettings, effects: EffectSet) -> Self {
        // No table depends on the seed.
        let settings = RenderSettings { quality: Quality { seed: 0, ..settings.quality }, ..*settings };
        Self { probe: *probe, settings, effects }
    }

    /// Whether both have the same scanlines and pixels, which don't depend on the focus.
    fn has_pixels_of(&self, other: &Self) -> bool {
        let image = |made: &Self| (made.settings.image.width, made.settings.image.height);
        let probe = |made: &Self| Probe { focus_mm: 0.0, ..made.probe };
        image(self) == image(other) && probe(self) == probe(other)
    }

    /// Whether each of `effects` is on in both or off in both.
    fn agree_on(&self, other: &Self, effects: &[Effect]) -> bool {
        effects.iter().all(|&effect| self.effects.has(effect) == other.effects.has(effect))
    }

    /// Whether beams and pulses of both are the same.
    fn has_beams_of(&self, other: &Self) -> bool {
        let taps = |made: &Self| (made.settings.beam_taps_max, made.settings.pulse_taps_max);
        let shape = [Effect::Aperture, Effect::ElevationalSpeckle];
        self.probe == other.probe && taps(self) == taps(other) && self.agree_on(other, &shape)
    }
}

impl Tables {
    /// Bit set of the steering angles that show each pixel [height × width].
    pub(crate) fn covered(&self) -> Vec<u16> {
        let (width, stride) = (self.sector.width as usize, self.sector.width.div_ceil(4) as usize * 4);
        let place = |angle: &SteeredAngle, i: usize| *angle.pixels.get(i).unwrap_or(&self.pixels[i]);
        let bit = |(k, angle): (usize, &SteeredAngle), i: usize| u16::from(place(angle, i) != OUTSIDE) << k;
        let at = |i: usize| i / width * stride + i % width;
        let bits = |i: usize| self.angles.iter().enumerate().map(|angle| bit(angle, at(i))).sum();
        (0..self.mask.len()).into_par_iter().map(bits).collect()
    }

    /// Copy of these tables with the steering angles of `settings`.
    pub(crate) fn with_angles(&self, probe: &Probe, settings: &RenderSettings) -> Self {
        let angles = angles(probe, &settings.look, &self.pixels, &self.angles);
        let made_for = MadeFor::new(probe, settings, self.made_for.effects);
        Self { elevations: elevations_of(probe, settings, &angles), angles, made_for, ..self.clone() }
    }

    /// Tables of a probe and settings: a match among `known`, or new ones that reuse single tables of `known`. Tissues
    /// come with the needle's number in the segmentation.
    pub(crate) fn new<'a>(
        (tissues, needle_tissue): (&[Tissue], u32),
        probe: &Probe,
        settings: &RenderSettings,
        effects: EffectSet,
        known: impl Iterator<Item = &'a Arc<Self>> + Clone,
    ) -> Arc<Self> {
        let made_for = MadeFor::new(probe, settings, effects);
        let packed = |(i, tissue)| PackedTissue::new(i, tissue, probe, effects);
        let packed_tissues: Vec<PackedTissue> = tissues.iter().enumerate().map(packed).collect();
        let textures = if effects.has(Effect::Texture) { textures(tissues) } else { Vec::new() };
        let same = |known: &&Arc<Self>| {
            known.made_for == made_for && known.tissues == packed_tissues && known.textures == textures
        };
        if let Some(known) = known.clone().find(same) {
            return known.clone();
        }
        let sector = Sector::fit(probe, settings.image.width, settings.image.height);
        let map_step_mm = sector.pixel_mm.min(probe.depth_mm / MAP_STEPS_MIN);
        let map_ray_count = map_ray_count(probe, map_step_mm);
        let placed = known.clone().find(|known| known.made_for.has_pixels_of(&made_for));
        let (pixels, sector_words, mask) = match placed {
            Some(known) => (known.pixels.clone(), known.sector_words.clone(), known.mask.clone()),
            None => {
                let (pixels, mask) = pixels(probe, &sector);
                let words = sector_words(&pixels, settings.image.width);
                (pixels.into(), words, mask.into())
            }
        };
        let steered = known.clone().filter(|known| known.made_for.has_pixels_of(&made_for));
        let steered: Vec<SteeredAngle> = steered.flat_map(|known| known.angles.iter().cloned()).collect();
        let angles = angles(probe, &settings.look, &pixels, &steered);
        let beams = known.clone().find(|known| known.made_for.has_beams_of(&made_for));
        let (sheets, aperture, kernels) = match beams {
            Some(known) => {
                let aperture = known.aperture.as_ref().map(|aperture| aperture.with_rays(probe, settings.quality.rays));
                (known.sheets.clone(), aperture, known.kernels.clone())
            }
            None => {
                let sheets = effects.has(Effect::ElevationalSpeckle).then(|| Sheets::new(probe));
                let aperture = effects.has(Effect::Aperture).then(|| ApertureTables::new(probe, settings.quality));
                let aperture = aperture.flatten();
                let reach = aperture.as_ref().map_or(0, ApertureTables::reach_lines);
                let kernels = Kernels::new(probe, settings, sheets.as_ref(), reach);
                (sheets, aperture, kernels)
            }
        };
        let same_needle = beams.filter(|known| known.made_for.settings.needle == settings.needle);
        let known_needle = same_needle.and_then(|known| known.needle.clone());
        let needle = settings.needle.filter(|_| effects.has(Effect::Needle));
        let needle =
            needle.map(|needle| known_needle.unwrap_or_else(|| NeedleTables::new(needle, probe, needle_tissue)));
        let near = effects.has(Effect::Contact) || effects.has(Effect::Clutter);
        let near_field = beams.and_then(|known| known.near_field.clone()).filter(|_| near);
        let new_near = || near.then(|| NearField::new(probe, &kernels.pulse));
        Arc::new(Self {
            near_field: near_field.or_else(new_near),
            needle,
            rays: rays(probe, settings.quality.rays),
            map_rays: fan(probe, map_ray_count),
            map_ray_count,
            map_depths: (probe.depth_mm / map_step_mm).ceil() as u32 + 2,
            map_step_mm,
            face_spacing_mm: probe.line_spacing_mm(0.0),
            elevations: elevations_of(probe, settings, &angles),
            tissues: packed_tissues,
            textures,
            kernels,
            aperture,
            sheets,
            pixels,
            sector_words,
            angles,
            mask,
            sector,
            made_for,
        })
    }
}

/// Indices of the words of four pixels that overlap the sector. They are sorted by tiles, since pixels near each other
/// read the same part of the scanlines and maps.
fn sector_words(pixels: &[u32], width: u32) -> Arc<[u32]> {
    let inside = |word: &[u32]| word.iter().any(|&pixel| pixel != OUTSIDE);
    let mut words: Vec<u32> = (0u32..).zip(pixels.chunks_exact(4)).filter(|(_, w)| inside(w)).map(|(i, _)| i).collect();
    let row_words = width.div_ceil(4);
    words.par_sort_unstable_by_key(|&i| (i / row_words / TILE_ROWS, i % row_words / TILE_WORDS, i));
    words.into()
}

/// Texture of each tissue; zeros for tissues without one.
fn textures(tissues: &[Tissue]) -> Vec<PackedTexture> {
    let texture = |(i, tissue)| PackedTexture::new(i, tissue).unwrap_or(bytemuck::Zeroable::zeroed());
    tissues.iter().enumerate().map(texture).collect()
}

fn push_ray(into: &mut Vec<[f32; 4]>, (origin, direction): (DVec3, DVec3)) {
    into.push(origin.as_vec3().extend(0.0).to_array());
    into.push(direction.as_vec3().extend(0.0).to_array());
}

/// Origins and directions of `count` rays, spread evenly over the sector.
fn fan(probe: &Probe, count: u32) -> Vec<[f32; 4]> {
    let mut table = Vec::with_capacity(2 * count as usize);
    for i in 0..count {
        let fraction = (f64::from(i) + 0.5) / f64::from(count);
        push_ray(&mut table, probe.ray(probe.lateral_coordinate(fraction)));
    }
    table
}

/// Origins and directions of all rays, spread evenly over each scanline's share of the sector, then of the scanlines'
/// axes.
fn rays(probe: &Probe, rays_per_line: u32) -> Vec<[f32; 4]> {
    let mut table = fan(probe, probe.scanlines * rays_per_line);
    table.extend(fan(probe, probe.scanlines));
    table
}

/// Number of map rays, at most 16,384: neighbours are at most a step apart at the deepest arc.
fn map_ray_count(probe: &Probe, map_step_mm: f64) -> u32 {
    let arc_mm = probe.line_spacing_mm(probe.depth_mm) * f64::from(probe.scanlines);
    ((arc_mm / map_step_mm).ceil() as u32).clamp(1, 16384)
}

/// Packed position of every pixel, with rows padded to whole words, and the sector's mask without padding.
fn pixels(probe: &Probe, sector: &Sector) -> (Vec<u32>, Vec<u8>) {
    let stride = sector.width.div_ceil(4) * 4;
    let place = |(column, row)| {
        let inside = (column < sector.width).then(|| Sector::polar(probe, sector.pixel_centre_mm(column, row)));
        packed(probe, inside.flatten())
    };
    let row = |row: u32| (0..stride).map(move |column| place((column, row)));
    let places: Vec<u32> = (0..sector.height).into_par_iter().flat_map_iter(row).collect();
    let rows = places.chunks_exact(stride as usize);
    let inside = |&place: &u32| if place == OUTSIDE { 0 } else { 255 };
    let mask = rows.flat_map(|row| row[..sector.width as usize].iter().map(inside)).collect();
    (places, mask)
}

/// Elevational offsets of the paths of all steering angles.
fn elevations_of(probe: &Probe, settings: &RenderSettings, angles: &[SteeredAngle]) -> Vec<[f32; 4]> {
    elevations(probe, settings.quality.rays, settings.quality.layers, angles.len() as u32)
}

/// Steering angles of a compounded picture, with their pixel positions. Equal angles of `known`, made for the same
/// pixels, are reused. Steered scanlines may not reach all of the sector.
fn angles(probe: &Probe, look: &LookSettings, pixels: &[u32], known: &[SteeredAngle]) -> Vec<SteeredAngle> {
    let angles = look.angles_of(probe.kind);
    let of_angle = |steer_rad: f64| {
        if let Some(known) = known.iter().find(|known| known.steer_rad == steer_rad) {
            return known.clone();
        }
        let steered = || {
            let steering = Steering::new(probe, steer_rad);
            pixels.par_iter().map(|&straight| steering.place(straight)).collect()
        };
        SteeredAngle { steer_rad, pixels: if steer_rad == 0.0 { Arc::default() } else { steered() } }
    };
    steering(angles, look.span_deg).into_iter().map(of_angle).collect()
}

/// Map from positions on straight scanlines to positions on steered scanlines: [`Sector::polar_steered`] as a table
/// over depth.
struct Steering {
    /// Shift across and steered depth at equal steps of the straight depth, as fractions of the sector.
    steps: Vec<[f64; 2]>,
}

impl Steering {
    /// Number of steps over the depth; between them, values are interpolated.
    const STEPS: u32 = 8192;

    fn new(probe: &Probe, steer_rad: f64) -> Self {
        let step = |step: u32| {
            // Steering shifts all points of one depth equally, so only the middle of the sector is tabulated.
            let depth_mm = f64::from(step) / f64::from(Self::STEPS) * probe.depth_mm;
            let [across, depth_mm] = Sector::steered(probe, DVec2::new(0.0, depth_mm), steer_rad);
            [across - 0.5, depth_mm / probe.depth_mm]
        };
        Self { steps: (0..=Self::STEPS).map(step).collect() }
    }

    fn place(&self, straight: u32) -> u32 {
        let Some([across, depth]) = unpack_place(straight) else { return OUTSIDE };
        let at = depth * f64::from(Self::STEPS);
        let step = (at as usize).min(self.steps.len().saturating_sub(2));
        let (Some(&[shift, near]), Some(&[next_shift, far])) = (self.steps.get(step), self.steps.get(step + 1)) else {
            return OUTSIDE;
        };
        let part = at - step as f64;
        let (across, depth) = (across + shift + part * (next_shift - shift), near + part * (far - near));
        let inside = (0.0..1.0).contains(&across) && (0.0..1.0).contains(&depth);
        if inside { pack_place(across, depth) } else { OUTSIDE }
    }
}

/// Packed position of a pixel; [`OUTSIDE`] for `None`. `polar` is the fraction of the sector's width, and the depth in
/// mm.
fn packed(probe: &Probe, polar: Option<(f64, f64)>) -> u32 {
    polar.map_or(OUTSIDE, |(across, depth_mm)| pack_place(across, depth_mm / probe.depth_mm))
}

/// Packs fractions of the sector's width and depth into one word, with steps of 1/32,766 and 1/131,070.
fn pack_place(across: f64, depth: f64) -> u32 {
    let (across_max, depth_max) = place_scales();
    // A cast takes less time than `round`.
    let across = (across.clamp(0.0, 1.0) * across_max + 0.5) as u32;
    let depth = (depth.clamp(0.0, 1.0) * depth_max + 0.5) as u32;
    across | depth << ACROSS_BITS
}

/// Fractions of the sector's width and depth in a packed position; `None` outside the sector.
pub(crate) fn unpack_place(word: u32) -> Option<[f64; 2]> {
    let (across_max, depth_max) = place_scales();
    let across = word & ((1 << ACROSS_BITS) - 1);
    (word != OUTSIDE).then(|| [f64::from(across) / across_max, f64::from(word >> ACROSS_BITS) / depth_max])
}

/// Codes of a fraction of 1 across and in depth: one less than the bits hold, so no position equals [`OUTSIDE`].
fn place_scales() -> (f64, f64) {
    (f64::from((1u32 << ACROSS_BITS) - 2), f64::from((1u32 << (32 - ACROSS_BITS)) - 2))
}

#[cfg(test)]
mod tests {
    use insonify_core::transducer::ProbeKind;

    use super::*;

    #[test]
    fn steered_places_are_those_of_the_geometry() {
        for kind in [ProbeKind::Convex { radius_mm: 40.0, fov_deg: 70.0 }, ProbeKind::Linear { width_mm: 40.0 }] {
            let probe = Probe { kind, ..Probe::default() };
            let sector = Sector::fit(&probe, 300, 200);
            let (pixels, _) = pixels(&probe, &sector);
            let (mut shown, mut beyond) = (0, 0);
            for steer_deg in [-15.0, 6.0, 15.0] {
                let steering = Steering::new(&probe, f64::to_radians(steer_deg));
                for (i, &straight) in pixels.iter().enumerate().filter(|(_, place)| **place != OUTSIDE) {
                    let point_mm = sector.pixel_centre_mm(i as u32 % 300, i as u32 / 300);
                    let found = unpack_place(steering.place(straight));
                    let expected = Sector::polar_steered(&probe, point_mm, f64::to_radians(steer_deg));
                    match (found, expected) {
                        (Some([across, depth]), Some((fraction, depth_mm))) => {
                            // A word holds a position to within 1/65,532 and 1/262,140. Two positions are rounded, and
                            // depth shifts across.
                            assert!((across - fraction).abs() < 2.2 / 65_532.0, "{steer_deg}: {across} {fraction}");
                            let off = (depth - depth_mm / probe.depth_mm).abs();
                            assert!(off < 2.2 / 262_140.0, "{steer_deg}: {off}");
                            shown += 1;
                        }
                        (None, None) => beyond += 1,
                        _ => {
                            let [across, depth_mm] = Sector::steered(&probe, point_mm, f64::to_radians(steer_deg));
                            let borders =
                                [across, across - 1.0, depth_mm / probe.depth_mm, depth_mm / probe.depth_mm - 1.0];
                            assert!(borders.iter().any(|b| b.abs() < 1.0e-4), "{steer_deg}: {across} {depth_mm}");
                        }
                    }
                }
            }
            assert!(shown > beyond && beyond > 100, "{shown} {beyond}");
        }
    }
}
