//! Binary messages to a page: a fixed header, then one map of a frame.
//!
//! Little-endian. Times are in ms since the session began; an unknown value is 0 and its flag is clear.
//!
//! | offset | type | meaning |
//! |---|---|---|
//! | 0 | u8 × 4 | `INSF` |
//! | 4 | u16 | version of this layout, 6 |
//! | 6 | u8 | map that follows: 1 grey levels, 2 tissue numbers, 3 attenuation (255 = 1) |
//! | 7 | u8 | source: 0 raw, 1 generated, 2 held generated |
//! | 8 | u64 | frame number |
//! | 16 | u32 × 2 | width, height, pixels |
//! | 24 | f64 | side of a pixel, mm |
//! | 32 | f64 | row of the middle of the probe's face, pixels |
//! | 40 | u8 | tracking: 0 good, 1 held, 2 stuck, 3 stale, 4 lost |
//! | 41 | u8 | flags: 1 pose, 2 first byte, 4 generator run, 8 contact known; 16 new pose; 32 deep, 64 looks out |
//! | 42 | u16 × 2 | numbers of bytes of the first text and of the notice |
//! | 46 | u16 | number n of values of live settings |
//! | 48 | f64 × 7 | `scene_from_probe`: x, y, z in mm, qw, qx, qy, qz |
//! | 104 | f64 × 7 | first byte, sampled, submitted, rendered, inference start and end, presented |
//! | 160 | f64 × 2 | part of the face in contact, 0..=1; its depth below the skin, mm (NaN: unknown) |
//! | 176 | f64 × 2 | tracking of the needle, numbered as the probe's (−1: the session has no needle); length of its shaft, mm |
//! | 192 | f64 × 7 | `scene_from_needle`: x, y, z in mm, qw, qx, qy, qz; all 0 if it is unknown |
//! | 248 | f64 × n | values of live settings, in the order of the first text message; switches are 0 or 1 |
//! | 248 + 8n | u8 × width × height | the map, row-major |
//! | | UTF-8 | a line each: name of the generator, operating point, its reason, latest events of the needle's tip; then the notice |
//!
//! The maps 2 and 3 of a frame precede the frame's grey levels, and are sent only to pages that request them.

use std::path::Path;
use std::time::Duration;

use super::super::SinkError;
use super::super::error::check_shape;
use crate::presented::{FrameInfo, FrameSource, PresentedFrame};
use crate::settings::{Setting, live_settings};
use crate::transducer::placement::Fault;

/// Number of bytes before the values of live settings.
const FIXED_BYTES: usize = 248;
const VERSION: u16 = 6;
/// Largest number of bytes of a line or of the notice; longer texts are cut.
const TEXT_BYTES_MAX: usize = 1024;

/// Map carried by a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Map {
    Image = 1,
    Segmentation = 2,
    Attenuation = 3,
}

/// Number of bytes before the map.
pub fn header_bytes() -> usize {
    FIXED_BYTES + 8 * live_settings().map(Setting::count).sum::<usize>()
}

/// Checks that the maps have the frame's size; segmentation and attenuation may be empty.
pub(super) fn check(frame: &PresentedFrame) -> Result<(), SinkError> {
    let shape = [frame.height as usize, frame.width as usize];
    check_shape(Path::new("the browser's image"), shape, frame.image.len())?;
    for (name, length) in [("segmentation", frame.segmentation.len()), ("attenuation", frame.attenuation.len())] {
        if length > 0 {
            check_shape(Path::new(&format!("the browser's {name}")), shape, length)?;
        }
    }
    Ok(())
}

