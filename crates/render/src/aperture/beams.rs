//! Transmit and receive beams as sums of modes, waves e^(iqx) along the face.

use insonify_core::transducer::Probe;
use rustfft::num_complex::Complex64;

use super::grid::{Grid, SLOPE_MARGIN, receive_mm};

/// Elements per wavelength along the face.
const ELEMENTS_PER_WAVELENGTH: f64 = 6.0;

/// Complex weights of the modes in the beams whose axis is at x = 0.
pub(super) struct Beams {
    /// Transmit beam, focused at the probe's fixed focus `[modes]`.
    pub(super) transmit: Vec<Complex64>,
    /// Receive beam focused at each depth plane [planes × modes].
    pub(super) receive: Vec<Complex64>,
}

impl Beams {
    pub(super) fn new(probe: &Probe, grid: &Grid) -> Self {
        let receive = (0..grid.planes).flat_map(|plane| {
            let depth_mm = grid.depth_mm(plane);
            beam(probe, grid, receive_mm(probe, depth_mm), depth_mm)
        });
        Self { transmit: beam(probe, grid, probe.aperture_mm, probe.focus_mm), receive: receive.collect() }
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
    let part = |mode: &Option<i32>| {
        let q = mode.map(|mode| grid.mode_wave_number(mode)).filter(|q| q.abs() <= k * steepest)?;
        // e^(−iqa) of the element at position a, rotated from the previous element's.
        let mut turn = Complex64::from_polar(1.0, -q * place(0));
        let step = Complex64::from_polar(1.0, -q * aperture_mm / elements as f64);
        let mut sum = Complex64::ZERO;
        for weight in &weights {
            sum += weight * turn;
            turn *= step;
        }
        Some(sum)
    };
    let parts: Vec<Complex64> = grid.modes.iter().map(|mode| part(mode).unwrap_or(Complex64::ZERO)).collect();
    let power: f64 = parts.iter().map(Complex64::norm_sqr).sum();
    parts.iter().map(|part| part / power.max(1e-30).sqrt()).collect()
}
