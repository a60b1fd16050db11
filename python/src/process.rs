//! Detection of processes that were forked after they imported the module.

use std::sync::OnceLock;

static IMPORTED_BY: OnceLock<u32> = OnceLock::new();

/// Stores the identifier of the process that imports the module.
pub(crate) fn note_import() {
    IMPORTED_BY.get_or_init(std::process::id);
}

/// Whether this process is a fork of the one that imported the module.
pub(crate) fn is_forked() -> bool {
    IMPORTED_BY.get().is_some_and(|process| *process != std::process::id())
}
