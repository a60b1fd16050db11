//! Identity of a station's scene, as a text in recordings.

use std::fmt;
use std::io::{self, Read};
use std::path::Path;

use serde_json::Value;
use sha2::{Digest, Sha256};

use super::{SceneSource, Station};
use crate::files::{self, FileKind, hex};
use crate::phantom::Parameters;

/// Key of the hash of a scene file.
const HASH: &str = "sha256";

/// Key of the image's depth, mm.
const DEPTH: &str = "depth_mm";

/// Prefix of the phantom's keys, as in a station file.
const PHANTOM: &str = "phantom_";

/// Number of bytes of a hash that are recorded.
const HASH_BYTES: usize = 8;

/// Number of bytes that are hashed at once.
const PIECE: usize = 1 << 16;

/// Identity of a scene: the phantom's parameters, or a file's name and hash. [`Display`](fmt::Display) writes `NAME
/// (key value, key value)`, as recordings have it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SceneIdentity {
    name: String,
    /// Keys and values that identify the scene.
    parts: Vec<(String, String)>,
}

impl SceneIdentity {
    /// Identity of `station`'s scene. If its file can't be read, the identity is only the name.
    pub fn of(station: &Station) -> Self {
        match &station.scene {
            SceneSource::ObstetricPhantom(options) => {
                Self { name: "obstetric phantom".to_owned(), parts: parameters(&options.parameters) }
            }
            SceneSource::File(path) => {
                let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
                let hash = hash(path).map(|hash| (HASH.to_owned(), hash));
                Self { name, parts: hash.into_iter().collect() }
            }
        }
    }

    /// The same identity with the depth of the image, for recordings that don't hold the session's settings.
    #[must_use]
    pub fn with_depth(mut self, depth_mm: f64) -> Self {
        self.parts.push((DEPTH.to_owned(), depth_mm.to_string()));
        self
    }

    /// Reads an identity. `None` for any other text, such as the name or path in earlier recordings.
    fn parse(text: &str) -> Option<Self> {
        let (name, parts) = text.strip_suffix(')')?.rsplit_once(" (")?;
        let pair = |part: &str| {
            let (key, value) = part.split_once(' ')?;
            let is_known = key == HASH || key == DEPTH || key.starts_with(PHANTOM);
            is_known.then(|| (key.to_owned(), value.to_owned()))
        };
        // A later version of insonify may write further keys.
        let parts: Vec<_> = parts.split(", ").filter_map(pair).collect();
        (!parts.is_empty()).then(|| Self { name: name.to_owned(), parts })
    }

    fn value(&self, key: &str) -> Option<&str> {
        self.parts.iter().find(|(known, _)| known == key).map(|(_, value)| value.as_str())
    }

    fn is_phantom(&self) -> bool {
        self.parts.iter().any(|(key, _)| key.starts_with(PHANTOM))
    }

    /// Differences between this scene and `here`: what each has, in words. `None` if all keys that both have are
    /// equal.
    fn difference(&self, here: &Self) -> Option<(String, String)> {
        let is_file = |scene: &Self| scene.value(HASH).is_some();
        if (self.is_phantom() && is_file(here)) || (is_file(self) && here.is_phantom()) {
            return Some((self.name.clone(), here.name.clone()));
        }
        let words = |scene: &Self, key: &str, value: &str| match key {
            HASH => format!("{} of SHA-256 {value}", scene.name),
            _ => format!("{key} {value}"),
        };
        let differing = self.parts.iter().filter_map(|(key, recorded)| {
            let value = here.value(key).filter(|value| value != recorded)?;
            Some((words(self, key, recorded), words(here, key, value)))
        });
        let (recorded, station): (Vec<String>, Vec<String>) = differing.unzip();
        (!recorded.is_empty()).then(|| (recorded.join(", "), station.join(", ")))
    }
}

impl fmt::Display for SceneIdentity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.name)?;
        if self.parts.is_empty() {
            return Ok(());
        }
        let parts: Vec<String> = self.parts.iter().map(|(key, value)| format!("{key} {value}")).collect();
        write!(f, " ({})", parts.join(", "))
    }
}

