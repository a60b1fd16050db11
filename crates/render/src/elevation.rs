//! Elevational offsets of paths: straight lines that together fill the beam's thickness.
//!
//! The beam's width is √(waist² + (start + slope·z)²) at depth z. Lines have that spread if their offset is the sum of
//! a waist part and a cone part, both Gaussian and independent. All lines of the cone meet at the focus, so the slice
//! keeps its thickness there.

use glam::{DMat2, DMat3, DVec2, DVec3};
use rayon::prelude::*;

use insonify_core::transducer::Probe;

/// Number of depths at which the beam's width is computed.
const DEPTHS: u32 = 20;
/// Fractional part of the golden ratio: turns between neighbouring points of a spiral.
const GOLDEN: f64 = 0.618_033_988_749_894_9;
/// Generator of the order in which the points of a layer go to the rays of a scanline: the inverse of the plastic
/// number.
const ORDER: f64 = 0.754_877_666_246_692_8;

/// Width of the elevational beam against depth, as the parameters of a waist and a cone.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Envelope {
    waist_mm: f64,
    start_mm: f64,
    slope: f64,
}

/// Elevational position of each path of a scanline [angles × layers × rays]: offset at the face (mm), slope (mm per mm
/// of ray), length of ray per mm of depth, and 0. A single layer is the image plane.
///
/// Each steering angle has its own offsets, so a compounded picture samples the slice with the paths of all its angles.
/// A dozen paths alone may miss an object that fills a hundredth of the beam.
pub(crate) fn elevations(probe: &Probe, rays: u32, layers: u32, angles: u32) -> Vec<[f32; 4]> {
    if layers == 1 {
        return vec![[0.0, 0.0, 1.0, 0.0]; (angles * rays) as usize];
    }
    let envelope = Envelope::of(probe);
    let line = |[waist, cone]: [f64; 2]| {
        let slope = cone * envelope.slope;
        [waist * envelope.waist_mm + cone * envelope.start_mm, slope, slope.hypot(1.0), 0.0].map(|v| v as f32)
    };
    (0..angles).flat_map(|angle| places(rays, layers, f64::from(angle) / f64::from(angles))).map(line).collect()
}

impl Envelope {
    /// Fits the envelope to the standard deviations of the elevational beam, by least squares of relative errors.
    fn of(probe: &Probe) -> Self {
        let parts = (0..DEPTHS).into_par_iter().map(|i| (f64::from(i) + 0.5) / f64::from(DEPTHS));
        let widths: Vec<_> = parts.map(|part| (part, probe.elevational_sigma_mm(part * probe.depth_mm))).collect();
        let (mut normal, mut right) = (DMat3::ZERO, DVec3::ZERO);
        for (part, sigma) in &widths {
            let row = DVec3::new(1.0, *part, part * part) / (sigma * sigma);
            normal += DMat3::from_cols(row * row.x, row * row.y, row * row.z);
            right += row;
        }
        let square = normal.inverse() * right;
        let slope = square.z.max(0.0).sqrt();
        let start_mm = 0.5 * square.y / slope;
        let waist2 = square.x - start_mm * start_mm;
        if slope > 0.0 && waist2 >= 0.0 {
            return Self { waist_mm: waist2.sqrt(), start_mm, slope: slope / probe.depth_mm };
        }
        // An image that ends far from the focus has no waist: the width is a line.
        let (mut normal, mut right) = (DMat2::ZERO, DVec2::ZERO);
        for (part, sigma) in &widths {
            let row = DVec2::new(1.0, *part) / *sigma;
            normal += DMat2::from_cols(row * row.x, row * row.y);
            right += row;
        }
        let line = normal.inverse() * right;
        Self { waist_mm: 0.0, start_mm: line.x, slope: line.y / probe.depth_mm }
    }
}

