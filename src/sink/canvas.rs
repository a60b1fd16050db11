//! A colour image to draw on: rectangles, images and captions.

use std::path::Path;

use image::{Rgb as Pixel, RgbImage};
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

use super::colour::Rgb;
use super::{SinkError, png};

/// Size of a caption.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Text {
    /// 16 pixels high.
    Small,
    /// 20 pixels high.
    Large,
}

impl Text {
    fn raster(self) -> RasterHeight {
        match self {
            Self::Small => RasterHeight::Size16,
            Self::Large => RasterHeight::Size20,
        }
    }

    /// Height of a line, pixels.
    pub(crate) fn height(self) -> u32 {
        self.raster().val() as u32
    }

    /// Width of `text`, pixels.
    pub(crate) fn width(self, text: &str) -> u32 {
        (get_raster_width(FontWeight::Regular, self.raster()) * text.chars().count()) as u32
    }
}

/// A canvas in RGB; drawing beyond its edges is clipped.
pub(crate) struct Canvas {
    image: RgbImage,
}

impl Canvas {
    /// A canvas filled with one colour.
    pub(crate) fn new(width: u32, height: u32, background: Rgb) -> Self {
        Self { image: RgbImage::from_pixel(width, height, Pixel(background)) }
    }

    /// Paints a rectangle.
    pub(crate) fn fill(&mut self, x: u32, y: u32, width: u32, height: u32, colour: Rgb) {
        for row in y..y.saturating_add(height).min(self.image.height()) {
            for column in x..x.saturating_add(width).min(self.image.width()) {
                self.image.put_pixel(column, row, Pixel(colour));
            }
        }
    }

    /// Copies an image, its upper left corner at (x, y).
    pub(crate) fn draw(&mut self, x: u32, y: u32, image: &RgbImage) {
        image::imageops::replace(&mut self.image, image, x.into(), y.into());
    }

    /// Writes a line of text, its upper left corner at (x, y). Characters beyond printable ASCII become `?`.
    pub(crate) fn text(&mut self, x: u32, y: u32, text: &str, size: Text, colour: Rgb) {
        let mut left = x;
        for c in text.chars() {
            let c = if (' '..='~').contains(&c) { c } else { '?' };
            let Some(glyph) = get_raster(c, FontWeight::Regular, size.raster()) else { continue };
            for (row, coverages) in (y..).zip(glyph.rows()) {
                for (column, &coverage) in (left..).zip(coverages) {
                    self.blend(column, row, colour, coverage);
                }
            }
            left = left.saturating_add(glyph.width() as u32);
        }
    }

    /// Writes text `factor` times as large.
    #[cfg(feature = "window")]
    pub(crate) fn text_enlarged(&mut self, x: u32, y: u32, text: &str, size: Text, factor: u32, colour: Rgb) {
        let (width, height) = (size.width(text), size.height());
        let mut small = Self::new(width, height, [0; 3]);
        small.text(0, 0, text, size, [255; 3]);
        for (column, row, pixel) in small.image.enumerate_pixels() {
            let (left, top) = (x.saturating_add(factor * column), y.saturating_add(factor * row));
            for (dx, dy) in (0..factor).flat_map(|dx| (0..factor).map(move |dy| (dx, dy))) {
                self.blend(left.saturating_add(dx), top.saturating_add(dy), colour, pixel.0[0]);
            }
        }
    }

    /// Writes the picture as a PNG.
    pub(crate) fn write(&self, path: &Path) -> Result<(), SinkError> {
        png::write_rgb(path, self.image.width(), self.image.height(), self.as_rgb())
    }

    /// Size, pixels.
    pub(crate) fn size(&self) -> (u32, u32) {
        self.image.dimensions()
    }

    /// The pixels [height × width × 3].
    pub(crate) fn as_rgb(&self) -> &[u8] {
        self.image.as_raw()
    }

    fn blend(&mut self, x: u32, y: u32, colour: Rgb, coverage: u8) {
        let Some(pixel) = self.image.get_pixel_mut_checked(x, y) else { return };
        let weight = u32::from(coverage);
        for (below, above) in pixel.0.iter_mut().zip(colour) {
            *below = ((u32::from(*below) * (255 - weight) + u32::from(above) * weight + 127) / 255) as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_stays_within_its_box_and_is_legible_ink() {
        let mut canvas = Canvas::new(200, 40, [0; 3]);
        canvas.text(10, 5, "LQ 1x1", Text::Small, [255; 3]);
        let (right, bottom) = (10 + Text::Small.width("LQ 1x1"), 5 + Text::Small.height());
        let mut ink = 0;
        for (x, y, pixel) in canvas.image.enumerate_pixels() {
            let inside = (10..right).contains(&x) && (5..bottom).contains(&y);
            assert!(inside || pixel.0 == [0; 3], "({x}, {y})");
            ink += u32::from(pixel.0[0] > 128);
        }
        assert!(ink > 60, "{ink}");
    }

    #[test]
    fn drawing_beyond_the_edges_is_cut_off() {
        let mut canvas = Canvas::new(8, 8, [1; 3]);
        canvas.fill(6, 6, u32::MAX, u32::MAX, [9; 3]);
        canvas.text(5, 5, "µm is not ASCII", Text::Large, [200; 3]);
        canvas.draw(7, 7, &RgbImage::new(5, 5));
        assert_eq!(&canvas.as_rgb()[..3], &[1; 3]);
        assert_eq!(canvas.image.get_pixel(7, 7).0, [0; 3]);
    }
}
