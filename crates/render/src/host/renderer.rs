//! Renderer of frames on the host's processors.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Instant;

use insonify_core::anatomy::Bvh;
use insonify_core::settings::Effect;
use rayon::prelude::*;

use super::aperture::beams::{Beams, beams};
use super::aperture::gain::ApertureGains;
use super::aperture::profiles::{Profiles, profiles};
use super::aperture::propagate::{by_mode, first_plane, propagate};
use super::aperture::transmission::{self, Transmission, transmission};
use super::aperture::visibility::{self, Gains, visibility};
use super::buffers::{Buffers, path_outputs};
use super::constants::{ImageConstants, TraceConstants};
use super::effects::PathEffects;
use super::image::detect::detect;
use super::image::lateral::{LateralBeam, lateral};
use super::image::multiples::multiples;
use super::image::percentile::percentile;
use super::image::receive::receive;
use super::image::scan_convert::{Image, Maps, scan_convert};
use super::image::section::{self, Section, section};
use super::needle;
use super::paths::Paths;
use super::scatter::echo::{Interfaces, echo};
use super::scatter::march::{Marched, Scatterers, march};
use super::scatter::texture::Waves;
use super::trace::path;
use super::trace::traverse::Tree;
use super::trace::tree::WideNode;
use super::trace::{Follow, fastest, trace};
use crate::configuration::{Configuration, FrameInputs};
use crate::error::{BackendError, RenderError};
use crate::frame::{Contents, Frame, FrameTimes, unpad};
use crate::kept::Kept;
use crate::maker::FrameMaker;
use crate::params::Params;
use crate::snapshot::PassBuffers;
use crate::texture::waves;

/// Least number of tree nodes that one parallel task decodes.
const DECODED_TOGETHER: usize = 512;

/// Makes frames on the host's processors. A frame is finished when `submit` returns.
#[derive(Debug)]
pub(crate) struct HostRenderer {
    /// Nodes of the scene's tree, shared with other renderers until the scene moves.
    nodes: Arc<Vec<WideNode>>,
    trace: TraceConstants,
    image: ImageConstants,
    follow: Follow,
    waves: Waves,
    buffers: Buffers,
    /// Buffers of the inactive configurations, by number.
    kept: Kept<Buffers>,
    /// Finished frames that were not received yet.
    made: VecDeque<Frame>,
    /// Frame buffers free for reuse.
    spare: Vec<Frame>,
}

/// Copies of outputs that later passes overwrite.
#[derive(Debug, Default)]
struct Intermediate {
    /// Baseband before the interfaces' echoes are added.
    scattered: Vec<[f32; 2]>,
    /// Transmission of the scan plane before the needle's shadow.
    mask: Vec<[f32; 2]>,
    /// Focused baseband before the needle's echoes, before multiples, and before the receiver adds to it.
    focused: Vec<[f32; 2]>,
    with_needle: Vec<[f32; 2]>,
    with_multiples: Vec<[f32; 2]>,
}

/// Stopwatch for consecutive passes.
struct Laps<'a> {
    last: Instant,
    times: &'a mut FrameTimes,
}

impl Laps<'_> {
    fn note(&mut self, name: &'static str) {
        let now = Instant::now();
        self.times.add(name, (now - self.last).as_secs_f64() * 1e3);
        self.last = now;
    }
}

impl HostRenderer {
    /// A renderer of a scene and a configuration.
    ///
    /// # Errors
    /// Too little memory.
    pub(crate) fn new(
        FrameInputs { bvh, configuration, .. }: FrameInputs<'_>,
        trace: TraceConstants,
        image: ImageConstants,
    ) -> Result<Self, BackendError> {
        let nodes = Arc::new(bvh.nodes.par_iter().map(WideNode::decode).collect());
        let buffers = Buffers::new(configuration, &[], None)?;
        let (made, spare) = (VecDeque::new(), Vec::new());
        let waves = Waves::new(waves());
        Ok(Self { nodes, trace, image, follow: fastest(), waves, buffers, kept: Kept::default(), made, spare })
    }

