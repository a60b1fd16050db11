//! Texture of tissues: level of their scattering at a place.
#![allow(clippy::needless_range_loop, reason = "several arrays go together")]

use super::wide::{TO_INTEGER, exp};
use crate::render::texture::{PackedTexture, SEPTUM_WIDTH, WAVES};

/// Wave vectors and phases of a field, by coordinate.
#[derive(Debug, Clone, Copy)]
pub(super) struct Waves {
    along: [[f32; WAVES]; 3],
    phases: [f32; WAVES],
}

impl Waves {
    pub(super) fn new(waves: &[[f32; 4]; WAVES]) -> Self {
        Self {
            along: [0, 1, 2].map(|axis| std::array::from_fn(|i| waves[i][axis])),
            phases: std::array::from_fn(|i| waves[i][3]),
        }
    }

    /// A Gaussian random field of variance 1 whose correlation at a distance d is e^(−d²/2).
    #[inline(always)]
    fn field(&self, [x, y, z]: [f32; 3]) -> f32 {
        let mut heights = [0.0f32; WAVES];
        for i in 0..WAVES {
            let turns = self.along[0][i] * x + self.along[1][i] * y + self.along[2][i] * z + self.phases[i];
            let whole = (turns + TO_INTEGER) - TO_INTEGER;
            let u = 2.0 * (turns - whole).abs();
            heights[i] = 1.0 - 2.0 * u * u * (3.0 - 2.0 * u);
        }
        let mut half = WAVES / 2;
        while half > 0 {
            for i in 0..half {
                heights[i] += heights[i + half];
            }
            half /= 2;
        }
        heights[0] * FIELD_SCALE
    }

    /// Factor of the scattering of a tissue at a place of the scene at rest.
    #[inline(always)]
    pub(super) fn gain(&self, texture: &PackedTexture, here_mm: [f32; 3]) -> f32 {
        let [fx, fy, fz, narrower] = texture.fibre;
        let [x, y, z] = here_mm;
        let along = narrower * (x * fx + y * fy + z * fz);
        let stretched_mm = [x + along * fx, y + along * fy, z + along * fz];
        let [cloud, grain, septa, level] = texture.amounts;
        let mut level = level;
        for (number, amount) in [cloud, grain].into_iter().enumerate() {
            if amount != 0.0 {
                level += amount * self.field(placed(&texture.fields[number], stretched_mm));
            }
        }
        if septa != 0.0 {
            let field = self.field(placed(&texture.fields[2], stretched_mm)) * (1.0 / SEPTUM_WIDTH as f32);
            level += septa * exp(-(field * field).min(80.0));
        }
        exp(level)
    }
}

/// 1/√(waves · variance of a wave).
const FIELD_SCALE: f32 = 0.358_715_03;

/// A place in the units of a field.
#[inline(always)]
fn placed([x0, y0, z0, per_mm]: &[f32; 4], [x, y, z]: [f32; 3]) -> [f32; 3] {
    [x * per_mm + x0, y * per_mm + y0, z * per_mm + z0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::texture::WAVE_VARIANCE;

    #[test]
    fn the_scale_is_that_of_the_waves() {
        let scale = 1.0 / (WAVES as f64 * WAVE_VARIANCE).sqrt();
        assert!((f64::from(FIELD_SCALE) - scale).abs() < 1.0e-7, "{scale}");
    }
}
