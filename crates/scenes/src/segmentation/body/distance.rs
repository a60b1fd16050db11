//! Euclidean distance transform (Felzenszwalb and Huttenlocher 2012).

use glam::DVec3;
use rayon::prelude::*;

/// Mean distance from a curved border to the nearest voxel centre outside it, in voxels.
pub(crate) const BORDER_VOXELS: f64 = 0.33;

/// Distance from each voxel's centre to the nearest voxel centre of the mask `set`, mm; infinite if `set` is empty. The
/// x axis is the fastest.
pub fn distances_mm(set: &[bool], size: [usize; 3], voxel_mm: DVec3) -> Vec<f32> {
    let [nx, ny, nz] = size;
    let mut squares: Vec<f32> = vec![0.0; set.len()];
    squares.par_chunks_mut(nx.max(1)).zip(set.par_chunks(nx.max(1))).for_each(|(row, set)| {
        along_row(row, set, voxel_mm.x as f32);
    });
    // Along y within each layer of equal z.
    squares.par_chunks_mut((nx * ny).max(1)).for_each(|layer| {
        let mut line = Line::new(ny);
        for x in 0..nx {
            (0..ny).for_each(|y| line.values[y] = layer[y * nx + x]);
            line.transform(voxel_mm.y as f32);
            (0..ny).for_each(|y| layer[y * nx + x] = line.found[y]);
        }
    });
    // Along z, a plane of equal y at a time.
    let planes: Vec<Vec<f32>> = (0..ny)
        .into_par_iter()
        .map(|y| {
            let mut line = Line::new(nz);
            let mut plane = vec![0.0; nx * nz];
            for x in 0..nx {
                (0..nz).for_each(|z| line.values[z] = squares[(z * ny + y) * nx + x]);
                line.transform(voxel_mm.z as f32);
                (0..nz).for_each(|z| plane[z * nx + x] = line.found[z].sqrt());
            }
            plane
        })
        .collect();
    squares.par_chunks_mut(nx.max(1)).enumerate().for_each(|(row, values)| {
        let (y, z) = (row % ny, row / ny);
        values.copy_from_slice(&planes[y][z * nx..(z + 1) * nx]);
    });
    squares
}

/// Squared distances, mm², along a row in x to the nearest voxel of `set`.
fn along_row(row: &mut [f32], set: &[bool], step_mm: f32) {
    let mut distance = f32::INFINITY;
    for (value, &inside) in row.iter_mut().zip(set) {
        distance = if inside { 0.0 } else { distance + step_mm };
        *value = distance;
    }
    distance = f32::INFINITY;
    for (value, &inside) in row.iter_mut().zip(set).rev() {
        distance = if inside { 0.0 } else { distance + step_mm };
        let least = value.min(distance);
        *value = least * least;
    }
}

/// Working memory for one line: the lower envelope of the parabolas of squared distance.
struct Line {
    values: Vec<f32>,
    found: Vec<f32>,
    /// Vertices of the parabolas of the envelope, and the position from which each parabola is the lowest; in voxels.
    positions: Vec<usize>,
    starts: Vec<f32>,
}

impl Line {
    fn new(length: usize) -> Self {
        Self { values: vec![0.0; length], found: vec![0.0; length], positions: Vec::new(), starts: Vec::new() }
    }

    fn transform(&mut self, step_mm: f32) {
        self.positions.clear();
        self.starts.clear();
        let square = step_mm * step_mm;
        for (q, &value) in self.values.iter().enumerate() {
            if value.is_infinite() {
                continue;
            }
            let mut start = f32::NEG_INFINITY;
            while let (Some(&p), Some(&from)) = (self.positions.last(), self.starts.last()) {
                let (qf, pf) = (q as f32, p as f32);
                start = ((value - self.values[p]) / square + (qf * qf - pf * pf)) / (2.0 * (qf - pf));
                if start > from {
                    break;
                }
                self.positions.pop();
                self.starts.pop();
                start = f32::NEG_INFINITY;
            }
            self.positions.push(q);
            self.starts.push(start);
        }
        if self.positions.is_empty() {
            self.found.fill(f32::INFINITY);
            return;
        }
        let mut n = 0;
        for (x, found) in self.found.iter_mut().enumerate() {
            while n + 1 < self.positions.len() && self.starts[n + 1] < x as f32 {
                n += 1;
            }
            let away = (x as f32 - self.positions[n] as f32) * step_mm;
            *found = away * away + self.values[self.positions[n]];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_equal_those_of_a_search_over_all_voxels() {
        let (size, voxel_mm) = ([9, 7, 8], DVec3::new(0.8, 1.3, 2.5));
        let at = |i: usize| DVec3::new((i % 9) as f64, (i / 9 % 7) as f64, (i / 63) as f64) * voxel_mm;
        let set: Vec<bool> = (0..504).map(|i| i * 7919 % 41 == 3).collect();
        let found = distances_mm(&set, size, voxel_mm);
        for (i, found) in found.iter().enumerate() {
            let of = |j: usize| at(i).distance(at(j));
            let nearest = (0..504).filter(|&j| set[j]).map(of).fold(f64::INFINITY, f64::min);
            assert!((f64::from(*found) - nearest).abs() < 1e-4, "{i}: {found}, {nearest}");
        }
        assert!(distances_mm(&[false; 504], size, voxel_mm).iter().all(|d| d.is_infinite()));
    }
}
