//! Interface of frame makers: the host renderer and the device renderer.

use std::fmt::Debug;

use super::configuration::FrameInputs;
use super::error::{BackendError, RenderError};
use super::frame::{Contents, Frame};
use super::snapshot::PassBuffers;
use crate::anatomy::Bvh;
use crate::anatomy::bvh::Changed;

/// Makes the frames of one scene.
pub(super) trait FrameMaker: Debug + Send {
    /// Makes buffers and passes for another configuration. Frames in flight stay as they were submitted.
    ///
    /// # Errors
    /// Too little memory, or a device that fails or is too small; nothing has changed then.
    fn configure(&mut self, inputs: FrameInputs<'_>) -> Result<(), RenderError>;

    /// Makes the configuration with a number the active one: its buffers and passes are kept, those of the active one, too. A new number
    /// gets buffers and passes of `inputs`. Numbers are given from 0 on; the first configuration has 0. Frames in flight stay as they
    /// were submitted.
    ///
    /// # Errors
    /// As [`FrameMaker::configure`].
    fn select(&mut self, number: usize, inputs: FrameInputs<'_>) -> Result<(), RenderError>;

    /// A maker of the same scene with buffers of its own, which makes frames at the same time; none for a device, which has frames in
    /// flight.
    ///
    /// # Errors
    /// Too little memory.
    fn beside(&self, inputs: FrameInputs<'_>) -> Result<Option<Box<dyn FrameMaker>>, RenderError>;

    /// Whether passes were compiled since the last call: the next frame takes longer.
    fn take_cold(&mut self) -> bool;

    /// Updates the nodes and triangles that moved, for the next frames.
    fn move_scene(&mut self, bvh: &Bvh, changed: &Changed);

    /// Starts a frame at the pose of the uniforms.
    ///
    /// # Errors
    /// A device that fails.
    fn submit(&mut self, inputs: FrameInputs<'_>, contents: Contents) -> Result<(), BackendError>;

    /// Waits for the oldest frame in flight and copies all of it into `frame`, except its mask and total time.
    ///
    /// # Errors
    /// A device that fails.
    fn receive(&mut self, frame: &mut Frame) -> Result<(), BackendError>;

    /// Makes a frame with its maps, and returns the outputs of every pass.
    ///
    /// # Errors
    /// A frame of several batches, or a device that fails.
    fn pass_buffers(&mut self, inputs: FrameInputs<'_>) -> Result<PassBuffers, RenderError>;
}
