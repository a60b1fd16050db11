//! Signals that the receiver adds to the lines: noise, clutter near the face, and the reverberation of a face without
//! contact.
//!
//! Reverberation and clutter belong to the probe: they stay at fixed positions on its scanlines, wherever it is. Their
//! shape follows a C5-1 in air (pydicom's `examples_palette.dcm`): bright arcs 1.2 mm apart over a diffuse haze, grey
//! at the face and black 2 cm deeper.

use rayon::prelude::*;

use insonify_core::random;
use insonify_core::transducer::Probe;

/// Decrease of the clutter with depth, dB per cm.
pub(crate) const CLUTTER_DB_CM: f64 = 20.0;
/// Decrease of the reverberation with depth, dB per cm.
pub(crate) const REVERBERATION_DB_CM: f64 = 35.0;
/// Reduction of clutter and reverberation in tissue harmonics, dB: so close to the face, few harmonics have formed
/// (assumed).
pub(crate) const HARMONIC_CLUTTER_DB: f64 = 15.0;
/// Depth at which clutter and reverberation end: clutter has fallen by 80 dB.
const NEAR_MM: f64 = 40.0;
/// Spacing of the reverberation's arcs, mm: a round trip through lens and matching layers.
const ARC_MM: f64 = 1.2;
/// Distances over which the arcs' random amplitude changes: mm of depth, and fraction of the face's width.
const ARC_DEPTH_MM: f64 = 2.5;
const ARC_PART: f64 = 0.2;
/// Distances over which the random haze changes: mm of depth (more for a longer pulse), and scanlines.
const HAZE_DEPTH_MM: f64 = 0.35;
const HAZE_LINES: f64 = 4.0;
/// Fraction of the reverberation's amplitude that is haze at the middle of the face; at the ends, all of it is haze.
const HAZE_PART: f64 = 0.45;
const SEED: u64 = 0x7265_6365_6976_6572;

/// Reverberation and clutter of a probe at the samples near its face, before the pulse is applied. After the pulse,
/// both have a level of 0 dB at the face.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct NearField {
    /// Samples per scanline; an even number.
    pub(crate) samples: u32,
    /// Baseband of reverberation (re, im), then of clutter (re, im) [scanlines × samples].
    pub(crate) values: Vec<[f32; 4]>,
}

impl NearField {
    /// Makes the table for a probe whose pulse envelope has the samples `pulse`.
    pub(crate) fn new(probe: &Probe, pulse: &[f32]) -> Self {
        let spacing_mm = probe.sample_spacing_mm();
        let samples = (((NEAR_MM / spacing_mm).ceil() as u32).next_multiple_of(2)).min(probe.sample_count() & !1);
        let haze_mm = HAZE_DEPTH_MM.max(4.0 * probe.axial_sigma_mm());
        // Haze and arcs change slowly over a pulse, so the pulse adds them in phase.
        let scale = 1.0 / pulse.iter().map(|&w| f64::from(w)).sum::<f64>();
        let depth = |sample: u32| Depth::new((f64::from(sample) + 0.5) * spacing_mm, haze_mm);
        let depths: Vec<Depth> = (0..samples).map(depth).collect();
        let rows = |of: fn(&Depth) -> Along| depths.last().map_or(0, |last| of(last).row + 2);
        let (haze_rows, arc_rows) = (rows(|depth| depth.haze), rows(|depth| depth.arcs));
        let of_line = |line: u32| {
            let across = (f64::from(line) + 0.5) / f64::from(probe.scanlines);
            let middle = 1.0 - (2.0 * across - 1.0).powi(2);
            let haze_part = (1.0 - middle * (1.0 - HAZE_PART * HAZE_PART)).sqrt();
            let arc_part = (1.0 - haze_part * haze_part).sqrt();
            let haze = Field::new(1, f64::from(line) / HAZE_LINES, haze_rows);
            let clutter = Field::new(2, f64::from(line) / HAZE_LINES, haze_rows);
            let arcs = Field::new(3, across / ARC_PART, arc_rows);
            let value = move |depth: &Depth| {
                let (haze, clutter, arcs) = (haze.at(depth.haze), clutter.at(depth.haze), arcs.at(depth.arcs));
                let ring = |i: usize| depth.ring * scale * (haze_part * haze[i] + arc_part * depth.arc * arcs[i]);
                let still = |i: usize| depth.clutter * scale * clutter[i];
                [ring(0), ring(1), still(0), still(1)].map(|v| v as f32)
            };
            depths.iter().map(value).collect::<Vec<_>>()
        };
        Self { samples, values: (0..probe.scanlines).into_par_iter().flat_map_iter(of_line).collect() }
    }
}

/// Values at a depth that all scanlines share.
struct Depth {
    /// Position of the depth in the random fields of haze and clutter, and in the field of the arcs.
    haze: Along,
    arcs: Along,
    /// Amplitudes of reverberation and clutter, relative to the face.
    ring: f64,
    clutter: f64,
    /// Amplitude of the arcs; its mean square over depth is 1.
    arc: f64,
}

