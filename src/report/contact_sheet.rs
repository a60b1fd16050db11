//! Contact sheet: rows of frames and columns of their images and maps, with the marks of a scanner's screen.

use std::path::Path;

use glam::DVec2;
use image::RgbImage;
use image::imageops::{FilterType, resize};

use crate::anatomy::TissueTable;
use crate::render::Frame;
use crate::sink::SinkError;
use crate::sink::canvas::{Canvas, Text};
use crate::sink::colour::{self, Rgb};
use crate::sink::error::check_shape;
use crate::transducer::Sector;

const MARGIN: u32 = 14;
/// Width of the space left of an image for the scale of its levels, pixels.
const BAR_GUTTER: u32 = 44;
/// Width of the space right of an image for the depth scale, pixels.
const SCALE_GUTTER: u32 = 40;
/// Space between a line of text and what is below it, pixels.
const LINE_GAP: u32 = 4;
/// Smallest space between the texts of neighbouring columns, pixels.
const TEXT_GAP: u32 = 16;
const BACKGROUND: Rgb = [14, 16, 20];
const INK: Rgb = [214, 218, 224];
const FAINT_INK: Rgb = [128, 134, 144];

/// Map of a frame that a panel shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Map {
    /// Grey levels, with a bar over the dynamic range.
    BMode {
        /// Dynamic range from black to white, dB.
        dynamic_range_db: f64,
    },
    /// Tissues in their colours.
    Segmentation,
    /// Attenuation in the viridis colours.
    Attenuation,
}

/// One map of one frame, as the sheet shows it.
#[derive(Debug, Clone)]
pub struct Panel {
    caption: String,
    /// Line below the caption; may be empty.
    note: String,
    image: RgbImage,
    map: Map,
    /// Numbers of the tissues that the segmentation contains.
    numbers: Vec<u8>,
}

impl Panel {
    /// The same panel with a line below its caption, printable ASCII.
    #[must_use]
    pub fn with_note(self, note: impl Into<String>) -> Self {
        Self { note: note.into(), ..self }
    }
}

/// Position of a column in the sheet.
struct Column {
    /// Left edge of the column's images and texts, pixels.
    image_x: u32,
    /// Width from that edge to the next column's gutter, pixels.
    width: u32,
    /// Whether a scale of levels is left of the column's images.
    has_bar: bool,
}

/// A sheet of panels that share one sector.
#[derive(Debug, Clone)]
pub struct ContactSheet<'a> {
    /// First line of the sheet; printable ASCII.
    pub title: String,
    /// Lines below the title; printable ASCII.
    pub notes: Vec<String>,
    /// Panels, row by row.
    pub rows: Vec<Vec<Panel>>,
    /// Sector that all frames share.
    pub sector: &'a Sector,
    /// Image depth, mm.
    pub depth_mm: f64,
    /// Tissues behind the numbers of the segmentation.
    pub tissues: &'a TissueTable,
    /// Width of an image in the sheet, pixels.
    pub panel_width: u32,
}

