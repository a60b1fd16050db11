//! The aperture's gain at the samples and interfaces of a scanline, from the outputs of the pass `visibility`.

use insonify_core::simd::{at_least, at_most, floor, real};

use crate::aperture::ApertureTables;
use crate::boundary::Boundary;
use crate::host::constants::{EVEN_NP, SPREAD_NP, TRACKED_NP};
use crate::host::paths::{BLOCK, Lanes, Paths, range_mm, seek};
use crate::params::Params;
use crate::segment::Segment;

/// The aperture's gain along all scanlines.
#[derive(Debug, Clone, Copy)]
pub(in crate::host) struct ApertureGains<'a> {
    pub(in crate::host) tables: &'a ApertureTables,
    /// Gain and losses at the boundaries of the depth intervals [scanlines × (planes + 1)].
    pub(in crate::host) lines: &'a [Boundary],
}

impl<'a> ApertureGains<'a> {
    /// The aperture's gain along one scanline.
    pub(in crate::host) fn line(&self, line: u32) -> ApertureGain<'a> {
        let boundaries = self.tables.planes + 1;
        ApertureGain::new(self.tables, &self.lines[line as usize * boundaries..][..boundaries])
    }

    /// ln of the two-way gain at the samples of a block.
    #[inline(always)]
    pub(in crate::host) fn block(&self, params: &Params, paths: &Paths<'_>, line: u32, first: u32) -> Lanes {
        let (gain, axial_path) = (self.line(line), params.axial_path_of(line));
        let (mut falls, mut passed) = ([0.0; BLOCK], [0.0; BLOCK]);
        let (end_mm, segment) = seek(params, paths, axial_path, first);
        if range_mm(params, first.wrapping_add(BLOCK as u32 - 1)) < end_mm {
            (falls, passed) = ([segment.fall_np_mm; BLOCK], [segment.ln_passed_at_zero; BLOCK]);
        } else {
            for i in 0..BLOCK {
                // Each pair of samples shares the segment of its first sample.
                let segment = seek(params, paths, axial_path, first.wrapping_add((i & !1) as u32)).1;
                (falls[i], passed[i]) = (segment.fall_np_mm, segment.ln_passed_at_zero);
            }
        }
        // A block lies in one interval or in two, unless intervals are shorter than blocks.
        let interval_samples = self.tables.plane_samples;
        if interval_samples as usize >= BLOCK {
            let (interval, last) = ((first / interval_samples) as usize, gain.row.len() - 2);
            // No closure: if not inlined, it is compiled without the vector instructions.
            let mut ln_gain = gain.whole_block(params, first, interval.min(last), [&falls, &passed]);
            let in_first = (interval_samples - first % interval_samples) as usize;
            if in_first < BLOCK {
                let next = gain.whole_block(params, first, (interval + 1).min(last), [&falls, &passed]);
                ln_gain[in_first..].copy_from_slice(&next[in_first..]);
            }
            return ln_gain;
        }
        let mut ln_gain = [0.0; BLOCK];
        for (i, ln_gain) in ln_gain.iter_mut().enumerate() {
            let range_mm = range_mm(params, first.wrapping_add(i as u32));
            *ln_gain = gain.at(range_mm, 0.5 * (falls[i] * range_mm - passed[i]));
        }
        ln_gain
    }
}

/// The aperture's gain along one scanline.
#[derive(Debug, Clone, Copy)]
pub(in crate::host) struct ApertureGain<'a> {
    row: &'a [Boundary],
    plane_mm: f32,
}

/// One depth interval of a scanline.
#[derive(Debug, Clone, Copy)]
struct Interval {
    /// Fractional indices of the depth planes whose gains apply at the interval's start and end.
    positions: [f32; 2],
    /// The scanline's loss up to the interval, its loss within the interval, and the part of the latter that all
    /// scanlines share; one-way nepers.
    begins_np: f32,
    total_np: f32,
    row_np: f32,
    /// Loss up to the interval that all scanlines share, one-way nepers.
    shared_np: f32,
}

impl Interval {
    /// The scanline's own loss in the interval, one-way nepers: total minus shared loss, at least 0.
    #[inline(always)]
    fn own_np(&self) -> f32 {
        at_least(self.total_np - self.row_np, 0.0)
    }

