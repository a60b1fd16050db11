//! Measurements in images of the QA phantom: distances, resolution, contrast, cysts, penetration.
//!
//! The layout is [`crate::anatomy::specimens::qa`]. A linear probe sees it, with its face on z = 0 and centred at x =
//! 0. As on a scanner, everything is measured in the displayed image: a grey level is a level in dB above black. The
//! definitions follow the ideas of the AIUM's "Methods for Measuring Performance of Pulse-Echo Ultrasound Equipment".
//! Each field gives its exact definition.

mod imaging;
mod table;

pub use imaging::{QaError, check_probe, check_scene, image_and_measure};

use glam::DVec2;
use serde::Serialize;

use crate::anatomy::specimens::qa;
use crate::statistics::slope;
use crate::transducer::{Probe, Sector};

use super::levels::Levels;

/// Smallest dip between two wires that counts as resolved, relative to the weaker wire, dB.
pub const RESOLVED_DIP_DB: f64 = 3.0;
/// Smallest mean level at which the background counts as visible, dB above black.
pub const SEEN_DB: f64 = 3.0;

/// A measured distance between two wires.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Distance {
    /// `vertical` or `horizontal`.
    pub direction: &'static str,
    /// Depth of the first wire, mm.
    pub depth_mm: f64,
    /// True distance, mm.
    pub true_mm: f64,
    /// Measured distance, mm. The position of a wire is the centre of the pixels within 10 dB of its peak.
    pub measured_mm: f64,
}

/// A measured grey-scale target.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Contrast {
    /// True contrast: scattered power relative to the background's, dB.
    pub true_db: f64,
    /// Measured contrast, dB: mean level in the target's centre (0.8 of its diameter) minus mean level of the
    /// background just above and below.
    pub measured_db: f64,
}

/// A measured anechoic cylinder.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Cyst {
    /// Diameter, mm.
    pub diameter_mm: f64,
    /// Depth of the centre, mm.
    pub depth_mm: f64,
    /// Void depth, dB: mean level of the background minus mean level in the central half of the cylinder.
    pub void_db: f64,
}

/// Measured size of the image of one wire.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Widths {
    /// Depth of the wire, mm.
    pub depth_mm: f64,
    /// Full width at half the amplitude (−6 dB) across the scanlines, mm.
    pub lateral_mm: f64,
    /// Expected lateral width, mm: the beam's width combined with the wire's.
    pub lateral_expected_mm: f64,
    /// Full width at half the amplitude along the scanlines, mm.
    pub axial_mm: f64,
    /// Expected axial width, mm: the pulse's length plus the delay between the two sides of the wire.
    pub axial_expected_mm: f64,
}

/// Two neighbouring wires of a resolution group.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Pair {
    /// `axial` or `lateral`.
    pub direction: &'static str,
    /// Depth of the resolution group, mm.
    pub depth_mm: f64,
    /// Distance between the centres, mm.
    pub apart_mm: f64,
    /// Dip of the level between the wires along that direction, relative to the weaker wire, dB.
    pub dip_db: f64,
}

impl Pair {
    /// Whether they are seen as two wires: the dip is at least [`RESOLVED_DIP_DB`].
    pub fn is_resolved(&self) -> bool {
        self.dip_db >= RESOLVED_DIP_DB
    }
}

/// Depth to which the background is visible.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Penetration {
    /// Depth to which the mean level of the background stays [`SEEN_DB`] above black, mm.
    pub seen_mm: f64,
    /// Whether this is the whole depth of the image.
    pub whole_depth: bool,
    /// Change of the background's level with depth, dB/cm: slope of a straight line fitted to the visible depths
    /// below 1 cm.
    pub slope_db_cm: f64,
    /// Levels of the background in steps of 5 mm: depth, mm, and mean level, dB above black.
    pub levels: Vec<(f64, f64)>,
}

/// All measurements of the phantom.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct QaMeasurements {
    /// Measured distances, vertical ones first.
    pub distances: Vec<Distance>,
    /// Measured grey-scale targets, from left to right.
    pub contrast: Vec<Contrast>,
    /// Measured anechoic cylinders.
    pub cysts: Vec<Cyst>,
    /// Measured sizes of the wires in the vertical group.
    pub widths: Vec<Widths>,
    /// Measured pairs of the resolution groups.
    pub pairs: Vec<Pair>,
    /// Measured penetration.
    pub penetration: Penetration,
}

