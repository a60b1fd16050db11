//! Measured operating points as CSV and as a Markdown table.

use std::borrow::Cow;
use std::fmt::Write;

use super::Point;

/// CSV with a header and one line per point: knobs, times, errors, front, noise; then the median of each pass.
pub fn csv(points: &[Point]) -> String {
    let mut passes: Vec<&str> = Vec::new();
    for pass in points.iter().flat_map(|p| &p.time.passes) {
        if !passes.contains(&pass.name.as_str()) {
            passes.push(&pass.name);
        }
    }
    let mut text = "name,sweep,generator,".to_owned();
    if let Some(first) = points.first() {
        first.knobs.values().iter().for_each(|(name, _)| text += &format!("{name},"));
    }
    text += "frames,median_ms,p95_ms,spread_ms,seen,seen_levels,seen_texture,seen_spread,rmse,psnr_db,identical,ssim,pkl,\
             snr_difference,grey_difference,contrast_lost,on_front,time_is_noise,error_is_noise";
    passes.iter().for_each(|name| text += &format!(",{}", csv_field(&format!("{name}_ms"))));
    text.push('\n');
    let optional = |value: Option<f64>| value.map_or_else(String::new, |v| v.to_string());
    for p in points {
        let generator = p.generator.as_deref().unwrap_or_default();
        text += &format!("{},{},{},", csv_field(&p.name), csv_field(&p.sweep), csv_field(generator));
        p.knobs.values().iter().for_each(|(_, value)| text += &format!("{value},"));
        let (t, e) = (&p.time, &p.error);
        text += &format!("{},{},{},{},", t.frames, t.median_ms, t.p95_ms, t.spread_ms);
        text += &format!("{},{},{},{},{},", e.seen.whole, e.seen.levels, e.seen.texture, e.seen_spread, e.rmse);
        text += &format!("{},{},{},{},", e.psnr_db, e.identical, e.ssim, optional(e.pkl));
        text += &format!("{},{},{},", optional(e.snr_difference), e.grey_difference, optional(e.contrast_lost));
        text += &format!("{},{},{}", p.on_front, p.time_is_noise, p.error_is_noise);
        for name in &passes {
            let pass = t.passes.iter().find(|pass| pass.name == *name);
            text += &format!(",{}", optional(pass.map(|pass| pass.median_ms)));
        }
        text.push('\n');
    }
    text
}

/// A CSV field, quoted with doubled quotes if it has a comma, quote or line break (RFC 4180).
pub(crate) fn csv_field(text: &str) -> Cow<'_, str> {
    if !text.contains([',', '"', '\n', '\r']) {
        return text.into();
    }
    format!("\"{}\"", text.replace('"', "\"\"")).into()
}

/// Markdown table of the points, sorted by time.
pub fn markdown(points: &[Point]) -> String {
    let mut sorted: Vec<&Point> = points.iter().collect();
    sorted.sort_by(|a, b| a.time.median_ms.total_cmp(&b.time.median_ms));
    let mut text =
        "| point | ms, median | p95 | seen error | levels | texture | PSNR, dB | SSIM, % | pKL x100 | contrast lost, % | note |\n\
                    |---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---|\n"
            .to_owned();
    for p in sorted {
        let (t, e) = (&p.time, &p.error);
        let bold = if p.on_front { "**" } else { "" };
        let percent = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{:.1}", 100.0 * v));
        let (lost, pkl) = (percent(e.contrast_lost), percent(e.pkl));
        let all = p.knobs.all_effects;
        let note = [
            (p.on_front, "front"),
            (all, "all effects"),
            (p.time_is_noise, "time is noise"),
            (p.error_is_noise, "error is noise"),
        ];
        let note: Vec<&str> = note.iter().filter(|(on, _)| *on).map(|(_, name)| *name).collect();
        // Writing to a String can't fail.
        let _ = writeln!(
            text,
            "| {bold}{}{bold} | {:.1} | {:.1} | {:.2} | {:.2} | {:.2} | {:.2} | {:.1} | {pkl} | {lost} | {} |",
            shown(&p.name),
            t.median_ms,
            t.p95_ms,
            e.seen.whole,
            e.seen.levels,
            e.seen.texture,
            e.psnr_db,
            100.0 * e.ssim,
            note.join(", ")
        );
    }
    text
}

/// Display name of a point; `LQ` or `HQ` is added where it applies.
pub(super) fn shown(name: &str) -> String {
    match name {
        "1x1" => "1x1 (LQ)".to_owned(),
        "32x3" => "32x3 (HQ)".to_owned(),
        other => match other.strip_suffix(" all effects") {
            Some(grid) => format!("{}, all effects", shown(grid)),
            None => other.to_owned(),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::super::point::tests::point;
    use super::*;

    #[test]
    fn every_line_has_the_columns_of_its_head() {
        let mut points = vec![point("1x1", 10.0, 30.0, None), point("32x3", 90.0, 5.0, Some("1x1"))];
        points[1].time.passes.clear();
        let csv = csv(&points);
        let columns: Vec<usize> = csv.lines().map(|line| line.split(',').count()).collect();
        assert_eq!(columns, [35; 3], "{csv}");
        assert!(csv.contains("trace_ms") && csv.contains("\n1x1,rays x layers,,1,1,"), "{csv}");
    }

    #[test]
    fn names_of_generators_are_quoted_where_they_must_be() {
        let named = Point { generator: Some("a, \"b\"".into()), ..point("1x1 + a, \"b\"", 10.0, 3.0, None) };
        let csv = csv(&[named]);
        assert!(csv.contains("\n\"1x1 + a, \"\"b\"\"\",rays x layers,\"a, \"\"b\"\"\",1,"), "{csv}");
    }

    #[test]
    fn the_table_is_in_the_order_of_time() {
        let mut points = [point("32x3 all effects", 90.0, 5.0, None), point("1x1", 10.0, 2.0, None)];
        points[1].on_front = true;
        points[0].knobs.all_effects = true;
        points[0].error.pkl = None;
        let table = markdown(&points);
        let rows: Vec<&str> = table.lines().skip(2).collect();
        assert_eq!(rows[0], "| **1x1 (LQ)** | 10.0 | 12.5 | 2.00 | 1.50 | 1.00 | 20.00 | 50.0 | 25.0 | 12.5 | front |");
        assert!(rows[1].starts_with("| 32x3 (HQ), all effects | 90.0 |"), "{table}");
        assert!(rows[1].ends_with("| - | 12.5 | all effects |"), "{table}");
    }
}