    /// Renders `contents` into `frame`. If given, `kept` receives the outputs that later passes overwrite.
    fn render(
        &mut self,
        inputs: FrameInputs<'_>,
        contents: Contents,
        frame: &mut Frame,
        mut kept: Option<&mut Intermediate>,
    ) {
        frame.times.passes.clear();
        let mut laps = Laps { last: Instant::now(), times: &mut frame.times };
        let Contents { image, maps: maps_wanted } = contents;
        let (params, tables) = (&inputs.configuration.params, &inputs.configuration.tables);
        frame.overflows = 0;
        if image {
            frame.overflows = self.follow_paths(inputs, &mut laps, kept.as_deref_mut());
            let (kernels, constants) = (&tables.kernels, self.image);
            let Buffers { passes: b, again, gain, amplitudes, batches, .. } = &mut self.buffers;
            let (gains, weights, blends) = (&b.block_gains[..], &b.profiles[..], &b.blends[..]);
            let beam = LateralBeam { constants, kernels, gains, reflected: &b.reflected, weights, blends };
            lateral(params, beam, &b.baseband, amplitudes, &mut b.focused);
            laps.note("lateral");
            let last = batches.params(batches.batches - 1, params);
            let paths = Paths { starts: &b.starts, segments: &b.segments, hints: &b.hints };
            if let Some(kept) = kept.as_deref_mut() {
                kept.focused.clone_from(&b.focused);
            }
            if let Some(frame) = &inputs.configuration.needle {
                let gains = tables.aperture.as_ref().map(|tables| ApertureGains { tables, lines: &b.line_gains });
                let (aperture_gains, delays) = (gains.as_ref(), &kernels.delays[..]);
                let needle = needle::echo::Needle { frame, paths, aperture_gains, delays };
                needle::echo::needle_echo(&last, constants, needle, &mut b.focused);
                laps.note("needle_echo");
            }
            if let Some(kept) = kept.as_deref_mut() {
                kept.with_needle.clone_from(&b.focused);
            }
            if params.face_reflection > 0.0 {
                multiples(params, constants, again, &mut b.focused);
                laps.note("multiples");
            }
            if let Some(kept) = kept {
                kept.with_multiples.clone_from(&b.focused);
            }
            if params.receives() {
                let near = tables.near_field.as_ref().map_or(&[][..], |near| &near.values);
                receive(&last, constants, paths, near, &mut b.focused);
                laps.note("receive");
            }
            detect(params, constants, kernels, gain, &b.focused, &mut b.polar, &mut b.lines);
            laps.note("detect");
        }
        if maps_wanted {
            frame.overflows += self.cut_section(inputs, &mut laps);
        }

        let Buffers { passes: b, layout, steered, rates_np_mm, .. } = &self.buffers;
        let pixels = params.image.width as usize * params.image.height as usize;
        (frame.width, frame.height) = (params.image.width, params.image.height);
        frame.bmode.resize(pixels, 0);
        frame.segmentation.resize(if maps_wanted { pixels } else { 0 }, 0);
        frame.attenuation.resize(if maps_wanted { pixels } else { 0 }, 0.0);
        frame.attenuation_p98 = if maps_wanted { (-b.percentile_np).exp() } else { 0.0 };
        let into = Image {
            bmode: &mut frame.bmode,
            segmentation: &mut frame.segmentation,
            attenuation: &mut frame.attenuation,
        };
        let maps = maps_wanted.then_some(Maps {
            raster: &b.raster,
            percentile_np: b.percentile_np,
            rates_np_mm,
            constants: self.image,
        });
        let steered = steered.get(inputs.angle).and_then(Option::as_ref);
        if let (Some(steered), None) = (steered, maps) {
            scan_convert(params, &steered.layout, &b.polar, None, into);
        } else {
            // Maps are not steered, whatever the image's angle.
            scan_convert(params, &layout.layout, &b.polar, maps, into);
            if let Some(steered) = steered {
                let image = Image { bmode: &mut frame.bmode, segmentation: &mut [], attenuation: &mut [] };
                scan_convert(params, &steered.layout, &b.polar, None, image);
            }
        }
        if !image {
            frame.bmode.clear();
        }
        laps.note("scan_convert");
        if let (Some(needle), true) = (&inputs.configuration.needle, maps_wanted) {
            needle::map::needle_map(self.image, &needle.outline, frame.width, &mut frame.segmentation);
            laps.note("needle_map");
        }
        unpad(&mut frame.lines, &b.lines, params.samples as usize, params.row_samples as usize);
    }

