//! Uniforms that every pass reads: `shaders/shared/params.wgsl` field by field, then the settings of the image.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};
use insonify_core::anatomy::Bvh;
use insonify_core::pose::Pose;
use insonify_core::settings::{Effect, EffectSet, ImageUniforms, RenderSettings};
use insonify_core::simd::{at_least, phasor};
use insonify_core::transducer::{Probe, ProbeKind};

use super::constants::{
    CELLS_OF_A_BEAM, FAMILY_SALT, HINT_BLOCK, KRONECKER, PROJECTION_MIN, ROW_ALIGN, SHEET_FAMILIES,
};
use super::receiver::{HARMONIC_CLUTTER_DB, white_amplitude};
use super::sheet_cells::SheetCells;
use super::sheets::Family;
use super::tables::Tables;

/// Size of the image settings, 32-bit words.
const IMAGE_WORDS: usize = size_of::<ImageUniforms>() / 4;
/// Padding after the image settings, words; it makes the size of [`Params`] a multiple of 16 bytes.
const TAIL: usize = IMAGE_WORDS.next_multiple_of(4) - IMAGE_WORDS;
/// Number of 4-word vectors that hold the image settings.
#[cfg(feature = "gpu")]
pub(crate) const IMAGE_QUADS: usize = IMAGE_WORDS.div_ceil(4);

// WGSL aligns vectors to 16 bytes, so the fields before `sheets` must add up to a multiple of that, padding included.
const _: () = assert!(std::mem::offset_of!(Params, sheets) % 16 == 0);
const _: () = assert!(std::mem::offset_of!(Params, image) % 16 == 0);

/// A family of parallel sheets of scatterers: `SheetFamily` of `shaders/shared/params.wgsl`.
#[derive(Debug, Clone, Copy, Pod, Zeroable, PartialEq)]
#[repr(C)]
pub(crate) struct SheetFamily {
    /// Unit normal of the sheets; then mm along the elevational axis per mm along the normal.
    pub(crate) normal: [f32; 4],
    /// Axes of the sheets' cells; then, on an elevational line, displacement along that axis per mm along the normal.
    pub(crate) first: [f32; 4],
    pub(crate) second: [f32; 4],
    /// Amplitude weight of the family; the squares over a slice's families sum to 1.
    pub(crate) share: f32,
    /// Number added to each sheet's index before hashing.
    pub(crate) salt: u32,
    /// Side of a cell, mm.
    pub(crate) cell_mm: f32,
    /// Scatterers of a cell, 1 to 4.
    pub(crate) cell_scatterers: u32,
}

impl SheetFamily {
    /// The family relative to a slice whose elevational axis is `elevational`.
    fn new(family: &Family, elevational: DVec3, cells: SheetCells) -> Self {
        let Family { number, axes, share } = *family;
        let along = axes.x_axis.dot(elevational);
        let vector = |v: DVec3, w: f64| v.as_vec3().extend(w as f32).to_array();
        let in_sheet = |axis: DVec3| vector(axis, axis.dot(elevational) / along);
        Self {
            normal: vector(axes.x_axis, 1.0 / along.abs()),
            first: in_sheet(axes.y_axis),
            second: in_sheet(axes.z_axis),
            share: share as f32,
            salt: FAMILY_SALT * (number + 1),
            cell_mm: cells.side_mm as f32,
            cell_scatterers: cells.scatterers,
        }
    }
}

/// Indices of the tissues outside all surfaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Outside {
    /// Tissue that conducts between the face and the body; fills all of the outside if contact is not simulated.
    pub(crate) background: u32,
    /// Air around the body.
    pub(crate) air: u32,
}

