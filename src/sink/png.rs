//! PNG images.

use std::path::Path;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use super::error::check_shape;
use super::{SinkError, write_with};

/// Compression effort: a higher effort takes more time for a smaller file. Both are lossless.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effort {
    /// For frame sequences: about 10 ms for a 1386 × 1000 B-mode image.
    Fast,
    /// For single images and label maps.
    Small,
}

/// Writes an 8-bit grey image: B-mode levels, tissue numbers or a mask, `grey` [height × width].
///
/// # Errors
/// `grey` does not have that size, or the file cannot be written.
pub fn write_grey(path: &Path, width: u32, height: u32, grey: &[u8], effort: Effort) -> Result<(), SinkError> {
    check_shape(path, [height as usize, width as usize], grey.len())?;
    encode(path, width, height, grey, ExtendedColorType::L8, effort)
}

/// Writes an 8-bit colour image, `rgb` [height × width × 3].
///
/// # Errors
/// `rgb` does not have that size, or the file cannot be written.
pub fn write_rgb(path: &Path, width: u32, height: u32, rgb: &[u8]) -> Result<(), SinkError> {
    check_shape(path, [height as usize, 3 * width as usize], rgb.len())?;
    encode(path, width, height, rgb, ExtendedColorType::Rgb8, Effort::Small)
}

/// Encodes an 8-bit colour image, `rgb` [height × width × 3], as the bytes of a PNG file.
///
/// # Errors
/// `rgb` does not have that size.
pub fn rgb_bytes(width: u32, height: u32, rgb: &[u8]) -> Result<Vec<u8>, SinkError> {
    let path = Path::new("a picture");
    check_shape(path, [height as usize, 3 * width as usize], rgb.len())?;
    let mut bytes = Vec::new();
    let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Default, FilterType::Adaptive);
    let encoded = encoder.write_image(rgb, width, height, ExtendedColorType::Rgb8);
    encoded.map_err(|source| SinkError::Image { path: path.to_owned(), source })?;
    Ok(bytes)
}

fn encode(
    path: &Path,
    width: u32,
    height: u32,
    data: &[u8],
    color: ExtendedColorType,
    effort: Effort,
) -> Result<(), SinkError> {
    let compression = match effort {
        Effort::Fast => CompressionType::Fast,
        Effort::Small => CompressionType::Default,
    };
    write_with(path, |w| {
        PngEncoder::new_with_quality(w, compression, FilterType::Adaptive)
            .write_image(data, width, height, color)
            .map_err(|source| SinkError::Image { path: path.to_owned(), source })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grey_levels_come_back_as_they_went() {
        let dir = tempfile::tempdir().unwrap();
        let grey: Vec<u8> = (0..37 * 23).map(|i| (i * 7 % 256) as u8).collect();
        for effort in [Effort::Fast, Effort::Small] {
            let path = dir.path().join("a.png");
            write_grey(&path, 37, 23, &grey, effort).unwrap();
            let back = image::open(&path).unwrap();
            assert_eq!(back.color(), image::ColorType::L8);
            assert_eq!((back.width(), back.height()), (37, 23));
            assert_eq!(back.into_bytes(), grey);
        }
    }

    #[test]
    fn colours_come_back_as_they_went() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        let rgb: Vec<u8> = (0..3 * 5 * 4).map(|i| (i * 4) as u8).collect();
        write_rgb(&path, 5, 4, &rgb).unwrap();
        assert_eq!(image::open(&path).unwrap().into_rgb8().into_raw(), rgb);
    }

    #[test]
    fn a_wrong_size_is_an_error_that_names_the_file() {
        let error = write_grey(Path::new("some/bmode.png"), 4, 4, &[0; 15], Effort::Fast).unwrap_err().to_string();
        assert!(error.contains("bmode.png") && error.contains("15") && error.contains("16"), "{error}");
    }
}
