//! Tests of segmentation and attenuation maps against exact cross-sections.

use glam::{DQuat, DVec2, DVec3, Vec3};
use insonify::anatomy::{Mesh, Scene, Tissue, analytic};
use insonify::pose::Pose;
use insonify::render::{Frame, RenderSettings};
use insonify::transducer::{Probe, ProbeKind, Sector};

use super::bench::{Bench, Rig, at, silent};

const FREQUENCY_MHZ: f64 = 8.0;

/// Renderers with the paper's image size and a small one, each with a convex, a linear and a phased probe.
fn rigs(scene: &Scene) -> Vec<Rig> {
    let kinds = [
        ProbeKind::Convex { radius_mm: 40.0, fov_deg: 70.0 },
        ProbeKind::Linear { width_mm: 160.0 },
        ProbeKind::Phased { fov_deg: 80.0 },
    ];
    let mut rigs = Vec::new();
    for kind in kinds {
        for (width, height) in [(1386, 1000), (203, 151)] {
            let probe = Probe { kind, scanlines: 32, samples: 512.into(), ..Probe::default() };
            let mut settings = RenderSettings::default();
            (settings.image.width, settings.image.height) = (width, height);
            rigs.push(Rig::new(scene, &probe, &settings));
        }
    }
    rigs
}

/// A tissue that attenuates by `alpha` dB/cm/MHz.
fn lossy(alpha: f64) -> Tissue {
    Tissue { attenuation_db_cm_mhz: alpha, ..silent(1540.0, 1.6) }
}

fn poses() -> Vec<Pose> {
    let tilt = DQuat::from_euler(glam::EulerRot::XYZ, 0.1, 0.2, 2.0);
    vec![
        at(0.0, 0.0, 0.0),
        at(21.3, 4.0, -7.7),
        // The sphere's centre on the face, and the face inside the sphere.
        at(0.0, 0.0, 70.0),
        Pose { position_mm: DVec3::new(-11.0, 13.0, 9.0), orientation: tilt },
    ]
}

#[test]
fn a_sphere_is_segmented_within_a_pixel() {
    // Fluid in tissue, equal attenuation, almost equal over a long path, and much stronger.
    for (around, within) in [(0.5, 0.0), (0.5, 0.5), (2.0, 2.05), (0.1, 4.0)] {
        let (radius, centre) = (20.0, DVec3::new(0.0, 0.0, 70.0));
        let mut bench = Bench::new(lossy(around));
        let sphere = bench.tissue(lossy(within));
        bench.add(sphere, 1, analytic::sphere(centre.as_vec3(), radius as f32, 6));
        let mut rigs = rigs(&bench.scene().unwrap());
        if (around, within) != (0.5, 0.0) {
            rigs.truncate(2);
        }
        for rig in &mut rigs {
            for pose in poses() {
                let frame = rig.frame(&pose);
                let sector = rig.sector();
                let local = pose.orientation.inverse() * (centre - pose.position_mm);
                let circle_radius = (radius * radius - local.y * local.y).max(0.0).sqrt();
                let middle = DVec2::new(local.x, local.z);
                let mut worst = 0.0_f64;
                for (i, &label) in frame.segmentation.iter().enumerate().filter(|(_, l)| **l > 0) {
                    let out = (pixel(&sector, i) - middle).length() - circle_radius;
                    if (out < 0.0) != (usize::from(label) == sphere + 1) {
                        worst = worst.max(out.abs() / sector.pixel_mm);
                    }
                }
                println!("{:?} {}: {worst:.3} pixels", rig.probe.kind, sector.width);
                assert!(worst <= 1.0, "{:?}, {} pixels wide: {worst} pixels off", rig.probe.kind, sector.width);
            }
        }
    }
}

fn pixel(sector: &Sector, index: usize) -> DVec2 {
    let (column, row) = (index as u32 % sector.width, index as u32 / sector.width);
    sector.pixel_centre_mm(column, row)
}

/// Half-spaces `normal · p ≥ offset` of the scene with their attenuations, dB/cm/MHz. Later ones have priority.
struct Layers {
    layers: Vec<(DVec3, f64, f64)>,
    background: f64,
}

impl Layers {
    /// One-way attenuation between two points of the scene, nepers.
    fn nepers(&self, from: DVec3, to: DVec3) -> f64 {
        let length = (to - from).length();
        let mut cuts = vec![0.0, 1.0];
        for &(normal, offset, _) in &self.layers {
            let (a, b) = (normal.dot(from) - offset, normal.dot(to) - offset);
            if (a < 0.0) != (b < 0.0) {
                cuts.push(a / (a - b));
            }
        }
        cuts.sort_by(f64::total_cmp);
        let rate = |at: f64| {
            let point = from.lerp(to, at);
            let top = self.layers.iter().rev().find(|(normal, offset, _)| normal.dot(point) >= *offset);
            lossy(top.map_or(self.background, |l| l.2)).attenuation_np_mm(FREQUENCY_MHZ)
        };
        cuts.windows(2).map(|w| (w[1] - w[0]) * length * rate(0.5 * (w[0] + w[1]))).sum()
    }

