//! Inputs of a frame's passes: pose, probe, scene and settings as uploaded to the device, widened to f64.

use glam::{DMat3, DVec2, DVec3, Vec3, Vec4};
use insonify_core::anatomy::bvh::PackedTriangle;
use insonify_core::settings::{Effect, EffectSet, ImageUniforms};

use super::aperture::Aperture;
use super::medium::Medium;
use super::motion::Motion;
use super::needle_table::Needle;
use crate::constants::{DEPTH_BLOCK, KRONECKER, MOVES, PROJECTION_MIN, PULSE_PAD, TISSUE_MASK};
use crate::params::Params;
use crate::tables::{Tables, unpack_place};
use crate::texture::PackedTexture;

/// Ray in the probe frame, where its direction's projection on the scan plane has length 1, or in the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Origin on the probe face, mm.
    pub origin_mm: DVec3,
    /// Direction.
    pub direction: DVec3,
}

/// Elevational position of a path: a straight line from the face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Elevation {
    /// Elevational offset at the face, mm.
    pub offset_mm: f64,
    /// Elevational offset per mm of ray in the scan plane.
    pub slope: f64,
    /// Length of the path per mm of ray in the scan plane.
    pub stretch: f64,
}

/// A triangle of the scene, relative to the centre of the tree of bounding boxes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Triangle {
    /// First corner, mm.
    pub corner_mm: DVec3,
    /// Second corner minus the first, mm.
    pub edge1_mm: DVec3,
    /// Third corner minus the first, mm.
    pub edge2_mm: DVec3,
    /// Tolerance of the edge functions per mm of distance, mm: longest edge × `EDGE_TOLERANCE_PER_MM`.
    pub tolerance: f64,
    /// Index of the triangle's surface. Where surfaces overlap, the highest index is the medium.
    pub surface: u32,
    /// Index of the triangle in the scene.
    pub index: u32,
    /// Displacement from the rest position, mm.
    pub displacement_mm: DVec3,
}

/// A family of parallel sheets that hold scatterers, relative to the slice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SheetFamily {
    /// Unit normal of the sheets, and the two axes of their cells.
    pub axes: [DVec3; 3],
    /// Distance along the elevational axis per mm along the normal.
    pub oblique: f64,
    /// Change of the coordinates along the two cell axes per mm along the normal, on an elevational line.
    pub drift: DVec2,
    /// Amplitude weight of the family; the squares of all weights sum to 1.
    pub share: f64,
    /// Number added to each sheet's index before hashing.
    pub salt: u32,
    /// Side of a cell, mm.
    pub cell_mm: f64,
    /// Number of scatterers in a cell, 1 to 4.
    pub cell_scatterers: u32,
}

