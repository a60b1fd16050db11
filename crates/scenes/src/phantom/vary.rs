//! Variation between individuals.

use insonify_core::random::bits;

/// Pseudo-random number in 0..1 that depends only on the phantom's `seed` and on `what`, the number of the quantity.
pub(super) fn random(seed: u64, what: u64) -> f32 {
    let state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(what.wrapping_mul(0xd1b5_4a32_d192_ed03));
    // The upper 24 bits, as an f32 holds no more.
    (bits(state) >> 40) as f32 / (1u64 << 24) as f32
}

/// Deviation of the quantity `what` from its mean, -1..1; always 0 for seed 0, the mean individual.
pub(super) fn vary(seed: u64, what: u64) -> f32 {
    if seed == 0 { 0.0 } else { 2.0 * random(seed, what) - 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_fill_their_range_and_seed_0_is_the_mean() {
        let mean = (0..1000).map(|i| random(7, i)).sum::<f32>() / 1000.0;
        assert!((mean - 0.5).abs() < 0.03, "mean {mean}");
        assert!((0..1000).all(|i| (0.0..1.0).contains(&random(i, 3))));
        assert!((0..100).all(|i| vary(0, i) == 0.0));
        assert_ne!(vary(1, 5), vary(2, 5));
    }
}
