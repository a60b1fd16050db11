//! Arrival times of the pieces of a byte stream.

use std::collections::VecDeque;

/// Arrival times of the pieces of a stream that a decoder has not consumed yet.
#[derive(Debug, Default)]
pub(crate) struct ArrivalTimes {
    /// Bytes received so far.
    total: u64,
    /// End offset of each piece in the stream, and its arrival time, ns. Consumed pieces are removed.
    pieces: VecDeque<(u64, u64)>,
}

impl ArrivalTimes {
    /// Notes that the next `length` bytes arrived at `time_ns`.
    pub(crate) fn push(&mut self, length: usize, time_ns: u64) {
        self.total += length as u64;
        self.pieces.push_back((self.total, time_ns));
    }

    /// Arrival time, ns, of the first of the last `left` bytes.
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
    fn the_time_is_that_of_the_first_byte_left() {
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
