//! Tests of the live page: its WebSocket, its access control, and the page itself in a headless browser.
#![cfg(feature = "browser")]
// clippy.toml allows these in test functions only, not in their helpers.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use futures_util::{SinkExt as _, StreamExt as _};
use insonify::anatomy::Axes;
use insonify::anatomy::{TissueTable, analytic};
use insonify::settings::{Assignment, Control, MarkContent};
use insonify::sink::browser::wire::header_bytes;
use insonify::sink::browser::{BrowserSink, SceneInfo, ScenePacket, Settings};
use insonify::sink::live::{FrameInfo, FrameSource, LiveSink as _, PresentedFrame};
use insonify::sink::{FrameRate, SinkError, Video};
use insonify::transducer::Probe;
use serde_json::{Value, json};
use tokio::io::AsyncWriteExt as _;
use tokio::sync::mpsc;
use tokio_tungstenite::tungstenite::client::IntoClientRequest as _;
use tokio_tungstenite::tungstenite::http::{HeaderName, HeaderValue};
use tokio_tungstenite::tungstenite::protocol::frame::coding::CloseCode;
use tokio_tungstenite::tungstenite::{Error, Message};
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, connect_async};

type Socket = WebSocketStream<MaybeTlsStream<tokio::net::TcpStream>>;

/// Time limit of tests that might hang; far longer than any step takes.
const LIMIT: Duration = Duration::from_secs(30);

const TOKEN: &str = "a-token-of-some-length";

fn frame(number: u64, width: u32, height: u32) -> PresentedFrame {
    let pixels = (width * height) as usize;
    PresentedFrame {
        number,
        info: FrameInfo::default(),
        source: FrameSource::Raw,
        width,
        height,
        pixel_mm: 0.5,
        image: vec![number as u8; pixels],
        segmentation: vec![2; pixels],
        attenuation: vec![1.0; pixels],
        mask: vec![255; pixels].into(),
        generator: None,
        point: None,
        tip_events: [].into(),
        notice: None,
    }
}

fn any_port() -> Settings {
    Settings { port: 0, ..Settings::default() }
}

fn surfaces() -> ScenePacket {
    let scene = analytic::scene(analytic::cyst(), &TissueTable::builtin().unwrap(), "liver").unwrap();
    ScenePacket::new(&scene, &Probe::default(), None, Axes::Depth)
}

fn serve(settings: &Settings) -> (BrowserSink, mpsc::Receiver<Control>) {
    let (sender, receiver) = mpsc::channel(4);
    let scene =
        SceneInfo { tissues: vec!["blood".into(), "liver".into()], surfaces: Some(surfaces()), ..SceneInfo::default() };
    (BrowserSink::new(settings, sender, &scene).unwrap(), receiver)
}

async fn connect_with(address: SocketAddr, headers: &[(&'static str, &str)]) -> Result<Socket, Error> {
    let mut request = format!("ws://{address}/stream").into_client_request().unwrap();
    for (name, value) in headers {
        request.headers_mut().insert(HeaderName::from_static(name), HeaderValue::from_str(value).unwrap());
    }
    Ok(connect_async(request).await?.0)
}

/// Connects a page, and reads the greeting.
async fn connect(address: SocketAddr) -> Socket {
    let mut socket = connect_with(address, &[]).await.unwrap();
    assert_eq!(text(&mut socket, "hello").await["tissues"][1]["name"], "liver");
    socket
}

fn refusal(result: Result<Socket, Error>) -> u16 {
    match result {
        Err(Error::Http(response)) => response.status().as_u16(),
        other => panic!("expected a refusal, got {other:?}"),
    }
}

async fn send(socket: &mut Socket, message: &Value) {
    socket.send(Message::text(message.to_string())).await.unwrap();
}

/// Next text message of the type `kind`; other messages and frames are skipped.
async fn text(socket: &mut Socket, kind: &str) -> Value {
    loop {
        if let Message::Text(text) = socket.next().await.unwrap().unwrap() {
            let value: Value = serde_json::from_str(&text).unwrap();
            if value["type"] == kind {
                return value;
            }
        }
    }
}

/// Next binary message: its map, its frame number, and the bytes after the header.
async fn binary(socket: &mut Socket) -> (u8, u64, Vec<u8>) {
    loop {
        if let Message::Binary(bytes) = socket.next().await.unwrap().unwrap() {
            let number = u64::from_le_bytes(bytes[8..16].try_into().unwrap());
            return (bytes[6], number, bytes[header_bytes()..].to_vec());
        }
    }
}

async fn drawn(socket: &mut Socket, number: u64) {
    send(socket, &json!({"type": "drawn", "number": number})).await;
}

/// Response to a plain HTTP request: status line, headers and body.
fn http(address: SocketAddr, path: &str, headers: &str) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(LIMIT)).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\n{headers}connection: close\r\n\r\n").unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    String::from_utf8_lossy(&answer).into_owned()
}