/// Everything that the passes of one frame read.
///
/// Scene coordinates are relative to the tree's centre, mm.
#[derive(Debug, Clone, PartialEq)]
pub struct Inputs {
    /// Rotation from the probe frame.
    pub scene_from_probe: DMat3,
    /// Centre of the probe's face, mm.
    pub probe_mm: DVec3,
    /// Number of scanlines.
    pub scanlines: usize,
    /// Samples per scanline. Sample j is at range (j + ½)·spacing.
    pub samples: usize,
    /// Spacing of samples, mm of range.
    pub sample_spacing_mm: f64,
    /// Deepest range, mm.
    pub depth_mm: f64,
    /// Turns of the baseband's phase per mm of range: 2f/c₀.
    pub phase_turns_per_mm: f64,
    /// Rays per scanline and layer.
    pub rays_per_line: usize,
    /// Greatest number of reflections of a path.
    pub reflections_max: u32,
    /// Number of paths of each scanline that follow reflections.
    pub reflecting_paths: usize,
    /// Seed of every random choice.
    pub seed: u32,
    /// Whether interfaces echo.
    pub interface_echoes: bool,
    /// Whether paths reflect.
    pub reflections: bool,
    /// Whether beams and reflected paths are refracted.
    pub refraction: bool,
    /// Range by which the wavefront of a steered frame falls behind from one scanline to the next, mm.
    pub steer_shift_mm: f64,
    /// Angle between neighbouring scanlines of a phased array, radians; 0 for other arrays.
    pub line_angle_rad: f64,
    /// Widest active aperture, mm.
    pub aperture_mm: f64,
    /// Distance from the face at which a ray has left the whole scene, mm.
    pub reach_mm: f64,
    /// Rays of a layer [scanlines × rays_per_line].
    pub rays: Vec<Ray>,
    /// Axis of each scanline, the first ray of its axial path.
    pub axes: Vec<Ray>,
    /// Number of layers, the elevational parts of the beam.
    pub layers: usize,
    /// Elevational position of each path of a scanline [layers × rays_per_line].
    pub elevations: Vec<Elevation>,
    /// Number of axial paths, which set where the scatterers lie: one per scanline, or 0 if the frame needs none. They
    /// are stored after the paths of all layers.
    pub axial_paths: usize,
    /// Triangles of the scene.
    pub triangles: Vec<Triangle>,
    /// Moving parts of the scene; `None` if nothing moves.
    pub motion: Option<Motion>,
    /// Index of each surface's tissue.
    pub surface_tissue: Vec<usize>,
    /// Whether each surface moves.
    pub surface_moves: Vec<bool>,
    /// Tissues.
    pub media: Vec<Medium>,
    /// Index of the tissue outside of all surfaces.
    pub background: usize,
    /// Index of the tissue outside of all surfaces beyond the film of gel.
    pub beyond: usize,
    /// Thickness of the film of gel, mm; `None` if the whole face is coupled.
    pub film_mm: Option<f64>,
    /// Number of samples per scanline in `near_field`.
    pub near_samples: usize,
    /// Reverberation and clutter of each sample near the face, complex [scanlines × near_samples].
    pub near_field: Vec<[DVec2; 2]>,
    /// Amplitude of the white noise.
    pub noise: f64,
    /// Amplitude that the face reflects, 0..=1; 0 without multiples.
    pub face_reflection: f64,
    /// Amplitude of the clutter.
    pub clutter: f64,
    /// Amplitude of the reverberation.
    pub reverberation: f64,
    /// Seed of the noise.
    pub noise_seed: u32,
    /// Families of sheets that hold the scatterers; if empty, the cells of the lattice hold them.
    pub sheets: Vec<SheetFamily>,
    /// Distance between the sheets of a family, mm.
    pub sheet_spacing_mm: f64,
    /// 1/Y for each block of `depth_block` samples, 1/mm. Sheets within the elevational distance ±Y count.
    pub sheets_per_reach_mm: Vec<f64>,
    /// Textures; texture number n is at index n − 1.
    pub(crate) textures: Vec<PackedTexture>,
    /// Gain of the scatterers in each block of `depth_block` samples. With it, their speckle has the power of one
    /// scatterer.
    pub scatterer_gain: Vec<f64>,
    /// Lateral kernel of each block of `depth_block` samples: weights of the scanlines from −half to +half.
    pub lateral_kernels: Vec<Vec<f64>>,
    /// Number of samples that share a lateral kernel and a gain.
    pub depth_block: usize,
    /// Envelope of the pulse, from −half to +half samples, 1 at its peak.
    pub pulse: Vec<f64>,
    /// Weights of an echo on the four samples around it, at even steps from one sample to the next; empty if an echo lies
    /// at the nearest sample.
    pub delays: Vec<[f64; 4]>,
    /// The pulse's weights of the same samples, half a sample later; empty if the envelope is detected at the samples
    /// alone.
    pub midway: Vec<f64>,
    /// Time-gain compensation, dB per mm of range.
    pub tgc_db_per_mm: f64,
    /// Settings of the image.
    pub image: ImageUniforms,
    /// Radius of the face, mm: 0 for a phased array, `None` for a linear one.
    pub face_radius_mm: Option<f64>,
    /// Tables of the aperture; `None` if its effect is off or the probe has none.
    pub aperture: Option<Aperture>,
    /// The frame's needle; `None` without the effect `needle`.
    pub needle: Option<Needle>,
    /// Straight rays along which the maps of tissue and attenuation are computed.
    pub map_rays: Vec<Ray>,
    /// Number of depths per map ray.
    pub map_depths: usize,
    /// Distance between the depths of a map ray, mm.
    pub map_step_mm: f64,
    /// Fractional indices of the scanline and the sample at each pixel's centre [height × width]; `None` outside the
    /// sector.
    pub pixels: Vec<Option<[f64; 2]>>,
    /// Like `pixels`, for the maps, whose rays are not steered.
    pub map_pixels: Vec<Option<[f64; 2]>>,
}

