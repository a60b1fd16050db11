//! Files at the edge of the program: reading within limits of size, and files that are not complete yet.

mod part;
mod read;

pub use part::{PartError, PartFile};
pub use read::{FileKind, open, read, read_text};
