//! Texture of tissues: level of their scattering at a position.

use glam::DVec3;

use crate::texture::{PackedTexture, SEPTUM_WIDTH, WAVE_VARIANCE, WAVES, waves};

/// Level of the scattering of a tissue at a position of the scene at rest, nepers of amplitude.
pub(crate) fn texture_level_np(texture: &PackedTexture, here_mm: DVec3) -> f64 {
    let [x, y, z, narrower] = texture.fibre.map(f64::from);
    let fibre = DVec3::new(x, y, z);
    let stretched_mm = here_mm + narrower * here_mm.dot(fibre) * fibre;
    let [cloud, grain, septa, level] = texture.amounts.map(f64::from);
    let field = |number: usize, at_mm: DVec3| {
        let [x, y, z, per_mm] = texture.fields[number].map(f64::from);
        gaussian_field(at_mm * per_mm + DVec3::new(x, y, z))
    };
    let septum = (-(field(2, stretched_mm) / SEPTUM_WIDTH).powi(2)).exp();
    level + cloud * field(0, stretched_mm) + grain * field(1, stretched_mm) + septa * septum
}

/// Value at a point of a Gaussian random field of variance 1 whose correlation at a distance d is e^(−d²/2).
fn gaussian_field(at: DVec3) -> f64 {
    let sum: f64 = waves()
        .iter()
        .map(|wave| {
            let [x, y, z, phase] = wave.map(f64::from);
            let turns = DVec3::new(x, y, z).dot(at) + phase;
            let u = 2.0 * (turns - turns.round()).abs();
            1.0 - 2.0 * u * u * (3.0 - 2.0 * u)
        })
        .sum();
    sum / (WAVES as f64 * WAVE_VARIANCE).sqrt()
}
