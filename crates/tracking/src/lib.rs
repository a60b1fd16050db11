//! Trackers of insonify, a real-time ultrasound simulator.
//!
//! | module | holds |
//! |---|---|
//! | [`tracker`] | decoders of protocols; sessions with devices: features `live`, `serial`, `hid` |
//! | [`recording`] | recordings of sessions (feature `recordings`), and interchange with other programs |

pub mod tracker;

pub mod recording;
