//! Scenes of insonify, a real-time ultrasound simulator.
//!
//! | module | holds |
//! |---|---|
//! | [`phantom`] | the obstetric phantom: an individual from its parameters |
//! | [`segmentation`] | scenes from label maps and meshes of patients |

pub mod phantom;

pub mod segmentation;
