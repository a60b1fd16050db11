//! Access control of the page by token, `Host` and `Origin`.
//!
//! A foreign page in the same browser can reach the port, too. Two headers tell it apart, because browsers set them
//! and pages can't change them.
//!
//! - `Host` is the name in the page's address. DNS rebinding makes a foreign name point here; such names are refused.
//!   Accepted are numeric addresses, `localhost`, `browser.host_name`, and the hosts in `browser.origins`. A numeric
//!   address can't be rebound, and browsers resolve `localhost` themselves. A server on loopback accepts loopback
//!   addresses only. Any port is valid, because `ssh -L` or a container's mapping gives the browser another port than
//!   the server's. A foreign page gains nothing by this, because its own address would have to lead here.
//! - `Origin` is the address of the page that makes the request. Accepted are `http://` with exactly the request's
//!   `Host` and port, and the entries of `browser.origins`. A server at another port of `localhost` is a foreign page.
//!   Behind an HTTPS proxy the scheme differs, so the proxy's origin must be listed.

use std::net::{IpAddr, SocketAddr};

use axum::http::HeaderMap;
use axum::http::header::{COOKIE, HOST, ORIGIN};
use base64::Engine as _;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use sha2::{Digest, Sha256};

use super::Settings;
use crate::settings::Origin;

/// Header in which proxies say the scheme of the browser's request.
const FORWARDED_PROTO: &str = "x-forwarded-proto";

/// Token, names, addresses and configured origins against which requests are checked.
#[derive(Debug)]
pub(super) struct Access {
    local: SocketAddr,
    host_name: Option<String>,
    origins: Vec<Origin>,
    token: Option<String>,
}

impl Access {
    /// Rules for a server that listens at `local`. Without a configured token, a random one is demanded if the page
    /// can be reached from other computers: at the server's address, or through a configured origin.
    ///
    /// # Errors
    /// The operating system gives no random bytes.
    pub(super) fn new(settings: &Settings, local: SocketAddr) -> Result<Self, getrandom::Error> {
        let origins = settings.origins.clone();
        let is_private = local.ip().is_loopback() && origins.iter().all(|origin| is_loopback(origin.host()));
        let token = match &settings.token {
            Some(token) => Some(token.clone()),
            None if is_private => None,
            None => Some(random_token()?),
        };
        let host_name = settings.host_name.as_ref().map(|name| name.to_ascii_lowercase());
        Ok(Self { local, host_name, origins, token })
    }

    /// Address of the page, with the token.
    pub(super) fn url(&self) -> String {
        let host = match &self.host_name {
            Some(name) => format!("{name}:{}", self.local.port()),
            None => SocketAddr::new(reachable(self.local.ip()), self.local.port()).to_string(),
        };
        self.with_token(&format!("http://{host}"))
    }

    /// Addresses of the page at the configured origins, with the token.
    pub(super) fn origin_urls(&self) -> Vec<String> {
        self.origins.iter().map(|origin| self.with_token(&origin.to_string())).collect()
    }

    fn with_token(&self, origin: &str) -> String {
        match &self.token {
            Some(token) => format!("{origin}/?token={token}"),
            None => format!("{origin}/"),
        }
    }

    /// Whether a token is demanded.
    pub(super) fn demands_token(&self) -> bool {
        self.token.is_some()
    }

    /// Whether the request's `Host` is a name or address of this server.
    pub(super) fn accepts_host(&self, headers: &HeaderMap) -> bool {
        // The scheme is unknown, so a `Host` without a port may mean the default port of HTTP or HTTPS.
        [false, true]
            .into_iter()
            .any(|is_https| host(headers, is_https).is_some_and(|host| self.is_own(&host) || self.is_listed(&host)))
    }

    /// Whether the request comes from a page of this server, or from no page at all. The request's `Host` must be
    /// accepted already.
    pub(super) fn accepts_origin(&self, headers: &HeaderMap) -> bool {
        if !headers.contains_key(ORIGIN) {
            return true;
        }
        let Some(origin) = origin(headers) else { return false };
        let is_same = host(headers, false).is_some_and(|host| host == origin && self.is_own(&host));
        is_same || self.is_listed(&origin)
    }

    /// Whether an origin's host is a name or address of this server itself.
    fn is_own(&self, origin: &Origin) -> bool {
        let name = origin.host();
        match address(name) {
            Some(ip) => ip.is_loopback() || !self.local.ip().is_loopback(),
            None => name == "localhost" || self.host_name.as_deref() == Some(name),
        }
    }

