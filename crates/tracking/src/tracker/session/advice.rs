//! Likely causes of a tracker's silence or damage, with remedies.

use std::net::{IpAddr, SocketAddr, UdpSocket};

use bytes::BytesMut;

use crate::tracker::settings::{Settings, Transport};
use crate::tracker::{Protocol, ascii_line, framing};

/// Largest number of recent bytes that a diagnosis examines. Half of it is a multiple of opentrack's datagram of 48
/// bytes, so that old bytes are forgotten in whole datagrams.
const SAMPLE_LIMIT: usize = 96 * 48;

/// Smallest number of decoded records that proves another protocol.
const PROOF: usize = 3;

/// Share of damaged pieces from which a remedy is named, if the stream also has records.
const NOTABLE: f64 = 0.02;

/// Flag byte of an SHTP frame over UART.
const SHTP_FLAG: u8 = 0x7E;

/// Usual speeds of serial devices, for advice about a wrong speed.
const USUAL_BAUDS: &str = "9600, 19200, 38400, 57600, 115200";

/// Keeps recent bytes of a stream and diagnoses them.
#[derive(Debug)]
pub(super) struct Advisor {
    protocol: Protocol,
    transport: Transport,
    sample: Vec<u8>,
}

impl Advisor {
    /// Advisor for the tracker of `settings` whose bytes are of `protocol`.
    pub(super) fn new(settings: &Settings, protocol: Protocol) -> Self {
        Self { protocol, transport: settings.transport.clone(), sample: Vec::with_capacity(SAMPLE_LIMIT) }
    }

    /// Takes received bytes and forgets the oldest.
    pub(super) fn bytes(&mut self, bytes: &[u8]) {
        let bytes = &bytes[bytes.len().saturating_sub(SAMPLE_LIMIT / 2)..];
        if self.sample.len() + bytes.len() > SAMPLE_LIMIT {
            self.sample.drain(..self.sample.len().min(SAMPLE_LIMIT / 2));
        }
        self.sample.extend_from_slice(bytes);
    }

    /// Forgets all bytes.
    pub(super) fn forget(&mut self) {
        self.sample.clear();
    }

    /// Remedy for `damaged` pieces among `records`; `None` if there is nothing to advise.
    pub(super) fn of_damage(&self, damaged: u64, records: u64) -> Option<String> {
        if damaged == 0 || matches!(self.transport, Transport::Recording { .. } | Transport::Mock(_)) {
            return None;
        }
        if records == 0 {
            return Some(self.of_foreign_bytes());
        }
        if (damaged as f64) < NOTABLE * (damaged + records) as f64 {
            return None;
        }
        let text = match &self.transport {
            Transport::Serial { .. } => {
                "bytes get lost or changed on the line: another program may read the same port (ModemManager, a serial \
                 monitor), the cable may be long or disturbed, or the device may send more than its baud rate carries"
            }
            Transport::Tcp { .. } => {
                "TCP changes no bytes: the sender writes broken records, or two programs write into one stream"
            }
            _ => "the sender's messages are not whole records; is it another program or version?",
        };
        Some(text.to_owned())
    }

