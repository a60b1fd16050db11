//! Scene: chest wall over aerated lung.

use glam::Vec3;
use insonify::anatomy::analytic::{Part, joined, tube};

use super::{layer, wavy_layer};

/// Depth of the visceral pleura, at which the air begins, mm.
pub(super) const AIR_MM: f32 = 20.4;

/// Skin, fat, muscle, two ribs and the pleura over air, seen along the chest: the "bat sign" of lung ultrasound.
///
/// A-lines are reverberations between pleura and probe. The tracer knows only surfaces, so a sheet above the skin,
/// "probe face", stands for the probe. It reflects part of the sound, as a transducer's layers do. This holds while the
/// probe is level on the skin, anywhere along the chest.
///
/// There are no B-lines. They come from bubbles in fluid far smaller than a millimetre, which surfaces can't represent.
pub(crate) fn lung_air() -> Vec<Part> {
    let half = (80.0, 40.0);
    let rib = |x: f32| {
        let ring = |y| (Vec3::new(x, y, 13.6), (6.5, 3.6));
        tube(&[ring(-38.0), ring(38.0)], 64)
    };
    vec![
        layer("probe face", "probe_face", 1, half, (-4.0, -0.2)),
        layer("skin", "skin", 2, half, (0.2, 1.9)),
        wavy_layer("fat", "fat", 3, half, (1.8, 6.5), 0.1),
        wavy_layer("muscle", "muscle", 4, half, (6.1, 160.0), 0.3),
        wavy_layer("fascia", "fascia", 5, half, (6.0, 6.4), 0.3),
        layer("pleura", "pleura", 6, half, (AIR_MM - 0.4, 159.0)),
        layer("lung", "lung_air", 7, half, (AIR_MM, 158.0)),
        Part { name: "ribs", tissue: "bone_adult", priority: 8, mesh: joined([-19.0, 19.0].map(rib)) },
    ]
}
