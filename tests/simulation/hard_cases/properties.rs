//! Properties that hold for any scene, tested on random ones. A failure names the seed that reproduces its scene.

use glam::{DQuat, DVec3, Quat, Vec3};
use insonify::acoustics::interface::{interface, refracted};
use insonify::anatomy::{Mesh, Scene, Tissue, analytic};
use insonify::pose::Pose;
use insonify::render::{ShaderSet, Snapshot};
use insonify::selftest::bench::{Bench, at, linear, silent, small};
use insonify::transducer::{Probe, ProbeKind};

use super::common::{Tolerance, frame, holds, renderer, vector};
use insonify::random::SplitMix64;

/// A random tissue, between air and bone, and between fluid and gravel.
fn tissue(random: &mut SplitMix64) -> Tissue {
    Tissue {
        attenuation_db_cm_mhz: random.between(0.0, 3.0),
        scatterer_density: random.unit(),
        scatterer_deviation: random.between(0.0, 0.05),
        roughness: if random.unit() < 0.5 { 0.0 } else { random.between(0.0, 1.0) },
        thickness_mm: if random.unit() < 0.5 { 0.0 } else { random.between(0.0, 0.3) },
        ..silent(random.between(340.0, 4100.0), 10f64.powf(random.between(-3.4, 0.9)))
    }
}

/// A scene of random bodies of any size and orientation, which may overlap.
fn scene(random: &mut SplitMix64, tissue: impl Fn(&mut SplitMix64) -> Tissue) -> Scene {
    let mut bench = Bench::new(tissue(random));
    for i in 0..6 {
        let filled = tissue(random);
        let filled = bench.tissue(filled);
        let centre = (DVec3::new(25.0, 15.0, 22.0) * vector(random) + DVec3::new(0.0, 0.0, 35.0)).as_vec3();
        let turn = Quat::from_scaled_axis((3.0 * vector(random)).as_vec3());
        let size = random.between(3.0, 30.0) as f32;
        let mesh = match i % 3 {
            0 => analytic::sphere(centre, 0.6 * size, 2),
            1 => analytic::plate(centre, size * (Vec3::ONE + 0.8 * vector(random).as_vec3()), turn),
            _ => analytic::plate(centre, Vec3::new(40.0, 40.0, 0.1 * size), turn),
        };
        bench.add(filled, i, mesh);
    }
    // A surface in front of every probe.
    bench.add(1, 0, analytic::cuboid(Vec3::new(-99.0, -99.0, 55.03), Vec3::new(99.0, 99.0, 61.07)));
    bench.scene().unwrap()
}

fn probe(seed: u64) -> Probe {
    let kind = match seed % 3 {
        0 => ProbeKind::Linear { width_mm: 30.0 },
        1 => ProbeKind::Convex { radius_mm: 30.0, fov_deg: 60.0 },
        _ => ProbeKind::Phased { fov_deg: 80.0 },
    };
    Probe {
        kind,
        scanlines: 33,
        samples: 256.into(),
        depth_mm: 70.0,
        frequency_mhz: 4.0,
        aperture_mm: 8.0,
        ..Probe::default()
    }
}

fn pose(random: &mut SplitMix64) -> Pose {
    let target = DVec3::new(0.0, 0.0, 35.0) + 10.0 * vector(random);
    Pose::looking(8.0 * vector(random), target, vector(random))
}

/// Asserts that the amplitude never rises along a path, and that no echo exceeds what absorption leaves.
fn assert_energy_falls(what: &str, s: &Snapshot) {
    for path in &s.paths {
        let (mut level, mut left) = (0.0, 0.0);
        for (i, segment) in path.segments.iter().enumerate() {
            let end_mm = path.segments.get(i + 1).map_or(s.inputs.depth_mm, |next| next.start_mm);
            let (first, last) = (segment.ln_amplitude(segment.start_mm), segment.ln_amplitude(end_mm));
            // Rounding of 10⁻⁴ nepers.
            assert!(end_mm >= segment.start_mm, "{what}: {path:?}");
            assert!(first <= level + 1e-3 && last <= first + 1e-3, "{what}: {level} {first} {last} in {path:?}");
            assert!(segment.echo.abs() <= f64::exp(left) * 1.001, "{what}: echo of {segment:?} above {left}");
            left -= segment.fall_np_mm * (end_mm - segment.start_mm);
            level = last;
        }
    }
}

