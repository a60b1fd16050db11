//! Hard cases of sizes: one sample, one scanline, the narrowest and the widest fields of view, images one pixel wide.

use glam::Vec3;
use insonify::anatomy::analytic;
use insonify::render::ShaderSet;
use insonify::selftest::bench::{Bench, at, grainy, linear, silent, slab, small};
use insonify::transducer::{Probe, ProbeKind};

use super::common::{ROUNDING, Tolerance, holds, renderer};

#[test]
fn the_smallest_and_widest_probes_match_the_twin() {
    let mut bench = Bench::new(grainy(0.0, 0.01));
    let plate = bench.tissue(silent(1540.0, 1.7));
    bench.add(plate, 1, slab(glam::DVec2::ZERO, 40.0, 20.03, 30.04));
    bench.add(plate, 2, analytic::sphere(Vec3::new(0.0, 0.0, 45.0), 6.0, 3));
    let scene = bench.scene().unwrap();
    let base = Probe { depth_mm: 60.0, ..Probe::default() };
    let (phased, convex) =
        (|fov_deg| ProbeKind::Phased { fov_deg }, |fov_deg| ProbeKind::Convex { radius_mm: 40.0, fov_deg });
    let cases = [
        ("one sample of one scanline", Probe { scanlines: 1, samples: 1.into(), ..base }, (16, 16), (1, 1)),
        ("one scanline", Probe { scanlines: 1, samples: 333.into(), ..base }, (17, 33), (1, 2)),
        ("one sample, 180°", Probe { scanlines: 7, samples: 1.into(), kind: phased(180.0), ..base }, (33, 17), (1, 1)),
        ("0.1°, phased", Probe { scanlines: 64, samples: 64.into(), kind: phased(0.1), ..base }, (65, 129), (1, 1)),
        ("0.1°, convex", Probe { scanlines: 65, samples: 97.into(), kind: convex(0.1), ..base }, (65, 129), (1, 1)),
        ("180°, convex", Probe { scanlines: 33, samples: 200.into(), kind: convex(180.0), ..base }, (127, 63), (5, 33)),
        ("a face of 0.1 mm", Probe { samples: 8192.into(), ..linear(3, 0.1 / 3.0, 8192, 60.0) }, (19, 1001), (1, 1)),
        ("1 mm of depth", linear(9, 0.1, 64, 1.0), (64, 64), (1, 1)),
        ("500 mm of depth", linear(9, 0.1, 64, 500.0), (64, 500), (1, 1)),
    ];
    let mut renderer = renderer(&scene, &base, &small(1, 1), &ShaderSet::default());
    for (what, probe, (width, height), (rays, layers)) in cases {
        let mut settings = small(rays, layers);
        (settings.image.width, settings.image.height) = (width, height);
        renderer.reconfigure(&probe, &settings).unwrap();
        for z in [0.0, 22.0, 45.0] {
            // With few samples, one lattice cell chosen by rounding is a large part of the image.
            let tolerance = if probe.sample_count() < 100 || probe.scanlines < 3 {
                Tolerance { grey: 8.0, other: 0.02 }
            } else {
                ROUNDING
            };
            holds(&format!("{what}, from {z} mm"), &mut renderer, &at(0.011, 0.012, z), tolerance);
        }
    }
}