    /// Fraction of the interval's loss that has occurred where the total loss is `loss_np`. `part` is the fraction of
    /// the interval's depth.
    #[inline(always)]
    fn lost(&self, part: f32, loss_np: f32) -> f32 {
        let lost_np = loss_np - self.begins_np + EVEN_NP * part;
        at_most(at_least(lost_np / (at_least(self.total_np, 0.0) + EVEN_NP), 0.0), 1.0)
    }

    /// Fractional plane index at the fraction `part` of the interval's depth and `lost` of its loss.
    #[inline(always)]
    fn position(&self, part: f32, lost: f32) -> f32 {
        let own_np = self.own_np();
        let done = (own_np * lost + SPREAD_NP * part) / (own_np + SPREAD_NP);
        self.positions[0] + done * (self.positions[1] - self.positions[0])
    }
}

impl<'a> ApertureGain<'a> {
    /// The gain along a scanline, from its boundaries.
    pub(in crate::host) fn new(tables: &ApertureTables, row: &'a [Boundary]) -> Self {
        Self { row, plane_mm: tables.plane_mm }
    }

    #[inline(always)]
    fn interval(&self, interval: usize) -> Interval {
        let [start, end] = [&self.row[interval], &self.row[interval + 1]];
        Interval {
            positions: [start.position, end.position],
            begins_np: start.loss_np,
            total_np: end.loss_np - start.loss_np,
            row_np: end.shared_np - start.shared_np,
            shared_np: start.shared_np,
        }
    }

    /// Index of the interval that contains a range, and the fraction of the interval's depth before the range.
    #[inline(always)]
    fn index(&self, range_mm: f32) -> (usize, f32) {
        let position = range_mm / self.plane_mm;
        let interval = floor(position).clamp(0, self.row.len() as i32 - 2) as usize;
        (interval, position - interval as f32)
    }

    /// ln of the two-way gain of scatterers at a range. `loss_np` is the axial path's loss up to that range, one-way
    /// nepers.
    #[inline(always)]
    pub(in crate::host) fn at(&self, range_mm: f32, loss_np: f32) -> f32 {
        let (interval, lost, position) = self.tracked(range_mm, loss_np);
        self.gain(position) - 2.0 * (interval.shared_np + interval.row_np * lost)
    }

    /// Two values: the gain of [`ApertureGain::at`] before the loss that all scanlines share, and the range as a
    /// fractional index of depth planes.
    #[inline(always)]
    pub(in crate::host) fn without_shared(&self, range_mm: f32, loss_np: f32) -> [f32; 2] {
        let (_, _, position) = self.tracked(range_mm, loss_np);
        [self.gain(position), position]
    }

    /// Interval that contains a range, the fraction of its loss before the range, and the fractional plane index.
    #[inline(always)]
    fn tracked(&self, range_mm: f32, loss_np: f32) -> (Interval, f32, f32) {
        let (index, part) = self.index(range_mm);
        let interval = self.interval(index);
        let lost = interval.lost(part, loss_np);
        (interval, lost, interval.position(part, lost))
    }

    /// [`ApertureGain::at`] for all samples of a block within one interval. `falls` and `passed` are `fall_np_mm` and
    /// `ln_passed_at_zero` of each sample's segment.
    #[inline(always)]
    fn whole_block(&self, params: &Params, first: u32, index: usize, [falls, passed]: [&Lanes; 2]) -> Lanes {
        let interval = self.interval(index);
        let per_mm = 1.0 / self.plane_mm;
        let (mut ln_gain, mut positions) = ([0.0; BLOCK], [0.0; BLOCK]);
        for i in 0..BLOCK {
            let range_mm = range_mm(params, first.wrapping_add(i as u32));
            let part = range_mm * per_mm - real(index as u32);
            let lost = interval.lost(part, 0.5 * (falls[i] * range_mm - passed[i]));
            positions[i] = interval.position(part, lost) + 1.0;
            ln_gain[i] = -2.0 * (interval.shared_np + interval.row_np * lost);
        }
        // Positions in one interval span at most three plane distances.
        let low = floor(at_least(interval.positions[0] + 1.0, 0.0)) as usize;
        let node = |k: usize| self.row[(low + k).min(self.row.len() - 1)].ln_gain;
        let (start, steps) = (node(0), [node(1) - node(0), node(2) - node(1), node(3) - node(2)]);
        for i in 0..BLOCK {
            let beyond = positions[i] - real(low as u32);
            let within = |k: f32| at_most(at_least(beyond - k, 0.0), 1.0);
            ln_gain[i] += start + steps[0] * within(0.0) + steps[1] * within(1.0) + steps[2] * within(2.0);
        }
        ln_gain
    }

