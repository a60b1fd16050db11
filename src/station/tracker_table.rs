//! `[tracker]`: source of live poses.

use std::net::SocketAddr;
use std::path::Path;
use std::str::FromStr;
use std::time::Duration;

use super::StationError;
use super::values::Values;
use crate::pose::Pose;
use crate::settings::{Repeat, TrackerSettings};
use crate::tracker::DeviceOptions;
use crate::tracker::ndi::USUAL_BAUD;
use crate::tracker::{Protocol, Settings, Speed, Transport, TransportKind, mock};

/// Keys that only some transports accept, with these transports.
const TRANSPORTS_OF: [(&[&str], &[&str]); 11] = [
    (&["protocol"], &["serial", "tcp", "udp", "hid", "mock"]),
    (&["port"], &["serial", "hid"]),
    (&["baud"], &["serial"]),
    (&["address"], &["tcp", "udp"]),
    (&["sensor"], &["serial", "tcp", "udp", "hid", "recording"]),
    (&["tool"], &["serial", "tcp", "recording"]),
    (&["silence_ms"], &["serial", "tcp", "udp", "hid", "mock", "recording"]),
    (&["reset_delay_ms", "hemisphere", "ndi_reply", "ndi_roms", "ndi_out_of_volume"], &["serial", "tcp"]),
    (&["puck_range", "axis_map"], &["hid", "recording"]),
    (&["recording", "speed", "repeat"], &["recording"]),
    (&["schedule", "rate_hz", "seed"], &["mock"]),
];

/// Settings of the station's tracker. A mock tracker moves about `default_pose`. Relative paths start at `dir`.
pub(super) fn settings(values: &Values, default_pose: Option<Pose>, dir: &Path) -> Result<Settings, StationError> {
    let kind = values.text("transport").and_then(TransportKind::named).unwrap_or(TransportKind::None);
    let name = kind.name();
    for (keys, transports) in TRANSPORTS_OF {
        if !transports.contains(&name) {
            let reason = format!("`tracker.transport` is \"{name}\"; it is for {}", transports.join(", "));
            values.refuse(keys, &reason)?;
        }
    }
    let defaults = Settings::default();
    let protocol = match (values.text("protocol"), kind) {
        (Some(_), _) => text(values, "protocol", defaults.protocol)?,
        (None, TransportKind::Hid) => Protocol::SpaceMouse,
        (None, TransportKind::None | TransportKind::Mock | TransportKind::Recording) => Protocol::AsciiLine,
        (None, _) => {
            let names = Protocol::ALL.map(Protocol::name).join(", ");
            return Err(missing("protocol", &format!("what the tracker speaks, one of {names}")));
        }
    };
    let transport = transport(kind, protocol, values, default_pose, dir)?;
    if !transport.carries(protocol) {
        let reason = format!("trackers that speak `{}` aren't reached by transport `{name}`", protocol.name());
        return Err(StationError::Text { key: "tracker.protocol".to_owned(), reason });
    }
    if !protocol.has_names() && kind != TransportKind::Recording {
        let reason = format!(
            "`tracker.protocol` is \"{}\", whose sensors have numbers: `tracker.sensor` chooses one",
            protocol.name()
        );
        values.refuse(&["tool"], &reason)?;
    }
    if values.text("tool").is_some() {
        values.refuse(&["sensor"], "`tracker.tool` chooses the probe by its name")?;
    }
    if protocol.has_names() && kind != TransportKind::Recording {
        let reason = format!("`{}` numbers its tools by arrival; name the probe by `tool`", protocol.name());
        values.refuse(&["sensor"], &reason)?;
    }
    let (given, usual): (TrackerSettings, _) = (values.group(), DeviceOptions::default());
    let mut device = DeviceOptions {
        sensor: values.integer("sensor").and_then(|sensor| u16::try_from(sensor).ok()),
        tool: values.text("tool").map(str::to_owned),
        silence: milliseconds(given.silence_ms),
        reset_delay: milliseconds(given.reset_delay_ms),
        hemisphere: values.numbers("hemisphere").unwrap_or(usual.hemisphere),
        puck_range: given.puck_range,
        ..usual
    };
    if let Transport::Serial { .. } = transport {
        device.ndi.baud = Some(values.integer("baud").unwrap_or(USUAL_BAUD));
    }
    if protocol != Protocol::Ndi {
        let reason = format!("`tracker.protocol` is \"{}\"; it is for ndi", protocol.name());
        values.refuse(&["ndi_reply", "ndi_roms", "ndi_out_of_volume"], &reason)?;
    } else {
        device.ndi.format = given.ndi_reply;
        device.ndi.out_of_volume = given.ndi_out_of_volume;
        let roms = values.texts("ndi_roms").unwrap_or_default();
        device.ndi.rom_files = roms.into_iter().map(|path| dir.join(path)).collect();
        device
            .ndi
            .validate()
            .map_err(|e| StationError::Text { key: "tracker.baud".to_owned(), reason: e.to_string() })?;
    }
    Ok(Settings { transport, protocol, device, axis_map: text(values, "axis_map", defaults.axis_map)? })
}

