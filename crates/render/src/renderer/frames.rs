//! Rendering of single frames and sequences: submission, reception, snapshots.

use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;
use insonify_core::needle::Needle;
use insonify_core::pose::Pose;
use insonify_core::settings::{Choice, Effect};
use insonify_core::transducer::{Contact, ScanGeometry, touch};

use super::Renderer;
use crate::angle_order::{Place, Rules};
use crate::configuration::FrameInputs;
use crate::error::RenderError;
use crate::frame::{Contents, FRAMES_IN_FLIGHT, Frame, FrameTimes};
use crate::needle::View;
use crate::receiver::noise_seed;
use crate::snapshot::Snapshot;

/// A frame that was submitted and not yet received.
#[derive(Debug)]
pub(super) struct InFlight {
    /// Sector mask of the settings at submission.
    mask: Arc<[u8]>,
    scan: ScanGeometry,
    contact: Option<Contact>,
    angle: usize,
    place: Place,
    /// [`Renderer::generation`] at submission.
    generation: u64,
    motion_ms: f64,
    started: Instant,
}

/// A probe in the scene, at its pose after contact has moved it onto the skin.
#[derive(Debug)]
pub(super) struct Placed {
    pose: Pose,
    contact: Option<Contact>,
    place: Place,
}

impl Renderer {
    /// Renders one frame and waits for it. With compounding, it renders all steering angles.
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
            // The last angle is straight: the frame gets its maps and lines.
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

    /// Renders `poses` in order, with two frames in flight. `each` receives every frame and its index. `before` is
    /// called with the index before each submission, and may wait. It returns the scene's time, s, and the needle.
    ///
    /// # Errors
    /// As [`Renderer::submit`] and [`Renderer::receive`], or an error of `each`.
    pub fn render_each<E: From<RenderError>>(
        &mut self,
        poses: &[Pose],
        mut before: impl FnMut(usize) -> (f64, Option<Needle>),
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
            let (time_s, needle) = before(submitted);
            self.set_time_s(time_s);
            self.set_needle(needle);
            self.submit(pose)?;
        }
        while done < poses.len() {
            self.receive(&mut frame)?;
            each(done, &mut frame)?;
            done += 1;
        }
        Ok(())
    }

    /// Renders frames at the times (s) and poses of `way`, one after another as in a live session. Compounding starts
    /// over. `frame` receives the last frame.
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

    /// Moves a probe near the skin onto it, and computes the contact. Without the effect `contact`, the pose is
    /// unchanged.
    pub(super) fn touch(&self, pose: &Pose) -> Placed {
        let active = &self.active;
        let skin = self.skin.as_ref().filter(|_| active.effects.has(Effect::Contact));
        // The skin drifts with the whole scene.
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

    /// Sets what changes with a frame: pose, steering angle, needle and seed of the noise.
    pub(super) fn aim(&mut self, placed: &Placed, angle: usize) {
        let active = &mut self.active;
        active.params.set_pose(&placed.pose, &self.bvh, &active.probe);
        active.params.set_angle(&active.tables, angle);
        // Each angle has its own noise. The straight angle, the last one, has the noise of a frame without compounding.
        if let (Some(tables), Some(frame)) = (&active.tables.needle, &mut active.needle) {
            let view = View {
                probe: &active.probe,
                aperture: active.tables.aperture.as_ref(),
                sector: &active.tables.sector,
                scene_from_probe: &placed.pose,
                steer_rad: active.tables.angles.get(angle).map_or(0.0, |angle| angle.steer_rad),
            };
            frame.place(tables, view, self.needle.as_ref());
        }
        let before_last = active.tables.angles.len().saturating_sub(1 + angle);
        active.params.noise_seed = noise_seed(active.params.seed, self.time_s, before_last as u32);
    }

    /// Starts a frame. At most [`FRAMES_IN_FLIGHT`] may wait to be received. The host renders it within this call.
    ///
    /// With compounding, the frame renders the next steering angle, and its picture is the mean of the latest pictures
    /// of all angles. Pictures from which the probe has moved by more than `look.reach_mm` are left out. With
    /// `look.registration`, pictures are resampled at the frame's pose.
    ///
    /// # Errors
    /// Too many frames in flight, or a device that fails.
    pub fn submit(&mut self, pose: &Pose) -> Result<(), RenderError> {
        if self.in_flight.len() >= FRAMES_IN_FLIGHT {
            return Err(RenderError::RingFull);
        }
        let placed = self.touch(pose);
        let angle = self.order.next(placed.place, Rules::of(&self.active.settings.look));
        self.submit_angle(&placed, angle)
    }

    /// Starts a frame with the steering angle of index `angle`.
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

    /// Whether the next frame has an image and maps.
    pub(super) fn contents(&self) -> Contents {
        let settings = &self.active.settings;
        let maps = settings.maps || settings.effects.of(Effect::Maps) == Choice::On;
        Contents { image: self.image || !maps || settings.lines, maps }
    }

    /// The record of a frame to be submitted.
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
    /// No frame in flight, or a device that fails.
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

    /// [`Renderer::snapshot`] of the steering angle with index `angle`; the last one is straight.
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