    /// Runs the passes from `trace` to `echo`, batch by batch. Returns the number of crossings lost for lack of room.
    fn follow_paths(
        &mut self,
        inputs: FrameInputs<'_>,
        laps: &mut Laps<'_>,
        mut kept: Option<&mut Intermediate>,
    ) -> u32 {
        let FrameInputs { configuration, .. } = inputs;
        let (tables, effects) = (&configuration.tables, configuration.effects.effects());
        let batches = self.buffers.batches;
        let mut lost = 0;
        if !effects.has(Effect::Scatterers) {
            self.buffers.passes.baseband.fill([0.0; 2]);
        }
        // The aperture's gain needs the paths of all batches, so several batches are traced twice.
        if tables.aperture.is_some() {
            for batch in 0..batches.batches {
                let params = batches.params(batch, &configuration.params);
                lost += self.trace_batch(inputs, &params, laps);
                self.see_through(configuration, &params, laps, kept.as_deref_mut());
            }
        }
        for batch in 0..batches.batches {
            let params = batches.params(batch, &configuration.params);
            if tables.aperture.is_none() {
                lost += self.trace_batch(inputs, &params, laps);
            } else if batches.batches > 1 {
                self.trace_batch(inputs, &params, laps);
            }
            let Buffers { passes: b, kept_powers, .. } = &mut self.buffers;
            let paths = Paths { starts: &b.starts, segments: &b.segments, hints: &b.hints };
            let aperture_gains = tables.aperture.as_ref().map(|tables| ApertureGains { tables, lines: &b.line_gains });
            let aperture_gains = aperture_gains.as_ref();
            if effects.has(Effect::Scatterers) {
                let gain = &tables.kernels.scatterer_gain;
                let per_reach_mm = tables.sheets.as_ref().map_or(&[][..], |sheets| &sheets.per_reach_mm);
                let (textures, waves) = (&tables.textures[..], &self.waves);
                let scatterers =
                    Scatterers { constants: self.image, gain, per_reach_mm, textures, waves, aperture_gains };
                let into = Marched { baseband: &mut b.baseband, reflected: &mut b.reflected, kept: kept_powers };
                march(&params, paths, scatterers, into);
                laps.note("march");
            }
            if let Some(kept) = &mut kept {
                kept.scattered.clone_from(&b.baseband);
            }
            if effects.has(Effect::InterfaceEchoes) {
                let (echoes, segment_counts) = (&b.echoes, &b.segment_counts);
                let delays = &tables.kernels.delays;
                let interfaces = Interfaces { paths, echoes, segment_counts, aperture_gains, delays };
                echo(&params, self.image, interfaces, &mut b.baseband);
                laps.note("echo");
            }
        }
        lost
    }

