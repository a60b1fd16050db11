//! Random numbers that are the same on every machine: SplitMix64 (Steele, Lea and Flood, "Fast splittable pseudorandom
//! number generators", OOPSLA 2014).

/// Increment of the generator's state from one number to the next.
const STEP: u64 = 0x9e37_79b9_7f4a_7c15;

/// Output of the generator for a state: 64 random bits. It also serves as a hash of `state`.
pub fn bits(state: u64) -> u64 {
    let mut z = state.wrapping_add(STEP);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// The upper 53 of `bits` as a number in 0..1.
pub fn fraction(bits: u64) -> f64 {
    (bits >> 11) as f64 / (1_u64 << 53) as f64
}

/// Number at position `index` (from 0) of the sequence of `seed`; in 0..1.
pub fn at(seed: u64, index: u64) -> f64 {
    fraction(bits(seed.wrapping_add(index.wrapping_mul(STEP))))
}

/// Generator of a sequence of random numbers.
#[derive(Debug, Clone)]
pub struct SplitMix64(u64);

impl SplitMix64 {
    /// Generator at the start of the sequence of `seed`.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next number, uniform in 0..1.
    pub fn unit(&mut self) -> f64 {
        let bits = bits(self.0);
        self.0 = self.0.wrapping_add(STEP);
        fraction(bits)
    }

    /// The next number, uniform in `low..high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// First output of `splitmix64.c` (Vigna, 2015) for the seeds 0 and 1234567.
    #[test]
    fn the_published_values_come_out() {
        assert_eq!(bits(0), 0xe220_a839_7b1d_cdaf);
        assert_eq!(bits(1_234_567), 6_457_827_717_110_365_317);
        assert_eq!(bits(1_234_567_u64.wrapping_add(STEP)), 3_203_168_211_198_807_973);
    }

    #[test]
    fn places_of_a_sequence_are_its_numbers_in_turn() {
        let mut random = SplitMix64::new(7);
        let numbers: Vec<f64> = (0..1000).map(|_| random.unit()).collect();
        assert!((0..1000).zip(&numbers).all(|(i, number)| at(7, i) == *number));
        assert!(numbers.iter().all(|number| (0.0..1.0).contains(number)));
        let mean = numbers.iter().sum::<f64>() / 1000.0;
        assert!((mean - 0.5).abs() < 0.03, "{mean}");
        assert!((0..1000).map(|_| random.between(-3.0, 5.0)).all(|number| (-3.0..5.0).contains(&number)));
    }
}
