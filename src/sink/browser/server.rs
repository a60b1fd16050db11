//! HTTP server of the page: every request is checked before anything is served.

use std::io;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use axum::Router;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::{Extension, Request, State};
use axum::http::header::{
    CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HeaderName, LOCATION, REFERRER_POLICY, SET_COOKIE,
    X_CONTENT_TYPE_OPTIONS, X_FRAME_OPTIONS,
};
use axum::http::{HeaderMap, HeaderValue, StatusCode};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;

use super::access::Access;
use super::assets::{ASSETS, Asset};
use super::client;
use super::refusal;
use super::shared::Shared;

/// Largest message that is accepted from a page, bytes; actual messages are far smaller.
const MESSAGE_BYTES_MAX: usize = 4096;
/// Longest wait for the headers of a request, after which the connection is closed.
const HEADER_TIMEOUT: Duration = Duration::from_secs(10);
/// Longest duration of a connection that is no WebSocket, with all its requests and answers.
const CONNECTION_TIMEOUT: Duration = Duration::from_secs(30);
/// Longest wait for the pages to leave when the station ends.
const GOODBYE: Duration = Duration::from_secs(1);

/// Content security policy: allows only the page's own scripts, styles and connections.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; connect-src 'self'; \
                      base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// Serves the page until cancelled.
pub(super) async fn serve(listener: TcpListener, shared: Arc<Shared>) -> io::Result<()> {
    let listener = tokio::net::TcpListener::from_std(listener)?;
    let router = router(&shared);
    let accept = async {
        loop {
            let (stream, address) = match listener.accept().await {
                Ok(accepted) => accepted,
                Err(e) => {
                    tracing::warn!("the browser page can't accept a connection: {e}");
                    tokio::time::sleep(Duration::from_millis(100)).await;
                    continue;
                }
            };
            if let Err(e) = stream.set_nodelay(true) {
                tracing::debug!("{address}: {e}");
            }
            let service = TowerToHyperService::new(router.clone().layer(Extension(address)));
            let counted = shared.connections.enter(address.ip());
            tokio::spawn(async move {
                let mut http = hyper::server::conn::http1::Builder::new();
                http.timer(TokioTimer::new()).header_read_timeout(HEADER_TIMEOUT);
                let connection = http.serve_connection(TokioIo::new(stream), service).with_upgrades();
                tokio::select! {
                    ended = tokio::time::timeout(CONNECTION_TIMEOUT, connection) => match ended {
                        Ok(Ok(())) => {}
                        Ok(Err(e)) => tracing::debug!("{address}: {e}"),
                        Err(_) => tracing::debug!("{address}: open for too long"),
                    },
                    () = counted.displaced() => tracing::debug!("{address}: closed for a newer connection"),
                }
            });
        }
    };
    tokio::select! {
        () = accept => {}
        () = shared.cancel.cancelled() => {}
    }
    let all_left = async {
        while shared.client_count() > 0 {
            shared.client_left.notified().await;
        }
    };
    if tokio::time::timeout(GOODBYE, all_left).await.is_err() {
        tracing::debug!("{} pages did not take leave", shared.client_count());
    }
    Ok(())
}

fn router(shared: &Arc<Shared>) -> Router {
    let mut router = Router::new().route("/stream", get(stream).post(why)).route("/scene", get(scene));
    for asset in ASSETS {
        router = router.route(asset.path, get(async || file(asset)));
    }
    router.layer(from_fn_with_state(shared.clone(), guard)).with_state(shared.clone())
}

fn file(asset: &'static Asset) -> Response {
    ([(CONTENT_TYPE, asset.content_type)], asset.bytes).into_response()
}

/// Responds with the surfaces of the 3-D view, to the station's own page only.
async fn scene(State(shared): State<Arc<Shared>>, headers: HeaderMap) -> Response {
    if !shared.access.accepts_origin(&headers) {
        return (StatusCode::FORBIDDEN, refusal::of_page(&shared.access, &headers)).into_response();
    }
    match &shared.surfaces {
        Some(packet) => ([(CONTENT_TYPE, "application/octet-stream")], packet.shared()).into_response(),
        None => (StatusCode::NOT_FOUND, "this station shows no scene\n").into_response(),
    }
}

