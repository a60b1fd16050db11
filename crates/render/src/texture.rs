//! Texture of tissues: their scattering level as a fixed random function of position.
//!
//! A level is the sum of three functions of Gaussian random fields: clouds (coarse), grain (fine) and septa (bright or
//! dark sheets where their field passes through zero). A field is a sum of plane waves whose wave vectors follow the
//! field's spectrum: random Fourier features (Rahimi and Recht, NIPS 2007). It has no lattice, and does not repeat
//! within a body.

use std::sync::LazyLock;

use bytemuck::{Pod, Zeroable};

use insonify_core::anatomy::Tissue;
use insonify_core::random;

/// Number of plane waves in a field.
pub(crate) const WAVES: usize = 16;
/// Variance of a wave. Its value is 1 − 2u²(3 − 2u) at the distance u/2 from its crest, in turns.
pub(crate) const WAVE_VARIANCE: f64 = 0.485_714_285_714;
/// Parameter w of septa, exp(−(g/w)²), where g is a Gaussian random field of variance 1.
pub(crate) const SEPTUM_WIDTH: f64 = 0.35;
/// Nepers of a decibel.
const NP_PER_DB: f64 = std::f64::consts::LN_10 / 20.0;
/// Largest offset of a tissue's fields, in multiples of a field's scale.
const OFFSET: f64 = 100.0;

/// Texture of a tissue: `Texture` of `shaders/shared/texture.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct PackedTexture {
    /// Direction of the fibres (unit vector), and width over length of structures along them, minus 1.
    pub(crate) fibre: [f32; 4],
    /// Offset (in scales) and inverse scale (1/mm) of the fields of clouds, grain and septa.
    pub(crate) fields: [[f32; 4]; 3],
    /// Amplitudes of clouds, grain and septa, nepers, and an added level that keeps the mean power.
    pub(crate) amounts: [f32; 4],
}

impl PackedTexture {
    /// Whether a tissue has a texture.
    pub(crate) fn is_of(tissue: &Tissue) -> bool {
        [tissue.cloud_db, tissue.grain_db, tissue.septa_db] != [0.0; 3]
    }

    /// Texture of the tissue with this index; `None` if the tissue is uniform.
    pub(crate) fn new(index: usize, tissue: &Tissue) -> Option<Self> {
        if !Self::is_of(tissue) {
            return None;
        }
        let amounts = [tissue.cloud_db, tissue.grain_db, tissue.septa_db].map(|db| db * NP_PER_DB);
        // A field of scale s passes through zero every πs on average (Rice, Bell Syst Tech J 24:46, 1945).
        let scales_mm = [tissue.cloud_mm, tissue.grain_mm, tissue.septa_mm / std::f64::consts::PI];
        let fields = [0, 1, 2].map(|field| {
            let at = |axis: u64| (random::at(0x7465_7874 + index as u64, 8 * field as u64 + axis) - 0.5) * 2.0 * OFFSET;
            [at(0), at(1), at(2), 1.0 / scales_mm[field]].map(|v| v as f32)
        });
        let [x, y, z] = tissue.fibre;
        let length = (x * x + y * y + z * z).sqrt().max(1.0e-9);
        let [cloud, grain, septa] = amounts;
        // Keeps the mean of the power e^(2·level) at 1.
        let level = -(cloud * cloud + grain * grain + 0.5 * septa_mean_power(septa).ln());
        Some(Self {
            fibre: [x / length, y / length, z / length, 1.0 / tissue.fibre_ratio - 1.0].map(|v| v as f32),
            fields,
            amounts: [cloud, grain, septa, level].map(|v| v as f32),
        })
    }
}

/// Mean of e^(2·amount·septum) over the values of a Gaussian field.
fn septa_mean_power(amount: f64) -> f64 {
    const STEPS: i32 = 4000;
    if amount == 0.0 {
        return 1.0;
    }
    let (mut sum, mut total) = (0.0, 0.0);
    for step in -STEPS..=STEPS {
        let field = 6.0 * f64::from(step) / f64::from(STEPS);
        let weight = (-0.5 * field * field).exp();
        sum += weight * (2.0 * amount * (-(field / SEPTUM_WIDTH).powi(2)).exp()).exp();
        total += weight;
    }
    sum / total
}

/// Wave vector (turns per unit) and phase (turns) of each wave of a field of scale 1. Directions spread evenly over a
/// hemisphere, lengths over the radii of a Gaussian in three dimensions.
pub(crate) fn waves() -> &'static [[f32; 4]; WAVES] {
    static WAVE_VECTORS: LazyLock<[[f32; 4]; WAVES]> = LazyLock::new(wave_vectors);
    &WAVE_VECTORS
}

fn wave_vectors() -> [[f32; 4]; WAVES] {
    let golden = 0.5 * (5f64.sqrt() - 1.0);
    std::array::from_fn(|i| {
        let part = (i as f64 + 0.5) / WAVES as f64;
        let (z, turn) = (part, (i as f64 * golden).fract());
        let across = (1.0 - z * z).sqrt();
        let (sin, cos) = (std::f64::consts::TAU * turn).sin_cos();
        // Neighbouring directions get different quantiles: 7 and 16 have no common factor.
        let radius = radius_of(((7 * i % WAVES) as f64 + 0.5) / WAVES as f64) / std::f64::consts::TAU;
        [across * cos * radius, across * sin * radius, z * radius, random::at(0x7761_7665, i as u64)].map(|v| v as f32)
    })
}

