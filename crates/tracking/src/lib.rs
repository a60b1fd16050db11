//! Trackers of insonify, a real-time ultrasound simulator: from received bytes to pose records, live or recorded.
//!
//! A decoder takes bytes and returns records. It reads no port and no clock, so tests, fuzzers and replays run the
//! decoder of a live session.
//!
//! ```
//! use bytes::BytesMut;
//! use insonify_core::pose::Reading;
//! use insonify_tracking::tracker::Protocol;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let mut decoder = Protocol::AsciiLine.decoder();
//! // Half of a line: more bytes are needed.
//! let mut buffer = BytesMut::from("P,7,1000,1.5,-2,80.25,");
//! assert_eq!(decoder.decode(&mut buffer)?, None);
//! // The rest of the line, with its checksum.
//! buffer.extend_from_slice(b"1,0,0,0*0F\n");
//! let record = decoder.decode(&mut buffer)?.ok_or("more bytes are needed")?;
//! let Reading::Pose(pose) = record.reading else { return Err("the record holds no pose".into()) };
//! assert_eq!((record.sequence, pose.position_mm.z), (Some(7), 80.25));
//! # Ok(())
//! # }
//! ```
//!
//! | module | holds |
//! |---|---|
//! | [`recording`] | recordings of sessions (feature `recordings`), and interchange with other programs |
//! | [`tracker`] | decoders, one file per protocol; sessions with devices (features `live`, `serial`, `hid`) |

pub mod tracker;

pub mod recording;
