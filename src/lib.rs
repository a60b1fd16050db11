//! insonify: a real-time ultrasound simulator for training stations.
//!
//! Data flows one way: pose → rays → segments → baseband lines → polar frame → Cartesian maps → generator → sink.
//! A module knows only those listed below it here; nothing points upward.
//!
//! Lengths are in mm, frequency in MHz, speed in m/s, attenuation in dB/cm/MHz and impedance in MRayl;
//! the unit is in the name. Transforms are named `a_from_b`.

pub mod pipeline;

pub mod chooser;

pub mod report;

pub mod station;

pub mod sink;

pub mod generator;

pub mod tradeoff;

pub mod selftest;

pub mod quality;

pub mod dataset;

pub mod exam;

pub mod render;

pub mod transducer;

pub mod anatomy;

pub mod tracker;

pub mod pose;

pub mod acoustics;

pub mod look;

pub mod settings;

pub mod files;

pub mod statistics;

pub mod random;

mod suggest;

mod names;

mod simd;
