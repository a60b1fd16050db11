//! Smoothing of a net, which removes staircases but keeps volumes and thin parts.
//!
//! Vertices move to the mean of their neighbours and never leave their cells (Gibson 1998). Where several surfaces join
//! in a line, vertices move along that line only. Averaging shrinks curved surfaces. The average loss around a vertex
//! is restored along its normal, so thin tubes keep their diameter.

use glam::Vec3;
use rayon::prelude::*;

use super::nets::{NO_VERTEX, Net};

/// Largest distance of a vertex from its cell's centre along each axis, voxels; less than one half, so that a single
/// layer of voxels keeps some thickness.
const REACH: f32 = 0.45;
/// Rounds of averaging, each followed by restoring the lost volume.
const ROUNDS: usize = 5;
/// Averaging steps in a round.
const AVERAGES: usize = 5;
/// Averaging steps that spread a loss over the neighbourhood.
const SPREAD: usize = 12;

/// Freedom of movement of a vertex.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// On one surface: free.
    Surface,
    /// On a junction line of several surfaces: movable along the line.
    Line,
    /// At a point where several junction lines join: fixed.
    Corner,
}

impl Net {
    /// Kind of a vertex.
    pub(super) fn kind(&self, vertex: usize) -> Kind {
        match self.junctions[vertex].count_ones() {
            0 => Kind::Surface,
            2 => Kind::Line,
            _ => Kind::Corner,
        }
    }

    /// Smooths the net.
    pub fn smooth(&mut self) {
        let kinds: Vec<Kind> = (0..self.cells.len()).into_par_iter().map(|v| self.kind(v)).collect();
        for _ in 0..ROUNDS {
            for _ in 0..AVERAGES {
                self.average(&kinds);
            }
            self.give_back_around(&kinds);
        }
    }

    /// `offset` clamped such that the vertex stays in its cell, and stays on the faces of the grid.
    fn held(&self, vertex: usize, offset: Vec3) -> Vec3 {
        let border = self.border(vertex);
        let fixed = border | border >> 3;
        let mut offset = offset.clamp(Vec3::splat(-REACH), Vec3::splat(REACH));
        for axis in 0..3 {
            if fixed >> axis & 1 == 1 {
                offset[axis] = 0.0;
            }
        }
        offset
    }

    fn average(&mut self, kinds: &[Kind]) {
        let next = |v: usize| {
            let mask = match kinds[v] {
                Kind::Surface => 0x3f,
                Kind::Line => self.junctions[v],
                Kind::Corner => return self.offsets[v],
            };
            let here = Vec3::from(self.cells[v].map(f32::from));
            let (mut sum, mut count) = (Vec3::ZERO, 0.0);
            for (n, &other) in self.neighbours[v].iter().enumerate() {
                if mask >> n & 1 == 1 && other != NO_VERTEX {
                    let other = other as usize;
                    sum += Vec3::from(self.cells[other].map(f32::from)) - here + self.offsets[other];
                    count += 1.0;
                }
            }
            if count == 0.0 {
                return self.offsets[v];
            }
            self.held(v, 0.4 * self.offsets[v] + 0.6 * (sum / count))
        };
        self.offsets = (0..self.offsets.len()).into_par_iter().map(next).collect();
    }

    /// Unit normal of each vertex that lies on one surface, from the lower label to the higher; zero for other
    /// vertices.
    fn normals(&self, kinds: &[Kind]) -> Vec<Vec3> {
        let mut normals = vec![Vec3::ZERO; self.cells.len()];
        for quad in &self.quads {
            let [a, b, c, d] = quad.corners.map(|v| self.position(v as usize));
            let area = 0.5 * (c - a).cross(d - b);
            let area = if quad.sides[0] < quad.sides[1] { area } else { -area };
            for &v in &quad.corners {
                normals[v as usize] += area;
            }
        }
        let unit = |(normal, kind): (Vec3, &Kind)| {
            if *kind == Kind::Surface { normal.normalize_or_zero() } else { Vec3::ZERO }
        };
        normals.into_par_iter().zip(kinds).map(unit).collect()
    }

    /// Moves each vertex outward by the average distance that the surface around it has lost.
    fn give_back_around(&mut self, kinds: &[Kind]) {
        let normals = self.normals(kinds);
        let mut lost: Vec<f32> = self.offsets.par_iter().zip(&normals).map(|(o, n)| o.dot(*n)).collect();
        for _ in 0..SPREAD {
            let next = |v: usize| {
                if kinds[v] != Kind::Surface {
                    return 0.0;
                }
                let (mut sum, mut count) = (lost[v], 1.0);
                for &other in &self.neighbours[v] {
                    if other != NO_VERTEX && kinds[other as usize] == Kind::Surface {
                        sum += lost[other as usize];
                        count += 1.0;
                    }
                }
                sum / count
            };
            lost = (0..lost.len()).into_par_iter().map(next).collect();
        }
        let next = |v: usize| self.held(v, self.offsets[v] - normals[v] * lost[v]);
        self.offsets = (0..self.offsets.len()).into_par_iter().map(next).collect();
    }
}
