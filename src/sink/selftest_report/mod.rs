//! A self-test as a page to print: one HTML file.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use super::exam_report::escape;
use super::{SinkError, write_with};
use crate::selftest::{Check, Report};

const STYLE: &str = include_str!("style.css");

/// Writes the page about `report` to `path`.
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, report: &Report) -> Result<(), SinkError> {
    let page = page(report);
    write_with(path, |file| file.write_all(page.as_bytes()).map_err(SinkError::io(path)))
}

/// A number as it is read: four significant digits, none after the point where it is whole.
pub fn number(value: f64) -> String {
    if !value.is_finite() {
        return "not measurable".to_owned();
    }
    if value == 0.0 || (value.fract() == 0.0 && value.abs() < 1e6) {
        return format!("{value:.0}");
    }
    let digits = (3 - value.abs().log10().floor() as i32).clamp(0, 12) as usize;
    let text = format!("{value:.digits$}");
    if value.abs() < 1e-4 { format!("{value:.2e}") } else { text }
}

/// The page. Writing to a string cannot fail.
fn page(report: &Report) -> String {
    let Report { version, device, driver, date, duration_s, .. } = report;
    let failed = report.failed().count();
    let verdict = if failed == 0 {
        "<span class=\"good\">passed</span>".to_owned()
    } else {
        format!("<span class=\"bad\">{failed} of {} checks failed</span>", report.checks.len())
    };
    let kind = if report.software { "software on the CPU" } else { "graphics processor" };
    let mut out = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>insonify self-test</title>\
         <meta name=\"viewport\" content=\"width=device-width\"><style>{STYLE}</style></head><body>\n\
         <h1>insonify self-test: {verdict}</h1>\n<dl>\
         <dt>Device</dt><dd>{} ({kind})</dd><dt>Driver</dt><dd>{}</dd><dt>Date</dt><dd>{date}</dd>\
         <dt>Version</dt><dd>insonify {version}</dd><dt>Duration</dt><dd>{duration_s:.1} s</dd></dl>\n\
         <table><thead><tr><th>what<th>measured on frames<th>expected<th>measured<th>tolerance<th>unit<th>result</tr></thead>\
         <tbody>\n",
        escape(device),
        escape(driver),
    );
    let mut group = "";
    for check in &report.checks {
        let Check { name, unit, expected, measured, tolerance, passed, .. } = check;
        let title = if check.group == group { "" } else { check.group };
        group = check.group;
        let (class, result) = if *passed { ("good", "pass") } else { ("bad", "FAIL") };
        let _ = writeln!(
            out,
            "<tr{}><th>{title}<td>{}<td>{}<td>{}<td>± {}<td>{unit}<td class=\"{class}\">{result}</tr>",
            if title.is_empty() { "" } else { " class=\"first\"" },
            escape(name),
            number(*expected),
            number(*measured),
            number(*tolerance),
        );
    }
    out.push_str(
        "</tbody></table>\n<p class=\"note\">Expected values are closed forms of acoustics (Snell, Fresnel, time of flight, \
         exponential loss, Gaussian pulse and beam, Rayleigh statistics) for specimens of known shape; measured values are \
         read off frames that this device rendered. Twin: the same frame by the 64-bit reference on the processor.</p>\n\
         </body></html>\n",
    );
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(name: &str, measured: f64, passed: bool) -> Check {
        let (group, name) = ("Fresnel", name.to_owned());
        Check { group, name, unit: "mm", expected: 0.5, measured, tolerance: 0.001, passed }
    }

    #[test]
    fn the_page_stands_alone_and_says_what_failed() {
        let checks = vec![check("a < b", 0.5, true), check("gone", f64::NAN, false)];
        let report = Report {
            version: "0.0.0",
            device: "GPU & co".to_owned(),
            driver: "driver".to_owned(),
            software: true,
            date: "2026-01-01T00:00:00Z".to_owned(),
            duration_s: 1.25,
            passed: false,
            checks,
        };
        let page = page(&report);
        for part in ["GPU &amp; co", "a &lt; b", "not measurable", "FAIL", "1 of 2 checks failed", "@media print"] {
            assert!(page.contains(part), "{part}");
        }
        assert!(!page.contains("http") && !page.contains("<script"), "a page of its own");
        assert_eq!(page.matches("<th>Fresnel").count(), 1);
    }

    #[test]
    fn numbers_are_short() {
        for (value, text) in
            [(0.0, "0"), (37.3, "37.30"), (-8.0, "-8"), (0.681034, "0.6810"), (1e-5, "1.00e-5"), (16384.0, "16384")]
        {
            assert_eq!(number(value), text);
        }
    }
}
