//! Emulated Polhemus tracker. It obeys commands as the manual says, in the configured units, format and output list,
//! and ignores them during a reset.
//!
//! It does no input or output and reads no clock, so it can be used on pseudo-terminals and in simulated time.

use std::time::Duration;

/// Device model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// FASTRAK.
    Fastrak,
    /// LIBERTY.
    Liberty,
}

/// Settings of a device, with their power-on values.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    pub binary: bool,
    pub centimetres: bool,
    pub streaming: bool,
    pub list: Vec<u8>,
    pub hemisphere: Option<String>,
    pub station_on: bool,
}

/// A simulated device with one sensor at station 1, and with a second one at station 2 of a LIBERTY if wanted.
#[derive(Debug)]
pub struct Polhemus {
    pub kind: Kind,
    /// Number of sensors.
    pub stations: u8,
    pub state: State,
    /// Duration of a reset.
    pub reset_time: Duration,
    /// Time at which the present reset ends.
    resetting: Option<Duration>,
    /// Whether the device hangs: it does nothing until it is reset.
    pub hung: bool,
    /// Number of resets.
    pub resets: u32,
    /// Commands that the device did not understand.
    pub refused: Vec<String>,
    /// Number of commands lost because they arrived during a reset.
    pub lost: usize,
    /// Bytes of an incomplete command.
    partial: Vec<u8>,
    period: Duration,
    next: Duration,
    /// Number of records sent.
    pub records: u32,
}

impl Polhemus {
    pub fn new(kind: Kind) -> Self {
        let rate = if kind == Kind::Fastrak { 120 } else { 240 };
        Self {
            kind,
            stations: 1,
            state: switched_on(kind),
            reset_time: Duration::from_secs(15),
            resetting: None,
            hung: false,
            resets: 0,
            refused: Vec::new(),
            lost: 0,
            partial: Vec::new(),
            period: Duration::from_secs(1) / rate,
            next: Duration::ZERO,
            records: 0,
        }
    }

    /// Position of the sensor at record `n`, cm.
    pub fn position_cm(n: u32) -> [f32; 3] {
        [10.0 + 0.01 * (n % 1000) as f32, -20.0, 30.0]
    }

    /// Position of the sensor of a station at record `n`, cm.
    pub fn position_of(station: u8, n: u32) -> [f32; 3] {
        let [x, y, z] = Self::position_cm(n);
        [x, y + 40.0 * f32::from(station - 1), z]
    }

    /// Receives bytes from the host.
    pub fn receive(&mut self, now: Duration, bytes: &[u8]) {
        self.pass(now);
        for &byte in bytes {
            if self.resetting.is_some() {
                self.lost += 1;
            } else if byte == 0x19 {
                self.partial.clear();
                // A LIBERTY waits for the carriage return behind it.
                match self.kind {
                    Kind::Fastrak => self.reset(now),
                    Kind::Liberty => self.partial.push(byte),
                }
            } else if self.hung && self.partial != [0x19] {
            } else {
                self.byte(now, byte);
            }
        }
    }

    fn reset(&mut self, now: Duration) {
        self.resets += 1;
        self.hung = false;
        self.partial.clear();
        self.state = switched_on(self.kind);
        self.resetting = Some(now + self.reset_time);
    }

    fn pass(&mut self, now: Duration) {
        if self.resetting.is_some_and(|until| now >= until) {
            self.resetting = None;
        }
    }

    fn byte(&mut self, now: Duration, byte: u8) {
        let alone = match self.kind {
            Kind::Fastrak => b"FfUuCcPS".as_slice(),
            Kind::Liberty => b"P".as_slice(),
        };
        if self.partial.is_empty() && alone.contains(&byte) {
            return self.command(now, &[byte]);
        }
        if byte == b'\r' {
            let command = std::mem::take(&mut self.partial);
            if !command.is_empty() {
                self.command(now, &command);
            }
            return;
        }
        self.partial.push(byte);
    }