#[tokio::test]
async fn frames_arrive_with_the_requested_maps() {
    let (mut sink, _controls) = serve(&any_port());
    let mut page = connect(sink.local_address()).await;
    sink.present(&frame(7, 20, 10)).unwrap();
    assert_eq!(binary(&mut page).await, (1, 7, vec![7; 200]));
    drawn(&mut page, 7).await;

    send(&mut page, &json!({"type": "overlays", "segmentation": true, "attenuation": true})).await;
    // The present frame arrives once more; after that the sink knows the request.
    assert_eq!(binary(&mut page).await.1, 7);
    sink.present(&frame(8, 20, 10)).unwrap();
    assert_eq!(binary(&mut page).await, (2, 8, vec![2; 200]));
    assert_eq!(binary(&mut page).await, (3, 8, vec![255; 200]));
    assert_eq!(binary(&mut page).await, (1, 8, vec![8; 200]));
}

#[tokio::test]
async fn a_late_page_gets_the_frozen_frame_and_its_maps() {
    let (mut sink, _controls) = serve(&any_port());
    let mut frozen = frame(3, 8, 4);
    frozen.info.settings.frozen = true;
    sink.present(&frozen).unwrap();
    let mut page = connect(sink.local_address()).await;
    assert_eq!(binary(&mut page).await.1, 3);
    send(&mut page, &json!({"type": "overlays", "segmentation": true, "attenuation": false})).await;
    assert_eq!(binary(&mut page).await, (2, 3, vec![2; 32]));
    assert_eq!(binary(&mut page).await.0, 1);
}

#[tokio::test]
async fn the_newest_frame_wins_at_a_slow_page_and_no_other_page_waits() {
    let (mut sink, _controls) = serve(&any_port());
    let mut slow = connect(sink.local_address()).await;
    let mut fast = connect(sink.local_address()).await;
    for number in 0..100 {
        sink.present(&frame(number, 16, 16)).unwrap();
        assert_eq!(binary(&mut fast).await.1, number);
        drawn(&mut fast, number).await;
        // The slow page gets two frames and acknowledges none.
        if number < 2 {
            assert_eq!(binary(&mut slow).await.1, number);
        }
    }
    drawn(&mut slow, 1).await;
    assert_eq!(binary(&mut slow).await.1, 99);
    let stats = loop {
        let stats = text(&mut slow, "stats").await;
        if stats["sent"] == 3 {
            break stats;
        }
    };
    assert_eq!((&stats["dropped"], &stats["clients"]), (&json!(97), &json!(2)));
    let mut counts: Vec<_> = sink.monitor().clients().iter().map(|c| (c.sent, c.dropped)).collect();
    counts.sort_unstable();
    assert_eq!(counts, [(3, 97), (100, 0)]);
}

#[tokio::test]
async fn a_page_that_reads_nothing_blocks_nobody() {
    let (mut sink, _controls) = serve(&any_port());
    let mut stuck = connect(sink.local_address()).await;
    let mut other = connect(sink.local_address()).await;
    // It acknowledges every frame, but reads nothing from its socket.
    for number in 0..40 {
        drawn(&mut stuck, u64::MAX).await;
        sink.present(&frame(number, 1386, 1000)).unwrap();
        assert_eq!(binary(&mut other).await.1, number);
        drawn(&mut other, number).await;
    }
    let counts: Vec<_> = sink.monitor().clients().iter().map(|c| (c.sent, c.dropped)).collect();
    assert!(counts.contains(&(40, 0)), "{counts:?}");
    Box::new(sink).finish().unwrap();
}

