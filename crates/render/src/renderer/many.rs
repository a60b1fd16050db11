//! Rendering of many independent frames of a scene, several at once.

use std::collections::VecDeque;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use insonify_core::lanes::{in_order, lane_count};
use insonify_core::needle::Needle;
use insonify_core::pose::Pose;
use insonify_core::settings::{Quality, RenderSettings};

use super::Renderer;
use crate::angle_order::AngleOrder;
use crate::configuration::FrameInputs;
use crate::error::RenderError;
use crate::frame::{FRAMES_IN_FLIGHT, Frame};
use crate::kept::Kept;
use crate::shared_tables::SharedTables;

/// One of many frames to render.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Job {
    /// Pose of the probe.
    pub pose: Pose,
    /// Time of the scene, s.
    pub time_s: f64,
    /// Seed of the frame's random choices.
    pub seed: u32,
    /// The needle in the scene; `None`: the frame shows none.
    pub needle: Option<Needle>,
}

impl Renderer {
    /// Renders `jobs` as [`Renderer::set_time_s`] and [`Renderer::render`] would with each job's seed. Frames are
    /// identical bit for bit on the host and in software; a GPU that makes several at once may round differently.
    /// `each` receives every frame with its job's index, in order, and may take the frame's memory.
    ///
    /// The host renders up to eight frames at once, as many as it has threads. Each has its share of the threads, its
    /// own buffers and, if the scene moves, a copy of the tree. These are kept for the next call. A device has two
    /// frames in flight. If one frame can't keep it busy, successive jobs of equal scene time share dispatches.
    ///
    /// Jobs are taken only a few ahead. Time, needle and settings are restored at the end.
    ///
    /// # Errors
    /// Frames in flight, too little memory, a frame that cannot be rendered ([`RenderError::Job`] names it), or an
    /// error of `each`. Earlier frames were handed to `each`.
    pub fn render_many<E: From<RenderError> + Send>(
        &mut self,
        jobs: impl IntoIterator<Item = Job>,
        each: impl FnMut(usize, &mut Frame) -> Result<(), E>,
    ) -> Result<(), E> {
        if self.frames_in_flight() > 0 {
            return Err(RenderError::RingFull.into());
        }
        let (time_s, needle) = (self.time_s, self.needle);
        let (settings, probe) = (self.active.settings, self.active.probe);
        let done = if self.on_host || self.compounding.is_some() {
            self.render_at_once(jobs, each)
        } else {
            self.render_in_flight(jobs, each)
        };
        // After an error, frames are left in flight that nobody receives.
        let mut unclaimed = Frame::default();
        while !self.in_flight.is_empty() {
            if self.receive(&mut unclaimed).is_err() {
                self.in_flight.clear();
            }
        }
        let restored = self.reconfigure(&probe, &settings);
        self.set_time_s(time_s);
        self.set_needle(needle);
        // The first error counts: restoring the settings of a lost device fails, too.
        done?;
        Ok(restored?)
    }

    /// [`Renderer::render_many`] on the host: one frame per lane, several lanes at once.
    fn render_at_once<E: From<RenderError> + Send>(
        &mut self,
        jobs: impl IntoIterator<Item = Job>,
        mut each: impl FnMut(usize, &mut Frame) -> Result<(), E>,
    ) -> Result<(), E> {
        let spare = Mutex::new(Vec::new());
        let spare = || spare.lock().unwrap_or_else(PoisonError::into_inner);
        let render = |lane: &mut &mut Self, (number, job): (usize, Job)| {
            let mut frame = spare().pop().unwrap_or_default();
            let rendered = lane.prepare(&job).and_then(|()| lane.render(&job.pose, &mut frame));
            rendered.map_err(|source| named(number, source))?;
            Ok(frame)
        };
        let jobs = jobs.into_iter().enumerate().map(Ok);
        self.with_lanes(lane_count(), |lanes| {
            in_order(lanes, jobs, render, |number, mut frame| {
                each(number, &mut frame)?;
                spare().push(frame);
                Ok(())
            })
        })?
    }

    /// [`Renderer::render_many`] on a device: two groups in flight, each of one or several frames.
    fn render_in_flight<E: From<RenderError>>(
        &mut self,
        jobs: impl IntoIterator<Item = Job>,
        mut each: impl FnMut(usize, &mut Frame) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut frame = Frame::default();
        let mut submitted = VecDeque::new();
        let mut receive = |renderer: &mut Self, submitted: &mut VecDeque<usize>| {
            let Some(number) = submitted.pop_front() else { return Ok(()) };
            renderer.receive(&mut frame).map_err(|source| named(number, source))?;
            each(number, &mut frame)
        };
        let at_once = self.frames_at_once();
        let mut jobs = jobs.into_iter().peekable();
        let (mut group, mut first) = (Vec::with_capacity(at_once), 0);
        while let Some(job) = jobs.next() {
            group.push(job);
            // All frames of a group show the scene at one time.
            while group.len() < at_once
                && let Some(next) = jobs.next_if(|next| next.time_s == job.time_s)
            {
                group.push(next);
            }
            while submitted.len() + group.len() > FRAMES_IN_FLIGHT * at_once {
                receive(self, &mut submitted)?;
            }
            self.submit_group(&group, at_once).map_err(|(at, source)| named(first + at, source))?;
            submitted.extend(first..first + group.len());
            first += group.len();
            group.clear();
        }
        while !submitted.is_empty() {
            receive(self, &mut submitted)?;
        }
        Ok(())
    }

