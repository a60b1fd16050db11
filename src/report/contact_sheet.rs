//! A contact sheet: rows of frames, columns of their maps, with the marks of a scanner's screen.

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
/// Left of an image: the scale of its levels.
const BAR_GUTTER: u32 = 44;
/// Right of an image: the depth scale.
const SCALE_GUTTER: u32 = 40;
const CAPTION_HEIGHT: u32 = 22;
const BACKGROUND: Rgb = [14, 16, 20];
const INK: Rgb = [214, 218, 224];
const FAINT_INK: Rgb = [128, 134, 144];

/// Map of a frame shown by a panel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Map {
    /// Grey levels, with a bar over this many dB.
    BMode {
        /// Black to white, dB.
        dynamic_range_db: f64,
    },
    /// Tissues in their colours.
    Segmentation,
    /// Attenuation in viridis.
    Attenuation,
}

/// One map of one frame, to be shown in the sheet.
#[derive(Debug, Clone)]
pub struct Panel {
    caption: String,
    image: RgbImage,
    map: Map,
    /// Segmentation numbers that occur.
    numbers: Vec<u8>,
}

/// A sheet of panels that share one sector.
#[derive(Debug, Clone)]
pub struct ContactSheet<'a> {
    /// First line; printable ASCII.
    pub title: String,
    /// Panels, row by row.
    pub rows: Vec<Vec<Panel>>,
    /// Sector of the frames.
    pub sector: &'a Sector,
    /// Image depth, mm.
    pub depth_mm: f64,
    /// Tissues of the segmentation numbers.
    pub tissues: &'a TissueTable,
    /// Width of an image in the sheet, pixels.
    pub panel_width: u32,
}

