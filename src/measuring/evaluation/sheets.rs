//! Sheets of pictures of some tuples: low quality, generated images, the target, and the remaining difference.

use std::path::{Path, PathBuf};

use super::judge::{ImageScores, RowReport};
use super::models::generate;
use super::scan::probe;
use crate::dataset::{Dataset, Row as TupleRow};
use crate::generator::Generator;
use crate::measuring::MeasuringError;
use crate::quality::cut;
use crate::report::ComparisonSheet;
use crate::report::comparison_sheet::Panel;
use crate::sink::create_dir;
use crate::transducer::ScanGeometry;

/// Width of a full field of view on a sheet, pixels.
const WIDTH: u32 = 460;
/// Side of the detail, shown at its original size, pixels.
const DETAIL: usize = 400;

/// Writes a sheet for the best, the median and the worst tuple by the PSNR of the last row.
pub(super) fn write(
    out: &Path,
    dataset: &Dataset,
    chosen: &[&TupleRow],
    rows: &[RowReport],
    generators: &mut [(String, Generator)],
    (side, seed): (usize, u64),
) -> Result<Vec<PathBuf>, MeasuringError> {
    create_dir(out)?;
    let Some(last) = rows.last() else { return Ok(Vec::new()) };
    let mut order: Vec<&ImageScores> = last.images.iter().collect();
    order.sort_by(|a, b| b.full.psnr_db.total_cmp(&a.full.psnr_db));
    let mut files = Vec::new();
    let places = [("best", 0), ("median", order.len() / 2), ("worst", order.len().saturating_sub(1))];
    for (number, (word, at)) in places.into_iter().enumerate() {
        let seen = places[..number].iter().any(|(_, other)| *other == at);
        let Some(scores) = order.get(at).filter(|_| !seen) else { continue };
        let Some(row) = chosen.iter().find(|row| row.index == scores.index) else { continue };
        let tuple = dataset.tuple(row)?;
        let attenuation = tuple.attenuation_map();
        let [width, height] = row.size;
        let scan = probe(dataset, row).ok().map(|probe| ScanGeometry::fit(&probe, width, height));
        let mut images = vec![("LQ".to_owned(), tuple.lq.clone())];
        for (name, generator) in generators.iter_mut() {
            let mut image = Vec::new();
            generate(generator, &tuple, &attenuation, scan, &mut image)?;
            images.push((name.clone(), image));
        }
        let score = |row: &RowReport| {
            let of = row.images.iter().find(|i| i.index == scores.index);
            of.map_or(String::new(), |i| format!(" {:.2} dB, SSIM {:.3}", i.full.psnr_db, i.full.ssim))
        };
        let caption = |number: usize, name: &str| format!("{name}{}", rows.get(number).map_or(String::new(), score));
        let mut full = Vec::new();
        for (number, (name, image)) in images.iter().enumerate() {
            full.push(Panel::grey(caption(number, name), image, tuple.size, WIDTH)?);
        }
        full.push(Panel::grey("target (HQ)", &tuple.hq, tuple.size, WIDTH)?);
        let Some((name, newest)) = images.last() else { continue };
        full.push(Panel::difference(format!("{name} - target"), newest, &tuple.hq, tuple.size, WIDTH)?);
        let mut sheet_rows = vec![full];
        let [width, height] = tuple.size;
        let detail = DETAIL.min(side).min(width).min(height);
        let place = match scores.crops.first() {
            Some(([left, top], _)) => [left + (side - detail) / 2, top + (side - detail) / 2],
            None => [(width - detail) / 2, (height - detail) / 2],
        };
        let part = |image: &[u8]| cut(image, width, place, detail);
        let size = [detail; 2];
        let mut details = Vec::new();
        for (name, image) in &images {
            details.push(Panel::grey(name.as_str(), &part(image), size, u32::MAX)?);
        }
        let hq = part(&tuple.hq);
        details.push(Panel::grey("target (HQ)", &hq, size, u32::MAX)?);
        details.push(Panel::difference(format!("{name} - target"), &part(newest), &hq, size, u32::MAX)?);
        sheet_rows.push(details);
        let title = format!("{word} of {} by {name}: tuple {}, crops' seed {seed}", order.len(), scores.index);
        let path = out.join(format!("{word}_{:07}.png", scores.index));
        ComparisonSheet { title, rows: sheet_rows }.write(&path)?;
        files.push(path);
    }
    Ok(files)
}