impl Inputs {
    pub(crate) fn new(
        params: &Params,
        tables: &Tables,
        surface_words: &[u32],
        (triangles, displacements): (&[PackedTriangle], &[[f32; 4]]),
        effects: EffectSet,
        angle: usize,
    ) -> Self {
        let vector = |v: [f32; 4]| Vec4::from(v).truncate().as_dvec3();
        let rays = |table: &[[f32; 4]]| {
            table.chunks_exact(2).map(|r| Ray { origin_mm: vector(r[0]), direction: vector(r[1]) }).collect::<Vec<_>>()
        };
        let wide = |values: &[f32]| values.iter().map(|&v| f64::from(v)).collect::<Vec<_>>();
        let kernels = &tables.kernels;
        let steer = DMat3::from_rotation_y(f64::from(params.steer[1]).atan2(params.steer[0].into()));
        let mut line_rays = rays(&tables.rays);
        line_rays.iter_mut().for_each(|ray: &mut Ray| ray.direction = steer * ray.direction);
        let axes = line_rays.split_off((params.scanlines * params.rays) as usize);
        let elevation = |e: &[f32; 4]| Elevation { offset_mm: e[0].into(), slope: e[1].into(), stretch: e[2].into() };
        let displaced = displacements.iter().copied().chain(std::iter::repeat([0.0; 4]));
        let triangles = triangles.iter().zip(displaced).map(|(t, displacement)| Triangle {
            corner_mm: Vec3::from(t.corner).as_dvec3(),
            edge1_mm: Vec3::from(t.edge1).as_dvec3(),
            edge2_mm: Vec3::from(t.edge2).as_dvec3(),
            tolerance: t.tolerance.into(),
            surface: t.surface,
            index: t.triangle,
            displacement_mm: vector(displacement),
        });
        let family = |f: &crate::params::SheetFamily| SheetFamily {
            axes: [f.normal, f.first, f.second].map(vector),
            oblique: f.normal[3].into(),
            drift: DVec2::new(f.first[3].into(), f.second[3].into()),
            share: f.share.into(),
            salt: f.salt,
            cell_mm: f.cell_mm.into(),
            cell_scatterers: f.cell_scatterers,
        };
        let pair =
            |[a, b, c, d]: &[f32; 4]| [DVec2::new((*a).into(), (*b).into()), DVec2::new((*c).into(), (*d).into())];
        let taps = |padded: &[f32]| wide(&padded[PULSE_PAD as usize..padded.len() - PULSE_PAD as usize]);
        let stride = 4 * params.row_words as usize;
        let position = |&word: &u32| {
            let [across, depth] = unpack_place(word)?;
            Some([across * f64::from(params.scanlines) - 0.5, depth * f64::from(params.samples) - 0.5])
        };
        let positions = |pixels: &[u32]| -> Vec<Option<[f64; 2]>> {
            pixels
                .chunks_exact(stride)
                .flat_map(|row| row[..params.image.width as usize].iter().map(position))
                .collect()
        };
        let steered = tables.angles.get(angle).map(|angle| &angle.pixels[..]).filter(|pixels| !pixels.is_empty());
        Self {
            scene_from_probe: DMat3::from_cols(
                vector(params.lateral),
                vector(params.elevational),
                vector(params.axial),
            ),
            probe_mm: DVec3::new(params.lateral[3].into(), params.elevational[3].into(), params.axial[3].into()),
            scanlines: params.scanlines as usize,
            samples: params.samples as usize,
            sample_spacing_mm: params.sample_spacing_mm.into(),
            depth_mm: params.depth_mm.into(),
            phase_turns_per_mm: params.phase_turns_per_mm.into(),
            rays_per_line: params.rays as usize,
            reflections_max: params.reflections_max,
            reflecting_paths: params.reflecting_paths as usize,
            seed: params.seed,
            interface_echoes: effects.has(Effect::InterfaceEchoes),
            reflections: effects.has(Effect::Reflections),
            refraction: effects.has(Effect::Refraction),
            steer_shift_mm: params.steer_shift_mm.into(),
            line_angle_rad: std::f64::consts::TAU * f64::from(params.line_turns),
            aperture_mm: params.aperture_mm.into(),
            reach_mm: params.reach_mm.into(),
            rays: line_rays,
            axes,
            layers: params.layers as usize,
            elevations: params.elevations_of(&tables.elevations).iter().map(elevation).collect(),
            axial_paths: params.axial_paths as usize,
            triangles: triangles.collect(),
            motion: None,
            surface_tissue: surface_words.iter().map(|&w| (w & TISSUE_MASK) as usize).collect(),
            surface_moves: surface_words.iter().map(|&w| w & MOVES != 0).collect(),
            media: tables.tissues.iter().map(Medium::from).collect(),
            background: params.background as usize,
            beyond: params.beyond as usize,
            film_mm: (params.film_mm >= 0.0).then_some(params.film_mm.into()),
            near_samples: params.near_samples as usize,
            near_field: tables.near_field.as_ref().map_or_else(Vec::new, |near| near.values.iter().map(pair).collect()),
            noise: params.noise.into(),
            face_reflection: params.face_reflection.into(),
            clutter: params.clutter.into(),
            reverberation: params.reverberation.into(),
            noise_seed: params.noise_seed,
            sheets: params.sheets[..params.sheet_families as usize].iter().map(family).collect(),
            sheet_spacing_mm: params.sheet_spacing_mm.into(),
            sheets_per_reach_mm: tables.sheets.as_ref().map_or_else(Vec::new, |sheets| wide(&sheets.per_reach_mm)),
            textures: tables.textures.clone(),
            scatterer_gain: wide(&kernels.scatterer_gain),
            lateral_kernels: kernels.lateral.chunks_exact(2 * kernels.lateral_half as usize + 1).map(wide).collect(),
            depth_block: DEPTH_BLOCK as usize,
            pulse: taps(&kernels.pulse),
            delays: kernels.delays.iter().map(|weights| weights.map(f64::from)).collect(),
            midway: if params.levels_per_sample == 2 { taps(&kernels.midway) } else { Vec::new() },
            tgc_db_per_mm: params.tgc_db_per_mm.into(),
            image: params.image,
            face_radius_mm: (params.face_radius_mm >= 0.0).then_some(params.face_radius_mm.into()),
            aperture: tables.aperture.as_ref().map(|tables| Aperture::new(tables, params.samples)),
            needle: None,
            map_rays: rays(&tables.map_rays),
            map_depths: params.map_depths as usize,
            map_step_mm: params.map_step_mm.into(),
            pixels: positions(steered.unwrap_or(&tables.pixels)),
            map_pixels: positions(&tables.pixels),
        }
    }

