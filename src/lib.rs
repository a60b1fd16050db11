//! insonify: a real-time ultrasound simulator for training stations.
//!
//! A [`Scene`] holds tissues as closed surfaces. A [`Renderer`] renders the scene for a probe's [`Pose`]: a [`Frame`]
//! has B-mode picture, segmentation and attenuation. A [`Station`] file describes scene, probe, tracker and displays.
//!
//! # A first frame
//!
//! ```
//! use insonify::anatomy::{TissueTable, analytic::sphere};
//! use insonify::glam::Vec3;
//! use insonify::render::{Backend, BackendChoice, RenderSettings};
//! use insonify::sink::png::{Effort, write_grey};
//! use insonify::{Frame, Pose, Renderer, Scene, transducer::Probe};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let mut scene = Scene::new(TissueTable::builtin()?, "liver")?;
//! scene.add("cyst", "amniotic_fluid", 1, sphere(Vec3::new(0.0, 0.0, 70.0), 20.0, 3))?;
//! let probe = Probe { scanlines: 128, ..Probe::default() };
//! let backend = Backend::open(BackendChoice::Host)?;
//! let mut renderer = Renderer::new(&backend, &scene, &probe, &RenderSettings::default())?;
//! let mut frame = Frame::default();
//! renderer.render(&Pose::IDENTITY, &mut frame)?;
//! let path = std::env::temp_dir().join("cyst.png");
//! write_grey(&path, frame.width, frame.height, &frame.bmode, Effort::Small)?;
//! # let level = |name: &str| {
//! #     let number = scene.tissues.index_of(name).map(|index| index as u8 + 1);
//! #     let pixels = frame.bmode.iter().zip(&frame.segmentation).filter(|(_, n)| Some(**n) == number);
//! #     let (sum, count) = pixels.fold((0.0, 0.0), |(sum, count), (grey, _)| (sum + f64::from(*grey), count + 1.0));
//! #     sum / count
//! # };
//! # assert!(level("liver") > level("amniotic_fluid") + 20.0, "{} {}", level("liver"), level("amniotic_fluid"));
//! # Ok(())
//! # }
//! ```
//!
//! The probe lies at the origin and looks along z. The fluid-filled sphere is dark. `examples/` has a scene from
//! arrays, a live session, a data set and a generator.
//!
//! # Modules
//!
//! Data flows one way: pose → rays → segments → baseband lines → polar frame → Cartesian maps → generator → sink.
//! A module depends only on modules below it in this table.
//!
//! | module | holds |
//! |---|---|
//! | [`pipeline`] | live sessions, and replays of recorded ones; feature `live` |
//! | [`chooser`] | operating points (quality and generator): their times, and the choice; feature `live` |
//! | [`measuring`] | times and errors of frames, sweeps, the error table; images and generators against their targets |
//! | [`dataset`] | data sets of paired frames |
//! | [`report`] | reports, sheets, pictures of scenes |
//! | [`station`] | station files |
//! | [`sink`] | files, and live displays; features `video`, `browser`, `window` |
//! | [`presented`] | frames on their way to viewers: pose, times, pixels |
//! | [`generator`] | models that translate frames; feature `generator` |
//! | [`quality`], [`selftest`] | image quality metrics; checks against known answers |
//! | [`exam`] | simulated sessions, scores |
//! | [`render`] | renderers of the host, of devices (feature `gpu`) and of tests |
//! | [`transducer`] | probes and their sectors |
//! | [`phantom`] | the obstetric phantom: an individual from its parameters |
//! | [`segmentation`] | scenes from label maps and meshes of patients |
//! | [`anatomy`] | scenes, tissues, solids, motion |
//! | [`recording`] | recordings and interchange; feature `recordings` |
//! | [`tracker`] | decoders; sessions: features `live`, `serial`, `hid` |
//! | [`pose`] | poses, their estimation and calibration |
//! | [`acoustics`], [`look`] | formulas; post-processing |
//! | [`settings`](mod@settings) | definition of every setting |
//! | [`files`], [`statistics`], [`random`], [`names`] | tools |
//!
//! All features except `window` are on by default, and `cli` makes the program `insonify`. Modules without a feature in
//! the table always work. Without their feature, other modules are absent, or return an error that names the feature.
//!
//! # Units
//!
//! Lengths are in mm, frequency in MHz, speed in m/s, attenuation in dB/cm/MHz and impedance in MRayl;
//! the unit is in the name. Transforms are named `a_from_b`.

pub use insonify_core::{acoustics, anatomy, files, names, needle, pose, random, settings, statistics, transducer};
pub use insonify_render as render;
pub use insonify_render::look;
pub use insonify_scenes::{phantom, segmentation};
pub use insonify_tracking::{recording, tracker};

pub use glam;

pub use anatomy::Scene;
pub use pose::Pose;
pub use render::{Frame, Renderer};
pub use station::Station;

#[cfg(feature = "live")]
pub mod pipeline;

#[cfg(feature = "live")]
pub mod chooser;

pub mod measuring;

pub mod dataset;

pub mod report;

pub mod station;

pub mod sink;

pub mod presented;

pub mod generator;

pub mod selftest;

pub mod quality;

pub mod exam;

pub(crate) use insonify_core::{lanes, simd, suggest};
