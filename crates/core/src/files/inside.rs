//! Files that another file names.

use std::io::{self, ErrorKind};
use std::path::{Component, Path, PathBuf};

/// Path of the file `name`, which another file in `folder` names. The path must lie in that folder or below: an
/// absolute path, `..` and a link that leads out are refused. Files of foreign origin thus can't make this program read
/// other files.
///
/// # Errors
/// A name or a link that leads out of the folder. A file that doesn't exist is not an error here.
pub fn inside(folder: &Path, name: &str) -> io::Result<PathBuf> {
    let refused = |how: &str| {
        let reason = format!("{how} leads out of the folder; copy the file into it, and name it without a path");
        Err(io::Error::new(ErrorKind::InvalidInput, reason))
    };
    // Both separators count on every system, since the file may come from another one.
    if name.split(['/', '\\']).any(|part| part == "..") {
        return refused("`..`");
    }
    let is_below = Path::new(name).components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    let has_drive = name.as_bytes().get(1) == Some(&b':') && name.as_bytes()[0].is_ascii_alphabetic();
    if !is_below || has_drive || name.starts_with('\\') {
        return refused("an absolute path");
    }
    let path = folder.join(name);
    let own = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    match (own.canonicalize(), path.canonicalize()) {
        (Ok(own), Ok(real)) if !real.starts_with(&own) => refused("a link"),
        _ => Ok(path),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_lead_out_of_the_folder_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let own = folder.path().join("own");
        std::fs::create_dir_all(own.join("sub")).unwrap();
        for name in ["own/a.raw", "own/sub/b.raw", "secret"] {
            std::fs::write(folder.path().join(name), "x").unwrap();
        }
        let secret = folder.path().join("secret");
        let absolute = secret.to_str().unwrap();
        for (name, says) in [
            (absolute, "absolute"),
            ("../secret", "`..`"),
            ("sub/../../secret", "`..`"),
            ("..\\secret", "`..`"),
            ("C:\\secret", "absolute"),
            ("\\\\server\\secret", "absolute"),
        ] {
            let error = inside(&own, name).unwrap_err().to_string();
            assert!(error.contains(says) && error.contains("copy the file into it"), "{name}: {error}");
        }
        for name in ["a.raw", "./a.raw", "sub/b.raw", "none.raw", "two words: a.raw"] {
            assert_eq!(inside(&own, name).unwrap(), own.join(name), "{name}");
        }
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(&secret, own.join("link")).unwrap();
            std::os::unix::fs::symlink(own.join("a.raw"), own.join("within")).unwrap();
            std::os::unix::fs::symlink(folder.path(), own.join("up")).unwrap();
            for name in ["link", "up/secret"] {
                assert!(inside(&own, name).unwrap_err().to_string().contains("a link leads out"), "{name}");
            }
            assert!(inside(&own, "within").is_ok());
        }
    }
}