    /// Projection of a phased array's aperture on a scanline, over the full width; 1 for other arrays.
    pub fn projection(&self, line: usize) -> f64 {
        let angle_rad = self.line_angle_rad * (line as f64 + 0.5 - 0.5 * self.scanlines as f64);
        angle_rad.cos().max(PROJECTION_MIN)
    }

    /// Grey levels of each sample: 1, or 2 if one lies midway to the next sample.
    pub fn levels_per_sample(&self) -> usize {
        if self.midway.is_empty() { 1 } else { 2 }
    }

    /// Number of paths of a frame that carry echoes. In their order, rays vary fastest, then scanlines, then layers.
    pub fn sounding(&self) -> usize {
        self.rays.len() * self.layers
    }

    /// Number of blocks of samples in a scanline; a block shares a lateral kernel and a gain.
    pub fn blocks(&self) -> usize {
        self.samples.div_ceil(self.depth_block)
    }

    /// Index of the path of a scanline that sets where its scatterers lie: its axial path, or its only path.
    pub fn axial_path_of(&self, line: usize) -> usize {
        if self.axial_paths == 0 { line } else { self.sounding() + line }
    }

    /// Number of paths of a frame: paths that carry echoes, then the axial paths.
    pub fn paths(&self) -> usize {
        self.sounding() + self.axial_paths
    }

