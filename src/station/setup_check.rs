//! Faults of a station's tracker and calibration that can be found without a session.

use std::fmt;
use std::path::Path;

use glam::{DQuat, DVec3};
use serde::Serialize;

use super::Station;
use crate::anatomy::doctor::Severity;
use crate::pose::pivot::METRES_BELOW_MM;
use crate::pose::{Calibration, CalibrationError, CalibrationSource, Fitted, Pose, angle_between};
use crate::tracker::devices::{Devices, SerialDevice};
use crate::tracker::{PortName, Protocol, Settings, Transport};

/// Largest plausible distance of a tracker from the centre of its scene, mm. Optical trackers reach 3 m.
const TRACKER_MM: f64 = 4000.0;

/// Plausible distances of a probe's face, or of a stylus's tip, from its sensor, mm.
const MOUNT_MM: [f64; 2] = [METRES_BELOW_MM, 500.0];

/// Distance between the origins of tracker and scene below which the calibration is likely in metres, mm.
const ORIGIN_MM: f64 = 10.0;

/// Residual of a calibration's fit above which the calibration is doubtful, mm.
const RMS_MM: f64 = 5.0;

/// A finding about a station's tracker or calibration.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct SetupFinding {
    /// Severity.
    pub severity: Severity,
    /// Sentence that says what is wrong and names the key of the station file.
    pub what: String,
    /// Advice how to mend it.
    pub remedy: String,
}

impl fmt::Display for SetupFinding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:8} {}\n         {}", self.severity.to_string(), self.what, self.remedy)
    }
}

/// Findings about the tracker and calibration of `station`. `bounds_mm` are the bounds of its scene. `devices` are
/// the devices of this machine; without them, ports aren't looked for.
pub fn check_setup(
    station: &Station,
    bounds_mm: Option<[[f32; 3]; 2]>,
    devices: Option<&Devices>,
) -> Vec<SetupFinding> {
    let mut findings = tracker(station, devices);
    match station.calibration.load() {
        Err(error) => findings.push(unusable(&error)),
        Ok(calibration) => {
            findings.extend(incomplete(&station.tracker, &calibration));
            findings.extend(implausible(&calibration, bounds_mm));
            findings.extend(needle(station));
        }
    }
    findings.sort_by_key(|finding| finding.severity);
    findings
}

/// Warnings about missing parts of a calibration that a live `tracker` needs, for the start of a session. A
/// calibration file that can't be read gives no warning here; whoever uses it reports the error.
pub fn missing_calibration(tracker: &Settings, calibration: &CalibrationSource) -> Vec<SetupFinding> {
    calibration.load().map_or_else(|_| Vec::new(), |calibration| incomplete(tracker, &calibration))
}

fn finding(severity: Severity, what: impl Into<String>, remedy: impl Into<String>) -> SetupFinding {
    SetupFinding { severity, what: what.into(), remedy: remedy.into() }
}

fn unusable(error: &CalibrationError) -> SetupFinding {
    let remedy = match error {
        CalibrationError::Missing { .. } => {
            "write it with `insonify calibrate landmarks --tracker` and `insonify calibrate probe --tracker` and this station, or remove the key `path` of `[calibration]`"
        }
        CalibrationError::Twice { .. } => "keep one of the two",
        _ => "correct the file, or write it anew with `insonify calibrate`",
    };
    finding(Severity::Error, error.to_string(), remedy)
}

/// Whether the tracker's poses are relative to its own origin, so that a calibration is needed.
fn needs_calibration(tracker: &Settings) -> bool {
    let live = matches!(tracker.transport, Transport::Serial { .. } | Transport::Tcp { .. } | Transport::Udp { .. });
    live && !matches!(tracker.protocol, Protocol::Bno08x | Protocol::Bno08xRollFirst)
}

/// Findings about missing parts of a calibration that a live tracker needs.
fn incomplete(tracker: &Settings, calibration: &Calibration) -> Vec<SetupFinding> {
    if !needs_calibration(tracker) {
        return Vec::new();
    }
    let mut findings = Vec::new();
    if calibration.scene_from_tracker.is_none() {
        findings.push(finding(
            Severity::Warning,
            "nothing says where the tracker is in the scene: its origin and axes are taken to be the scene's",
            "`insonify calibrate landmarks --tracker` with this station finds it, and writes it to `[calibration] path`",
        ));
    }
    if calibration.sensor_from_probe.is_none() {
        findings.push(finding(
            Severity::Warning,
            "nothing says how the sensor is mounted on the probe: its origin is taken to be the centre of the probe's face, its axes the probe's",
            "`insonify calibrate probe --tracker` with this station finds it, and writes it to `[calibration] path`",
        ));
    }
    findings
}