#[tokio::test]
async fn peers_that_ask_and_read_no_answer_keep_no_new_page_out() {
    let (mut sink, _controls) = serve(&any_port());
    let address = sink.local_address();
    let request = format!("GET /app.js HTTP/1.1\r\nhost: {address}\r\n\r\n").repeat(400);
    let mut peers = Vec::new();
    for _ in 0..64 {
        let socket = tokio::net::TcpSocket::new_v4().unwrap();
        // Small, so that the answers don't fit into the system's memory.
        socket.set_recv_buffer_size(4096).unwrap();
        let mut peer = socket.connect(address).await.unwrap();
        // The server may close it while it writes.
        let _ = peer.write_all(request.as_bytes()).await;
        peers.push(peer);
    }
    let page = tokio::task::spawn_blocking(move || http(address, "/", &format!("host: {address}\r\n"))).await.unwrap();
    assert!(page.contains("<title>insonify</title>"), "{page}");
    let mut page = connect(address).await;
    sink.present(&frame(5, 4, 4)).unwrap();
    assert_eq!(binary(&mut page).await.1, 5);
    drop(peers);
}

#[tokio::test]
async fn values_that_the_page_does_not_offer_are_refused_with_the_reason() {
    let (mut sink, mut controls) = serve(&any_port());
    let mut page = connect(sink.local_address()).await;
    let set = |values: &[(&str, f64)]| {
        let assignments: Vec<_> = values.iter().map(|&(key, value)| Assignment::new(key, value)).collect();
        json!({"type": "set", "assignments": assignments})
    };
    let excessive = set(&[("rays", 256.0), ("layers", 33.0), ("angles", 15.0)]);
    send(&mut page, &excessive).await;
    let error = text(&mut page, "error").await;
    assert!(error["message"].as_str().unwrap().contains("the page offers"), "{error}");
    send(&mut page, &set(&[("rays", 256.0), ("layers", 33.0)])).await;
    let error = text(&mut page, "error").await;
    let expected = "not set: quality.rays x quality.layers is 256x33; the page offers 1x1, 4x3, 32x3";
    assert_eq!(error["message"], expected);
    let offered = [("rays", 32.0), ("layers", 3.0)];
    send(&mut page, &set(&offered)).await;
    let expected: Vec<_> = offered.iter().map(|&(key, value)| Assignment::new(key, value)).collect();
    assert_eq!(controls.recv().await, Some(Control::Set(expected)), "nothing came before");
    // A station beyond that can be gone back to.
    let mut shown = frame(0, 4, 4);
    (shown.info.settings.render.quality.rays, shown.info.settings.render.quality.layers) = (64, 5);
    sink.present(&shown).unwrap();
    binary(&mut page).await;
    send(&mut page, &set(&[("rays", 64.0), ("layers", 5.0)])).await;
    assert!(matches!(controls.recv().await, Some(Control::Set(_))));
}

#[tokio::test]
async fn foreign_pages_and_rebound_host_names_are_refused() {
    let (sink, _controls) = serve(&any_port());
    let address = sink.local_address();
    let port = address.port();
    for origin in ["http://evil.example", "null", "http://127.0.0.1:1"] {
        assert_eq!(refusal(connect_with(address, &[("origin", origin)]).await), 403, "{origin}");
    }
    let rebound = format!("evil.example:{port}");
    let origin = format!("http://{rebound}");
    assert_eq!(refusal(connect_with(address, &[("host", &rebound), ("origin", &origin)]).await), 421);
    for path in ["/", "/app.js", "/stream", "/scene", "/nothing"] {
        let answer = http(address, path, &format!("host: {rebound}\r\n"));
        assert!(answer.starts_with("HTTP/1.1 421 "), "{path}: {answer}");
    }
    let foreign = http(address, "/scene", &format!("host: {address}\r\norigin: http://evil.example\r\n"));
    assert!(foreign.starts_with("HTTP/1.1 403 "), "{foreign}");
    let own = format!("http://{address}");
    let scene = http(address, "/scene", &format!("host: {address}\r\norigin: {own}\r\n"));
    assert!(scene.starts_with("HTTP/1.1 200 ") && scene.contains("amniotic_fluid"));
    connect_with(address, &[("origin", &own)]).await.unwrap();
    assert!(sink.address() == format!("{own}/"));
}

