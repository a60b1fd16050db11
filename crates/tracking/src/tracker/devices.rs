//! Serial ports and HID devices of this machine.

use std::fmt;
use std::io;
use std::path::Path;

use serde::Serialize;

use super::settings::{PortName, Settings, Transport};
use super::spacemouse;

/// Identity reported by a USB device.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct UsbIdentity {
    /// Vendor id.
    pub vendor: u16,
    /// Product id.
    pub product: u16,
    /// Serial number, if the device reports one.
    pub serial: Option<String>,
    /// Vendor and product names, if the device reports them.
    pub name: Option<String>,
}

impl UsbIdentity {
    /// Id as written in station files: `vendor:product:serial`.
    pub fn id(&self) -> String {
        let ids = format!("{:04x}:{:04x}", self.vendor, self.product);
        self.serial.as_ref().map_or_else(|| ids.clone(), |serial| format!("{ids}:{serial}"))
    }
}

/// A serial port.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct SerialDevice {
    /// Path, which may change when the device is plugged in again.
    pub path: String,
    /// Stable path by id (Linux), if there is one.
    pub by_id: Option<String>,
    /// USB identity, if it is a USB adapter.
    pub usb: Option<UsbIdentity>,
    /// FTDI latency timer, ms: longest time for which the adapter buffers bytes. `None` for other adapters, and outside
    /// Linux.
    pub latency_timer_ms: Option<u32>,
}

impl SerialDevice {
    /// Whether `name` identifies this port: by its path, its stable path, or its USB identity.
    pub fn is(&self, name: &PortName) -> bool {
        match name {
            PortName::Path(path) => self.path == *path || self.by_id.as_deref() == Some(path.as_str()),
            usb => self.usb.as_ref().is_some_and(|own| usb.is(own.vendor, own.product, own.serial.as_deref())),
        }
    }
}

/// A HID device.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct HidDevice {
    /// Path.
    pub path: String,
    /// USB identity.
    pub usb: UsbIdentity,
    /// Whether it is a supported SpaceMouse puck.
    pub space_mouse: bool,
}

/// All serial ports and HID devices.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Devices {
    /// Serial ports; empty without the feature `serial`.
    pub serial: Vec<SerialDevice>,
    /// HID devices; empty without the feature `hid`.
    pub hid: Vec<HidDevice>,
}

impl Devices {
    /// The devices of this machine.
    ///
    /// # Errors
    /// The system cannot list the devices.
    pub fn list() -> io::Result<Self> {
        Ok(Self {
            #[cfg(feature = "serial")]
            serial: serial_ports()?,
            #[cfg(not(feature = "serial"))]
            serial: Vec::new(),
            #[cfg(feature = "hid")]
            hid: hid_devices()?,
            #[cfg(not(feature = "hid"))]
            hid: Vec::new(),
        })
    }
}

impl fmt::Display for Devices {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.serial.is_empty() {
            writeln!(f, "no serial ports")?;
        }
        for port in &self.serial {
            let usb = port.usb.as_ref();
            let name = usb.and_then(|usb| usb.name.as_deref()).unwrap_or("");
            writeln!(f, "serial  {:<16} {} {name}", port.path, usb.map(UsbIdentity::id).unwrap_or_default())?;
            for further in port.by_id.iter().chain(&latency_hint(port)) {
                writeln!(f, "        {further}")?;
            }
        }
        if self.hid.is_empty() {
            writeln!(f, "no HID devices")?;
        }
        for HidDevice { path, usb, space_mouse } in &self.hid {
            let puck = if *space_mouse { " (a SpaceMouse)" } else { "" };
            let name = usb.name.as_deref().unwrap_or("");
            writeln!(f, "hid     {path:<16} {} {name}{puck}", usb.id())?;
        }
        Ok(())
    }
}

/// Whether a HID device is a SpaceMouse puck.
pub fn is_space_mouse(vendor: u16, product: u16, usage_page: u16, usage: u16) -> bool {
    spacemouse::VENDORS.contains(&vendor)
        && (usage_page, usage) == spacemouse::USAGE
        && !(vendor == 0x256f && spacemouse::NOT_A_PUCK.contains(&product))
}