fn transport(
    kind: TransportKind,
    protocol: Protocol,
    values: &Values,
    default_pose: Option<Pose>,
    dir: &Path,
) -> Result<Transport, StationError> {
    Ok(match kind {
        TransportKind::Serial => Transport::Serial {
            port: parsed("port", values.text("port").ok_or_else(|| missing("port", "which serial port"))?)?,
            // An NDI device is opened at its default baud rate, and then switched to the station's.
            baud: match protocol {
                Protocol::Ndi => protocol.usual_baud(),
                _ => values.integer("baud").unwrap_or(protocol.usual_baud()),
            },
        },
        TransportKind::Tcp => {
            let address = values.text("address").ok_or_else(|| missing("address", "the tracker's host:port"))?;
            match address.rsplit_once(':') {
                Some((host, port)) if !host.is_empty() && port.parse::<u16>().is_ok() => {}
                _ => return Err(not_an_address(address)),
            }
            Transport::Tcp { address: address.to_owned() }
        }
        TransportKind::Udp => {
            let address = values.text("address").unwrap_or("127.0.0.1:4242");
            Transport::Udp { address: SocketAddr::from_str(address).map_err(|_| not_an_address(address))? }
        }
        TransportKind::Hid => {
            Transport::Hid { device: values.text("port").map(|port| parsed("port", port)).transpose()? }
        }
        TransportKind::Mock => {
            let mut mock = mock::Settings::default();
            mock.around = default_pose.unwrap_or(mock.around);
            values.set_group(&mut mock);
            mock.schedule = text(values, "schedule", mock.schedule)?;
            Transport::Mock(mock)
        }
        TransportKind::Recording => {
            let path = values.text("recording").ok_or_else(|| missing("recording", "which recording to play"))?;
            let TrackerSettings { speed, repeat, .. } = values.group();
            let speed = if speed > 0.0 { Speed::Factor(speed) } else { Speed::AtOnce };
            let repeat = repeat == Repeat::Yes;
            if repeat && speed == Speed::AtOnce {
                values.refuse(&["repeat"], "`tracker.speed` is 0: it would never rest")?;
            }
            Transport::Recording { path: dir.join(path), speed, repeat }
        }
        TransportKind::None => Transport::None,
    })
}

fn milliseconds(ms: f64) -> Duration {
    Duration::from_secs_f64(ms / 1000.0)
}

fn text<T: FromStr<Err: std::fmt::Display>>(values: &Values, key: &str, default: T) -> Result<T, StationError> {
    values.text(key).map_or(Ok(default), |text| parsed(key, text))
}

fn parsed<T: FromStr<Err: std::fmt::Display>>(key: &str, text: &str) -> Result<T, StationError> {
    let wrong = |error: T::Err| StationError::Text { key: format!("tracker.{key}"), reason: error.to_string() };
    text.parse().map_err(wrong)
}

fn missing(key: &str, needed: &str) -> StationError {
    StationError::Missing { key: format!("tracker.{key}"), needed: needed.to_owned() }
}

