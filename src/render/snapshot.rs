//! What every pass of a frame read and wrote, read back from the device: to compare passes with their twins.

use glam::{DVec2, DVec3};

use super::Frame;
use super::device::gpu::{Gpu, GpuError};
use super::device::readback::Contents;
use super::host::HostWork;
use super::renderer::{RenderError, Renderer};
use super::tables::{ENTRIES, SEGMENTS, STARTS};
use super::twin::{Inputs, Membership, Path, RasterPoint, Run, Sections, Segment};
use crate::pose::Pose;

/// Low bits of a word that carries a small integer.
const TAG_TISSUE: u32 = 0xffff;
const TAG_DENSITY: u32 = 0x3ffff;

/// Inputs and outputs of every pass of one frame, as typed values in f64.
#[derive(Debug, Clone, PartialEq)]
pub struct Snapshot {
    /// What the passes read beside each other's outputs.
    pub inputs: Inputs,
    /// `locate`: the surfaces that each path starts inside `[paths]`.
    pub starts_inside: Vec<Membership>,
    /// `trace`: the paths `[paths]`.
    pub paths: Vec<Path>,
    /// `trace`: the segment that holds the first sample of each block of `hint_block` [paths × blocks].
    pub hints: Vec<u8>,
    /// Samples that share a hint.
    pub hint_block: usize,
    /// `march`: baseband of the scatterers [scanlines × samples].
    pub scattered: Vec<DVec2>,
    /// `echo`: the same with the interfaces' echoes.
    pub baseband: Vec<DVec2>,
    /// `lateral`: baseband after the beam.
    pub focused: Vec<DVec2>,
    /// `detect`: baseband after the pulse; empty unless the settings ask for lines.
    pub lines: Vec<DVec2>,
    /// `detect`: grey levels [scanlines × samples].
    pub grey: Vec<f64>,
    /// `section`: what the map rays cross.
    pub sections: Sections,
    /// `percentile`: Σμ of the attenuation's 98th percentile, nepers.
    pub percentile_np: f64,
    /// `scan_convert`: grey levels [height × width].
    pub bmode: Vec<u8>,
    /// `scan_convert`: tissue numbers [height × width].
    pub segmentation: Vec<u8>,
    /// `scan_convert`: attenuation over its percentile [height × width].
    pub attenuation: Vec<f64>,
    /// Crossings and segments beyond what the buffers hold.
    pub overflows: u32,
}

