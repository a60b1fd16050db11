//! Effects along a path.

use insonify_core::settings::{Effect, EffectSet};

/// Switches of the effects along a path. If an effect is off, neutral values in the tables make its arithmetic do
/// nothing.
#[derive(Debug, Clone, Copy)]
pub(super) struct PathEffects {
    pub(super) moving: bool,
    pub(super) refraction: bool,
    pub(super) interface_echoes: bool,
    pub(super) roughness: bool,
    pub(super) reflections: bool,
    pub(super) aperture: bool,
}

impl PathEffects {
    /// The switches of a frame; `displaced`: whether any triangle of the scene moves.
    pub(super) fn new(effects: EffectSet, displaced: bool) -> Self {
        Self {
            moving: displaced && effects.has(Effect::Motion),
            refraction: effects.has(Effect::Refraction),
            interface_echoes: effects.has(Effect::InterfaceEchoes),
            roughness: effects.has(Effect::Roughness),
            reflections: effects.has(Effect::Reflections),
            aperture: effects.has(Effect::Aperture),
        }
    }
}
