//! Access control of the page by token, `Host` and `Origin`.
//!
//! A foreign page in the same browser reaches the port, too. Its requests carry its own `Origin`, or, after it has made its
//! name point here (DNS rebinding), its own name as `Host`; both are refused. Numeric addresses can't be rebound.

use std::net::{IpAddr, SocketAddr};

use axum::http::HeaderMap;
use axum::http::header::{COOKIE, HOST, ORIGIN};
use axum::http::uri::Authority;
use base64::Engine as _;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use sha2::{Digest, Sha256};

use super::Settings;

/// Values that requests are checked against.
#[derive(Debug)]
pub(super) struct Access {
    local: SocketAddr,
    host_name: Option<String>,
    token: Option<String>,
}

impl Access {
    /// Rules for a server that listens at `local`.
    ///
    /// # Errors
    /// The operating system gives no random bytes.
    pub(super) fn new(settings: &Settings, local: SocketAddr) -> Result<Self, getrandom::Error> {
        let token = match &settings.token {
            Some(token) => Some(token.clone()),
            None if local.ip().is_loopback() => None,
            None => Some(random_token()?),
        };
        Ok(Self { local, host_name: settings.host_name.as_ref().map(|name| name.to_ascii_lowercase()), token })
    }

    /// The address to open, with the token.
    pub(super) fn url(&self) -> String {
        let host = match &self.host_name {
            Some(name) => format!("{name}:{}", self.local.port()),
            None => SocketAddr::new(reachable(self.local.ip()), self.local.port()).to_string(),
        };
        match &self.token {
            Some(token) => format!("http://{host}/?token={token}"),
            None => format!("http://{host}/"),
        }
    }

    /// Whether a token is demanded.
    pub(super) fn demands_token(&self) -> bool {
        self.token.is_some()
    }

    /// Whether the request's `Host` is a name or address of this server.
    pub(super) fn accepts_host(&self, headers: &HeaderMap) -> bool {
        let Some(authority) = host(headers) else { return false };
        if authority.port_u16().unwrap_or(80) != self.local.port() || authority.as_str().contains('@') {
            return false;
        }
        let name = authority.host().to_ascii_lowercase();
        let digits = name.trim_start_matches('[').trim_end_matches(']');
        match digits.parse::<IpAddr>() {
            Ok(ip) => ip.is_loopback() || !self.local.ip().is_loopback(),
            Err(_) => name == "localhost" || self.host_name.as_deref() == Some(&name),
        }
    }

    /// Whether the request comes from a page of this server, or from no page at all.
    pub(super) fn accepts_origin(&self, headers: &HeaderMap) -> bool {
        let Some(origin) = headers.get(ORIGIN) else { return true };
        let Some(authority) = host(headers) else { return false };
        origin.to_str().ok().and_then(|o| o.strip_prefix("http://")) == Some(authority.as_str())
    }

    /// Whether `given` is the token; the comparison takes constant time.
    pub(super) fn accepts_token(&self, given: &str) -> bool {
        let Some(token) = &self.token else { return true };
        let (given, wanted) = (Sha256::digest(given), Sha256::digest(token));
        given.iter().zip(&wanted).fold(0, |differing, (a, b)| differing | (a ^ b)) == 0
    }

    /// Whether the request carries the token in this server's cookie.
    pub(super) fn accepts_cookie(&self, headers: &HeaderMap) -> bool {
        let name = self.cookie_name();
        let cookies = headers.get_all(COOKIE).iter().filter_map(|value| value.to_str().ok());
        let mut pairs = cookies.flat_map(|value| value.split(';')).filter_map(|pair| pair.trim().split_once('='));
        pairs.any(|(key, value)| key == name && self.accepts_token(value))
    }

    /// `Set-Cookie` value that stores the token for later requests.
    pub(super) fn cookie(&self) -> Option<String> {
        let token = self.token.as_ref()?;
        Some(format!("{}={token}; Path=/; HttpOnly; SameSite=Strict", self.cookie_name()))
    }

    /// Name of the cookie, with the port: browsers share cookies between the ports of a host.
    fn cookie_name(&self) -> String {
        format!("insonify_{}", self.local.port())
    }
}

fn host(headers: &HeaderMap) -> Option<Authority> {
    let mut hosts = headers.get_all(HOST).iter();
    let first = hosts.next()?;
    if hosts.next().is_some() {
        return None;
    }
    first.to_str().ok()?.parse().ok()
}

fn random_token() -> Result<String, getrandom::Error> {
    let mut bytes = [0; 24];
    getrandom::fill(&mut bytes)?;
    Ok(URL_SAFE_NO_PAD.encode(bytes))
}

