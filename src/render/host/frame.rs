//! A whole frame in the host's memory: every pass, in the device's layouts.

use std::time::Instant;

use bytemuck::Zeroable;

use super::detect::{DepthGain, detect};
use super::echo::echo;
use super::lateral::lateral;
use super::march::{Paths, Scatterers, march};
use super::percentile::percentile;
use super::scan_convert::{Image, Layout, Maps, scan_convert};
use super::section::{Scene, Section, section};
use super::staging::PathOutputs;
use super::traverse::Tree;
use super::{HostTrace, ImageConstants};
use crate::anatomy::Bvh;
use crate::render::configuration::Media;
use crate::render::device::buffers::BatchPlan;
use crate::render::device::gpu::{Gpu, GpuError};
use crate::render::device::readback::{Contents, unpad};
use crate::render::params::Params;
use crate::render::plan::{Effect, EffectSet};
use crate::render::tables::{ENTRIES, SEGMENTS, STARTS, Tables};
use crate::render::{Frame, PassTime};

/// What passes of one configuration read and write beside its tables.
#[derive(Debug)]
pub(in crate::render) struct HostFrame {
    paths: usize,
    pub(in crate::render) starts_inside: Vec<[u32; 8]>,
    pub(in crate::render) starts: Vec<f32>,
    pub(in crate::render) segments: Vec<[f32; 12]>,
    pub(in crate::render) echoes: Vec<[f32; 2]>,
    pub(in crate::render) hints: Vec<u32>,
    pub(in crate::render) segment_counts: Vec<u32>,
    pub(in crate::render) baseband: Vec<[f32; 2]>,
    pub(in crate::render) focused: Vec<[f32; 2]>,
    pub(in crate::render) polar: Vec<u32>,
    /// Empty unless they are wanted.
    pub(in crate::render) lines: Vec<[f32; 2]>,
    pub(in crate::render) entries: Vec<[f32; 4]>,
    pub(in crate::render) entry_counts: Vec<u32>,
    pub(in crate::render) raster: Vec<u32>,
    pub(in crate::render) percentile_np: f32,
    gain: DepthGain,
    layout: Layout,
    /// One-way attenuation of each tissue, nepers/mm.
    rates_np_mm: [f32; 256],
}

/// Zeros, if the device too could bind as many and the host has the memory.
fn zeros<T: Zeroable + Clone>(gpu: &Gpu, what: &'static str, count: u64) -> Result<Vec<T>, GpuError> {
    let bytes = count * size_of::<T>() as u64;
    let limits = gpu.device.limits();
    let offered = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
    let adapter = gpu.adapter_name();
    if bytes > offered {
        let limit_name = "bytes a storage buffer";
        return Err(GpuError::Limit { what, needed: bytes, limit_name, offered, adapter });
    }
    let mut memory = Vec::new();
    match memory.try_reserve_exact(count as usize) {
        Ok(()) => {
            memory.resize(count as usize, T::zeroed());
            Ok(memory)
        }
        Err(e) => Err(GpuError::Memory { what, bytes, reason: e.to_string(), adapter }),
    }
}

/// What a frame is made from, beside its buffers.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct HostScene<'a> {
    pub(in crate::render) host: &'a HostTrace,
    pub(in crate::render) media: &'a Media,
    pub(in crate::render) bvh: &'a Bvh,
    pub(in crate::render) tables: &'a Tables,
    pub(in crate::render) plan: &'a BatchPlan,
    pub(in crate::render) effects: EffectSet,
    /// Of the whole frame.
    pub(in crate::render) params: &'a Params,
}

/// Notes what each pass took.
struct Laps<'a> {
    last: Instant,
    passes: &'a mut Vec<PassTime>,
}

impl Laps<'_> {
    fn note(&mut self, name: &'static str) {
        let now = Instant::now();
        let ms = (now - self.last).as_secs_f64() * 1e3;
        self.last = now;
        match self.passes.iter_mut().find(|pass| pass.name == name) {
            Some(pass) => pass.ms += ms,
            None => self.passes.push(PassTime { name, ms }),
        }
    }
}

impl HostFrame {
    /// # Errors
    /// More memory than the device would bind, or than there is.
    pub(in crate::render) fn new(
        gpu: &Gpu,
        tables: &Tables,
        params: &Params,
        plan: &BatchPlan,
        keep_lines: bool,
    ) -> Result<Self, GpuError> {
        let paths = u64::from(params.paths(plan.layers_per_batch));
        let samples = u64::from(params.scanlines) * u64::from(params.row_samples);
        let map_rays = u64::from(params.map_rays);
        let of_paths = |count: u32| paths * u64::from(count);
        let (width, height) = (params.width, params.height);
        Ok(Self {
            paths: paths as usize,
            segments: zeros(gpu, "segments", of_paths(SEGMENTS))?,
            starts_inside: zeros(gpu, "start membership", paths)?,
            starts: zeros(gpu, "segment starts", of_paths(STARTS))?,
            echoes: zeros(gpu, "interface echoes", of_paths(SEGMENTS))?,
            hints: zeros(gpu, "segment hints", of_paths(params.hint_words))?,
            segment_counts: zeros(gpu, "segment counts", paths)?,
            baseband: zeros(gpu, "baseband", samples)?,
            focused: zeros(gpu, "focused baseband", samples)?,
            polar: zeros(gpu, "polar image", samples)?,
            lines: zeros(gpu, "lines", if keep_lines { samples } else { 0 })?,
            entries: zeros(gpu, "section", map_rays * u64::from(ENTRIES))?,
            entry_counts: zeros(gpu, "section counts", map_rays)?,
            raster: zeros(gpu, "map raster", map_rays * u64::from(params.map_depths))?,
            percentile_np: 0.0,
            gain: DepthGain::default(),
            layout: Layout::new(width, height, &tables.pixels, &tables.sector_words),
            rates_np_mm: [0.0; 256],
        })
    }

