//! Reordering of voxels, so that the axes run to the patient's left, back and head.

use glam::{DAffine3, DMat3, DVec3};
use rayon::prelude::*;

use super::{Image, LabelMap};

impl LabelMap {
    /// The volume with axes permuted and reversed such that i, j and k run as nearly as possible to left, posterior and
    /// superior.
    pub fn canonical(mut self) -> Self {
        let order = Order::of(self.lps_from_voxel, self.size);
        self.layers = self.layers.into_iter().map(|layer| order.apply(layer)).collect();
        (self.size, self.lps_from_voxel) = (order.size(), order.placement(self.lps_from_voxel));
        self
    }
}

impl Image {
    /// The volume with axes permuted and reversed such that i, j and k run as nearly as possible to left, posterior and
    /// superior.
    pub fn canonical(mut self) -> Self {
        let order = Order::of(self.lps_from_voxel, self.size);
        self.values = order.apply(self.values);
        (self.size, self.lps_from_voxel) = (order.size(), order.placement(self.lps_from_voxel));
        self
    }
}

/// For each new axis, the old axis that becomes it, and whether that axis is reversed.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Order {
    axes: [usize; 3],
    reversed: [bool; 3],
    old_size: [usize; 3],
}

impl Order {
    /// The order with the largest sum of absolute cosines between the axes and left, posterior and superior.
    fn of(lps_from_voxel: DAffine3, old_size: [usize; 3]) -> Self {
        let directions = [0, 1, 2].map(|axis| lps_from_voxel.matrix3.col(axis).normalize_or_zero());
        let along = |axes: [usize; 3]| (0..3).map(|new| directions[axes[new]][new].abs()).sum::<f64>();
        let mut best = [0, 1, 2];
        for axes in [[0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
            if along(axes) > along(best) {
                best = axes;
            }
        }
        let reversed = [0, 1, 2].map(|new| directions[best[new]][new] < 0.0);
        Self { axes: best, reversed, old_size }
    }

    fn size(self) -> [usize; 3] {
        self.axes.map(|axis| self.old_size[axis])
    }

    fn placement(self, lps_from_voxel: DAffine3) -> DAffine3 {
        let mut first = DVec3::ZERO;
        let columns = [0, 1, 2].map(|new| {
            let (old, reversed) = (self.axes[new], self.reversed[new]);
            let column = lps_from_voxel.matrix3.col(old);
            if reversed {
                first[old] = (self.old_size[old] - 1) as f64;
            }
            // A subtraction, since negation would give -0.
            if reversed { DVec3::ZERO - column } else { column }
        });
        let [x, y, z] = columns;
        DAffine3::from_mat3_translation(DMat3::from_cols(x, y, z), lps_from_voxel.transform_point3(first))
    }

    fn apply<T: Copy + Send + Sync + Default>(self, old: Vec<T>) -> Vec<T> {
        if self.axes == [0, 1, 2] && self.reversed == [false; 3] {
            return old;
        }
        let strides = [1, self.old_size[0], self.old_size[0] * self.old_size[1]];
        let size = self.size();
        // Contribution of the index `at` along the new axis to the index of a value in the old data.
        let part =
            |new: usize, at: usize| strides[self.axes[new]] * if self.reversed[new] { size[new] - 1 - at } else { at };
        let mut moved = vec![T::default(); old.len()];
        moved.par_chunks_mut(size[0] * size[1]).enumerate().for_each(|(k, slice)| {
            for (j, row) in slice.chunks_mut(size[0]).enumerate() {
                let start = part(1, j) + part(2, k);
                for (i, value) in row.iter_mut().enumerate() {
                    *value = old[start + part(0, i)];
                }
            }
        });
        moved
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const PERMUTATIONS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];

    fn map(size: [usize; 3], lps_from_voxel: DAffine3, labels: Vec<u16>) -> LabelMap {
        LabelMap {
            path: "a.nii".into(),
            size,
            lps_from_voxel,
            layers: vec![labels],
            segments: Vec::new(),
            remarks: Vec::new(),
        }
    }

    /// A copy of `whole` whose axis `new` is the original axis `axes[new]`, reversed if `reversed[new]`.
    fn rearranged(whole: &LabelMap, axes: [usize; 3], reversed: [bool; 3]) -> LabelMap {
        let order = Order { axes, reversed, old_size: whole.size };
        let labels = order.apply(whole.layers[0].clone());
        map(order.size(), order.placement(whole.lps_from_voxel), labels)
    }

    proptest! {
        #[test]
        fn rearranged_copies_become_equal(
            size in [1_usize..5, 1..5, 1..5],
            permutation in 0_usize..6,
            reversed in any::<[bool; 3]>(),
            angles in [-0.3_f64..0.3, -0.3..0.3, -0.3..0.3],
            origin in [-300.0_f64..300.0, -300.0..300.0, -300.0..300.0],
        ) {
            let rotation = DMat3::from_euler(glam::EulerRot::XYZ, angles[0], angles[1], angles[2]);
            let voxel_mm = DVec3::new(0.7, 1.5, 3.0);
            let affine = DAffine3::from_mat3_translation(rotation * DMat3::from_diagonal(voxel_mm), origin.into());
            let labels = (0..size.iter().product::<usize>()).map(|n| n as u16).collect();
            let whole = map(size, affine, labels);
            let copy = rearranged(&whole, PERMUTATIONS[permutation], reversed).canonical();
            prop_assert_eq!(&copy.layers, &whole.layers);
            prop_assert_eq!(copy.size, size);
            prop_assert!(copy.lps_from_voxel.abs_diff_eq(affine, 1e-9));
            prop_assert_eq!(whole.clone().canonical(), whole);
        }
    }

    #[test]
    fn voxels_keep_their_places_in_the_patient() {
        let affine = DAffine3::from_mat3_translation(
            DMat3::from_cols(DVec3::new(0.0, 0.0, -2.0), DVec3::new(-1.0, 0.0, 0.0), DVec3::new(0.0, 3.0, 0.0)),
            DVec3::new(10.0, 20.0, 30.0),
        );
        let size = [2, 3, 4];
        let mut labels = vec![0; 24];
        labels[1 + 2 * 2 + 2 * 3 * 3] = 7;
        let at = affine.transform_point3(DVec3::new(1.0, 2.0, 3.0));
        let moved = map(size, affine, labels).canonical();
        assert_eq!(moved.size, [3, 4, 2]);
        let index = moved.layers[0].iter().position(|label| *label == 7).unwrap();
        let voxel = DVec3::new((index % 3) as f64, (index / 3 % 4) as f64, (index / 12) as f64);
        assert_eq!(moved.lps_from_voxel.transform_point3(voxel), at);
        assert!((0..3).all(|axis| moved.lps_from_voxel.matrix3.col(axis)[axis] > 0.0));
    }

    #[test]
    fn axes_at_45_degrees_are_still_a_permutation() {
        let affine = DAffine3::from_rotation_z(std::f64::consts::FRAC_PI_4);
        let moved = map([2, 2, 1], affine, vec![1, 2, 3, 4]).canonical();
        let mut labels = moved.layers[0].clone();
        labels.sort_unstable();
        assert_eq!(labels, [1, 2, 3, 4]);
    }
}