    fn is_listed(&self, origin: &Origin) -> bool {
        self.origins.contains(origin)
    }

    /// Entry of `browser.origins` that would admit a request with this `Host`; `None` for an invalid `Host`. The
    /// scheme is a guess if no header tells it.
    pub(super) fn origin_of_host(&self, headers: &HeaderMap) -> Option<Origin> {
        let forwarded =
            headers.get(FORWARDED_PROTO).is_some_and(|proto| proto.as_bytes().eq_ignore_ascii_case(b"https"));
        let secure = host(headers, true);
        let is_https = forwarded || secure.as_ref().is_some_and(|host| origin(headers).as_ref() == Some(host));
        if is_https { secure } else { host(headers, false) }
    }

    /// Entry of `browser.origins` that would admit the request's page; `None` for an invalid `Origin`.
    pub(super) fn origin_of_page(&self, headers: &HeaderMap) -> Option<Origin> {
        origin(headers)
    }

    /// Whether `given` is the token; the comparison takes constant time.
    pub(super) fn accepts_token(&self, given: &str) -> bool {
        let Some(token) = &self.token else { return true };
        let (given, wanted) = (Sha256::digest(given), Sha256::digest(token));
        given.iter().zip(&wanted).fold(0, |differing, (a, b)| differing | (a ^ b)) == 0
    }

    /// Whether the request carries the token in this server's cookie.
    pub(super) fn accepts_cookie(&self, headers: &HeaderMap) -> bool {
        let name = cookie_name(headers);
        let cookies = headers.get_all(COOKIE).iter().filter_map(|value| value.to_str().ok());
        let mut pairs = cookies.flat_map(|value| value.split(';')).filter_map(|pair| pair.trim().split_once('='));
        pairs.any(|(key, value)| key == name && self.accepts_token(value))
    }

    /// `Set-Cookie` value that stores the token for later requests to the same `Host`; `None` without a token.
    pub(super) fn cookie(&self, headers: &HeaderMap) -> Option<String> {
        let token = self.token.as_ref()?;
        let is_https = host(headers, true).is_some_and(|host| self.is_listed(&host));
        let secure = if is_https { "; Secure" } else { "" };
        Some(format!("{}={token}; Path=/; HttpOnly; SameSite=Strict{secure}", cookie_name(headers)))
    }
}

/// Name of the cookie, which contains the port of the page's address. Browsers share cookies between all ports of a
/// host, and several stations may be forwarded to ports of one computer.
fn cookie_name(headers: &HeaderMap) -> String {
    format!("insonify_{}", host(headers, false).map_or(80, |host| host.port()))
}

/// The request's `Host` as an origin; `None` if it is missing, repeated or invalid.
fn host(headers: &HeaderMap, is_https: bool) -> Option<Origin> {
    let mut hosts = headers.get_all(HOST).iter();
    let first = hosts.next()?;
    if hosts.next().is_some() {
        return None;
    }
    Origin::new(is_https, first.to_str().ok()?)
}

/// The request's `Origin`; `None` if it is missing, `null` or invalid.
fn origin(headers: &HeaderMap) -> Option<Origin> {
    headers.get(ORIGIN)?.to_str().ok()?.parse().ok()
}

/// IP address that `host` spells; `None` if it is a name.
fn address(host: &str) -> Option<IpAddr> {
    host.trim_start_matches('[').trim_end_matches(']').parse().ok()
}

/// Whether `host` names this computer itself.
fn is_loopback(host: &str) -> bool {
    host == "localhost" || address(host).is_some_and(|ip| ip.is_loopback())
}

fn random_token() -> Result<String, getrandom::Error> {
    let mut bytes = [0; 24];
    getrandom::fill(&mut bytes)?;
    Ok(URL_SAFE_NO_PAD.encode(bytes))
}

