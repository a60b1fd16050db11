//! Frames of a renderer: submitted, received, at once, or as a live session makes them.

use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;
use insonify_core::pose::Pose;
use insonify_core::settings::{Choice, Effect};
use insonify_core::transducer::{Contact, ScanGeometry, touch};

use super::Renderer;
use crate::angle_order::{Place, Rules};
use crate::configuration::FrameInputs;
use crate::error::RenderError;
use crate::frame::{Contents, FRAMES_IN_FLIGHT, Frame, FrameTimes};
use crate::receiver::noise_seed;
use crate::snapshot::Snapshot;

/// A frame that was submitted and not received.
#[derive(Debug)]
pub(super) struct InFlight {
    /// Mask of the settings that it was submitted with.
    mask: Arc<[u8]>,
    scan: ScanGeometry,
    contact: Option<Contact>,
    angle: usize,
    place: Place,
    /// [`Renderer::generation`] at its submission.
    generation: u64,
    motion_ms: f64,
    started: Instant,
}

/// A probe in the scene.
#[derive(Debug)]
pub(super) struct Placed {
    pose: Pose,
    contact: Option<Contact>,
    place: Place,
}

impl Renderer {
    /// Renders one frame and waits for it. A compounded one takes all angles.
    ///
    /// # Errors
    /// A device that fails, or frames that are still in flight.
    pub fn render(&mut self, pose: &Pose, frame: &mut Frame) -> Result<(), RenderError> {
        if !self.in_flight.is_empty() {
            return Err(RenderError::RingFull);
        }
        self.restart_compounding();
        let angles = self.active.tables.angles.len();
        let maps = self.active.settings.maps;
        let (mut times, mut overflows) = (FrameTimes::default(), 0u32);
        let placed = self.touch(pose);
        for angle in 1..=angles {
            // The last angle is straight: its maps and lines are the frame's.
            self.active.settings.maps = maps && angle == angles;
            let rendered = self.submit_angle(&placed, angle - 1).and_then(|()| self.receive(frame));
            self.active.settings.maps = maps;
            rendered?;
            if angles > 1 {
                times.add_frame(&frame.times);
                overflows = overflows.saturating_add(frame.overflows);
            }
        }
        if angles > 1 {
            (frame.times, frame.overflows) = (times, overflows);
        }
        Ok(())
    }

    /// Renders `poses` in order, two in flight. `each` receives every frame with its index. `before` runs before each
    /// submission, may wait, and returns the scene's time, s.
    ///
    /// # Errors
    /// As [`Renderer::submit`] and [`Renderer::receive`], or an error of `each`.
    pub fn render_each<E: From<RenderError>>(
        &mut self,
        poses: &[Pose],
        mut before: impl FnMut(usize) -> f64,
        mut each: impl FnMut(usize, &mut Frame) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut frame = Frame::default();
        let mut done = 0;
        for (submitted, pose) in poses.iter().enumerate() {
            if submitted - done == FRAMES_IN_FLIGHT {
                self.receive(&mut frame)?;
                each(done, &mut frame)?;
                done += 1;
            }
            self.set_time_s(before(submitted));
            self.submit(pose)?;
        }
        while done < poses.len() {
            self.receive(&mut frame)?;
            each(done, &mut frame)?;
            done += 1;
        }
        Ok(())
    }

    /// Renders frames at these times (s) and poses one after another, as a live session does, from a new compounded picture on.
    /// `frame` is the last.
    ///
    /// # Errors
    /// As [`Renderer::submit`] and [`Renderer::receive`].
    pub fn render_live(
        &mut self,
        way: impl IntoIterator<Item = (f64, Pose)>,
        frame: &mut Frame,
    ) -> Result<(), RenderError> {
        self.restart_compounding();
        for (time_s, pose) in way {
            self.set_time_s(time_s);
            self.submit(&pose)?;
            self.receive(frame)?;
        }
        Ok(())
    }

    /// Places the probe on the skin, if it is within the tolerance and contact is simulated.
    pub(super) fn touch(&self, pose: &Pose) -> Placed {
        let active = &self.active;
        let skin = self.skin.as_ref().filter(|_| active.effects.has(Effect::Contact));
        // The whole scene drifts, its skin included.
        let drift_mm = self.bvh.drift_mm();
        let at_rest = Pose { position_mm: pose.position_mm - drift_mm, ..*pose };
        let touched = skin.map(|skin| touch(skin, &active.probe, &at_rest, &active.settings.contact));
        let at_rest = touched.map_or(at_rest, |(placed, _)| placed);
        let contact = touched.map(|(_, contact)| contact);
        let shift_mm = contact.map_or(0.0, |contact| contact.shift_mm);
        let pose = Pose { position_mm: pose.position_mm + shift_mm * pose.transform_vector(DVec3::Z), ..*pose };
        let coupled = contact.is_none_or(|contact| contact.coupled());
        Placed { pose, contact, place: Place::new(at_rest, active.probe.depth_mm, coupled) }
    }

