//! The aperture's gain along each scanline: amplitude received from scatterers at a depth, relative to a medium without
//! loss.

use super::aperture::Aperture;
use super::inputs::Inputs;
use super::segment::{Path, segment_at};
use super::transmission::passed_np;
use crate::constants::{EVEN_NP, SPREAD_NP, TRACKED_NP, VISIBLE_MAX_NP, VISIBLE_MIN, VISIBLE_MIN_NP};

/// Gain and losses of a scanline at a boundary of the depth intervals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Boundary {
    /// Fractional index of the depth plane whose gain applies at the boundary; −1 is the face.
    pub position: f64,
    /// Loss of the axial path up to the boundary, one-way nepers.
    pub loss_np: f64,
    /// ln of the aperture's two-way gain at the plane before this boundary.
    pub ln_gain: f64,
    /// Loss up to the boundary that all scanlines share, one-way nepers.
    pub shared_np: f64,
}

/// The aperture's gain for a block of samples, at its first sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BlockGain {
    /// Two-way amplitude gain, without the loss that all scanlines share.
    pub gain: f64,
    /// Fractional index of the depth plane whose gain applies.
    pub position: f64,
}

/// The gain of every block [scanlines × blocks].
pub fn block_gains(inputs: &Inputs, aperture: &Aperture, paths: &[Path], boundaries: &[Boundary]) -> Vec<BlockGain> {
    let of = |line: usize| {
        let along = ApertureGain::new(aperture, boundaries, line);
        let axial_path = &paths[inputs.axial_path_of(line)];
        (0..inputs.blocks()).map(move |block| {
            let range_mm = inputs.range_mm(block * inputs.depth_block);
            along.without_shared(range_mm, passed_np(axial_path, range_mm))
        })
    };
    (0..inputs.scanlines).flat_map(of).collect()
}

/// The gain along every scanline [scanlines × (planes + 1)], from the beams' echo powers and the loss that scanlines
/// share in each interval (`row_np`).
pub fn visibility(
    inputs: &Inputs,
    aperture: &Aperture,
    paths: &[Path],
    powers: &[f64],
    row_np: &[f64],
) -> Vec<Boundary> {
    let line = |line: usize| {
        let axial_path = &paths[inputs.axial_path_of(line)];
        let boundaries = positions(aperture, axial_path, row_np);
        let gained = move |(number, boundary): (usize, Boundary)| match number.checked_sub(1) {
            Some(plane) => Boundary { ln_gain: gain(aperture, line, plane, powers), ..boundary },
            None => boundary,
        };
        boundaries.into_iter().enumerate().map(gained).collect::<Vec<_>>()
    };
    (0..inputs.scanlines).flat_map(line).collect()
}

/// Positions and losses at the boundaries of a scanline; its gains are not filled in.
fn positions(aperture: &Aperture, axial_path: &Path, row_np: &[f64]) -> Vec<Boundary> {
    let uncoupled_np = passed_np(axial_path, 0.0);
    let ln_gain = (-2.0 * uncoupled_np).max(VISIBLE_MIN_NP);
    let start = Boundary { position: -0.5, loss_np: uncoupled_np, ln_gain, shared_np: 0.0 };
    let mut boundaries = vec![start];
    let mut last = 0.5;
    for (interval, &row_np) in row_np.iter().enumerate() {
        let [from, to] = [interval, interval + 1].map(|boundary| boundary as f64 * aperture.plane_mm);
        let before = boundaries[interval];
        let rise = |at_mm: f64| passed_np(axial_path, at_mm) - before.loss_np;
        let own_np = (rise(to) - row_np).max(0.0);
        let followed = own_np / (own_np + TRACKED_NP);
        let mean_np = mean_loss_np(axial_path, from, to) - before.loss_np - 0.5 * row_np;
        let centre = (1.0 - mean_np / own_np.max(1.0e-6)).clamp(0.0, 1.0);
        last += followed * (centre - last);
        boundaries.push(Boundary {
            position: (interval + 1) as f64 - (1.0 - followed) * last,
            loss_np: passed_np(axial_path, to),
            ln_gain: 0.0,
            shared_np: before.shared_np + row_np,
        });
    }
    boundaries
}

/// Mean loss of an axial path between two ranges, one-way nepers.
fn mean_loss_np(axial_path: &Path, from: f64, to: f64) -> f64 {
    let pieces = (segment_at(axial_path, from)..=segment_at(axial_path, to)).map(|at| {
        let segment = &axial_path.segments[at];
        let end = axial_path.segments.get(at + 1).map_or(to, |next| next.start_mm.min(to));
        let start = segment.start_mm.max(from);
        -0.5 * segment.ln_passed(0.5 * (start + end)) * (end - start)
    });
    pieces.sum::<f64>() / (to - from)
}

/// ln of the two-way gain of a scanline at a plane, interpolated between the beams.
fn gain(aperture: &Aperture, line: usize, plane: usize, powers: &[f64]) -> f64 {
    let nodes = aperture.nodes(plane);
    let node = (aperture.line_cells[line] / aperture.node_cells[plane] as f64).clamp(0.0, nodes as f64 - 1.001);
    let root = |node: usize| powers[plane * aperture.cells + node].max(VISIBLE_MIN).powf(0.25);
    let part = node - node.floor();
    (2.0 * (root(node as usize) * (1.0 - part) + root(node as usize + 1) * part).ln()).min(VISIBLE_MAX_NP)
}

