//! The base of insonify, a real-time ultrasound simulator: what every other crate of it stands on.
//!
//! | module | holds |
//! |---|---|
//! | [`transducer`] | probes and their sectors |
//! | [`anatomy`] | scenes, tissues, solids, motion |
//! | [`pose`] | poses, their estimation and calibration |
//! | [`acoustics`] | formulas of sound in tissue |
//! | [`settings`] | every setting once |
//! | [`files`], [`statistics`], [`random`], [`names`], [`suggest`] | tools |
//! | [`lanes`], [`simd`] | jobs on several threads, loops on vectors |
//!
//! A module knows only those below it in this table.

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