    /// Fraction of the beam's energy in each path that carries echoes.
    pub fn path_weight(&self) -> f64 {
        1.0 / (self.rays_per_line * self.layers) as f64
    }

    /// Fraction of the beam's energy in a path that has reflected: it stands for the paths that follow no reflections.
    pub fn reflected_weight(&self) -> f64 {
        1.0 / self.reflecting_paths as f64
    }

    /// Whether a path follows reflections. All axial paths do. The other paths that follow reflections are spread evenly
    /// over the rays and layers of a scanline. From scanline to scanline, they shift by the golden ratio.
    pub fn follows_reflections(&self, path: usize) -> bool {
        if path >= self.sounding() {
            return true;
        }
        let (layer, line_ray) = (path / self.rays.len(), path % self.rays.len());
        let (line, ray) = (line_ray / self.rays_per_line, line_ray % self.rays_per_line);
        let paths = self.rays_per_line * self.layers;
        let golden = (line as u32).wrapping_add(self.seed).wrapping_mul(KRONECKER[0]);
        let shift = (f64::from(golden >> 16) / 65536.0 * paths as f64) as usize;
        // The n-th of N = reflecting_paths begins where (index · N + shift) passes a multiple of the number of paths.
        ((layer * self.rays_per_line + ray) * self.reflecting_paths + shift) % paths < self.reflecting_paths
    }

    /// Elevational position of a path. An axial path is in the scan plane.
    pub fn elevation_of(&self, path: usize) -> Elevation {
        let image_plane = Elevation { offset_mm: 0.0, slope: 0.0, stretch: 1.0 };
        let across = path / self.rays.len() * self.rays_per_line + path % self.rays_per_line;
        if path < self.sounding() { self.elevations[across] } else { image_plane }
    }

    /// Range of a sample, mm.
    pub fn range_mm(&self, sample: usize) -> f64 {
        (sample as f64 + 0.5) * self.sample_spacing_mm
    }

    /// Depth of the scene position `here_mm` below the apex of the face, mm.
    pub fn below_face_mm(&self, here_mm: DVec3) -> f64 {
        (here_mm - self.probe_mm).dot(self.scene_from_probe * DVec3::Z)
    }

    /// Scene ray of a probe-frame ray; its direction has length 1.
    pub fn in_scene(&self, ray: &Ray) -> Ray {
        Ray {
            origin_mm: self.probe_mm + self.scene_from_probe * ray.origin_mm,
            direction: (self.scene_from_probe * ray.direction).normalize(),
        }
    }

    /// First ray of a path in the scene: its scanline's ray with the path's elevational offset and slope, or the axis
    /// for an axial path.
    pub fn launch(&self, path: usize) -> Ray {
        let ray = match path.checked_sub(self.sounding()) {
            Some(line) => self.axes[line],
            None => self.rays[path % self.rays.len()],
        };
        let elevation = self.elevation_of(path);
        self.in_scene(&Ray {
            origin_mm: ray.origin_mm + DVec3::Y * elevation.offset_mm,
            direction: ray.direction + DVec3::Y * elevation.slope,
        })
    }
}
