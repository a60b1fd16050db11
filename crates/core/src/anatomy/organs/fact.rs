//! Volume and position of an organ.

use glam::DVec3;

/// Volume and position of an organ.
#[derive(Debug, Clone, PartialEq)]
pub struct OrganFact {
    /// Name of the organ's class, for example `kidney_left`.
    pub name: String,
    /// Volume, ml.
    pub volume_ml: f64,
    /// Centre of mass, LPS, mm.
    pub centre_mm: DVec3,
    /// Whether the organ reaches the border of the scan, so that a part of it may be missing.
    pub is_cut: bool,
}

/// Whether a name fits a pattern. A pattern is a whole name, or the start of names if it ends in `*`. Case is
/// ignored; spaces and hyphens count as underscores.
pub(super) fn matches(pattern: &str, name: &str) -> bool {
    let name = name.replace([' ', '-'], "_").to_lowercase();
    let pattern = pattern.to_lowercase();
    match pattern.strip_suffix('*') {
        Some(start) => name.starts_with(start),
        None => name == pattern,
    }
}