/// Findings about calibrated values that are implausible.
fn implausible(calibration: &Calibration, bounds_mm: Option<[[f32; 3]; 2]>) -> Vec<SetupFinding> {
    let mut findings = Vec::new();
    let mut warn = |what: String, remedy: &str| findings.push(finding(Severity::Warning, what, remedy));
    let residual = |rms_mm: Option<f64>| rms_mm.filter(|rms| *rms > RMS_MM);
    if let Some(Fitted { value, rms_mm }) = calibration.scene_from_tracker {
        let centre = bounds_mm.map_or(DVec3::ZERO, |[low, high]| {
            0.5 * (DVec3::from_array(low.map(f64::from)) + DVec3::from_array(high.map(f64::from)))
        });
        let away_mm = value.position_mm.distance(centre);
        if away_mm > TRACKER_MM {
            warn(
                format!("[scene_from_tracker] puts the tracker {:.1} m from the middle of the scene", 1e-3 * away_mm),
                "trackers reach 3 m at most: touch the landmarks again, with the unit of the tracker's points",
            );
        }
        let origin_mm = value.position_mm.length();
        if origin_mm > 0.0 && origin_mm < ORIGIN_MM {
            warn(
                format!(
                    "[scene_from_tracker] puts the tracker {origin_mm:.3} mm from the scene's origin: is it in metres?"
                ),
                "`position_mm` is in mm; `insonify calibrate landmarks` writes it",
            );
        }
        if let Some(rms) = residual(rms_mm) {
            warn(
                format!("[scene_from_tracker] was fitted with a residual of {rms:.1} mm RMS"),
                "touch the landmarks again; 1 to 2 mm are usual",
            );
        }
    }
    if let Some(Fitted { value: Pose { position_mm, orientation }, rms_mm }) = calibration.sensor_from_probe {
        if let Some(what) = off_mount("[sensor_from_probe] puts the face", position_mm) {
            warn(what, "find it again with `insonify calibrate probe`");
        }
        if rms_mm.is_some() && angle_between(orientation, DQuat::IDENTITY) < 1e-9 {
            warn(
                "[sensor_from_probe] was pivoted, and the probe's axes are taken to be the sensor's".to_owned(),
                "find the turn of the probe with `insonify calibrate probe`",
            );
        }
        if let Some(rms) = residual(rms_mm) {
            let what = format!("[sensor_from_probe] was fitted with a residual of {rms:.1} mm RMS");
            warn(what, "pivot it again; the middle of the face must not slip");
        }
    }
    if let Some(Fitted { value, rms_mm }) = calibration.stylus_tip_mm {
        if let Some(what) = off_mount("[stylus] puts the tip", value) {
            warn(what, "find it again with `insonify calibrate pivot`");
        }
        if let Some(rms) = residual(rms_mm) {
            let what = format!("[stylus] was fitted with a residual of {rms:.1} mm RMS");
            warn(what, "pivot it again; the tip must not slip");
        }
    }
    findings
}

/// Finding about a tracked needle whose sensor's mounting is unknown.
fn needle(station: &Station) -> Option<SetupFinding> {
    station.tracker.device.needle.as_ref()?;
    let error = station.needle_settings().err()?;
    let remedy = "write the table `[needle]` of the calibration file, or remove `sensor` and `tool` of the station's `[needle]` and give its `position_mm`";
    Some(finding(Severity::Error, error.to_string(), remedy))
}

/// Message about an implausible distance from a sensor; `None` for a plausible one.
fn off_mount(what: &str, position_mm: DVec3) -> Option<String> {
    let away_mm = position_mm.length();
    let [least, most] = MOUNT_MM;
    if away_mm > most {
        return Some(format!("{what} {away_mm:.0} mm from its sensor: is a unit wrong?"));
    }
    (away_mm > 0.0 && away_mm < least).then(|| format!("{what} {away_mm:.3} mm from its sensor: is it in metres?"))
}

/// Finding about a `sensor` number other than 0, if the tracker has only sensor 0.
fn unheard_sensor(tracker: &Settings) -> Option<SetupFinding> {
    let Settings { transport, protocol, device, .. } = tracker;
    let has_one = protocol.sensor_numbers() == (0..=0);
    let number = device.sensor.filter(|number| *number != 0 && has_one)?;
    // A recording has its own protocol.
    (!matches!(transport, Transport::Recording { .. })).then(|| {
        let what = format!(
            "`tracker.sensor` is {number}, which is never heard: `{}` has one sensor, number 0",
            protocol.name()
        );
        finding(Severity::Error, what, "remove the key `sensor`")
    })
}

