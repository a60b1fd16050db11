//! Measurements in images of the QA phantom: distances, resolution, contrast, cysts, penetration.
//!
//! The layout is that of [`crate::anatomy::specimens::qa`], seen by a linear probe with its face on z = 0, centred at x
//! = 0. As on a scanner, everything is measured on the displayed image: a grey level is a level in dB above black.
//! Definitions follow the AIUM's "Methods for Measuring Performance of Pulse-Echo Ultrasound Equipment" in spirit; each
//! field gives its exact definition.

mod imaging;
mod table;

pub use imaging::{QaError, check_probe, check_scene, image_and_measure};

use glam::DVec2;
use serde::Serialize;

use crate::anatomy::specimens::qa;
use crate::statistics::slope;
use crate::transducer::{Probe, Sector};

use super::levels::Levels;

/// Least dip between two resolved wires, below the weaker of them, dB.
pub const RESOLVED_DIP_DB: f64 = 3.0;
/// Least mean level of visible background above black, dB.
pub const SEEN_DB: f64 = 3.0;

/// A distance between two wires.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Distance {
    /// `vertical` or `horizontal`.
    pub direction: &'static str,
    /// Depth of the first wire, mm.
    pub depth_mm: f64,
    /// True distance, mm.
    pub true_mm: f64,
    /// Distance between the centres of the pixels within 10 dB of each wire's peak, mm.
    pub measured_mm: f64,
}

/// A grey-scale target.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Contrast {
    /// True contrast: scattered power relative to the background's, dB.
    pub true_db: f64,
    /// Mean level of the target's middle (0.8 of its diameter) minus that of the background just above and below, dB.
    pub measured_db: f64,
}

/// An anechoic cylinder.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Cyst {
    /// Diameter, mm.
    pub diameter_mm: f64,
    /// Depth of its centre, mm.
    pub depth_mm: f64,
    /// Mean level of the background minus that of the cylinder's middle half, dB.
    pub void_db: f64,
}

/// Size of the image of one wire.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Widths {
    /// Depth of the wire, mm.
    pub depth_mm: f64,
    /// Full width at half the amplitude (−6 dB) across the scanlines, mm.
    pub lateral_mm: f64,
    /// Expected lateral width: that of the beam combined with the wire's own, mm.
    pub lateral_expected_mm: f64,
    /// Full width at half the amplitude along the scanlines, mm.
    pub axial_mm: f64,
    /// Expected axial width: that of the pulse plus the delay between the wire's two sides, mm.
    pub axial_expected_mm: f64,
}

/// Two wires side by side or one behind the other.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Pair {
    /// `axial` or `lateral`.
    pub direction: &'static str,
    /// Depth of the group, mm.
    pub depth_mm: f64,
    /// Centre to centre, mm.
    pub apart_mm: f64,
    /// Dip of the level between them, along that direction, below the weaker of the two, dB.
    pub dip_db: f64,
}

impl Pair {
    /// True if they are seen as two: a dip of at least [`RESOLVED_DIP_DB`].
    pub fn is_resolved(&self) -> bool {
        self.dip_db >= RESOLVED_DIP_DB
    }
}

/// Depth to which the background is visible.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Penetration {
    /// Depth to which the background's mean level stays [`SEEN_DB`] above black, mm.
    pub seen_mm: f64,
    /// True if that is the bottom of the image.
    pub whole_depth: bool,
    /// Change of the background's level with depth, dB/cm: a straight-line fit over the visible depths, from 1 cm on.
    pub slope_db_cm: f64,
    /// Depth (mm) and mean level (dB above black) of the background, in steps of 5 mm.
    pub levels: Vec<(f64, f64)>,
}

/// All measurements.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct QaReport {
    /// Distances, vertical ones first.
    pub distances: Vec<Distance>,
    /// Grey-scale targets, from left to right.
    pub contrast: Vec<Contrast>,
    /// Anechoic cylinders.
    pub cysts: Vec<Cyst>,
    /// Images of the wires of the vertical group.
    pub widths: Vec<Widths>,
    /// Pairs of the resolution groups.
    pub pairs: Vec<Pair>,
    /// Penetration.
    pub penetration: Penetration,
}

