//! Measurements in images of the QA phantom: distances, resolution, contrast, cysts, penetration.
//!
//! The layout is that of [`crate::anatomy::specimens::qa`], seen by a linear probe whose face lies on z = 0 about x = 0. As
//! on a scanner, everything is measured on the displayed image: a grey level is a level in dB above black.
//! Definitions follow the AIUM's "Methods for Measuring Performance of Pulse-Echo Ultrasound Equipment" in spirit; each
//! field says what exactly was done.

use glam::DVec2;
use serde::Serialize;

use crate::anatomy::specimens::qa;
use crate::statistics::slope;
use crate::transducer::{Probe, Sector};

use super::levels::Levels;

/// Dip between two wires, below the weaker of them, from which they count as two, dB.
pub const RESOLVED_DIP_DB: f64 = 3.0;
/// The background counts as seen down to where its mean level is this much above black, dB.
pub const SEEN_DB: f64 = 3.0;

/// A distance between two wires.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Distance {
    /// `vertical` or `horizontal`.
    pub direction: &'static str,
    /// Depth of the first wire, mm.
    pub depth_mm: f64,
    /// As built, mm.
    pub true_mm: f64,
    /// From centre to centre of what is within 10 dB of each wire's peak, mm.
    pub measured_mm: f64,
}

/// A grey-scale target.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Contrast {
    /// As built: scattered power against the background's, dB.
    pub true_db: f64,
    /// Mean level of the target's middle (0.8 of its diameter) less that of the background just above and below, dB.
    pub measured_db: f64,
}

/// An anechoic cylinder.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Cyst {
    /// Diameter, mm.
    pub diameter_mm: f64,
    /// Depth of its centre, mm.
    pub depth_mm: f64,
    /// Mean level of the background less that of its middle half, dB.
    pub void_db: f64,
}

/// Size of the image of one wire.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Widths {
    /// Depth of the wire, mm.
    pub depth_mm: f64,
    /// Full width at half the amplitude (−6 dB) across the scanlines, mm.
    pub lateral_mm: f64,
    /// The beam there, with the wire's own width, mm.
    pub lateral_expected_mm: f64,
    /// Full width at half the amplitude along the scanlines, mm.
    pub axial_mm: f64,
    /// The pulse, with the wire's two sides one behind the other, mm.
    pub axial_expected_mm: f64,
}

/// Two wires beside or behind each other.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Pair {
    /// `axial` or `lateral`.
    pub direction: &'static str,
    /// Depth of the group, mm.
    pub depth_mm: f64,
    /// Centre to centre, mm.
    pub apart_mm: f64,
    /// Least level between them along that direction below the weaker of the two, dB.
    pub dip_db: f64,
}

impl Pair {
    /// Whether they are seen as two: a dip of at least [`RESOLVED_DIP_DB`].
    pub fn is_resolved(&self) -> bool {
        self.dip_db >= RESOLVED_DIP_DB
    }
}

/// Depth to which the background is visible.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Penetration {
    /// Depth to which the background's mean level stays [`SEEN_DB`] above black, mm.
    pub seen_mm: f64,
    /// Whether that is the bottom of the image.
    pub whole_depth: bool,
    /// Change of the background's level with depth, dB a cm; a straight line through what is seen, from 1 cm on.
    pub slope_db_cm: f64,
    /// Depth (mm) and mean level (dB above black) of the background, in steps of 5 mm.
    pub levels: Vec<(f64, f64)>,
}

/// All that was measured.
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

/// Measures everything of the phantom that lies within `probe`'s depth. `levels` holds at least one image; several, taken
/// along the targets (y), average the speckle.
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
pub fn wire_mm(levels: &Levels, (x, depth): (f32, f32)) -> DVec2 {
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
    // Speckle beside the wire, whose power adds to its own.
    let noise = levels.box_power((at + DVec2::new(0.0, 2.5), DVec2::new(3.0, 0.8)));
    let wire = f64::from(qa::WIRE_MM);
    let beam = FWHM_PER_SIGMA * probe.lateral_sigma_mm(depth_mm);
    Widths {
        depth_mm,
        lateral_mm: levels.half_width_mm(at, DVec2::X, noise),
        // The second moments of a Gaussian and a box add.
        lateral_expected_mm: (beam.powi(2) + FWHM_PER_SIGMA.powi(2) / 12.0 * wire.powi(2)).sqrt(),
        axial_mm: levels.half_width_mm(at, DVec2::Y, noise),
        // Upper and lower side of the wire echo one behind the other; nylon (2600 m/s) is faster than the phantom.
        axial_expected_mm: FWHM_PER_SIGMA * probe.axial_sigma_mm() + wire * 1540.0 / 2600.0,
    }
}

fn pairs(levels: &Levels, depth: f32) -> Vec<Pair> {
    let places = qa::resolution(depth);
    // Axial flights go down on the right, lateral rows to the left; both begin with a wire of their own.
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

/// Dip between two wires, dB: the brightest level across the direction of interest, along it, has a peak at either wire;
/// how far its least value between them is below the weaker. 0 where they are one peak.
fn dip_db(levels: &Levels, direction: &str, a: (f32, f32), b: (f32, f32)) -> f64 {
    // A wire's echo is that of its upper side.
    let centre = |(x, z): (f32, f32)| DVec2::new(x.into(), f64::from(z) + 0.1);
    let (from, to) = (centre(a), centre(b));
    let (axis, across) = if direction == "axial" { (DVec2::Y, DVec2::X) } else { (DVec2::X, DVec2::Y) };
    let (low, high) = (from.min(to), from.max(to));
    let (start, end) = (low.dot(axis), high.dot(axis));
    // Part of the gap beyond either wire, so that each peak is inside and no neighbour is.
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
    // Between the vertical group and the targets of the right: background alone over most of the depth.
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

/// Whether `probe` and its image can show the phantom as it is laid out.
pub fn suits(probe: &Probe, sector: &Sector) -> bool {
    probe.face_radius_mm().is_none() && probe.half_extent() >= 29.0 && probe.depth_mm >= 60.0 && sector.pixel_mm <= 0.25
}
