//! An OpenIGTLink server (TCP 18944): images and transforms for 3D Slicer, PLUS, or any other client.
//!
//! Each presented frame goes to every client as three version 1 messages:
//!
//! | message | device | content |
//! |---|---|---|
//! | `STATUS` | `Tracking` | 1 (all is well), or 13 (not ready) while the sensor is stuck, or the pose stale or lost |
//! | `TRANSFORM` | `ProbeToScene` | the probe's pose; left out while the status is not 1 |
//! | `IMAGE` | `Image` | the picture, u8, one slice, at its pose in the scene |
//!
//! # Frames
//! All coordinates are RAS, mm, as in 3D Slicer. The scene stands for the patient; [`SceneAxes`] gives the directions
//! of its axes. The image's first index runs along the probe's x (lateral), its second along the probe's z (into the
//! body). So the image's normal is the probe's −y. Its position is its centre, as the protocol requires. 3D
//! Slicer therefore shows the image at the probe's pose: do *not* put it under `ProbeToScene` as well. Before the
//! first pose, the probe is at the scene's origin.
//!
//! # Clients
//! Each client has a task of its own and takes the newest frame when it is ready; skipped frames are counted. A
//! client that doesn't read delays no other. A client that reads nothing for [`STALL_LIMIT`] is disconnected. The
//! protocol has no password: anyone who reaches the port sees the picture. Therefore the default address is loopback.

use std::net::{IpAddr, Ipv4Addr};

mod scene_axes;
#[cfg(feature = "live")]
mod server;
#[cfg(feature = "live")]
mod sink;

pub use scene_axes::{SceneAxes, SceneAxesError};
#[cfg(feature = "live")]
pub use server::{Counters, STALL_LIMIT};
#[cfg(feature = "live")]
pub use sink::OpenIgtLink;

use crate::settings::settings;
use crate::tracker::openigtlink::TCP_PORT;

settings! {
    /// Server settings of a station.
    #[derive(Debug, Clone, PartialEq)]
    pub struct Settings in "openigtlink" {
        /// Port of the server; 0 takes any free port.
        port: u16 = TCP_PORT, "", 0.0..=65_535.0, Everything;

        /// Thickness of the image slice, as sent to the clients.
        slice_mm: f64 = 1.0, "mm", 0.01..=100.0, Everything;

        /// Largest number of clients connected at a time; others are turned away.
        clients_max: u32 = 16, "", 1.0..=256.0, Everything;
    }
    plain {
        /// Address to listen at.
        address: IpAddr = Ipv4Addr::LOCALHOST.into(), Everything;
        /// Directions of the scene's axes.
        scene_axes: SceneAxes = SceneAxes::default(), Everything;
    }
}
