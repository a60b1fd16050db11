//! Tables of an evaluation as Markdown, and one line per image as CSV.

use std::fmt::Write;

use super::dataset::DatasetReport;
use super::judge::{Distance, RowReport};
use super::steadiness::SteadinessReport;
use crate::measuring::table::csv_field;
use crate::quality::{RegionError, Scores, SeenError, Summary};

/// Least share of the pixels for a tissue to appear in the printed table. The JSON has all tissues.
const SHARE_MIN: f64 = 0.002;

impl DatasetReport {
    /// All tables of the report as Markdown.
    pub fn markdown(&self) -> String {
        let DatasetReport {
            dataset, split, tuples, crop_side, crops_per_tuple, crop_inside, seed, rows, notes, ..
        } = self;
        let mut text = format!("{}, split {split}, {tuples} tuples\n\n", dataset.display());
        if rows.iter().any(|row| row.crops.is_some()) {
            let inside = 100.0 * crop_inside;
            let _ = writeln!(
                text,
                "{crops_per_tuple} random crops of {crop_side} x {crop_side} a tuple (seed {seed}, at least {inside:.0} % \
             inside the sector), cut from the generators' full fields of view:\n"
            );
            text += &table(rows, |row| row.crops.as_ref(), |distance| distance.crops);
        }
        text += "The full field of view:\n\n";
        text += &table(rows, |row| Some(&row.full), |distance| distance.full);
        text += &shadows(rows);
        text += &tissues(rows);
        for note in notes {
            let _ = writeln!(text, "Note: {note}.\n");
        }
        text
    }

    /// CSV with a line for each image and crop: tuple, row, part, corner, PSNR, SSIM, pKL, seen error and its
    /// parts.
    pub fn csv(&self) -> String {
        let mut text = format!("tuple,row,part,left,top,{CSV_SCORES}\n");
        for row in &self.rows {
            let name = csv_field(&row.name);
            let mut line = |index: usize, part: &str, [left, top]: [usize; 2], scores: &Scores| {
                let _ = writeln!(text, "{index},{name},{part},{left},{top},{}", csv_scores(scores));
            };
            for image in &row.images {
                line(image.index, "full", [0, 0], &image.full);
                image.crops.iter().for_each(|(place, scores)| line(image.index, "crop", *place, scores));
            }
        }
        text
    }
}

impl SteadinessReport {
    /// Table of the steadiness as Markdown.
    pub fn markdown(&self) -> String {
        let SteadinessReport { station, frames, step_pixels, step_mm, rows } = self;
        let mut text = format!(
            "Steadiness: {frames} frames of {} while the probe slides by {step_pixels} pixels ({step_mm:.3} mm) a frame in \
         its image plane; mean magnitude of the difference of neighbouring frames after the exact shift, grey levels, pixel by \
         pixel (speckle changes with the probe, and a smooth picture has less of it) and of the means of 32 x 32:\n\n",
            station.display()
        );
        text += "| | pixels | over the target's | 32 x 32 | over the target's | pixels without the shift |\n";
        text += "|---|---:|---:|---:|---:|---:|\n";
        for row in rows {
            let s = &row.steadiness;
            let [pixels, levels] = [[s.difference, s.over_target], [s.level_difference, s.level_over_target]]
                .map(|[own, ratio]| format!("{own:.2} | {ratio:.2}"));
            let _ = writeln!(text, "| {} | {pixels} | {levels} | {:.2} |", row.name, s.unwarped_difference);
        }
        text + "\n"
    }
}

/// Table in the form of Zhang et al. 2020, with a line for each row of the report.
fn table(
    rows: &[RowReport],
    summary: impl Fn(&RowReport) -> Option<&Summary>,
    distance: impl Fn(&Distance) -> Option<f64>,
) -> String {
    let mut text = "| | PSNR dB | 5 % | SSIM % | 5 % | pKL x100 | 95 % |".to_owned();
    let names = rows.first().map_or(&[][..], |row| &row.distances);
    names.iter().for_each(|d| text += &format!(" {} |", d.name));
    text += " seen error | levels | texture |\n|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|";
    names.iter().for_each(|_| text += "---:|");
    text += "\n";
    for row in rows {
        let Some(&Summary { psnr_db, ssim, pkl: spread, seen, .. }) = summary(row) else { continue };
        let pkl = |value: Option<f64>| number(value.map(|v| 100.0 * v));
        let [mean, worst] = [ssim.mean, ssim.percentile].map(|v| 100.0 * v);
        let name = named(row);
        let _ = write!(text, "| {name} | {:.2} | {:.2} | {mean:.2} | {worst:.2} |", psnr_db.mean, psnr_db.percentile);
        let _ = write!(text, " {} | {} |", pkl(spread.map(|s| s.mean)), pkl(spread.map(|s| s.percentile)));
        row.distances.iter().for_each(|d| text += &format!(" {} |", number(distance(d))));
        seen_parts(seen.as_ref()).iter().for_each(|part| text += &format!(" {} |", number(*part)));
        text += "\n";
    }
    text + "\n"
}

