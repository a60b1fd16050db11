//! The state of one path on its way.

use glam::Vec3;

use super::membership::Inside;

/// Position of a path, and its propagated quantities.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct PathState {
    pub(super) line_ray: u32,
    pub(super) layer: u32,
    /// It carries no echo, and says where the others' scatterers lie.
    pub(super) guide: bool,
    /// Length a mm of depth in its layer.
    pub(super) stretch: f32,
    pub(super) origin: Vec3,
    pub(super) direction: Vec3,
    pub(super) inside: Inside,
    // Interfaces add in amplitude over rays and layers where they stay in phase, in power where they don't.
    pub(super) in_phase: f32,
    pub(super) in_power: f32,
    pub(super) here: u32,
    pub(super) range_mm: f32,
    pub(super) ln_amplitude: f32,
    /// Scatterers of different paths add in power: chance takes half of an interface's loss, this the other half.
    pub(super) ln_scatter: f32,
    pub(super) bounce: u32,
    pub(super) reflections: u32,
    pub(super) crossed: u32,
    pub(super) echo: f32,
    pub(super) echo_range_mm: f32,
    /// From where on along the ray crossings count, mm.
    pub(super) t_min: f32,
    pub(super) open: bool,
    /// From where the medium rests to where it is: scatterers are looked up at rest, so that speckle goes with its tissue.
    pub(super) carried_mm: Vec3,
    /// Crossings and segments that found no room.
    pub(super) lost: u32,
}