    /// Traces the paths of a batch. Returns the number of crossings lost for lack of room.
    fn trace_batch(
        &mut self,
        FrameInputs { bvh, media, configuration, .. }: FrameInputs<'_>,
        params: &Params,
        laps: &mut Laps<'_>,
    ) -> u32 {
        let tables = &configuration.tables;
        let scene = path::Scene {
            tree: Tree { nodes: &self.nodes, triangles: &bvh.triangles },
            displacements: bvh.displacements(),
            surface_words: &media.surface_words,
            params,
            rays: &tables.rays,
            elevations: params.elevations_of(&tables.elevations),
            tissues: &tables.tissues,
            effects: PathEffects::new(configuration.effects.effects(), media.moving),
            constants: self.trace,
        };
        // The last batch may have fewer layers than the others.
        let paths = params.paths() as usize;
        let lost = trace(&scene, self.follow, path_outputs(&mut self.buffers.passes, paths));
        laps.note("trace");
        lost
    }

    /// Adds a batch's paths to the transmission of the scan plane. After the last batch, computes the aperture's gain
    /// along the scanlines.
    fn see_through(
        &mut self,
        configuration: &Configuration,
        params: &Params,
        laps: &mut Laps<'_>,
        kept: Option<&mut Intermediate>,
    ) {
        let Buffers { passes: b, aperture, .. } = &mut self.buffers;
        let (Some(tables), Some(work)) = (&configuration.tables.aperture, aperture) else { return };
        let paths = Paths { starts: &b.starts, segments: &b.segments, hints: &b.hints };
        let into = Transmission { means: &mut work.cell_means, mask: &mut b.mask, row_np: &mut b.row_np };
        let bends = configuration.effects.effects().has(Effect::Refraction);
        let elevations = bends.then_some(params.elevations_of(&configuration.tables.elevations));
        transmission(params, transmission::Inputs { constants: self.image, tables, paths, elevations }, into);
        laps.note("transmission");
        if params.layer_first + params.layer_count < params.layers {
            return;
        }
        if let Some(kept) = kept {
            kept.mask.clone_from(&b.mask);
        }
        if let Some(needle) = &configuration.needle {
            needle::shadow::needle_shadow(self.image, &needle.shadows, &mut b.mask);
            laps.note("needle_shadow");
        }
        let first = first_plane(self.image, tables, &b.mask);
        b.first_plane = first as u32;
        propagate(tables, &work.propagation, first, &b.mask, &mut work.mode_work, &mut b.fields);
        laps.note("propagate");
        let into = Beams { amplitudes: &mut b.amplitudes, powers: &mut b.beam_powers };
        beams(self.image, tables, &work.beam_roots, first, &b.fields, &mut work.beam_work, into);
        laps.note("beams");
        let into = Profiles { weights: &mut b.profiles, blends: &mut b.blends };
        profiles(params, tables, &configuration.tables.kernels, first, &b.amplitudes, into);
        laps.note("profiles");
        let into = Gains { lines: &mut b.line_gains, blocks: &mut b.block_gains };
        let (constants, powers, row_np) = (self.image, &b.beam_powers, &b.row_np);
        visibility(params, visibility::Inputs { constants, tables, paths, powers, row_np }, into);
        laps.note("visibility");
    }

    /// Runs the passes of the maps up to scan conversion. Returns the number of crossings and runs lost for lack of
    /// room.
    fn cut_section(&mut self, inputs: FrameInputs<'_>, laps: &mut Laps<'_>) -> u32 {
        let FrameInputs { bvh, media, configuration, .. } = inputs;
        let (params, tables) = (&configuration.params, &configuration.tables);
        let Buffers { passes: b, rates_np_mm, .. } = &mut self.buffers;
        for (rate, tissue) in rates_np_mm.iter_mut().zip(&tables.tissues) {
            *rate = self.image.one_way() * tissue.attenuation_np_mm;
        }
        let rays = section::Scene {
            tree: Tree { nodes: &self.nodes, triangles: &bvh.triangles },
            surface_words: &media.surface_words,
            map_rays: &tables.map_rays,
            rates_np_mm,
        };
        let into = Section { entries: &mut b.entries, entry_counts: &mut b.entry_counts, raster: &mut b.raster };
        let lost = section(params, rays, into);
        laps.note("section");
        b.percentile_np = percentile(params, self.image, &b.entries, &b.entry_counts);
        laps.note("percentile");
        lost
    }
}

