//! Tests of what every decoder promises: the same records for any split of the stream, progress on any input, and
//! recovery after damage.

use bytes::BytesMut;
use glam::{DMat3, DQuat, DVec3};
use insonify::pose::{Pose, Reading};
use insonify::tracker::{Decoder, Fault, Protocol, Record, ascii_line, openigtlink};
use proptest::prelude::*;

use crate::protocols::messages::{floats, matrix, message, tool};
use crate::protocols::ndi_device::{Port, Tool, binary_reply, framed, text_reply};

/// Streams that can be split anywhere.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Stream {
    NdiBinary,
    NdiText,
    Bno08x,
    OpenIgtLink,
    AsciiLine,
}

const STREAMS: [Stream; 5] =
    [Stream::NdiBinary, Stream::NdiText, Stream::Bno08x, Stream::OpenIgtLink, Stream::AsciiLine];

impl Stream {
    fn protocol(self) -> Protocol {
        match self {
            Self::NdiBinary | Self::NdiText => Protocol::Ndi,
            Self::Bno08x => Protocol::Bno08x,
            Self::OpenIgtLink => Protocol::OpenIgtLink,
            Self::AsciiLine => Protocol::AsciiLine,
        }
    }

    /// Bytes of record number `n`.
    fn record(self, n: u32) -> Vec<u8> {
        let tools = [Tool { port: Port::Enabled, in_view: !n.is_multiple_of(7), ..Tool::wired(1) }];
        match self {
            Self::NdiBinary => binary_reply(n + 1, &tools, 0),
            Self::NdiText => framed(&text_reply(n + 1, &tools, 0)),
            Self::Bno08x => {
                let mut bytes = vec![0xAA, 0xAA, n as u8];
                for value in [n as i16 * 10, -(n as i16), 1234, 1, -2, 981] {
                    bytes.extend(value.to_le_bytes());
                }
                bytes.extend([0; 3]);
                let sum = bytes[2..].iter().fold(0_u8, |sum, &byte| sum.wrapping_add(byte));
                bytes.push(sum);
                bytes
            }
            Self::AsciiLine => {
                let pose = Pose::from_components([f64::from(n), 2.5, -30.0, 0.8, 0.6, 0.0, 0.0]).unwrap();
                ascii_line::encode(n, u64::from(n) * 20_000, &pose).into_bytes()
            }
            Self::OpenIgtLink => {
                let rotation = DMat3::from_quat(DQuat::from_rotation_x(f64::from(n) * 0.1));
                let matrix = matrix(rotation, DVec3::new(f64::from(n), 2.0, 3.0));
                let version = if n.is_multiple_of(2) { 1 } else { 3 };
                match n % 3 {
                    0 => message(version, "TRANSFORM", "Probe", n + 1, &matrix),
                    1 => message(version, "TDATA", "Tracker", n + 1, &tool("Stylus", &matrix)),
                    _ => {
                        let position = floats(&[f64::from(n), 2.0, 3.0, 0.0, 0.6, 0.0, 0.8]);
                        message(version, "POSITION", "Needle", n + 1, &position)
                    }
                }
            }
        }
    }

    fn bytes(self, count: u32) -> Vec<u8> {
        (0..count).flat_map(|n| self.record(n)).collect()
    }
}

/// Records and errors from a stream received in pieces; each decoding step must remove bytes.
fn decode(mut decoder: Decoder, pieces: &[&[u8]]) -> (Vec<Record>, Vec<String>) {
    let mut buffer = BytesMut::new();
    let (mut records, mut errors) = (Vec::new(), Vec::new());
    for piece in pieces {
        buffer.extend_from_slice(piece);
        loop {
            let before = buffer.len();
            match decoder.decode(&mut buffer) {
                Ok(Some(record)) => records.push(record),
                Ok(None) => break,
                Err(error) => errors.push(error.to_string()),
            }
            assert!(buffer.len() < before, "no progress");
        }
    }
    let left = buffer.len();
    let ended = decoder.finish(&mut buffer);
    assert!(buffer.is_empty());
    if left > 0 {
        errors.push(ended.unwrap_err().to_string());
    }
    (records, errors)
}

