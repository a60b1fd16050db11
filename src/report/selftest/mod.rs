//! Report of a self-test: a text table, and a printable page in one HTML file.

use std::fmt::Write as _;
use std::path::Path;

use super::html::{escape, head};
use crate::selftest::{Check, Report};
use crate::sink::{SinkError, write_text};

const STYLE: &str = include_str!("style.css");

/// Writes the page about `report` to `path`.
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, report: &Report) -> Result<(), SinkError> {
    write_text(path, &page(report))
}

/// All checks in a text table.
pub fn table(report: &Report) -> String {
    let Report { device, driver, date, duration_s, checks, .. } = report;
    let mut out = format!("{device} ({driver}), {date}\n\n");
    let _ = writeln!(out, "{:15} {:54} {:>10} {:>14} {:>10} {:6}", "", "", "expected", "measured", "tolerance", "");
    let mut last = "";
    for Check { group, name, unit, expected, measured, tolerance, passed } in checks {
        let title = if *group == last { "" } else { group };
        last = group;
        let [expected, measured, tolerance] = [expected, measured, tolerance].map(|value| figure(*value, *tolerance));
        let result = if *passed { "pass" } else { "FAIL" };
        let _ = writeln!(out, "{title:15} {name:54} {expected:>10} {measured:>14} {tolerance:>10} {unit:6} {result}");
    }
    let passed = checks.len() - report.failed().count();
    let _ = writeln!(out, "\n{passed} of {} checks passed in {duration_s:.1} s", checks.len());
    out
}

/// A number as text, rounded to the second significant digit of its tolerance. A tolerance of 0 means that the number
/// is a count.
fn figure(value: f64, tolerance: f64) -> String {
    if !value.is_finite() {
        return "not measurable".to_owned();
    }
    let digits = if tolerance > 0.0 { (1.0 - tolerance.log10().floor()).clamp(0.0, 9.0) as usize } else { 0 };
    let text = format!("{value:.digits$}");
    // Rounding may leave a negative zero; removes its sign.
    if text.trim_start_matches(['-', '0', '.']).is_empty() { text.trim_start_matches('-').to_owned() } else { text }
}

/// Text of the page. Writing to a string cannot fail.
fn page(report: &Report) -> String {
    let Report { version, device, driver, date, duration_s, .. } = report;
    let failed = report.failed().count();
    let verdict = if failed == 0 {
        "<span class=\"good\">passed</span>".to_owned()
    } else {
        format!("<span class=\"bad\">{failed} of {} checks failed</span>", report.checks.len())
    };
    let kind = if report.software { "software on the CPU" } else { "graphics processor" };
    let mut out = head("insonify self-test", STYLE);
    let _ = write!(
        out,
        "<h1>insonify self-test: {verdict}</h1>\n<dl>\
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
            figure(*expected, *tolerance),
            figure(*measured, *tolerance),
            figure(*tolerance, *tolerance),
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
            trace: None,
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
    fn figures_have_the_digits_of_their_tolerance() {
        for (value, tolerance, text) in [
            (36.677_259_75, 0.002, "36.6773"),
            (-39.58, 0.5, "-39.58"),
            (0.009_173_9, 1.83e-5, "0.009174"),
            (16384.0, 0.0, "16384"),
            (-1e-7, 0.02, "0.000"),
            (f64::NAN, 0.1, "not measurable"),
        ] {
            assert_eq!(figure(value, tolerance), text);
        }
    }
}