/// Uniforms of one dispatch.
#[derive(Debug, Clone, Copy, Pod, Zeroable, PartialEq)]
#[repr(C)]
pub(crate) struct Params {
    pub(crate) lateral: [f32; 4],
    pub(crate) elevational: [f32; 4],
    pub(crate) axial: [f32; 4],
    pub(crate) scanlines: u32,
    pub(crate) samples: u32,
    pub(crate) rays: u32,
    pub(crate) layer_first: u32,
    pub(crate) layer_count: u32,
    pub(crate) line_first: u32,
    pub(crate) line_count: u32,
    pub(crate) seed: u32,
    pub(crate) lateral_half: u32,
    pub(crate) axial_half: u32,
    pub(crate) map_rays: u32,
    pub(crate) row_words: u32,
    pub(crate) sample_spacing_mm: f32,
    pub(crate) depth_mm: f32,
    pub(crate) phase_turns_per_mm: f32,
    pub(crate) aperture_mm: f32,
    pub(crate) reach_mm: f32,
    pub(crate) tgc_db_per_mm: f32,
    pub(crate) face_radius_mm: f32,
    pub(crate) background: u32,
    pub(crate) row_samples: u32,
    pub(crate) hint_words: u32,
    pub(crate) map_depths: u32,
    pub(crate) map_step_mm: f32,
    pub(crate) sector_words: u32,
    pub(crate) reflections_max: u32,
    pub(crate) layers: u32,
    pub(crate) axial_paths: u32,
    /// Number of families in `sheets`, and distance between neighbouring sheets of a family, mm; 0 without speckle
    /// across the slice.
    pub(crate) sheet_families: u32,
    pub(crate) sheet_spacing_mm: f32,
    /// Tissue outside all surfaces, deeper than the film of gel.
    pub(crate) beyond: u32,
    /// Thickness of the film of gel, mm; negative if contact is not simulated.
    pub(crate) film_mm: f32,
    /// Amplitudes of white noise, clutter and reverberation; 0 if they are off.
    pub(crate) noise: f32,
    pub(crate) clutter: f32,
    pub(crate) reverberation: f32,
    /// Samples per scanline in the table of clutter and reverberation.
    pub(crate) near_samples: u32,
    /// Seed of the receiver's noise in this frame.
    pub(crate) noise_seed: u32,
    /// Cosine and sine of the steering angle.
    pub(crate) steer: [f32; 2],
    /// Offset of this steering angle in the table of pixel positions, words of four pixels.
    pub(crate) angle_words: u32,
    /// Range by which a steered wavefront falls behind from one scanline to the next, mm.
    pub(crate) steer_shift_mm: f32,
    /// Angle between neighbouring scanlines of a phased array, turns; 0 for other arrays.
    pub(crate) line_turns: f32,
    /// Number of paths of each scanline that follow reflections: all of them, or fewer.
    pub(crate) reflecting_paths: u32,
    /// Grey levels that `detect` makes of each sample: 1, or 2 if one lies midway to the next sample.
    pub(crate) levels_per_sample: u32,
    /// Amplitude that the face reflects, 0..=1; 0 without multiples.
    pub(crate) face_reflection: f32,
    /// Padding to a multiple of 16 bytes.
    pub(crate) unused: [u32; 3],
    pub(crate) sheets: [SheetFamily; SHEET_FAMILIES as usize],
    /// Every setting of the section `[image]`.
    pub(crate) image: ImageUniforms,
    pub(crate) tail: [u32; TAIL],
}

/// Angle between neighbouring scanlines of a phased array, turns; 0 for other arrays.
fn line_turns(probe: &Probe) -> f32 {
    match probe.kind {
        ProbeKind::Phased { fov_deg } => (fov_deg / (360.0 * f64::from(probe.scanlines))) as f32,
        ProbeKind::Convex { .. } | ProbeKind::Linear { .. } => 0.0,
    }
}

