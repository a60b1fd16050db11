//! Transmit and receive beams as sums of modes, waves e^(iqx) along the face.

use insonify_core::transducer::Probe;
use rayon::prelude::*;
use rustfft::num_complex::Complex64;

use super::grid::{Grid, SLOPE_MARGIN, receive_mm};

/// Elements per wavelength along the face.
const ELEMENTS_PER_WAVELENGTH: f64 = 6.0;
/// Half angle of the arc on which the field of a phased array is taken, radians.
const ARC: f64 = 1.4;

/// Complex weights of the modes in the beams whose axis is at x = 0.
pub(super) struct Beams {
    /// Transmit beam, focused at the probe's fixed focus `[modes]`.
    pub(super) transmit: Vec<Complex64>,
    /// Receive beam focused at each depth plane [planes × modes].
    pub(super) receive: Vec<Complex64>,
}

impl Beams {
    pub(super) fn new(probe: &Probe, grid: &Grid) -> Self {
        let receive = |plane: usize| {
            let aperture_mm = receive_mm(probe, grid.depth_mm(plane));
            beam(probe, grid, aperture_mm, grid.wave_depth_mm(plane))
        };
        let receive: Vec<Vec<Complex64>> = (0..grid.planes).into_par_iter().map(receive).collect();
        Self { transmit: beam(probe, grid, probe.aperture_mm, probe.focus_mm), receive: receive.concat() }
    }
}

/// Weight of each mode in the beam of an aperture focused at a depth. The weights' squared magnitudes sum to 1.
fn beam(probe: &Probe, grid: &Grid, aperture_mm: f64, focus_mm: f64) -> Vec<Complex64> {
    let k = grid.wave_number;
    let steepest = grid.shape.slope(0.5 * aperture_mm, focus_mm) + SLOPE_MARGIN;
    let spacing_mm = std::f64::consts::TAU / k / ELEMENTS_PER_WAVELENGTH;
    let elements = ((aperture_mm / spacing_mm).round() as usize).max(1);
    let place = |element: usize| ((element as f64 + 0.5) / elements as f64 - 0.5) * aperture_mm;
    let weights: Vec<Complex64> = (0..elements)
        .map(|element| {
            let across = place(element);
            let delay = grid.shape.distance_mm(across, focus_mm) - focus_mm;
            Complex64::from_polar(probe.apodization.weight(across / aperture_mm), -k * delay)
        })
        .collect();
    // Sources along the face, or along the arc where the waves of a phased array begin: their amplitudes, the position of
    // the first, and their distance.
    let (sources, first_mm, apart_mm) = if grid.shape.is_phased() {
        let elements: Vec<(f64, Complex64)> = weights.iter().enumerate().map(|(n, &w)| (place(n), w)).collect();
        on_arc(grid, &elements, spacing_mm)
    } else {
        (weights, place(0), aperture_mm / elements as f64)
    };
    let part = |mode: &Option<i32>| {
        let q = mode.map(|mode| grid.mode_wave_number(mode)).filter(|q| q.abs() <= k * steepest)?;
        // e^(−iqa) of the source at position a, rotated from the previous source's.
        let mut turn = Complex64::from_polar(1.0, -q * first_mm);
        let step = Complex64::from_polar(1.0, -q * apart_mm);
        let mut sum = Complex64::ZERO;
        for weight in &sources {
            sum += weight * turn;
            turn *= step;
        }
        Some(sum)
    };
    let parts: Vec<Complex64> = grid.modes.iter().map(|mode| part(mode).unwrap_or(Complex64::ZERO)).collect();
    let power: f64 = parts.iter().map(Complex64::norm_sqr).sum();
    parts.iter().map(|part| part / power.max(1e-30).sqrt()).collect()
}

/// Field of a flat aperture on the arc about its middle from which the waves of a phased array are computed: amplitudes,
/// position of the first along the arc, and their distance. `elements` are positions and weights.
fn on_arc(grid: &Grid, elements: &[(f64, Complex64)], spacing_mm: f64) -> (Vec<Complex64>, f64, f64) {
    let radius_mm = grid.shape.radius_mm;
    let reach_mm = radius_mm * ARC;
    let count = (2.0 * reach_mm / spacing_mm).ceil().max(1.0) as usize;
    let apart_mm = 2.0 * reach_mm / count as f64;
    let first_mm = 0.5 * apart_mm - reach_mm;
    let field = |n: usize| {
        let along_mm = first_mm + n as f64 * apart_mm;
        let (sin, cos) = (along_mm / radius_mm).sin_cos();
        let sent = |&(across_mm, weight): &(f64, Complex64)| {
            let distance_mm = (radius_mm * sin - across_mm).hypot(radius_mm * cos);
            weight * Complex64::from_polar(1.0 / distance_mm.sqrt(), grid.wave_number * distance_mm)
        };
        // Smooth at the ends of the arc, where hardly anything arrives.
        let inside = ((reach_mm - along_mm.abs()) / (0.2 * reach_mm)).min(1.0);
        (std::f64::consts::FRAC_PI_2 * inside).sin().powi(2) * elements.iter().map(sent).sum::<Complex64>()
    };
    ((0..count).map(field).collect(), first_mm, apart_mm)
}
