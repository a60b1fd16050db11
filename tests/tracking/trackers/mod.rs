//! Tests of sessions with emulated devices on pseudo-terminals and sockets, and of the Polhemus decoders' properties.
// clippy.toml allows these in test functions only, not in their helpers.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs, unreachable_pub)]

#[cfg(all(feature = "serial", feature = "hid"))]
mod command;
#[cfg(unix)]
mod landmarks;
#[allow(dead_code)]
mod listener;
#[cfg(all(target_os = "linux", feature = "serial"))]
mod ndi;
#[cfg(unix)]
mod needle;
#[allow(dead_code)]
mod polhemus;
#[cfg(all(unix, feature = "serial"))]
mod ports;
#[cfg(unix)]
mod probe;
mod properties;
mod sockets;
#[cfg(all(feature = "serial", feature = "hid"))]
mod told;