/// All serial ports, sorted by path.
///
/// # Errors
/// The system cannot list the ports.
#[cfg(feature = "serial")]
pub(crate) fn serial_ports() -> io::Result<Vec<SerialDevice>> {
    use tokio_serial::SerialPortType;

    // Some containers have no sysfs, and so no ports.
    if cfg!(target_os = "linux") && !Path::new("/sys/class/tty").is_dir() {
        return Ok(Vec::new());
    }
    let ports = tokio_serial::available_ports().map_err(io::Error::from)?;
    let mut found: Vec<_> = ports
        .into_iter()
        .map(|port| SerialDevice {
            by_id: by_id(&port.port_name),
            latency_timer_ms: latency_timer_ms(&port.port_name),
            usb: match port.port_type {
                SerialPortType::UsbPort(usb) => Some(UsbIdentity {
                    vendor: usb.vid,
                    product: usb.pid,
                    serial: usb.serial_number,
                    name: joined(usb.manufacturer.as_deref(), usb.product.as_deref()),
                }),
                _ => None,
            },
            path: port.port_name,
        })
        .collect();
    found.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(found)
}

/// Hint of [`latency_hint`] for the serial port of a tracker; `None` if it has no serial port on this machine.
pub fn hint_of(tracker: &Settings) -> Option<String> {
    let Transport::Serial { port, .. } = &tracker.transport else { return None };
    Devices::list().ok()?.serial.iter().find(|device| device.is(port)).and_then(latency_hint)
}

/// Current path of a port.
#[cfg(feature = "serial")]
pub(super) fn serial_path(name: &PortName) -> io::Result<String> {
    if let PortName::Path(path) = name {
        return Ok(path.clone());
    }
    let port = serial_ports()?.into_iter().find(|port| port.is(name));
    port.map(|port| port.path).ok_or_else(|| missing("serial port", name))
}

#[cfg(any(feature = "serial", feature = "hid"))]
fn missing(kind: &str, name: &PortName) -> io::Error {
    io::Error::new(io::ErrorKind::NotFound, format!("no {kind} is {name}; `insonify trackers` lists those there are"))
}

#[cfg(any(feature = "serial", feature = "hid"))]
fn joined(vendor: Option<&str>, product: Option<&str>) -> Option<String> {
    let words: Vec<_> = [vendor, product].into_iter().flatten().map(str::trim).filter(|w| !w.is_empty()).collect();
    (!words.is_empty()).then(|| words.join(" "))
}

/// Link in `/dev/serial/by-id` that points to `path`, if there is one.
#[cfg(feature = "serial")]
fn by_id(path: &str) -> Option<String> {
    let target = std::fs::canonicalize(path).ok()?;
    let links = std::fs::read_dir("/dev/serial/by-id").ok()?;
    let mut links = links.flatten().map(|link| link.path());
    links.find(|link| std::fs::canonicalize(link).is_ok_and(|t| t == target)).map(|link| link.display().to_string())
}

/// Latency timer of an FTDI adapter, ms; `None` for other adapters.
#[cfg(feature = "serial")]
fn latency_timer_ms(path: &str) -> Option<u32> {
    let name = Path::new(path).file_name()?;
    let file = Path::new("/sys/bus/usb-serial/devices").join(name).join("latency_timer");
    std::fs::read_to_string(file).ok()?.trim().parse().ok()
}

/// Advice for an adapter that buffers bytes for more than 1 ms; `None` if it doesn't.
pub fn latency_hint(port: &SerialDevice) -> Option<String> {
    let timer = port.latency_timer_ms.filter(|ms| *ms > 1)?;
    let name = Path::new(&port.path).file_name()?.to_string_lossy().into_owned();
    Some(format!(
        "{} holds bytes back for up to {timer} ms (FTDI latency timer). Set it to 1 ms: \
         echo 1 | sudo tee /sys/bus/usb-serial/devices/{name}/latency_timer",
        port.path
    ))
}

/// All HID devices, sorted by path.
///
/// # Errors
/// The system cannot list the devices.
#[cfg(feature = "hid")]
pub(crate) fn hid_devices() -> io::Result<Vec<HidDevice>> {
    Ok(listed(&hidapi::HidApi::new().map_err(io::Error::other)?))
}