impl Params {
    /// Uniforms of a frame with the effects `on`, without its pose and its batch of paths.
    pub(crate) fn new(
        outside: Outside,
        probe: &Probe,
        settings: &RenderSettings,
        tables: &Tables,
        on: EffectSet,
    ) -> Self {
        let (image, receiver) = (&settings.image, &settings.receiver);
        let amplitude = |effect: Effect, value: f64| if on.has(effect) { value as f32 } else { 0.0 };
        let cleaner_db = if probe.harmonics { HARMONIC_CLUTTER_DB } else { 0.0 };
        let level = |effect: Effect, db: f64| amplitude(effect, 10f64.powf((db - cleaner_db) / 20.0));
        let contact = on.has(Effect::Contact);
        let several = settings.quality.rays * settings.quality.layers > 1;
        // With the aperture, paths that may reflect need an axial path, which passes every interface.
        let has_axial_paths = if on.has(Effect::Aperture) {
            several || on.has(Effect::Reflections)
        } else {
            several && (on.has(Effect::Scatterers) || on.has(Effect::Needle))
        };
        Self {
            lateral: [0.0; 4],
            elevational: [0.0; 4],
            axial: [0.0; 4],
            scanlines: probe.scanlines,
            samples: probe.sample_count(),
            rays: settings.quality.rays,
            layer_first: 0,
            layer_count: settings.quality.layers,
            line_first: 0,
            line_count: probe.scanlines,
            seed: settings.quality.seed,
            lateral_half: tables.kernels.lateral_half,
            axial_half: tables.kernels.axial_half,
            map_rays: tables.map_ray_count,
            row_words: image.width.div_ceil(4),
            sample_spacing_mm: probe.sample_spacing_mm() as f32,
            depth_mm: probe.depth_mm as f32,
            phase_turns_per_mm: probe.phase_turns_per_mm() as f32,
            aperture_mm: probe.aperture_mm as f32,
            reach_mm: 0.0,
            tgc_db_per_mm: (image.tgc_db_per_cm / 10.0) as f32,
            face_radius_mm: probe.face_radius_mm().map_or(-1.0, |r| r as f32),
            background: outside.background,
            row_samples: probe.sample_count().div_ceil(ROW_ALIGN) * ROW_ALIGN,
            hint_words: probe.sample_count().div_ceil(4 * HINT_BLOCK) + 1,
            map_depths: tables.map_depths,
            map_step_mm: tables.map_step_mm as f32,
            sector_words: tables.sector_words.len() as u32,
            reflections_max: settings.reflections_max,
            layers: settings.quality.layers,
            axial_paths: if has_axial_paths { probe.scanlines } else { 0 },
            sheet_families: 0,
            sheet_spacing_mm: tables.sheets.as_ref().map_or(0.0, |sheets| sheets.spacing_mm as f32),
            beyond: if contact { outside.air } else { outside.background },
            film_mm: if contact { settings.contact.gel_mm as f32 } else { -1.0 },
            noise: amplitude(Effect::Noise, white_amplitude(receiver.noise_db, &tables.kernels.pulse)),
            clutter: level(Effect::Clutter, receiver.clutter_db),
            reverberation: level(Effect::Contact, receiver.reverberation_db),
            near_samples: tables.near_field.as_ref().map_or(0, |near| near.samples),
            noise_seed: 0,
            steer: [1.0, 0.0],
            angle_words: 0,
            steer_shift_mm: 0.0,
            line_turns: line_turns(probe),
            reflecting_paths: settings.reflecting_paths(),
            levels_per_sample: if tables.kernels.delays.is_empty() { 1 } else { 2 },
            face_reflection: level(Effect::Multiples, receiver.face_reflection_db),
            unused: [0; 3],
            sheets: bytemuck::Zeroable::zeroed(),
            image: image.into(),
            tail: [0; TAIL],
        }
    }

    /// Steers the scanlines by the steering angle with index `angle`.
    pub(crate) fn set_angle(&mut self, tables: &Tables, angle: usize) {
        let steer_rad = tables.angles.get(angle).map_or(0.0, |angle| angle.steer_rad);
        self.steer = [steer_rad.cos() as f32, steer_rad.sin() as f32];
        // Steered scanlines of a curved face turn about its centre of curvature, so the shift at the face holds at all
        // depths.
        self.steer_shift_mm = (tables.face_spacing_mm * steer_rad.sin()) as f32;
        // The pixel positions of the straight scanlines come first.
        let steered = tables.angles.get(angle).is_some_and(|angle| !angle.pixels.is_empty());
        self.angle_words = if steered { (angle as u32 + 1) * self.sector_words } else { 0 };
    }

