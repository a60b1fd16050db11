//! Texture of tissues: level of their scattering at several positions at once.
#![allow(clippy::needless_range_loop, reason = "several arrays go together")]

use insonify_core::simd::{TO_INTEGER, exp};

use crate::texture::{PackedTexture, SEPTUM_WIDTH, WAVES};

/// Positions whose levels are found at once.
pub(in crate::host) const POSITIONS: usize = 16;
/// A coordinate, or a level, of each position.
pub(in crate::host) type Positions = [f32; POSITIONS];

/// Plane waves of a Gaussian random field: wave vector and phase of each.
#[derive(Debug, Clone, Copy)]
pub(in crate::host) struct Waves([[f32; 4]; WAVES]);

impl Waves {
    pub(in crate::host) fn new(waves: &[[f32; 4]; WAVES]) -> Self {
        Self(*waves)
    }

    /// Values at the positions of a Gaussian random field of variance 1 whose correlation at a distance d is e^(−d²/2).
    #[inline(always)]
    fn field(&self, &[x0, y0, z0, per_mm]: &[f32; 4], [x, y, z]: &[Positions; 3]) -> Positions {
        let mut at = [[0.0; POSITIONS]; 3];
        for j in 0..POSITIONS {
            (at[0][j], at[1][j], at[2][j]) = (x[j] * per_mm + x0, y[j] * per_mm + y0, z[j] * per_mm + z0);
        }
        let height = |wave: usize, j: usize| {
            let [wx, wy, wz, phase] = self.0[wave];
            let turns = wx * at[0][j] + wy * at[1][j] + wz * at[2][j] + phase;
            let whole = (turns + TO_INTEGER) - TO_INTEGER;
            let u = 2.0 * (turns - whole).abs();
            1.0 - 2.0 * u * u * (3.0 - 2.0 * u)
        };
        // The first two levels of the tree of sums are added in registers.
        let mut half = WAVES / 4;
        let mut heights = [[0.0; POSITIONS]; WAVES / 4];
        for (i, sums) in heights.iter_mut().enumerate() {
            for j in 0..POSITIONS {
                let near = height(i, j) + height(i + 2 * half, j);
                sums[j] = near + (height(i + half, j) + height(i + 3 * half, j));
            }
        }
        half /= 2;
        while half > 0 {
            for i in 0..half {
                for j in 0..POSITIONS {
                    heights[i][j] += heights[i + half][j];
                }
            }
            half /= 2;
        }
        heights[0].map(|height| height * FIELD_SCALE)
    }

    /// Amplitude factors of a tissue's scatterers at positions in the scene at rest.
    #[inline(always)]
    pub(in crate::host) fn gains(&self, texture: &PackedTexture, here_mm: &[Positions; 3]) -> Positions {
        let [fx, fy, fz, narrower] = texture.fibre;
        let mut stretched_mm = *here_mm;
        for j in 0..POSITIONS {
            let [x, y, z] = [here_mm[0][j], here_mm[1][j], here_mm[2][j]];
            let along = narrower * (x * fx + y * fy + z * fz);
            stretched_mm[0][j] = x + along * fx;
            stretched_mm[1][j] = y + along * fy;
            stretched_mm[2][j] = z + along * fz;
        }
        let [cloud, grain, septa, level] = texture.amounts;
        let mut levels = [level; POSITIONS];
        for (number, amount) in [cloud, grain].into_iter().enumerate() {
            if amount != 0.0 {
                let field = self.field(&texture.fields[number], &stretched_mm);
                for j in 0..POSITIONS {
                    levels[j] += amount * field[j];
                }
            }
        }
        if septa != 0.0 {
            let field = self.field(&texture.fields[2], &stretched_mm);
            for j in 0..POSITIONS {
                let field = field[j] * (1.0 / SEPTUM_WIDTH as f32);
                levels[j] += septa * exp(-(field * field).min(80.0));
            }
        }
        for level in &mut levels {
            *level = exp(*level);
        }
        levels
    }
}

/// 1/√(number of waves · variance of a wave).
const FIELD_SCALE: f32 = 0.358_715_03;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::WAVE_VARIANCE;

    #[test]
    fn the_scale_is_that_of_the_waves() {
        let scale = 1.0 / (WAVES as f64 * WAVE_VARIANCE).sqrt();
        assert!((f64::from(FIELD_SCALE) - scale).abs() < 1.0e-7, "{scale}");
    }
}