#[cfg(feature = "hid")]
fn listed(api: &hidapi::HidApi) -> Vec<HidDevice> {
    let mut found: Vec<HidDevice> = Vec::new();
    for device in api.device_list() {
        let path = device.path().to_string_lossy().into_owned();
        let puck = is_space_mouse(device.vendor_id(), device.product_id(), device.usage_page(), device.usage());
        // A device is listed once per usage.
        if let Some(known) = found.iter_mut().find(|known| known.path == path) {
            known.space_mouse |= puck;
            continue;
        }
        let usb = UsbIdentity {
            vendor: device.vendor_id(),
            product: device.product_id(),
            serial: device.serial_number().filter(|serial| !serial.is_empty()).map(str::to_owned),
            name: joined(device.manufacturer_string(), device.product_string()),
        };
        found.push(HidDevice { path, usb, space_mouse: puck });
    }
    found.sort_by(|a, b| a.path.cmp(&b.path));
    found
}

/// Opens a HID device (the first SpaceMouse if `name` is `None`) and returns it with its description.
#[cfg(feature = "hid")]
pub(super) fn open_hid(name: Option<&PortName>) -> io::Result<(hidapi::HidDevice, String)> {
    let wanted = |device: &HidDevice| match name {
        None => device.space_mouse,
        Some(PortName::Path(path)) => device.path == *path,
        Some(usb) => usb.is(device.usb.vendor, device.usb.product, device.usb.serial.as_deref()),
    };
    let none = || match name {
        None => io::Error::new(io::ErrorKind::NotFound, "no SpaceMouse is plugged in"),
        Some(name) => missing("HID device", name),
    };
    let api = hidapi::HidApi::new().map_err(io::Error::other)?;
    let device = listed(&api).into_iter().find(wanted).ok_or_else(none)?;
    let path = std::ffi::CString::new(device.path.clone()).map_err(io::Error::other)?;
    let hint = if cfg!(target_os = "linux") { "; a udev rule must let users read it" } else { "" };
    let opened = api.open_path(&path).map_err(|error| {
        io::Error::other(format!("cannot open {} ({}): {error}{hint}", device.path, device.usb.id()))
    })?;
    Ok((opened, device.usb.name.map_or(device.path.clone(), |name| format!("{name} at {}", device.path))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pucks_are_distinguished_from_their_receivers_and_keyboards() {
        assert!(is_space_mouse(0x256f, 0xc635, 1, 8));
        assert!(is_space_mouse(0x046d, 0xc626, 1, 8));
        assert!(!is_space_mouse(0x256f, 0xc635, 1, 6), "its keyboard");
        assert!(!is_space_mouse(0x256f, 0xc650, 1, 8));
        assert!(!is_space_mouse(0x1234, 0xc635, 1, 8));
    }

    #[test]
    fn a_port_is_found_by_either_path_and_by_its_identity() {
        let usb = UsbIdentity { vendor: 0x403, product: 0x6001, serial: Some("A5".into()), name: None };
        let by_id = Some("/dev/serial/by-id/usb-FTDI-port0".to_owned());
        let port = SerialDevice { path: "/dev/ttyUSB0".into(), by_id, usb: Some(usb), latency_timer_ms: None };
        for right in ["/dev/ttyUSB0", "/dev/serial/by-id/usb-FTDI-port0", "0403:6001", "0403:6001:A5"] {
            assert!(port.is(&right.parse::<PortName>().unwrap()), "{right}");
        }
        for wrong in ["/dev/ttyUSB1", "0403:6002", "0403:6001:A6"] {
            assert!(!port.is(&wrong.parse::<PortName>().unwrap()), "{wrong}");
        }
    }

    #[test]
    fn a_slow_latency_timer_gives_a_hint() {
        let mut port = SerialDevice { path: "/dev/ttyUSB3".into(), by_id: None, usb: None, latency_timer_ms: Some(16) };
        let hint = latency_hint(&port).unwrap();
        assert!(hint.contains("16 ms") && hint.contains("devices/ttyUSB3/latency_timer"), "{hint}");
        for fine in [None, Some(1)] {
            port.latency_timer_ms = fine;
            assert_eq!(latency_hint(&port), None);
        }
    }
}