    /// Sets the pose and steers the scanlines.
    pub(super) fn aim(&mut self, placed: &Placed, angle: usize) {
        let active = &mut self.active;
        active.params.set_pose(&placed.pose, &self.bvh, &active.probe);
        active.params.set_angle(&active.tables, angle);
        // Each angle has its own noise; the straight one, the last, that of a frame without compounding.
        let before_last = active.tables.angles.len().saturating_sub(1 + angle);
        active.params.noise_seed = noise_seed(active.params.seed, self.time_s, before_last as u32);
    }

    /// Starts a frame. With compounding it has the next angle, and its picture is the mean of the last ones of all angles
    /// from which the probe has moved by no more than `look.reach_mm`; `look.registration` brings them to its pose. At most
    /// [`FRAMES_IN_FLIGHT`] may wait to be received.
    /// The host makes it within this call.
    ///
    /// # Errors
    /// A full ring, or a device that fails.
    pub fn submit(&mut self, pose: &Pose) -> Result<(), RenderError> {
        if self.in_flight.len() >= FRAMES_IN_FLIGHT {
            return Err(RenderError::RingFull);
        }
        let placed = self.touch(pose);
        let angle = self.order.next(placed.place, Rules::of(&self.active.settings.look));
        self.submit_angle(&placed, angle)
    }

    /// Starts a frame of one angle.
    fn submit_angle(&mut self, placed: &Placed, angle: usize) -> Result<(), RenderError> {
        if self.in_flight.len() >= FRAMES_IN_FLIGHT {
            return Err(RenderError::RingFull);
        }
        let started = Instant::now();
        self.aim(placed, angle);
        let contents = self.contents();
        let inputs = FrameInputs { bvh: &self.bvh, media: &self.media, configuration: &self.active, angle };
        self.maker.submit(inputs, contents)?;
        let waiting = self.waiting(placed, angle, started);
        self.in_flight.push_back(waiting);
        Ok(())
    }

    /// Parts of the next frame.
    pub(super) fn contents(&self) -> Contents {
        let settings = &self.active.settings;
        let maps = settings.maps || settings.effects.of(Effect::Maps) == Choice::On;
        Contents { image: self.image || !maps || settings.lines, maps }
    }

    /// What is known of a frame before it is received.
    pub(super) fn waiting(&mut self, placed: &Placed, angle: usize, started: Instant) -> InFlight {
        InFlight {
            mask: self.active.tables.mask.clone(),
            scan: ScanGeometry::new(&self.active.probe, self.active.tables.sector),
            contact: placed.contact,
            angle,
            place: placed.place,
            generation: self.generation,
            motion_ms: std::mem::take(&mut self.motion_ms),
            started,
        }
    }

    /// Waits for the oldest frame in flight and copies it into `frame`.
    ///
    /// # Errors
    /// An empty ring, or a device that fails.
    pub fn receive(&mut self, frame: &mut Frame) -> Result<(), RenderError> {
        let InFlight { mask, scan, contact, angle, place, generation, motion_ms, started } =
            self.in_flight.pop_front().ok_or(RenderError::RingEmpty)?;
        self.maker.receive(frame)?;
        if let Some(compounding) = self.compounding.as_mut().filter(|_| generation == self.generation) {
            compounding.add(angle, place, Rules::of(&self.active.settings.look), &mut frame.bmode);
        }
        frame.mask = mask;
        frame.scan = Some(scan);
        frame.contact = contact;
        frame.times.total_ms = started.elapsed().as_secs_f64() * 1e3;
        frame.times.motion_ms = motion_ms;
        Ok(())
    }

    /// Renders a frame with its maps, whatever the settings are, and returns the inputs and outputs of every pass.
    /// Slow: for tests and study.
    ///
    /// # Errors
    /// Frames in flight, settings whose paths don't fit in one batch, or a device that fails.
    pub fn snapshot(&mut self, pose: &Pose) -> Result<Snapshot, RenderError> {
        self.snapshot_of_angle(pose, self.active.tables.angles.len().saturating_sub(1))
    }

    /// [`Renderer::snapshot`] of one angle of a compounded picture; the last one is not steered.
    ///
    /// # Errors
    /// As [`Renderer::snapshot`].
    pub fn snapshot_of_angle(&mut self, pose: &Pose, angle: usize) -> Result<Snapshot, RenderError> {
        if self.frames_in_flight() > 0 {
            return Err(RenderError::RingFull);
        }
        self.aim(&self.touch(pose), angle);
        let inputs = FrameInputs { bvh: &self.bvh, media: &self.media, configuration: &self.active, angle };
        Ok(Snapshot::new(self.maker.pass_buffers(inputs)?, inputs))
    }
}