    fn command(&mut self, now: Duration, command: &[u8]) {
        let text = String::from_utf8_lossy(command).into_owned();
        let list = |items: &str| items.split(',').filter_map(|item| item.parse().ok()).collect::<Vec<u8>>();
        match (self.kind, text.as_str()) {
            (Kind::Fastrak, "f") | (Kind::Liberty, "F1") => self.state.binary = true,
            (Kind::Fastrak, "F") | (Kind::Liberty, "F0") => self.state.binary = false,
            (Kind::Fastrak, "u") | (Kind::Liberty, "U1") => self.state.centimetres = true,
            (Kind::Fastrak, "U") | (Kind::Liberty, "U0") => self.state.centimetres = false,
            (_, "C") => {
                self.state.streaming = true;
                self.next = now;
            }
            (Kind::Fastrak, "c") | (Kind::Liberty, "P") => self.state.streaming = false,
            (Kind::Fastrak, "l1,1") => self.state.station_on = true,
            (Kind::Liberty, "\u{19}") => self.reset(now),
            (Kind::Fastrak, t) if t.starts_with("H1,") => self.state.hemisphere = Some(t[3..].to_owned()),
            (Kind::Liberty, t) if t.starts_with("H*,") => self.state.hemisphere = Some(t[3..].to_owned()),
            (Kind::Fastrak, t) if t.starts_with("O1,") => self.state.list = list(&t[3..]),
            (Kind::Liberty, t) if t.starts_with("O*,") => self.state.list = list(&t[3..]),
            _ => self.refused.push(text.escape_default().to_string()),
        }
    }

    /// Time of the next record; `None` while the device sends none.
    pub fn next_at(&self) -> Option<Duration> {
        (self.state.streaming && self.resetting.is_none() && !self.hung).then_some(self.next)
    }

    /// The next record, if it is due.
    pub fn next_record(&mut self, now: Duration) -> Option<Vec<u8>> {
        self.pass(now);
        let at = self.next_at().filter(|at| *at <= now)?;
        self.next = at + self.period;
        self.records += 1;
        Some((1..=self.stations).flat_map(|station| self.record(station, self.records - 1, at)).collect())
    }

    /// Bytes of record `n` of a station with the present settings.
    fn record(&self, station: u8, n: u32, at: Duration) -> Vec<u8> {
        let scale = if self.state.centimetres { 1.0 } else { 1.0 / 2.54 };
        let position = Self::position_of(station, n).map(|cm| cm * scale);
        let mut payload = Vec::new();
        let floats = |payload: &mut Vec<u8>, values: &[f32]| {
            for value in values {
                if self.state.binary {
                    payload.extend(value.to_le_bytes());
                } else {
                    payload.extend(format!("{value:7.2}").bytes());
                }
            }
        };
        for item in &self.state.list {
            match item {
                0 | 50 => payload.push(b' '),
                1 | 51 => payload.extend(b"\r\n"),
                2 | 3 => floats(&mut payload, &position),
                4 => floats(&mut payload, &[90.0, 0.0, 0.0]),
                7 | 11 if *item == 7 || self.kind == Kind::Fastrak => {
                    let half = std::f32::consts::FRAC_1_SQRT_2;
                    floats(&mut payload, &[half, 0.0, 0.0, half]);
                }
                8 => payload.extend((at.as_millis() as u32).to_le_bytes()),
                9 => payload.extend(n.to_le_bytes()),
                11 => payload.extend(0_i32.to_le_bytes()),
                other => panic!("the emulator has no item {other}"),
            }
        }
        let mut record = match self.kind {
            Kind::Fastrak => vec![b'0', b'0' + station, b' '],
            Kind::Liberty if self.state.binary => {
                let mut head = vec![b'L', b'Y', station, b'C', 0, 0];
                head.extend((payload.len() as u16).to_le_bytes());
                head
            }
            Kind::Liberty => b"01 ".to_vec(),
        };
        record.append(&mut payload);
        record
    }
}

fn switched_on(kind: Kind) -> State {
    State {
        binary: false,
        centimetres: false,
        streaming: false,
        list: vec![2, 4, 1],
        hemisphere: None,
        station_on: kind == Kind::Liberty,
    }
}