    /// Best number of frames in one group of the device.
    fn frames_at_once(&mut self) -> usize {
        // Each frame has its own table of the needle.
        if self.active.needle.is_some() {
            return 1;
        }
        let inputs = FrameInputs { bvh: &self.bvh, media: &self.media, configuration: &self.active, angle: 0 };
        self.maker.at_once(inputs).max(1)
    }

    /// Starts the frames of `jobs`, which all have the same scene time.
    ///
    /// # Errors
    /// The error, with the index in `jobs` of the job that failed.
    fn submit_group(&mut self, jobs: &[Job], at_once: usize) -> Result<(), (usize, RenderError)> {
        if at_once == 1 {
            let mut numbered = jobs.iter().enumerate();
            return numbered.try_for_each(|(at, job)| {
                self.prepare(job).and_then(|()| self.submit(&job.pose)).map_err(|source| (at, source))
            });
        }
        let started = Instant::now();
        let angle = self.active.tables.angles.len().saturating_sub(1);
        let (mut params, mut waiting) = (Vec::with_capacity(jobs.len()), Vec::with_capacity(jobs.len()));
        for (at, job) in jobs.iter().enumerate() {
            self.prepare(job).map_err(|source| (at, source))?;
            let placed = self.touch(&job.pose);
            self.aim(&placed, angle);
            params.push(self.active.params);
            waiting.push(self.waiting(&placed, angle, started));
        }
        let inputs = FrameInputs { bvh: &self.bvh, media: &self.media, configuration: &self.active, angle };
        self.maker.submit_several(inputs, &params, self.contents()).map_err(|source| (0, source.into()))?;
        self.in_flight.extend(waiting);
        Ok(())
    }

    /// Sets the seed and the scene's time of a job.
    fn prepare(&mut self, job: &Job) -> Result<(), RenderError> {
        let RenderSettings { quality, .. } = self.active.settings;
        let probe = self.active.probe;
        self.reconfigure(
            &probe,
            &RenderSettings { quality: Quality { seed: job.seed, ..quality }, ..self.active.settings },
        )?;
        self.set_time_s(job.time_s);
        self.set_needle(job.needle);
        Ok(())
    }

    /// Runs `work` with this renderer and up to `count` − 1 others of the same scene, probe and settings. They may
    /// render at the same time. On a device, this renderer is alone.
    ///
    /// # Errors
    /// Too little memory.
    pub fn with_lanes<T>(&mut self, count: usize, work: impl FnOnce(&mut [&mut Self]) -> T) -> Result<T, RenderError> {
        let mut beside = std::mem::take(&mut self.beside);
        while beside.len() + 1 < count {
            match self.new_beside()? {
                Some(lane) => beside.push(lane),
                None => break,
            }
        }
        let (probe, settings) = (self.active.probe, self.active.settings);
        let known = [SharedTables::of(&self.active.tables)];
        let wanted = beside.iter_mut().take(count.saturating_sub(1));
        wanted.into_iter().try_for_each(|lane| {
            lane.image = self.image;
            lane.reconfigure_with(&probe, &settings, &known)
        })?;
        let mut lanes: Vec<&mut Self> = std::iter::once(&mut *self).chain(&mut beside).take(count.max(1)).collect();
        let done = work(&mut lanes);
        self.beside = beside;
        Ok(done)
    }

    /// Another renderer of the same scene, probe and settings, with its own buffers; `None` on a device.
    fn new_beside(&self) -> Result<Option<Self>, RenderError> {
        let inputs = FrameInputs { bvh: &self.bvh, media: &self.media, configuration: &self.active, angle: 0 };
        let Some(maker) = self.maker.beside(inputs)? else { return Ok(None) };
        let mut lane = Self {
            bvh: self.bvh.clone(),
            media: self.media.clone(),
            active: self.active.clone(),
            kept: Kept::default(),
            skin: self.skin.clone(),
            maker,
            on_host: self.on_host,
            compute_device: self.compute_device,
            image: self.image,
            time_s: self.time_s,
            needle: self.needle,
            motion_ms: 0.0,
            compounding: None,
            kept_pictures: Kept::default(),
            order: AngleOrder::default(),
            generation: 0,
            in_flight: VecDeque::with_capacity(FRAMES_IN_FLIGHT),
            beside: Vec::new(),
        };
        lane.prepare_compounding();
        Ok(Some(lane))
    }
}

