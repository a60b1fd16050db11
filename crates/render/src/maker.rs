//! Interface of frame makers: the host renderer and the device renderer.

use std::fmt::Debug;

use insonify_core::anatomy::Bvh;

use super::configuration::FrameInputs;
use super::error::{BackendError, RenderError};
use super::frame::{Contents, Frame};
use super::params::Params;
use super::snapshot::PassBuffers;

/// Makes the frames of one scene.
pub(crate) trait FrameMaker: Debug + Send {
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

    /// Moves the scene to `time_s` for the frames that are submitted from now on. A device leaves the triangles and nodes of `bvh` at
    /// rest, and moves its own.
    fn move_scene(&mut self, bvh: &mut Bvh, time_s: f64);

    /// Starts a frame at the pose of the uniforms.
    ///
    /// # Errors
    /// A device that fails.
    fn submit(&mut self, inputs: FrameInputs<'_>, contents: Contents) -> Result<(), BackendError>;

    /// Frames that [`FrameMaker::submit_several`] makes best at once; 1 if it takes none.
    fn at_once(&mut self, _: FrameInputs<'_>) -> usize {
        1
    }

    /// Starts a frame for each of `params`, up to [`FrameMaker::at_once`], twice as many in flight. They differ from those of `inputs` in
    /// the pose and in seeds.
    ///
    /// # Errors
    /// A device that fails, or a maker that takes one at a time.
    fn submit_several(&mut self, _: FrameInputs<'_>, _: &[Params], _: Contents) -> Result<(), BackendError> {
        Err(BackendError::NoAdapter { reason: "frames are made one at a time".to_owned() })
    }

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