    fn scene(&self) -> Scene {
        let mut bench = Bench::new(lossy(self.background));
        for (i, &(normal, offset, alpha)) in self.layers.iter().enumerate() {
            let tissue = bench.tissue(lossy(alpha));
            bench.add(tissue, i as i32, half_space(normal, offset));
        }
        bench.scene().unwrap()
    }
}

/// A box so large that it fills `normal · p ≥ offset` within the depth of any probe here.
fn half_space(normal: DVec3, offset: f64) -> Mesh {
    let size = 800.0;
    let rotation = DQuat::from_rotation_arc(DVec3::Z, normal);
    analytic::plate((normal * (offset + 0.5 * size)).as_vec3(), Vec3::splat(size as f32), rotation.as_quat())
}

/// Index and one-way level of pixels of the sector, along the straight ray to each.
fn exact(layers: &Layers, probe: &Probe, sector: &Sector, pose: &Pose, frame: &Frame) -> Vec<(usize, f64)> {
    let inside = (0..frame.mask.len()).filter(|&i| frame.mask[i] == 255);
    // Every seventh pixel of a large image.
    inside
        .step_by(if sector.width > 1000 { 7 } else { 1 })
        .filter_map(|i| {
            let (fraction, depth) = Sector::polar(probe, pixel(sector, i))?;
            let (origin, direction) = probe.ray(probe.lateral_coordinate(fraction));
            let (from, to) = (pose.transform_point(origin), pose.transform_point(origin + direction * depth));
            Some((i, (-layers.nepers(from, to)).exp()))
        })
        .collect()
}

/// One-way level that 2 % of the sector's area exceed. The sector is divided into strips of equal angle or width, and
/// these into equal steps of depth.
fn percentile_98(layers: &Layers, probe: &Probe, pose: &Pose) -> f64 {
    let (strips, steps) = (160, 1500);
    let mut levels = Vec::with_capacity(strips * steps);
    for strip in 0..strips {
        let (origin, direction) = probe.ray(probe.lateral_coordinate((strip as f64 + 0.5) / strips as f64));
        for step in 0..steps {
            let depth = (step as f64 + 0.5) / steps as f64 * probe.depth_mm;
            let (from, to) = (pose.transform_point(origin), pose.transform_point(origin + direction * depth));
            levels.push(((-layers.nepers(from, to)).exp(), probe.line_spacing_mm(depth)));
        }
    }
    levels.sort_by(|a, b| b.0.total_cmp(&a.0));
    let wanted = 0.02 * levels.iter().map(|l| l.1).sum::<f64>();
    let mut sum = 0.0;
    let above = levels.iter().find(|l| {
        sum += l.1;
        sum >= wanted
    });
    above.unwrap().0
}

#[test]
fn attenuation_of_slabs_follows_beer_and_lambert() {
    let tilted = |degrees: f64| DQuat::from_rotation_y(degrees.to_radians()) * DVec3::Z;
    let scenes = [
        // One slab in lossless fluid.
        Layers { layers: vec![(DVec3::Z, 40.0, 0.5), (DVec3::Z, 90.0, 0.0)], background: 0.0 },
        // Several slabs.
        Layers {
            layers: vec![(DVec3::Z, 10.0, 0.48), (DVec3::Z, 35.0, 0.7), (DVec3::Z, 70.0, 0.35), (DVec3::Z, 95.0, 0.6)],
            background: 0.1,
        },
        // An oblique slab.
        Layers { layers: vec![(tilted(20.0), 45.0, 0.45), (tilted(-8.0), 100.0, 0.2)], background: 0.3 },
    ];
    for layers in &scenes {
        for rig in &mut rigs(&layers.scene()) {
            for pose in [at(0.0, 0.0, 0.0), at(13.0, 2.0, 6.0)] {
                let frame = rig.frame(&pose);
                let sector = rig.sector();
                let exact = exact(layers, &rig.probe, &sector, &pose, &frame);
                let p98 = f64::from(frame.attenuation_p98);
                let (mut worst, mut counted) = (0.0_f64, 0);
                for &(i, want) in &exact {
                    let level = f64::from(frame.attenuation[i]);
                    if level < 1.0 {
                        worst = worst.max((level * p98 / want - 1.0).abs());
                        counted += 1;
                    } else {
                        assert!(want / p98 > 0.999, "clipped at {want}, 98th percentile {p98}");
                    }
                }
                let want = percentile_98(layers, &rig.probe, &pose);
                println!("{:?} {}: {worst:.1e}, p98 {:.1e}", rig.probe.kind, sector.width, p98 / want - 1.0);
                assert!(counted * 10 >= exact.len() * 5);
                assert!(worst <= 1e-3, "{:?}, {} wide: off by {worst}", rig.probe.kind, sector.width);
                assert!((p98 / want - 1.0).abs() <= 2e-3, "98th percentile {p98}, expected {want}");
            }
        }
    }
}