    /// Renders a frame that holds `contents`. `scattered` takes the baseband as it is before the interfaces echo.
    pub(in crate::render) fn render(
        &mut self,
        scene: HostScene<'_>,
        contents: Contents,
        frame: &mut Frame,
        scattered: Option<&mut Vec<[f32; 2]>>,
    ) {
        frame.times.passes.clear();
        let mut laps = Laps { last: Instant::now(), passes: &mut frame.times.passes };
        let Contents { image, maps } = contents;
        let HostScene { host, tables, params, .. } = scene;
        let ImageConstants { least_weight, db_a_doubling, one_way, brightest_part, first_number, .. } = host.image;
        frame.overflows = 0;
        if image {
            frame.overflows = self.follow_paths(scene, &mut laps, scattered);
            let kernels = &tables.kernels;
            lateral(params, least_weight, &kernels.lateral, &self.baseband, &mut self.focused);
            laps.note("lateral");
            let (polar, lines) = (&mut self.polar, &mut self.lines);
            detect(params, db_a_doubling, &kernels.pulse, &mut self.gain, &self.focused, polar, lines);
            laps.note("detect");
        }
        if maps {
            for (rate, tissue) in self.rates_np_mm.iter_mut().zip(&tables.tissues) {
                *rate = one_way * tissue.attenuation_np_mm;
            }
            let rays = Scene {
                tree: Tree { nodes: &host.nodes, triangles: &scene.bvh.triangles },
                surface_words: &scene.media.surface_words,
                map_rays: &tables.map_rays,
                rates_np_mm: &self.rates_np_mm,
            };
            let (entries, entry_counts, raster) = (&mut self.entries, &mut self.entry_counts, &mut self.raster);
            frame.overflows += section(params, rays, Section { entries, entry_counts, raster });
            laps.note("section");
            self.percentile_np = percentile(params, brightest_part, &self.entries, &self.entry_counts);
            laps.note("percentile");
        }

        let pixels = params.width as usize * params.height as usize;
        (frame.width, frame.height) = (params.width, params.height);
        frame.bmode.resize(pixels, 0);
        frame.segmentation.resize(if maps { pixels } else { 0 }, 0);
        frame.attenuation.resize(if maps { pixels } else { 0 }, 0.0);
        frame.attenuation_p98 = if maps { (-self.percentile_np).exp() } else { 0.0 };
        let into = Image {
            bmode: &mut frame.bmode,
            segmentation: &mut frame.segmentation,
            attenuation: &mut frame.attenuation,
        };
        let maps = maps.then_some(Maps {
            raster: &self.raster,
            percentile_np: self.percentile_np,
            rates_np_mm: &self.rates_np_mm,
            first_number,
        });
        scan_convert(params, &self.layout, &self.polar, maps, into);
        if !image {
            frame.bmode.clear();
        }
        laps.note("scan_convert");
        frame.lines.clear();
        unpad(&mut frame.lines, &self.lines, params.samples as usize, params.row_samples as usize);
    }

    /// The passes of the paths, batch by batch; how many crossings and segments found no room.
    fn follow_paths(
        &mut self,
        scene: HostScene<'_>,
        laps: &mut Laps<'_>,
        mut scattered: Option<&mut Vec<[f32; 2]>>,
    ) -> u32 {
        let HostScene { host, media, bvh, tables, plan, effects, params } = scene;
        let mut lost = 0;
        if !effects.has(Effect::Scatterers) {
            self.baseband.fill([0.0; 2]);
        }
        for batch in 0..plan.batches {
            let params = plan.params(batch, params);
            let outputs = PathOutputs::over(
                self.paths,
                [
                    bytemuck::cast_slice_mut(&mut self.segments),
                    bytemuck::cast_slice_mut(&mut self.starts),
                    bytemuck::cast_slice_mut(&mut self.echoes),
                    bytemuck::cast_slice_mut(&mut self.starts_inside),
                    bytemuck::cast_slice_mut(&mut self.hints),
                    bytemuck::cast_slice_mut(&mut self.segment_counts),
                ],
            );
            lost += host.run((media, bvh), (tables, effects), &params, outputs);
            laps.note("trace");
            if effects.has(Effect::Scatterers) {
                let paths = Paths { starts: &self.starts, segments: &self.segments, hints: &self.hints };
                let (layers, gain) = (&tables.layers, &tables.kernels.scatterer_gain);
                let scatterers = Scatterers { cell_mm: host.image.cell_mm, layers, gain };
                // `lateral` writes what is focused later.
                march(&params, paths, scatterers, &mut self.baseband, &mut self.focused);
                laps.note("march");
            }
            if let Some(scattered) = &mut scattered {
                scattered.clone_from(&self.baseband);
            }
            if effects.has(Effect::InterfaceEchoes) {
                let first = host.image.first_interface;
                echo(&params, first, &self.echoes, &self.segment_counts, &mut self.baseband);
                laps.note("echo");
            }
        }
        lost
    }
}
