//! State of a station that several threads share.

use std::sync::{Mutex, PoisonError};

use crate::described::Described;
use crate::rendering::Slot;

/// A station's description and renderer, shared by the threads that work for it.
pub(crate) struct SharedStation {
    described: Mutex<Described>,
    pub(crate) rendering: Slot,
}

impl SharedStation {
    pub(crate) fn new(described: Described) -> Self {
        Self { described: Mutex::new(described), rendering: Mutex::new(None) }
    }

    /// Replaces the description.
    pub(crate) fn describe(&self, next: Described) {
        *self.described.lock().unwrap_or_else(PoisonError::into_inner) = next;
    }

    /// The present description.
    pub(crate) fn described(&self) -> Described {
        self.described.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}
