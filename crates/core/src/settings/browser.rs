//! Server of the browser page: address, token and number of pages.

use std::net::{IpAddr, Ipv4Addr};

use super::{Origin, settings};

/// Smallest number of characters of a configured token.
pub const TOKEN_CHARS_MIN: usize = 16;

settings! {
    /// The `[browser]` of a station.
    #[derive(Debug, Clone, PartialEq, Eq)]
    pub struct BrowserSettings in "browser" {
        /// Port of the server; 0 takes any free port.
        port: u16 = 8790, "", 0.0..=65_535.0, Everything;

        /// Largest number of pages that watch at the same time.
        clients_max: u32 = 8, "", 1.0..=64.0, Everything;
    }
    plain {
        /// Address at which the server listens. Addresses other than loopback require a token.
        address: IpAddr = Ipv4Addr::LOCALHOST.into(), Everything;
        /// Token that pages must present: at least [`TOKEN_CHARS_MIN`] characters of A-Z, a-z, 0-9, `-` and `_`. If
        /// `None`, each session has a random token, unless the address is loopback.
        token: Option<String> = None, Everything;
        /// Name under which browsers reach the station, in addition to its addresses.
        host_name: Option<String> = None, Everything;
        /// Further origins of the page, for example of an HTTPS proxy.
        origins: Vec<Origin> = Vec::new(), Everything;
    }
}

impl BrowserSettings {
    /// Whether `token` is long enough and has only characters that a URL allows.
    pub fn accepts_token(token: &str) -> bool {
        token.len() >= TOKEN_CHARS_MIN && token.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-' || b == b'_')
    }
}
