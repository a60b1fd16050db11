//! Priority queue with a bucket for each range of costs. A push and a pop take constant time.

use std::collections::VecDeque;

/// Bits of a cost that don't select its bucket. The bits that do are the exponent and four bits of the fraction, so the
/// costs of a bucket differ by at most a sixteenth.
const SHIFT: u32 = 19;
/// Number of words with a bit for each bucket, and of bits in a word.
const WORDS: usize = 64;

/// Queue of items in ascending order of their buckets. Items of one bucket leave in the order in which they came.
pub(super) struct BucketQueue<T> {
    buckets: Vec<VecDeque<T>>,
    /// A bit for each bucket, set if the bucket has an item.
    filled: [u64; WORDS],
    /// A bit for each word of `filled`, set if the word isn't zero.
    filled_words: u64,
}

impl<T> BucketQueue<T> {
    /// An empty queue.
    pub(super) fn new() -> Self {
        let buckets = std::iter::repeat_with(VecDeque::new).take(WORDS * WORDS).collect();
        Self { buckets, filled: [0; WORDS], filled_words: 0 }
    }

    /// Adds an item. A negative cost counts as zero; an item whose cost is no number is dropped.
    pub(super) fn push(&mut self, cost: f32, item: T) {
        if cost.is_nan() {
            return;
        }
        let bucket = ((cost.max(0.0).to_bits() >> SHIFT) as usize).min(self.buckets.len() - 1);
        self.buckets[bucket].push_back(item);
        self.filled[bucket / WORDS] |= 1 << (bucket % WORDS);
        self.filled_words |= 1 << (bucket / WORDS);
    }

    /// Removes the first item of the lowest bucket that has one.
    pub(super) fn pop(&mut self) -> Option<T> {
        let word = self.filled_words.trailing_zeros() as usize;
        let bit = self.filled.get(word)?.trailing_zeros() as usize;
        let bucket = &mut self.buckets[word * WORDS + bit];
        let item = bucket.pop_front();
        if bucket.is_empty() {
            self.filled[word] &= !(1 << bit);
            if self.filled[word] == 0 {
                self.filled_words &= !(1 << word);
            }
        }
        item
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_leave_in_the_order_of_their_costs_to_a_sixteenth() {
        let mut queue = BucketQueue::new();
        // Costs over twelve decades, in a scrambled order.
        let costs: Vec<f32> = (0..5000).map(|i| 10f32.powf((i * 7919 % 12_000) as f32 / 1000.0 - 9.0)).collect();
        costs.iter().for_each(|&cost| queue.push(cost, cost));
        let found: Vec<f32> = std::iter::from_fn(|| queue.pop()).collect();
        assert_eq!(found.len(), costs.len());
        assert!(found.windows(2).all(|pair| pair[1] > pair[0] * (1.0 - 1.0 / 16.0)), "{found:?}");
        assert!(found.windows(2).any(|pair| pair[1] < pair[0]), "a sorted input proves nothing");
    }

    #[test]
    fn items_of_one_bucket_leave_first_come_first_served_and_any_cost_is_taken() {
        let mut queue = BucketQueue::new();
        for (cost, item) in [(1.0, 0), (-3.0, 1), (1.0, 2), (f32::INFINITY, 3), (0.0, 4), (f32::MIN_POSITIVE, 5)] {
            queue.push(cost, item);
        }
        assert_eq!(std::iter::from_fn(|| queue.pop()).collect::<Vec<_>>(), [1, 4, 5, 0, 2, 3]);
        queue.push(f32::NAN, 6);
        assert_eq!(queue.pop(), None);
    }
}