    /// Elevational offsets of this angle's paths, a part of the table of all angles.
    pub(crate) fn elevations_of<'a>(&self, elevations: &'a [[f32; 4]]) -> &'a [[f32; 4]] {
        let count = (self.layers * self.rays) as usize;
        let angle = (self.angle_words / self.sector_words.max(1)) as usize;
        elevations.get(angle * count..(angle + 1) * count).unwrap_or_default()
    }

    /// Turns a direction of the probe frame by the steering angle.
    #[inline(always)]
    pub(crate) fn steered(&self, v: Vec3) -> Vec3 {
        let [cos, sin] = self.steer;
        Vec3::new(v.x * cos + v.z * sin, v.y, v.z * cos - v.x * sin)
    }

    /// Fraction of a phased array's aperture, projected on a scanline: the cosine of the scanline's angle to the
    /// normal. 1 for other arrays.
    #[inline(always)]
    pub(crate) fn projection(&self, line: usize) -> f32 {
        if self.line_turns == 0.0 {
            return 1.0;
        }
        let turns = self.line_turns * (line as f32 + 0.5 - 0.5 * self.scanlines as f32);
        at_least(phasor(turns)[0], PROJECTION_MIN as f32)
    }

    /// Tissue outside all surfaces, at a depth below the apex of the face: `background` within the film of gel, else
    /// `beyond`.
    #[inline(always)]
    pub(crate) fn outside(&self, depth_mm: f32) -> u32 {
        if depth_mm > self.film_mm { self.beyond } else { self.background }
    }

    /// Number of grey levels per row in memory.
    #[inline(always)]
    pub(crate) fn row_levels(&self) -> u32 {
        self.row_samples.wrapping_mul(self.levels_per_sample)
    }

    /// Whether the receiver adds noise, clutter or reverberation to the lines.
    pub(crate) fn receives(&self) -> bool {
        self.near_samples > 0 || self.noise > 0.0
    }

    /// Fraction of the beam in each path that carries echoes.
    pub(crate) fn path_weight(&self) -> f32 {
        1.0 / (self.rays * self.layers) as f32
    }

    /// Two amplitude weights of an echo, for a path that carries the fraction `part` of the beam. The first weight is for
    /// echoes that add in phase over the paths, the second for echoes that add in power.
    pub(crate) fn echo_weights(part: f32) -> [f32; 2] {
        [part, (part * (CELLS_OF_A_BEAM as f32 * part).min(1.0)).sqrt()]
    }

    /// Fraction of the beam that a path stands for once it has reflected.
    pub(crate) fn reflected_weight(&self) -> f32 {
        1.0 / self.reflecting_paths as f32
    }

    /// Whether a path follows reflections. The paths that follow reflections are spread evenly over the rays and layers
    /// of a scanline. From scanline to scanline, they shift by the golden ratio.
    pub(crate) fn follows_reflections(&self, line_ray: u32, layer: u32) -> bool {
        let paths = self.rays * self.layers;
        let (line, in_line) = (line_ray / self.rays, layer * self.rays + line_ray % self.rays);
        let shift = ((line.wrapping_add(self.seed).wrapping_mul(KRONECKER[0]) >> 16) * paths) >> 16;
        (in_line * self.reflecting_paths + shift) % paths < self.reflecting_paths
    }

    /// Number of paths of this batch that carry echoes.
    fn sounding_paths(&self) -> u32 {
        self.line_count * self.rays * self.layer_count
    }

    /// Whether each scanline has a single path that carries echoes.
    pub(crate) fn single(&self) -> bool {
        self.rays * self.layers == 1
    }

    /// Index, in this batch, of the axial path of scanline `line`; its only path if there are no axial paths.
    pub(crate) fn axial_path_of(&self, line: u32) -> u32 {
        if self.axial_paths == 0 { line } else { self.sounding_paths() + line }
    }

    /// Number of paths of this batch: paths that carry echoes, then the axial paths.
    pub(crate) fn paths(&self) -> u32 {
        self.sounding_paths() + self.axial_paths
    }

    /// Centre of the probe's face, relative to the tree's centre, mm.
    pub(crate) fn face_mm(&self) -> Vec3 {
        Vec3::new(self.lateral[3], self.elevational[3], self.axial[3])
    }

    /// Turns a vector of the probe frame into the scene frame.
    pub(crate) fn scene_vector(&self, v: Vec3) -> Vec3 {
        let axis = |[x, y, z, _]: [f32; 4]| Vec3::new(x, y, z);
        axis(self.lateral) * v.x + axis(self.elevational) * v.y + axis(self.axial) * v.z
    }

    /// Sets the probe's pose, and the families of scatterer sheets that its slice meets.
    pub(crate) fn set_pose(&mut self, pose: &Pose, bvh: &Bvh, probe: &Probe) {
        let origin = pose.position_mm - bvh.drift_mm() - bvh.centre_mm;
        let column = |axis: DVec3, translation: f64| {
            let v = pose.transform_vector(axis);
            [v.x as f32, v.y as f32, v.z as f32, translation as f32]
        };
        self.lateral = column(DVec3::X, origin.x);
        self.elevational = column(DVec3::Y, origin.y);
        self.axial = column(DVec3::Z, origin.z);
        let mut families = 0;
        if self.sheet_spacing_mm > 0.0 {
            let elevational = pose.transform_vector(DVec3::Y);
            let cells = SheetCells::new(probe);
            for (slot, family) in self.sheets.iter_mut().zip(super::sheets::families(elevational)) {
                *slot = SheetFamily::new(&family, elevational, cells);
                families += 1;
            }
        }
        self.sheet_families = families;
        // Longer than any line from the face backwards through the whole scene.
        let face = probe.half_extent().max(1.0) * probe.face_radius_mm().unwrap_or(1.0).max(1.0);
        self.reach_mm = (origin.length() + 2.0 * bvh.radius_mm + face + probe.elevational_height_mm) as f32;
    }
}