/// The aperture's gain along one scanline.
#[derive(Debug, Clone, Copy)]
pub(super) struct ApertureGain<'a> {
    aperture: &'a Aperture,
    row: &'a [Boundary],
}

impl<'a> ApertureGain<'a> {
    /// The gain along scanline `line`, from the boundaries of all scanlines.
    pub(super) fn new(aperture: &'a Aperture, boundaries: &'a [Boundary], line: usize) -> Self {
        let count = aperture.planes + 1;
        Self { aperture, row: &boundaries[line * count..][..count] }
    }

    /// ln of the two-way gain of scatterers at a range. `loss_np` is the axial path's loss up to that range, one-way
    /// nepers.
    pub(super) fn at(&self, range_mm: f64, loss_np: f64) -> f64 {
        let interval = self.interval(range_mm);
        let lost = self.lost(interval, range_mm, loss_np - self.row[interval].loss_np);
        self.gain(self.position(interval, range_mm, lost, self.row[interval].position)) - self.shared(interval, lost)
    }

    /// [`ApertureGain::at`] as amplitude, without the loss that all scanlines share; and the fractional plane index.
    fn without_shared(&self, range_mm: f64, loss_np: f64) -> BlockGain {
        let interval = self.interval(range_mm);
        let lost = self.lost(interval, range_mm, loss_np - self.row[interval].loss_np);
        let position = self.position(interval, range_mm, lost, self.row[interval].position);
        BlockGain { gain: self.gain(position).exp(), position }
    }

    fn interval(&self, range_mm: f64) -> usize {
        ((range_mm / self.aperture.plane_mm) as usize).min(self.aperture.planes - 1)
    }

    /// Losses within an interval, one-way nepers: the loss that all scanlines share, and the scanline's own loss.
    fn losses(&self, interval: usize) -> (f64, f64) {
        let [a, b] = [self.row[interval], self.row[interval + 1]];
        let row_np = b.shared_np - a.shared_np;
        (row_np, (b.loss_np - a.loss_np - row_np).max(0.0))
    }

    /// Fraction of an interval's depth that lies before a range.
    fn part(&self, interval: usize, range_mm: f64) -> f64 {
        range_mm / self.aperture.plane_mm - interval as f64
    }

    /// Fraction of an interval's loss that occurs before a range. `rise_np` is the loss from the interval's start to
    /// the range.
    fn lost(&self, interval: usize, range_mm: f64, rise_np: f64) -> f64 {
        let total_np = self.row[interval + 1].loss_np - self.row[interval].loss_np;
        let lost_np = rise_np + EVEN_NP * self.part(interval, range_mm);
        (lost_np / (total_np.max(0.0) + EVEN_NP)).clamp(0.0, 1.0)
    }

    /// Fractional plane index at a range and at the fraction `lost` of the interval's loss. It is `start` at the
    /// interval's start.
    fn position(&self, interval: usize, range_mm: f64, lost: f64, start: f64) -> f64 {
        let (_, own_np) = self.losses(interval);
        let done = (own_np * lost + SPREAD_NP * self.part(interval, range_mm)) / (own_np + SPREAD_NP);
        start + done * (self.row[interval + 1].position - start)
    }

    /// Loss that all scanlines share up to the fraction `lost` of an interval's loss, two-way nepers.
    fn shared(&self, interval: usize, lost: f64) -> f64 {
        2.0 * (self.row[interval].shared_np + self.losses(interval).0 * lost)
    }

    /// ln of the two-way gain at a fractional plane index; −1 is the face.
    fn gain(&self, position: f64) -> f64 {
        let at = (position + 1.0).clamp(0.0, self.aperture.planes as f64);
        let low = (at as usize).min(self.aperture.planes - 1);
        let part = at - low as f64;
        self.row[low].ln_gain * (1.0 - part) + self.row[low + 1].ln_gain * part
    }

    /// ln of the two-way amplitude factor of the echo at the end of segment `arrived` of a path. It is the aperture's
    /// gain before obstacles that the path has not crossed yet.
    pub(super) fn at_interface(&self, path: &Path, arrived: usize) -> f64 {
        let range_mm = path.segments[arrived + 1].start_mm;
        // The path's loss before its interface.
        let loss_np = |range_mm: f64| -0.5 * path.segments[segment_at(path, range_mm).min(arrived)].ln_passed(range_mm);
        let interval = self.interval(range_mm);
        let begins_np = loss_np(interval as f64 * self.aperture.plane_mm);
        let mut start = self.row[interval].position;
        if let Some(before) = interval.checked_sub(1) {
            let lags = |own_np: f64| TRACKED_NP / (own_np.max(0.0) + TRACKED_NP);
            let (row_np, own_np) = self.losses(before);
            let lag = (interval as f64 - start) / lags(own_np);
            let rise_np = begins_np - loss_np(before as f64 * self.aperture.plane_mm) - row_np;
            start = interval as f64 - lags(rise_np) * lag.clamp(0.0, 1.0);
        }
        let rise_np = -0.5 * path.segments[arrived].ln_passed(range_mm) - begins_np;
        let lost = self.lost(interval, range_mm, rise_np);
        // Plane `interval` precedes obstacles that the path has not crossed. Only its own loss leads past that plane.
        let own_np = (rise_np - self.losses(interval).0 * lost).max(0.0);
        let furthest = (interval as f64 + own_np / (own_np + TRACKED_NP)).max(start);
        self.gain(self.position(interval, range_mm, lost, start).min(furthest)) - self.shared(interval, lost)
    }
}