impl Depth {
    fn new(mm: f64, haze_mm: f64) -> Self {
        let fallen = |db_cm: f64| 10f64.powf(-db_cm * mm / 200.0);
        // Every other arc is weaker: it returns from the back of the lens. The mean square of the bracket is 1.745.
        let turn = std::f64::consts::TAU * mm / ARC_MM;
        let arc = (1.0 + turn.cos() + 0.7 * (0.5 * turn).cos()) / 1.745_f64.sqrt();
        Self {
            haze: Along::new(mm / haze_mm),
            arcs: Along::new(mm / ARC_DEPTH_MM),
            ring: fallen(REVERBERATION_DB_CM),
            clutter: fallen(CLUTTER_DB_CM),
            arc,
        }
    }
}

/// Position along one axis of a random [`Field`]: index of the node before it, and the weights of both neighbouring
/// nodes.
#[derive(Debug, Clone, Copy)]
struct Along {
    row: usize,
    /// Weights of node `row` and of the next one; their squares add to 1.
    weights: [f64; 2],
}

impl Along {
    fn new(at: f64) -> Self {
        let row = at.floor();
        let (sin, cos) = (std::f64::consts::FRAC_PI_2 * (at - row)).sin_cos();
        Self { row: row as usize, weights: [cos, sin] }
    }
}

/// A complex random function of depth along one scanline: random values at nodes, interpolated along and across. Its
/// mean square is 1.
struct Field {
    /// Values of the nodes in the columns on both sides of the scanline [rows].
    nodes: Vec<[[f64; 2]; 2]>,
    /// Weights of the two columns; their squares add to 1.
    weights: [f64; 2],
}

impl Field {
    /// The first `rows` rows of nodes around position `across`, which is in columns. `kind` numbers independent fields.
    fn new(kind: u64, across: f64, rows: usize) -> Self {
        let Along { row: column, weights } = Along::new(across);
        let node = |row: usize| [column, column + 1].map(|column| node(kind, row as u64, column as u64));
        Self { nodes: (0..rows).map(node).collect(), weights }
    }

    fn at(&self, along: Along) -> [f64; 2] {
        let mut sum = [0.0; 2];
        for (sides, along) in self.nodes.iter().skip(along.row).zip(along.weights) {
            for (value, beside) in sides.iter().zip(self.weights) {
                sum[0] += along * beside * value[0];
                sum[1] += along * beside * value[1];
            }
        }
        sum
    }
}

/// Value of a node: a complex normal number of mean square 1.
fn node(kind: u64, row: u64, column: u64) -> [f64; 2] {
    let bits = random::bits(SEED ^ (kind << 56) ^ (column << 28) ^ row);
    let radius = (-random::fraction(bits).max(1.0e-12).ln()).sqrt();
    let (sin, cos) = (std::f64::consts::TAU * random::fraction(random::bits(bits))).sin_cos();
    [radius * cos, radius * sin]
}

/// Amplitude of white noise that has the mean square `level_db` after the pulse.
pub(crate) fn white_amplitude(level_db: f64, pulse: &[f32]) -> f64 {
    let pulse_power: f64 = pulse.iter().map(|&w| f64::from(w).powi(2)).sum();
    10f64.powf(level_db / 20.0) / pulse_power.sqrt()
}

/// Seed of a frame's noise, from the settings' seed, the scene's time and the index of the steering angle.
pub(crate) fn noise_seed(seed: u32, time_s: f64, angle: u32) -> u32 {
    random::bits(u64::from(seed) ^ u64::from(angle) << 48 ^ time_s.to_bits().rotate_left(17)) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reverberation_and_clutter_have_their_level_at_the_face_and_fall_with_depth() {
        let probe = Probe { scanlines: 512, ..Probe::default() };
        let table = NearField::new(&probe, &[0.5, 1.0, 0.5]);
        // Level after the pulse, whose sum is 2, averaged over 2.4 mm of depth.
        let level_db = |depth_mm: f64, part: usize| {
            let of = |mm: f64| (mm / probe.sample_spacing_mm()).round() as usize;
            let (from, count) = (of(depth_mm), of(2.4));
            let rows = table.values.chunks_exact(table.samples as usize);
            let power: f64 = rows
                .flat_map(|row| &row[from..from + count])
                .map(|value| f64::from(value[part]).powi(2) + f64::from(value[part + 1]).powi(2))
                .sum();
            10.0 * (4.0 * power / (count as f64 * 512.0)).log10()
        };
        for (depth_mm, expected_db) in [(0.0, -2.2), (10.0, -22.2), (20.0, -42.2)] {
            assert!((level_db(depth_mm, 2) - expected_db).abs() < 0.8, "{depth_mm} mm: {}", level_db(depth_mm, 2));
        }
        for (depth_mm, expected_db) in [(0.0, -3.5), (10.0, -38.5), (20.0, -73.5)] {
            assert!((level_db(depth_mm, 0) - expected_db).abs() < 2.5, "{depth_mm} mm: {}", level_db(depth_mm, 0));
        }
    }

    #[test]
    fn frames_of_other_times_seeds_and_angles_have_other_noise() {
        let seeds = [(0, 0.0, 0), (0, 0.04, 0), (1, 0.0, 0), (1, 0.04, 0), (0, 0.0, 1), (0, 0.0, 2), (1, 0.04, 2)];
        let seeds = seeds.map(|(seed, time_s, angle)| noise_seed(seed, time_s, angle));
        for (i, seed) in seeds.iter().enumerate() {
            assert!(!seeds[..i].contains(seed));
        }
        assert_eq!(noise_seed(3, 1.5, 2), noise_seed(3, 1.5, 2));
    }
}
