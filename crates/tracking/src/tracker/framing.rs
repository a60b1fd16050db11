//! Resynchronisation after damaged bytes, for protocols whose records begin with a head; reading of numbers and texts.
//!
//! The removed bytes depend only on the stream, never on how it was split into pieces. A search examines a window of
//! fixed length, and a possible start of a head at the window's end counts as a head.

/// Largest number of noise bytes that one error covers.
pub(super) const NOISE_LIMIT: usize = 64;

/// Offset in `window`, at least 1, of the next possible head; the window's length if there is none. `plausible` tells
/// whether the bytes from an offset on may be a head.
pub(super) fn next_head(window: &[u8], plausible: impl Fn(&[u8]) -> bool) -> usize {
    (1..window.len()).find(|&start| plausible(&window[start..])).unwrap_or(window.len())
}

/// Number of noise bytes at the front of `buffer`, which doesn't start with a head; `None` if more bytes are needed.
pub(super) fn noise(buffer: &[u8], head_length: usize, plausible: impl Fn(&[u8]) -> bool) -> Option<usize> {
    let window = &buffer[..buffer.len().min(NOISE_LIMIT)];
    let start = next_head(window, &plausible);
    // A head near the window's end can't be recognised before more bytes arrive, unless the window is full.
    (window.len() == NOISE_LIMIT || start + head_length <= window.len()).then_some(start)
}

/// First bytes of a text, escaped, for an error message.
pub(super) fn quote(bytes: &[u8]) -> String {
    const LIMIT: usize = 32;
    let more = if bytes.len() > LIMIT { "..." } else { "" };
    format!("{}{more}", bytes[..bytes.len().min(LIMIT)].escape_ascii())
}

/// Little-endian u32 at `at`; 0 if the slice is too short. Callers check the length.
pub(super) fn u32_at(bytes: &[u8], at: usize) -> u32 {
    bytes.get(at..at + 4).and_then(|b| b.try_into().ok()).map_or(0, u32::from_le_bytes)
}

/// Little-endian f32 at `at`, like [`u32_at`].
pub(super) fn f32_at(bytes: &[u8], at: usize) -> f64 {
    f64::from(f32::from_bits(u32_at(bytes, at)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether the bytes may be the test's head, `AB`.
    fn plausible(bytes: &[u8]) -> bool {
        bytes[0] == b'A' && bytes.get(1).is_none_or(|&b| b == b'B')
    }

    #[test]
    fn noise_ends_at_a_head_however_the_stream_is_split() {
        assert_eq!(noise(b"xxAB", 2, plausible), Some(2));
        assert_eq!(noise(b"xxA", 2, plausible), None);
        assert_eq!(noise(b"xx", 2, plausible), None);
        let mut long = [b'x'; 100];
        assert_eq!(noise(&long, 2, plausible), Some(NOISE_LIMIT));
        long[NOISE_LIMIT - 1] = b'A';
        for length in NOISE_LIMIT..100 {
            assert_eq!(noise(&long[..length], 2, plausible), Some(NOISE_LIMIT - 1), "of {length}");
        }
    }
}
