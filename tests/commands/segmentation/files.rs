//! Writers of small volumes, independent of the readers.

use std::path::Path;

use glam::{DAffine3, DVec3};

/// A label map, to be written with the affine of the file's own axes.
pub(crate) struct Volume {
    pub(crate) size: [usize; 3],
    /// Transform from voxel index to LPS, mm.
    pub(crate) lps_from_voxel: DAffine3,
    /// Labels of the voxels, i fastest.
    pub(crate) labels: Vec<u8>,
}

impl Volume {
    /// Label map on a grid; `label_at` gives the label at a position (LPS, mm).
    pub(crate) fn of(size: [usize; 3], lps_from_voxel: DAffine3, label_at: impl Fn(DVec3) -> u8) -> Self {
        let mut labels = Vec::with_capacity(size.iter().product());
        for k in 0..size[2] {
            for j in 0..size[1] {
                for i in 0..size[0] {
                    labels.push(label_at(lps_from_voxel.transform_point3(DVec3::new(i as f64, j as f64, k as f64))));
                }
            }
        }
        Self { size, lps_from_voxel, labels }
    }

    /// The same map with axes permuted and reversed. Axis n of the result is axis `order[n]` of this map, reversed if
    /// `reversed[n]`.
    pub(crate) fn turned(&self, order: [usize; 3], reversed: [bool; 3]) -> Self {
        let size = order.map(|n| self.size[n]);
        let old = |new: [usize; 3]| {
            let mut at = [0; 3];
            for n in 0..3 {
                at[order[n]] = if reversed[n] { size[n] - 1 - new[n] } else { new[n] };
            }
            at
        };
        let mut labels = Vec::with_capacity(self.labels.len());
        for k in 0..size[2] {
            for j in 0..size[1] {
                for i in 0..size[0] {
                    let [a, b, c] = old([i, j, k]);
                    labels.push(self.labels[(c * self.size[1] + b) * self.size[0] + a]);
                }
            }
        }
        let place = |at: [usize; 3]| self.lps_from_voxel.transform_point3(DVec3::from_array(at.map(|v| v as f64)));
        let origin = place(old([0; 3]));
        let axis = |n: usize| {
            let sign = if reversed[n] { -1.0 } else { 1.0 };
            self.lps_from_voxel.matrix3.col(order[n]) * sign
        };
        let matrix = glam::DMat3::from_cols(axis(0), axis(1), axis(2));
        Self { size, lps_from_voxel: DAffine3 { matrix3: matrix, translation: origin }, labels }
    }

    /// Position of a voxel, LPS, mm.
    pub(crate) fn place(&self, index: usize) -> DVec3 {
        let [nx, ny, _] = self.size;
        let at = [index % nx, index / nx % ny, index / (nx * ny)];
        self.lps_from_voxel.transform_point3(DVec3::from_array(at.map(|v| v as f64)))
    }

    /// Bytes of a NIfTI-1 file with an sform.
    pub(crate) fn nifti(&self) -> Vec<u8> {
        let mut header = vec![0u8; 352];
        let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
        put(0, &348i32.to_le_bytes());
        for (n, size) in [3, self.size[0], self.size[1], self.size[2], 1, 1, 1, 1].into_iter().enumerate() {
            put(40 + 2 * n, &(size as i16).to_le_bytes());
        }
        put(70, &2i16.to_le_bytes());
        put(72, &8i16.to_le_bytes());
        let m = self.lps_from_voxel.matrix3;
        for (n, step) in [1.0, m.x_axis.length(), m.y_axis.length(), m.z_axis.length()].into_iter().enumerate() {
            put(76 + 4 * n, &(step as f32).to_le_bytes());
        }
        put(108, &352f32.to_le_bytes());
        put(112, &1f32.to_le_bytes());
        put(123, &[2]);
        put(254, &1i16.to_le_bytes());
        // RAS: x and y of LPS reversed.
        for (row, sign) in [(0, -1.0), (1, -1.0), (2, 1.0)] {
            let of = [m.x_axis[row], m.y_axis[row], m.z_axis[row], self.lps_from_voxel.translation[row]];
            for (n, value) in of.into_iter().enumerate() {
                put(280 + 16 * row + 4 * n, &((sign * value) as f32).to_le_bytes());
            }
        }
        put(344, b"n+1\0");
        header.extend(&self.labels);
        header
    }

    /// Bytes of a raw NRRD file in LPS.
    pub(crate) fn nrrd(&self) -> Vec<u8> {
        let vector = |v: DVec3| format!("({:?},{:?},{:?})", v.x, v.y, v.z);
        let m = self.lps_from_voxel.matrix3;
        let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis].map(vector);
        let [nx, ny, nz] = self.size;
        let origin = vector(self.lps_from_voxel.translation);
        let header = format!(
            "NRRD0004\ntype: unsigned char\ndimension: 3\nspace: left-posterior-superior\nsizes: {nx} {ny} {nz}\n\
             space directions: {x} {y} {z}\nkinds: domain domain domain\nencoding: raw\nspace origin: {origin}\n\n"
        );
        [header.into_bytes(), self.labels.clone()].concat()
    }
}

/// Writes a file; returns its path as text.
pub(crate) fn written(folder: &Path, name: &str, bytes: &[u8]) -> String {
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    path.display().to_string()
}