    /// Diagnosis of bytes that contain no record.
    fn of_foreign_bytes(&self) -> String {
        let own = self.protocol.name();
        if let Some(other) = self.other_protocol() {
            let other = other.name();
            return format!(
                "these bytes are `{other}`, not `{own}`: set `[tracker] protocol = \"{other}\"` or `--protocol {other}`"
            );
        }
        let shtp = self.sample.windows(2).filter(|pair| pair[0] == SHTP_FLAG && pair[1] <= 1).count();
        if matches!(self.protocol, Protocol::Bno08x | Protocol::Bno08xRollFirst) && shtp >= 2 {
            return "the board speaks SHTP instead of UART-RVC: pull its pin PS0 high and PS1 low, then switch it off and on"
                .to_owned();
        }
        if self.protocol == Protocol::AsciiLine
            && let Some(fault) = ascii_line::fault_of_last(&self.sample)
        {
            return format!(
                "the sender writes lines of `{own}` with a fault: {fault}; docs/trackers.md has the format"
            );
        }
        let is_text = |byte: &&u8| matches!(**byte, b' '..=b'~' | b'\r' | b'\n' | b'\t');
        let text = self.sample.iter().filter(is_text).count();
        if !self.sample.is_empty() && text as f64 >= 0.95 * self.sample.len() as f64 {
            let start = self.sample.split(|b| *b == b'\n').nth(1).filter(|line| !line.is_empty());
            let line = framing::quote(start.unwrap_or(&self.sample));
            return format!(
                "the sender writes text that is not `{own}` (`{line}`): is it the right device and protocol? The formats are \
                 in docs/trackers.md"
            );
        }
        match &self.transport {
            Transport::Serial { baud, .. } => format!(
                "bytes arrive that are no protocol known here: most likely {baud} baud is not the device's speed. Set \
                 `[tracker] baud` or `--baud` to it (usual: {USUAL_BAUDS}), and check the protocol (`{own}`)"
            ),
            Transport::Hid { .. } => {
                let text =
                    "this device is no SpaceMouse: correct `tracker.port` or `--port`; `insonify trackers` lists them";
                text.to_owned()
            }
            _ => format!(
                "bytes arrive that are no protocol known here: is it the right address, and does the sender speak `{own}`?"
            ),
        }
    }

    /// Another protocol of which the sample contains at least `PROOF` records; `None` if there is none.
    fn other_protocol(&self) -> Option<Protocol> {
        let records = |protocol: Protocol| {
            let (mut decoder, mut buffer) = (protocol.decoder(), BytesMut::from(&self.sample[..]));
            let (mut records, mut damaged) = (0, 0);
            loop {
                match decoder.decode(&mut buffer) {
                    Ok(Some(_)) => records += 1,
                    Ok(None) => break,
                    Err(_) => damaged += 1,
                }
            }
            if damaged <= records { records } else { 0 }
        };
        let others =
            Protocol::ALL.into_iter().filter(|other| *other != self.protocol && self.transport.carries(*other));
        let counted = others.map(|other| (records(other), other)).filter(|(records, _)| *records >= PROOF);
        // If two protocols fit equally, the first one in `Protocol::ALL` is chosen: it is more common.
        counted.rev().max_by_key(|(records, _)| *records).map(|(_, other)| other)
    }

    /// Likely cause of a silence since the port was opened; `None` if there is nothing to advise. `damaged` is the
    /// number of damaged pieces, and `skipped` names messages without a pose.
    pub(super) fn of_silence(&self, bytes: u64, damaged: u64, skipped: Option<String>) -> Option<String> {
        if let Some(skipped) = skipped {
            return Some(match damaged {
                0 => format!("only messages without a pose arrive ({skipped}); the server must send transforms, too"),
                _ => format!(
                    "no whole transform arrives: {damaged} pieces are damaged, other messages hold no pose ({skipped}); \
                     does the server write transforms with the right lengths and check sums?"
                ),
            });
        }
        if bytes > 0 {
            return matches!(self.transport, Transport::Serial { .. } | Transport::Tcp { .. } | Transport::Udp { .. })
                .then(|| self.of_foreign_bytes());
        }
        match &self.transport {
            Transport::Udp { address } => Some(nothing_at(*address)),
            Transport::Tcp { address } => Some(match self.protocol {
                Protocol::OpenIgtLink => format!(
                    "{address} accepts the connection and sends nothing: PLUS sends the transforms named in its \
                     DefaultClientInfo, 3D Slicer those under its connector's Out node"
                ),
                Protocol::Ndi => {
                    format!("{address} accepts the connection and answers no command; is it an NDI device?")
                }
                _ => format!("{address} accepts the connection and sends nothing; is it streaming?"),
            }),
            Transport::Serial { port, baud } => Some(match self.protocol {
                Protocol::Ndi
                | Protocol::FastrakAscii
                | Protocol::FastrakBinary
                | Protocol::Liberty
                | Protocol::Patriot => format!(
                    "the device on {port} answers no command at {baud} baud: is it switched on, is the cable right (FASTRAK: \
                     null modem), and is {baud} baud what the device is set to?"
                ),
                _ => format!(
                    "nothing arrives on {port}: is the device switched on and sending, is it this port (`insonify trackers` \
                     lists them), and does no other program hold it?"
                ),
            }),
            Transport::Hid { .. } => Some("a puck sends nothing at rest: move it".to_owned()),
            Transport::None | Transport::Mock(_) | Transport::Recording { .. } => None,
        }
    }
}

