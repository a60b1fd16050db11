//! The state of one path while it is traced.

use glam::Vec3;

use super::line_crossings::Progress;
use super::membership::Inside;

/// Position of a path, and its propagated quantities.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct PathState {
    pub(super) line_ray: u32,
    pub(super) layer: u32,
    /// Whether this is an axial path: it sets where the scatterers of its scanline lie, and its echoes replace those
    /// that reflected paths miss.
    pub(super) is_axial: bool,
    /// Whether the path follows reflections.
    pub(super) follows_reflections: bool,
    /// Length of the path per mm of depth.
    pub(super) stretch: f32,
    /// Depth of the path's start below the apex of the face, mm; negative on a convex face.
    pub(super) face_depth_mm: f32,
    pub(super) origin: Vec3,
    pub(super) direction: Vec3,
    /// Start of the path's straight line.
    pub(super) start: Vec3,
    /// Whether the path is on that line, and its next crossings are known. False from the first reflection on.
    pub(super) on_line: bool,
    /// Progress along the line's crossings.
    pub(super) progress: Progress,
    pub(super) inside: Inside,
    // Weights of an echo. Over rays and layers, echoes in phase add in amplitude, others in power.
    pub(super) in_phase: f32,
    pub(super) in_power: f32,
    pub(super) here: u32,
    pub(super) range_mm: f32,
    /// Range that this path saved in fast hard bodies, mm. The aperture's sound goes around such bodies and saves none.
    pub(super) behind_mm: f32,
    pub(super) ln_amplitude: f32,
    /// ln of an amplitude factor of the scatterers alone. Their powers add over the paths, so the random choice of
    /// reflection makes half of an interface's loss in nepers; this is the other half.
    pub(super) ln_scatter: f32,
    /// ln of a second amplitude factor of the scatterers alone. It is 0 until the path reflects. From then on the path also
    /// stands for the paths that follow no reflections.
    pub(super) ln_share: f32,
    /// ln of the two-way amplitude of a wave that passes every interface.
    pub(super) ln_passed: f32,
    /// Whether the path has reflected.
    pub(super) has_reflected: bool,
    pub(super) bounce: u32,
    pub(super) reflections: u32,
    pub(super) crossed: u32,
    pub(super) echo: f32,
    pub(super) echo_range_mm: f32,
    /// Distance along the ray beyond which crossings count, mm.
    pub(super) t_min: f32,
    pub(super) open: bool,
    /// Displacement of the medium from rest, mm: scatterers are looked up at rest, so speckle moves with its tissue.
    pub(super) carried_mm: Vec3,
    /// Number of crossings lost for lack of room.
    pub(super) lost: u32,
}