/// Findings about the tracker's port, files and sensor.
fn tracker(station: &Station, devices: Option<&Devices>) -> Vec<SetupFinding> {
    let mut findings = Vec::from_iter(unheard_sensor(&station.tracker));
    match &station.tracker.transport {
        Transport::Serial { port, .. } => {
            let ports = devices.map_or(&[][..], |devices| &devices.serial);
            if devices.is_some() && !is_there(port, ports) {
                let all: Vec<&str> = ports.iter().map(|port| port.path.as_str()).collect();
                let all = if all.is_empty() {
                    "there is no serial port".to_owned()
                } else {
                    format!("there are {}", all.join(", "))
                };
                findings.push(finding(
                    Severity::Warning,
                    format!("`tracker.port` is {port}, which is not plugged in; {all}"),
                    "plug the tracker in, or correct the key; `insonify trackers` lists ports with their USB ids",
                ));
            }
        }
        Transport::Hid { device } => {
            let found = devices.is_none_or(|devices| {
                devices.hid.iter().any(|hid| match device {
                    None => hid.space_mouse,
                    Some(PortName::Path(path)) => hid.path == *path,
                    Some(usb) => usb.is(hid.usb.vendor, hid.usb.product, hid.usb.serial.as_deref()),
                })
            });
            if !found {
                let which = device.as_ref().map_or_else(|| "a SpaceMouse".to_owned(), PortName::to_string);
                findings.push(finding(
                    Severity::Warning,
                    format!("{which} is not plugged in"),
                    "plug it in, or correct `tracker.port`; `insonify trackers` lists HID devices",
                ));
            }
        }
        Transport::Udp { address } if address.ip().is_loopback() => findings.push(finding(
            Severity::Note,
            format!("the tracker is heard on {address}, from this machine only"),
            "for a sender on another machine set `tracker.address` to 0.0.0.0 and the port",
        )),
        Transport::Recording { path, .. } if !path.is_file() => findings.push(finding(
            Severity::Error,
            format!("`tracker.recording` is {}, which is not there", path.display()),
            "correct the key, or record one with `insonify record`",
        )),
        _ => {}
    }
    findings.extend(station.tracker.device.ndi.rom_files.iter().filter(|path| !path.is_file()).map(|path| {
        let what = format!("`tracker.ndi_roms` names {}, which is not there", path.display());
        finding(Severity::Error, what, "copy the tool's .rom file there, or correct the key")
    }));
    findings
}