/// Asserts that accumulated attenuation never falls along a map ray. For a linear probe, the map's level must not rise
/// from row to row.
fn assert_attenuation_falls(what: &str, s: &Snapshot, frame: &insonify::render::Frame) {
    for ray in s.sections.raster.chunks_exact(s.inputs.map_depths) {
        assert!(ray.windows(2).all(|w| w[1].sum_np >= w[0].sum_np * (1.0 - 1e-4) - 1e-6), "{what}");
    }
    if s.inputs.face_radius_mm.is_some() {
        return;
    }
    let width = frame.width as usize;
    for column in 0..width {
        let levels: Vec<f32> = frame.attenuation.iter().skip(column).step_by(width).copied().collect();
        let inside: Vec<bool> = frame.mask.iter().skip(column).step_by(width).map(|&m| m == 255).collect();
        for i in 1..levels.len() {
            assert!(
                !(inside[i] && inside[i - 1]) || levels[i] <= levels[i - 1] + 2e-3,
                "{what}: column {column}, row {i}"
            );
        }
    }
}

#[test]
fn on_any_scene_frames_are_valid_and_energy_and_attenuation_are_monotonic() {
    for seed in 0..9 {
        let mut random = SplitMix64::new(1000 + seed);
        let scene = scene(&mut random, tissue);
        let settings = small(3, 3);
        let mut renderer = renderer(&scene, &probe(seed), &settings, &ShaderSet::default());
        for i in 0..4 {
            let what = format!("seed {seed}, pose {i}");
            let pose = pose(&mut random);
            // Random paths that branch differently in f64 are different paths: more than rounding, less than a
            // different image.
            let s = holds(&what, &mut renderer, &pose, Tolerance { grey: 8.0, other: 0.02 });
            assert_energy_falls(&what, &s);
            assert_attenuation_falls(&what, &s, &frame(&mut renderer, &pose));
        }
    }
}

/// The scene with every vertex moved by `to`, and its faces turned over if `flip` is set.
fn moved(scene: &Scene, to: impl Fn(Vec3) -> Vec3, flip: bool) -> Scene {
    let mut scene = scene.clone();
    for surface in &mut scene.surfaces {
        let mesh = &mut surface.mesh;
        *mesh = Mesh { vertices_mm: mesh.vertices_mm.iter().map(|&v| to(v)).collect(), ..mesh.clone() };
        if flip {
            mesh.flip();
        }
    }
    scene
}

#[test]
fn segmentation_does_not_depend_on_the_coordinates() {
    for seed in 0..4 {
        let mut random = SplitMix64::new(2000 + seed);
        let scene = scene(&mut random, tissue);
        let rigid = Pose {
            position_mm: 300.0 * vector(&mut random),
            orientation: DQuat::from_scaled_axis(3.0 * vector(&mut random)),
        };
        let there = moved(&scene, |v| rigid.transform_point(v.as_dvec3()).as_vec3(), false);
        let settings = small(1, 1);
        let mut a = renderer(&scene, &probe(seed), &settings, &ShaderSet::default());
        let mut b = renderer(&there, &probe(seed), &settings, &ShaderSet::default());
        for _ in 0..3 {
            let pose = pose(&mut random);
            let (one, other) = (frame(&mut a, &pose), frame(&mut b, &(rigid * pose)));
            let inside = one.mask.iter().filter(|&&m| m == 255).count();
            let differ = one.segmentation.iter().zip(&other.segmentation).filter(|(a, b)| a != b).count();
            // Vertices 500 mm away are rounded to 3·10⁻⁵ mm, which matters for pixels that a boundary bisects.
            println!("seed {seed}: {differ} of {inside} pixels");
            assert!(differ * 200 <= inside, "seed {seed}: {differ} of {inside} pixels");
        }
    }
}

