//! Outputs for frames: image, array and video files; the page and the window of a live station.
//!
//! A file is written under a temporary name in the same directory and renamed when complete, so that readers never
//! see a partial one. Logs grow under their final name, videos under a name of their own. Every error names the file.

pub mod browser;
pub mod colour;
pub mod frame_files;
pub mod frame_line;
pub mod frame_log;
pub mod frame_record;
pub mod live;
#[cfg(feature = "video")]
pub mod live_video;
pub mod meta_image;
#[cfg(feature = "video")]
pub mod mp4;
pub mod npy;
pub mod null;
pub mod openigtlink;
pub mod png;
pub mod png_sequence;
mod stills;
pub mod video;
pub mod window;

pub(crate) mod canvas;
pub(crate) mod error;
mod file;
mod frame_directory;
mod frame_rate;
#[cfg(feature = "video")]
mod growing_mp4;
pub(crate) mod layers;
mod live_kind;

pub use error::SinkError;
pub(crate) use error::check_shape;
pub use file::{create_dir, remove, write_json, write_text};
pub(crate) use file::{write_bytes, write_with};
pub use frame_directory::{FrameDirectory, FrameFileError};
pub use frame_files::FrameFiles;
pub use frame_log::FrameLog;
pub use frame_rate::FrameRate;
pub use frame_record::FrameRecord;
pub use live_kind::{LiveSinkKind, UnknownSink};
#[cfg(feature = "video")]
pub(crate) use live_video::LiveVideo;
#[cfg(feature = "video")]
pub use mp4::Video;
pub use null::NullSink;
pub use png_sequence::PngSequence;
pub use stills::Stills;
