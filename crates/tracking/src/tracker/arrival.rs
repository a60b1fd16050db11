//! Received bytes with their arrival times.

use std::collections::VecDeque;

use bytes::BytesMut;

/// Unconsumed bytes of a stream, and their arrival times.
#[derive(Debug, Default)]
pub(crate) struct StampedBuffer {
    /// The bytes; a decoder removes them from the front.
    pub(crate) bytes: BytesMut,
    /// Number of bytes received so far.
    total: u64,
    /// Stream offset of each piece's end, and the piece's arrival time, ns. Consumed pieces are removed.
    pieces: VecDeque<(u64, u64)>,
}

impl StampedBuffer {
    /// Appends `bytes`, which arrived at `time_ns`.
    pub(crate) fn push(&mut self, bytes: &[u8], time_ns: u64) {
        self.bytes.extend_from_slice(bytes);
        self.total += bytes.len() as u64;
        self.pieces.push_back((self.total, time_ns));
    }

    /// Arrival time of the first remaining byte, ns.
    pub(crate) fn first_byte_ns(&mut self) -> u64 {
        let position = self.total - self.bytes.len() as u64;
        while self.pieces.len() > 1 && self.pieces.front().is_some_and(|(end, _)| *end <= position) {
            self.pieces.pop_front();
        }
        self.pieces.front().map_or(0, |(_, time_ns)| *time_ns)
    }
}

#[cfg(test)]
mod tests {
    use bytes::Buf;

    use super::*;

    #[test]
    fn the_time_is_that_of_the_first_byte_left() {
        let mut buffer = StampedBuffer::default();
        let mut after = |consumed: usize, received: Option<(&[u8], u64)>| {
            buffer.bytes.advance(consumed);
            received.into_iter().for_each(|(bytes, time_ns)| buffer.push(bytes, time_ns));
            buffer.first_byte_ns()
        };
        assert_eq!(after(0, Some((b"abcd", 10))), 10);
        assert_eq!(after(0, Some((b"efg", 20))), 10);
        assert_eq!(after(3, None), 10);
        assert_eq!(after(1, None), 20);
        assert_eq!(after(2, Some((b"h", 30))), 20);
        assert_eq!(after(1, None), 30);
    }
}
