//! NDI Polaris, Vega and Aurora: the Combined API, over a serial line or TCP (port 8765).
//!
//! The host sends commands, and the device answers. A command is `CMD:arguments`, a CRC of four upper-case hexadecimal
//! digits and a carriage return. An answer is text with the same ending; the answer to `BX` is a binary frame with two
//! checksums. Both kinds of tracking replies, `TX` (text) and `BX`, are decoded with the reply options `0001` and
//! `0800`: transforms, including transforms outside the measurement volume.
//!
//! A record's `sensor` is the device's port handle, its `sequence` the device's frame number, and its `buttons` the
//! tool's switches. A tool that is reported missing gives
//! [`Reading::OutOfView`](insonify_core::pose::Reading::OutOfView); a disabled or unplugged tool gives no record.
//! Requests may be faster than measurements: a reply that repeats the previous frame gives no record.
//!
//! Sources: `ndicapi` (PlusToolkit), PLUS `vtkPlusNDITracker.cxx`, VRPN.

use std::path::PathBuf;

use bytes::{BufMut, Bytes, BytesMut};
use crc::{CRC_16_ARC, Crc, Table};
use thiserror::Error;

use insonify_core::files::{self, FileError, FileKind};
use insonify_core::pose::PoseError;

mod bring_up;
mod decoder;
mod driver;
mod frame;
mod reply;

pub use decoder::Decoder;
pub use driver::NdiDriver;

pub use insonify_core::settings::ReplyFormat;

/// Speed of a serial device after power-on or reset, baud.
pub(crate) const START_BAUD: u32 = 9600;

/// Default speed to which a serial device is switched, baud.
pub const USUAL_BAUD: u32 = 115_200;

/// Number of bytes of a tool's description (its ROM).
pub const ROM_BYTES: usize = 1024;

/// Longest text reply, bytes: a `TX` reply of 255 tools.
pub(crate) const TEXT_LIMIT: usize = 2 + 255 * 70 + 9;

const CRC16: Crc<u16, Table<1>> = Crc::<u16, Table<1>>::new(&CRC_16_ARC);

/// Baud rates of `COMM`, in the order of its first digit.
pub const BAUD_RATES: [u32; 8] = [9600, 14_400, 19_200, 38_400, 57_600, 115_200, 921_600, 1_228_739];

/// Checksum of the Combined API: CRC-16/ARC.
pub fn crc16(bytes: &[u8]) -> u16 {
    CRC16.checksum(bytes)
}

/// A command or reply as transmitted: `text`, its checksum and a carriage return.
pub fn framed(text: &str) -> Bytes {
    let mut bytes = BytesMut::with_capacity(text.len() + 5);
    bytes.put_slice(text.as_bytes());
    bytes.put_slice(format!("{:04X}\r", crc16(text.as_bytes())).as_bytes());
    bytes.freeze()
}

/// Settings of a device.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Requested reply format.
    pub format: ReplyFormat,
    /// Whether to accept poses outside the characterised volume; otherwise the tool counts as out of view there.
    pub out_of_volume: bool,
    /// Speed to switch a serial line to, one of [`BAUD_RATES`]; `None` without a serial line.
    pub baud: Option<u32>,
    /// Descriptions of wireless tools, [`ROM_BYTES`] each; handles are requested in this order. See [`pad_rom`].
    pub roms: Vec<Vec<u8>>,
    /// Files (.rom) that [`load_roms`](Self::load_roms) appends to `roms`.
    pub rom_files: Vec<PathBuf>,
    /// Shortest interval between requests for poses.
    pub poll_interval: std::time::Duration,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            format: ReplyFormat::Binary,
            out_of_volume: insonify_core::settings::TrackerSettings::default().ndi_out_of_volume,
            baud: None,
            roms: Vec::new(),
            rom_files: Vec::new(),
            poll_interval: std::time::Duration::from_millis(8),
        }
    }
}