/// Writes one message into `out`, which keeps its capacity.
pub(super) fn encode(frame: &PresentedFrame, map: Map, out: &mut Vec<u8>) {
    let point = frame.point.as_deref();
    let texts =
        [frame.generator.as_deref(), point.map(|p| &*p.name), point.map(|p| &*p.reason), frame.notice.as_deref()];
    let [generator, name, reason, notice] = match map {
        Map::Image => texts.map(text),
        Map::Segmentation | Map::Attenuation => [""; 4],
    };
    let (first, events) = match map {
        Map::Image => ([generator, name, reason], &*frame.tip_events),
        Map::Segmentation | Map::Attenuation => ([""; 3], &[][..]),
    };
    let first = if first == [""; 3] && events.is_empty() { &[] } else { &first[..] };
    let lines = || first.iter().copied().chain(events.iter().map(|event| text(Some(event))));
    out.clear();
    let bytes = lines().map(|line| line.len() + 1).sum::<usize>().saturating_sub(1);
    header(frame, map, [bytes as u16, notice.len() as u16], out);
    match map {
        Map::Image => out.extend_from_slice(&frame.image),
        Map::Segmentation => out.extend_from_slice(&frame.segmentation),
        Map::Attenuation => out.extend(frame.attenuation.iter().map(|&a| (a * 255.0 + 0.5) as u8)),
    }
    for (nth, line) in lines().enumerate() {
        if nth > 0 {
            out.push(b'\n');
        }
        // Control characters become spaces, because a line break ends a text in this layout.
        out.extend(line.bytes().map(|byte| if byte.is_ascii_control() { b' ' } else { byte }));
    }
    out.extend_from_slice(notice.as_bytes());
}

fn header(frame: &PresentedFrame, map: Map, texts: [u16; 2], out: &mut Vec<u8>) {
    let times = &frame.info.timeline;
    let source = match frame.source {
        FrameSource::Raw => 0,
        FrameSource::Generated => 1,
        FrameSource::HeldGenerated => 2,
    };
    let tracking = frame.info.estimate.state as u8;
    let fault = frame.info.misplaced.map(|misplaced| misplaced.fault);
    let flags = [
        frame.info.pose().is_some(),
        times.first_byte.is_some(),
        times.inference.is_some(),
        frame.info.contact.is_some(),
        frame.info.pose_to_present().is_some(),
        matches!(fault, Some(Fault::Deep { .. })),
        matches!(fault, Some(Fault::LooksOut)),
    ];
    let contact = frame.info.contact.map_or([0.0, f64::NAN], |c| [c.part, c.press_mm.unwrap_or(f64::NAN)]);
    let flags = flags.iter().enumerate().fold(0, |byte, (bit, &set)| byte | u8::from(set) << bit);
    let pose = frame.info.pose().map_or([0.0; 7], |pose| pose.components());
    let ms = |time: Duration| time.as_secs_f64() * 1e3;
    let (start, end) = times.inference.unwrap_or_default();
    let first_byte = times.first_byte.unwrap_or_default();
    let times = [first_byte, times.sampled, times.submitted, times.rendered, start, end, times.presented].map(ms);
    let needle = needle(&frame.info);
    let values = (header_bytes() - FIXED_BYTES) / 8;

    out.extend_from_slice(b"INSF");
    out.extend_from_slice(&VERSION.to_le_bytes());
    out.extend_from_slice(&[map as u8, source]);
    out.extend_from_slice(&frame.number.to_le_bytes());
    out.extend_from_slice(&frame.width.to_le_bytes());
    out.extend_from_slice(&frame.height.to_le_bytes());
    out.extend_from_slice(&frame.pixel_mm.to_le_bytes());
    out.extend_from_slice(&frame.face_row().to_le_bytes());
    out.extend_from_slice(&[tracking, flags]);
    for length in texts.into_iter().chain([values as u16]) {
        out.extend_from_slice(&length.to_le_bytes());
    }
    let fixed = pose.into_iter().chain(times).chain(contact).chain(needle);
    for value in fixed.chain(frame.info.settings.values()) {
        out.extend_from_slice(&value.to_le_bytes());
    }
}

/// Tracking, length and pose of the needle, as the table says.
fn needle(info: &FrameInfo) -> [f64; 9] {
    let state = info.needle.map_or(-1.0, |needle| f64::from(needle.state as u8));
    let length_mm = info.settings.render.needle.map_or(0.0, |needle| needle.length_mm);
    let pose = info.needle.and_then(|estimate| estimate.needle);
    let [x, y, z, qw, qx, qy, qz] = pose.map_or([0.0; 7], |needle| needle.scene_from_needle.components());
    [state, length_mm, x, y, z, qw, qx, qy, qz]
}

