//! When the bytes of a stream came.

use std::collections::VecDeque;

/// Remembers when each piece of a stream came, as long as a decoder has not used it up.
#[derive(Debug, Default)]
pub(crate) struct ArrivalTimes {
    /// Bytes so far.
    total: u64,
    /// Where each piece ends in the stream, and its time; those that were used up are removed.
    pieces: VecDeque<(u64, u64)>,
}

impl ArrivalTimes {
    /// The next `length` bytes came at `time_ns`.
    pub(crate) fn push(&mut self, length: usize, time_ns: u64) {
        self.total += length as u64;
        self.pieces.push_back((self.total, time_ns));
    }

    /// Time of the first of the last `left` bytes.
    pub(crate) fn of_first_of(&mut self, left: usize) -> u64 {
        let position = self.total - left as u64;
        while self.pieces.len() > 1 && self.pieces.front().is_some_and(|(end, _)| *end <= position) {
            self.pieces.pop_front();
        }
        self.pieces.front().map_or(0, |(_, time_ns)| *time_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_byte_left_gives_the_time() {
        let mut times = ArrivalTimes::default();
        times.push(4, 10);
        times.push(3, 20);
        assert_eq!(times.of_first_of(7), 10);
        assert_eq!(times.of_first_of(4), 10);
        assert_eq!(times.of_first_of(3), 20);
        times.push(1, 30);
        assert_eq!(times.of_first_of(2), 20);
        assert_eq!(times.of_first_of(1), 30);
    }
}