#[test]
fn a_mirrored_scene_gives_the_mirrored_image() {
    // Without grain and chance: neither the lattice nor random numbers are mirrored.
    let quiet = |random: &mut SplitMix64| Tissue {
        attenuation_db_cm_mhz: random.between(0.0, 1.0),
        ..silent(random.between(1450.0, 1600.0), random.between(1.4, 1.8))
    };
    for seed in 0..3 {
        let mut random = SplitMix64::new(3000 + seed);
        let scene = scene(&mut random, quiet);
        let mirror = moved(&scene, |v| Vec3::new(-v.x, v.y, v.z), true);
        let mut settings = small(1, 1);
        (settings.image.dynamic_range_db, settings.image.gain_db) = (120.0, 20.0);
        let mut a = renderer(&scene, &probe(seed), &settings, &ShaderSet::default());
        let mut b = renderer(&mirror, &probe(seed), &settings, &ShaderSet::default());
        let (one, other) = (frame(&mut a, &at(0.0, 0.0, 0.0)), frame(&mut b, &at(0.0, 0.0, 0.0)));
        let width = one.width as usize;
        let mirrored = |i: usize| i - i % width + (width - 1 - i % width);
        let inside: Vec<usize> = (0..one.mask.len()).filter(|&i| one.mask[i] == 255).collect();
        let far = |i: &&usize| one.bmode[**i].abs_diff(other.bmode[mirrored(**i)]) > 4;
        let (grey, tissue) = (
            inside.iter().filter(far).count(),
            inside.iter().filter(|&&i| one.segmentation[i] != other.segmentation[mirrored(i)]).count(),
        );
        println!("seed {seed}: {grey} grey levels and {tissue} tissues of {} pixels", inside.len());
        assert!(inside.iter().all(|&i| other.mask[mirrored(i)] == 255));
        assert!(grey * 50 <= inside.len() && tissue * 100 <= inside.len(), "seed {seed}: {grey} {tissue}");
        assert!(inside.iter().any(|&i| one.bmode[i] > 40), "seed {seed}: a black image proves nothing");
    }
}

#[test]
fn an_interface_transmits_equally_both_ways() {
    let mut random = SplitMix64::new(7);
    for _ in 0..10_000 {
        let [z1, z2] = [(); 2].map(|()| 10f64.powf(random.between(-3.4, 0.9)));
        let [c1, c2] = [(); 2].map(|()| random.between(340.0, 4100.0));
        let cos = random.unit();
        let there = interface(z1, z2, c1, c2, cos);
        if there.cos_transmitted > 0.0 {
            let back = interface(z2, z1, c2, c1, there.cos_transmitted);
            assert!((there.energy_reflection - back.energy_reflection).abs() < 1e-9, "{z1} {z2} {c1} {c2} {cos}");
            assert!((there.pressure_reflection + back.pressure_reflection).abs() < 1e-9);
            let direction = DVec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
            let bent = refracted(c1, c2, DVec3::NEG_Z, direction).unwrap();
            let home = refracted(c2, c1, DVec3::Z, -bent).unwrap();
            assert!((home + direction).length() < 1e-6, "{home} {direction}");
        }
    }
}

#[test]
fn a_stack_of_layers_transmits_equally_from_either_side() {
    for seed in 0..3 {
        let mut random = SplitMix64::new(4000 + seed);
        let mut bench = Bench::new(silent(1540.0, 1.5));
        // Weak interfaces: no random branching.
        for i in 0..5 {
            let layer = Tissue {
                attenuation_db_cm_mhz: random.between(0.0, 1.0),
                ..silent(random.between(1400.0, 1700.0), random.between(1.3, 1.9))
            };
            let layer = bench.tissue(layer);
            let top = 10.03 + 6.0 * f64::from(i);
            bench.add(
                layer,
                i,
                insonify::selftest::bench::slab(glam::DVec2::ZERO, 40.0 - f64::from(i), top, top + 5.97),
            );
        }
        let mut renderer =
            renderer(&bench.scene().unwrap(), &linear(5, 0.5, 64, 60.0), &small(1, 1), &ShaderSet::default());
        let back = Pose::looking(DVec3::new(0.0, 0.0, 50.0), DVec3::NEG_Z, DVec3::X);
        let passed = [at(0.1, 0.2, 0.0), back].map(|pose| {
            let s = renderer.snapshot(&pose).unwrap();
            let last = s.paths[2].segments.last().copied().unwrap();
            assert_eq!(s.paths[2].segments.len(), 11, "each layer is entered and left");
            last.ln_amplitude(last.start_mm)
        });
        println!("seed {seed}: {passed:?}");
        assert!((passed[0] - passed[1]).abs() < 1e-4 && passed[0] < -1e-3, "seed {seed}: {passed:?}");
    }
}
