//! Spatial compounding: mean of pictures whose scanlines are steered by several angles.
//!
//! Amplitudes are averaged, not their logarithms: the looks' speckle then adds as independent estimates of one amplitude
//! do (Trahey, Smith and von Ramm, IEEE Trans UFFC 33:257, 1986).

use rayon::prelude::*;

/// Bits of the mantissa by which the table of levels is looked up: steps of 0.004 dB.
const MANTISSA_BITS: u32 = 11;
/// Pixels per task.
const CHUNK: usize = 1 << 15;

/// Steering angles in the order in which looks are made, radians. The last one is 0: its lines and maps are kept.
pub(crate) fn steering(angles: u32, span_deg: f64) -> Vec<f64> {
    let half = f64::from(angles / 2);
    let step = if half > 0.0 { 0.5 * span_deg.to_radians() / half } else { 0.0 };
    // Neighbours in time lie on different sides, so that a moving picture leans to neither.
    let sides = (1..=angles / 2).rev().flat_map(|i| [-f64::from(i), f64::from(i)]);
    sides.chain([0.0]).map(|i| i * step).collect()
}

/// Amplitude of white in the unit of the sums. A sum is of whole numbers, so it stays exact however often a look is
/// replaced.
const WHITE: f64 = (1u64 << 50) as f64;

/// The last picture of each look, and their mean.
#[derive(Debug)]
pub(super) struct Compounding {
    /// Looks that show each pixel, one bit each.
    covered: Vec<u16>,
    looks: Vec<Vec<u8>>,
    /// Sums of the looks' amplitudes.
    sums: Vec<u64>,
    /// Looks that have been made, one bit each.
    made: u16,
    /// Mean over sum, by the looks that show a pixel.
    per_sum: Vec<f32>,
    dynamic_range_db: f64,
    amplitudes: [u64; 256],
    levels: Levels,
}

/// Grey levels of amplitudes in 0..=1, by the upper bits of their representation.
#[derive(Debug)]
struct Levels {
    table: Vec<u8>,
    first: u32,
}

impl Levels {
    fn new(dynamic_range_db: f64) -> Self {
        let shift = 23 - MANTISSA_BITS;
        let least = 10f64.powf(-dynamic_range_db / 20.0).max(1.0e-30) as f32;
        let (first, last) = (least.to_bits() >> shift, 1f32.to_bits() >> shift);
        let level = |bits: u32| {
            // The middle of the amplitudes with these bits.
            let amplitude = f64::from(f32::from_bits(bits << shift | 1 << (shift - 1)));
            let level = 1.0 + 20.0 * amplitude.log10() / dynamic_range_db;
            (255.0 * level.clamp(0.0, 1.0)).round() as u8
        };
        Self { table: (first..=last).map(level).collect(), first }
    }

    fn of(&self, amplitude: f32) -> u8 {
        let at = (amplitude.to_bits() >> (23 - MANTISSA_BITS)).saturating_sub(self.first);
        self.table.get(at as usize).copied().unwrap_or(255)
    }
}

impl Compounding {
    /// Pictures whose pixels the looks of `covered` show.
    pub(super) fn new(covered: Vec<u16>, looks: usize, dynamic_range_db: f64) -> Self {
        let pixels = covered.len();
        let amplitudes = amplitudes(dynamic_range_db);
        let levels = Levels::new(dynamic_range_db);
        let per_sum =
            |shown: u16| if shown == 0 { 0.0 } else { (1.0 / (WHITE * f64::from(shown.count_ones()))) as f32 };
        let per_sum = (0..1 << looks).map(per_sum).collect();
        let looks = vec![vec![0; pixels]; looks];
        Self { covered, looks, sums: vec![0; pixels], made: 0, per_sum, dynamic_range_db, amplitudes, levels }
    }

    /// Forgets the pictures so far; those from now on have this dynamic range, dB.
    pub(super) fn restart(&mut self, dynamic_range_db: f64) {
        self.made = 0;
        if self.dynamic_range_db != dynamic_range_db {
            self.dynamic_range_db = dynamic_range_db;
            self.amplitudes = amplitudes(dynamic_range_db);
            self.levels = Levels::new(dynamic_range_db);
        }
    }

    /// Leaves a look out of the mean until it is made again.
    pub(super) fn leave_out(&mut self, look: usize) {
        let bit = 1 << look;
        let Self { covered, looks, sums, made, amplitudes, .. } = self;
        let Some(kept) = looks.get(look).filter(|_| *made & bit != 0) else { return };
        *made &= !bit;
        let pixels = kept.par_chunks(CHUNK).zip(covered.par_chunks(CHUNK)).zip(sums.par_chunks_mut(CHUNK));
        pixels.for_each(|((kept, covered), sums)| {
            for ((level, covered), sum) in kept.iter().zip(covered).zip(sums) {
                if covered & bit != 0 {
                    *sum -= amplitudes[usize::from(*level)];
                }
            }
        });
    }