/// Measures all targets of the phantom within `probe`'s depth. `levels` holds at least one image; several, taken at
/// different y along the targets, average the speckle.
pub fn measure(levels: &Levels, probe: &Probe) -> QaReport {
    let seen = |depth: f32| f64::from(depth) + 2.0 < probe.depth_mm;
    QaReport {
        distances: distances(levels, seen),
        contrast: if seen(qa::CONTRAST_DEPTH_MM + 10.0) { contrasts(levels) } else { Vec::new() },
        cysts: qa::CYSTS_MM.into_iter().filter(|c| seen(c.1 + 9.0)).map(|c| cyst(levels, c)).collect(),
        widths: (0..qa::VERTICAL_COUNT)
            .map(qa::vertical)
            .filter(|&(_, depth)| seen(depth + 3.0))
            .map(|place| widths(levels, probe, place))
            .collect(),
        pairs: qa::RESOLUTION_DEPTHS_MM
            .into_iter()
            .filter(|&d| seen(d + 12.0))
            .flat_map(|d| pairs(levels, d))
            .collect(),
        penetration: penetration(levels, probe),
    }
}

fn distances(levels: &Levels, seen: impl Fn(f32) -> bool) -> Vec<Distance> {
    let mut found = Vec::new();
    let vertical: Vec<_> = (0..qa::VERTICAL_COUNT).map(qa::vertical).filter(|&(_, depth)| seen(depth)).collect();
    for pair in vertical.windows(2) {
        found.push(distance(levels, "vertical", pair[0], pair[1]));
    }
    if let [first, .., last] = vertical[..] {
        found.push(distance(levels, "vertical", first, last));
    }
    for depth in qa::HORIZONTAL_DEPTHS_MM.into_iter().filter(|&depth| seen(depth)) {
        let row = qa::HORIZONTAL_MM.map(|x| (x, depth));
        for pair in row.windows(2) {
            found.push(distance(levels, "horizontal", pair[0], pair[1]));
        }
        found.push(distance(levels, "horizontal", row[0], row[row.len() - 1]));
    }
    found
}

fn distance(levels: &Levels, direction: &'static str, from: (f32, f32), to: (f32, f32)) -> Distance {
    let apart = wire_mm(levels, to) - wire_mm(levels, from);
    let (measured_mm, true_mm) = match direction {
        "vertical" => (apart.y, to.1 - from.1),
        _ => (apart.x, to.0 - from.0),
    };
    Distance { direction, depth_mm: from.1.into(), true_mm: true_mm.into(), measured_mm }
}

fn contrasts(levels: &Levels) -> Vec<Contrast> {
    let z = f64::from(qa::CONTRAST_DEPTH_MM);
    let measured = qa::CONTRAST.map(|(x, true_db, _)| {
        let x = f64::from(x);
        let disc = |dz: f64, radius: f64| levels.disc_db(DVec2::new(x, z + dz), radius);
        let around = 0.5 * (disc(-7.6, 2.4) + disc(7.6, 2.4));
        let middle = 0.4 * f64::from(qa::CONTRAST_DIAMETER_MM);
        Contrast { true_db, measured_db: disc(0.0, middle) - around }
    });
    measured.to_vec()
}

fn cyst(levels: &Levels, (x, depth, diameter): (f32, f32, f32)) -> Cyst {
    let (x, depth_mm, diameter_mm) = (f64::from(x), f64::from(depth), f64::from(diameter));
    let disc = |dz: f64, radius: f64| levels.disc_db(DVec2::new(x, depth_mm + dz), radius);
    let around = 0.5 * (disc(-7.0, 1.5) + disc(7.0, 1.5));
    Cyst { diameter_mm, depth_mm, void_db: around - disc(0.0, 0.25 * diameter_mm) }
}

/// Measured position of the wire near (x, depth): centre of the pixels within 10 dB of its peak, mm.
pub(crate) fn wire_mm(levels: &Levels, (x, depth): (f32, f32)) -> DVec2 {
    let box_mm = (DVec2::new(x.into(), f64::from(depth) + 0.1), DVec2::new(1.6, 0.5));
    let peak = levels.pixels(box_mm).map(|(_, power)| power).fold(0.0, f64::max);
    let mut weight = 0.0;
    let mut sum = DVec2::ZERO;
    for (place, power) in levels.pixels(box_mm).filter(|&(_, power)| power >= 0.1 * peak) {
        sum += place * power;
        weight += power;
    }
    sum / weight.max(f64::MIN_POSITIVE)
}