impl ContactSheet<'_> {
    /// A panel of one map of `frame`. It is already reduced to the sheet's size, so the frame may be overwritten.
    /// `caption` is printable ASCII.
    ///
    /// # Errors
    /// A map that does not have the frame's size.
    pub fn panel(&self, caption: impl Into<String>, frame: &Frame, map: Map) -> Result<Panel, SinkError> {
        let caption = caption.into();
        let named = Path::new(&caption);
        let shape = [frame.height as usize, frame.width as usize];
        let mut numbers = Vec::new();
        let colours: Vec<Rgb> = match map {
            Map::BMode { .. } => return self.grey_panel(caption, &frame.bmode, [frame.width, frame.height], map),
            Map::Segmentation => {
                check_shape(named, shape, frame.segmentation.len())?;
                let palette = colour::segmentation_palette(self.tissues.names());
                let mut seen = [false; 256];
                frame.segmentation.iter().for_each(|&n| seen[usize::from(n)] = true);
                numbers = (1..=255).filter(|&n: &u8| seen[usize::from(n)]).collect();
                frame.segmentation.iter().map(|&n| palette[usize::from(n)]).collect()
            }
            Map::Attenuation => {
                check_shape(named, shape, frame.attenuation.len())?;
                check_shape(named, shape, frame.mask.len())?;
                let inside = frame.attenuation.iter().zip(&*frame.mask);
                inside.map(|(&a, &mask)| if mask > 0 { colour::viridis(a) } else { [0; 3] }).collect()
            }
        };
        let image = self.reduced([frame.width, frame.height], |index| colours[index]);
        Ok(Panel { caption, note: String::new(), image, map, numbers })
    }

    /// A panel as [`Self::panel`] makes it, for grey levels [height × width] that are not part of a frame.
    ///
    /// # Errors
    /// Levels that do not fill `size`, [width, height].
    pub(crate) fn grey_panel(
        &self,
        caption: impl Into<String>,
        levels: &[u8],
        size @ [width, height]: [u32; 2],
        map: Map,
    ) -> Result<Panel, SinkError> {
        let caption = caption.into();
        check_shape(Path::new(&caption), [height as usize, width as usize], levels.len())?;
        let image = self.reduced(size, |index| [levels[index]; 3]);
        Ok(Panel { caption, note: String::new(), image, map, numbers: Vec::new() })
    }

    /// Image at the sheet's size; `colour` returns the colour of each pixel of the full size by its index.
    fn reduced(&self, [full_width, full_height]: [u32; 2], colour: impl Fn(usize) -> Rgb) -> RgbImage {
        let (width, height) = self.image_size(full_width, full_height);
        let colour = |x: u32, y: u32| image::Rgb(colour((y * full_width + x) as usize));
        resize(&RgbImage::from_fn(full_width, full_height, colour), width, height, FilterType::Triangle)
    }

    /// Draws the sheet and writes it as a PNG.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), SinkError> {
        self.draw().write(path)
    }

    fn image_size(&self, width: u32, height: u32) -> (u32, u32) {
        let scaled = f64::from(self.panel_width) * f64::from(height) / f64::from(width.max(1));
        (self.panel_width.max(1), (scaled.round() as u32).max(1))
    }

    fn draw(&self) -> Canvas {
        let (_, image_height) = self.image_size(self.sector.width, self.sector.height);
        let line = Text::Large.height() + LINE_GAP;
        let columns = self.columns();
        let row_width = columns.last().map_or(0, |column| column.image_x + column.width);
        let head = std::iter::once(&self.title).chain(&self.notes);
        let head_width = head.map(|text| Text::Large.width(text)).max().unwrap_or(0) + MARGIN;
        let width = MARGIN + row_width.max(head_width);
        let legend = self.legend_entries();
        let top = 2 * MARGIN + line * (1 + self.notes.len() as u32);
        let noted = self.rows.iter().flatten().any(|panel| !panel.note.is_empty());
        let caption_height = if noted { 2 * line } else { line };
        let row_height = caption_height + image_height + MARGIN;
        let legend_top = top + self.rows.len() as u32 * row_height;
        let legend_height = legend_lines(&legend, width) * (Text::Small.height() + LEGEND_GAP);

        let mut canvas = Canvas::new(width, legend_top + legend_height + MARGIN, BACKGROUND);
        canvas.text(MARGIN, MARGIN, &self.title, Text::Large, INK);
        for (y, note) in (MARGIN + line..).step_by(line as usize).zip(&self.notes) {
            canvas.text(MARGIN, y, note, Text::Large, INK);
        }
        for (y, row) in (top..).step_by(row_height as usize).zip(&self.rows) {
            for (column, panel) in columns.iter().zip(row) {
                let (x, image_y) = (column.image_x, y + caption_height);
                canvas.text(x, y, &panel.caption, Text::Large, INK);
                canvas.text(x, y + line, &panel.note, Text::Large, INK);
                canvas.draw(x, image_y, &panel.image);
                if column.has_bar {
                    draw_bar(&mut canvas, x - BAR_GUTTER, image_y, image_height, panel.map);
                }
                self.draw_depth_scale(&mut canvas, x + panel.image.width() + 4, image_y);
            }
        }
        draw_legend(&mut canvas, legend_top, &legend, width);
        canvas
    }

    /// Columns of the sheet, each wide enough for its texts. A column has a bar unless the bar of its left neighbour
    /// is the same.
    fn columns(&self) -> Vec<Column> {
        let count = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let mut next_x = MARGIN;
        let mut columns = Vec::with_capacity(count);
        for index in 0..count {
            let panels = || self.rows.iter().filter_map(|row| row.get(index));
            let has_bar = self.rows.iter().any(|row| {
                let map = |index: usize| row.get(index).map(|panel| panel.map);
                map(index) != Some(Map::Segmentation) && (index == 0 || map(index) != map(index - 1))
            });
            let image_x = next_x + if has_bar { BAR_GUTTER } else { 0 };
            let texts = panels().flat_map(|panel| [&panel.caption, &panel.note]);
            let text_width = texts.map(|text| Text::Large.width(text)).max().unwrap_or(0) + TEXT_GAP;
            let width = (self.panel_width + SCALE_GUTTER).max(text_width);
            columns.push(Column { image_x, width, has_bar });
            next_x = image_x + width;
        }
        columns
    }

    /// Draws a tick at every cm below the face's centre; numbered ticks are longer.
    fn draw_depth_scale(&self, canvas: &mut Canvas, x: u32, y: u32) {
        let shrink = f64::from(self.panel_width) / f64::from(self.sector.width.max(1));
        let row = |cm: u32| {
            let pixel = self.sector.pixel_from_probe(DVec2::new(0.0, f64::from(cm) * 10.0)).y * shrink;
            y + pixel.round().max(0.0) as u32
        };
        let deepest = (self.depth_mm / 10.0).floor().clamp(0.0, 100.0) as u32;
        // Numbers need room, so every 5 cm has one; in shallow images every cm.
        let labelled = if deepest > 6 { 5 } else { 1 };
        for cm in 0..=deepest {
            let long = cm % labelled == 0;
            canvas.fill(x, row(cm), if long { 9 } else { 5 }, 1, if long { INK } else { FAINT_INK });
            if long {
                let text_y = row(cm).saturating_sub(Text::Small.height() / 2);
                let label = if cm == 0 { "cm".to_owned() } else { cm.to_string() };
                canvas.text(x + 12, text_y, &label, Text::Small, FAINT_INK);
            }
        }
    }

    fn legend_entries(&self) -> Vec<(&str, Rgb)> {
        let mut numbers: Vec<u8> = self.rows.iter().flatten().flat_map(|p| p.numbers.iter().copied()).collect();
        numbers.sort_unstable();
        numbers.dedup();
        let names = self.tissues.names();
        let name = |n: u8| names.get(usize::from(n).saturating_sub(1)).map(String::as_str);
        numbers.into_iter().filter_map(name).map(|name| (name, colour::tissue(name))).collect()
    }
}

