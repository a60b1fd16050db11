//! Frames whose paths do not fit into one batch equal those that were made in one batch.

use insonify::render::{Choice, Effect, Frame, Quality, RenderError, RenderSettings, ShaderSet};
use insonify::transducer::ProbeKind;

use crate::twins::reconfigure::untimed;
use crate::twins::scenes::{Case, nested};

/// Memory for the segments of a path, bytes.
const PATH_BYTES: u64 = 40 * 48;

/// The nested case with 33 scanlines, 7 rays and this many layers, with or without the aperture effect.
fn case(layers: u32, aperture: Choice) -> Case {
    let mut case = nested();
    case.settings.quality = Quality { rays: 7, layers, seed: 3 };
    case.settings.effects = case.settings.effects.with(Effect::Aperture, aperture);
    case
}

/// Shaders whose batches hold `lines` scanlines of a layer in addition to the axial paths.
fn shaders_of(lines: u64) -> ShaderSet {
    shaders_within((33 + 7 * lines) * PATH_BYTES)
}

/// Shaders whose batches have at most `bytes` bytes of segments.
fn shaders_within(bytes: u64) -> ShaderSet {
    let mut shaders = ShaderSet::default();
    shaders.segment_bytes_max = Some(bytes);
    shaders
}

/// Renders a frame, which must take `batches` batches.
fn frame(case: &Case, shaders: &ShaderSet, batches: u32) -> Frame {
    let mut renderer = case.renderer(shaders);
    match renderer.snapshot(&case.pose) {
        Err(RenderError::Batches { batches: found }) => assert_eq!(found, batches),
        other => assert!(other.is_ok() && batches == 1, "{batches} batches"),
    }
    let mut frame = Frame::default();
    renderer.render(&case.pose, &mut frame).unwrap();
    assert!(frame.bmode.iter().any(|&grey| grey > 20) && frame.overflows == 0);
    untimed(frame)
}

#[test]
fn a_layer_in_several_batches_is_the_layer_bit_for_bit() {
    for aperture in [Choice::On, Choice::Off] {
        let one = case(1, aperture);
        let whole = frame(&one, &ShaderSet::default(), 1);
        assert!(whole == frame(&one, &shaders_of(13), 3), "{aperture:?}");
        assert!(whole == frame(&one, &shaders_of(1), 33), "{aperture:?}: a scanline each");
        let three = case(3, aperture);
        assert!(frame(&three, &shaders_of(33), 3) == frame(&three, &shaders_of(20), 6), "{aperture:?}: layers");
    }
    // Sums of a cell go on from batch to batch.
    let mut damaged = shaders_of(13);
    assert!(damaged.replace("transmission", "before = partial_sums[at];", "before = vec2<f32>(0.0);"));
    let one = case(1, Choice::On);
    assert!(frame(&one, &shaders_of(13), 3) != frame(&one, &damaged, 3));
}

#[test]
fn layers_in_several_batches_are_one_frame_but_for_the_rounding_of_their_echoes() {
    for aperture in [Choice::On, Choice::Off] {
        let case = case(3, aperture);
        let whole = frame(&case, &ShaderSet::default(), 1);
        for (lines, batches) in [(66, 2), (33, 3), (20, 6)] {
            let split = frame(&case, &shaders_of(lines), batches);
            assert!(whole.segmentation == split.segmentation && whole.attenuation == split.attenuation);
            // Echoes of interfaces are added before the scatterers of the last batch, not after them.
            let numbers = |frame: &Frame| frame.lines.as_flattened().to_vec();
            let greatest = numbers(&whole).into_iter().map(f32::abs).fold(0.0, f32::max);
            let pairs = numbers(&whole).into_iter().zip(numbers(&split));
            let worst = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) / greatest;
            let other = whole.bmode.iter().zip(&split.bmode).filter(|(a, b)| a != b).count();
            println!("{aperture:?}, {batches} batches: {worst:.1e} of the greatest amplitude, {other} pixels differ");
            assert!(worst < 4.0e-7, "{worst}");
            assert!(whole.bmode.iter().zip(&split.bmode).all(|(a, b)| a.abs_diff(*b) <= 1));
            assert!(other * 1000 < whole.bmode.len(), "{other} pixels");
        }
        // The host has the same brightness.
        let mut host = Frame::default();
        case.host_renderer().render(&case.pose, &mut host).unwrap();
        let split = frame(&case, &shaders_of(20), 6);
        let grey = host.bmode.iter().zip(&split.bmode).filter(|(a, b)| a.abs_diff(**b) > 1).count();
        assert!(grey * 50 < host.bmode.len(), "{aperture:?}: {grey} pixels");
    }
}

#[test]
#[ignore = "takes half a minute on software Vulkan; `make test` runs it where there is a device"]
fn the_largest_layer_renders_on_a_device_that_binds_little() {
    // Segments of 503 MB; software takes 96 MiB.
    let mut case = nested();
    case.probe.kind = ProbeKind::Linear { width_mm: 40.0 };
    (case.probe.scanlines, case.probe.samples) = (1024, 64.into());
    case.settings = RenderSettings { lines: false, maps: false, ..case.settings };
    case.settings.quality = Quality { rays: 256, layers: 1, seed: 3 };
    let (mut device, mut host) = (Frame::default(), Frame::default());
    case.renderer(&shaders_within(96 << 20)).render(&case.pose, &mut device).unwrap();
    case.host_renderer().render(&case.pose, &mut host).unwrap();
    assert!(device.bmode.iter().any(|&grey| grey > 20));
    let other = host.bmode.iter().zip(&device.bmode).filter(|(a, b)| a.abs_diff(**b) > 1).count();
    println!("{other} of {} pixels differ; {:?}", host.bmode.len(), device.times);
    assert!(other * 50 < host.bmode.len(), "{other} pixels");
}
