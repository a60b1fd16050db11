//! Frames of half size, for videos.

/// A frame of half the width and height, rounded down to even numbers; each pixel is the mean of four.
///
/// `grey` is [height × width]. Returns the frame, its width and its height.
pub fn halved(grey: &[u8], width: u32, height: u32) -> (Vec<u8>, u32, u32) {
    let (half_width, half_height) = (width / 4 * 2, height / 4 * 2);
    let at = |x: u32, y: u32| u32::from(grey[(y * width + x) as usize]);
    let mean = |x: u32, y: u32| (at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1) + 2) / 4;
    let pixels = (0..half_height).flat_map(|y| (0..half_width).map(move |x| mean(2 * x, 2 * y) as u8)).collect();
    (pixels, half_width, half_height)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_halved_frame_is_the_mean_of_four_pixels() {
        let grey: Vec<u8> = (0..7 * 5).collect();
        let (half, width, height) = halved(&grey, 7, 5);
        assert_eq!((width, height), (2, 2));
        // The first block of four pixels is 0, 1, 7, 8.
        assert_eq!(half, [4, 6, 18, 20]);
    }
}
