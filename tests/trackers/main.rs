//! Sessions with emulated devices on pseudo-terminals and sockets, and properties of the Polhemus decoders.
// clippy.toml allows these in test functions only, not in what they share.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs, unreachable_pub)]

#[cfg(all(feature = "serial", feature = "hid"))]
mod command;
#[cfg_attr(not(feature = "serial"), allow(dead_code))]
mod ear;
#[allow(dead_code)]
mod polhemus;
#[cfg(all(unix, feature = "serial"))]
mod ports;
mod properties;
mod sockets;
