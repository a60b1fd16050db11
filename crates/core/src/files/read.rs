//! Reading of whole files, with a size limit for each kind.

use std::fs::File;
use std::io::{self, ErrorKind, Read};
use std::path::Path;

use super::kind::FileKind;
use super::other_kind::refuse_other_kind;
use super::stand_in::{refuse_stand_in, start_of};

/// Opens a regular file of at most the size that its kind allows.
///
/// Pipes and devices are refused: they might never end. Also refused are stand-ins: pointers of Git LFS and git-annex,
/// web pages, and servers' error messages. Where this program's own text files are expected, scenes, recordings,
/// volumes and meshes are refused.
///
/// # Errors
/// The file cannot be opened, is not a regular file, is a stand-in, is recognised as another kind, or is too large; the
/// error gives its size and the limit.
pub fn open(path: &Path, kind: FileKind) -> io::Result<File> {
    // Checked before opening: opening a pipe waits for its other end.
    let found = std::fs::metadata(path)?;
    if found.is_dir() {
        return Err(io::Error::new(ErrorKind::IsADirectory, "it is a directory, not a regular file"));
    }
    if !found.is_file() {
        return Err(io::Error::new(ErrorKind::InvalidInput, "it is not a regular file"));
    }
    let mut file = File::open(path)?;
    let start = start_of(&mut file)?;
    refuse_stand_in(&start)?;
    refuse_other_kind(&start, path, kind)?;
    if found.len() > kind.limit().1 {
        return Err(too_large(kind, &format!("it has {} bytes", found.len())));
    }
    Ok(file)
}

/// Reads a regular file of at most the size that its kind allows.
///
/// # Errors
/// The errors of [`open`], or the file cannot be read.
pub fn read(path: &Path, kind: FileKind) -> io::Result<Vec<u8>> {
    let (file, (_, limit)) = (open(path, kind)?, kind.limit());
    let length = file.metadata().map_or(0, |found| found.len().min(limit));
    let mut bytes = Vec::with_capacity(usize::try_from(length).unwrap_or_default());
    // The file may grow while it is read, and files of `/proc` state no length.
    file.take(limit + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit {
        return Err(too_large(kind, "it is larger"));
    }
    Ok(bytes)
}

/// Reads the text of a file, like [`read`].
///
/// # Errors
/// The errors of [`read`], or bytes that are not UTF-8.
pub fn read_text(path: &Path, kind: FileKind) -> io::Result<String> {
    let not_text = |e: std::string::FromUtf8Error| {
        let byte = e.utf8_error().valid_up_to();
        io::Error::new(ErrorKind::InvalidData, format!("it is not UTF-8 text: byte {byte}"))
    };
    String::from_utf8(read(path, kind)?).map_err(not_text)
}

fn too_large(kind: FileKind, found: &str) -> io::Error {
    let (what, limit) = kind.limit();
    io::Error::new(ErrorKind::FileTooLarge, format!("{found}; {what} has at most {limit}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_read_up_to_the_limit_of_its_kind() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("c.toml");
        let limit = FileKind::Calibration.limit().1;
        let sized = |bytes: u64| File::create(&path).unwrap().set_len(bytes).unwrap();
        sized(limit);
        assert_eq!(read(&path, FileKind::Calibration).unwrap().len() as u64, limit);
        sized(limit + 1);
        let error = read_text(&path, FileKind::Calibration).unwrap_err().to_string();
        assert_eq!(error, "it has 1048577 bytes; a calibration has at most 1048576");
        std::fs::write(&path, [b"glTF".repeat(1 << 19), vec![0]].concat()).unwrap();
        let error = read_text(&path, FileKind::Calibration).unwrap_err().to_string();
        assert!(error.starts_with("it is a scene (glTF), not a calibration"), "{error}");
        assert!(open(dir.path(), FileKind::Scene).is_err_and(|e| e.kind() == ErrorKind::IsADirectory));
        std::fs::write(&path, b"ab\xff").unwrap();
        assert!(read_text(&path, FileKind::Station).unwrap_err().to_string().ends_with("byte 2"));
    }

    #[test]
    fn a_pointer_of_git_lfs_is_refused_whatever_its_kind() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("model.onnx");
        std::fs::write(&path, "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n").unwrap();
        for kind in [FileKind::Model, FileKind::Scene, FileKind::Station, FileKind::Recording] {
            assert!(read(&path, kind).unwrap_err().to_string().contains("git lfs pull"));
        }
        std::fs::write(&path, "as it is").unwrap();
        assert_eq!(read_text(&path, FileKind::Model).unwrap(), "as it is");
    }

    #[cfg(unix)]
    #[test]
    fn devices_and_pipes_are_refused_at_once() {
        let dir = tempfile::tempdir().unwrap();
        let pipe = dir.path().join("pipe");
        nix::unistd::mkfifo(&pipe, nix::sys::stat::Mode::S_IRWXU).unwrap();
        for path in [Path::new("/dev/zero"), &pipe] {
            let error = read(path, FileKind::Station).unwrap_err();
            assert_eq!(error.to_string(), "it is not a regular file", "{}", path.display());
        }
    }
}
