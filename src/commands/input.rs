//! Parsing of arguments, and reading of the files that they name.

use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, anyhow};
use insonify::anatomy::planes::{StandardPlane, StandardPlanes};
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

/// The pose `given`, else the station's. If there is none, the error suggests the options in `others`.
pub(crate) fn pose(given: Option<Pose>, station: &Station, others: &str) -> Result<Pose, Failure> {
    given.or(station.default_pose).ok_or_else(|| {
        let station = station.path.display();
        Failure::Input(anyhow!("no pose: give {others}, or a [pose] with position_mm and quaternion in {station}"))
    })
}

/// Whether `path` is a station file. If not, it is taken for a scene.
pub(crate) fn is_station(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "toml")
}

/// Parses a duration in seconds.
pub(crate) fn seconds(text: &str) -> Result<Duration, String> {
    let in_range = |s: &f64| *s > 0.0 && *s <= 31.0 * 86_400.0;
    let seconds = text.parse().ok().filter(in_range).ok_or("expected seconds, above 0 and at most 2678400")?;
    Ok(Duration::from_secs_f64(seconds))
}

/// Parses the path of an HTML page.
pub(crate) fn html(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    if path.extension().is_some_and(|extension| extension == "html") {
        Ok(path)
    } else {
        Err("it must end in .html".into())
    }
}

/// Contents of a recording that a tracked sequence cannot hold.
pub(crate) const NOT_IN_SEQUENCES: &str =
    "events, names of planes, measurements and texts, which a sequence (.mha) has no place for";

/// Word of `--planes` for all planes of the scene.
pub(crate) const ALL_PLANES: &str = "all";

/// Parses the name of a standard plane in a list. Blanks around it are removed.
pub(crate) fn plane(text: &str) -> Result<String, String> {
    match text.trim() {
        "" => Err("a name is empty; give names of planes with commas between them, or `all`".into()),
        name => Ok(name.to_owned()),
    }
}

/// The scene's standard planes with these names. No name, or only `all`, means all planes.
pub(crate) fn chosen<'a>(names: &[String], scene: &'a StandardPlanes) -> Result<Vec<&'a StandardPlane>, Failure> {
    let has_all = names.iter().any(|name| name == ALL_PLANES);
    match names.len() {
        1 if has_all => Ok(scene.planes.iter().collect()),
        _ if has_all => {
            let names = names.join(",");
            Err(Failure::Input(anyhow!("--planes {names}: `all` stands alone; give `all`, or names of planes")))
        }
        _ => Ok(scene.chosen(names)?),
    }
}

/// Refuses a recording and a station whose file names can't be right, for example because they were swapped.
pub(crate) fn expect_recording(recording: &Path, station: &Path) -> Result<(), Failure> {
    let extension = |path: &Path| path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    let (first, second) = (extension(recording), extension(station));
    let (recording, station) = (recording.display(), station.display());
    match (first.as_deref(), second.as_deref()) {
        (Some("toml"), Some("mcap")) => Err(Failure::Input(anyhow!(
            "{recording} is a station file and {station} a recording: give the recording first, then the station"
        ))),
        (Some("csv" | "tsv" | "mha" | "mhd"), _) => Err(Failure::Input(anyhow!(
            "{recording} is not a recording (.mcap); `insonify import {recording} --out FILE.mcap` makes one of it"
        ))),
        _ => Ok(()),
    }
}

/// Parses two whole numbers separated by an `x`.
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

    #[test]
    fn names_of_planes_have_no_blanks_around_them() {
        assert_eq!(plane(" abdomen"), Ok("abdomen".to_owned()));
        assert!(plane(" ").unwrap_err().contains("a name is empty"));
    }

    #[test]
    fn all_planes_stand_alone() {
        let scene = StandardPlanes { version: 1, planes: Vec::new() };
        let chosen = |names: &[&str]| chosen(&names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>(), &scene);
        assert!(chosen(&[]).is_ok() && chosen(&["all"]).is_ok());
        let Err(Failure::Input(error)) = chosen(&["head", "all"]) else { panic!("a list with `all` is taken") };
        assert!(error.to_string().contains("--planes head,all: `all` stands alone"), "{error}");
    }

    #[test]
    fn swapped_and_foreign_files_are_told() {
        let told = |recording: &str, station: &str| match expect_recording(Path::new(recording), Path::new(station)) {
            Err(Failure::Input(error)) => error.to_string(),
            _ => String::new(),
        };
        assert_eq!(told("exam.mcap", "station.toml"), "");
        assert_eq!(told("station.toml", "station.toml"), "", "its content says what it is");
        assert!(told("station.toml", "exam.mcap").contains("give the recording first"));
        assert!(told("good.csv", "station.toml").contains("`insonify import good.csv --out FILE.mcap`"));
    }
}