impl FrameMaker for HostRenderer {
    fn configure(&mut self, inputs: FrameInputs<'_>) -> Result<(), RenderError> {
        let known: Vec<&Buffers> = self.kept.others().chain([&self.buffers]).collect();
        let mut next = Buffers::new(inputs.configuration, &known, Some(&self.buffers))?;
        next.take_over(&mut self.buffers);
        self.buffers = next;
        Ok(())
    }

    fn select(&mut self, number: usize, inputs: FrameInputs<'_>) -> Result<(), RenderError> {
        let new = match self.kept.has(number) {
            true => None,
            false => Some(Buffers::new(inputs.configuration, &[&self.buffers], None)?),
        };
        self.kept.swap(number, &mut self.buffers, new);
        Ok(())
    }

    fn beside(&self, inputs: FrameInputs<'_>) -> Result<Option<Box<dyn FrameMaker>>, RenderError> {
        let Self { ref nodes, trace, image, follow, ref waves, .. } = *self;
        Ok(Some(Box::new(Self {
            nodes: nodes.clone(),
            trace,
            image,
            follow,
            waves: *waves,
            buffers: Buffers::new(inputs.configuration, &[&self.buffers], None)?,
            kept: Kept::default(),
            made: VecDeque::new(),
            spare: Vec::new(),
        })))
    }

    fn take_cold(&mut self) -> bool {
        false
    }

    fn move_scene(&mut self, bvh: &mut Bvh, time_s: f64) {
        bvh.set_time_s(time_s);
        for changed in bvh.changed() {
            let moved = &bvh.nodes[changed.nodes.clone()];
            let nodes = Arc::make_mut(&mut self.nodes);
            let nodes = nodes[changed.nodes.clone()].par_iter_mut().zip(moved).with_min_len(DECODED_TOGETHER);
            nodes.for_each(|(node, words)| *node = WideNode::decode(words));
        }
    }

    fn submit(&mut self, inputs: FrameInputs<'_>, contents: Contents) -> Result<(), BackendError> {
        let mut frame = self.spare.pop().unwrap_or_default();
        self.render(inputs, contents, &mut frame, None);
        self.made.push_back(frame);
        Ok(())
    }

    fn receive(&mut self, frame: &mut Frame) -> Result<(), BackendError> {
        if let Some(mut made) = self.made.pop_front() {
            // Swaps all memory, except the mask's.
            std::mem::swap(frame, &mut made);
            std::mem::swap(&mut frame.mask, &mut made.mask);
            self.spare.push(made);
        }
        Ok(())
    }

    fn pass_buffers(&mut self, inputs: FrameInputs<'_>) -> Result<PassBuffers, RenderError> {
        if let batches @ 2.. = self.buffers.batches.batches {
            return Err(RenderError::Batches { batches });
        }
        let (mut frame, mut kept) = (Frame::default(), Intermediate::default());
        self.render(inputs, Contents { image: true, maps: true }, &mut frame, Some(&mut kept));
        let Intermediate { scattered, mask, focused, with_needle, with_multiples } = kept;
        let received = self.buffers.passes.focused.clone();
        let fields = &self.buffers.passes.fields;
        let by_mode = |tables| by_mode(tables, fields);
        Ok(PassBuffers {
            fields: inputs.configuration.tables.aperture.as_ref().map_or_else(Vec::new, by_mode),
            shaded_mask: self.buffers.passes.mask.clone(),
            mask,
            scattered,
            focused,
            with_needle,
            with_multiples,
            received,
            bmode: frame.bmode,
            segmentation: frame.segmentation,
            attenuation: frame.attenuation,
            overflows: frame.overflows,
            ..self.buffers.passes.clone()
        })
    }
}
