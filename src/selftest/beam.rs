//! Echo widths of point targets and of an edge. Axial widths are compared with the pulse; lateral and elevational ones
//! with diffraction of beam and lens.

use glam::DVec2;

use super::bench::{Bench, at, linear, post, silent, slab, small};
use super::fixture::fixture;
use super::measure::{half_width, line, magnitude};
use super::{Check, Family, Rig};
use crate::acoustics::pulse::FWHM_PER_SIGMA;
use crate::render::RenderError;
use crate::settings::Apodization;
use crate::transducer::{Probe, ProbeKind};

/// Depths of the posts (point targets), mm.
const POSTS_MM: [f64; 3] = [30.0, 70.0, 120.0];
/// Depth of the edge that measures the elevational width, mm.
const EDGE_MM: f64 = 30.0;
/// Rays and layers of frames of the edge.
const PATHS: (u32, u32) = (128, 5);
/// Share of a Gaussian's integral below −σ.
const BELOW_SIGMA: f64 = 0.158_655_253_931_457_05;

/// Positions of the two specimens: posts along a fan's scanlines, and an edge.
pub(super) struct Beam {
    posts: DVec2,
    edge: DVec2,
}

fn fan() -> Probe {
    Probe { kind: ProbeKind::Convex { radius_mm: 40.0, fov_deg: 20.0 }, ..Probe::default() }
}

/// Two-way lateral width of the default beam at a depth, mm, from an independent diffraction sum over the aperture.
fn lateral_width_mm(apodization: Apodization, depth_mm: f64) -> f64 {
    let key = format!("{},8,20,70,{depth_mm}", apodization.name());
    fixture(include_str!("../../tests/truth/point_spread.csv"), &key, "flat_width_mm")
}

/// Scanline along which post number `i` stands.
fn post_line(i: usize) -> u32 {
    let posts = POSTS_MM.len() as u32;
    (2 * i as u32 + 1) * fan().scanlines / (2 * posts)
}

/// Middle of the sample that holds a depth, mm. An echo there has the length of the pulse: between samples it is longer.
fn middle_of_sample_mm(depth_mm: f64) -> f64 {
    let spacing_mm = fan().sample_spacing_mm();
    ((depth_mm / spacing_mm).floor() + 0.5) * spacing_mm
}

impl Beam {
    pub(super) fn new(bench: &mut Bench) -> Self {
        let (posts, edge) = (bench.place(), bench.place());
        let target = bench.tissue(silent(1540.0, 1.7));
        for (i, &depth) in POSTS_MM.iter().enumerate() {
            bench.add(target, 1, post(posts.extend(0.0), &fan(), post_line(i), middle_of_sample_mm(depth), 300.0));
        }
        // The slab's edge lies at y = 0 of the specimen's position.
        bench.add(target, 1, slab(edge + DVec2::new(0.0, 20.0), 20.0, EDGE_MM, 45.0));
        Self { posts, edge }
    }
}

impl Family for Beam {
    fn groups(&self) -> &'static [&'static str] {
        &["Point spread"]
    }

    fn measure(&self, rig: &mut Rig) -> Result<Vec<Check>, RenderError> {
        let mut checks = Vec::new();
        let probe = fan();
        let frame = rig.frame(&probe, &small(1, 1), &at(self.posts.x, self.posts.y, 0.0))?;
        let spacing = probe.sample_spacing_mm();
        for (i, &depth) in POSTS_MM.iter().enumerate() {
            let sample = (depth / spacing) as usize;
            let reach = (1.0 / spacing) as usize;
            let envelope: Vec<f64> = line(&probe, frame, post_line(i)).iter().map(|&s| magnitude(s)).collect();
            let near = envelope.get(sample - reach..sample + reach).unwrap_or_default();
            let want = FWHM_PER_SIGMA * probe.axial_sigma_mm();
            let name = format!("axial width at {depth:.0} mm");
            checks.push(Check::new("Point spread", name, "mm", want, half_width(near) * spacing, 0.02 * want));
        }
        for apodization in [Apodization::Rectangular, Apodization::Hann, Apodization::Gaussian] {
            let probe = Probe { apodization, ..probe };
            let frame = rig.frame(&probe, &small(1, 1), &at(self.posts.x, self.posts.y, 0.0))?;
            for (i, &depth) in POSTS_MM.iter().enumerate() {
                let want = lateral_width_mm(apodization, depth);
                let sample = (depth / spacing) as usize;
                let neighbours = probe.scanlines / (2 * POSTS_MM.len() as u32);
                let across: Vec<f64> = (post_line(i) - neighbours..post_line(i) + neighbours)
                    .map(|l| line(&probe, frame, l).get(sample).map_or(0.0, |&s| magnitude(s)))
                    .collect();
                let name = format!("lateral width at {depth:.0} mm, {}", apodization.name());
                let got = half_width(&across) * probe.line_spacing_mm(depth);
                checks.push(Check::new("Point spread", name, "mm", want, got, 0.05 * want));
            }
        }
        // As the probe moves across the edge, the share of the beam on the slab grows like the integral of a Gaussian.
        // The wide aperture also receives the echoes of oblique paths.
        let near = Probe { aperture_mm: 80.0, ..linear(1, 1.0, 256, 50.0) };
        let far = Probe { elevational_height_mm: 8.0, elevational_focus_mm: 20.0, ..near };
        for (probe, side) in [(near, "before"), (far, "beyond")] {
            let mut amplitude = |y: f64| {
                let frame = rig.frame(&probe, &small(PATHS.0, PATHS.1), &at(self.edge.x, self.edge.y + y, 0.0))?;
                // Excludes depths beyond the edge, where paths hit the side of the slab.
                let [from, to] = [EDGE_MM - 0.1, EDGE_MM + 0.2].map(|mm| (mm / probe.sample_spacing_mm()) as usize);
                let edge = line(&probe, frame, 0).get(from..to).unwrap_or_default();
                Ok::<_, RenderError>(edge.iter().map(|&s| magnitude(s)).fold(0.0, f64::max))
            };
            let (none, all) = (amplitude(-10.0)?, amplitude(10.0)?);
            let mut place = |part: f64| {
                let (mut low, mut high) = (-10.0, 10.0);
                for _ in 0..12 {
                    let middle = 0.5 * (low + high);
                    if amplitude(middle)? > none + part * (all - none) { high = middle } else { low = middle }
                }
                Ok::<_, RenderError>(0.5 * (low + high))
            };
            let got = FWHM_PER_SIGMA * 0.5 * (place(1.0 - BELOW_SIGMA)? - place(BELOW_SIGMA)?);
            let want = FWHM_PER_SIGMA * probe.elevational_sigma_mm(EDGE_MM);
            let name = format!("elevational width at {EDGE_MM:.0} mm, {side} the focus");
            // The widths that straight paths give agree with diffraction within 10 %.
            checks.push(Check::new("Point spread", name, "mm", want, got, 0.1 * want));
        }
        Ok(checks)
    }
}
