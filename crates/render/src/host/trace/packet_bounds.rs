//! Bounds of a packet's rays: a box outside these bounds is missed by every ray.

use super::traverse::{max, min, slack};
use super::tree::{WIDTH, WideNode};
use crate::host::lanes::{Lanes, RAYS, fold};

/// Least and greatest values of the rays' origins and directions along one axis.
#[derive(Debug, Clone, Copy)]
struct Span {
    origin: [f32; 2],
    direction: [f32; 2],
    reciprocal: [f32; 2],
    /// Rounding error of the distance to a box's side, mm.
    margin_mm: f32,
}

/// Bounds of a packet's rays.
#[derive(Debug)]
pub(super) struct PacketBounds {
    axes: [Span; 3],
    /// Whether all rays are finite. If not, every box counts as met.
    bounded: bool,
}

/// Minimum and maximum of the active lanes.
#[inline(always)]
fn range(of: &Lanes, on: &[bool; RAYS]) -> [f32; 2] {
    let (mut least, mut most) = ([0.0; RAYS], [0.0; RAYS]);
    for lane in 0..RAYS {
        least[lane] = if on[lane] { of[lane] } else { f32::INFINITY };
        most[lane] = if on[lane] { of[lane] } else { f32::NEG_INFINITY };
    }
    [fold(least, min), fold(most, max)]
}

impl PacketBounds {
    /// Bounds of the rays whose bits are set in `rays`. They search between `first_mm` and `last_mm` of distance.
    #[inline(always)]
    pub(super) fn new(
        [origin, direction, reciprocal]: [&[Lanes; 3]; 3],
        rays: u32,
        [first_mm, last_mm]: [f32; 2],
    ) -> Self {
        let mut on = [false; RAYS];
        for (lane, on) in on.iter_mut().enumerate() {
            *on = rays >> lane & 1 != 0;
        }
        let mut strays = [0.0; RAYS];
        for lane in 0..RAYS {
            // 0 for finite numbers only.
            let stray = |of: &[Lanes; 3]| (0..3).map(|axis| of[axis][lane] * 0.0).sum::<f32>();
            strays[lane] = if on[lane] { stray(origin) + stray(direction) + stray(reciprocal) } else { 0.0 };
        }
        let axes = std::array::from_fn(|axis| {
            let origin = range(&origin[axis], &on);
            let farthest = max(max(origin[0].abs(), origin[1].abs()), max(first_mm.abs(), last_mm.abs()));
            Span {
                origin,
                direction: range(&direction[axis], &on),
                reciprocal: range(&reciprocal[axis], &on),
                margin_mm: 4.0 * slack(0.0, farthest),
            }
        });
        Self { axes, bounded: strays.iter().sum::<f32>() == 0.0 }
    }

    /// Bit mask of a node's children that a ray may meet from `first` to `last`. `nearest` receives a lower bound of
    /// the entry distance of each child.
    ///
    /// Rounding is monotonic: a ray's distance to a side lies between the distances computed from the ends of the
    /// spans.
    #[inline(always)]
    pub(super) fn meets(&self, node: &WideNode, [first, last]: [f32; 2], nearest: &mut [f32; WIDTH]) -> u32 {
        *nearest = [first; WIDTH];
        if !self.bounded {
            return (1 << WIDTH) - 1;
        }
        let bounds = &node.bounds;
        let (mut from, mut to) = ([first; WIDTH], [last; WIDTH]);
        for (axis, span) in self.axes.iter().enumerate() {
            let [least, most] = span.reciprocal;
            let (near, far, last_origin, first_origin) = if least > 0.0 {
                (axis, 3 + axis, span.origin[1], span.origin[0])
            } else if most < 0.0 {
                (3 + axis, axis, span.origin[0], span.origin[1])
            } else {
                continue;
            };
            for i in 0..WIDTH {
                let (near, far) = (bounds[near][i] - last_origin, bounds[far][i] - first_origin);
                from[i] = max(from[i], min(near * least, near * most));
                to[i] = min(to[i], max(far * least, far * most));
            }
        }
        let mut mask = 0;
        for i in 0..WIDTH {
            mask |= u32::from(from[i] <= to[i] + 1.0e-4) << i;
        }
        *nearest = from;
        // An axis along which rays go both ways: bounds of their positions between the other axes' sides.
        for (axis, span) in self.axes.iter().enumerate() {
            let [least, most] = span.reciprocal;
            if least > 0.0 || most < 0.0 {
                continue;
            }
            let ([o0, o1], [d0, d1], margin) = (span.origin, span.direction, span.margin_mm);
            let mut outside = 0;
            for i in 0..WIDTH {
                // Distances may be negative, so either end of the range may give the bound.
                let lowest = o0 + min(min(d0 * from[i], d0 * to[i]), min(d1 * from[i], d1 * to[i])) - margin;
                let highest = o1 + max(max(d0 * from[i], d0 * to[i]), max(d1 * from[i], d1 * to[i])) + margin;
                outside |= u32::from((bounds[3 + axis][i] < lowest) | (bounds[axis][i] > highest)) << i;
            }
            mask &= !outside;
        }
        mask
    }
}
