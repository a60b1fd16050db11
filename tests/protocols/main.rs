//! Wire formats: an NDI device emulated, streams cut, damaged and made up, and the OpenIGTLink server with its clients.
// clippy.toml allows these in test functions only, not in what they share.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod fuzzed;
mod messages;
mod ndi;
mod ndi_device;
mod server;
mod streams;