/// Waist and cone parts of `rays` × `layers` paths, in standard deviations. All points weigh the same; both parts have
/// mean 0, variance 1 and covariance 0. Each layer has one part of the cone; in a layer, neighbouring rays are far
/// apart. `turned` rotates the pattern, in turns.
fn places(rays: u32, layers: u32, turned: f64) -> Vec<[f64; 2]> {
    let count = rays * layers;
    // A spiral with Gaussian density.
    let point = |i: u32| {
        let radius = (-2.0 * (1.0 - (f64::from(i) + 0.5) / f64::from(count)).ln()).sqrt();
        let angle = std::f64::consts::TAU * (f64::from(i) * GOLDEN + turned).fract();
        [radius * angle.cos(), radius * angle.sin()]
    };
    let mut points: Vec<[f64; 2]> = (0..count).map(point).collect();
    standardise(&mut points);
    points.sort_by(|a, b| a[1].total_cmp(&b[1]));
    let mut order: Vec<usize> = (0..rays as usize).collect();
    order.sort_by(|&a, &b| (a as f64 * ORDER).fract().total_cmp(&(b as f64 * ORDER).fract()));
    let mut sorted = vec![[0.0; 2]; points.len()];
    for (sorted, layer) in sorted.chunks_exact_mut(rays as usize).zip(points.chunks_exact(rays as usize)) {
        for (&ray, point) in order.iter().zip(layer) {
            sorted[ray] = *point;
        }
    }
    sorted
}