impl Renderer {
    /// Renders a frame with its maps, whatever the settings say, and reads every intermediate buffer back. Slow: for tests
    /// and study.
    ///
    /// # Errors
    /// Frames in flight, settings whose layers don't fit in one batch, or a device that fails.
    pub fn snapshot(&mut self, pose: &Pose) -> Result<Snapshot, RenderError> {
        if self.frames_in_flight() > 0 {
            return Err(RenderError::RingFull);
        }
        if self.now.plan.batches != 1 {
            return Err(RenderError::Batches { batches: self.now.plan.batches });
        }
        self.place(pose);
        let words = if self.now.host_frame.is_some() { self.host_words() } else { self.device_words()? };
        let now = &self.now;
        let lost = |reason: String| RenderError::Gpu(GpuError::Lost { reason });
        let [
            scattered,
            starts_inside,
            starts,
            segments,
            echoes,
            counts,
            hints,
            baseband,
            focused,
            lines,
            polar,
            entries,
            entry_counts,
            raster,
            percentile,
            bmode,
            segmentation,
            attenuation,
            overflows,
        ] = &words[..]
        else {
            return Err(lost("a buffer was not read back".to_owned()));
        };

        let inputs = Inputs::new(&now.params, &now.tables, &self.media.surface_words, &self.bvh, now.effects.effects());
        let rows = (now.params.samples as usize, now.params.row_samples as usize);
        let complex = |words: &[u32]| {
            let row =
                |row: &[u32]| row[..2 * rows.0].chunks_exact(2).map(|c| DVec2::new(real(c[0]), real(c[1]))).collect();
            words.chunks_exact(2 * rows.1).flat_map(|r| -> Vec<DVec2> { row(r) }).collect::<Vec<_>>()
        };
        let paths = (0..inputs.paths()).map(|path| path_from(path, counts[path], starts, segments, echoes)).collect();
        let runs = entry_counts[..inputs.map_rays.len()]
            .iter()
            .enumerate()
            .map(|(ray, &count)| {
                let first = ray * 4 * ENTRIES as usize;
                entries[first..first + 4 * count as usize].chunks_exact(4).map(run_from).collect()
            })
            .collect();
        let raster = raster[..inputs.map_rays.len() * inputs.map_depths]
            .iter()
            .map(|word| RasterPoint { sum_np: real((word & 0xffff_fe00) >> 1), tissue: (word & 0xff) as usize })
            .collect();
        let (width, stride) = (inputs.width, 4 * now.params.row_words as usize);
        let cropped = |bytes: &[u8]| bytes.chunks_exact(stride).flat_map(|r| r[..width].to_vec()).collect::<Vec<_>>();
        Ok(Snapshot {
            starts_inside: starts_inside
                .chunks_exact(8)
                .map(|w| Membership([w[0], w[1], w[2], w[3], w[4], w[5], w[6], w[7]]))
                .collect(),
            paths,
            hints: hints.iter().flat_map(|word| word.to_le_bytes()).collect(),
            hint_block: super::tables::HINT_BLOCK as usize,
            scattered: complex(scattered),
            baseband: complex(baseband),
            focused: complex(focused),
            lines: if lines.len() >= focused.len() { complex(lines) } else { Vec::new() },
            grey: polar
                .chunks_exact(rows.1)
                .flat_map(|row| row[..rows.0].iter().map(|&w| f64::from(w & 0xffff) / 257.0))
                .collect(),
            sections: Sections { runs, raster },
            percentile_np: real(percentile[0]),
            bmode: cropped(bytemuck::cast_slice(bmode)),
            segmentation: cropped(bytemuck::cast_slice(segmentation)),
            attenuation: attenuation
                .chunks_exact(stride)
                .flat_map(|row| row[..width].iter().map(|&w| real(w)))
                .collect(),
            overflows: overflows[0],
            inputs,
        })
    }

    /// What every pass wrote on the device.
    fn device_words(&mut self) -> Result<Vec<Vec<u32>>, RenderError> {
        let label = wgpu::CommandEncoderDescriptor { label: Some("snapshot") };
        let mut encoder = self.gpu.device.create_command_encoder(&label);
        encoder.clear_buffer(&self.now.buffers.overflows, 0, None);
        self.trace_on_host(0, &mut encoder, &mut HostWork::default())?;
        let (now, buffers) = (&self.now, &self.now.buffers);
        now.clear_unwritten(&mut encoder);
        // The echoes are added in place: the scatterers alone are kept on the way.
        let mut scattered = None;
        for pass in now.path_passes.iter().chain(&now.image_passes) {
            if scattered.is_none() && ["echo", "lateral"].contains(&pass.name) {
                scattered = Some(Staged::new(&self.gpu, &mut encoder, &buffers.baseband));
            }
            {
                let mut compute = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                    label: Some(pass.name),
                    timestamp_writes: None,
                });
                pass.record(&mut compute, 0);
            }
        }
        let wanted = [
            &buffers.starts_inside,
            &buffers.starts,
            &buffers.segments,
            &buffers.echoes,
            &buffers.segment_counts,
            &buffers.hints,
            &buffers.baseband,
            &buffers.focused,
            &buffers.lines,
            &buffers.polar,
            &buffers.entries,
            &buffers.entry_counts,
            &buffers.raster,
            &buffers.percentile,
            &buffers.bmode,
            &buffers.segmentation,
            &buffers.attenuation,
            &buffers.overflows,
        ];
        let staged = wanted.map(|buffer| Staged::new(&self.gpu, &mut encoder, buffer));
        let submission = self.gpu.queue.submit([encoder.finish()]);
        self.now.submitted(&submission);
        for one in staged.iter().chain(&scattered) {
            // A failed map shows when the range is asked for.
            one.0.slice(..).map_async(wgpu::MapMode::Read, |_| {});
        }
        let lost = |reason: String| RenderError::Gpu(GpuError::Lost { reason });
        let wait = wgpu::PollType::Wait { submission_index: Some(submission), timeout: None };
        self.gpu.device.poll(wait).map_err(|e| lost(e.to_string()))?;
        let scattered = scattered.map_or(Ok(Vec::new()), |s| s.words())?;
        let mut words = vec![scattered];
        for one in &staged {
            words.push(one.words()?);
        }
        Ok(words)
    }

    /// What every pass wrote on the host.
    fn host_words(&mut self) -> Vec<Vec<u32>> {
        let (mut frame, mut scattered) = (Frame::default(), Vec::new());
        self.make_on_host(Contents { image: true, maps: true }, &mut frame, Some(&mut scattered));
        let Some(made) = &self.now.host_frame else { return Vec::new() };
        let (width, stride) = (frame.width as usize, 4 * self.now.params.row_words as usize);
        let padded = |bytes: &[u8]| words_of(&padded(bytes, width, stride));
        vec![
            words_of(&scattered),
            words_of(&made.starts_inside),
            words_of(&made.starts),
            words_of(&made.segments),
            words_of(&made.echoes),
            made.segment_counts.clone(),
            made.hints.clone(),
            words_of(&made.baseband),
            words_of(&made.focused),
            words_of(&made.lines),
            made.polar.clone(),
            words_of(&made.entries),
            made.entry_counts.clone(),
            made.raster.clone(),
            vec![made.percentile_np.to_bits()],
            padded(&frame.bmode),
            padded(&frame.segmentation),
            words_of(&self::padded(&frame.attenuation, width, stride)),
            vec![frame.overflows],
        ]
    }
}

