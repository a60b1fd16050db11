//! Sums of squared distances to planes (Garland and Heckbert 1997).

use std::ops::{Add, AddAssign};

use glam::{DMat3, DVec3};

/// Weighted sum of squared distances of a point x from planes: xᵀAx + 2b·x + c.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Quadric {
    /// Elements of A: xx, xy, xz, yy, yz, zz.
    a: [f64; 6],
    b: [f64; 3],
    c: f64,
}

impl Quadric {
    /// Quadric of one plane: squared distance from the plane through `point` with this unit normal, times `weight`.
    pub(super) fn plane(point: DVec3, normal: DVec3, weight: f64) -> Self {
        let DVec3 { x, y, z } = normal;
        let d = -normal.dot(point);
        let scaled = |v: f64| weight * v;
        Self {
            a: [x * x, x * y, x * z, y * y, y * z, z * z].map(scaled),
            b: [x * d, y * d, z * d].map(scaled),
            c: weight * d * d,
        }
    }

    /// Value of the sum at `p`.
    pub(super) fn at(&self, p: DVec3) -> f64 {
        let [xx, xy, xz, yy, yz, zz] = self.a;
        let DVec3 { x, y, z } = p;
        let square = xx * x * x + yy * y * y + zz * z * z + 2.0 * (xy * x * y + xz * x * z + yz * y * z);
        (square + 2.0 * (self.b[0] * x + self.b[1] * y + self.b[2] * z) + self.c).max(0.0)
    }

    /// Point near `start` at which the sum is least. Directions that no plane constrains keep the position of `start`.
    pub(super) fn minimum(&self, start: DVec3) -> DVec3 {
        let [xx, xy, xz, yy, yz, zz] = self.a;
        let trace = xx + yy + zz;
        // A weak attraction to `start` keeps the system solvable where planes are nearly parallel.
        let pull = 1e-3 * trace;
        let matrix = DMat3::from_cols(
            DVec3::new(xx + pull, xy, xz),
            DVec3::new(xy, yy + pull, yz),
            DVec3::new(xz, yz, zz + pull),
        );
        let right = pull * start - DVec3::from_array(self.b);
        if trace <= 0.0 || matrix.determinant().abs() < 1e-30 {
            return start;
        }
        let found = matrix.inverse() * right;
        if found.is_finite() { found } else { start }
    }
}

impl Add for Quadric {
    type Output = Self;

    fn add(mut self, other: Self) -> Self {
        self += other;
        self
    }
}

impl AddAssign for Quadric {
    fn add_assign(&mut self, other: Self) {
        self.a.iter_mut().zip(other.a).for_each(|(a, b)| *a += b);
        self.b.iter_mut().zip(other.b).for_each(|(a, b)| *a += b);
        self.c += other.c;
    }
}
