//! Rule for the tracked needle.

use super::bound::Bound;
use super::rules::{Finding, Rules, finding};

impl Rules<'_> {
    /// The needle is called for by stations that have one with an echo.
    pub(super) fn needle(&self) -> Finding {
        match self.settings.needle {
            None => finding("the station has no needle", Bound::Exact),
            Some(needle) if !needle.echoes() => finding("a pointer has no echo", Bound::Exact),
            Some(needle) => {
                let reason = format!("a needle of {} gauge, {} mm long", needle.gauge, needle.length_mm);
                finding(reason, Bound::none("the needle"))
            }
        }
    }
}
