//! Offline reports for people: exams, self-tests, sheets, time tables, pictures of scenes.

pub mod comparison_sheet;
pub mod contact_sheet;
pub mod exam;
pub mod scene_view;
pub mod segmentation;
pub mod selftest;
pub mod time_table;

mod html;
mod other_load;

pub(crate) use comparison_sheet::ComparisonSheet;
pub use contact_sheet::ContactSheet;
pub use other_load::OtherLoad;
pub use time_table::TimeTable;