/// Scales and shears points to mean 0, variance 1 and covariance 0. For two points, the first coordinates (waist parts)
/// become 0.
fn standardise(points: &mut [[f64; 2]]) {
    let per_point = 1.0 / points.len() as f64;
    let mean = |points: &[[f64; 2]], of: fn(&[f64; 2]) -> f64| points.iter().map(of).sum::<f64>() * per_point;
    let means = [mean(points, |p| p[0]), mean(points, |p| p[1])];
    points.iter_mut().for_each(|p| *p = [p[0] - means[0], p[1] - means[1]]);
    let deviation = mean(points, |p| p[1] * p[1]).sqrt();
    points.iter_mut().for_each(|p| p[1] /= deviation);
    let shared = mean(points, |p| p[0] * p[1]);
    points.iter_mut().for_each(|p| p[0] -= shared * p[1]);
    let deviation = mean(points, |p| p[0] * p[0]).sqrt();
    let scale = if deviation > 1e-6 { 1.0 / deviation } else { 0.0 };
    points.iter_mut().for_each(|p| p[0] *= scale);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Standard deviation of the lines' offsets at a depth, mm.
    fn spread_mm(lines: &[[f32; 4]], depth: f64) -> f64 {
        let square = |l: &[f32; 4]| (f64::from(l[0]) + f64::from(l[1]) * depth).powi(2);
        (lines.iter().map(square).sum::<f64>() / lines.len() as f64).sqrt()
    }

    #[test]
    fn one_layer_is_the_image_plane() {
        assert_eq!(elevations(&Probe::default(), 3, 1, 1), vec![[0.0, 0.0, 1.0, 0.0]; 3]);
    }

    #[test]
    fn lines_of_any_number_have_the_spread_of_the_beam() {
        let probe = Probe::default();
        let Envelope { waist_mm, start_mm, slope } = Envelope::of(&probe);
        for (rays, layers) in [(1, 3), (2, 3), (7, 2), (32, 3), (128, 33), (256, 33)] {
            let lines = elevations(&probe, rays, layers, 1);
            assert_eq!(lines.len(), (rays * layers) as usize);
            for depth in [0.0, 35.0, 70.0, 150.0] {
                let want = waist_mm.hypot(start_mm + slope * depth);
                let got = spread_mm(&lines, depth);
                assert!((got / want - 1.0).abs() < 1e-4, "{rays}x{layers} at {depth} mm: {got}, not {want}");
                let mean = lines.iter().map(|l| f64::from(l[0]) + f64::from(l[1]) * depth).sum::<f64>();
                assert!((mean / lines.len() as f64).abs() < 1e-4 * want);
            }
        }
    }

    #[test]
    fn lines_have_the_gaussian_profile_of_the_beam_at_every_depth() {
        let probe = Probe::default();
        let lines = elevations(&probe, 32, 3, 1);
        for depth in [10.0, 40.0, 60.0, 70.0, 80.0, 120.0, 150.0] {
            let sigma = spread_mm(&lines, depth);
            for (sigmas, want) in [(-2.0, 0.0228), (-1.0, 0.1587), (-0.5, 0.3085), (0.0, 0.5), (1.0, 0.8413)] {
                let below = lines.iter().filter(|l| f64::from(l[0]) + f64::from(l[1]) * depth < sigmas * sigma).count();
                let got = below as f64 / lines.len() as f64;
                assert!((got - want).abs() < 0.035, "{got}, not {want}, below {sigmas} sigma at {depth} mm");
            }
        }
    }

    #[test]
    fn angles_have_places_of_their_own_which_fill_the_beam_together() {
        let probe = Probe::default();
        let (one, nine) = (elevations(&probe, 4, 3, 1), elevations(&probe, 4, 3, 9));
        assert_eq!((one.len(), nine.len()), (12, 9 * 12));
        assert_eq!(one[..], nine[..12]);
        // Largest error of the fraction of the beam beyond an offset.
        let beyond = |lines: &[[f32; 4]]| {
            let mut worst = 0.0_f64;
            for depth in [20.0, 40.0, 60.0, 80.0, 110.0, 140.0] {
                let sigma = spread_mm(lines, depth);
                for (sigmas, want) in [(1.5, 0.0668), (2.0, 0.0228), (2.5, 0.0062)] {
                    for side in [-1.0, 1.0] {
                        let out = |l: &&[f32; 4]| side * (f64::from(l[0]) + f64::from(l[1]) * depth) > sigmas * sigma;
                        worst = worst.max((lines.iter().filter(out).count() as f64 / lines.len() as f64 - want).abs());
                    }
                }
            }
            worst
        };
        assert!(beyond(&one) > 0.05, "{}", beyond(&one));
        assert!(beyond(&nine) < 0.025, "{}", beyond(&nine));
    }

    #[test]
    fn envelopes_follow_lenses_with_and_without_a_waist() {
        let lenses = [
            Probe::default(),
            Probe { frequency_mhz: 2.5, elevational_focus_mm: 80.0, depth_mm: 160.0, ..Probe::default() },
            Probe { depth_mm: 75.0, ..Probe::default() },
            Probe { depth_mm: 50.0, ..Probe::default() },
            Probe { elevational_height_mm: 8.0, elevational_focus_mm: 20.0, depth_mm: 50.0, ..Probe::default() },
        ];
        for probe in lenses {
            let Envelope { waist_mm, start_mm, slope } = Envelope::of(&probe);
            for part in [0.1, 0.3, 0.5, 0.7, 0.9] {
                let depth = part * probe.depth_mm;
                let (got, want) = (waist_mm.hypot(start_mm + slope * depth), probe.elevational_sigma_mm(depth));
                assert!((got / want - 1.0).abs() < 0.25, "{probe:?} at {depth} mm: {got}, not {want}");
            }
        }
    }

    #[test]
    fn layers_have_parts_of_the_cone() {
        let lines = elevations(&Probe::default(), 32, 3, 1);
        let slopes = |layer: usize| lines[32 * layer..32 * (layer + 1)].iter().map(|l| l[1]);
        let (most, least) = (slopes(0).fold(f32::MIN, f32::max), slopes(1).fold(f32::MAX, f32::min));
        assert!(most <= least && slopes(1).fold(f32::MIN, f32::max) <= slopes(2).fold(f32::MAX, f32::min));
    }
}
