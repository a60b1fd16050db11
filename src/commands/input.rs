//! Reading of arguments and of the files that they name.

use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, anyhow};
use insonify::files::{self, FileKind};
use insonify::pose::Pose;
use insonify::station::Station;

use super::{Classify, Failure};

/// Whether the file at `path` starts with `magic`; `what` names it in errors.
pub(crate) fn starts_with(path: &Path, magic: &[u8], what: &str) -> Result<bool, Failure> {
    let mut head = Vec::with_capacity(magic.len());
    let read =
        files::open(path, FileKind::Recording).and_then(|file| file.take(magic.len() as u64).read_to_end(&mut head));
    read.with_context(|| cannot_read(path, what)).input()?;
    Ok(head == magic)
}

/// Reads the text of the file at `path`; `what` names it in errors.
pub(crate) fn text(path: &Path, kind: FileKind, what: &str) -> Result<String, Failure> {
    let advised = |error: std::io::Error| match (error.kind(), kind) {
        (ErrorKind::InvalidData, FileKind::Table) => {
            std::io::Error::new(ErrorKind::InvalidData, format!("{error}; save the table as UTF-8 (Excel: CSV UTF-8)"))
        }
        _ => error,
    };
    files::read_text(path, kind).map_err(advised).with_context(|| cannot_read(path, what)).input()
}

fn cannot_read(path: &Path, what: &str) -> String {
    let space = if what.is_empty() { "" } else { " " };
    format!("cannot read {what}{space}{}", path.display())
}

/// `given`, else the station's pose; an error suggests `others`.
pub(crate) fn pose(given: Option<Pose>, station: &Station, others: &str) -> Result<Pose, Failure> {
    given.or(station.default_pose).ok_or_else(|| {
        let station = station.path.display();
        Failure::Input(anyhow!("no pose: give {others}, or a [pose] with position_mm and quaternion in {station}"))
    })
}

/// Whether `path` is a station file; otherwise it is a scene.
pub(crate) fn is_station(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "toml")
}

/// Parses a duration in seconds.
pub(crate) fn seconds(text: &str) -> Result<Duration, String> {
    let in_range = |s: &f64| *s > 0.0 && *s <= 31.0 * 86_400.0;
    let seconds = text.parse().ok().filter(in_range).ok_or("expected seconds, above 0 and at most 2678400")?;
    Ok(Duration::from_secs_f64(seconds))
}

/// Parses the path of a page.
pub(crate) fn html(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    if path.extension().is_some_and(|extension| extension == "html") {
        Ok(path)
    } else {
        Err("it must end in .html".into())
    }
}

/// Parses two whole numbers with an `x` between them.
pub(crate) fn product(text: &str) -> Option<(u32, u32)> {
    let (first, second) = text.split_once('x')?;
    Some((first.parse().ok()?, second.parse().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_positive_and_finite() {
        assert_eq!(seconds("1.5"), Ok(Duration::from_millis(1500)));
        for wrong in ["0", "-1", "NaN", "inf", "1e9", "ten"] {
            assert!(seconds(wrong).is_err(), "{wrong}");
        }
    }
}
