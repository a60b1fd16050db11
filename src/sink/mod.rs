//! Where frames go: images, arrays, videos and contact sheets on disk; pages and windows of a live station.
//!
//! Every file is written under a temporary name beside its target and renamed when it is whole, so that a reader never
//! sees half of one. Every error names the file.

pub mod browser;
pub mod colour;
pub mod contact_sheet;
pub mod control;
pub mod frame_files;
pub mod frame_record;
pub mod hot_keys;
pub mod live;
pub mod meta_image;
pub mod mp4;
pub mod npy;
pub mod openigtlink;
pub mod png;
pub mod time_table;
pub mod video;
pub mod window;
pub mod y4m;

mod canvas;
mod error;
mod file;

pub use contact_sheet::ContactSheet;
pub use error::SinkError;
pub use file::{create_dir, remove, write_json, write_with};
pub use frame_files::FrameFiles;
pub use frame_record::FrameRecord;
pub use time_table::TimeTable;
pub use video::{FrameRate, Video};