fn cut<'a>(bytes: &'a [u8], cuts: &[usize]) -> Vec<&'a [u8]> {
    let mut cuts: Vec<usize> = cuts.iter().map(|at| at % (bytes.len() + 1)).collect();
    cuts.extend([0, bytes.len()]);
    cuts.sort_unstable();
    cuts.windows(2).map(|pair| &bytes[pair[0]..pair[1]]).collect()
}

/// Length of the longest common subsequence of `a` and `b`.
fn longest_common(a: &[String], b: &[String]) -> usize {
    let mut row = vec![0; b.len() + 1];
    for x in a {
        let mut before = 0;
        for (i, y) in b.iter().enumerate() {
            let above = row[i + 1];
            row[i + 1] = if x == y { before + 1 } else { above.max(row[i]) };
            before = above;
        }
    }
    row[b.len()]
}

fn stream() -> impl Strategy<Value = Stream> {
    prop::sample::select(&STREAMS[..])
}

#[test]
fn sound_streams_give_all_their_records() {
    for stream in STREAMS {
        let bytes = stream.bytes(40);
        let (records, errors) = decode(stream.protocol().decoder(), &[&bytes]);
        assert_eq!((records.len(), &errors[..]), (40, &[][..]), "{stream:?}");
    }
}

#[test]
fn openigtlink_names_are_numbers_and_other_messages_are_skipped() {
    let matrix = matrix(DMat3::IDENTITY, DVec3::new(1.0, 2.0, 3.0));
    let tools = [tool("Stylus", &matrix), tool("Probe", &matrix), tool("", &matrix)].concat();
    let stream = [
        message(1, "TRANSFORM", "Probe", 100, &matrix),
        message(3, "IMAGE", "Image", 100, &[0; 5000]),
        message(3, "TDATA", "Tracker", 101, &tools),
        message(1, "STATUS", "Tracker", 0, &[0, 1]),
        message(1, "TDATA", "Tracker", 0, &[]),
        message(1, "POSITION", "Stylus", 0, &floats(&[1.0, 2.0, 3.0])),
    ]
    .concat();
    let mut decoder = Protocol::OpenIgtLink.decoder();
    let mut buffer = BytesMut::from(&stream[..]);
    let mut found = Vec::new();
    while let Some(record) = decoder.decode(&mut buffer).unwrap() {
        let Reading::Pose(pose) = record.reading else { panic!("{record:?}") };
        assert_eq!(pose.position_mm, DVec3::new(1.0, 2.0, 3.0));
        found.push((record.sensor, record.device_time_us));
    }
    let second = 1_000_000;
    let expected =
        [(0, Some(100 * second)), (1, Some(101 * second)), (0, Some(101 * second)), (2, Some(101 * second)), (1, None)];
    assert_eq!(found, expected);
    assert!(buffer.is_empty());
}

#[test]
fn openigtlink_numbers_are_kept_and_end() {
    let matrix = matrix(DMat3::IDENTITY, DVec3::ZERO);
    let mut decoder = Protocol::OpenIgtLink.decoder();
    let mut sensor_of = |name: &str| {
        let mut buffer = BytesMut::from(&message(1, "TRANSFORM", name, 0, &matrix)[..]);
        decoder.decode(&mut buffer).map(|record| record.unwrap().sensor)
    };
    assert_eq!(["A", "B", "C", "B", "A"].map(&mut sensor_of), [Ok(0), Ok(1), Ok(2), Ok(1), Ok(0)]);
    for n in 3..openigtlink::NAMES_LIMIT {
        assert_eq!(sensor_of(&format!("tool {n}")), Ok(n as u16));
    }
    let error = sensor_of("one more").unwrap_err();
    assert!(matches!(error.fault, Fault::OpenIgtLink(openigtlink::Reason::TooManyNames { .. })), "{error}");
    assert_eq!(sensor_of("C"), Ok(2));
}