impl ContactSheet<'_> {
    /// A panel of `frame`, already reduced to the sheet's size, so that the frame may be overwritten. `caption` is
    /// printable ASCII.
    ///
    /// # Errors
    /// A map that does not have the frame's size.
    pub fn panel(&self, caption: impl Into<String>, frame: &Frame, map: Map) -> Result<Panel, SinkError> {
        let caption = caption.into();
        let named = Path::new(&caption);
        let shape = [frame.height as usize, frame.width as usize];
        let mut numbers = Vec::new();
        let colours: Vec<Rgb> = match map {
            Map::BMode { .. } => {
                check_shape(named, shape, frame.bmode.len())?;
                frame.bmode.iter().map(|&grey| [grey; 3]).collect()
            }
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
                let inside = frame.attenuation.iter().zip(&frame.mask);
                inside.map(|(&a, &mask)| if mask > 0 { colour::viridis(a) } else { [0; 3] }).collect()
            }
        };
        let (width, height) = self.image_size(frame.width, frame.height);
        let colour = |x: u32, y: u32| image::Rgb(colours[(y * frame.width + x) as usize]);
        let full = RgbImage::from_fn(frame.width, frame.height, colour);
        let image = resize(&full, width, height, FilterType::Triangle);
        Ok(Panel { caption, image, map, numbers })
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
        let (image_width, image_height) = self.image_size(self.sector.width, self.sector.height);
        let cell_width = BAR_GUTTER + image_width + SCALE_GUTTER;
        let cell_height = CAPTION_HEIGHT + image_height + MARGIN;
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0) as u32;
        let title_width = 2 * MARGIN + Text::Large.width(&self.title);
        let width = (2 * MARGIN + columns * cell_width).max(title_width);
        let legend = self.legend_entries();
        let lines = legend_lines(&legend, width);
        let top = 2 * MARGIN + Text::Large.height();
        let legend_top = top + self.rows.len() as u32 * cell_height;
        let height = legend_top + lines * (Text::Small.height() + 6) + MARGIN;

        let mut canvas = Canvas::new(width, height, BACKGROUND);
        canvas.text(MARGIN, MARGIN, &self.title, Text::Large, INK);
        for (y, row) in (top..).step_by(cell_height as usize).zip(&self.rows) {
            for (x, panel) in (MARGIN..).step_by(cell_width as usize).zip(row) {
                canvas.text(x + BAR_GUTTER, y, &panel.caption, Text::Small, INK);
                let image_y = y + CAPTION_HEIGHT;
                canvas.draw(x + BAR_GUTTER, image_y, &panel.image);
                draw_bar(&mut canvas, x, image_y, image_height, panel.map);
                self.draw_depth_scale(&mut canvas, x + BAR_GUTTER + image_width + 4, image_y);
            }
        }
        draw_legend(&mut canvas, legend_top, &legend, width);
        canvas
    }

    /// Ticks at every cm below the face's centre; numbered ticks are longer.
    fn draw_depth_scale(&self, canvas: &mut Canvas, x: u32, y: u32) {
        let shrink = f64::from(self.panel_width) / f64::from(self.sector.width.max(1));
        let row = |cm: u32| {
            let pixel = self.sector.pixel_from_probe(DVec2::new(0.0, f64::from(cm) * 10.0)).y * shrink;
            y + pixel.round().max(0.0) as u32
        };
        let deepest = (self.depth_mm / 10.0).floor().clamp(0.0, 100.0) as u32;
        // Numbers need room: every 5 cm, closer only in shallow images.
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

/// The scale of a panel's levels, in the gutter left of its image.
fn draw_bar(canvas: &mut Canvas, x: u32, y: u32, image_height: u32, map: Map) {
    let line = Text::Small.height();
    let (top, bottom) = match map {
        Map::BMode { dynamic_range_db } => ("0dB".to_owned(), format!("{:.0}", -dynamic_range_db)),
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

fn entry_width(name: &str) -> u32 {
    SWATCH + 6 + Text::Small.width(name) + 18
}

/// Place of each legend entry: x in pixels, and line.
fn legend_places<'a>(entries: &'a [(&'a str, Rgb)], width: u32) -> impl Iterator<Item = (u32, u32)> + 'a {
    let (mut x, mut line) = (MARGIN, 0);
    entries.iter().map(move |(name, _)| {
        let needed = entry_width(name);
        if x > MARGIN && x + needed > width - MARGIN {
            (x, line) = (MARGIN, line + 1);
        }
        let place = (x, line);
        x += needed;
        place
    })
}

fn legend_lines(entries: &[(&str, Rgb)], width: u32) -> u32 {
    legend_places(entries, width).last().map_or(0, |(_, line)| line + 1)
}

fn draw_legend(canvas: &mut Canvas, top: u32, entries: &[(&str, Rgb)], width: u32) {
    for ((x, line), (name, colour)) in legend_places(entries, width).zip(entries) {
        let y = top + line * (Text::Small.height() + 6);
        canvas.fill(x, y + 1, SWATCH, SWATCH, FAINT_INK);
        canvas.fill(x + 1, y + 2, SWATCH - 2, SWATCH - 2, *colour);
        canvas.text(x + SWATCH + 6, y, name, Text::Small, INK);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transducer::Probe;

    fn tissues() -> TissueTable {
        let tissue = crate::anatomy::Tissue::default();
        TissueTable::new(["blood", "bone_fetal", "liver"].map(|n| (n.to_owned(), tissue.clone()))).unwrap()
    }

    fn sheet<'a>(title: &str, sector: &'a Sector, tissues: &'a TissueTable, panel_width: u32) -> ContactSheet<'a> {
        ContactSheet { title: title.into(), rows: Vec::new(), sector, depth_mm: 150.0, tissues, panel_width }
    }

    fn frame(sector: &Sector, probe: &Probe) -> Frame {
        let mut frame = Frame { width: sector.width, height: sector.height, ..Frame::default() };
        for row in 0..sector.height {
            for column in 0..sector.width {
                let polar = Sector::polar(probe, sector.pixel_centre_mm(column, row));
                let depth = polar.map(|(_, depth)| depth);
                frame.bmode.push(depth.map_or(0, |d| (d * 1.6) as u8));
                frame.segmentation.push(depth.map_or(0, |d| if d < 70.0 { 1 } else { 3 }));
                frame.attenuation.push(depth.map_or(0.0, |d| (-d as f32 / 100.0).exp()));
                frame.mask.push(if depth.is_some() { 255 } else { 0 });
            }
        }
        frame
    }

    #[test]
    fn panels_keep_their_colours_and_the_legend_names_what_is_seen() {
        let probe = Probe::default();
        let sector = Sector::fit(&probe, 693, 500);
        let frame = frame(&sector, &probe);
        let tissues = tissues();
        let mut sheet = sheet("test", &sector, &tissues, 300);
        let maps = [Map::BMode { dynamic_range_db: 60.0 }, Map::Segmentation, Map::Attenuation];
        let row: Vec<_> = maps.iter().map(|&m| sheet.panel("a panel", &frame, m).unwrap()).collect();
        sheet.rows = vec![row.clone(), row];
        let names: Vec<_> = sheet.legend_entries().into_iter().map(|(name, _)| name).collect();
        assert_eq!(names, ["blood", "liver"]);

        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("sheet.png");
        sheet.write(&path).unwrap();
        let image = image::open(&path).unwrap().into_rgb8();
        let (cell, top) = (BAR_GUTTER + 300 + SCALE_GUTTER, 2 * MARGIN + Text::Large.height() + CAPTION_HEIGHT);
        // The middle column of each panel at a third of its height is at 36 mm, in blood.
        let at = |panel: u32, y: u32| image.get_pixel(MARGIN + panel * cell + BAR_GUTTER + 150, top + y).0;
        assert_eq!(at(1, 72), colour::tissue("blood"));
        assert_eq!(at(1, 200), colour::tissue("liver"));
        assert!(at(0, 200)[0] > at(0, 72)[0] && at(0, 72)[0] == at(0, 72)[2]);
        assert!(at(2, 72)[1] > at(2, 200)[1]);
        // Outside the sector every map is black.
        assert_eq!(*image.get_pixel(MARGIN + 2 * cell + BAR_GUTTER + 2, top + 2), image::Rgb([0; 3]));
    }

    #[test]
    fn an_empty_sheet_is_its_title() {
        let sector = Sector::fit(&Probe::default(), 64, 48);
        let tissues = TissueTable::default();
        let sheet = sheet("nothing", &sector, &tissues, 100);
        assert!(sheet.draw().size().0 > Text::Large.width("nothing"));
    }

    #[test]
    fn a_map_that_is_missing_is_an_error() {
        let sector = Sector::fit(&Probe::default(), 4, 4);
        let tissues = TissueTable::default();
        let sheet = sheet("", &sector, &tissues, 100);
        let frame = Frame { width: 4, height: 4, bmode: vec![0; 16], ..Frame::default() };
        let error = sheet.panel("key frame 2", &frame, Map::Segmentation).unwrap_err().to_string();
        assert!(error.contains("key frame 2"), "{error}");
    }
}