/// Address that a browser can open. The unspecified address is replaced by the address of this machine's outbound
/// route.
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
        // A forwarded port differs from the server's.
        for host in ["127.0.0.1", "127.0.0.1:80", "localhost:9000", "[::1]:9000"] {
            assert!(access.accepts_host(&headers(&[("host", host)])), "{host}");
        }
        let wrong =
            ["evil.example:8790", "192.168.0.7:8790", "0.0.0.0:8790", "localhost.evil.example:8790", "", "null"];
        let odd = ["a@127.0.0.1:8790", "127.0.0.1.evil.example:8790", "localhost.:8790", "127.0.0.1:8790/", "::1:8790"];
        for host in wrong.into_iter().chain(odd) {
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
        for host in ["192.168.0.7:9000", "station.local:9000"] {
            assert!(access.accepts_host(&headers(&[("host", host)])), "{host}");
        }
        for host in ["evil.example", "station.local.evil.example", "other.local:80"] {
            assert!(!access.accepts_host(&headers(&[("host", host)])), "{host}");
        }
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
    fn a_page_behind_a_forwarded_port_is_its_own_and_its_neighbours_are_foreign() {
        let access = access("127.0.0.1:8790", Settings::default());
        let accepts = |host, origin| {
            let headers = headers(&[("host", host), ("origin", origin)]);
            access.accepts_host(&headers) && access.accepts_origin(&headers)
        };
        assert!(accepts("localhost:9000", "http://localhost:9000"));
        assert!(accepts("127.0.0.1:9000", "http://127.0.0.1:9000"));
        assert!(accepts("[::1]:9000", "http://[::1]:9000"));
        for (host, origin) in [
            ("localhost:9000", "http://localhost:3000"),
            ("localhost:9000", "http://127.0.0.1:9000"),
            ("localhost:9000", "https://localhost:9000"),
            ("localhost:9000", "http://evil.example:9000"),
            ("localhost:9000", "null"),
            ("evil.example:9000", "http://evil.example:9000"),
            ("127.0.0.1:8790", "http://localhost:9000"),
        ] {
            assert!(!accepts(host, origin), "{host} {origin}");
        }
    }

    #[test]
    fn listed_origins_are_accepted_exactly() {
        let origins = ["https://station.local:9000", "https://proxy.local"].map(|origin| origin.parse().unwrap());
        let access = access("127.0.0.1:8790", Settings { origins: origins.into(), ..Settings::default() });
        let accepts = |host, origin| {
            let headers = headers(&[("host", host), ("origin", origin)]);
            access.accepts_host(&headers) && access.accepts_origin(&headers)
        };
        assert!(accepts("station.local:9000", "https://station.local:9000"));
        assert!(accepts("STATION.local:9000", "https://station.local:9000"));
        assert!(accepts("proxy.local", "https://proxy.local"));
        // A proxy may send its own name for this server.
        assert!(accepts("127.0.0.1:8790", "https://station.local:9000"));
        for (host, origin) in [
            ("station.local:9000", "http://station.local:9000"),
            ("station.local:9001", "https://station.local:9001"),
            ("proxy.local", "http://proxy.local"),
            ("proxy.local:80", "https://proxy.local"),
            ("evil.example", "https://station.local:9000"),
            ("127.0.0.1:8790", "https://station.local"),
        ] {
            assert!(!accepts(host, origin), "{host} {origin}");
        }
        assert!(access.demands_token(), "the page can be reached beyond loopback");
        let urls = access.origin_urls();
        assert!(urls[0].starts_with("https://station.local:9000/?token="), "{urls:?}");
        let cookie = |host| access.cookie(&headers(&[("host", host)])).unwrap();
        assert!(cookie("proxy.local").ends_with("; Secure") && !cookie("127.0.0.1:8790").contains("Secure"));
        let loopback = ["http://localhost:9000".parse().unwrap()];
        let settings = Settings { origins: loopback.into(), ..Settings::default() };
        let with_loopback = Access::new(&settings, "127.0.0.1:8790".parse().unwrap()).unwrap();
        assert!(!with_loopback.demands_token());
    }

    #[test]
    fn stations_behind_ports_of_one_computer_keep_their_own_cookies() {
        let access = access("192.168.0.7:8790", Settings::default());
        let at = |port: &str| headers(&[("host", &format!("localhost:{port}"))]);
        let cookie = access.cookie(&at("9000")).unwrap();
        assert!(cookie.starts_with("insonify_9000="), "{cookie}");
        assert_ne!(access.cookie(&at("9001")).unwrap(), cookie);
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
        let at_one = [("host", "192.168.0.7:8790")];
        let cookie = one.cookie(&headers(&at_one)).unwrap();
        assert!(cookie.contains("HttpOnly") && cookie.contains("SameSite=Strict"));
        let pair = cookie.split(';').next().unwrap();
        assert!(one.accepts_cookie(&headers(&[at_one[0], ("cookie", &format!("other=1; {pair}"))])));
        assert!(!one.accepts_cookie(&headers(&[at_one[0], ("cookie", "insonify_8790=")])));
        assert!(!other.accepts_cookie(&headers(&[at_one[0], ("cookie", pair)])));
    }
}
