//! Data sets of paired frames for training generators: low and high quality of the same pose, with segmentation and
//! attenuation.
//!
//! A data set is a directory: `dataset.json` ([`Header`]), one row a tuple in `manifest*.jsonl` ([`Row`]), the tuples
//! themselves as `uint8` arrays [4 × height × width] in `tuples/`, the masks of the sectors in `masks/`, and the station
//! files in `stations/`. What is in it is planned from a seed before anything is rendered ([`Plan`]); rendering itself is
//! `insonify dataset`'s.

mod error;
mod plan;
mod read;
mod row;
mod variation;

pub use error::DatasetError;
pub use plan::{Exam, Moment, Plan, Shard, Source, Wishes};
pub use read::{Dataset, Tuple, manifests, read_rows};
pub use row::{ExamRow, Header, PoseRow, Row, SettingsRow, Split, StationRow};
pub use variation::parameters;

/// Version of the directory's layout.
pub const FORMAT: u32 = 1;

/// Planes of a tuple, in order: grey levels of low and high quality, numbers of tissues ([`Header::classes`]), and
/// 255 × the attenuation map to the power of [`ATTENUATION_POWER`].
pub const PLANES: [&str; 4] = ["lq", "hq", "segmentation", "attenuation"];

/// Exponent of the attenuation map in a tuple: the map falls over ten decades, of which eight linear bits hold two. The
/// least that is told from 0 is 4e-12, and a step is less than 9 % above 1e-5 of the greatest.
pub const ATTENUATION_POWER: f32 = 0.25;

/// File of the header in its directory.
pub const HEADER_FILE: &str = "dataset.json";
