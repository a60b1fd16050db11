//! Files that the program reads and writes: size limits, unfinished files, and the cache.

mod cache;
mod error;
mod grey;
mod hex;
mod inside;
mod kind;
mod memory;
mod npy;
mod other_kind;
mod outputs;
mod part;
mod read;
mod stand_in;
mod toml_reason;

pub use cache::cache_directory;
pub use error::FileError;
pub use grey::GreyError;
pub use grey::read_grey;
pub use hex::hex;
pub use inside::inside;
pub use kind::FileKind;
pub use memory::{NoMemory, memory_for};
pub use npy::npy;
pub use outputs::{OutputError, Outputs};
pub use part::{PartError, PartFile};
pub use read::{open, read, read_text};
pub use toml_reason::{backslashes, toml_reason};