/// Table of errors behind bone, and of lost contrast at tissue borders.
fn shadows(rows: &[RowReport]) -> String {
    let mut text =
        "Behind bone (mean grey level, its difference from the target's, and the mean magnitude of the pixels' \
                    differences) and in the rest of the sector, and the contrast of tissues' borders that is lost:\n\n"
            .to_owned();
    text += "| | behind bone | off | pixels off | elsewhere | off | pixels off | contrast lost % |\n";
    text += "|---|---:|---:|---:|---:|---:|---:|---:|\n";
    for row in rows {
        let _ = write!(text, "| {} |", named(row));
        for region in [row.behind_bone, row.elsewhere] {
            let grey = number(region.map(|r| r.grey));
            let off = region.map_or("-".to_owned(), |r| format!("{:+.2}", r.difference));
            let _ = write!(text, " {grey} | {off} | {} |", number(region.map(|r| r.absolute_difference)));
        }
        let _ = writeln!(text, " {} |", number(row.contrast_lost.map(|lost| 100.0 * lost)));
    }
    if let Some(row) = rows.first() {
        let grey = |region: Option<RegionError>| number(region.map(|r| r.reference_grey));
        let _ = writeln!(text, "| target | {} | | | {} | | | |", grey(row.behind_bone), grey(row.elsewhere));
    }
    text + "\n"
}

/// Table with one line per tissue: its share, the target's level, and the errors of each row.
fn tissues(rows: &[RowReport]) -> String {
    let Some(first) = rows.first() else { return String::new() };
    let mut text =
        "By tissue: mean grey level less the target's / mean magnitude of the pixels' differences:\n\n".to_owned();
    text += "| tissue | share % | target |";
    rows.iter().for_each(|row| text += &format!(" {} |", row.name));
    text += "\n|---|---:|---:|";
    rows.iter().for_each(|_| text += "---:|");
    text += "\n";
    let shown = first.tissues.iter().filter(|t| t.share >= SHARE_MIN);
    for tissue in shown {
        let (share, target) = (100.0 * tissue.share, tissue.error.reference_grey);
        let _ = write!(text, "| {} | {share:.1} | {target:.1} |", tissue.tissue);
        for row in rows {
            let error = row.tissues.iter().find(|t| t.tissue == tissue.tissue).map(|t| t.error);
            let shown =
                error.map_or("-".to_owned(), |e| format!("{:+.1} / {:.1}", e.difference, e.absolute_difference));
            let _ = write!(text, " {shown} |");
        }
        text += "\n";
    }
    let left = first.tissues.iter().filter(|t| t.share < SHARE_MIN).count();
    if left > 0 {
        let _ = writeln!(text, "\n{left} tissues with less than {} % of the pixels are left out.", 100.0 * SHARE_MIN);
    }
    text + "\n"
}

/// Names of the fields of [`csv_scores`].
pub(super) const CSV_SCORES: &str = "psnr_db,ssim,pkl,seen,levels,texture";

/// CSV fields of the scores.
pub(super) fn csv_scores(Scores { psnr_db, ssim, pkl, seen }: &Scores) -> String {
    let field = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
    let [whole, levels, texture] = seen_parts(seen.as_ref()).map(field);
    format!("{psnr_db},{ssim},{},{whole},{levels},{texture}", field(*pkl))
}

/// The seen error, its part of levels and its part of texture.
fn seen_parts(seen: Option<&SeenError>) -> [Option<f64>; 3] {
    [seen.map(|s| s.whole), seen.map(|s| s.levels), seen.map(|s| s.texture)]
}

fn named(row: &RowReport) -> String {
    row.variant.map_or_else(|| row.name.clone(), |variant| format!("{} ({variant:?})", row.name))
}

fn number(value: Option<f64>) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.2}"))
}
