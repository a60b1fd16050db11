//! Segments of a path.

use glam::DVec3;

/// A straight stretch of a path in one medium. Position and ln amplitude are linear in the range ρ, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// Range at which the segment begins, mm.
    pub start_mm: f64,
    /// Scatterer lookup position at ρ = 0, mm.
    pub origin_mm: DVec3,
    /// Change of the lookup position per mm of range.
    pub step: DVec3,
    /// ln of the two-way amplitude at ρ = 0.
    pub ln_amplitude_at_zero: f64,
    /// Decrease of the ln amplitude per mm of range.
    pub fall_np_mm: f64,
    /// Mean amplitude of the medium's scatterers.
    pub scatterer_mean: f64,
    /// Standard deviation of the scatterers' amplitude.
    pub scatterer_deviation: f64,
    /// Fraction of the lattice's cells that contain a scatterer, in 1/131072.
    pub scatterer_density: u32,
    /// Number of the medium's texture; 0 if it is uniform.
    pub texture: usize,
    /// Whether the path has reflected before this segment.
    pub has_reflected: bool,
    /// ln of the two-way amplitude at ρ = 0 of a wave that passes every interface. After a reflection: the value at the
    /// segment's start, not extrapolated to ρ = 0.
    pub ln_passed_at_zero: f64,
    /// Amplitude of the echo of the interface at which the segment begins.
    pub echo: f64,
    /// Range of the echo, mm.
    pub echo_range_mm: f64,
}

impl Segment {
    /// Scatterer lookup position at `range_mm`, mm.
    pub fn scatterer_mm(&self, range_mm: f64) -> DVec3 {
        self.origin_mm + self.step * range_mm
    }

    /// ln of the two-way amplitude at `range_mm` of a wave that passes every interface. Invalid after a reflection.
    pub fn ln_passed(&self, range_mm: f64) -> f64 {
        self.ln_passed_at_zero - self.fall_np_mm * range_mm
    }

    /// ln of the two-way amplitude at `range_mm`.
    pub fn ln_amplitude(&self, range_mm: f64) -> f64 {
        self.ln_amplitude_at_zero - self.fall_np_mm * range_mm
    }
}

/// One path.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Path {
    /// Segments, in order of range; at least one.
    pub segments: Vec<Segment>,
}

/// Index of the segment that holds `range_mm`.
pub fn segment_at(path: &Path, range_mm: f64) -> usize {
    path.segments.partition_point(|segment| segment.start_mm <= range_mm).saturating_sub(1)
}