/// Radius that contains the fraction `part` of a three-dimensional Gaussian of variance 1.
fn radius_of(part: f64) -> f64 {
    // Probability density of the radius: √(2/π)·r²·e^(−r²/2).
    const STEP: f64 = 1.0e-4;
    let (mut radius, mut sum) = (0.0_f64, 0.0);
    while sum < part && radius < 6.0 {
        radius += STEP;
        sum += STEP * (2.0 / std::f64::consts::PI).sqrt() * radius * radius * (-0.5 * radius * radius).exp();
    }
    radius
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::texture_level_np;
    use glam::DVec3;

    fn tissue(cloud_db: f64, septa_db: f64, fibre_ratio: f64) -> Tissue {
        Tissue {
            cloud_db,
            cloud_mm: 4.0,
            septa_db,
            septa_mm: 12.0,
            fibre_ratio,
            fibre: [0.0, 2.0, 0.0],
            ..Tissue::default()
        }
    }

    /// Levels (nepers) at random positions, each with the level at the position moved by `by_mm`.
    fn pairs(tissue: &Tissue, by_mm: DVec3) -> Vec<[f64; 2]> {
        let texture = PackedTexture::new(3, tissue).unwrap();
        let mut random = random::SplitMix64::new(5);
        let place = |random: &mut random::SplitMix64| DVec3::from_array([0; 3].map(|_| random.between(-150.0, 150.0)));
        (0..20_000)
            .map(|_| {
                let at = place(&mut random);
                [at, at + by_mm].map(|at| texture_level_np(&texture, at))
            })
            .collect()
    }

    fn moments(pairs: &[[f64; 2]]) -> (f64, f64, f64) {
        let count = pairs.len() as f64;
        let mean = pairs.iter().map(|p| p[0]).sum::<f64>() / count;
        let variance = pairs.iter().map(|p| (p[0] - mean).powi(2)).sum::<f64>() / count;
        let shared = pairs.iter().map(|p| (p[0] - mean) * (p[1] - mean)).sum::<f64>() / count;
        (mean, variance.sqrt() / NP_PER_DB, shared / variance)
    }

    #[test]
    fn clouds_have_their_contrast_and_their_scale() {
        for (by_mm, expected) in [(2.0_f64, 0.882), (4.0, 0.607), (8.0, 0.135), (16.0, 0.0)] {
            let mut sum = 0.0;
            for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
                let (_, deviation_db, correlation) = moments(&pairs(&tissue(2.0, 0.0, 1.0), by_mm * axis));
                assert!((deviation_db - 2.0).abs() < 0.1, "{deviation_db}");
                sum += correlation / 3.0;
            }
            assert!((sum - expected).abs() < 0.1, "{by_mm} mm: {sum}");
        }
    }

    #[test]
    fn nothing_repeats_within_a_sweep() {
        // A motion of 60 s at 5 mm/s.
        let texture = PackedTexture::new(3, &tissue(2.0, 0.0, 1.0)).unwrap();
        let mut random = random::SplitMix64::new(11);
        let places: Vec<DVec3> =
            (0..1500).map(|_| DVec3::from_array([0; 3].map(|_| random.between(-150.0, 150.0)))).collect();
        let levels = |by_mm: DVec3| {
            let levels: Vec<f64> = places.iter().map(|at| texture_level_np(&texture, *at + by_mm)).collect();
            let mean = levels.iter().sum::<f64>() / levels.len() as f64;
            levels.into_iter().map(|level| level - mean).collect::<Vec<_>>()
        };
        let power = |levels: &[f64]| levels.iter().map(|level| level * level).sum::<f64>();
        let here = levels(DVec3::ZERO);
        for axis in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE.normalize()] {
            for lag_mm in 12..300 {
                let there = levels(f64::from(lag_mm) * axis);
                let shared: f64 = here.iter().zip(&there).map(|(a, b)| a * b).sum();
                let alike = shared / (power(&here) * power(&there)).sqrt();
                assert!(alike < 0.75, "{alike} after {lag_mm} mm along {axis}");
            }
        }
    }

    #[test]
    fn fibres_stretch_clouds_along_their_direction() {
        let along = moments(&pairs(&tissue(2.0, 0.0, 4.0), 8.0 * DVec3::Y)).2;
        let across = moments(&pairs(&tissue(2.0, 0.0, 4.0), 8.0 * DVec3::X)).2;
        assert!(along > 0.75 && across < 0.35, "{along}, {across}");
    }

    #[test]
    fn texture_keeps_the_mean_power() {
        for tissue in [tissue(3.0, 0.0, 1.0), tissue(1.0, 6.0, 1.0), tissue(0.0, -6.0, 1.0)] {
            let power = pairs(&tissue, DVec3::ZERO).iter().map(|p| (2.0 * p[0]).exp()).sum::<f64>() / 20_000.0;
            assert!((10.0 * power.log10()).abs() < 0.25, "{:.2} dB", 10.0 * power.log10());
        }
        assert_eq!(PackedTexture::new(0, &Tissue::default()), None);
    }

    #[test]
    fn septa_have_their_distance() {
        let texture = PackedTexture::new(3, &tissue(0.0, 6.0, 1.0)).unwrap();
        let level = |x: f64, y: f64| texture_level_np(&texture, DVec3::new(x, y, 0.37 * y));
        // Crossings of the middle level along lines: two per septum.
        let (low, high) = (f64::from(texture.amounts[3]), f64::from(texture.amounts[2] + texture.amounts[3]));
        let mut crossings = 0;
        for line in 0..100 {
            let above = |i: i32| level(0.1 * f64::from(i), 3.1 * f64::from(line)) > 0.5 * (low + high);
            crossings += (0..3000).filter(|&i| above(i) != above(i + 1)).count();
        }
        let distance_mm = 300.0 * 100.0 / (0.5 * crossings as f64);
        assert!((distance_mm - 12.0).abs() < 1.5, "{distance_mm} mm");
    }
}