impl Options {
    /// Validates the options.
    ///
    /// # Errors
    /// The device does not support the speed, or a tool description has the wrong length.
    pub fn validate(&self) -> Result<(), OptionsError> {
        if let Some(baud) = self.baud.filter(|baud| !BAUD_RATES.contains(baud)) {
            return Err(OptionsError::Baud { baud });
        }
        match self.roms.iter().find(|rom| rom.len() != ROM_BYTES) {
            Some(rom) => Err(OptionsError::RomLength { length: rom.len() }),
            None => Ok(()),
        }
    }

    /// Reads the files of wireless tools into `roms` and empties `rom_files`.
    ///
    /// # Errors
    /// A file cannot be read, or is not a tool description.
    pub fn load_roms(mut self) -> Result<Self, RomError> {
        for path in std::mem::take(&mut self.rom_files) {
            let content = files::read(&path, FileKind::ToolDescription)
                .map_err(FileError::at("read the tool description", &path))?;
            self.roms.push(pad_rom(content).map_err(|source| RomError::Content { path, source })?);
        }
        Ok(self)
    }
}

/// Errors in the description file of a wireless tool.
#[derive(Debug, Error)]
pub enum RomError {
    /// The file could not be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// Not a tool description.
    #[error("{path}: {source}")]
    Content {
        /// File.
        path: PathBuf,
        /// Fault of its content.
        source: OptionsError,
    },
}

/// Invalid options of a device.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
pub enum OptionsError {
    /// Unsupported speed.
    #[error("an NDI device has no speed of {baud} baud; it must be one of {BAUD_RATES:?}")]
    Baud {
        /// Requested speed.
        baud: u32,
    },
    /// A file that is not a tool description.
    #[error("a tool description has 1 to {ROM_BYTES} bytes; this one has {length}")]
    RomLength {
        /// Length of the file, bytes.
        length: usize,
    },
}

/// Content of a `.rom` file padded with zeros to full length, as NDI's own programs do.
///
/// # Errors
/// The file is empty or longer than [`ROM_BYTES`].
pub fn pad_rom(mut rom: Vec<u8>) -> Result<Vec<u8>, OptionsError> {
    if rom.is_empty() || rom.len() > ROM_BYTES {
        return Err(OptionsError::RomLength { length: rom.len() });
    }
    rom.resize(ROM_BYTES, 0);
    Ok(rom)
}

/// Fault of a reply or of the device.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum Reason {
    /// Bytes that start neither a binary reply nor a text reply.
    #[error("no reply starts with 0x{byte:02X}; one starts with text or with C4 A5 and a checked length")]
    Noise {
        /// Byte found.
        byte: u8,
    },
    /// A wrong checksum.
    #[error("a reply has the checksum {found:04X}, but its bytes give {computed:04X}")]
    Checksum {
        /// Checksum in the reply.
        found: u16,
        /// CRC of the received bytes.
        computed: u16,
    },
    /// Text without a checksum.
    #[error("the reply `{text}` does not end in a checksum of four hexadecimal digits")]
    ChecksumMissing {
        /// Start of the reply, escaped.
        text: String,
    },
    /// No carriage return within the limit.
    #[error("text of more than {TEXT_LIMIT} bytes without a carriage return")]
    TooLong,
    /// A complete reply with an inconsistent layout.
    #[error("a tracking reply is not laid out as reply option 0001 asks: {what}")]
    Layout {
        /// The inconsistent part.
        what: &'static str,
    },
    /// A transform that is not a pose.
    #[error("tool {handle:02X}: {source}")]
    Pose {
        /// Port handle.
        handle: u8,
        /// Fault of the pose.
        source: PoseError,
    },
    /// The device refuses a command.
    #[error("the device answers ERROR{code:02X} to {command}: {}", error_name(*code))]
    Refused {
        /// Error code.
        code: u8,
        /// The command, if known.
        command: String,
    },
    /// No reply within the time limit.
    #[error("no reply to `{command}` within {waited_ms} ms")]
    NoReply {
        /// The command.
        command: String,
        /// Time waited, ms.
        waited_ms: u64,
    },
    /// A reply that doesn't match the command.
    #[error("`{text}` is no reply to `{command}`")]
    Unexpected {
        /// The reply, escaped.
        text: String,
        /// The command.
        command: String,
    },
    /// The device reports that it was reset.
    #[error("the device has started anew; it is set up again")]
    Restarted,
    /// No tool is connected.
    #[error(
        "the device has no tool to track; plug one in, or name the .rom file of a wireless tool in the station file"
    )]
    NoTool,
    /// The stream ended within a reply.
    #[error("the stream ends, or the device was given up, after {length} bytes of a reply")]
    Incomplete {
        /// Number of bytes present.
        length: usize,
    },
}