    /// Takes the picture of a look, and replaces it by the mean of the last pictures of all looks.
    pub(super) fn add(&mut self, look: usize, picture: &mut [u8]) {
        let Self { covered, looks, sums, made, per_sum, amplitudes, levels, .. } = self;
        let Some(kept) = looks.get_mut(look).filter(|kept| kept.len() == picture.len()) else { return };
        let (first, bit) = (*made == 0, 1 << look);
        let none = [0; 256];
        let replaced = if *made & bit == 0 { &none } else { &*amplitudes };
        *made |= bit;
        let made = *made;
        let pixels = picture.par_chunks_mut(CHUNK).zip(kept.par_chunks_mut(CHUNK));
        let chunks = pixels.zip(covered.par_chunks(CHUNK)).zip(sums.par_chunks_mut(CHUNK));
        chunks.for_each(|(((picture, kept), covered), sums)| {
            if first {
                sums.fill(0);
            }
            for (((level, kept), covered), sum) in picture.iter_mut().zip(kept).zip(covered).zip(sums) {
                // Outside its own sector a look is black, and doesn't count.
                if covered & bit != 0 {
                    *sum = *sum + amplitudes[usize::from(*level)] - replaced[usize::from(*kept)];
                    *kept = *level;
                }
                let per_sum = per_sum.get(usize::from(covered & made)).copied().unwrap_or(0.0);
                *level = levels.of(*sum as f32 * per_sum);
            }
        });
    }
}

/// Amplitudes of the grey levels; 1 is [`WHITE`].
fn amplitudes(dynamic_range_db: f64) -> [u64; 256] {
    std::array::from_fn(|level| (WHITE * 10f64.powf((level as f64 / 255.0 - 1.0) * dynamic_range_db / 20.0)) as u64)
}

/// The mean of the looks' pictures in f64: levels 0..=255 of the pixels that each look shows.
#[cfg(test)]
fn compounded(looks: &[(Vec<bool>, Vec<u8>)], dynamic_range_db: f64) -> Vec<f64> {
    let amplitude = |level: u8| 10f64.powf((f64::from(level) / 255.0 - 1.0) * dynamic_range_db / 20.0);
    let pixel = |i: usize| {
        let shown: Vec<f64> =
            looks.iter().filter(|(covers, _)| covers[i]).map(|(_, look)| amplitude(look[i])).collect();
        if shown.is_empty() {
            return 0.0;
        }
        let mean = shown.iter().sum::<f64>() / shown.len() as f64;
        255.0 * (1.0 + 20.0 * mean.log10() / dynamic_range_db).clamp(0.0, 1.0)
    };
    (0..looks.first().map_or(0, |(_, look)| look.len())).map(pixel).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random;

    #[test]
    fn angles_are_even_and_end_with_none() {
        let degrees =
            |angles, span| steering(angles, span).iter().map(|a| a.to_degrees().round() as i32).collect::<Vec<_>>();
        assert_eq!(degrees(1, 30.0), [0]);
        assert_eq!(degrees(3, 30.0), [-15, 15, 0]);
        assert_eq!(degrees(5, 20.0), [-10, 10, -5, 5, 0]);
    }

    #[test]
    fn a_mean_is_its_twins() {
        for range_db in [30.0, 60.0, 120.0, 200.0] {
            let pixels = 5000;
            let of = |look: u64| {
                let covers = (0..pixels).map(|i| random::at(look, i) > 0.2).collect::<Vec<bool>>();
                let levels = (0..pixels).map(|i| (255.0 * random::at(look + 50, i)) as u8).collect::<Vec<u8>>();
                (covers, levels)
            };
            let looks = [of(1), of(2), of(3)];
            let covered = (0..pixels as usize)
                .map(|i| looks.iter().enumerate().map(|(k, (covers, _))| u16::from(covers[i]) << k).sum())
                .collect();
            let mut compounding = Compounding::new(covered, 3, range_db);
            let mut mean = Vec::new();
            for (k, (_, levels)) in looks.iter().enumerate() {
                mean.clone_from(levels);
                compounding.add(k, &mut mean);
                let twin = compounded(&looks[..=k], range_db);
                let off = mean.iter().zip(&twin).map(|(&a, b)| (f64::from(a) - b).abs()).fold(0.0, f64::max);
                assert!(off < 0.55, "{range_db} dB, {k}: {off}");
            }
            // The same picture again changes nothing; another one replaces it.
            let before = mean.clone();
            let mut again = looks[1].1.clone();
            compounding.add(1, &mut again);
            assert_eq!(again, before);
            let other = [looks[0].clone(), (looks[1].0.clone(), of(7).1), looks[2].clone()];
            let off = |mean: &[u8], range_db: f64| {
                let twin = compounded(&other, range_db);
                mean.iter().zip(&twin).map(|(&a, b)| (f64::from(a) - b).abs()).fold(0.0, f64::max)
            };
            let mut mean = other[1].1.clone();
            compounding.add(1, &mut mean);
            assert!(mean != before && off(&mean, range_db) < 0.55, "{range_db} dB, replaced");
            // Without a look, the mean is that of the others; made again, it is as before.
            let whole = mean.clone();
            compounding.leave_out(0);
            compounding.leave_out(0);
            let mut fewer = other[1].1.clone();
            compounding.add(1, &mut fewer);
            let twin = compounded(&other[1..], range_db);
            let off_by = fewer.iter().zip(&twin).map(|(&a, b)| (f64::from(a) - b).abs()).fold(0.0, f64::max);
            assert!(off_by < 0.55 && fewer != whole, "{range_db} dB, left out: {off_by}");
            let mut back = other[0].1.clone();
            compounding.add(0, &mut back);
            assert_eq!(back, whole);
            // Anew with another range, in another order.
            compounding.restart(0.5 * range_db);
            for k in [2, 0, 1] {
                mean.clone_from(&other[k].1);
                compounding.add(k, &mut mean);
            }
            assert!(off(&mean, 0.5 * range_db) < 0.55, "{range_db} dB, anew");
        }
    }
}
