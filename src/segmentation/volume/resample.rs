//! Images on the voxels of a label map.

use glam::DVec3;
use rayon::prelude::*;

use super::{Image, LabelMap};

/// Value of voxels outside the image: the radiodensity of air, HU.
pub const OUTSIDE: f32 = -1024.0;

/// Rounding of two affines that agree, voxels.
const EDGE: f64 = 1e-6;

impl Image {
    /// Values at the voxel centres of `map`, i fastest, interpolated linearly along each axis. Voxels of `map` whose
    /// centre is outside the image's voxels get `OUTSIDE`.
    pub fn resampled_like(&self, map: &LabelMap) -> Vec<f32> {
        let own_from_map = self.lps_from_voxel.inverse() * map.lps_from_voxel;
        let [width, height, _] = map.size;
        let mut values = vec![OUTSIDE; map.size.iter().product()];
        values.par_chunks_mut(width * height).enumerate().for_each(|(k, slice)| {
            for (index, value) in slice.iter_mut().enumerate() {
                let voxel = DVec3::new((index % width) as f64, (index / width) as f64, k as f64);
                *value = self.at_voxel(own_from_map.transform_point3(voxel)).unwrap_or(OUTSIDE);
            }
        });
        values
    }

    /// Value at a place in voxel indices; none more than half a voxel beyond the outermost centres.
    fn at_voxel(&self, place: DVec3) -> Option<f32> {
        let last = DVec3::from(self.size.map(|size| size as f64 - 1.0));
        let half = 0.5 + EDGE;
        if place.cmplt(DVec3::splat(-half)).any() || place.cmpgt(last + half).any() || !place.is_finite() {
            return None;
        }
        let inside = place.clamp(DVec3::ZERO, last);
        let low = inside.floor();
        let part = inside - low;
        let mut sum = 0.0;
        for corner in 0..8_usize {
            let offset = [corner & 1, corner >> 1 & 1, corner >> 2];
            let weight: f64 = (0..3).map(|a| if offset[a] == 1 { part[a] } else { 1.0 - part[a] }).product();
            // A corner without weight may lie beyond the last voxel, or hold NaN.
            if weight > 0.0 {
                let [i, j, k] = [0, 1, 2].map(|a| low[a] as usize + offset[a]);
                sum += weight * f64::from(self.values[i + self.size[0] * (j + self.size[1] * k)]);
            }
        }
        Some(sum as f32)
    }
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;

    fn image() -> Image {
        let affine = DAffine3::from_scale_rotation_translation(
            DVec3::new(2.0, 1.0, 0.5),
            glam::DQuat::from_rotation_x(0.2),
            DVec3::new(5.0, -3.0, 1.0),
        );
        let size = [4, 3, 2];
        let values = (0..24).map(|n| (n % 4) as f32 + 10.0 * (n / 4 % 3) as f32 + 100.0 * (n / 12) as f32).collect();
        Image { path: "ct.nii".into(), size, lps_from_voxel: affine, values, stated: None, remarks: Vec::new() }
    }

    fn map(lps_from_voxel: DAffine3, size: [usize; 3]) -> LabelMap {
        let layers = vec![vec![0; size.iter().product()]];
        LabelMap { path: "seg.nii".into(), size, lps_from_voxel, layers, segments: Vec::new(), remarks: Vec::new() }
    }

    #[test]
    fn the_same_voxels_give_the_same_values() {
        let image = image();
        assert_eq!(image.resampled_like(&map(image.lps_from_voxel, image.size)), image.values);
    }

    #[test]
    fn a_linear_image_is_interpolated_exactly() {
        let image = image();
        let shifted = image.lps_from_voxel * DAffine3::from_translation(DVec3::new(0.5, 0.25, 0.75));
        let values = image.resampled_like(&map(shifted, [3, 2, 1]));
        let expected = [0, 1, 2, 3, 4, 5].map(|n| 0.5 + (n % 3) as f32 + 10.0 * (0.25 + (n / 3) as f32) + 75.0);
        for (value, expected) in values.iter().zip(expected) {
            assert!((value - expected).abs() < 1e-3, "{value} {expected}");
        }
    }

    #[test]
    fn voxels_out_of_the_field_are_air() {
        let image = image();
        let shifted = image.lps_from_voxel * DAffine3::from_translation(DVec3::new(3.4, 0.0, 0.0));
        assert_eq!(image.resampled_like(&map(shifted, [2, 1, 1])), [3.0, OUTSIDE]);
    }
}
