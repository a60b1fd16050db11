//! Regular grid of voxels and the labels on it.

use glam::{DAffine3, DVec3};

/// Regular grid of voxels.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// Number of voxels along i, j and k.
    pub size: [usize; 3],
    /// Patient position (LPS, mm) of a voxel index; voxel centres have whole indices.
    pub lps_from_voxel: DAffine3,
}

impl Grid {
    /// Number of voxels.
    pub fn len(&self) -> usize {
        self.size.iter().product()
    }

    /// Whether the grid has no voxel.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Distance between neighbouring voxels along i, j and k, mm.
    pub fn voxel_mm(&self) -> DVec3 {
        let m = self.lps_from_voxel.matrix3;
        DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length())
    }

    /// Volume of a voxel, mm³.
    pub fn voxel_mm3(&self) -> f64 {
        self.lps_from_voxel.matrix3.determinant().abs()
    }

    /// Distance in memory between neighbours along i, j and k, in elements.
    pub fn strides(&self) -> [usize; 3] {
        [1, self.size[0], self.size[0] * self.size[1]]
    }

    /// Indices along i, j and k of the voxel at `index` in memory.
    pub fn at(&self, index: usize) -> [usize; 3] {
        [index % self.size[0], index / self.size[0] % self.size[1], index / (self.size[0] * self.size[1])]
    }
}

/// Plane at which the scan ends, within the body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CutPlane {
    /// Point on the plane, LPS, mm.
    pub point_mm: DVec3,
    /// Unit normal.
    pub normal: DVec3,
}
