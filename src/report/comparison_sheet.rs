//! Comparison sheet: rows of captioned images of the same region, next to their differences.

use std::path::Path;

use image::imageops::{FilterType, resize};
use image::{Rgb as Pixel, RgbImage};

use crate::sink::SinkError;
use crate::sink::canvas::{Canvas, Text};
use crate::sink::colour::Rgb;
use crate::sink::error::check_shape;

const MARGIN: u32 = 14;
const CAPTION_HEIGHT: u32 = 20;
const BACKGROUND: Rgb = [14, 16, 20];
const INK: Rgb = [214, 218, 224];
/// Difference that has the most saturated colour, grey levels.
pub const FULL_DIFFERENCE: f64 = 96.0;

/// One image of a sheet.
#[derive(Debug, Clone)]
pub struct Panel {
    caption: String,
    image: RgbImage,
}

/// Rows of panels under a title; all text is printable ASCII.
#[derive(Debug, Clone, Default)]
pub(crate) struct ComparisonSheet {
    /// First line of the sheet.
    pub title: String,
    /// Panels, row by row; the panels of a row have the same height.
    pub rows: Vec<Vec<Panel>>,
}

impl Panel {
    /// A panel of grey levels [height × width], reduced to `panel_width` pixels if wider.
    ///
    /// # Errors
    /// `levels` does not fill `size`.
    pub fn grey(
        caption: impl Into<String>,
        levels: &[u8],
        size: [usize; 2],
        panel_width: u32,
    ) -> Result<Self, SinkError> {
        Self::of(caption.into(), levels.len(), size, panel_width, |index| [levels[index]; 3])
    }

    /// A panel of `image` minus `reference`, both [height × width]. Pixels where `image` is brighter are red, darker
    /// ones blue. Colours saturate at [`FULL_DIFFERENCE`] levels.
    ///
    /// # Errors
    /// An image does not fill `size`.
    pub fn difference(
        caption: impl Into<String>,
        image: &[u8],
        reference: &[u8],
        size: [usize; 2],
        panel_width: u32,
    ) -> Result<Self, SinkError> {
        let colour = |index: usize| {
            let part = (f64::from(image[index]) - f64::from(reference[index])) / FULL_DIFFERENCE;
            let level = |part: f64| (part.clamp(0.0, 1.0) * 255.0).round() as u8;
            [level(part), level(0.35 * part.abs()), level(-part)]
        };
        Self::of(caption.into(), image.len().min(reference.len()), size, panel_width, colour)
    }

    fn of(
        caption: String,
        pixels: usize,
        [width, height]: [usize; 2],
        panel_width: u32,
        colour: impl Fn(usize) -> Rgb,
    ) -> Result<Self, SinkError> {
        check_shape(Path::new(&caption), [height, width], pixels)?;
        let full =
            RgbImage::from_fn(width as u32, height as u32, |x, y| Pixel(colour(y as usize * width + x as usize)));
        let image = if panel_width < full.width() {
            let scaled = f64::from(panel_width) * height as f64 / width as f64;
            resize(&full, panel_width.max(1), (scaled.round() as u32).max(1), FilterType::Triangle)
        } else {
            full
        };
        Ok(Self { caption, image })
    }
}

impl ComparisonSheet {
    /// Draws the sheet and writes it as a PNG.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(crate) fn write(&self, path: &Path) -> Result<(), SinkError> {
        self.draw().write(path)
    }

    fn draw(&self) -> Canvas {
        let step = |panel: &Panel| panel.image.width().max(Text::Small.width(&panel.caption)) + MARGIN;
        let row_width = |row: &Vec<Panel>| row.iter().map(step).sum::<u32>();
        let row_height = |row: &Vec<Panel>| {
            CAPTION_HEIGHT + row.iter().map(|panel| panel.image.height()).max().unwrap_or(0) + MARGIN
        };
        let widest = self.rows.iter().map(row_width).max().unwrap_or(0);
        let width = MARGIN + widest.max(Text::Large.width(&self.title) + MARGIN);
        let top = 2 * MARGIN + Text::Large.height();
        let height = top + self.rows.iter().map(row_height).sum::<u32>();
        let mut canvas = Canvas::new(width, height, BACKGROUND);
        canvas.text(MARGIN, MARGIN, &self.title, Text::Large, INK);
        let mut y = top;
        for row in &self.rows {
            let mut x = MARGIN;
            for panel in row {
                canvas.text(x, y, &panel.caption, Text::Small, INK);
                canvas.draw(x, y + CAPTION_HEIGHT, &panel.image);
                x += step(panel);
            }
            y += row_height(row);
        }
        canvas
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_stand_side_by_side_and_differences_have_their_sign() {
        let (a, b) = (vec![200; 60 * 40], vec![104; 60 * 40]);
        let grey = Panel::grey("LQ", &a, [60, 40], 500).unwrap();
        let brighter = Panel::difference("a - b", &a, &b, [60, 40], 30).unwrap();
        let darker = Panel::difference("b - a", &b, &a, [60, 40], 500).unwrap();
        assert_eq!(brighter.image.dimensions(), (30, 20));
        assert_eq!(brighter.image.get_pixel(5, 5).0, [255, 89, 0]);
        assert_eq!(darker.image.get_pixel(5, 5).0, [0, 89, 255]);
        let sheet = ComparisonSheet { title: "t".into(), rows: vec![vec![grey, brighter], vec![darker]] };
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("sheet.png");
        sheet.write(&path).unwrap();
        let image = image::open(&path).unwrap().into_rgb8();
        let top = 2 * MARGIN + Text::Large.height() + CAPTION_HEIGHT;
        assert_eq!(image.get_pixel(MARGIN + 3, top + 3).0, [200; 3]);
        assert_eq!(image.get_pixel(MARGIN + 60 + MARGIN + 3, top + 3).0, [255, 89, 0]);
        assert_eq!(image.get_pixel(MARGIN + 3, top + 40 + MARGIN + CAPTION_HEIGHT + 3).0, [0, 89, 255]);
    }

    #[test]
    fn levels_that_do_not_fill_their_size_are_an_error() {
        let error = Panel::grey("target", &[0; 5], [2, 3], 10).unwrap_err().to_string();
        assert!(error.contains("target"), "{error}");
        assert!(Panel::difference("d", &[0; 6], &[0; 5], [2, 3], 10).is_err());
        assert!(ComparisonSheet { title: "nothing".into(), rows: vec![] }.draw().size().1 > 0);
    }
}