fn widths(levels: &Levels, probe: &Probe, place: (f32, f32)) -> Widths {
    use crate::acoustics::pulse::FWHM_PER_SIGMA;
    let depth_mm = f64::from(place.1);
    let at = wire_mm(levels, place);
    // Speckle beside the wire: its power adds to the wire's.
    let noise = levels.box_power((at + DVec2::new(0.0, 2.5), DVec2::new(3.0, 0.8)));
    let wire = f64::from(qa::WIRE_MM);
    let beam = FWHM_PER_SIGMA * probe.lateral_sigma_mm(depth_mm);
    Widths {
        depth_mm,
        lateral_mm: levels.half_width_mm(at, DVec2::X, noise),
        // The second moments of a Gaussian and a box add.
        lateral_expected_mm: (beam.powi(2) + FWHM_PER_SIGMA.powi(2) / 12.0 * wire.powi(2)).sqrt(),
        axial_mm: levels.half_width_mm(at, DVec2::Y, noise),
        // Upper and lower side of the wire echo one after the other; nylon (2600 m/s) is faster than the phantom.
        axial_expected_mm: FWHM_PER_SIGMA * probe.axial_sigma_mm() + wire * 1540.0 / 2600.0,
    }
}

fn pairs(levels: &Levels, depth: f32) -> Vec<Pair> {
    let places = qa::resolution(depth);
    // Axial flights go down on the right, lateral rows to the left; each begins with its own wire.
    let flight = |right: bool| places.iter().copied().filter(move |p| (p.0 > 0.0) == right);
    let along = |direction: &'static str, right: bool| {
        let row: Vec<_> = flight(right).collect();
        row.windows(2).map(move |pair| (direction, pair[0], pair[1])).collect::<Vec<_>>()
    };
    let both = along("axial", true).into_iter().chain(along("lateral", false));
    both.map(|(direction, a, b)| {
        let apart_mm = f64::from(if direction == "axial" { b.1 - a.1 } else { a.0 - b.0 });
        Pair { direction, depth_mm: depth.into(), apart_mm, dip_db: dip_db(levels, direction, a, b) }
    })
    .collect()
}

/// Dip between two wires, dB, on the profile of the brightest level across the direction of interest. It is the least
/// value between the two peaks, below the weaker peak. 0 if they are one peak.
fn dip_db(levels: &Levels, direction: &str, a: (f32, f32), b: (f32, f32)) -> f64 {
    // A wire's echo comes from its upper side.
    let centre = |(x, z): (f32, f32)| DVec2::new(x.into(), f64::from(z) + 0.1);
    let (from, to) = (centre(a), centre(b));
    let (axis, across) = if direction == "axial" { (DVec2::Y, DVec2::X) } else { (DVec2::X, DVec2::Y) };
    let (low, high) = (from.min(to), from.max(to));
    let (start, end) = (low.dot(axis), high.dot(axis));
    // Margin beyond either wire, which includes its peak and excludes its neighbours.
    let margin = (0.3 * (end - start)).min(0.4);
    let (side_from, side_to) = (low.dot(across) - 0.3, high.dot(across) + 0.3);
    let steps = |from: f64, to: f64, step: f64| {
        let n = ((to - from) / step).ceil().max(1.0) as u32;
        (0..=n).map(move |i| from + (to - from) * f64::from(i) / f64::from(n))
    };
    let along: Vec<f64> = steps(start - margin, end + margin, 0.02)
        .map(|t| steps(side_from, side_to, 0.05).map(|s| levels.db_at(axis * t + across * s)).fold(f64::MIN, f64::max))
        .collect();
    let half = along.len() / 2;
    let top = |range: std::ops::Range<usize>| range.max_by(|&i, &j| along[i].total_cmp(&along[j])).unwrap_or(half);
    let (i, j) = (top(0..half), top(half..along.len()));
    let least = along[i..=j].iter().copied().fold(f64::INFINITY, f64::min);
    along[i].min(along[j]) - least
}

fn penetration(levels: &Levels, probe: &Probe) -> Penetration {
    let step = 5.0;
    // The median over the columns suppresses wires and targets.
    let places: Vec<(f64, f64)> = (1..)
        .map(|i| f64::from(i) * step)
        .take_while(|depth| depth + 1.0 < probe.depth_mm)
        .map(|depth| (depth, levels.median_row_db(depth, 1.0)))
        .collect();
    let dark = places.iter().position(|&(_, db)| db < SEEN_DB);
    let seen = &places[..dark.unwrap_or(places.len())];
    let deep: Vec<(f64, f64)> = seen.iter().copied().filter(|p| p.0 >= 10.0).collect();
    Penetration {
        seen_mm: seen.last().map_or(0.0, |p| p.0),
        whole_depth: dark.is_none(),
        slope_db_cm: 10.0 * Some(slope(&deep).0).filter(|slope| slope.is_finite()).unwrap_or(0.0),
        levels: places,
    }
}

/// True if `probe` and its image can show the phantom's layout.
fn suits(probe: &Probe, sector: &Sector) -> bool {
    probe.face_radius_mm().is_none() && probe.half_extent() >= 29.0 && probe.depth_mm >= 60.0 && sector.pixel_mm <= 0.25
}
