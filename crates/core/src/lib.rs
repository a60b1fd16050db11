//! The base of insonify, a real-time ultrasound simulator: probes, scenes, poses, acoustic formulas and settings.
//!
//! ```
//! use glam::Vec3;
//! use insonify_core::anatomy::{Scene, TissueTable, analytic::sphere};
//! use insonify_core::transducer::Probe;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // A cyst in a liver that fills the rest of space. Lengths are in mm.
//! let mut scene = Scene::new(TissueTable::builtin()?, "liver")?;
//! scene.add("cyst", "amniotic_fluid", 1, sphere(Vec3::new(0.0, 0.0, 70.0), 20.0, 3))?;
//! assert_eq!(scene.triangle_count(), 1280);
//!
//! // The middle scanline of a convex probe leaves the centre of its face along z.
//! let probe = Probe::default();
//! let (origin_mm, direction) = probe.ray(probe.lateral_coordinate(0.5));
//! assert_eq!((origin_mm.length(), direction.z), (0.0, 1.0));
//! # Ok(())
//! # }
//! ```
//!
//! A module knows only those below it in this table.
//!
//! | module | holds |
//! |---|---|
//! | [`needle`] | pose of a tracked needle, the way of its tip |
//! | [`transducer`] | geometry of a probe, and of its sector in the image |
//! | [`anatomy`] | scenes: surfaces, tissues, motion, glTF files, bounding-volume hierarchy, checks |
//! | [`pose`] | poses: their estimation from tracker records, calibration, registration |
//! | [`acoustics`] | formulas in f64: interfaces, attenuation, decibels, pulse, beam |
//! | [`settings`](mod@settings) | every setting once: key, unit, range, default, and what a change requires |
//! | [`files`], [`statistics`], [`random`], [`names`], [`suggest`] | size limits of reading, moments, random numbers, names of enums, spelling |
//! | [`lanes`], [`simd`], [`instructions`] | jobs on several threads, loops on vectors, vector instructions in use |
//!
//! Lengths are in mm, frequency in MHz, speed in m/s, attenuation in dB/cm/MHz. The unit is in the name.

pub mod needle;

pub mod transducer;

pub mod anatomy;

pub mod pose;

pub mod acoustics;

pub mod settings;

pub mod files;

pub mod statistics;

pub mod random;

pub mod lanes;

pub mod suggest;

pub mod names;

pub mod simd;

pub mod instructions;
