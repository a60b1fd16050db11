//! Files of another kind than the expected one.

use std::io::{self, ErrorKind};
use std::path::Path;

use super::kind::FileKind;

/// Kind of a file with its article, and advice for a user who gave such a file.
type Known = (&'static str, &'static str);

const GLTF: Known =
    ("a scene (glTF)", "`insonify doctor` examines it, and a station file (TOML) names it under [scene]");
const RECORDING: Known = ("a recording (MCAP)", "`insonify inspect` summarises it");
const VOLUME: Known = ("a volume (NIfTI)", "`insonify scene from-labels` makes a scene of a label map");
const MESH: Known = ("a mesh (STL)", "`insonify scene from-meshes` makes a scene of meshes");
const COMPRESSED: Known = ("a compressed file (gzip)", "decompress it first");

/// Kind of a file by its first bytes or the end of its name; `None` if neither tells it.
fn known(start: &[u8], path: &Path) -> Option<Known> {
    let ends_with = |end: &str| path.to_string_lossy().to_ascii_lowercase().ends_with(end);
    let has = |word: &[u8]| start.windows(word.len()).any(|bytes| bytes == word);
    let is_nifti = matches!(start.get(344..348), Some(b"n+1\0" | b"ni1\0"))
        || matches!(start.get(4..8), Some(b"n+2\0" | b"ni2\0"));
    if start.starts_with(b"glTF") {
        Some(GLTF)
    } else if start.starts_with(b"\x89MCAP0\r\n") {
        Some(RECORDING)
    } else if start.starts_with(b"\x1f\x8b\x08") {
        Some(if ends_with(".nii.gz") { VOLUME } else { COMPRESSED })
    } else if is_nifti {
        Some(VOLUME)
    } else if ends_with(".stl") || (start.starts_with(b"solid") && has(b"facet")) {
        Some(MESH)
    } else {
        None
    }
}

/// Refuses a file that is recognised as another kind than the expected `kind`. Only text files and scenes are
/// checked; the readers of other kinds recognise their own formats.
///
/// # Errors
/// A file of another kind; the error names that kind.
pub(super) fn refuse_other_kind(start: &[u8], path: &Path, kind: FileKind) -> io::Result<()> {
    let Some(found) = known(start, path) else { return Ok(()) };
    let is_other = match kind {
        FileKind::Station
        | FileKind::Names
        | FileKind::Calibration
        | FileKind::Planes
        | FileKind::Manifest
        | FileKind::Table
        | FileKind::DatasetHeader
        | FileKind::DatasetRows => true,
        // A scene's buffers belong to this kind, and may start with any bytes.
        FileKind::Scene => found != GLTF && path.extension().is_none_or(|end| !end.eq_ignore_ascii_case("bin")),
        _ => false,
    };
    if !is_other {
        return Ok(());
    }
    let ((what, advice), (expected, _)) = (found, kind.limit());
    Err(io::Error::new(ErrorKind::Unsupported, format!("it is {what}, not {expected}; {advice}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(start: &[u8], name: &str, kind: FileKind) -> String {
        refuse_other_kind(start, Path::new(name), kind).err().map(|error| error.to_string()).unwrap_or_default()
    }

    #[test]
    fn files_of_another_kind_are_named_with_what_reads_them() {
        let nifti = [&[0; 344][..], b"n+1\0", &[0; 8]].concat();
        for (start, name, kind, says) in [
            (&b"glTF\x02\0\0\0"[..], "patient.glb", FileKind::Station, "it is a scene (glTF), not a station file; "),
            (b"\x89MCAP0\r\n", "a.mcap", FileKind::Calibration, "it is a recording (MCAP), not a calibration; "),
            (b"\x1f\x8b\x08\0", "total.nii.gz", FileKind::Scene, "it is a volume (NIfTI), not a scene; "),
            (b"\x1f\x8b\x08\0", "a.toml.gz", FileKind::Station, "it is a compressed file (gzip)"),
            (&nifti[..], "total.nii", FileKind::Scene, "it is a volume (NIfTI)"),
            (b"made by a scanner", "liver.STL", FileKind::Scene, "`insonify scene from-meshes`"),
            (b"solid liver\n facet normal", "liver", FileKind::Station, "it is a mesh (STL), not a station file"),
        ] {
            let said = told(start, name, kind);
            assert!(said.contains(says), "{name}: {said}");
        }
    }

    #[test]
    fn files_of_the_expected_kind_and_raw_data_pass() {
        for (start, name, kind) in [
            (&b"glTF\x02\0\0\0"[..], "patient.glb", FileKind::Scene),
            (b"{\"asset\": {}}", "patient.gltf", FileKind::Scene),
            (b"\x1f\x8b\x08\0", "buffer.bin", FileKind::Scene),
            (b"\x1f\x8b\x08\0", "total.nii.gz", FileKind::Volume),
            (b"solid liver\n facet", "liver.stl", FileKind::Mesh),
            (b"\x89MCAP0\r\n", "a.mcap", FileKind::Recording),
            (b"solid = \"a\"\n", "station.toml", FileKind::Station),
            (b"", "station.toml", FileKind::Station),
        ] {
            assert_eq!(told(start, name, kind), "", "{name}");
        }
    }
}
