//! Tests of wire formats: an emulated NDI device; split, damaged and arbitrary streams; the OpenIGTLink server and its
//! clients.
// clippy.toml allows these in test functions only, not in their helpers.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod fuzzed;
pub(crate) mod messages;
mod ndi;
pub(crate) mod ndi_device;
mod server;
mod streams;
