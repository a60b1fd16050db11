//! Output to stdout.

use std::io::Write;
use std::path::Path;

use anyhow::{Context, anyhow};
use serde::Serialize;

use super::{Classify, Failure};

/// Prints a line.
pub(crate) fn line(text: impl std::fmt::Display) -> Result<(), Failure> {
    self::text(format_args!("{text}\n"))
}

/// Prints text that already ends with a line break.
pub(crate) fn text(text: impl std::fmt::Display) -> Result<(), Failure> {
    match write!(std::io::stdout(), "{text}") {
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Err(Failure::OutputClosed),
        written => written.context("cannot write to stdout").other(),
    }
}

/// Prints a value as indented JSON.
pub(crate) fn json(value: &impl Serialize) -> Result<(), Failure> {
    line(serde_json::to_string_pretty(value).other()?)
}

/// Creates the directory of the file `path`.
pub(crate) fn make_parent(path: &Path) -> Result<(), Failure> {
    match path.parent().filter(|d| !d.as_os_str().is_empty()) {
        Some(directory) => Ok(insonify::sink::create_dir(directory)?),
        None => Ok(()),
    }
}

/// Refuses a file for a recording whose name does not end in `.mcap`, because it is likely another kind of file.
/// `option` names the option in the error.
pub(crate) fn recording(option: &str, path: &Path) -> Result<(), Failure> {
    if path.extension().is_some_and(|suffix| suffix.eq_ignore_ascii_case("mcap")) {
        return Ok(());
    }
    let path = path.display();
    Err(Failure::Input(anyhow!("{option} is {path}, which is no name of a recording: it must end in .mcap")))
}

/// Text for a duration, in s, min or h.
pub(crate) fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 90.0 => format!("{s:.0} s"),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recordings_end_in_mcap() {
        for name in ["a.mcap", "out/b.MCAP", "c.toml.mcap"] {
            assert!(recording("--out", Path::new(name)).is_ok(), "{name}");
        }
        for name in ["cal.toml", "mcap", "a.mcap.part", ".mcap"] {
            let Err(Failure::Input(error)) = recording("--record", Path::new(name)) else { panic!("{name}") };
            let text = error.to_string();
            assert!(text.contains(&format!("--record is {name},")) && text.contains("end in .mcap"), "{text}");
        }
    }

    #[test]
    fn durations_have_a_unit_of_their_size() {
        assert_eq!([12.4, 120.0, 9000.0].map(duration), ["12 s", "2 min", "2.5 h"]);
    }
}
