//! Comparison of frames by different pipelines: with maps and without, with an effect and without, with bounds checks
//! and without.
//!
//! A driver may contract multiplications and additions in one pipeline and not in another, since naga emits no
//! `NoContraction`. Software Vulkan was never seen to do so, so its frames are compared bit for bit. On a GPU, frames
//! are compared within a bound.

use insonify::render::{ComputeDevice, Frame};

use crate::twins::scenes::DEVICE;

/// Fraction of the values that may differ by more. Rounding may choose another cell of scatterers, or the other side of
/// an edge.
const PART: f64 = 1e-3;
/// Largest difference of the other values of a line, relative to the greatest magnitude.
const OF_LINE: f32 = 1e-4;

/// Asserts that two frames by different pipelines of the device are the same picture. Maps or lines that one of them
/// lacks are not compared.
#[track_caller]
pub(crate) fn assert_alike(found: &Frame, expected: &Frame, what: &str) {
    let in_software = DEVICE.compute_device() == ComputeDevice::Processors;
    if let Err(reason) = alike(found, expected, in_software) {
        panic!("{what}: {reason}");
    }
}

/// Checks that two frames by different pipelines are alike; the error names what is not.
fn alike(found: &Frame, expected: &Frame, in_software: bool) -> Result<(), String> {
    let lines = |frame: &Frame| frame.lines.as_flattened().to_vec();
    let (found_lines, expected_lines) = (lines(found), lines(expected));
    let greatest = expected_lines.iter().fold(0.0f32, |greatest, v| greatest.max(v.abs()));
    let grey = |found: &[u8], expected: &[u8], allowed: u8| {
        compare(found, expected, |a, b| if in_software { a == b } else { a.abs_diff(b) <= allowed }, in_software)
    };
    let real = |found: &[f32], expected: &[f32], allowed: f32| {
        let close = |a: f32, b: f32| if in_software { a.to_bits() == b.to_bits() } else { (a - b).abs() <= allowed };
        compare(found, expected, close, in_software)
    };
    grey(&found.bmode, &expected.bmode, 1).map_err(|reason| format!("image: {reason}"))?;
    grey(&found.segmentation, &expected.segmentation, 0).map_err(|reason| format!("segmentation: {reason}"))?;
    real(&found.attenuation, &expected.attenuation, 1.0 / 255.0).map_err(|reason| format!("attenuation: {reason}"))?;
    real(&found_lines, &expected_lines, OF_LINE * greatest).map_err(|reason| format!("lines: {reason}"))
}

/// Checks that all values are close; outside software, the fraction [`PART`] may not be. An empty side is not compared.
fn compare<T: Copy>(
    found: &[T],
    expected: &[T],
    close: impl Fn(T, T) -> bool,
    in_software: bool,
) -> Result<(), String> {
    if found.is_empty() || expected.is_empty() {
        return Ok(());
    }
    if found.len() != expected.len() {
        return Err(format!("{} values, {} expected", found.len(), expected.len()));
    }
    let far = found.iter().zip(expected).filter(|&(&a, &b)| !close(a, b)).count();
    let allowed = if in_software { 0.0 } else { PART * found.len() as f64 };
    if far as f64 <= allowed { Ok(()) } else { Err(format!("{far} of {} values differ", found.len())) }
}

#[test]
fn a_gpu_may_round_but_not_draw_something_else() {
    let frame = Frame {
        bmode: (0..10_000).map(|i| (i % 251) as u8).collect(),
        segmentation: vec![3; 10_000],
        attenuation: vec![0.5; 10_000],
        lines: vec![[1.0, -2.0]; 10_000],
        ..Frame::default()
    };
    assert!(alike(&frame, &frame, true).is_ok() && alike(&frame, &frame, false).is_ok());
    let changed = |change: &dyn Fn(&mut Frame)| {
        let mut other = frame.clone();
        change(&mut other);
        [true, false].map(|in_software| alike(&other, &frame, in_software).is_ok())
    };
    assert_eq!(changed(&|f| f.bmode.iter_mut().for_each(|grey| *grey += 1)), [false, true], "a level everywhere");
    assert_eq!(changed(&|f| f.bmode[..10].fill(255)), [false, true], "another speckle on 0.1 %");
    assert_eq!(changed(&|f| f.bmode[..300].fill(255)), [false, false]);
    assert_eq!(changed(&|f| f.segmentation[..10].fill(4)), [false, true]);
    assert_eq!(changed(&|f| f.segmentation[..11].fill(4)), [false, false]);
    assert_eq!(changed(&|f| f.attenuation.fill(0.5 + 1e-6)), [false, true]);
    assert_eq!(changed(&|f| f.attenuation.fill(0.51)), [false, false]);
    assert_eq!(changed(&|f| f.lines.fill([1.0, -2.000_1])), [false, true]);
    assert_eq!(changed(&|f| f.lines.fill([1.0, -2.1])), [false, false]);
    assert_eq!(changed(&|f| f.segmentation.clear()), [true, true], "a frame without maps");
    assert_eq!(changed(&|f| f.bmode.truncate(9)), [false, false]);
}
