//! Variation between individuals.

use insonify_core::random::bits;

/// Pseudo-random number in 0..1, a function of the phantom's `seed` and of `what` only.
pub(super) fn random(seed: u64, what: u64) -> f32 {
    let state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(what.wrapping_mul(0xd1b5_4a32_d192_ed03));
    // An f32 holds 24 bits.
    (bits(state) >> 40) as f32 / (1u64 << 24) as f32
}

/// Deviation from the mean in -1..1; seed 0 is the mean itself.
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