impl Reason {
    /// Whether a well-formed reply reports an error of the device: the device is connected and responding.
    pub fn is_report(&self) -> bool {
        matches!(self, Self::Refused { .. } | Self::Restarted | Self::NoTool)
    }
}

/// Meaning of an error code of the device (`ndicapi.h`).
fn error_name(code: u8) -> &'static str {
    match code {
        0x01 => "invalid command",
        0x02 => "command too long",
        0x03 => "command too short",
        0x04 => "wrong checksum of the command",
        0x05 => "time ran out while the command was carried out",
        0x06 => "the new communication parameters could not be set",
        0x07 => "wrong number of parameters",
        0x08 => "invalid port handle",
        0x09 => "invalid mode",
        0x0A => "invalid light",
        0x0B => "invalid state of a light",
        0x0C => "the command is not allowed in the device's present mode",
        0x0D => "no tool in the port",
        0x0E => "the port is not initialised",
        0x0F => "the port is not enabled",
        0x10 => "the system is not initialised",
        0x11 => "tracking could not be stopped",
        0x12 => "tracking could not be started",
        0x13 => "the tool in the port could not be initialised",
        0x14 => "invalid camera parameters",
        0x15 => "the system could not be initialised",
        0x16 => "the diagnostic mode could not be started",
        0x17 => "the diagnostic mode could not be stopped",
        0x18 => "infrared light around could not be measured",
        _ => "see the device's manual",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Test vectors from the guide to the interface and from `ndicapi`.
    #[test]
    fn checksums_are_those_of_the_device() {
        let vectors = [
            ("RESET", 0xBE6F),
            ("OKAY", 0xA896),
            ("INIT:", 0xE3A5),
            ("TSTART:", 0x5423),
            ("TX:0001", 0x031A),
            ("BX:0801", 0x00EC),
            ("PHSR:01", 0xE03E),
            ("ERROR01", 0x6BC2),
        ];
        for (text, crc) in vectors {
            assert_eq!(crc16(text.as_bytes()), crc, "{text}");
            assert_eq!(framed(text), format!("{text}{crc:04X}\r").as_bytes());
        }
    }

    #[test]
    fn a_tool_description_is_padded() {
        let rom = pad_rom(vec![7; 752]).unwrap();
        assert_eq!((rom.len(), rom[751], rom[752]), (ROM_BYTES, 7, 0));
        assert_eq!(pad_rom(Vec::new()), Err(OptionsError::RomLength { length: 0 }));
        assert_eq!(pad_rom(vec![0; 1025]), Err(OptionsError::RomLength { length: 1025 }));
    }

    #[test]
    fn tool_files_are_read_in_order() {
        let dir = tempfile::tempdir().unwrap();
        let file = |name: &str, bytes: &[u8]| {
            let path = dir.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            path
        };
        let load = |rom_files| Options { rom_files, ..Options::default() }.load_roms();
        let found = load(vec![file("a.rom", &[3; 752]), file("b.rom", &[5; ROM_BYTES])]).unwrap();
        assert_eq!(found.roms.iter().map(|rom| (rom.len(), rom[0])).collect::<Vec<_>>(), [(1024, 3), (1024, 5)]);
        assert!(found.rom_files.is_empty() && found.validate().is_ok());
        let error = load(vec![file("c.rom", &[0; 1025])]).unwrap_err().to_string();
        assert!(error.contains("c.rom: a tool description has 1 to 1024 bytes; this one has 1025"), "{error}");
        let error = load(vec![dir.path().join("no.rom")]).unwrap_err().to_string();
        assert!(error.starts_with("cannot read the tool description") && error.contains("no.rom"), "{error}");
    }
}
