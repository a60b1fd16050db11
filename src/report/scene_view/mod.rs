//! Pictures of a scene with the probe and its fan (the imaged sector). They are made on the processor, so no graphics
//! driver is needed.
//!
//! Surfaces are shaded in the colours of their tissues. Layers that enclose others are transparent or hidden. A cut
//! removes everything in front of a plane, and shows the tissues in the plane. The projection is parallel, so one
//! scale holds everywhere.

mod annotate;
mod camera;
mod caster;
mod fan;
mod paint;
mod panel;
mod selection;
mod shading;

use thiserror::Error;

pub use camera::{Cut, Direction, Orbit};
pub(super) use fan::border_mm;
pub use fan::{BmodeImage, Fan};
pub use paint::{PIXELS_MAX, PictureSettings, SceneView};
pub use panel::Picture;
pub use selection::{Opacity, Selection};

/// Errors of scene pictures.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum ViewError {
    /// No surface, tissue or layer of the scene has this name.
    #[error("no surface, tissue or layer of the scene is called `{name}`{suggestion}")]
    UnknownName {
        /// Name that was requested.
        name: String,
        /// Nearest known name, ready to print, or empty.
        suggestion: String,
    },
    /// All surfaces are hidden.
    #[error("nothing is left to show: every surface is hidden")]
    NothingLeft,
    /// A text is no opacity.
    #[error("`{text}` is no opacity; it is NAME=PERCENT with 0..=100, for example fat=30")]
    Opacity {
        /// Text found.
        text: String,
    },
    /// A text is no direction.
    #[error("`{text}` is no direction; it is one of {}{suggestion}", Direction::names().join(", "))]
    Direction {
        /// Text found.
        text: String,
        /// Nearest direction, ready to print, or empty.
        suggestion: String,
    },
    /// A text is no orbit.
    #[error("`{text}` is no orbit; it is AZIMUTH,ELEVATION in degrees, -360..=360 and -90..=90, for example 30,20")]
    Orbit {
        /// Text found.
        text: String,
    },
    /// A text is no plane.
    #[error("`{text}` is no plane; it is `fan`, or x, y or z with a place in mm, for example z=40")]
    Cut {
        /// Text found.
        text: String,
    },
    /// The fan was requested without a pose of the probe.
    #[error("{what} needs a probe: give --pose, or a station with a [pose]")]
    NoFan {
        /// Option that needs the pose.
        what: &'static str,
    },
    /// The size of a picture is too small or too large.
    #[error(
        "a picture of {width} x {height} pixels; each side must lie in 64..=8192, and there may be {PIXELS_MAX} in all"
    )]
    Size {
        /// Requested width, pixels.
        width: u32,
        /// Requested height, pixels.
        height: u32,
    },
}
