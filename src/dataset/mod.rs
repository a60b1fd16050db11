//! Data sets of paired frames for training generators. A tuple is one pair: low and high quality of the same pose, with
//! segmentation and attenuation.
//!
//! A data set is a directory with `dataset.json` ([`Header`]) and one row per tuple in `manifest*.jsonl` ([`Row`]).
//! Each tuple is a `uint8` array [4 × height × width] in `tuples/`. `masks/` holds the sectors' masks, `stations/` the
//! station files. The content is planned from a seed before rendering ([`Plan`]).
//!
//! ```no_run
//! use std::path::Path;
//!
//! use insonify::Station;
//! use insonify::dataset::{Dataset, Maker, Recipe};
//! use insonify::render::{Backend, BackendChoice};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let backend = Backend::open(BackendChoice::Auto)?;
//! let station = Station::load(Path::new("configs/obstetric.toml"))?;
//! let maker = Maker::new(Recipe { frames: 100, ..Recipe::new(vec![station]) })?;
//! let made = maker.make(Path::new("data"), &backend, &|step| println!("{step:?}"))?;
//! println!("{} for training, {} for the test", made.train, made.test);
//! let verified = Dataset::open(Path::new("data"))?.verify(&backend, 10, &|_| ())?;
//! assert_eq!(verified.same(), verified.tuples);
//! # Ok(())
//! # }
//! ```

mod error;
mod job;
mod levels;
mod maker;
mod plan;
mod read;
mod recipe;
mod row;
mod scenes;
mod stations;
mod step;
mod store;
mod sum;
mod targets;
mod tuple_renderer;
mod variation;
mod verify;

pub use error::DatasetError;
pub use job::{Job, Made};
pub use maker::{Maker, Planned};
pub use plan::{Exam, Moment, Plan, Shard, Source, Wishes};
pub use read::{Dataset, Tuple, manifests, read_rows};
pub use recipe::Recipe;
pub use row::{CompoundingRow, ExamRow, Header, PoseRow, RollingRow, Row, ScanRow, SettingsRow, Split, StationRow};
pub(crate) use scenes::{Scenes, TupleScene};
pub use step::{Progress, Step};
pub(crate) use tuple_renderer::TupleRenderer;
pub use variation::parameters;
pub use verify::Verified;

/// Version of the data set's directory layout.
pub const FORMAT: u32 = 1;

/// Planes of a tuple, in order: grey levels of low quality, grey levels of high quality, tissue classes (indices in
/// [`Header::classes`]), and 255 × the attenuation map to the power of [`ATTENUATION_POWER`].
pub const PLANES: [&str; 4] = ["lq", "hq", "segmentation", "attenuation"];

/// Exponent applied to the attenuation map in a tuple. The map spans ten decades, of which eight linear bits would hold
/// only two. With the exponent, values from 1.5e-11 on are not rounded to 0, and rounding errors are below 15 % above
/// 1e-5.
pub const ATTENUATION_POWER: f32 = 0.25;

/// Name of the header file in the data set's directory.
pub const HEADER_FILE: &str = "dataset.json";