/// Checks every request and adds the security headers to every response.
async fn guard(State(shared): State<Arc<Shared>>, request: Request, next: Next) -> Response {
    let mut response = match instead(&shared.access, &request) {
        Some(response) => response,
        None => next.run(request).await,
    };
    let headers = [
        (CONTENT_SECURITY_POLICY, POLICY),
        (X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (X_FRAME_OPTIONS, "DENY"),
        (REFERRER_POLICY, "no-referrer"),
        (CACHE_CONTROL, "no-store"),
        (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
        (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
    ];
    for (name, value) in headers {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

/// Response to a refused or redirected request; `None` if the request may pass.
fn instead(access: &Access, request: &Request) -> Option<Response> {
    let headers = request.headers();
    if !access.accepts_host(headers) {
        return Some((StatusCode::MISDIRECTED_REQUEST, refusal::of_host(access, headers)).into_response());
    }
    if !access.demands_token() || access.accepts_cookie(headers) {
        return None;
    }
    let query = request.uri().query().unwrap_or("");
    let given = query.split('&').find_map(|pair| pair.strip_prefix("token="));
    if !given.is_some_and(|token| access.accepts_token(token)) {
        return Some((StatusCode::UNAUTHORIZED, refusal::TOKEN).into_response());
    }
    if request.uri().path() != "/" {
        return None;
    }
    // Redirects, so that the token disappears from address bar and history.
    let cookie = access.cookie(headers).and_then(|cookie| HeaderValue::from_str(&cookie).ok())?;
    let headers = [(SET_COOKIE, cookie), (LOCATION, HeaderValue::from_static("/"))];
    Some((StatusCode::SEE_OTHER, headers).into_response())
}

/// Tells a page why its stream is refused, because a browser hides the response to a refused WebSocket. The request is
/// a POST, so that it carries its `Origin`.
async fn why(State(shared): State<Arc<Shared>>, headers: HeaderMap) -> Response {
    if shared.access.accepts_origin(&headers) {
        return StatusCode::NO_CONTENT.into_response();
    }
    (StatusCode::FORBIDDEN, refusal::of_page(&shared.access, &headers)).into_response()
}

async fn stream(
    State(shared): State<Arc<Shared>>,
    Extension(address): Extension<SocketAddr>,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    if !shared.access.accepts_origin(&headers) {
        let reason = refusal::of_page(&shared.access, &headers);
        // A refused page tries again every two seconds.
        if !shared.has_warned_of_page.swap(true, Ordering::Relaxed) {
            let line = reason.split_whitespace().collect::<Vec<_>>().join(" ");
            tracing::warn!("{address} is refused the page's stream: {line}");
        }
        return (StatusCode::FORBIDDEN, reason).into_response();
    }
    let upgrade = upgrade.max_message_size(MESSAGE_BYTES_MAX).max_frame_size(MESSAGE_BYTES_MAX);
    match shared.enter(address) {
        Some(slot) => upgrade.on_upgrade(move |socket| client::run(socket, slot)),
        None => {
            let reason = format!("{} pages are watching already, which is browser.clients_max", shared.clients_max);
            tracing::warn!("{address} turned away: {reason}");
            upgrade.on_upgrade(move |socket| client::turn_away(socket, reason))
        }
    }
}

#[cfg(test)]
mod tests {
    use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
    use tokio::net::TcpStream;
    use tokio::sync::{mpsc, watch};

    use super::super::{SceneInfo, Settings, messages};
    use super::*;

    /// Longest simulated time that a test waits.
    const LIMIT: Duration = Duration::from_secs(120);

    /// A station on any free port, served on this test's runtime.
    fn station() -> (SocketAddr, Arc<Shared>) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        listener.set_nonblocking(true).unwrap();
        let local = listener.local_addr().unwrap();
        let access = Access::new(&Settings::default(), local).unwrap();
        let hello = messages::write(&messages::hello(&SceneInfo::default()));
        let shared = Shared::new(access, hello, None, mpsc::channel(1).0, watch::channel(None).1, 8);
        let shared = Arc::new(shared);
        tokio::spawn(serve(listener, shared.clone()));
        (local, shared)
    }

    async fn until(shared: &Shared, count: usize) {
        let counted = async {
            while shared.connections.count() != count {
                tokio::time::sleep(Duration::from_millis(10)).await;
            }
        };
        let reached = tokio::time::timeout(LIMIT, counted).await;
        assert!(reached.is_ok(), "{} connections are open instead of {count}", shared.connections.count());
    }

    #[tokio::test(start_paused = true)]
    async fn silent_peers_and_those_that_read_no_answer_are_closed() {
        let (address, shared) = station();
        let mut silent = TcpStream::connect(address).await.unwrap();
        let mut half = TcpStream::connect(address).await.unwrap();
        half.write_all(b"GET / HTTP/1.1\r\nhost: ").await.unwrap();
        let mut unread = TcpStream::connect(address).await.unwrap();
        // Answers of 20 MB: more than the system keeps for a connection.
        let request = format!("GET /app.js HTTP/1.1\r\nhost: {address}\r\n\r\n");
        unread.write_all(request.repeat(1500).as_bytes()).await.unwrap();
        until(&shared, 3).await;
        until(&shared, 0).await;
        for closed in [&mut silent, &mut half] {
            let mut answer = Vec::new();
            let ended = closed.read_to_end(&mut answer).await;
            assert!(ended.is_ok() || answer.is_empty(), "{ended:?}");
        }
    }
}
