//! Tests of the decoder.

use super::*;
use crate::tracker::Fault;
use crate::tracker::decoder::decode_all;

/// A frame captured from a real LIBERTY, quoted in a public script (comment `b'LY\x01C \x00"\x00...'`): output list
/// 9,8,2,4,1.
const CAPTURED: [u8; 42] = [
    0x4c, 0x59, 0x01, 0x43, 0x20, 0x00, 0x22, 0x00, 0xe6, 0xe0, 0x03, 0x00, 0x13, 0x29, 0x10, 0x00, 0xc0, 0x3c, 0xb6,
    0x40, 0x4c, 0x40, 0x28, 0xc0, 0xc9, 0x3f, 0x7e, 0x3f, 0xc9, 0x6a, 0xf6, 0xc2, 0x4d, 0x21, 0x36, 0x40, 0x96, 0xb6,
    0xd0, 0x41, 0x0d, 0x0a,
];
const CAPTURED_ITEMS: &[Item] = &[Item::FrameCount, Item::Timestamp, Item::Position, Item::Angles, Item::LineEnd];

/// Frame made with Python's `struct` from the layout: station 2, 123456 ms, frame 7890, distortion 3, (10.5, −20.25,
/// 30.125) cm, quaternion (0.5, 0.5, −0.5, 0.5).
const FRAME: [u8; 48] = *b"LY\x02C \x00\x28\x00\x40\xe2\x01\x00\xd2\x1e\x00\x00\x03\x00\x00\x00\x00\x00\x28\x41\
                           \x00\x00\xa2\xc1\x00\x00\xf1\x41\x00\x00\x00\x3f\x00\x00\x00\x3f\x00\x00\x00\xbf\
                           \x00\x00\x00\x3f";

fn liberty(bytes: &[u8]) -> Vec<Result<Record, Fault>> {
    decode_all(&mut Decoder::new(Device::Liberty), bytes)
}

#[test]
fn a_frame_of_a_real_liberty() {
    let found = decode_all(&mut Decoder::with_items(Device::Liberty, CAPTURED_ITEMS), &CAPTURED);
    let record = found[0].clone().unwrap();
    // 254182 frames at 240 Hz last 1059.091 s, as the device's clock says: both fields are in the right order.
    assert_eq!((record.sensor, record.sequence, record.device_time_us), (1, Some(254_182), Some(1_059_091_000)));
    let Reading::Pose(pose) = record.reading else { panic!("no pose") };
    assert!(pose.position_mm.distance(DVec3::new(56.949, -26.289, 9.932)) < 1e-3, "{pose:?}");
    let expected = super::super::fastrak::orientation(-123.208, 2.845_8, 26.089);
    assert!(pose.orientation.angle_between(expected) < 1e-4);
}

#[test]
fn a_frame_of_the_drivers_output_list() {
    let record = liberty(&FRAME)[0].clone().unwrap();
    assert_eq!((record.sensor, record.sequence, record.device_time_us), (2, Some(7890), Some(123_456_000)));
    let pose = Pose::from_components([105.0, -202.5, 301.25, 0.5, 0.5, -0.5, 0.5]).unwrap();
    assert_eq!(record.reading, Reading::Pose(pose));
    let mut patriot = FRAME;
    patriot[..2].copy_from_slice(b"PA");
    assert_eq!(decode_all(&mut Decoder::new(Device::Patriot), &patriot), [Ok(record)]);
}

#[test]
fn a_damaged_frame_loses_only_itself() {
    for at in 0..FRAME.len() {
        let mut stream = [FRAME; 14].concat();
        stream[FRAME.len() + at] ^= 0x80;
        let good = liberty(&stream).into_iter().filter(|r| r.as_ref().is_ok_and(|r| r.sensor == 2)).count();
        assert!(good >= 13, "byte {at}: {good}");
    }
    for lost in 1..FRAME.len() - 3 {
        let mut stream = [FRAME; 5].concat();
        stream.drain(FRAME.len() + 3..FRAME.len() + 3 + lost);
        let good = liberty(&stream).into_iter().filter(Result::is_ok).count();
        assert!(good >= 3, "{lost} bytes lost: {good}");
    }
}

#[test]
fn answers_are_skipped_and_errors_reported() {
    let mut answer = b"LY\x01O\x00\x00\x00\x00".to_vec();
    answer.extend(FRAME);
    assert_eq!(liberty(&answer).len(), 1);
    let refused = liberty(b"LY\x01O\x03\x00\x00\x00");
    let text = refused[0].clone().unwrap_err().to_string();
    assert_eq!(text, "station 1 reports error 3 to command `O`: a parameter is outside its range");
    let mut faulty = FRAME;
    faulty[4] = b'I';
    let text = liberty(&faulty)[0].clone().unwrap_err().to_string();
    assert!(text.contains("error `I` to command `C`: a fault of the source"), "{text}");
    let text = liberty(&CAPTURED)[0].clone().unwrap_err().to_string();
    assert_eq!(text, "a payload of 34 bytes; the output list gives 40");
    let text = liberty(&[b'x'; 70])[0].clone().unwrap_err().to_string();
    assert_eq!(text, "64 bytes are no frame; one starts with `LY` and the number of a station");
}

#[test]
fn commands_end_with_streaming() {
    assert_eq!(setup([0.0, 0.0, 1.0]).concat(), b"F1\rU1\rO*,8,9,11,3,7\rH*,0,0,1\rC\r");
}
