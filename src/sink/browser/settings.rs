//! Browser settings of a station: address, token and number of pages.

use std::net::{IpAddr, Ipv4Addr};

/// Fewest characters of a token that a person chose.
pub const TOKEN_CHARS_MIN: usize = 16;

/// The `[browser]` of a station.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Settings {
    /// Address to listen at. Beyond loopback a token is demanded.
    pub address: IpAddr,
    /// Port; 0 takes any free one.
    pub port: u16,
    /// Token to demand, at least [`TOKEN_CHARS_MIN`] characters of A-Z, a-z, 0-9, `-` and `_`; none: a random one for each
    /// session where the address is not loopback.
    pub token: Option<String>,
    /// Name under which browsers reach the station, beside its addresses.
    pub host_name: Option<String>,
    /// Most pages that may watch at a time.
    pub clients_max: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self { address: IpAddr::V4(Ipv4Addr::LOCALHOST), port: 8790, token: None, host_name: None, clients_max: 8 }
    }
}

impl Settings {
    /// Whether `token` may stand in an address and is long enough.
    pub fn accepts_token(token: &str) -> bool {
        token.len() >= TOKEN_CHARS_MIN && token.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-' || b == b'_')
    }
}
