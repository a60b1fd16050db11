//! Tests of the layout of contact sheets.

use super::*;
use crate::transducer::Probe;

fn tissues() -> TissueTable {
    let tissue = crate::anatomy::Tissue::default();
    TissueTable::new(["blood", "bone_fetal", "liver"].map(|n| (n.to_owned(), tissue.clone()))).unwrap()
}

fn sheet<'a>(title: &str, sector: &'a Sector, tissues: &'a TissueTable, panel_width: u32) -> ContactSheet<'a> {
    let (title, notes, rows) = (title.into(), Vec::new(), Vec::new());
    ContactSheet { title, notes, rows, sector, depth_mm: 150.0, tissues, panel_width }
}

fn frame(sector: &Sector, probe: &Probe) -> Frame {
    let mut frame = Frame { width: sector.width, height: sector.height, ..Frame::default() };
    let mut mask = Vec::new();
    for row in 0..sector.height {
        for column in 0..sector.width {
            let polar = Sector::polar(probe, sector.pixel_centre_mm(column, row));
            let depth = polar.map(|(_, depth)| depth);
            frame.bmode.push(depth.map_or(0, |d| (d * 1.6) as u8));
            frame.segmentation.push(depth.map_or(0, |d| if d < 70.0 { 1 } else { 3 }));
            frame.attenuation.push(depth.map_or(0.0, |d| (-d as f32 / 100.0).exp()));
            mask.push(if depth.is_some() { 255 } else { 0 });
        }
    }
    frame.mask = mask.into();
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
    let top = 2 * MARGIN + 2 * (Text::Large.height() + LINE_GAP);
    let columns = sheet.columns();
    // A point in the middle column of each panel, at a third of its height: 36 mm deep, in blood.
    let at = |panel: usize, y: u32| image.get_pixel(columns[panel].image_x + 150, top + y).0;
    assert_eq!(at(1, 72), colour::tissue("blood"));
    assert_eq!(at(1, 200), colour::tissue("liver"));
    assert!(at(0, 200)[0] > at(0, 72)[0] && at(0, 72)[0] == at(0, 72)[2]);
    assert!(at(2, 72)[1] > at(2, 200)[1]);
    // Outside the sector every map is black.
    assert_eq!(*image.get_pixel(columns[2].image_x + 2, top + 2), image::Rgb([0; 3]));
}

/// A row as the demo makes it, with or without a translated image. All levels of that image are 200.
fn row(sheet: &ContactSheet<'_>, frame: &Frame, translated: bool) -> Vec<Panel> {
    let bmode = Map::BMode { dynamic_range_db: 60.0 };
    let mut row = vec![sheet.panel("LQ", frame, bmode).unwrap().with_note("PSNR 20.0 dB")];
    if translated {
        let levels = vec![200; frame.bmode.len()];
        let panel = sheet.grey_panel("translated", &levels, [frame.width, frame.height], bmode);
        row.push(panel.unwrap().with_note("PSNR 24.0 dB"));
    }
    row.push(sheet.panel("HQ", frame, bmode).unwrap());
    row.push(sheet.panel("segmentation", frame, Map::Segmentation).unwrap());
    row
}

#[test]
fn a_translated_column_stands_between_both_qualities_and_moves_the_others_right() {
    let probe = Probe::default();
    let sector = Sector::fit(&probe, 231, 167);
    let (frame, tissues) = (frame(&sector, &probe), tissues());
    let mut sheet = sheet("test", &sector, &tissues, 150);
    let mut sizes = Vec::new();
    for translated in [false, true] {
        sheet.rows = (0..2).map(|_| row(&sheet, &frame, translated)).collect();
        let columns = sheet.columns();
        // Neighbouring grey images share one bar; the segmentation has none.
        let bars: Vec<bool> = columns.iter().map(|column| column.has_bar).collect();
        assert_eq!(bars, [&[true][..], &vec![false; bars.len() - 1]].concat());
        let canvas = sheet.draw();
        let (width, _) = canvas.size();
        let top = 2 * MARGIN + 3 * (Text::Large.height() + LINE_GAP);
        let at = |panel: usize| {
            let index = ((top + 30) * width + columns[panel].image_x + 75) as usize;
            canvas.as_rgb()[3 * index]
        };
        assert_eq!(at(0), at(columns.len() - 2), "LQ and HQ show the same frame");
        assert_eq!(at(1) == 200, translated);
        sizes.push(canvas.size());
    }
    let [without, with] = sizes[..] else { panic!("{sizes:?}") };
    assert_eq!((with.0 - without.0, with.1), (150 + SCALE_GUTTER, without.1));
}

#[test]
fn texts_stay_in_their_columns_and_above_the_images() {
    let sector = Sector::fit(&Probe::default(), 64, 48);
    let tissues = TissueTable::default();
    let mut sheet = sheet("t", &sector, &tissues, 60);
    sheet.notes = vec!["what the columns are".repeat(8)];
    let white = |caption: &str| sheet.grey_panel(caption, &[255; 64 * 48], [64, 48], Map::Attenuation).unwrap();
    let row =
        vec![white("a caption much wider than its image").with_note("n"), white("b").with_note("note ".repeat(9))];
    sheet.rows = vec![row];
    let columns = sheet.columns();
    let end = |index: usize, text: &str| columns[index].image_x + Text::Large.width(text);
    assert!(end(0, "a caption much wider than its image") < columns[1].image_x);
    let canvas = sheet.draw();
    let (width, height) = canvas.size();
    assert!(end(1, &"note ".repeat(9)) < width && MARGIN + Text::Large.width(&sheet.notes[0]) < width);
    // Every pixel of the images is white: no text is on them.
    let (image_width, image_height) = sheet.image_size(64, 48);
    let image_y = height - MARGIN - MARGIN - image_height;
    for (x, y) in (0..image_width).flat_map(|x| (0..image_height).map(move |y| (x, y))) {
        let index = 3 * ((image_y + y) * width + columns[1].image_x + x) as usize;
        assert_eq!(canvas.as_rgb()[index..index + 3], [255; 3], "({x}, {y})");
    }
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
    assert!(sheet.grey_panel("t", &[0; 15], [4, 4], Map::BMode { dynamic_range_db: 60.0 }).is_err());
}