#[tokio::test]
async fn the_page_answers_behind_a_forwarded_port() {
    let (sink, _controls) = serve(&any_port());
    let address = sink.local_address();
    // As through `ssh -L 9000:localhost:8790`.
    for host in ["localhost:9000", "127.0.0.1:9000", "[::1]:9000"] {
        let page = http(address, "/", &format!("host: {host}\r\n"));
        assert!(page.starts_with("HTTP/1.1 200 "), "{host}: {page}");
        connect_with(address, &[("host", host), ("origin", &format!("http://{host}"))]).await.unwrap();
    }
    // A page of another server on the same computer.
    let neighbour = [("host", "localhost:9000"), ("origin", "http://localhost:3000")];
    assert_eq!(refusal(connect_with(address, &neighbour).await), 403);
    // As through `docker run -p 9000:8790`.
    let (sink, _controls) = serve(&Settings { address: [0, 0, 0, 0].into(), token: Some(TOKEN.into()), ..any_port() });
    let address = SocketAddr::from(([127, 0, 0, 1], sink.local_address().port()));
    for host in ["192.168.0.7:9000", "localhost:9000"] {
        let answer = http(address, &format!("/?token={TOKEN}"), &format!("host: {host}\r\n"));
        assert!(
            answer.starts_with("HTTP/1.1 303 ") && answer.contains("set-cookie: insonify_9000="),
            "{host}: {answer}"
        );
    }
}

/// Text of a station file with the line `origins` that an answer advises.
fn advised(answer: &str) -> String {
    let line = answer.lines().find(|line| line.starts_with("origins = ")).unwrap_or_else(|| panic!("{answer}"));
    format!("[scene]\nphantom = \"obstetric\"\n[browser]\nport = 0\ntoken = \"{TOKEN}\"\n{line}\n")
}

/// The page's settings in the text of a station file.
fn settings_of(station: &str) -> Settings {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("station.toml");
    std::fs::write(&path, station).unwrap();
    insonify::Station::load(&path).unwrap().browser.unwrap()
}

#[tokio::test]
async fn a_refusal_names_the_line_that_admits_the_page() {
    let (sink, _controls) = serve(&any_port());
    let address = sink.local_address();
    // A proxy that passes its own name on.
    let proxied = "host: station.local:9000\r\nx-forwarded-proto: https\r\n";
    let answer = http(address, "/", proxied);
    assert!(answer.starts_with("HTTP/1.1 421 ") && answer.contains("content-type: text/plain"), "{answer}");
    let settings = settings_of(&advised(&answer));
    assert_eq!(settings.origins[0].to_string(), "https://station.local:9000");
    let (admitting, _controls) = serve(&settings);
    assert_eq!(admitting.origin_addresses(), [format!("https://station.local:9000/?token={TOKEN}")]);
    let answer = http(admitting.local_address(), &format!("/?token={TOKEN}"), proxied);
    let cookie =
        answer.lines().find_map(|line| line.strip_prefix("set-cookie: ")).unwrap_or_else(|| panic!("{answer}"));
    let cookie = cookie.split(';').next().unwrap();
    let with = |origin| [("host", "station.local:9000"), ("origin", origin), ("cookie", cookie)];
    connect_with(admitting.local_address(), &with("https://station.local:9000")).await.unwrap();
    assert_eq!(refusal(connect_with(admitting.local_address(), &with("https://evil.example")).await), 403);

    // A proxy that calls the station by its address: the page loads, the stream is refused, and the page asks why.
    let own = format!("host: {address}\r\n");
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(LIMIT)).unwrap();
    write!(stream, "POST /stream HTTP/1.1\r\n{own}origin: https://proxy.local\r\nconnection: close\r\n\r\n").unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    assert!(answer.starts_with("HTTP/1.1 403 "), "{answer}");
    assert_eq!(settings_of(&advised(&answer)).origins[0].to_string(), "https://proxy.local");
}

