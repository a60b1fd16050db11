//! Renderers of insonify, a real-time ultrasound simulator: from the pose of a probe to a B-mode frame with its maps.
//!
//! ```
//! use glam::Vec3;
//! use insonify_core::anatomy::{Scene, TissueTable, analytic::sphere};
//! use insonify_core::{pose::Pose, transducer::Probe};
//! use insonify_render::{Backend, BackendChoice, Frame, RenderSettings, Renderer};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let mut scene = Scene::new(TissueTable::builtin()?, "liver")?;
//! scene.add("cyst", "amniotic_fluid", 1, sphere(Vec3::new(0.0, 0.0, 70.0), 20.0, 3))?;
//! let probe = Probe { scanlines: 32, ..Probe::default() };
//! let backend = Backend::open(BackendChoice::Host)?;
//! let mut renderer = Renderer::new(&backend, &scene, &probe, &RenderSettings::default())?;
//! let mut frame = Frame::default();
//! renderer.render(&Pose::IDENTITY, &mut frame)?;
//! // The probe lies at the origin and looks along z: the cyst is in the picture.
//! let cyst = scene.tissues.index_of("amniotic_fluid").ok_or("there is no such tissue")? + 1;
//! assert!(frame.segmentation.iter().any(|&tissue| usize::from(tissue) == cyst));
//! assert_eq!(frame.bmode.len(), frame.segmentation.len());
//! # Ok(())
//! # }
//! ```
//!
//! [`Renderer`] is the one interface of two renderers: `host` runs all passes on the processor's cores, `device` on a
//! graphics device (feature `gpu`). Neither uses the other. Both use the files directly in `src`: effect plan, tables,
//! uniforms, constants. [`twin`] has the same passes in f64, as their reference; read its `trace.rs` first.
//!
//! | module | holds |
//! |---|---|
//! | [`plan`] | the effects that scene, probe and settings call for, each with its reason and bound |
//! | [`look`] | post-processing of the picture: speckle reduction, edge enhancement, persistence, grey maps |
//! | [`twin`] | all passes in f64, the reference for tests |

mod angle_order;
mod aperture;
mod backend;
mod batch_plan;
mod boundary;
mod compounding;
mod compute_device;
mod configuration;
mod constants;
#[cfg(feature = "gpu")]
mod device;
#[cfg(not(feature = "gpu"))]
#[path = "no_device.rs"]
mod device;
mod elevation;
mod error;
mod fractional_delay;

mod frame;
mod frame_quality;
mod hooks;
mod host;
mod kept;
mod kernels;
mod lateral_beam;
pub mod look;
mod maker;
mod needle;
mod params;
pub mod plan;
mod preset;
mod receiver;
mod renderer;
mod segment;
mod shared_tables;
mod sheet_cells;
mod sheets;
mod snapshot;
mod tables;
mod texture;
mod trace_by;
#[cfg(feature = "gpu")]
mod trace_cache;
#[cfg(feature = "gpu")]
mod trace_times;
pub mod twin;

pub use backend::{Backend, BackendChoice, UnknownBackend, UnknownBackendVariable};
pub use compute_device::{ComputeDevice, NVIDIA, PciAddress};
#[cfg(all(feature = "test-hooks", feature = "gpu"))]
pub use device::InjectedHang;
#[cfg(feature = "test-hooks")]
pub use device::ShaderSet;
pub use error::{BackendError, RenderError};
pub use frame::{DeviceTimes, FRAMES_IN_FLIGHT, Frame, FrameTimes, PassTime, warn_of_overflows};
pub use frame_quality::FrameQuality;
#[cfg(feature = "test-hooks")]
pub use hooks::TestHooks;
pub use host::processor_name;
#[cfg(feature = "test-hooks")]
pub use host::{ImageConstants, TraceConstants};
pub use insonify_core::instructions::{Instructions, WrongInstructions};
pub use plan::{Decision, EffectPlan};
pub use preset::{NoQuality, Preset, UnknownPreset};
pub use renderer::{Job, Renderer};
pub use shared_tables::{SharedTables, TableMaker};
pub use snapshot::Snapshot;
pub use trace_by::{TraceBy, UnknownTrace};

pub use insonify_core::settings::{Choice, Effect, EffectChoices, EffectSet, ImageSettings, Quality, RenderSettings};
