//! Tables of classes: the tissue of each label of a segmentation.
//!
//! The built-in tables have the classes of TotalSegmentator by name and number, and the numbers of other tools and
//! data sets. Names of all built-in tables are always known. Numbers are looked up in the chosen table alone.

mod class;
mod error;
mod file_name;
mod key;
mod map;
mod table;
mod unused;

pub use class::{Class, Gas, Role, Wall};
pub use error::ClassError;
pub use file_name::{CommonWords, OrganInName, VOLUME_SUFFIXES, common_words, organ_in_name, stem};
pub use map::{MappedSegment, Unmapped};
pub use table::ClassTable;
pub use unused::{Mappable, check_mappings};
