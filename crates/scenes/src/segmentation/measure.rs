//! Voxel counts and centres of the labels of a map.

use std::collections::BTreeMap;

use glam::DVec3;
use insonify_core::anatomy::organs::OrganFact;
use rayon::prelude::*;

use super::volume::LabelMap;

/// Number of slabs that are counted in parallel.
const SLABS: usize = 8;

/// Voxel count, volume and centre of one label.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measure {
    /// Number of voxels.
    pub voxels: u64,
    /// Volume, ml.
    pub volume_ml: f64,
    /// Centre of mass, LPS, mm.
    pub centre_mm: DVec3,
    /// Whether the label reaches the border of the map.
    pub is_cut: bool,
}

impl Measure {
    /// Volume and position of this label as an organ called `name`.
    pub fn fact(&self, name: &str) -> OrganFact {
        let Self { volume_ml, centre_mm, is_cut, .. } = *self;
        OrganFact { name: name.to_owned(), volume_ml, centre_mm, is_cut }
    }
}

/// Sums over the voxels of one label.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    voxels: u64,
    at: [u64; 3],
    is_cut: bool,
}

/// Measures of all labels with voxels, except 0, by layer and label.
pub fn measure(map: &LabelMap) -> BTreeMap<(usize, u16), Measure> {
    let grid = map.grid();
    let mut measures = BTreeMap::new();
    for (layer, labels) in map.layers.iter().enumerate() {
        for (label, sums) in (0..=u16::MAX).zip(sums(labels, map.size)) {
            if sums.voxels == 0 || label == 0 {
                continue;
            }
            let mean = DVec3::from_array(sums.at.map(|sum| sum as f64 / sums.voxels as f64));
            let measure = Measure {
                voxels: sums.voxels,
                volume_ml: sums.voxels as f64 * grid.voxel_mm3() * 1e-3,
                centre_mm: map.lps_from_voxel.transform_point3(mean),
                is_cut: sums.is_cut,
            };
            measures.insert((layer, label), measure);
        }
    }
    measures
}

/// Sums of each label from 0 to the highest.
fn sums(labels: &[u16], size: [usize; 3]) -> Vec<Sums> {
    let highest = labels.par_iter().copied().max().unwrap_or(0);
    let none = || vec![Sums::default(); usize::from(highest) + 1];
    let [nx, ny, nz] = size;
    let slab = nz.div_ceil(SLABS).max(1);
    let of_slab = |number: usize| {
        let mut sums = none();
        for z in number * slab..((number + 1) * slab).min(nz) {
            for y in 0..ny {
                let row = &labels[(z * ny + y) * nx..][..nx];
                let is_border = y == 0 || y + 1 == ny || z == 0 || z + 1 == nz;
                for (x, &label) in row.iter().enumerate().filter(|(_, label)| **label != 0) {
                    let sums = &mut sums[usize::from(label)];
                    sums.voxels += 1;
                    sums.at[0] += x as u64;
                    sums.at[1] += y as u64;
                    sums.at[2] += z as u64;
                    sums.is_cut |= is_border || x == 0 || x + 1 == nx;
                }
            }
        }
        sums
    };
    let added = |mut a: Vec<Sums>, b: Vec<Sums>| {
        for (a, b) in a.iter_mut().zip(b) {
            a.voxels += b.voxels;
            a.at.iter_mut().zip(b.at).for_each(|(a, b)| *a += b);
            a.is_cut |= b.is_cut;
        }
        a
    };
    (0..SLABS).into_par_iter().map(of_slab).reduce(none, added)
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DVec3};

    use super::*;

    #[test]
    fn labels_are_counted_placed_and_known_to_be_cut() {
        let size = [7, 6, 30];
        let mut labels = vec![0u16; 7 * 6 * 30];
        let at = |x: usize, y: usize, z: usize| (z * 6 + y) * 7 + x;
        for z in 3..27 {
            labels[at(2, 3, z)] = 5;
        }
        labels[at(6, 3, 9)] = u16::MAX;
        let lps_from_voxel = DAffine3::from_translation(DVec3::X * 10.0) * DAffine3::from_scale(DVec3::splat(2.0));
        let map = LabelMap {
            path: "a.nii".into(),
            size,
            lps_from_voxel,
            layers: vec![labels],
            segments: Vec::new(),
            remarks: Vec::new(),
        };
        let measures = measure(&map);
        assert_eq!(measures.keys().copied().collect::<Vec<_>>(), [(0, 5), (0, u16::MAX)]);
        let tube = measures[&(0, 5)];
        assert_eq!((tube.voxels, tube.is_cut, measures[&(0, u16::MAX)].is_cut), (24, false, true));
        assert!((tube.volume_ml - 24.0 * 8e-3).abs() < 1e-12);
        assert!(tube.centre_mm.distance(DVec3::new(14.0, 6.0, 29.0)) < 1e-9, "{}", tube.centre_mm);
    }
}
