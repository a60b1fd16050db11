//! OpenIGTLink, versions 1 to 3: poses received from a tracking server (PLUS, 3D Slicer), images and transforms sent.
//!
//! A message is a header of 58 bytes and a body with a CRC-64; numbers are big-endian. [`Decoder`] takes poses from
//! `TRANSFORM`, `POSITION` and `TDATA` messages and skips all others. [`message`] holds the codec, which the server in
//! `insonify::sink::openigtlink` also uses.
//!
//! | message | body |
//! |---|---|
//! | `TRANSFORM` | 12 f32: the columns of the rotation, then the translation, mm |
//! | `POSITION` | 3 f32 mm, then nothing, or f32 qx qy qz, or f32 qx qy qz qw |
//! | `TDATA` | for each tool: char\[20\] name, u8 type, u8 0, 12 f32 as in a `TRANSFORM`; tools out of view are omitted |
//!
//! A record's `sensor` is the number of its device or tool: 0 for the first name received, 1 for the next; the decoder
//! knows their names. Its device time is the message's time stamp, if present. A transform that is invalid according to
//! its metadata gives [`Reading::OutOfView`](insonify_core::pose::Reading::OutOfView). A CRC of 0 means that the sender
//! computes none, as PLUS and 3D Slicer do by default.
//!
//! Source: protocol documents of OpenIGTLink v1 to v3.

use thiserror::Error;

use insonify_core::pose::PoseError;

mod decoder;
pub mod message;
mod metadata;

pub use decoder::{Decoder, NAMES_LIMIT};

/// Default TCP port.
pub const TCP_PORT: u16 = 18_944;

/// Length of a device's or tool's name on the wire, bytes; senders truncate longer names.
pub(crate) const NAME_LENGTH: usize = 20;

/// Fault of a message.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum Reason {
    /// No message header.
    #[error(
        "no message starts with 0x{byte:02X} and what follows; one starts with a version 1 to 3, a type and a size"
    )]
    Head {
        /// First byte.
        byte: u8,
    },
    /// A body of the wrong size for its type.
    #[error("a {kind} message has {found} bytes; it must have {expected}")]
    Size {
        /// Message type.
        kind: &'static str,
        /// Size of the content, bytes.
        found: u64,
        /// Accepted sizes.
        expected: &'static str,
    },
    /// Bytes damaged in transmission.
    #[error("a message has the CRC {found:016X}, but its body gives {computed:016X}")]
    Checksum {
        /// Checksum in the header.
        found: u64,
        /// CRC-64 of the body.
        computed: u64,
    },
    /// A v3 body with inconsistent parts.
    #[error("the extended header asks for {parts} bytes of a body of {body}; it must be 12 bytes long")]
    ExtendedHeader {
        /// Size of extended header and metadata, bytes.
        parts: u64,
        /// Size of the body, bytes.
        body: u64,
    },
    /// Metadata whose lengths do not add up.
    #[error("the {header} bytes of the metadata's header do not describe its {text} bytes of keys and values")]
    Metadata {
        /// Length of the header, bytes.
        header: usize,
        /// Length of keys and values, bytes.
        text: usize,
    },
    /// Numbers that are not a pose.
    #[error("`{name}`: {source}")]
    Pose {
        /// Device or tool.
        name: String,
        /// Fault of the pose.
        source: PoseError,
    },
    /// Too many names.
    #[error("`{name}` would be the device or tool number {NAMES_LIMIT}; at most {NAMES_LIMIT} are distinguished")]
    TooManyNames {
        /// The name.
        name: String,
    },
}
