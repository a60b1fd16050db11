//! Conversion of a tuple's maps to bytes: tissue numbers to class indices, attenuation to levels.

use super::{ATTENUATION_POWER, DatasetError};

/// Number of low bits of an `f32` pattern that are dropped for an index into `Levels::least`.
const SHIFT: u32 = 17;
/// Number of indices into `Levels::least` for the values 0 to 1.
const CHOICES: usize = (ONE >> SHIFT) as usize + 1;
/// Bit pattern of 1.0 as an `f32`.
const ONE: u32 = 0x3f80_0000;

/// Tables that convert an attenuation a to its level 255 × a^[`ATTENUATION_POWER`], instead of computing the power.
pub(super) struct Levels {
    /// Level of the smallest value that has each index.
    least: Vec<u8>,
    /// For each level, the bit pattern of the smallest value that has the next level.
    next: [u32; 256],
}

impl Levels {
    pub(super) fn new() -> Self {
        // The bit patterns of non-negative numbers have the same order as the numbers, and levels rise with them. A
        // binary search is thus possible.
        let first_of = |level: u8| {
            let (mut below, mut reached) = (0, ONE + 1);
            while reached - below > 1 {
                let middle = below + (reached - below) / 2;
                if level_of(f32::from_bits(middle)) >= level { reached = middle } else { below = middle }
            }
            reached
        };
        let next = std::array::from_fn(|level| u8::try_from(level + 1).map_or(u32::MAX, first_of));
        let least = (0..CHOICES).map(|choice| level_of(f32::from_bits((choice as u32) << SHIFT))).collect();
        Self { least, next }
    }

    /// Appends the level of each value of an attenuation map (0 to 1) to `into`.
    pub(super) fn extend(&self, into: &mut Vec<u8>, attenuation: &[f32]) {
        into.extend(attenuation.iter().map(|&value| self.of(value)));
    }

    fn of(&self, value: f32) -> u8 {
        let bits = value.to_bits();
        match self.least.get((bits >> SHIFT) as usize) {
            Some(&least) => least + u8::from(bits >= self.next[usize::from(least)]),
            None => level_of(value),
        }
    }
}

/// Computes the level of an attenuation without tables.
fn level_of(attenuation: f32) -> u8 {
    (attenuation.powf(ATTENUATION_POWER) * 255.0).round() as u8
}

/// Appends the class index of each tissue number to `into`.
///
/// # Errors
/// A number has no class.
pub(super) fn extend_by_classes(into: &mut Vec<u8>, numbers: &[u8], class_of: &[u8]) -> Result<(), DatasetError> {
    let most = numbers.iter().copied().max().unwrap_or(0);
    if !numbers.is_empty() && usize::from(most) >= class_of.len() {
        return Err(DatasetError::Number { number: most });
    }
    let classes: [u8; 256] = std::array::from_fn(|number| class_of.get(number).copied().unwrap_or(0));
    into.extend(numbers.iter().map(|&number| classes[usize::from(number)]));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix64;

    #[test]
    fn levels_are_those_of_the_power() {
        let levels = Levels::new();
        let mut random = SplitMix64::new(7);
        // Tests the smallest value of each index, the borders of all levels, and random values of every magnitude.
        let borders =
            levels.next.iter().filter(|&&bits| bits <= ONE).flat_map(|&bits| bits - 300..=(bits + 300).min(ONE));
        let choices = (0..CHOICES as u32).flat_map(|choice| [choice << SHIFT, (choice << SHIFT).saturating_sub(1)]);
        let any = (0..1_000_000).map(|_| (random.unit() * f64::from(ONE)) as u32);
        for bits in borders.chain(choices).chain(any) {
            let value = f32::from_bits(bits);
            assert_eq!(levels.of(value), level_of(value), "{value:e}");
        }
        for beyond in [1.5, f32::NAN, -0.0, -1.0, f32::INFINITY] {
            assert_eq!(levels.of(beyond), level_of(beyond), "{beyond}");
        }
    }

    #[test]
    fn a_number_without_a_class_is_named() {
        let mut bytes = Vec::new();
        extend_by_classes(&mut bytes, &[0, 2, 1], &[0, 7, 9]).unwrap();
        assert_eq!(bytes, [0, 9, 7]);
        let error = extend_by_classes(&mut bytes, &[0, 3], &[0, 7, 9]).unwrap_err();
        assert!(matches!(error, DatasetError::Number { number: 3 }), "{error}");
    }
}