#[tokio::test]
async fn a_refusal_repeats_nothing_that_needs_escaping() {
    let (sink, _controls) = serve(&any_port());
    let address = sink.local_address();
    let long = "a".repeat(4000);
    for host in ["\"]\\evil", "<script>", "a\u{7}b", "\u{202e}a", &long, "a b", "%22.example"] {
        let answer = http(address, "/", &format!("host: {host}\r\n"));
        let status = answer.split(' ').nth(1).unwrap_or_default();
        assert!(status == "421" || status == "400", "{answer}");
        assert!(!answer.contains(host) && !answer.contains("origins = "), "{host}: {answer}");
    }
    let answer = http(address, "/scene", &format!("host: {address}\r\norigin: https://a\"]<b>\r\n"));
    assert!(answer.starts_with("HTTP/1.1 403 ") && !answer.contains("<b>"), "{answer}");
}

#[tokio::test]
async fn the_page_and_its_headers_are_served() {
    let (sink, _controls) = serve(&any_port());
    let address = sink.local_address();
    let host = format!("host: {address}\r\n");
    let page = http(address, "/", &host);
    assert!(page.starts_with("HTTP/1.1 200 ") && page.contains("<title>insonify</title>"), "{page}");
    for header in [
        "content-type: text/html",
        "content-security-policy: default-src 'none';",
        "x-content-type-options: nosniff",
        "x-frame-options: DENY",
        "referrer-policy: no-referrer",
        "cross-origin-resource-policy: same-origin",
    ] {
        assert!(page.contains(header), "{header}");
    }
    assert!(http(address, "/app.js", &host).contains("content-type: text/javascript"));
    let missing = http(address, "/../Cargo.toml", &host);
    assert!(missing.starts_with("HTTP/1.1 404 ") && missing.contains("nosniff"), "{missing}");
}

#[tokio::test]
async fn without_the_token_nothing_is_served() {
    let (sink, _controls) = serve(&Settings { token: Some(TOKEN.into()), ..any_port() });
    let address = sink.local_address();
    assert_eq!(sink.address(), format!("http://{address}/?token={TOKEN}"));
    let host = format!("host: {address}\r\n");
    for path in
        ["/", "/app.js", "/?token=", "/?token=a-token-of-some-lengt", "/?token=a-token-of-some-lengthh", "/nothing"]
    {
        let answer = http(address, path, &host);
        assert!(answer.starts_with("HTTP/1.1 401 ") && !answer.contains(TOKEN), "{path}: {answer}");
    }
    assert_eq!(refusal(connect_with(address, &[]).await), 401);
    let cookie = format!("insonify_{}=another-token-of-length", address.port());
    assert_eq!(refusal(connect_with(address, &[("cookie", &cookie)]).await), 401);

    // The token moves from the address into a cookie.
    let answer = http(address, &format!("/?token={TOKEN}"), &host);
    assert!(answer.starts_with("HTTP/1.1 303 ") && answer.contains("location: /\r\n"), "{answer}");
    let line = answer.lines().find_map(|line| line.strip_prefix("set-cookie: ")).unwrap();
    assert!(line.contains("HttpOnly") && line.contains("SameSite=Strict"));
    let cookie = line.split(';').next().unwrap();
    assert!(http(address, "/app.js", &format!("{host}cookie: {cookie}\r\n")).starts_with("HTTP/1.1 200 "));
    connect_with(address, &[("cookie", cookie)]).await.unwrap();
    // A token doesn't admit a foreign page.
    let foreign = [("cookie", cookie), ("origin", "http://evil.example")];
    assert_eq!(refusal(connect_with(address, &foreign).await), 403);
}

#[test]
fn beyond_loopback_a_token_is_always_required() {
    let everywhere = Settings { address: [0, 0, 0, 0].into(), ..any_port() };
    let [(one, _c1), (other, _c2)] = [0, 1].map(|_| serve(&everywhere));
    let token = |sink: &BrowserSink| sink.address().split_once("/?token=").unwrap().1.to_owned();
    assert!(token(&one).len() >= 32);
    assert_ne!(token(&one), token(&other));
    let address = SocketAddr::from(([127, 0, 0, 1], one.local_address().port()));
    assert!(http(address, "/", &format!("host: {address}\r\n")).starts_with("HTTP/1.1 401 "));
}