    /// ln of the two-way gain at a fractional plane index; −1 is the face.
    #[inline(always)]
    fn gain(&self, position: f32) -> f32 {
        let at = at_most(at_least(position + 1.0, 0.0), (self.row.len() - 1) as f32);
        let low = (at as usize).min(self.row.len() - 2);
        let part = at - low as f32;
        self.row[low].ln_gain * (1.0 - part) + self.row[low + 1].ln_gain * part
    }
}

/// The aperture's gains at the interfaces of a path, from the first to the last.
#[derive(Debug)]
pub(in crate::host) struct InterfaceGains<'a> {
    gain: ApertureGain<'a>,
    starts: &'a [f32],
    segments: &'a [Segment],
    /// Interval that contains the last interface, its index, and the path's loss up to the interval (one-way nepers).
    /// The interval's first position is the path's own.
    interval: Interval,
    index: usize,
    begins_np: f32,
    /// Indices of the segments that contain the start of that interval and the start of the previous one.
    holds: [usize; 2],
}

impl<'a> InterfaceGains<'a> {
    /// Gains of a path with these `starts` and `segments`.
    #[inline(always)]
    pub(in crate::host) fn new(gain: ApertureGain<'a>, (starts, segments): (&'a [f32], &'a [Segment])) -> Self {
        Self { gain, starts, segments, interval: gain.interval(0), index: usize::MAX, begins_np: 0.0, holds: [0; 2] }
    }

    /// ln of the two-way amplitude factor of an interface's echo: the aperture's gain before obstacles that the path
    /// has not crossed yet. The interface begins segment `arrived` + 1; `arrived` must not decrease from call to call.
    #[inline(always)]
    pub(in crate::host) fn at(&mut self, arrived: usize) -> f32 {
        let range_mm = self.starts[arrived + 1];
        let (index, part) = self.gain.index(range_mm);
        self.enter(index, arrived);
        let (interval, begins_np) = (self.interval, self.begins_np);
        let rise_np = self.segments[arrived].loss_np(range_mm) - begins_np;
        let lost = interval.lost(part, rise_np + interval.begins_np);
        // Plane `index` precedes obstacles that the path has not crossed. Only its own loss leads past that plane.
        let own_np = at_least(rise_np - interval.row_np * lost, 0.0);
        let furthest = at_least(index as f32 + own_np / (own_np + TRACKED_NP), interval.positions[0]);
        let position = at_most(interval.position(part, lost), furthest);
        self.gain.gain(position) - 2.0 * (interval.shared_np + interval.row_np * lost)
    }

    /// Makes `index` the current interval, for a path that has reached segment `arrived`.
    #[inline(always)]
    fn enter(&mut self, index: usize, arrived: usize) {
        let boundary_mm = |interval: usize| interval as f32 * self.gain.plane_mm;
        let holds = self.holding(self.holds[0], arrived, boundary_mm(index));
        if index == self.index && holds == self.holds[0] {
            return;
        }
        let loss_of = |interval: usize, holds: usize| self.segments[holds].loss_np(boundary_mm(interval));
        self.begins_np = loss_of(index, holds);
        self.interval = self.gain.interval(index);
        if let Some(before) = index.checked_sub(1) {
            // Lag of the position behind the depth. It is rescaled from the scanline's own loss in the previous
            // interval to the path's own loss there.
            let last = self.gain.interval(before);
            let lags = |own_np: f32| TRACKED_NP / (at_least(own_np, 0.0) + TRACKED_NP);
            let lag = (index as f32 - self.interval.positions[0]) / lags(last.own_np());
            let holds_before = self.holding(self.holds[1], arrived, boundary_mm(before));
            let own_np = self.begins_np - loss_of(before, holds_before) - last.row_np;
            self.interval.positions[0] = index as f32 - lags(own_np) * at_most(at_least(lag, 0.0), 1.0);
            self.holds[1] = holds_before;
        }
        (self.index, self.holds[0]) = (index, holds);
    }

    /// Index of the last segment from `from` to `arrived` that begins at or before a range.
    #[inline(always)]
    fn holding(&self, mut from: usize, arrived: usize, range_mm: f32) -> usize {
        while from < arrived && self.starts[from + 1] <= range_mm {
            from += 1;
        }
        from
    }
}
