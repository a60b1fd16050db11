//! Tests of odd sizes, extreme sectors, and refused settings.

use insonify::anatomy::{Bvh, BvhError, analytic};
use insonify::render::{Frame, RenderError, RenderSettings, Renderer};
use insonify::transducer::{Probe, ProbeKind};

use super::bench::{Bench, Rig, at, backend, grainy, linear, magnitude, silent, slab, small};

fn scene() -> insonify::anatomy::Scene {
    let mut bench = Bench::new(grainy(0.0, 0.01));
    let plate = bench.tissue(silent(1540.0, 1.7));
    bench.add(plate, 1, slab(0.0, 40.0, 20.0, 30.0));
    bench.add(plate, 2, analytic::sphere(glam::Vec3::new(0.0, 0.0, 45.0), 6.0, 4));
    bench.scene().unwrap()
}

#[test]
fn buffers_of_any_size_give_complete_frames() {
    let scene = scene();
    let phased = |fov_deg| ProbeKind::Phased { fov_deg };
    let convex = |fov_deg| ProbeKind::Convex { radius_mm: 40.0, fov_deg };
    let base = Probe { depth_mm: 60.0, ..Probe::default() };
    let cases = [
        (Probe { scanlines: 1, samples: 1.into(), ..base }, (16, 16), (1, 1)),
        (Probe { scanlines: 1, samples: 333.into(), ..base }, (17, 33), (1, 2)),
        (Probe { scanlines: 7, samples: 333.into(), ..base }, (17, 33), (3, 2)),
        (Probe { scanlines: 7, samples: 1.into(), kind: phased(180.0), ..base }, (33, 17), (1, 1)),
        (Probe { scanlines: 65, samples: 1023.into(), kind: convex(0.1), ..base }, (65, 129), (1, 1)),
        (Probe { scanlines: 33, samples: 500.into(), kind: convex(180.0), ..base }, (127, 63), (5, 33)),
        (
            Probe { scanlines: 3, samples: 8192.into(), kind: ProbeKind::Linear { width_mm: 0.1 }, ..base },
            (19, 1001),
            (1, 1),
        ),
        (Probe { scanlines: 1024, samples: 17.into(), kind: phased(0.1), ..base }, (501, 21), (1, 1)),
    ];
    for (probe, (width, height), (rays, layers)) in cases {
        let mut settings = small(rays, layers);
        (settings.image.width, settings.image.height) = (width, height);
        let mut rig = Rig::new(&scene, &probe, &settings);
        for z in [0.0, 22.0, 45.0] {
            let frame = rig.frame(&at(0.0, 0.0, z));
            let again = rig.frame(&at(0.0, 0.0, z));
            assert_eq!((&frame.lines, &frame.bmode), (&again.lines, &again.bmode));
            assert!(z > 0.0 || frame.lines.iter().any(|&s| magnitude(s) > 0.0), "{probe:?}");
        }
    }
}

#[test]
fn wrong_settings_are_refused() {
    let scene = scene();
    let refused = |probe: &Probe, settings: &RenderSettings| match Renderer::new(backend(), &scene, probe, settings) {
        Err(error @ RenderError::Settings(_)) => error.to_string(),
        other => panic!("{other:?}"),
    };
    let good = linear(8, 0.5, 64, 40.0);
    type Spoil = fn(&mut Probe, &mut RenderSettings);
    let spoils: [(&str, Spoil); 24] = [
        ("image.width", |_, s| s.image.width = 0),
        ("image.width", |_, s| s.image.width = 4097),
        ("image.height", |_, s| s.image.height = 15),
        ("image.dynamic_range_db", |_, s| s.image.dynamic_range_db = 0.0),
        ("image.gain_db", |_, s| s.image.gain_db = f64::NAN),
        ("image.tgc_db_per_cm", |_, s| s.image.tgc_db_per_cm = -1.0),
        ("quality.rays", |_, s| s.quality.rays = 0),
        ("quality.rays", |_, s| s.quality.rays = 257),
        ("quality.layers", |_, s| s.quality.layers = 34),
        ("quality.reflections_max", |_, s| s.reflections_max = 7),
        ("quality.beam_taps_max", |_, s| s.beam_taps_max = 130),
        ("quality.pulse_taps_max", |_, s| s.pulse_taps_max = 2),
        ("width_mm", |p, _| p.kind = ProbeKind::Linear { width_mm: 0.0 }),
        ("fov_deg", |p, _| p.kind = ProbeKind::Phased { fov_deg: 181.0 }),
        ("radius_mm", |p, _| p.kind = ProbeKind::Convex { radius_mm: f64::INFINITY, fov_deg: 60.0 }),
        ("frequency_mhz", |p, _| p.frequency_mhz = f64::NAN),
        ("fractional_bandwidth", |p, _| p.fractional_bandwidth = 0.0),
        ("depth_mm", |p, _| p.depth_mm = -1.0),
        ("scanlines", |p, _| p.scanlines = 0),
        ("samples", |p, _| p.samples = 8193.into()),
        ("focus_mm", |p, _| p.focus_mm = 0.0),
        ("aperture_mm", |p, _| p.aperture_mm = f64::INFINITY),
        ("elevational_height_mm", |p, _| p.elevational_height_mm = 0.0),
        ("elevational_focus_mm", |p, _| p.elevational_focus_mm = f64::NAN),
    ];
    for (key, spoil) in spoils {
        let (mut probe, mut settings) = (good, small(1, 1));
        spoil(&mut probe, &mut settings);
        let message = refused(&probe, &settings);
        assert!(message.contains(key) && message.contains("must lie in"), "{key}: {message}");
    }
    let empty = Bench::new(silent(1540.0, 1.5)).scene().unwrap();
    assert_eq!(Bvh::build(&empty).unwrap_err(), BvhError::Empty);
    assert!(matches!(Renderer::new(backend(), &empty, &good, &small(1, 1)), Err(RenderError::Bvh(BvhError::Empty))));
}

#[test]
fn the_ring_of_frames_is_bounded() {
    let mut renderer = Renderer::new(backend(), &scene(), &linear(8, 0.5, 64, 40.0), &small(1, 1)).unwrap();
    let mut frame = Frame::default();
    assert!(matches!(renderer.receive(&mut frame), Err(RenderError::RingEmpty)));
    renderer.submit(&at(0.0, 0.0, 0.0)).unwrap();
    renderer.submit(&at(1.0, 0.0, 0.0)).unwrap();
    assert!(matches!(renderer.submit(&at(2.0, 0.0, 0.0)), Err(RenderError::RingFull)));
    assert!(matches!(renderer.render(&at(2.0, 0.0, 0.0), &mut frame), Err(RenderError::RingFull)));
    renderer.receive(&mut frame).unwrap();
    let first = frame.clone();
    renderer.receive(&mut frame).unwrap();
    renderer.render(&at(0.0, 0.0, 0.0), &mut frame).unwrap();
    assert_eq!(first.lines, frame.lines);
}