/// Draws the scale of a panel's levels, in the gutter left of its image.
fn draw_bar(canvas: &mut Canvas, x: u32, y: u32, image_height: u32, map: Map) {
    let line = Text::Small.height();
    let (top, bottom) = match map {
        Map::BMode { dynamic_range_db } => ("0 dB".to_owned(), format!("{:.0}", -dynamic_range_db)),
        Map::Attenuation => ("1".to_owned(), "0".to_owned()),
        Map::Segmentation => return,
    };
    let height = (image_height / 2).max(2);
    canvas.text(x, y, &top, Text::Small, FAINT_INK);
    for step in 0..height {
        let level = 1.0 - step as f32 / (height - 1) as f32;
        let colour = match map {
            Map::Attenuation => colour::viridis(level),
            _ => [(level * 255.0).round() as u8; 3],
        };
        canvas.fill(x + 6, y + line + step, 12, 1, colour);
    }
    canvas.text(x, y + line + height + 1, &bottom, Text::Small, FAINT_INK);
}

const SWATCH: u32 = 14;
/// Space between lines of the legend, pixels.
const LEGEND_GAP: u32 = 6;

fn entry_width(name: &str) -> u32 {
    SWATCH + 6 + Text::Small.width(name) + 18
}

/// Position of each legend entry: x in pixels, and number of its line.
fn legend_positions<'a>(entries: &'a [(&'a str, Rgb)], width: u32) -> impl Iterator<Item = (u32, u32)> + 'a {
    let (mut x, mut line) = (MARGIN, 0);
    entries.iter().map(move |(name, _)| {
        let needed = entry_width(name);
        if x > MARGIN && x + needed > width - MARGIN {
            (x, line) = (MARGIN, line + 1);
        }
        let position = (x, line);
        x += needed;
        position
    })
}

fn legend_lines(entries: &[(&str, Rgb)], width: u32) -> u32 {
    legend_positions(entries, width).last().map_or(0, |(_, line)| line + 1)
}

fn draw_legend(canvas: &mut Canvas, top: u32, entries: &[(&str, Rgb)], width: u32) {
    for ((x, line), (name, colour)) in legend_positions(entries, width).zip(entries) {
        let y = top + line * (Text::Small.height() + LEGEND_GAP);
        canvas.fill(x, y + 1, SWATCH, SWATCH, FAINT_INK);
        canvas.fill(x + 1, y + 2, SWATCH - 2, SWATCH - 2, *colour);
        canvas.text(x + SWATCH + 6, y, name, Text::Small, INK);
    }
}

#[cfg(test)]
mod tests;
