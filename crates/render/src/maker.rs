//! Interface that the host renderer and the device renderer share.

use std::fmt::Debug;

use insonify_core::anatomy::Bvh;

use super::configuration::FrameInputs;
use super::error::{BackendError, RenderError};
use super::frame::{Contents, Frame};
use super::params::Params;
use super::snapshot::PassBuffers;

/// Makes the frames of one scene.
pub(crate) trait FrameMaker: Debug + Send {
    /// Makes buffers and passes for another configuration. Frames in flight keep theirs.
    ///
    /// # Errors
    /// Too little memory, or a device that fails or is too small; nothing has changed then.
    fn configure(&mut self, inputs: FrameInputs<'_>) -> Result<(), RenderError>;

    /// Makes configuration `number` the active one. All configurations keep their buffers and passes; a new number gets
    /// them made for `inputs`. Numbers are given from 0 on, and the first configuration has 0. Frames in flight stay as
    /// they were submitted.
    ///
    /// # Errors
    /// As [`FrameMaker::configure`].
    fn select(&mut self, number: usize, inputs: FrameInputs<'_>) -> Result<(), RenderError>;

    /// Another maker of the same scene with its own buffers, for frames made at the same time. `None` for a device,
    /// which has frames in flight instead.
    ///
    /// # Errors
    /// Too little memory.
    fn beside(&self, inputs: FrameInputs<'_>) -> Result<Option<Box<dyn FrameMaker>>, RenderError>;

    /// Whether passes were compiled since the last call; if so, the next frame takes longer.
    fn take_cold(&mut self) -> bool;

    /// Moves the scene to `time_s` for frames submitted from now on. A device moves its own triangles and nodes, and
    /// leaves `bvh` at rest.
    fn move_scene(&mut self, bvh: &mut Bvh, time_s: f64);

    /// Starts a frame at the pose in the uniforms.
    ///
    /// # Errors
    /// A device that fails.
    fn submit(&mut self, inputs: FrameInputs<'_>, contents: Contents) -> Result<(), BackendError>;

    /// Best number of frames for one call of [`FrameMaker::submit_several`]; 1 if it isn't supported.
    fn at_once(&mut self, _: FrameInputs<'_>) -> usize {
        1
    }

    /// Starts one frame for each of `params`, which differ from the uniforms of `inputs` only in pose and seeds.
    /// `params` has up to [`FrameMaker::at_once`] entries; up to twice as many frames may be in flight.
    ///
    /// # Errors
    /// A device that fails, or a maker that makes frames one at a time.
    fn submit_several(&mut self, _: FrameInputs<'_>, _: &[Params], _: Contents) -> Result<(), BackendError> {
        Err(BackendError::NoAdapter { reason: "frames are made one at a time".to_owned() })
    }

    /// Waits for the oldest frame in flight and copies it into `frame`, except its mask and total time.
    ///
    /// # Errors
    /// A device that fails.
    fn receive(&mut self, frame: &mut Frame) -> Result<(), BackendError>;

    /// Makes a frame with its maps, and returns the outputs of every pass.
    ///
    /// # Errors
    /// Paths that need several batches, or a device that fails.
    fn pass_buffers(&mut self, inputs: FrameInputs<'_>) -> Result<PassBuffers, RenderError>;
}