#[test]
fn openigtlink_refuses_messages_without_a_valid_pose() {
    let refused = |kind: &str, content: &[u8]| {
        let bytes = message(1, kind, "D", 0, content);
        let (records, errors) = decode(Protocol::OpenIgtLink.decoder(), &[&bytes]);
        assert_eq!((records.len(), errors.len()), (0, 1), "{kind}: {errors:?}");
        errors[0].clone()
    };
    let mirrored = matrix(DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0)), DVec3::ZERO);
    assert!(refused("TRANSFORM", &mirrored).ends_with("`D`: the matrix is no rotation: it mirrors"));
    assert!(refused("TRANSFORM", &[7; 40]).ends_with("a TRANSFORM message has 40 bytes; it must have 48"));
    assert!(
        refused("POSITION", &floats(&[f64::NAN, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])).contains("must be a finite number")
    );
    assert!(refused("TDATA", &[7; 71]).contains("70 for each"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn any_split_of_a_stream_gives_the_same(
        stream in stream(),
        cuts in prop::collection::vec(any::<usize>(), 0..30),
        noise in prop::collection::vec(any::<u8>(), 0..30),
        at in any::<usize>(),
    ) {
        let mut bytes = stream.bytes(8);
        let at = at % bytes.len();
        bytes.splice(at..at, noise);
        let whole = decode(stream.protocol().decoder(), &[&bytes]);
        let pieces = decode(stream.protocol().decoder(), &cut(&bytes, &cuts));
        prop_assert_eq!(pieces, whole);
    }

    #[test]
    fn arbitrary_bytes_are_survived(
        stream in stream(),
        bytes in prop::collection::vec(any::<u8>(), 0..2000),
        cuts in prop::collection::vec(any::<usize>(), 0..10),
    ) {
        decode(stream.protocol().decoder(), &cut(&bytes, &cuts));
        // As records with a valid start.
        let mut bytes = [stream.record(1), bytes].concat();
        let start = stream.record(2).len() / 2;
        bytes.extend(&stream.record(2)[..start]);
        let (records, _) = decode(stream.protocol().decoder(), &cut(&bytes, &cuts));
        prop_assert!(!records.is_empty());
    }

    #[test]
    fn damage_costs_two_records_at_most(
        stream in stream(),
        at in any::<usize>(),
        damage in prop_oneof![
            (1..=255_u8).prop_map(|bits| (1, vec![bits])),
            (1..20_usize).prop_map(|length| (length, vec![])),
        ],
    ) {
        const COUNT: u32 = 20;
        let sound = stream.bytes(COUNT);
        let length = stream.bytes(COUNT - 4).len();
        let at = at % length;
        let (removed, bits) = damage;
        let end = (at + removed).min(length);
        let replacement: Vec<u8> = bits.iter().map(|bits| sound[at] ^ bits).collect();
        let mut bytes = sound.clone();
        bytes.splice(at..end, replacement);
        let (all, _) = decode(stream.protocol().decoder(), &[&sound]);
        let (records, errors) = decode(stream.protocol().decoder(), &[&bytes]);
        // An OpenIGTLink head has no checksum: a damaged type makes it another message, a damaged name another tool. A
        // completely lost record shows only in its counter.
        let may_be_silent = stream == Stream::OpenIgtLink || removed > 1;
        prop_assert!(!errors.is_empty() || may_be_silent);
        // Compared by content, not by device number, which a damaged name or index may shift.
        let key = |record: &Record| format!("{:?}", record.reading);
        let (sent, found): (Vec<_>, Vec<_>) = (all.iter().map(key).collect(), records.iter().map(key).collect());
        let same = longest_common(&sent, &found);
        let (lost, wrong) = (sent.len() - same, found.len() - same);
        // One in 256 shifted frames has the right sum, as has a line without two equal digits.
        let may_be_wrong = matches!(stream, Stream::Bno08x | Stream::AsciiLine) && bits.is_empty();
        prop_assert!(wrong <= usize::from(may_be_wrong), "{wrong} records that were never sent: {records:?} {errors:?}");
        // A false record ends within a third one.
        prop_assert!(lost <= 2 + wrong, "{lost} records lost, {wrong} never sent: {errors:?}");
    }

    #[test]
    fn datagrams_and_hid_reports_are_independent(
        protocol in prop::sample::select(&[Protocol::OpenTrack, Protocol::SpaceMouse][..]),
        messages in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..100), 0..20),
    ) {
        let mut decoder = protocol.decoder();
        let mut buffer = BytesMut::new();
        for message in messages {
            buffer.extend_from_slice(&message);
            while !buffer.is_empty() {
                let before = buffer.len();
                let _ = decoder.decode(&mut buffer);
                prop_assert!(buffer.len() < before);
            }
        }
        let sound: Vec<u8> = match protocol {
            Protocol::OpenTrack => [1.0_f64, 2.0, 3.0, 4.0, 5.0, 6.0].iter().flat_map(|v| v.to_le_bytes()).collect(),
            _ => vec![1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1],
        };
        buffer.extend_from_slice(&sound);
        prop_assert!(decoder.decode(&mut buffer).unwrap().is_some());
    }
}

