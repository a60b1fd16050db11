//! Tests of devices on sockets.

use std::io::Write;
use std::net::{SocketAddr, TcpListener, UdpSocket};
use std::time::Duration;

use insonify::pose::Pose;
use insonify::tracker::{Protocol, Settings, TrackerEvent, Transport, ascii_line};

use crate::trackers::listener::{Live, connected, decode_error, disconnected};

fn line(n: u32) -> String {
    let pose = Pose::from_components([f64::from(n), 2.0, 3.0, 1.0, 0.0, 0.0, 0.0]).unwrap();
    ascii_line::encode(n, u64::from(n) * 5000, &pose)
}

fn settings(transport: Transport) -> Settings {
    Settings { transport, protocol: Protocol::AsciiLine, ..Settings::default() }
}

#[test]
fn a_tcp_server_is_read_and_found_again() {
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = server.local_addr().unwrap().to_string();
    let live = Live::start(&settings(Transport::Tcp { address: address.clone() }));
    let (mut first, _) = server.accept().unwrap();
    for n in 0..10 {
        // Split anywhere.
        let line = line(n);
        first.write_all(&line.as_bytes()[..7]).unwrap();
        first.write_all(&line.as_bytes()[7..]).unwrap();
    }
    live.listener.wait("ten records", |heard| (heard.records.len() == 10).then_some(()));
    first.write_all(b"P,10,").unwrap();
    drop(first);
    let TrackerEvent::Disconnected { reason, .. } = live.listener.nth_event(1, disconnected) else { panic!() };
    assert_eq!(reason, "the server closed the connection");
    assert!(live.listener.nth_event(1, decode_error).to_string().contains("ends after 5 bytes"));
    let (mut second, _) = server.accept().unwrap();
    second.write_all(line(11).as_bytes()).unwrap();
    let last = live.listener.wait("a record", |heard| heard.records.get(10).map(|(_, record)| *record));
    assert_eq!(last.sequence, Some(11));
    let TrackerEvent::Connected { port } = live.listener.nth_event(2, connected) else { panic!() };
    assert_eq!(port, address);
}

#[test]
fn an_unreachable_address_is_retried() {
    // Held, so that nobody else gets the port, but without a listener.
    let held = tokio::net::TcpSocket::new_v4().unwrap();
    held.bind(([127, 0, 0, 1], 0).into()).unwrap();
    let address = held.local_addr().unwrap();
    let live = Live::start(&settings(Transport::Tcp { address: address.to_string() }));
    let TrackerEvent::Disconnected { reason, retry } = live.listener.nth_event(1, disconnected) else { panic!() };
    assert!(reason.starts_with(&format!("cannot connect to {address}")), "{reason}");
    assert_eq!(retry, Duration::from_millis(250));
}

#[test]
fn datagrams_are_independent() {
    let live = Live::start(&settings(Transport::Udp { address: SocketAddr::from(([127, 0, 0, 1], 0)) }));
    let TrackerEvent::Connected { port } = live.listener.nth_event(1, connected) else { panic!() };
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.connect(port.strip_prefix("UDP ").unwrap()).unwrap();
    socket.send(line(0).as_bytes()).unwrap();
    // Half of one must not swallow the next.
    socket.send(&line(1).as_bytes()[..20]).unwrap();
    socket.send(line(2).as_bytes()).unwrap();
    socket.send(format!("{}{}", line(3), line(4)).as_bytes()).unwrap();
    let found = live.listener.wait("four records", |heard| {
        let found: Vec<_> = heard.records.iter().filter_map(|(_, record)| record.sequence).collect();
        (found.len() == 4).then_some(found)
    });
    assert_eq!(found, [0, 2, 3, 4]);
    assert!(live.listener.nth_event(1, decode_error).to_string().contains("ends after 20 bytes"));
}

#[test]
fn a_second_sender_is_left_out_and_named() {
    let live = Live::start(&settings(Transport::Udp { address: SocketAddr::from(([127, 0, 0, 1], 0)) }));
    let TrackerEvent::Connected { port } = live.listener.nth_event(1, connected) else { panic!() };
    let [first, second] = [0, 1].map(|_| {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.connect(port.strip_prefix("UDP ").unwrap()).unwrap();
        socket
    });
    for n in 0..20 {
        first.send(line(2 * n).as_bytes()).unwrap();
        second.send(line(1000 + n).as_bytes()).unwrap();
        // In order: each is received before the next is sent.
        live.listener.wait("a record", |heard| (heard.records.len() == n as usize + 1).then_some(()));
    }
    let TrackerEvent::OtherSender { other, used, .. } =
        live.listener.nth_event(1, |event| matches!(event, TrackerEvent::OtherSender { .. }))
    else {
        panic!()
    };
    assert_eq!((used, other), (first.local_addr().unwrap(), second.local_addr().unwrap()));
    live.listener.wait("its records alone", |heard| {
        assert!(heard.records.iter().all(|(_, record)| record.sequence < Some(1000)));
        // What is left out is not recorded either.
        let text = String::from_utf8_lossy(&heard.bytes);
        assert!(!text.contains("P,1000,") && text.contains("P,38,"), "{text}");
        Some(())
    });
}

#[test]
fn a_sender_with_a_new_port_for_each_datagram_is_one_sender() {
    let live = Live::start(&settings(Transport::Udp { address: SocketAddr::from(([127, 0, 0, 1], 0)) }));
    let TrackerEvent::Connected { port } = live.listener.nth_event(1, connected) else { panic!() };
    // All stay open, so that no port comes twice.
    let sockets = [(); 10].map(|()| UdpSocket::bind("127.0.0.1:0").unwrap());
    for (n, socket) in (0..).zip(&sockets) {
        socket.send_to(line(n).as_bytes(), port.strip_prefix("UDP ").unwrap()).unwrap();
    }
    live.listener.wait("all but the second and third", |heard| (heard.records.len() == 8).then_some(()));
    live.listener.wait("no second sender", |heard| {
        let is_other = |event: &TrackerEvent| matches!(event, TrackerEvent::OtherSender { .. });
        assert!(!heard.events.iter().any(is_other), "{:?}", heard.events);
        Some(())
    });
}