/// Whether `port` is among the ports of this machine.
fn is_there(port: &PortName, ports: &[SerialDevice]) -> bool {
    let exists = matches!(port, PortName::Path(path) if Path::new(path).exists());
    exists || ports.iter().any(|device| device.is(port))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(dir: &Path, tables: &str, bounds: Option<[[f32; 3]; 2]>) -> Vec<SetupFinding> {
        let station = Station::parse(&format!("[scene]\nphantom = \"obstetric\"\n{tables}"), dir).unwrap();
        check_setup(&station, bounds, Some(&Devices { serial: Vec::new(), hid: Vec::new() }))
    }

    #[test]
    fn tracker_and_calibration_of_a_station_are_checked() {
        let dir = tempfile::tempdir().unwrap();
        let dir = dir.path();
        let says = |tables: &str, severity: Severity, part: &str| {
            let all = found(dir, tables, None);
            assert!(all.iter().any(|f| f.severity == severity && f.what.contains(part)), "{part}: {all:#?}");
        };
        let live = "[tracker]\ntransport = \"serial\"\nprotocol = \"liberty\"\nport = \"/dev/no-such-port\"\n";
        says(
            live,
            Severity::Warning,
            "`tracker.port` is /dev/no-such-port, which is not plugged in; there is no serial port",
        );
        says(live, Severity::Warning, "nothing says where the tracker is in the scene");
        says(live, Severity::Warning, "nothing says how the sensor is mounted");
        let datagrams = "[tracker]\ntransport = \"udp\"\nprotocol = \"opentrack\"\n";
        let part = "`tracker.sensor` is 2, which is never heard: `opentrack` has one sensor, number 0";
        says(&format!("{datagrams}sensor = 2\n"), Severity::Error, part);
        let needle = format!("{live}[needle]\nsensor = 2\n");
        says(&needle, Severity::Error, "`[needle]` is tracked, but `[calibration] path` names no file");
        says("[tracker]\ntransport = \"hid\"\n", Severity::Warning, "a SpaceMouse is not plugged in");
        says("[tracker]\ntransport = \"udp\"\nprotocol = \"opentrack\"\n", Severity::Note, "from this machine only");
        says("[tracker]\ntransport = \"recording\"\nrecording = \"a.mcap\"\n", Severity::Error, "which is not there");
        says("[calibration]\npath = \"none.toml\"\n", Severity::Error, "there is no such file");
        std::fs::write(dir.join("bad.toml"), "version = 1\nmine = 2\n").unwrap();
        says("[calibration]\npath = \"bad.toml\"\n", Severity::Error, "unknown field `mine`");
        let at = |position: [f64; 3]| Pose { position_mm: position.into(), ..Pose::IDENTITY };
        fn fitted<T>(value: T) -> Option<Fitted<T>> {
            Some(Fitted { value, rms_mm: Some(6.5) })
        }
        let wrong = Calibration {
            scene_from_tracker: fitted(at([0.0, 9000.0, 0.0])),
            sensor_from_probe: fitted(at([0.0, 0.0, 0.09])),
            stylus_tip_mm: fitted(DVec3::X * 900.0),
            ..Calibration::default()
        };
        std::fs::write(dir.join("wrong.toml"), wrong.to_toml()).unwrap();
        for part in [
            "puts the tracker 9.0 m from the middle of the scene",
            "[scene_from_tracker] was fitted with a residual of 6.5 mm RMS",
            "[sensor_from_probe] puts the face 0.090 mm from its sensor: is it in metres?",
            "the probe's axes are taken to be the sensor's",
            "[stylus] puts the tip 900 mm from its sensor",
        ] {
            says("[calibration]\npath = \"wrong.toml\"\n", Severity::Warning, part);
        }
        let metres = Calibration { scene_from_tracker: fitted(at([0.3, 0.1, 1.2])), ..Calibration::default() };
        std::fs::write(dir.join("metres.toml"), metres.to_toml()).unwrap();
        let part = "[scene_from_tracker] puts the tracker 1.241 mm from the scene's origin: is it in metres?";
        says("[calibration]\npath = \"metres.toml\"\n", Severity::Warning, part);
        let far = Some([[-100.0, 8000.0, -100.0], [100.0, 8400.0, 100.0]]);
        let all = found(dir, "[calibration]\npath = \"wrong.toml\"\n", far);
        assert!(!all.iter().any(|f| f.what.contains("from the middle")), "{all:#?}");
    }

    #[test]
    fn a_session_warns_of_each_missing_part_of_a_real_trackers_calibration() {
        let dir = tempfile::tempdir().unwrap();
        let said = |tables: &str| {
            let station = Station::parse(&format!("[scene]\nphantom = \"obstetric\"\n{tables}"), dir.path()).unwrap();
            missing_calibration(&station.tracker, &station.calibration)
        };
        let live = "[tracker]\ntransport = \"tcp\"\nprotocol = \"ascii-line\"\naddress = \"h:1\"\n";
        assert_eq!(said(live).len(), 2);
        let mounted = "[calibration]\nsensor_from_probe_mm = [0, 0, 90]\n";
        let found = said(&format!("{live}{mounted}"));
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].what.starts_with("nothing says where the tracker is"), "{found:?}");
        assert_eq!(said("[tracker]\ntransport = \"mock\"\n"), []);
        assert_eq!(said("[tracker]\ntransport = \"recording\"\nrecording = \"a.mcap\"\n"), []);
        // A recording that is still to be written has no findings: `record` may be its first step.
        assert_eq!(said(&format!("{live}[calibration]\npath = \"none.toml\"\n")), []);
    }

    #[test]
    fn numbers_of_sensors_that_may_be_heard_are_no_finding() {
        let dir = tempfile::tempdir().unwrap();
        for (protocol, sensor) in [("ascii-line", 0), ("ascii-line", 2), ("fastrak-ascii", 2), ("liberty", 3)] {
            let tracker = format!("[tracker]\ntransport = \"tcp\"\nprotocol = \"{protocol}\"\naddress = \"h:1\"\n");
            let all = found(dir.path(), &format!("{tracker}sensor = {sensor}\n"), None);
            assert!(!all.iter().any(|f| f.what.contains("tracker.sensor")), "{protocol}: {all:#?}");
        }
        let played = "[tracker]\ntransport = \"recording\"\nrecording = \"a.mcap\"\nsensor = 2\n";
        assert!(!found(dir.path(), played, None).iter().any(|f| f.what.contains("tracker.sensor")));
    }

    #[test]
    fn a_complete_station_has_no_finding() {
        let dir = tempfile::tempdir().unwrap();
        let pose = |x: f64, turn: f64| Pose { position_mm: DVec3::X * x, orientation: DQuat::from_rotation_z(turn) };
        let right = Calibration {
            scene_from_tracker: Some(Fitted { value: pose(400.0, 1.0), rms_mm: Some(1.2) }),
            sensor_from_probe: Some(Fitted { value: pose(90.0, 0.5), rms_mm: Some(0.4) }),
            ..Calibration::default()
        };
        std::fs::write(dir.path().join("c.toml"), right.to_toml()).unwrap();
        let port = "[tracker]\ntransport = \"serial\"\nprotocol = \"liberty\"\nport = \"/dev/null\"\n[calibration]\npath = \"c.toml\"\n";
        assert_eq!(found(dir.path(), port, None), []);
        assert_eq!(found(dir.path(), "[tracker]\ntransport = \"mock\"\n", None), []);
    }
}