fn not_an_address(text: &str) -> StationError {
    let reason = format!("`{text}` is no address; it must be host:port (for udp an IP address and a port)");
    StationError::Text { key: "tracker.address".to_owned(), reason }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::settings::ReplyFormat;
    use crate::station::tests::{assert_refused, parse};
    use crate::tracker::{PortName, ProbeSensor};

    fn read(table: &str) -> Result<Settings, StationError> {
        Ok(parse(&format!("[pose]\nposition_mm = [1, 2, 3]\n{table}"))?.tracker)
    }

    fn transport_of(table: &str) -> Transport {
        read(&format!("[tracker]\n{table}")).unwrap().transport
    }

    #[test]
    fn each_transport_is_read() {
        assert_eq!(read("").unwrap(), Settings::default());
        let port = PortName::Usb { vendor: 0x403, product: 0x6001, serial: None };
        assert_eq!(
            transport_of("transport = \"serial\"\nport = \"0403:6001\"\nprotocol = \"liberty\""),
            Transport::Serial { port, baud: 115_200 }
        );
        assert_eq!(
            transport_of("transport = \"tcp\"\naddress = \"tracker.local:5000\"\nprotocol = \"ascii-line\""),
            Transport::Tcp { address: "tracker.local:5000".into() }
        );
        assert_eq!(
            transport_of("transport = \"udp\"\nprotocol = \"ascii-line\""),
            Transport::Udp { address: SocketAddr::from(([127, 0, 0, 1], 4242)) }
        );
        assert_eq!(
            transport_of("transport = \"recording\"\nrecording = \"a.mcap\"\nspeed = 0"),
            Transport::Recording { path: PathBuf::from("/station/a.mcap"), speed: Speed::AtOnce, repeat: false }
        );
        let Transport::Mock(mock) = transport_of("transport = \"mock\"\nschedule = \"hold 1\"\nseed = 9") else {
            panic!("no mock");
        };
        assert_eq!((mock.around.position_mm.x, mock.schedule.to_string(), mock.seed), (1.0, "hold 1".into(), 9));
    }

    #[test]
    fn options_are_read() {
        let table = "[tracker]\ntransport = \"tcp\"\naddress = \"h:1\"\nprotocol = \"fastrak-binary\"\nsensor = 2\n\
                     silence_ms = 500\nreset_delay_ms = 100\nhemisphere = [0, -1, 0]";
        let device = read(table).unwrap().device;
        let expected = DeviceOptions {
            sensor: Some(2),
            silence: Duration::from_millis(500),
            reset_delay: Duration::from_millis(100),
            hemisphere: [0.0, -1.0, 0.0],
            ..DeviceOptions::default()
        };
        assert_eq!(device, expected);
    }

    #[test]
    fn the_probe_is_chosen_by_name_or_by_number() {
        let probe = |table: &str| read(&format!("[tracker]\n{table}")).unwrap().device.probe();
        let igtl = "transport = \"tcp\"\naddress = \"h:18944\"\nprotocol = \"openigtlink\"\n";
        let tool = Some(ProbeSensor::Tool("ProbeToTracker".into()));
        assert_eq!(probe(&format!("{igtl}tool = \"ProbeToTracker\"")), tool);
        assert_eq!(probe(igtl), None);
        let recording = "transport = \"recording\"\nrecording = \"a.mcap\"\n";
        assert_eq!(probe(&format!("{recording}tool = \"ProbeToTracker\"")), tool);
        assert_eq!(probe(&format!("{recording}sensor = 1")), Some(ProbeSensor::Number(1)));
    }

    #[test]
    fn options_of_ndi_devices_and_pucks_are_read() {
        let ndi = |rest: &str| {
            read(&format!("[tracker]\ntransport = \"tcp\"\naddress = \"h:8765\"\nprotocol = \"ndi\"\n{rest}"))
        };
        let found = ndi("ndi_reply = \"TX\"\nndi_roms = [\"tools/a.rom\", \"/b.rom\"]\nndi_out_of_volume = false");
        let found = found.unwrap().device.ndi;
        assert_eq!((found.format, found.out_of_volume), (ReplyFormat::Text, false));
        assert_eq!(found.rom_files, [PathBuf::from("/station/tools/a.rom"), PathBuf::from("/b.rom")]);
        let found = ndi("").unwrap().device.ndi;
        assert_eq!((found.format, found.out_of_volume, found.rom_files.len()), (ReplyFormat::Binary, true, 0));
        let puck = read("[tracker]\ntransport = \"hid\"\npuck_range = 500").unwrap().device;
        assert_eq!(puck.puck_range, 500.0);
    }

    #[test]
    fn mistakes_are_named() {
        let lines = [
            ("transport = \"serail\"", "(did you mean `serial`?)"),
            ("transport = \"serial\"\nprotocol = \"liberty\"", "`tracker.port` is missing"),
            ("transport = \"serial\"\nport = \"/dev/x\"", "`tracker.protocol` is missing"),
            (
                "transport = \"serial\"\nport = \"/dev/x\"\nprotocol = \"librety\"",
                "`tracker.protocol` is \"librety\"; it must be one of",
            ),
            ("transport = \"serial\"\nport = \"zz:1\"\nprotocol = \"liberty\"", "`tracker.port`: `zz:1` is no port"),
            ("transport = \"udp\"\nprotocol = \"liberty\"", "aren't reached by transport `udp`"),
            ("transport = \"tcp\"\naddress = \"host\"\nprotocol = \"liberty\"", "`host` is no address"),
            ("transport = \"mock\"\nport = \"/dev/x\"", "`tracker.port` does not apply"),
            ("baud = 9600", "`tracker.baud` does not apply: `tracker.transport` is \"none\""),
            ("transport = \"mock\"\nschedule = \"dance 3\"", "`tracker.schedule`: `dance 3` is no part"),
            (
                "transport = \"tcp\"\naddress = \"h:1\"\nprotocol = \"liberty\"\nndi_reply = \"TX\"",
                "`tracker.ndi_reply` does not apply: `tracker.protocol` is \"liberty\"; it is for ndi",
            ),
            (
                "transport = \"serial\"\nport = \"/dev/x\"\nprotocol = \"liberty\"\ntool = \"Probe\"",
                "`tracker.tool` does not apply: `tracker.protocol` is \"liberty\", whose sensors have numbers",
            ),
            (
                "transport = \"tcp\"\naddress = \"h:1\"\nprotocol = \"openigtlink\"\ntool = \"Probe\"\nsensor = 1",
                "`tracker.sensor` does not apply: `tracker.tool` chooses the probe by its name",
            ),
            // A number would depend on the order in which the tools happen to come into view.
            (
                "transport = \"tcp\"\naddress = \"h:1\"\nprotocol = \"openigtlink\"\nsensor = 0",
                "`tracker.sensor` does not apply: `openigtlink` numbers its tools by arrival; name the probe by `tool`",
            ),
            ("transport = \"mock\"\npuck_range = 350", "`tracker.puck_range` does not apply"),
            ("transport = \"recording\"\nrecording = \"a\"\nspeed = 0\nrepeat = \"yes\"", "it would never rest"),
        ];
        assert_refused("tracker", &lines.map(|(line, message)| (line, [message])));
    }
}