/// Measures all targets within the depth of `probe`. `levels` must hold at least one image. Several images, taken at
/// different y along the targets, average out the speckle.
pub fn measure(levels: &Levels, probe: &Probe) -> QaMeasurements {
    let seen = |depth: f32| f64::from(depth) + 2.0 < probe.depth_mm;
    QaMeasurements {
        distances: distances(levels, seen),
        contrast: if seen(qa::CONTRAST_DEPTH_MM + 10.0) { contrasts(levels) } else { Vec::new() },
        cysts: qa::CYSTS_MM.into_iter().filter(|c| seen(c.1 + 9.0)).map(|c| cyst(levels, c)).collect(),
        widths: (0..qa::VERTICAL_COUNT)
            .map(qa::vertical)
            .filter(|&(_, depth)| seen(depth + 3.0))
            .map(|position| widths(levels, probe, position))
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

/// Measured position of the wire near (x, depth), mm: the centre of the pixels within 10 dB of its peak.
pub(crate) fn wire_mm(levels: &Levels, (x, depth): (f32, f32)) -> DVec2 {
    let box_mm = (DVec2::new(x.into(), f64::from(depth) + 0.1), DVec2::new(1.6, 0.5));
    let peak = levels.pixels(box_mm).map(|(_, power)| power).fold(0.0, f64::max);
    let mut weight = 0.0;
    let mut sum = DVec2::ZERO;
    for (position, power) in levels.pixels(box_mm).filter(|&(_, power)| power >= 0.1 * peak) {
        sum += position * power;
        weight += power;
    }
    sum / weight.max(f64::MIN_POSITIVE)
}

fn widths(levels: &Levels, probe: &Probe, position: (f32, f32)) -> Widths {
    use crate::acoustics::pulse::FWHM_PER_SIGMA;
    let depth_mm = f64::from(position.1);
    let at = wire_mm(levels, position);
    // Power of the speckle near the wire, which adds to the wire's own.
    let noise = levels.box_power((at + DVec2::new(0.0, 2.5), DVec2::new(3.0, 0.8)));
    let wire = f64::from(qa::WIRE_MM);
    let beam = FWHM_PER_SIGMA * probe.lateral_sigma_mm(depth_mm);
    Widths {
        depth_mm,
        lateral_mm: levels.half_width_mm(at, DVec2::X, noise),
        // The variances of the Gaussian beam and of the wire's box profile add.
        lateral_expected_mm: (beam.powi(2) + FWHM_PER_SIGMA.powi(2) / 12.0 * wire.powi(2)).sqrt(),
        axial_mm: levels.half_width_mm(at, DVec2::Y, noise),
        // The upper and the lower side of the wire echo one after the other. Sound in nylon (2600 m/s) is faster than
        // in the phantom.
        axial_expected_mm: FWHM_PER_SIGMA * probe.axial_sigma_mm() + wire * 1540.0 / 2600.0,
    }
}

fn pairs(levels: &Levels, depth: f32) -> Vec<Pair> {
    let wires = qa::resolution(depth);
    // Wires on the right form a column that goes down, for axial resolution. Wires on the left form a row. Each
    // begins with a wire of its own.
    let flight = |right: bool| wires.iter().copied().filter(move |p| (p.0 > 0.0) == right);
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

/// Dip between two wires, dB. The profile is the brightest level across `direction`, and the dip is its minimum
/// between the two peaks, relative to the weaker peak. 0 if the wires form one peak.
fn dip_db(levels: &Levels, direction: &str, a: (f32, f32), b: (f32, f32)) -> f64 {
    // The echo of a wire comes from its upper side.
    let centre = |(x, z): (f32, f32)| DVec2::new(x.into(), f64::from(z) + 0.1);
    let (from, to) = (centre(a), centre(b));
    let (axis, across) = if direction == "axial" { (DVec2::Y, DVec2::X) } else { (DVec2::X, DVec2::Y) };
    let (low, high) = (from.min(to), from.max(to));
    let (start, end) = (low.dot(axis), high.dot(axis));
    // Margin beyond both wires that includes their peaks, but not the next wires.
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
    let levels_db: Vec<(f64, f64)> = (1..)
        .map(|i| f64::from(i) * step)
        .take_while(|depth| depth + 1.0 < probe.depth_mm)
        .map(|depth| (depth, levels.median_row_db(depth, 1.0)))
        .collect();
    let dark = levels_db.iter().position(|&(_, db)| db < SEEN_DB);
    let seen = &levels_db[..dark.unwrap_or(levels_db.len())];
    let deep: Vec<(f64, f64)> = seen.iter().copied().filter(|p| p.0 >= 10.0).collect();
    Penetration {
        seen_mm: seen.last().map_or(0.0, |p| p.0),
        whole_depth: dark.is_none(),
        slope_db_cm: 10.0 * Some(slope(&deep).0).filter(|slope| slope.is_finite()).unwrap_or(0.0),
        levels: levels_db,
    }
}

/// Whether `probe` and its image can show the phantom's layout.
fn suits(probe: &Probe, sector: &Sector) -> bool {
    probe.face_radius_mm().is_none() && probe.half_extent() >= 29.0 && probe.depth_mm >= 60.0 && sector.pixel_mm <= 0.25
}
