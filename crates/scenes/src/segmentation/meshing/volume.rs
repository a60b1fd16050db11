//! Volumes of labels, and correction of surfaces to given volumes.

use std::collections::HashMap;

use glam::DVec3;

use super::complex::Complex;
use super::smooth::Kind;
use super::{BORDER, NONE};

/// Rounds of moving surfaces.
const ROUNDS: usize = 8;

impl Complex {
    /// Volume that each label's surface encloses, mm³.
    pub fn volumes_mm3(&self) -> HashMap<u16, f64> {
        let mut volumes = HashMap::new();
        for triangle in &self.triangles {
            let [a, b, c] = triangle.corners.map(|v| self.vertices_mm[v as usize]);
            let volume = a.dot(b.cross(c)) / 6.0;
            *volumes.entry(triangle.sides[0]).or_default() += volume;
            *volumes.entry(triangle.sides[1]).or_default() -= volume;
        }
        volumes.remove(&NONE);
        volumes.remove(&BORDER);
        volumes
    }

    /// Moves surfaces along their normals until each label has its volume in `wanted_mm3`. No surface moves by more
    /// than `most_mm` in total. Lines where several surfaces join don't move.
    pub fn restore_volumes(&mut self, wanted_mm3: &HashMap<u16, f64>, most_mm: f64) {
        let step_mm = most_mm / ROUNDS as f64;
        for _ in 0..ROUNDS {
            let found = self.volumes_mm3();
            let mut areas: HashMap<u16, f64> = HashMap::new();
            let mut normals = vec![DVec3::ZERO; self.vertices_mm.len()];
            for triangle in &self.triangles {
                let [a, b, c] = triangle.corners.map(|v| self.vertices_mm[v as usize]);
                let area = 0.5 * (b - a).cross(c - a);
                let low_first = triangle.sides[0] < triangle.sides[1];
                for (&v, side) in triangle.corners.iter().zip([0, 1, 2]) {
                    normals[v as usize] += if low_first { area } else { -area };
                    if side < 2 && self.kinds[v as usize] == Kind::Surface {
                        *areas.entry(triangle.sides[side]).or_default() += area.length();
                    }
                }
            }
            let step = |label: u16| match (wanted_mm3.get(&label), found.get(&label), areas.get(&label)) {
                (Some(wanted), Some(found), Some(area)) if *area > 0.0 => (wanted - found) / area,
                _ => 0.0,
            };
            let steps: HashMap<u16, f64> = areas.keys().map(|&label| (label, step(label))).collect();
            let of = |label: u16| steps.get(&label).copied().unwrap_or(0.0);
            let mut growth = vec![0.0; self.vertices_mm.len()];
            for triangle in &self.triangles {
                let [low, high] = [triangle.sides[0].min(triangle.sides[1]), triangle.sides[0].max(triangle.sides[1])];
                for &v in &triangle.corners {
                    growth[v as usize] = of(low) - of(high);
                }
            }
            for (v, point) in self.vertices_mm.iter_mut().enumerate() {
                if self.kinds[v] != Kind::Surface {
                    continue;
                }
                let mut shift = normals[v].normalize_or_zero() * growth[v].clamp(-step_mm, step_mm);
                let fixed = self.borders[v] | self.borders[v] >> 3;
                (0..3).filter(|axis| fixed >> axis & 1 == 1).for_each(|axis| shift[axis] = 0.0);
                *point += shift;
            }
        }
    }
}