/// Adds the job's index to an error.
fn named(number: usize, source: RenderError) -> RenderError {
    RenderError::Job { number, source: Box::new(source) }
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};
    use insonify_core::anatomy::{TissueTable, analytic};
    use insonify_core::settings::{LookSettings, RenderSettings};
    use insonify_core::transducer::Probe;

    use super::*;
    use crate::{Backend, BackendChoice};

    fn renderer(settings: &RenderSettings) -> (Renderer, Probe) {
        let ball = analytic::Part {
            name: "ball",
            tissue: "liver",
            priority: 0,
            mesh: analytic::sphere(DVec3::new(0.0, 0.0, 60.0).as_vec3(), 30.0, 3),
        };
        let scene = analytic::scene(vec![ball], &TissueTable::builtin().unwrap(), "water").unwrap();
        let probe = Probe { scanlines: 32, samples: 512.into(), ..Probe::default() };
        let backend = Backend::open(BackendChoice::Host).unwrap();
        (Renderer::new(&backend, &scene, &probe, settings).unwrap(), probe)
    }

    fn settings() -> RenderSettings {
        let mut settings = RenderSettings { maps: true, ..RenderSettings::default() };
        (settings.image.width, settings.image.height) = (200, 150);
        settings
    }

    fn jobs(count: u32) -> impl Iterator<Item = Job> {
        (0..count).map(|i| Job {
            pose: Pose { position_mm: DVec3::new(f64::from(i) - 3.0, 0.0, 0.0), orientation: DQuat::IDENTITY },
            time_s: 0.1 * f64::from(i),
            seed: i / 2,
            needle: None,
        })
    }

    /// The frame with its times set to zero.
    fn timeless(frame: &Frame) -> Frame {
        Frame { times: Default::default(), ..frame.clone() }
    }

    #[test]
    fn frames_are_those_that_are_rendered_one_by_one() {
        for angles in [1, 3] {
            let settings = RenderSettings { look: LookSettings { angles, ..LookSettings::default() }, ..settings() };
            let (mut many, probe) = renderer(&settings);
            let (mut one, _) = renderer(&settings);
            let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
            let mut seen = 0;
            // Two rounds, since lanes are kept between calls. The focus changes in between.
            for focus_mm in [probe.focus_mm, 40.0] {
                let probe = Probe { focus_mm, ..probe };
                one.reconfigure(&probe, &settings).unwrap();
                many.reconfigure(&probe, &settings).unwrap();
                let mut expected = jobs(11).map(|job| {
                    one.prepare(&job).unwrap();
                    let mut frame = Frame::default();
                    one.render(&job.pose, &mut frame).unwrap();
                    frame
                });
                let each = |number, frame: &mut Frame| {
                    assert_eq!(number, seen % 11);
                    assert!(
                        timeless(frame) == timeless(&expected.next().unwrap()),
                        "frame {number} of {angles} angles"
                    );
                    seen += 1;
                    Ok::<_, RenderError>(())
                };
                pool.install(|| many.render_many(jobs(11), each)).unwrap();
            }
            assert_eq!((seen, many.beside.len()), (22, 2));
            assert_eq!((many.time_s, many.settings().quality.seed), (0.0, settings.quality.seed));
        }
    }

    #[test]
    fn a_frame_that_fails_is_named() {
        let (mut renderer, _) = renderer(&settings());
        let error = named(4, RenderError::RingEmpty);
        assert!(error.to_string().starts_with("frame 4: no frame is in flight"), "{error}");
        let stopped =
            renderer.render_many(jobs(9), |number, _| if number == 2 { Err(error_of(number)) } else { Ok(()) });
        assert!(matches!(stopped, Err(RenderError::Job { number: 2, .. })));
    }

    fn error_of(number: usize) -> RenderError {
        named(number, RenderError::RingEmpty)
    }

    #[test]
    fn configurations_keep_their_frames() {
        let (mut both, probe) = renderer(&settings());
        let high = RenderSettings { quality: Quality { rays: 4, layers: 3, seed: 9 }, maps: false, ..settings() };
        let all: Vec<Job> = jobs(3).collect();
        for focus_mm in [60.0, 90.0] {
            let probe = Probe { focus_mm, ..probe };
            for (number, settings) in [settings(), high].into_iter().enumerate() {
                both.select(number).unwrap();
                both.reconfigure(&probe, &settings).unwrap();
            }
            let (mut low_alone, _) = renderer(&settings());
            let (mut high_alone, _) = renderer(&high);
            low_alone.reconfigure(&probe, &settings()).unwrap();
            high_alone.reconfigure(&probe, &high).unwrap();
            for job in &all {
                // Submit both frames before receiving either.
                for number in [0, 1] {
                    both.select(number).unwrap();
                    both.submit(&job.pose).unwrap();
                }
                for alone in [&mut low_alone, &mut high_alone] {
                    let (mut expected, mut found) = (Frame::default(), Frame::default());
                    alone.render(&job.pose, &mut expected).unwrap();
                    both.receive(&mut found).unwrap();
                    assert!(timeless(&expected) == timeless(&found), "focus {focus_mm}");
                }
            }
        }
    }
}