/// Reasons for receiving nothing at a UDP address.
fn nothing_at(address: SocketAddr) -> String {
    let (ip, port) = (address.ip(), address.port());
    if ip.is_loopback() {
        return format!(
            "nothing arrives at UDP {address}, which only programs on this computer reach. For a sender elsewhere (a phone, \
             another PC) set `[tracker] address = \"0.0.0.0:{port}\"` or `--address 0.0.0.0:{port}`, and let it send to \
             {}, port {port}; if the sender is on this computer, check that it is started and sends to port {port}",
            own_address()
        );
    }
    let here = if ip.is_unspecified() { own_address() } else { ip.to_string() };
    format!(
        "nothing arrives at UDP {address}: does the sender run, is its target {here}, port {port} (not 127.0.0.1), are both \
         in one network, and does this computer's firewall let UDP port {port} in?"
    )
}

/// Address of this computer in its network, in words if it is unknown.
fn own_address() -> String {
    // Connecting a datagram socket only chooses a route; nothing is sent. The target is reserved for documentation.
    let chosen = UdpSocket::bind("0.0.0.0:0").and_then(|socket| {
        socket.connect("192.0.2.1:9")?;
        socket.local_addr()
    });
    match chosen.map(|address| address.ip()) {
        Ok(ip) if !ip.is_loopback() && ip != IpAddr::from([0, 0, 0, 0]) => format!("this computer's address ({ip})"),
        _ => "this computer's address in the network".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use insonify_core::pose::Pose;

    use super::*;
    use crate::tracker::PortName;

    fn advisor(protocol: Protocol, transport: Transport, bytes: &[u8]) -> Advisor {
        let mut advisor = Advisor::new(&Settings { transport, protocol, ..Settings::default() }, protocol);
        bytes.chunks(7).for_each(|piece| advisor.bytes(piece));
        advisor
    }

    fn serial() -> Transport {
        Transport::Serial { port: PortName::Path("/dev/ttyUSB0".into()), baud: 57_600 }
    }

    fn noise(count: u64) -> Vec<u8> {
        (0..count).map(|i| (insonify_core::random::bits(i) >> 11) as u8).collect()
    }

    #[test]
    fn bytes_of_another_protocol_are_named() {
        let lines: String = (0..20).map(|i| ascii_line::encode(i, u64::from(i) * 1000, &Pose::IDENTITY)).collect();
        let said = advisor(Protocol::Liberty, serial(), lines.as_bytes()).of_damage(9, 0).unwrap();
        assert!(said.contains("are `ascii-line`, not `liberty`") && said.contains("--protocol ascii-line"), "{said}");
    }

    #[test]
    fn datagrams_are_recognised_after_the_oldest_were_forgotten() {
        let datagram: Vec<u8> = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0_f64].iter().flat_map(|v| v.to_le_bytes()).collect();
        let udp = Transport::Udp { address: "127.0.0.1:4242".parse().unwrap() };
        let said = advisor(Protocol::AsciiLine, udp, &datagram.repeat(100)).of_damage(100, 0).unwrap();
        assert!(said.contains("are `opentrack`, not `ascii-line`"), "{said}");
    }

    #[test]
    fn random_bytes_on_a_line_suggest_its_speed() {
        let said = advisor(Protocol::AsciiLine, serial(), &noise(3000)).of_damage(40, 0).unwrap();
        assert!(said.contains("57600 baud is not the device's speed") && said.contains("--baud"), "{said}");
        let tcp = Transport::Tcp { address: "h:1".into() };
        let said = advisor(Protocol::AsciiLine, tcp, &noise(3000)).of_damage(40, 0).unwrap();
        assert!(!said.contains("baud") && said.contains("speak `ascii-line`"), "{said}");
    }

    #[test]
    fn a_device_that_is_no_puck_is_named_by_its_key() {
        let said =
            advisor(Protocol::SpaceMouse, Transport::Hid { device: None }, &noise(300)).of_damage(40, 0).unwrap();
        assert!(said.contains("no SpaceMouse: correct `tracker.port`") && !said.contains("address"), "{said}");
    }

    #[test]
    fn a_board_in_another_mode_and_foreign_text_are_recognised() {
        let frame = [0x7E, 0x01, 0x14, 0x81, 0x02, 0x00, 0xF8, 0x00, 0x04, 0x04, 0x7E];
        let said = advisor(Protocol::Bno08x, serial(), &frame.repeat(20)).of_damage(40, 0).unwrap();
        assert!(said.contains("SHTP instead of UART-RVC") && said.contains("PS0 high"), "{said}");
        let said = advisor(Protocol::Liberty, serial(), &b"x=1 y=2\r\n".repeat(20)).of_damage(40, 0).unwrap();
        assert!(said.contains("text that is not `liberty` (`x=1 y=2"), "{said}");
    }

    #[test]
    fn a_fault_in_every_line_of_ones_own_firmware_is_named() {
        let sealed = |body: &str, sum: u8| format!("P{body}*{:02X}\n", body.bytes().fold(sum, |sum, byte| sum ^ byte));
        for (line, words) in [
            ("P,7,1000,1.5,-2,80.25,1,0,0,0\n".to_owned(), "a line has no checksum"),
            (sealed(",7,1000,1.5,-2,80.25,1,0,0,0", b'P'), "between `P` and `*`, both left out"),
            (sealed(",7,1000,1,5,-2,0,80,25,1,0,0,0,0,0,0,0", 0), "a decimal point, no comma"),
            (sealed(",7,1000,1.5,-2,80.25,1.01,0,0,0", 0), "has norm 1.010000"),
        ] {
            let advisor = advisor(Protocol::AsciiLine, serial(), line.repeat(20).as_bytes());
            for said in [advisor.of_damage(20, 0), advisor.of_silence(600, 20, None)] {
                assert!(said.as_ref().is_some_and(|said| said.contains(words)), "{words}: {said:?}");
            }
        }
    }

    #[test]
    fn part_of_the_records_damaged_has_other_causes_and_a_rare_fault_none() {
        let advise = |damaged, records| advisor(Protocol::AsciiLine, serial(), b"").of_damage(damaged, records);
        assert!(advise(50, 50).unwrap().contains("another program may read the same port"));
        assert_eq!((advise(1, 500), advise(0, 0)), (None, None));
    }

    #[test]
    fn silence_names_the_address_and_its_likely_causes() {
        let udp = |address: &str| {
            let transport = Transport::Udp { address: address.parse().unwrap() };
            advisor(Protocol::OpenTrack, transport, b"").of_silence(0, 0, None).unwrap()
        };
        let said = udp("127.0.0.1:4242");
        assert!(said.contains("UDP 127.0.0.1:4242") && said.contains("--address 0.0.0.0:4242"), "{said}");
        let said = udp("0.0.0.0:4243");
        assert!(said.contains("firewall") && said.contains("not 127.0.0.1") && said.contains("port 4243"), "{said}");
        let tcp = Transport::Tcp { address: "h:18944".into() };
        let advisor_of_igt = advisor(Protocol::OpenIgtLink, tcp, b"");
        let said = advisor_of_igt.of_silence(900, 0, Some("IMAGE, STATUS".into())).unwrap();
        assert!(said.contains("only messages without a pose arrive (IMAGE, STATUS)"), "{said}");
        // Transforms arrive, too, but with wrong checksums.
        let said = advisor_of_igt.of_silence(900, 7, Some("STATUS".into())).unwrap();
        assert!(!said.contains("only messages") && said.contains("7 pieces are damaged"), "{said}");
        let said = advisor(Protocol::Liberty, serial(), b"").of_silence(0, 0, None).unwrap();
        assert!(said.contains("answers no command at 57600 baud"), "{said}");
    }
}
