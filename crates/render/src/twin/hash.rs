//! Integer hashes, identical bit for bit to `shaders/shared/hash.wgsl`.

use crate::constants::KRONECKER;

/// pcg3d (Jarzynski and Olano, "Hash functions for GPU rendering", JCGT 2020).
pub fn pcg3d(key: [u32; 3]) -> [u32; 3] {
    let spread = |[x, y, z]: [u32; 3]| {
        let x = x.wrapping_add(y.wrapping_mul(z));
        let y = y.wrapping_add(z.wrapping_mul(x));
        [x, y, z.wrapping_add(x.wrapping_mul(y))]
    };
    let seeds = key.map(|k| k.wrapping_mul(1664525).wrapping_add(1013904223));
    spread(spread(seeds).map(|v| v ^ (v >> 16)))
}

/// The upper 24 bits as a number in 0..1.
pub fn unit(bits: u32) -> f64 {
    f64::from(bits >> 8) / f64::from(1 << 24)
}

/// Random number in 0..1 for dimension `dim` (0..4) of a path's `bounce`-th interface. `line_ray` is the ray's index,
/// scanline × rays per scanline + ray. Low-discrepancy over the scanlines and rays at the first four interfaces, a
/// plain hash after them.
pub fn sample_unit(seed: u32, line_ray: u32, layer: u32, bounce: u32, dim: u32) -> f64 {
    let rotation = pcg3d([seed, layer, bounce * 4 + dim]);
    if bounce < 4 {
        return unit(line_ray.wrapping_mul(KRONECKER[(bounce * 4 + dim) as usize]).wrapping_add(rotation[0]));
    }
    unit(pcg3d([line_ray, rotation[0], rotation[1]])[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn generators_are_fractional_parts_of_irrationals() {
        let roots = [2, 3, 7, 11, 13, 19, 22, 29, 31, 43, 33, 53, 58, 71, 73].map(|n| f64::from(n).sqrt());
        let golden = 0.5 * (1.0 + 5f64.sqrt());
        for (generator, number) in KRONECKER.into_iter().zip(std::iter::once(golden).chain(roots)) {
            assert!((f64::from(generator) - number.fract() * 4294967296.0).abs() <= 1.0, "{generator} {number}");
        }
    }

    #[test]
    fn hashes_are_even() {
        let mean = (0..4096).map(|i| unit(pcg3d([i, 7, 9])[0])).sum::<f64>() / 4096.0;
        assert!((mean - 0.5).abs() < 4.0 * (1.0 / 12f64).sqrt() / 64.0, "{mean}");
    }
}