/// Sentence that tells how `station`'s scene differs from the `recorded` one. `None` if they are equal, or if the
/// recording doesn't identify its scene.
pub fn other_scene(recorded: &str, station: &Station) -> Option<String> {
    let recorded = SceneIdentity::parse(recorded)?;
    let here = SceneIdentity::of(station).with_depth(station.probe.depth_mm);
    let (recorded, here) = recorded.difference(&here)?;
    Some(format!("the session was recorded on {recorded}, the station has {here}"))
}

/// All parameters of a phantom, with their keys in a station file.
fn parameters(parameters: &Parameters) -> Vec<(String, String)> {
    let Ok(Value::Object(values)) = serde_json::to_value(parameters) else { return Vec::new() };
    let text = |value: &Value| match value {
        Value::String(text) => text.clone(),
        Value::Number(number) if number.is_f64() => number.as_f64().unwrap_or_default().to_string(),
        other => other.to_string(),
    };
    values.iter().map(|(key, value)| (format!("{PHANTOM}{key}"), text(value))).collect()
}

/// First bytes of the SHA-256 of the file at `path`, as hexadecimal digits; `None` if it can't be read.
fn hash(path: &Path) -> Option<String> {
    let mut file = files::open(path, FileKind::Scene).ok()?;
    let (mut hash, mut piece) = (Sha256::new(), vec![0; PIECE]);
    loop {
        match file.read(&mut piece) {
            Ok(0) => break,
            Ok(read) => hash.update(&piece[..read]),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(_) => return None,
        }
    }
    Some(hex(&hash.finalize()[..HASH_BYTES]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn phantom(more: &str) -> Station {
        Station::parse(&format!("[scene]\nphantom = \"obstetric\"\n{more}"), Path::new("/station")).unwrap()
    }

    #[test]
    fn another_phantom_or_depth_is_told_and_the_same_is_not() {
        let recorded = SceneIdentity::of(&phantom("")).with_depth(phantom("").probe.depth_mm).to_string();
        assert!(recorded.starts_with("obstetric phantom (") && recorded.contains("phantom_lie cephalic"), "{recorded}");
        assert_eq!(other_scene(&recorded, &phantom("phantom_scale = 0.5\nmotion = false")), None);
        let other = other_scene(&recorded, &phantom("phantom_lie = \"breech\"")).unwrap();
        let said = "the session was recorded on phantom_lie cephalic, the station has phantom_lie breech";
        assert_eq!(other, said);
        let other = other_scene(&recorded, &phantom("phantom_weeks = 30\n[probe]\ndepth_mm = 60")).unwrap();
        for part in ["the station has ", "phantom_weeks 30", "depth_mm 60"] {
            assert!(other.contains(part), "{part}: {other}");
        }
    }

    #[test]
    fn recordings_that_do_not_say_their_scene_are_taken_as_they_are() {
        for old in ["obstetric phantom", "configs/obstetric.toml", "none", "", "a (copy).glb", "scene (old)"] {
            assert_eq!(other_scene(old, &phantom("phantom_lie = \"breech\"")), None, "{old}");
        }
    }

    #[test]
    fn a_file_is_known_by_its_bytes() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str, bytes: &[u8]| {
            std::fs::write(dir.path().join(name), bytes).unwrap();
            Station::parse(&format!("[scene]\npath = \"{name}\""), dir.path()).unwrap()
        };
        let recorded = SceneIdentity::of(&at("a.glb", b"one")).to_string();
        // The digits are the first of the SHA-256 of "one".
        assert_eq!(recorded, "a.glb (sha256 7692c3ad3540bb80)");
        assert_eq!(other_scene(&recorded, &at("renamed.glb", b"one")), None);
        let other = other_scene(&recorded, &at("b.glb", b"two")).unwrap();
        assert!(other.contains("recorded on a.glb of SHA-256 7692c3ad3540bb80, the station has b.glb of"), "{other}");
        let other = other_scene(&recorded, &phantom("")).unwrap();
        assert_eq!(other, "the session was recorded on a.glb, the station has obstetric phantom");
        let gone = Station::parse("[scene]\npath = \"gone.glb\"", dir.path()).unwrap();
        assert_eq!((SceneIdentity::of(&gone).to_string(), other_scene(&recorded, &gone)), ("gone.glb".into(), None));
    }
}
