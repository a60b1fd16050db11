//! Live session: from poses to sinks, frame by frame. A part that fails or hangs does not stop the others.
//!
//! ```text
//! poses → [late sample] → render → slot → generator → slot → presenter → slot each → sinks
//!                           ├────────────── slot ──────────────↗
//!                           └→ slot → needle: follows the tip, if there is a needle
//! ```
//! Each stage has its own thread. Each link is a slot for one item: the newest replaces the older one, which is counted
//! as dropped. Events and controls have separate bounded queues. All waits use the session's [`Clock`], so
//! [`SimulatedClock`] runs a session without waiting.
//!
//! Each begun frame is either presented or dropped, and drops are counted by cause: `produced = presented + Σ drops`.
//!
//! [`replay`] renders recorded sessions without a clock.

mod clock;
mod controls;
mod deadline;
mod events;
mod freshness;
mod generate_stage;
mod generator_link;
mod generators;
mod histogram;
mod live_station;
mod local_renderer;
mod metrics;
mod needle_stage;
mod pace;
mod parts;
mod presenter;
mod recorded;
mod render_stage;
mod rendered;
pub mod replay;
mod replayed;
mod session;
mod shutdown;
mod signals;
mod simulated;
mod sink_stage;
mod slot;
mod sources;
mod summary;
mod summary_table;
mod tracked;
mod tracker_watch;

pub use clock::{Clock, NEVER, Signal, SystemClock};
pub use events::Observer;
pub use generators::Generators;
pub use histogram::Percentiles;
#[cfg(feature = "browser")]
pub use live_station::scene_info;
pub use live_station::{LiveError, LiveStation};
pub use local_renderer::LocalRendererFactory;
pub use metrics::Status;
pub use needle_stage::NeedleSummary;
pub use parts::{
    FrameGenerators, FrameRenderer, GenerateError, ImageShape, PoseSource, RenderFault, RendererFactory, Terminator,
};
pub use recorded::{RecordError, RecordedSlot, RecorderPart, RecordingObserver, start_recorder};
pub use replayed::{OtherSetting, ReplayedNeedle, ReplayedPoses};
pub use session::{Limits, Parts, Pipeline, PipelineError};
pub use shutdown::{Joined, Part, Stop, Thread, spawn};
pub use signals::{StopSignals, on_ctrl_c};
pub use simulated::SimulatedClock;
pub use sources::{StandingPose, WithStandingNeedle};
pub use summary::{GeneratorSummary, MisplacedSummary, SinkSummary, Summary};
pub use tracked::{TrackedPoses, TrackerPart};
pub use tracker_watch::{TrackerSummary, TrackerWatch};