/// Body of a message of header version 2: content and metadata.
fn with_metadata(content: &[u8], entries: &[(&str, &str)]) -> Vec<u8> {
    let mut header = (entries.len() as u16).to_be_bytes().to_vec();
    let mut text = Vec::new();
    for (key, value) in entries {
        header.extend((key.len() as u16).to_be_bytes());
        header.extend([0, 3]);
        header.extend((value.len() as u32).to_be_bytes());
        text.extend([key.as_bytes(), value.as_bytes()].concat());
    }
    let mut body = vec![0, 12];
    body.extend((header.len() as u16).to_be_bytes());
    body.extend((text.len() as u32).to_be_bytes());
    body.extend([0; 4]);
    [&body[..], content, &header, &text].concat()
}

/// A message of header version 2 with this body.
fn version_2(kind: &str, device: &str, body: &[u8]) -> Vec<u8> {
    let mut bytes = message(1, kind, device, 7, body);
    bytes[..2].copy_from_slice(&[0, 2]);
    bytes
}

#[test]
fn openigtlink_transforms_that_are_called_invalid_are_no_poses() {
    let identity = matrix(DMat3::IDENTITY, DVec3::ZERO);
    let readings = |kind: &str, content: &[u8], entries: &[(&str, &str)]| {
        let bytes = version_2(kind, "ProbeToTracker", &with_metadata(content, entries));
        let (records, errors) = decode(Protocol::OpenIgtLink.decoder(), &[&bytes]);
        assert_eq!(errors, [""; 0]);
        records.into_iter().map(|record| record.reading).collect::<Vec<_>>()
    };
    for invalid in [
        &[("TransformValid", "False"), ("TransformStatus", "INVALID")][..],
        &[("TransformStatus", "OUT_OF_VIEW")],
        &[("FrameNumber", "12"), ("TransformValid", "false")],
        &[("ProbeToTrackerTransformStatus", "MISSING")],
    ] {
        assert_eq!(readings("TRANSFORM", &identity, invalid), [Reading::OutOfView], "{invalid:?}");
    }
    for valid in
        [&[][..], &[("TransformStatus", "OK"), ("TransformValid", "True")], &[("StylusTransformStatus", "INVALID")]]
    {
        assert_eq!(readings("TRANSFORM", &identity, valid), [Reading::Pose(Pose::IDENTITY)], "{valid:?}");
    }
    // What an invalid transform holds does not matter, and each tool of a message has its own status.
    assert_eq!(readings("TRANSFORM", &[0; 48], &[("TransformStatus", "INVALID")]), [Reading::OutOfView]);
    let tools = [tool("Stylus", &identity), tool("Probe", &identity)].concat();
    let found = readings("TDATA", &tools, &[("StylusTransformStatus", "INVALID")]);
    assert_eq!(found, [Reading::OutOfView, Reading::Pose(Pose::IDENTITY)]);
    // Metadata that do not add up say nothing about validity: refused.
    let mut broken = with_metadata(&identity, &[("TransformStatus", "INVALID")]);
    broken[12 + 48 + 3] ^= 1;
    let (records, errors) = decode(Protocol::OpenIgtLink.decoder(), &[&version_2("TRANSFORM", "Probe", &broken)]);
    assert!(records.is_empty() && errors[0].contains("the metadata's header"), "{errors:?}");
}