#[tokio::test]
async fn mistakes_are_answered_and_the_page_stays_connected() {
    let (sink, mut controls) = serve(&any_port());
    let mut page = connect(sink.local_address()).await;
    for (message, part) in [
        ("", "not a message"),
        (r#"{"type":"quit"}"#, "unknown variant"),
        (r#"{"type":"set","assignments":[{"key":"gain_db","value":1e9}]}"#, "-200..=200"),
        (r#"{"type":"set","assignments":[{"key":"gain_db","value":null}]}"#, "null"),
        (r#"{"type":"set","assignments":[{"key":"tgc_sliders_db","index":8,"value":0}]}"#, "0..=7"),
        (r#"{"type":"set","assignments":[{"key":"rays","value":32},{"key":"layers","value":300}]}"#, "1..=33"),
    ] {
        page.send(Message::text(message)).await.unwrap();
        let error = text(&mut page, "error").await;
        assert!(error["message"].as_str().unwrap().contains(part), "{message}: {error}");
    }
    page.send(Message::binary(vec![1, 2, 3])).await.unwrap();
    assert!(text(&mut page, "error").await["message"].as_str().unwrap().contains("binary"));

    let slider = Assignment { index: 2, ..Assignment::new("tgc_sliders_db", -6.0) };
    send(&mut page, &json!({"type": "set", "assignments": [slider]})).await;
    assert_eq!(controls.recv().await, Some(Control::Set(vec![slider])));
    let freeze = json!({"type": "set", "assignments": [{"key": "frozen", "value": 1}]});
    // The channel has a capacity of four; nobody reads it.
    for _ in 0..5 {
        send(&mut page, &freeze).await;
    }
    assert!(text(&mut page, "error").await["message"].as_str().unwrap().contains("busy"));
    drop(controls);
    send(&mut page, &freeze).await;
    assert!(text(&mut page, "error").await["message"].as_str().unwrap().contains("no controls"));
}

#[tokio::test]
async fn marks_reach_the_session_cleaned_and_wrong_ones_are_refused_with_the_reason() {
    let (sink, mut controls) = serve(&any_port());
    let mut page = connect(sink.local_address()).await;
    let mark = |content: Value| json!({"type": "mark", "id": "p-1", "frame": 12, "sampled_ms": 400.5, "pose": null, "content": content});
    let line = |x: f64| json!({"kind": "distance", "measure": "BPD\u{1b}", "points_mm": [[x, 40.0], [0.0, 40.0]]});
    send(&mut page, &mark(line(90.0))).await;
    let Some(Control::Mark(read)) = controls.recv().await else { panic!() };
    let content = MarkContent::Distance { measure: "BPD".into(), points_mm: [[90.0, 40.0], [0.0, 40.0]] };
    assert_eq!((read.frame, read.sampled_ms, &read.content), (12, 400.5, &content));
    send(&mut page, &json!({"type": "unmark", "ids": ["p-1"]})).await;
    assert_eq!(controls.recv().await, Some(Control::Unmark(vec!["p-1".into()])));
    for (message, part) in [
        (mark(line(2e4)), "points_mm"),
        (mark(json!({"kind": "text", "text": "x".repeat(61), "at_mm": [0, 1]})), "61 characters"),
        (mark(json!({"kind": "ellipse", "measure": "HC", "points_mm": [[0, 1], [1, 1]]})), "4"),
        (json!({"type": "unmark", "ids": ["p 1"]}), "letters, digits"),
        (json!({"type": "unmark", "ids": vec!["a"; 65]}), "65 marks"),
    ] {
        send(&mut page, &message).await;
        let error = text(&mut page, "error").await;
        assert!(error["message"].as_str().unwrap().contains(part), "{message}: {error}");
    }
    // The channel has a capacity of four; nobody reads it.
    for _ in 0..5 {
        send(&mut page, &mark(line(1.0))).await;
    }
    let error = text(&mut page, "error").await;
    assert_eq!(error["message"], "the mark is not recorded: the station is busy; try again");
}

#[tokio::test]
async fn an_endless_message_ends_the_connection() {
    let (sink, _controls) = serve(&any_port());
    let mut page = connect(sink.local_address()).await;
    // The server may close before everything is written.
    let _ = page.send(Message::text("x".repeat(1 << 20))).await;
    while let Some(Ok(message)) = page.next().await {
        assert!(!matches!(message, Message::Binary(_)));
    }
    drop(connect(sink.local_address()).await);
}

#[tokio::test]
async fn pages_beyond_the_limit_are_refused_with_the_reason() {
    let (sink, _controls) = serve(&Settings { clients_max: 1, ..any_port() });
    let first = connect(sink.local_address()).await;
    let mut second = connect_with(sink.local_address(), &[]).await.unwrap();
    match second.next().await {
        Some(Ok(Message::Close(Some(close)))) => {
            assert_eq!(close.code, CloseCode::Again);
            assert!(close.reason.as_str().contains("browser.clients_max"), "{}", close.reason);
        }
        other => panic!("{other:?}"),
    }
    drop(first);
    let left = async {
        while !sink.monitor().clients().is_empty() {
            tokio::task::yield_now().await;
        }
    };
    tokio::time::timeout(LIMIT, left).await.unwrap();
    connect(sink.local_address()).await;
}

#[tokio::test]
async fn after_a_restart_pages_find_the_station_at_its_port() {
    let (mut sink, _controls) = serve(&any_port());
    let address = sink.local_address();
    let mut page = connect(address).await;
    sink.present(&frame(0, 4, 4)).unwrap();
    binary(&mut page).await;
    Box::new(sink).finish().unwrap();
    let close = loop {
        match page.next().await {
            Some(Ok(Message::Close(Some(close)))) => break close,
            Some(Ok(_)) => {}
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(close.code, CloseCode::Away);
    let same = Settings { port: address.port(), ..Settings::default() };
    let (mut sink, _controls) = serve(&same);
    let mut page = connect(address).await;
    sink.present(&frame(5, 4, 4)).unwrap();
    assert_eq!(binary(&mut page).await.1, 5);
    // A second station can't take the port.
    match BrowserSink::new(&same, mpsc::channel(1).0, &SceneInfo::default()) {
        Err(error @ SinkError::Listen { .. }) => assert!(error.to_string().contains(&address.to_string()), "{error}"),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_frame_of_the_wrong_size_is_an_error() {
    let (mut sink, _controls) = serve(&any_port());
    let wrong = PresentedFrame { image: vec![0; 3], ..frame(0, 4, 4) };
    assert!(sink.present(&wrong).unwrap_err().to_string().contains("image"));
    assert!(sink.present(&frame(0, 4, 4)).is_ok());
}

#[test]
#[ignore = "needs Chromium and ChromeDriver; `make test` runs it where they are installed"]
fn the_page_works_in_a_headless_browser() {
    run_script("end_to_end.py");
}

#[test]
#[ignore = "needs Chromium and ChromeDriver; `make test` runs it where they are installed"]
fn a_video_plays_in_a_headless_browser() {
    let dir = tempfile::tempdir().unwrap();
    let mut video = Video::create(&dir.path().join("v"), 346, 251, FrameRate::new(10.0).unwrap()).unwrap();
    for frame in 0..40 {
        let grey: Vec<u8> = (0..346 * 251_u64).map(|i| (((i % 346) / 2 + i / 692 + 5 * frame) % 251) as u8).collect();
        video.push(&grey).unwrap();
    }
    let path = video.finish().unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/browser/video.py");
    let output = Command::new("python3").arg(script).arg(&path).args(["346", "252", "4"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// Runs a script of tests/browser on the demo.
fn run_script(name: &str) {
    // Next to this test's own directory, `deps`.
    let program = std::env::current_exe().unwrap().parent().unwrap().with_file_name("examples").join("browser_demo");
    assert!(program.is_file(), "{} is not built: cargo build --release --example browser_demo", program.display());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/browser").join(name);
    let output = Command::new("python3").arg(script).arg(program).output().unwrap();
    let [said, failed] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes));
    println!("{said}{failed}");
    assert!(output.status.success(), "{said}{failed}");
}
