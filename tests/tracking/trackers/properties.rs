//! Tests of properties that hold for any stream of a Polhemus device.

use bytes::BytesMut;
use insonify::tracker::{DecodeError, Protocol, Record};
use proptest::prelude::*;

use crate::trackers::polhemus::{Kind, Polhemus};

const PROTOCOLS: [(Kind, Protocol); 4] = [
    (Kind::Fastrak, Protocol::FastrakAscii),
    (Kind::Fastrak, Protocol::FastrakBinary),
    (Kind::Liberty, Protocol::Liberty),
    (Kind::Liberty, Protocol::Patriot),
];

/// Records and errors from `bytes`, received in pieces that end at `cuts`.
fn decode(protocol: Protocol, bytes: &[u8], cuts: &[usize]) -> Vec<Result<Record, DecodeError>> {
    let mut ends: Vec<_> = cuts.iter().map(|cut| cut % (bytes.len() + 1)).collect();
    ends.push(bytes.len());
    ends.sort_unstable();
    let (mut decoder, mut buffer, mut out, mut start) = (protocol.decoder(), BytesMut::new(), Vec::new(), 0);
    for end in ends {
        buffer.extend_from_slice(&bytes[start..end]);
        start = end;
        loop {
            let before = buffer.len();
            match decoder.decode(&mut buffer) {
                Ok(Some(record)) => out.push(Ok(record)),
                Ok(None) => break,
                Err(error) => out.push(Err(error)),
            }
            assert!(buffer.len() < before, "no progress");
        }
        assert!(buffer.len() <= 64);
    }
    out.extend(decoder.finish(&mut buffer).err().map(Err));
    assert!(buffer.is_empty());
    out
}

/// Bytes of the first `count` records that a device streams after it was configured.
fn stream(kind: Kind, protocol: Protocol, count: usize) -> Vec<u8> {
    let mut device = Polhemus::new(kind);
    let commands: &[u8] = match protocol {
        Protocol::FastrakAscii => b"l1,1\ruO1,2,4,1\rFC",
        Protocol::FastrakBinary => b"l1,1\ruO1,2,11,0\rfC",
        _ => b"F1\rU1\rO*,8,9,11,3,7\rC\r",
    };
    device.receive(std::time::Duration::ZERO, commands);
    assert!(device.refused.is_empty(), "{:?}", device.refused);
    let later = std::time::Duration::from_secs(3600);
    let record = |_| {
        let mut record = device.next_record(later).unwrap();
        if protocol == Protocol::Patriot {
            // Its frames differ only in their tag.
            record[..2].copy_from_slice(b"PA");
        }
        record
    };
    (0..count).flat_map(record).collect()
}

#[test]
fn sound_streams_are_decoded_completely() {
    for (kind, protocol) in PROTOCOLS {
        let found = decode(protocol, &stream(kind, protocol, 300), &[]);
        assert_eq!(found.iter().filter(|record| record.is_ok()).count(), 300, "{protocol:?}");
        assert_eq!(found.len(), 300);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_split_of_a_damaged_stream_gives_the_same(
        which in 0..PROTOCOLS.len(),
        damage in prop::collection::vec((any::<usize>(), any::<u8>()), 0..8),
        lost in prop::collection::vec(any::<usize>(), 0..8),
        noise in prop::collection::vec((any::<usize>(), prop::collection::vec(prop::sample::select(&b"0LYPA1 \r\n\0C"[..]), 1..90)), 0..3),
        cuts in prop::collection::vec(any::<usize>(), 0..20),
    ) {
        let (kind, protocol) = PROTOCOLS[which];
        let mut bytes = stream(kind, protocol, 12);
        for (at, value) in damage {
            let at = at % bytes.len();
            bytes[at] = value;
        }
        for at in lost {
            bytes.remove(at % bytes.len());
        }
        for (at, noise) in noise {
            let at = at % bytes.len();
            bytes.splice(at..at, noise);
        }
        // Compared as text: an error may contain NaN, which equals nothing.
        let text = |cuts: &[usize]| format!("{:?}", decode(protocol, &bytes, cuts));
        let whole = text(&[]);
        prop_assert_eq!(&text(&cuts), &whole);
        let every: Vec<_> = (0..bytes.len()).collect();
        prop_assert_eq!(&text(&every), &whole);
    }

    #[test]
    fn arbitrary_bytes_are_survived(
        which in 0..PROTOCOLS.len(),
        bytes in prop::collection::vec(prop_oneof![any::<u8>(), prop::sample::select(&b"0LYPA1 C"[..])], 0..600),
    ) {
        let (kind, protocol) = PROTOCOLS[which];
        decode(protocol, &bytes, &[]);
        // Behind any noise a stream is found again within two records.
        let good = stream(kind, protocol, 10);
        let found = decode(protocol, &[&bytes[..], &good].concat(), &[]);
        let expected: Vec<_> = decode(protocol, &good, &[]).into_iter().flatten().collect();
        let tail: Vec<_> = found.into_iter().flatten().collect();
        prop_assert!(tail.ends_with(&expected[2..]), "{} of 10 at the end", tail.len());
    }

    #[test]
    fn one_damaged_byte_loses_two_records_at_most(which in 0..PROTOCOLS.len(), at in any::<usize>(), value in any::<u8>()) {
        let (kind, protocol) = PROTOCOLS[which];
        let mut bytes = stream(kind, protocol, 10);
        let at = at % bytes.len();
        bytes[at] = value;
        let good = decode(protocol, &bytes, &[]).into_iter().flatten().count();
        prop_assert!(good >= 8, "{good} of 10");
    }
}
