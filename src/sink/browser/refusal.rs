//! Answers to requests that the page's server refuses. Each says how to get access.
//!
//! `Host` and `Origin` come from strangers. They are shown only as an [`Origin`]: its characters need no escaping,
//! and its length is bounded.

use axum::http::HeaderMap;

use super::access::Access;
use crate::settings::Origin;

/// Answer to a request without the token.
pub(super) const TOKEN: &str = "this station demands a token: open the address that it prints when it starts; at another \
                                address of the page, add the same /?token=... to it\n";

/// Answer to a request whose `Host` is not accepted.
pub(super) fn of_host(access: &Access, headers: &HeaderMap) -> String {
    let Some(origin) = access.origin_of_host(headers) else {
        return "this station can't tell by which address it was called: the request's Host is missing or invalid; open the \
                address that the station prints\n"
            .to_owned();
    };
    let other = if origin.is_https() { "http" } else { "https" };
    format!(
        "this station doesn't know the address {origin}: open the address that it prints when it starts. If this address is \
         yours (a proxy, a name of this computer), {}\nWrite {other}:// if the address in your browser begins so.\n",
        remedy(&origin)
    )
}

/// Answer to a request whose `Origin` is not accepted.
pub(super) fn of_page(access: &Access, headers: &HeaderMap) -> String {
    let Some(origin) = access.origin_of_page(headers) else {
        return "only the station's own page may read this, and the request's Origin is null or invalid; open the address \
                that the station prints\n"
            .to_owned();
    };
    format!(
        "only the station's own page may read this, and {origin} is not known to be its address. If it is (an HTTPS proxy, \
         another name), {}",
        remedy(&origin)
    )
}

/// Line of the station file that would admit an origin.
fn remedy(origin: &Origin) -> String {
    format!(
        "add this line to [browser] in the station file, or its entry to the list that is there, and start the station \
         again:\n\norigins = [\"{origin}\"]\n"
    )
}
