//! Origin of a page: scheme, host and port, as a browser sends it.

use std::fmt;
use std::net::Ipv6Addr;
use std::str::FromStr;

use thiserror::Error;

/// Longest name of a host, bytes (RFC 1035).
const HOST_BYTES_MAX: usize = 253;

/// Scheme, host and port of a page's address, for example `https://station.local:9000`.
///
/// Hosts are in lower case and have only letters, digits, `-`, `.`, `_`, and for IPv6 `[`, `]` and `:`. An origin thus
/// needs no escaping when printed.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Origin {
    is_https: bool,
    host: String,
    port: u16,
}

/// Error: the text is not an origin.
#[derive(Debug, Error, Clone, Copy, PartialEq, Eq)]
#[error("an origin is http:// or https://, a name or address, and a port if it isn't 80 or 443, without path")]
pub struct NotAnOrigin;

impl Origin {
    /// An origin of a scheme and an authority (`host` or `host:port`); `None` if the authority is invalid.
    pub fn new(is_https: bool, authority: &str) -> Option<Self> {
        let (host, port) = match authority.rsplit_once(':') {
            // In a bare IPv6 address, the last colon is within the brackets.
            Some((host, port)) if !port.ends_with(']') => (host, Some(port)),
            _ => (authority, None),
        };
        let port = match port {
            None => Self::default_port(is_https),
            Some(digits) if digits.bytes().all(|b| b.is_ascii_digit()) => digits.parse().ok().filter(|&p| p > 0)?,
            Some(_) => return None,
        };
        let host = host.to_ascii_lowercase();
        is_host(&host).then_some(Self { is_https, host, port })
    }

    const fn default_port(is_https: bool) -> u16 {
        if is_https { 443 } else { 80 }
    }

    /// Whether the scheme is https.
    pub fn is_https(&self) -> bool {
        self.is_https
    }

    /// Host name or address in lower case; an IPv6 address is in brackets.
    pub fn host(&self) -> &str {
        &self.host
    }

    /// Port; the scheme's default if the address states none.
    pub fn port(&self) -> u16 {
        self.port
    }
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { is_https, host, port } = self;
        let scheme = if *is_https { "https" } else { "http" };
        if *port == Self::default_port(*is_https) {
            write!(f, "{scheme}://{host}")
        } else {
            write!(f, "{scheme}://{host}:{port}")
        }
    }
}

impl FromStr for Origin {
    type Err = NotAnOrigin;

    fn from_str(text: &str) -> Result<Self, NotAnOrigin> {
        let (scheme, authority) = text.split_once("://").ok_or(NotAnOrigin)?;
        let is_https = match scheme.to_ascii_lowercase().as_str() {
            "http" => false,
            "https" => true,
            _ => return Err(NotAnOrigin),
        };
        // Browsers show the slash of the root path.
        Self::new(is_https, authority.strip_suffix('/').unwrap_or(authority)).ok_or(NotAnOrigin)
    }
}

/// Whether `host` is a name or an address, in lower case.
fn is_host(host: &str) -> bool {
    if let Some(address) = host.strip_prefix('[') {
        return address.strip_suffix(']').is_some_and(|address| address.parse::<Ipv6Addr>().is_ok());
    }
    let is_part = |b: u8| b.is_ascii_alphanumeric() || b == b'-' || b == b'_' || b == b'.';
    !host.is_empty() && host.len() <= HOST_BYTES_MAX && host.bytes().all(is_part)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn origins_are_read_as_browsers_write_them() {
        for (text, shown) in [
            ("https://station.local:9000", "https://station.local:9000"),
            ("HTTPS://Station.Local:9000/", "https://station.local:9000"),
            ("http://192.168.0.7:80", "http://192.168.0.7"),
            ("https://a:443", "https://a"),
            ("https://a:80", "https://a:80"),
            ("http://[::1]:9000", "http://[::1]:9000"),
            ("http://[fe80::1]", "http://[fe80::1]"),
            ("http://xn--mnchen-3ya.de", "http://xn--mnchen-3ya.de"),
        ] {
            assert_eq!(text.parse::<Origin>().map(|origin| origin.to_string()).as_deref(), Ok(shown), "{text}");
        }
    }

    #[test]
    fn anything_else_is_refused() {
        let long = format!("http://{}", "a".repeat(254));
        for text in [
            "",
            "null",
            "station.local",
            "station.local:9000",
            "ftp://a",
            "http://",
            "http://a/b",
            "http://a?b",
            "http://a#b",
            "http://a:",
            "http://a:0",
            "http://a:65536",
            "http://a:+1",
            "http://a:1:2",
            "http://u@a",
            "http://*.a",
            "http://[a]",
            "http://::1",
            "http://a b",
            "http://a\"]",
            "http://a\nb",
            "http://münchen.de",
            "http://<b>",
            &long,
        ] {
            assert_eq!(text.parse::<Origin>(), Err(NotAnOrigin), "{text}");
        }
    }
}