#[test]
fn openigtlink_without_checksums_is_taken_and_each_wrong_one_is_counted() {
    let one =
        |n: u32| message(1, "TRANSFORM", "Probe", n, &matrix(DMat3::IDENTITY, DVec3::new(f64::from(n), 0.0, 0.0)));
    let with_crc = |n: u32, crc: [u8; 8]| {
        let mut bytes = one(n);
        bytes[50..58].copy_from_slice(&crc);
        bytes
    };
    let unchecked: Vec<u8> = (0..50).flat_map(|n| with_crc(n, [0; 8])).collect();
    let (records, errors) = decode(Protocol::OpenIgtLink.decoder(), &[&unchecked]);
    assert_eq!((records.len(), errors.len()), (50, 0), "{errors:?}");
    let wrong: Vec<u8> = (0..50).flat_map(|n| with_crc(n, [1; 8])).collect();
    let (records, errors) = decode(Protocol::OpenIgtLink.decoder(), &[&wrong]);
    assert_eq!((records.len(), errors.len()), (0, 50), "{errors:?}");
}

#[test]
fn each_damaged_frame_is_counted_however_many_follow_each_other() {
    // Before, one error covered everything up to the next good frame.
    let bad: Vec<u8> = (0..60_u32)
        .flat_map(|n| {
            let mut frame = Stream::Bno08x.record(n);
            frame[18] ^= 0x55;
            frame
        })
        .collect();
    let (records, errors) = decode(Protocol::Bno08x.decoder(), &[&bad]);
    assert!(records.is_empty() && (60..=70).contains(&errors.len()), "{}", errors.len());
    // Noise counts by its length.
    let noise: Vec<u8> = (0..6400_u32).map(|i| 1 + (i.wrapping_mul(2_654_435_761) >> 25) as u8 % 100).collect();
    for protocol in [Protocol::Bno08x, Protocol::OpenIgtLink, Protocol::Ndi] {
        let (_, errors) = decode(protocol.decoder(), &[&noise]);
        assert!(errors.len() >= 25, "{protocol:?}: {} errors in 6400 bytes", errors.len());
    }
}

#[test]
fn names_of_openigtlink_tools_are_known_by_number() {
    let identity = matrix(DMat3::IDENTITY, DVec3::ZERO);
    let stream = [
        message(1, "TRANSFORM", "StylusToTracker", 1, &identity),
        message(1, "IMAGE", "Image", 1, &[0; 100]),
        message(1, "TRANSFORM", "ProbeToTracker", 1, &identity),
    ];
    let mut decoder = Protocol::OpenIgtLink.decoder();
    let mut buffer = BytesMut::from(&stream.concat()[..]);
    while decoder.decode(&mut buffer).unwrap().is_some() {}
    assert_eq!((decoder.name_of(1), decoder.name_of(2)), (Some("ProbeToTracker"), None));
    assert_eq!(decoder.skipped().as_deref(), Some("IMAGE"));
}
