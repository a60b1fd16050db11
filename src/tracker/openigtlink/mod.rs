//! OpenIGTLink, versions 1 to 3: poses of a tracking server (PLUS, 3D Slicer) in, images and transforms out.
//!
//! A message is a head of 58 bytes and a body guarded by a CRC-64; numbers are big-endian. [`Decoder`] takes poses from
//! `TRANSFORM`, `POSITION` and `TDATA` messages and passes over all others. [`message`] holds the codec, which the server
//! in [`crate::sink::openigtlink`] uses, too.
//!
//! | message | body |
//! |---|---|
//! | `TRANSFORM` | 12 f32: the columns of the rotation, then the translation, mm |
//! | `POSITION` | 3 f32 mm, then nothing, or f32 qx qy qz, or f32 qx qy qz qw |
//! | `TDATA` | for each tool: char\[20\] name, u8 type, u8 0, 12 f32 as of a `TRANSFORM`; tools out of view are left out |
//!
//! A record's `sensor` is the number of its device or tool: 0 for the first name heard, 1 for the next. Its device time is
//! the message's time stamp, where it has one.
//!
//! Source: protocol documents of OpenIGTLink v1 to v3.

use thiserror::Error;

use crate::pose::PoseError;

mod decoder;
pub mod message;

pub use decoder::{Decoder, NAMES_LIMIT};

/// TCP port.
pub const TCP_PORT: u16 = 18_944;

/// Bytes that are no message, or a message without a pose that should have one.
#[derive(Debug, Error, Clone, PartialEq)]
#[error("byte {offset} of the OpenIGTLink stream: {reason}")]
pub struct DecodeError {
    /// Where it starts, bytes from the start of the stream.
    pub offset: u64,
    /// What is wrong.
    pub reason: Reason,
}

/// What is wrong with a message.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum Reason {
    /// No head.
    #[error(
        "no message starts with 0x{byte:02X} and what follows; one starts with a version 1 to 3, a type and a size"
    )]
    Head {
        /// First byte.
        byte: u8,
    },
    /// A body of a size that its kind can't have.
    #[error("a {kind} message has {found} bytes; it must have {expected}")]
    Size {
        /// Its type.
        kind: &'static str,
        /// Bytes of its content.
        found: u64,
        /// What would be right.
        expected: &'static str,
    },
    /// Damaged on its way.
    #[error("a message has the CRC {found:016X}, but its body gives {computed:016X}")]
    Checksum {
        /// What its head says.
        found: u64,
        /// CRC-64 of its body.
        computed: u64,
    },
    /// A v3 body whose parts don't fit.
    #[error("the extended header asks for {parts} bytes of a body of {body}; it must be 12 bytes long")]
    ExtendedHeader {
        /// Extended header and metadata, bytes.
        parts: u64,
        /// Body, bytes.
        body: u64,
    },
    /// A matrix that turns and stretches.
    #[error("the matrix of `{name}` is no rotation: {what}")]
    Matrix {
        /// Device or tool.
        name: String,
        /// What is wrong with it.
        what: &'static str,
    },
    /// Twelve numbers, but no pose.
    #[error("`{name}`: {source}")]
    Pose {
        /// Device or tool.
        name: String,
        /// What is wrong with it.
        source: PoseError,
    },
    /// Too many names.
    #[error("`{name}` would be the device or tool number {NAMES_LIMIT}; fewer are told apart")]
    TooManyNames {
        /// The name.
        name: String,
    },
    /// The stream ended within a message.
    #[error("the stream ends after {length} bytes of a message")]
    Incomplete {
        /// Bytes there were.
        length: u64,
    },
}