/// Rows of `width` in rows of `stride`.
fn padded<T: Copy + Default>(from: &[T], width: usize, stride: usize) -> Vec<T> {
    let zeros = || std::iter::repeat_n(T::default(), stride - width);
    from.chunks_exact(width).flat_map(|row| row.iter().copied().chain(zeros())).collect()
}

fn words_of<T: bytemuck::NoUninit>(values: &[T]) -> Vec<u32> {
    let bytes: &[u8] = bytemuck::cast_slice(values);
    bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
}

/// A copy of a buffer that the CPU may read once the device has run.
struct Staged(wgpu::Buffer);

impl Staged {
    fn new(gpu: &Gpu, encoder: &mut wgpu::CommandEncoder, buffer: &wgpu::Buffer) -> Self {
        let copy = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("snapshot"),
            size: buffer.size(),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        encoder.copy_buffer_to_buffer(buffer, 0, &copy, 0, Some(buffer.size()));
        Self(copy)
    }

    fn words(&self) -> Result<Vec<u32>, RenderError> {
        let lost = |e: wgpu::MapRangeError| GpuError::Lost { reason: e.to_string() };
        let view = self.0.slice(..).get_mapped_range().map_err(lost)?;
        let bytes: &[u8] = &view;
        Ok(bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
    }
}

/// The f32 of a word.
fn real(word: u32) -> f64 {
    f32::from_bits(word).into()
}

fn path_from(path: usize, count: u32, starts: &[u32], segments: &[u32], echoes: &[u32]) -> Path {
    let segment = |i: usize| {
        let slot = path * SEGMENTS as usize + i;
        let words = &segments[12 * slot..12 * (slot + 1)];
        let vector = |at: usize| DVec3::new(real(words[at]), real(words[at + 1]), real(words[at + 2]));
        Segment {
            start_mm: real(starts[path * STARTS as usize + i]),
            origin_mm: vector(0),
            step: vector(4),
            ln_amplitude_at_zero: real(words[3]),
            fall_np_mm: real(words[7]),
            scatterer_mean: real(words[8]),
            scatterer_deviation: real(words[9]),
            scatterer_density: words[10] & TAG_DENSITY,
            echo: real(echoes[2 * slot]),
            echo_range_mm: real(echoes[2 * slot + 1]),
        }
    };
    Path { segments: (0..count as usize).map(segment).collect() }
}

fn run_from(words: &[u32]) -> Run {
    Run {
        start_mm: real(words[0]),
        sum_np: real(words[1]),
        rate_np_mm: real(words[2]),
        tissue: (words[3] & TAG_TISSUE) as usize,
    }
}
