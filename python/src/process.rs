//! Whether this process was forked from one that had imported the module.

use std::sync::OnceLock;

static IMPORTED_BY: OnceLock<u32> = OnceLock::new();

/// Notes the process that imports the module.
pub(crate) fn note_import() {
    IMPORTED_BY.get_or_init(std::process::id);
}

/// Whether this is another process than the one that imported the module.
pub(crate) fn is_forked() -> bool {
    IMPORTED_BY.get().is_some_and(|process| *process != std::process::id())
}