/// A text, cut at a character boundary to at most `TEXT_BYTES_MAX` bytes.
fn text(text: Option<&str>) -> &str {
    let text = text.unwrap_or("");
    &text[..text.floor_char_boundary(TEXT_BYTES_MAX)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::needle::{Needle, NeedleEstimate};
    use crate::pose::{Estimate, Pose, TrackingState};
    use crate::presented::{FrameTimeline, PointText};
    use crate::settings::{LiveSettings, NeedleSettings};
    use crate::transducer::{Contact, Misplacement};

    fn frame() -> PresentedFrame {
        let seconds = Duration::from_secs_f64;
        PresentedFrame {
            number: 7,
            info: FrameInfo {
                estimate: Estimate {
                    scene_from_probe: Some(Pose::from_components([1.0, 2.0, 3.0, 0.0, 1.0, 0.0, 0.0]).unwrap()),
                    state: TrackingState::Stuck,
                    ..Estimate::default()
                },
                timeline: FrameTimeline {
                    first_byte: Some(seconds(1.0)),
                    inference: None,
                    presented: seconds(1.05),
                    ..FrameTimeline::default()
                },
                settings: LiveSettings { frozen: true, ..LiveSettings::default() },
                contact: Some(Contact { part: 0.75, press_mm: Some(1.5), shift_mm: 0.0, misplaced: None }),
                ..FrameInfo::default()
            },
            source: FrameSource::HeldGenerated,
            width: 3,
            height: 4,
            pixel_mm: 0.25,
            image: (0..12).collect(),
            segmentation: (12..24).collect(),
            attenuation: vec![0.0, 0.5, 1.0, 2.0, -1.0, f32::NAN, 0.1, 0.2, 0.3, 0.4, 0.6, 0.7],
            mask: [255, 0, 255, 0, 255, 0, 255, 255, 255, 255, 255, 255].into(),
            generator: Some("MSA".into()),
            point: Some(PointText { name: "1x3 + MSA".into(), reason: "it fits".into() }.into()),
            tip_events: ["1.2 s: entered cyst".to_owned()].into(),
            notice: Some("no generator µ".into()),
        }
    }

    fn f64_at(bytes: &[u8], offset: usize) -> f64 {
        f64::from_le_bytes(bytes[offset..offset + 8].try_into().unwrap())
    }

    #[test]
    fn every_field_lies_where_the_table_says() {
        let mut out = Vec::new();
        encode(&frame(), Map::Image, &mut out);
        assert_eq!(&out[..8], b"INSF\x06\x00\x01\x02");
        assert_eq!((out[8], out[16], out[20]), (7, 3, 4));
        assert_eq!((f64_at(&out, 24), f64_at(&out, 32)), (0.25, 1.0));
        let values: Vec<f64> = frame().info.settings.values().collect();
        assert_eq!(out[40..48], [2, 0b1011, 41, 0, 15, 0, values.len() as u8, 0]);
        assert_eq!((f64_at(&out, 48), f64_at(&out, 80)), (1.0, 1.0));
        assert_eq!((f64_at(&out, 104), f64_at(&out, 152)), (1000.0, 1050.0));
        let header = header_bytes();
        assert_eq!((f64_at(&out, 160), f64_at(&out, 168)), (0.75, 1.5));
        assert_eq!((0..values.len()).map(|i| f64_at(&out, 248 + 8 * i)).collect::<Vec<_>>(), values);
        assert_eq!(&out[header..header + 12], &frame().image[..]);
        assert_eq!(&out[header + 12..], "MSA\n1x3 + MSA\nit fits\n1.2 s: entered cystno generator µ".as_bytes());
    }

    #[test]
    fn a_needle_is_in_the_header_with_its_state() {
        let values = |needle: Option<NeedleEstimate>| {
            let mut frame = frame();
            frame.info.needle = needle;
            frame.info.settings.render.needle = needle.map(|_| NeedleSettings::default());
            let mut out = Vec::new();
            encode(&frame, Map::Image, &mut out);
            [176, 184, 192, 216].map(|offset| f64_at(&out, offset))
        };
        assert_eq!(values(None), [-1.0, 0.0, 0.0, 0.0]);
        let pose = Pose::from_components([5.0, 6.0, 7.0, 1.0, 0.0, 0.0, 0.0]).unwrap();
        let needle = Some(Needle { scene_from_needle: pose, bevel_known: true });
        let lost = NeedleEstimate { state: TrackingState::Lost, ..NeedleEstimate::default() };
        assert_eq!(values(Some(NeedleEstimate { needle, state: TrackingState::Held, ..lost })), [1.0, 90.0, 5.0, 1.0]);
        assert_eq!(values(Some(lost)), [4.0, 90.0, 0.0, 0.0]);
    }

    #[test]
    fn flags_tell_a_new_pose_and_a_misplaced_probe() {
        let flags = |change: &dyn Fn(&mut FrameInfo)| {
            let mut frame = frame();
            change(&mut frame.info);
            let mut out = Vec::new();
            encode(&frame, Map::Image, &mut out);
            out[41] & !0b1111
        };
        assert_eq!(flags(&|_| ()), 0, "a stuck pose in a frozen picture is not new");
        let measured = |info: &mut FrameInfo| {
            (info.settings.frozen, info.estimate.state, info.new.count) = (false, TrackingState::Good, 1);
        };
        assert_eq!(flags(&measured), 16);
        let wrong = |info: &mut FrameInfo, fault| info.misplaced = Some(Misplacement { fault, likely: None });
        assert_eq!(flags(&|info| wrong(info, Fault::Deep { depth_mm: 80.0 })), 32);
        assert_eq!(flags(&|info| wrong(info, Fault::LooksOut)), 64);
    }

    #[test]
    fn maps_follow_the_same_header_without_texts() {
        let (mut seg, mut att) = (Vec::new(), Vec::new());
        encode(&frame(), Map::Segmentation, &mut seg);
        encode(&frame(), Map::Attenuation, &mut att);
        assert_eq!((seg[6], att[6], seg[42], seg.len()), (2, 3, 0, header_bytes() + 12));
        assert_eq!(&seg[header_bytes()..], &frame().segmentation[..]);
        assert_eq!(&att[header_bytes()..header_bytes() + 6], &[0, 128, 255, 255, 0, 0]);
    }

    #[test]
    fn a_text_of_several_lines_is_sent_as_one() {
        let mut out = Vec::new();
        let point = PointText { name: "1x3".into(), reason: "it failed:\r\nno\tmemory µ".into() };
        let frame = PresentedFrame { generator: None, point: Some(point.into()), notice: None, ..frame() };
        let frame = PresentedFrame { tip_events: [].into(), ..frame };
        encode(&frame, Map::Image, &mut out);
        let texts = &out[header_bytes() + 12..];
        assert_eq!(texts, "\n1x3\nit failed:  no memory µ".as_bytes());
        assert_eq!(usize::from(out[42]), texts.len());
    }

    #[test]
    fn a_long_notice_is_cut_at_a_character() {
        let mut out = Vec::new();
        let notice = Some("µ".repeat(600) + "x");
        encode(
            &PresentedFrame { notice, generator: None, point: None, tip_events: [].into(), ..frame() },
            Map::Image,
            &mut out,
        );
        assert_eq!(out.len(), header_bytes() + 12 + 1024);
        assert!(std::str::from_utf8(&out[header_bytes() + 12..]).is_ok());
    }

    #[test]
    fn maps_of_another_size_are_refused() {
        assert!(check(&frame()).is_ok());
        assert!(check(&PresentedFrame { segmentation: vec![], attenuation: vec![], ..frame() }).is_ok());
        for wrong in [
            PresentedFrame { image: vec![0; 11], ..frame() },
            PresentedFrame { segmentation: vec![0; 13], ..frame() },
            PresentedFrame { attenuation: vec![0.0; 1], ..frame() },
        ] {
            assert!(check(&wrong).is_err());
        }
    }
}
