//! Emulated NDI device: the device's side of the Combined API, as strict as a real one.

use std::fmt::Write;

use glam::{DQuat, DVec3};

pub(crate) const POWER_ON_BAUD: u32 = 9600;
const BAUDS: [u32; 8] = [9600, 14_400, 19_200, 38_400, 57_600, 115_200, 921_600, 1_228_739];

/// CRC-16/ARC, computed bit by bit, independently of the code under test.
pub(crate) fn crc(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0, |crc, &byte| {
        (0..8).fold(crc ^ u16::from(byte), |crc, _| if crc & 1 == 1 { (crc >> 1) ^ 0xA001 } else { crc >> 1 })
    })
}

pub(crate) fn framed(text: &str) -> Vec<u8> {
    format!("{text}{:04X}\r", crc(text.as_bytes())).into_bytes()
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Mode {
    PoweredOn,
    SetUp,
    Tracking,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Port {
    Stale,
    Occupied,
    Initialised,
    Enabled,
    Disabled,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Tool {
    pub(crate) handle: u8,
    pub(crate) port: Port,
    pub(crate) in_view: bool,
    /// Whether the tool's initialisation fails.
    pub(crate) broken: bool,
    /// Bytes that the host has written to a wireless tool; `None` for a wired one.
    pub(crate) rom: Option<Vec<Option<u8>>>,
    pub(crate) switches: u8,
}

impl Tool {
    pub(crate) fn wired(handle: u8) -> Self {
        Self { handle, port: Port::Occupied, in_view: true, broken: false, rom: None, switches: 0 }
    }
}

/// Pose of the tool `handle` at `frame`, exactly representable in both reply formats.
pub(crate) fn pose(handle: u8, frame: u32) -> (DQuat, DVec3) {
    let q = [DQuat::from_xyzw(0.5, -0.5, 0.5, 0.5), DQuat::from_xyzw(0.6, 0.0, 0.0, 0.8)][usize::from(handle % 2)];
    (q, DVec3::new(f64::from(frame % 1000) * 0.25, -f64::from(handle) * 0.5, -1200.25))
}

pub(crate) struct Device {
    mode: Mode,
    pub(crate) tools: Vec<Tool>,
    /// Number of the device's measurement frame, 0 after a reset.
    pub(crate) frame: u32,
    pub(crate) baud: u32,
    pub(crate) line_baud: u32,
    pub(crate) system_status: u16,
    /// Whether the device refuses `TSTART:80`, as older ones do.
    pub(crate) is_old: bool,
    /// Whether the device is switched off.
    pub(crate) is_off: bool,
    /// Commands that the device accepted or refused, without long arguments.
    pub(crate) log: Vec<String>,
    input: Vec<u8>,
    output: Vec<u8>,
}

impl Device {
    pub(crate) fn new(handles: &[u8]) -> Self {
        Self {
            mode: Mode::PoweredOn,
            tools: handles.iter().map(|&handle| Tool::wired(handle)).collect(),
            frame: 0,
            baud: POWER_ON_BAUD,
            line_baud: POWER_ON_BAUD,
            system_status: 0,
            is_old: false,
            is_off: false,
            log: Vec::new(),
            input: Vec::new(),
            output: Vec::new(),
        }
    }

    /// A device that still tracks, as an earlier session left it when it was killed.
    pub(crate) fn left_tracking(handles: &[u8], baud: u32) -> Self {
        let mut device = Self::new(handles);
        device.mode = Mode::Tracking;
        device.baud = baud;
        device.tools.iter_mut().for_each(|tool| tool.port = Port::Enabled);
        device
    }

    pub(crate) fn is_tracking(&self) -> bool {
        self.mode == Mode::Tracking
    }

    /// Resets the device, as by a break or the power switch; `says_so` makes it report the reset.
    pub(crate) fn reset(&mut self, says_so: bool) {
        self.mode = Mode::PoweredOn;
        self.baud = POWER_ON_BAUD;
        self.frame = 0;
        self.input.clear();
        self.output.clear();
        self.tools.retain(|tool| tool.rom.is_none());
        self.tools.iter_mut().for_each(|tool| tool.port = Port::Occupied);
        if says_so && self.line_baud == self.baud {
            self.output.extend(framed("RESET"));
        }
    }

    pub(crate) fn take_output(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.output)
    }

    pub(crate) fn receive(&mut self, bytes: &[u8]) {
        // At the wrong speed it receives noise.
        if self.is_off || self.line_baud != self.baud {
            return;
        }
        self.input.extend(bytes);
        while let Some(end) = self.input.iter().position(|&b| b == b'\r') {
            let line: Vec<u8> = self.input.drain(..=end).collect();
            self.command(&line[..end]);
        }
    }

    fn command(&mut self, line: &[u8]) {
        let Some(text) = line.len().checked_sub(4).map(|at| &line[..at]) else { return self.reply("ERROR03") };
        if format!("{:04X}", crc(text)).as_bytes() != &line[text.len()..] {
            self.log.push("bad CRC".into());
            return self.reply("ERROR04");
        }
        let text = String::from_utf8(text.to_vec()).unwrap();
        self.log.push(text.chars().take(24).collect());
        let (name, arguments) = text.split_once(':').unwrap_or((&text, ""));
        match self.carry_out(name, arguments) {
            Ok(Some(reply)) => self.reply(&reply),
            Ok(None) => {}
            Err(code) => self.reply(&format!("ERROR{code:02X}")),
        }
    }

    fn reply(&mut self, text: &str) {
        self.output.extend(framed(text));
    }

    fn tool(&mut self, arguments: &str) -> Result<&mut Tool, u8> {
        let handle = arguments.get(..2).and_then(|text| u8::from_str_radix(text, 16).ok()).ok_or(0x07)?;
        self.tools.iter_mut().find(|tool| tool.handle == handle).ok_or(0x08)
    }

    fn carry_out(&mut self, name: &str, arguments: &str) -> Result<Option<String>, u8> {
        let okay = Ok(Some("OKAY".to_owned()));
        match (name, self.mode) {
            ("RESET", _) => {
                self.reset(true);
                return Ok(None);
            }
            ("INIT", Mode::Tracking) => return Err(0x0C),
            ("INIT", _) => {
                self.mode = Mode::SetUp;
                for tool in &mut self.tools {
                    // Handles of an earlier session are unused.
                    tool.port = if tool.port == Port::Occupied { Port::Occupied } else { Port::Stale };
                }
                return okay;
            }
            ("COMM", Mode::PoweredOn | Mode::SetUp) => {
                let index = arguments.get(..1).and_then(|digit| digit.parse::<usize>().ok()).ok_or(0x07)?;
                if arguments.len() != 5 || &arguments[1..] != "0000" {
                    return Err(0x07);
                }
                let baud = *BAUDS.get(index).ok_or(0x06)?;
                self.reply("OKAY");
                self.baud = baud;
                return Ok(None);
            }
            (_, Mode::PoweredOn) => return Err(0x10),
            _ => {}
        }
        match (name, self.mode) {
            ("PHSR", Mode::SetUp) => {
                let wanted: fn(Port) -> bool = match arguments {
                    "01" => |port| port == Port::Stale,
                    "02" => |port| port == Port::Occupied,
                    "03" => |port| port == Port::Initialised,
                    _ => return Err(0x07),
                };
                let handles: Vec<u8> =
                    self.tools.iter().filter(|tool| wanted(tool.port)).map(|tool| tool.handle).collect();
                let mut text = format!("{:02X}", handles.len());
                handles.iter().for_each(|handle| write!(text, "{handle:02X}001").unwrap());
                Ok(Some(text))
            }
            ("PHF", Mode::SetUp) => {
                let tool = self.tool(arguments)?;
                tool.port = Port::Occupied;
                let (handle, is_wireless) = (tool.handle, tool.rom.is_some());
                if is_wireless {
                    self.tools.retain(|tool| tool.handle != handle);
                }
                okay
            }
            ("PHRQ", Mode::SetUp) if arguments == "*********1****" => {
                let handle = self.tools.iter().map(|tool| tool.handle).max().unwrap_or(0) + 1;
                self.tools.push(Tool { rom: Some(vec![None; 1024]), ..Tool::wired(handle) });
                Ok(Some(format!("{handle:02X}")))
            }
            ("PVWR", Mode::SetUp) => {
                let tool = self.tool(arguments)?;
                let rom = tool.rom.as_mut().ok_or(0x08)?;
                let address = usize::from_str_radix(arguments.get(2..6).ok_or(0x03)?, 16).map_err(|_| 0x07)?;
                let data = arguments.get(6..).unwrap_or("");
                if data.len() != 128 || !address.is_multiple_of(64) || address >= 1024 {
                    return Err(0x07);
                }
                for i in 0..64 {
                    rom[address + i] = Some(u8::from_str_radix(&data[2 * i..2 * i + 2], 16).map_err(|_| 0x07)?);
                }
                okay
            }
            ("PINIT", Mode::SetUp) => {
                let tool = self.tool(arguments)?;
                let is_described = tool.rom.as_ref().is_none_or(|rom| rom.iter().all(Option::is_some));
                if tool.broken || !is_described || tool.port != Port::Occupied {
                    return Err(0x13);
                }
                tool.port = Port::Initialised;
                okay
            }
            ("PENA", Mode::SetUp) => {
                let tool = self.tool(arguments)?;
                if arguments.len() != 3 || !arguments.ends_with('D') {
                    return Err(0x07);
                }
                if tool.port != Port::Initialised {
                    return Err(0x0E);
                }
                tool.port = Port::Enabled;
                okay
            }
            ("TSTART", Mode::SetUp) if arguments == "80" && !self.is_old => {
                (self.mode, self.frame) = (Mode::Tracking, 0);
                okay
            }
            ("TSTART", Mode::SetUp) if arguments.is_empty() => {
                self.mode = Mode::Tracking;
                okay
            }
            ("TSTART", Mode::SetUp) => Err(0x07),
            ("TSTOP", Mode::Tracking) => {
                self.mode = Mode::SetUp;
                okay
            }
            ("TX", Mode::Tracking) if matches!(arguments, "0001" | "0801") => {
                self.frame += 1;
                Ok(Some(text_reply(self.frame, &self.tools, self.system_status)))
            }
            ("BX", Mode::Tracking) if matches!(arguments, "0001" | "0801") => {
                self.frame += 1;
                self.output.extend(binary_reply(self.frame, &self.tools, self.system_status));
                Ok(None)
            }
            ("PHSR" | "PHF" | "PHRQ" | "PVWR" | "PINIT" | "PENA" | "TSTART" | "TSTOP" | "TX" | "BX" | "COMM", _) => {
                Err(0x0C)
            }
            _ => Err(0x01),
        }
    }
}

fn reported(tools: &[Tool]) -> Vec<&Tool> {
    tools.iter().filter(|tool| matches!(tool.port, Port::Enabled | Port::Disabled)).collect()
}

fn port_status(tool: &Tool) -> u32 {
    0x31 | (u32::from(tool.switches) << 1)
}

/// A complete `BX` reply.
pub(crate) fn binary_reply(frame: u32, tools: &[Tool], system_status: u16) -> Vec<u8> {
    let tools = reported(tools);
    let mut data = vec![tools.len() as u8];
    for tool in tools {
        data.push(tool.handle);
        if tool.port == Port::Disabled {
            data.push(4);
            continue;
        }
        data.push(if tool.in_view { 1 } else { 2 });
        if tool.in_view {
            let (q, p) = pose(tool.handle, frame);
            for value in [q.w, q.x, q.y, q.z, p.x, p.y, p.z, 0.01] {
                data.extend((value as f32).to_le_bytes());
            }
        }
        data.extend(port_status(tool).to_le_bytes());
        data.extend(frame.to_le_bytes());
    }
    data.extend(system_status.to_le_bytes());
    let mut reply = vec![0xC4, 0xA5];
    reply.extend((data.len() as u16).to_le_bytes());
    let head = crc(&reply);
    reply.extend(head.to_le_bytes());
    let body = crc(&data);
    reply.extend(data);
    reply.extend(body.to_le_bytes());
    reply
}

/// A `TX` reply without its checksum.
pub(crate) fn text_reply(frame: u32, tools: &[Tool], system_status: u16) -> String {
    let tools = reported(tools);
    let mut text = format!("{:02X}", tools.len());
    for tool in tools {
        write!(text, "{:02X}", tool.handle).unwrap();
        if tool.port == Port::Disabled {
            text.push_str("DISABLED\n");
            continue;
        }
        if tool.in_view {
            let (q, p) = pose(tool.handle, frame);
            for value in [q.w, q.x, q.y, q.z] {
                write!(text, "{:+06}", (value * 1e4).round() as i32).unwrap();
            }
            for value in p.to_array() {
                write!(text, "{:+07}", (value * 100.0).round() as i32).unwrap();
            }
            text.push_str("+00100");
        } else {
            text.push_str("MISSING");
        }
        writeln!(text, "{:08X}{frame:08X}", port_status(tool)).unwrap();
    }
    write!(text, "{system_status:04X}").unwrap();
    text
}

#[test]
fn the_emulator_is_strict() {
    let mut device = Device::new(&[1]);
    let mut ask = |bytes: &[u8]| {
        device.receive(bytes);
        String::from_utf8(device.take_output()).unwrap()
    };
    let error = |code: &str| String::from_utf8(framed(&format!("ERROR{code}"))).unwrap();
    assert_eq!(ask(b"INIT:E3A6\r"), error("04"));
    assert_eq!(ask(&framed("PHSR:01")), error("10"));
    assert_eq!(ask(b"INIT:E3A5\r"), "OKAYA896\r");
    assert_eq!(ask(&framed("BX:0801")), error("0C"));
    assert_eq!(ask(&framed("PENA:01D")), error("0E"));
    assert_eq!(ask(&framed("PINIT:09")), error("08"));
    assert_eq!(ask(&framed("NONSENSE:")), error("01"));
    assert_eq!(ask(&framed("TSTOP:")), error("0C"));
}