/// Address that a browser can open: for the unspecified address, that of this machine's outbound route.
fn reachable(ip: IpAddr) -> IpAddr {
    if !ip.is_unspecified() {
        return ip;
    }
    let (any, documentation, loopback): (IpAddr, IpAddr, IpAddr) = match ip {
        IpAddr::V4(_) => (ip, [192, 0, 2, 1].into(), [127, 0, 0, 1].into()),
        IpAddr::V6(_) => (ip, [0x2001, 0xdb8, 0, 0, 0, 0, 0, 1].into(), [0, 0, 0, 0, 0, 0, 0, 1].into()),
    };
    // Connecting a UDP socket sends nothing; it only picks the route.
    let socket = std::net::UdpSocket::bind((any, 0));
    let local = socket.and_then(|s| s.connect((documentation, 9)).and_then(|()| s.local_addr()));
    local.map_or(loopback, |address| address.ip())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn access(local: &str, settings: Settings) -> Access {
        Access::new(&settings, local.parse().unwrap()).unwrap()
    }

    fn headers(pairs: &[(&'static str, &str)]) -> HeaderMap {
        pairs.iter().map(|(name, value)| (name.parse().unwrap(), value.parse().unwrap())).collect()
    }

    #[test]
    fn a_loopback_server_answers_to_loopback_names_only() {
        let access = access("127.0.0.1:8790", Settings::default());
        for host in ["127.0.0.1:8790", "localhost:8790", "LOCALHOST:8790", "[::1]:8790"] {
            assert!(access.accepts_host(&headers(&[("host", host)])), "{host}");
        }
        let wrong =
            ["evil.example:8790", "127.0.0.1", "127.0.0.1:80", "192.168.0.7:8790", "localhost.evil.example:8790"];
        for host in wrong.into_iter().chain(["", "a@127.0.0.1:8790", "127.0.0.1.evil.example:8790", "localhost.:8790"])
        {
            assert!(!access.accepts_host(&headers(&[("host", host)])), "{host}");
        }
        assert!(!access.accepts_host(&headers(&[])));
        assert!(!access.accepts_host(&headers(&[("host", "localhost:8790"), ("host", "localhost:8790")])));
        assert!(!access.demands_token() && access.url() == "http://127.0.0.1:8790/");
    }

    #[test]
    fn an_open_server_answers_to_addresses_and_its_configured_name() {
        let settings = Settings { host_name: Some("Station.local".into()), ..Settings::default() };
        let access = access("0.0.0.0:80", settings);
        for host in ["192.168.0.7", "192.168.0.7:80", "station.LOCAL", "localhost", "[fe80::1]:80"] {
            assert!(access.accepts_host(&headers(&[("host", host)])), "{host}");
        }
        assert!(!access.accepts_host(&headers(&[("host", "evil.example")])));
        assert!(access.demands_token());
    }

    #[test]
    fn only_its_own_pages_may_connect() {
        let access = access("127.0.0.1:8790", Settings::default());
        let with = |origin| access.accepts_origin(&headers(&[("host", "127.0.0.1:8790"), ("origin", origin)]));
        assert!(with("http://127.0.0.1:8790"));
        for origin in
            ["http://evil.example", "null", "https://127.0.0.1:8790", "http://127.0.0.1:8791", "http://localhost:8790"]
        {
            assert!(!with(origin), "{origin}");
        }
        assert!(access.accepts_origin(&headers(&[("host", "127.0.0.1:8790")])));
    }

    #[test]
    fn tokens_are_random_and_checked_whole() {
        let [one, other] = [0, 1].map(|_| access("192.168.0.7:8790", Settings::default()));
        let token = one.token.clone().unwrap();
        assert!(Settings::accepts_token(&token) && token.len() == 32);
        assert_ne!(one.token, other.token);
        assert!(one.accepts_token(&token));
        for wrong in [&token[..31], &format!("{token}a"), "", &token.to_uppercase()] {
            assert!(!one.accepts_token(wrong), "{wrong}");
        }
        assert!(one.url().ends_with(&format!("/?token={token}")));
        let cookie = one.cookie().unwrap();
        assert!(cookie.contains("HttpOnly") && cookie.contains("SameSite=Strict"));
        let pair = cookie.split(';').next().unwrap();
        assert!(one.accepts_cookie(&headers(&[("cookie", &format!("other=1; {pair}"))])));
        assert!(!one.accepts_cookie(&headers(&[("cookie", "insonify_8790=")])));
        assert!(!other.accepts_cookie(&headers(&[("cookie", pair)])));
    }
}
