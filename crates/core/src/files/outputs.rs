//! Output files, checked before the program starts: none is also an input, and none is replaced unless the user asks
//! for it.

use std::path::{Component, Path, PathBuf};

use thiserror::Error;

use super::PartFile;

/// A refused output. `option` is the name of the option as the user typed it.
#[derive(Debug, Error)]
pub enum OutputError {
    /// An existing file that should not be replaced.
    #[error("{path} is there already; --force replaces it")]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// A device or a pipe, where a file would be replaced.
    #[error("{path} is not a regular file; {option} would replace it")]
    Device {
        /// The option.
        option: String,
        /// The device.
        path: PathBuf,
    },
    /// A file, where a directory is expected.
    #[error("{path} is a file; {option} takes a directory")]
    File {
        /// The option.
        option: String,
        /// The file.
        path: PathBuf,
    },
    /// A directory, where a file is expected.
    #[error("{path} is a directory; {option} takes a file")]
    Directory {
        /// The option.
        option: String,
        /// The directory.
        path: PathBuf,
    },
    /// A file in the path of an output, where a directory is expected.
    #[error("{path} is not a directory; {option} names a file in it")]
    NoDirectory {
        /// The option.
        option: String,
        /// The file.
        path: PathBuf,
    },
    /// An output that is also an input.
    #[error("this command reads {path}, so {option} must name another place")]
    Read {
        /// The option.
        option: String,
        /// The input.
        path: PathBuf,
    },
    /// Two outputs to one file.
    #[error("{other} and {option} name one file, {path}")]
    Twice {
        /// The first option.
        other: String,
        /// The second option.
        option: String,
        /// The file.
        path: PathBuf,
    },
}

/// Output files of a program, checked against its inputs and against each other.
#[derive(Debug, Default)]
pub struct Outputs {
    inputs: Vec<FileIdentity>,
    /// Each output's option with its file.
    outputs: Vec<(String, FileIdentity)>,
}

impl Outputs {
    /// Starts the check with these inputs.
    pub fn apart_from<P: AsRef<Path>>(inputs: impl IntoIterator<Item = P>) -> Self {
        Self::default().and(inputs)
    }

    /// Adds further inputs.
    pub fn and<P: AsRef<Path>>(mut self, inputs: impl IntoIterator<Item = P>) -> Self {
        self.inputs.extend(inputs.into_iter().map(|path| FileIdentity::of(path.as_ref())));
        self
    }

    /// Checks the output `path` of `option`. The output is written under another name and then renamed. It replaces an
    /// existing file only if `force` is set.
    pub fn file(self, option: &str, path: &Path, force: bool) -> Result<Self, OutputError> {
        if path.exists() && !force {
            return self.replaced(option, path).and_then(|_| Err(OutputError::Exists { path: path.to_owned() }));
        }
        self.replaced(option, path)
    }

    /// Checks an output that every run replaces, otherwise like [`file`](Self::file).
    pub fn replaced(self, option: &str, path: &Path) -> Result<Self, OutputError> {
        if path.exists() && !path.is_file() && !path.is_dir() {
            return Err(OutputError::Device { option: option.to_owned(), path: path.to_owned() });
        }
        self.checked(option, path)
    }

    /// Checks an output that is written directly, otherwise like [`file`](Self::file): it may be a device or a pipe.
    pub fn log(self, option: &str, path: &Path, force: bool) -> Result<Self, OutputError> {
        // A redirected /dev/stdout counts as a regular file, too.
        let regular = path.is_file() && !path.starts_with("/dev");
        if regular { self.file(option, path, force) } else { self.checked(option, path) }
    }

    /// Checks that no input is one of the files `names` in `directory`, which `option` names. A `*` in the last part of
    /// a name matches anything.
    pub fn within(self, option: &str, directory: &Path, names: &[&str]) -> Result<Self, OutputError> {
        if directory.exists() && !directory.is_dir() {
            return Err(OutputError::File { option: option.to_owned(), path: directory.to_owned() });
        }
        let file = FileIdentity::of(directory);
        for name in names {
            let reads = |input: &&FileIdentity| match name.split_once('*') {
                None => input.is(&FileIdentity::of(&directory.join(name))),
                Some((before, after)) => {
                    let below = input.path.strip_prefix(&file.path).ok().and_then(Path::to_str);
                    below.is_some_and(|name| name.starts_with(before) && name.ends_with(after))
                }
            };
            if let Some(input) = self.inputs.iter().find(reads) {
                return Err(OutputError::Read { option: option.to_owned(), path: input.path.clone() });
            }
        }
        Ok(self)
    }

    fn checked(mut self, option: &str, path: &Path) -> Result<Self, OutputError> {
        if path.is_dir() {
            return Err(OutputError::Directory { option: option.to_owned(), path: path.to_owned() });
        }
        let above = path.ancestors().skip(1).find(|above| !above.as_os_str().is_empty() && above.exists());
        if let Some(above) = above.filter(|above| !above.is_dir()) {
            return Err(OutputError::NoDirectory { option: option.to_owned(), path: above.to_owned() });
        }
        let file = FileIdentity::of(path);
        // An unfinished recording is renamed before a new one is written, so an input must not have that file name.
        let part = FileIdentity::of(&PartFile::appended(path).part);
        if self.inputs.iter().any(|input| input.is(&file) || input.is(&part)) {
            return Err(OutputError::Read { option: option.to_owned(), path: path.to_owned() });
        }
        if let Some((other, _)) = self.outputs.iter().find(|(_, other)| other.is(&file)) {
            return Err(OutputError::Twice { other: other.clone(), option: option.to_owned(), path: path.to_owned() });
        }
        self.outputs.push((option.to_owned(), file));
        Ok(self)
    }
}

/// Identity of a file: relative paths, symbolic links and hard links to one file are equal.
#[derive(Debug)]
struct FileIdentity {
    /// Absolute path, free of symbolic links as far as it exists.
    path: PathBuf,
    /// Device and inode of the file; `None` if it doesn't exist.
    inode: Option<(u64, u64)>,
}

impl FileIdentity {
    fn of(path: &Path) -> Self {
        Self { inode: inode(path), path: resolved(path) }
    }

    fn is(&self, other: &Self) -> bool {
        self.path == other.path || (self.inode.is_some() && self.inode == other.inode)
    }
}

/// Absolute path without symbolic links. The existing part is resolved by the system; the rest stays as written.
fn resolved(path: &Path) -> PathBuf {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    for above in absolute.ancestors() {
        if let (Ok(real), Ok(rest)) = (above.canonicalize(), absolute.strip_prefix(above)) {
            return rest.components().fold(real, |mut path, part| {
                match part {
                    Component::ParentDir => drop(path.pop()),
                    part => path.push(part),
                }
                path
            });
        }
    }
    absolute
}

#[cfg(unix)]
fn inode(path: &Path) -> Option<(u64, u64)> {
    use std::os::unix::fs::MetadataExt;
    path.metadata().ok().map(|found| (found.dev(), found.ino()))
}

#[cfg(not(unix))]
fn inode(_: &Path) -> Option<(u64, u64)> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(checked: Result<Outputs, OutputError>) -> String {
        match checked {
            Ok(_) => String::new(),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn a_file_that_is_read_is_never_written_by_whatever_name() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        std::fs::create_dir(at("sub")).unwrap();
        std::fs::write(at("in.mcap"), "").unwrap();
        std::fs::hard_link(at("in.mcap"), at("hard.mcap")).unwrap();
        #[cfg(unix)]
        std::os::unix::fs::symlink(at("in.mcap"), at("soft.mcap")).unwrap();
        #[cfg(unix)]
        std::os::unix::fs::symlink(dir.path(), at("sub/up")).unwrap();
        for name in ["in.mcap", "./in.mcap", "sub/../in.mcap", "hard.mcap", "soft.mcap", "sub/up/in.mcap"] {
            for force in [false, true] {
                let message = text(Outputs::apart_from([at("in.mcap")]).file("--record", &at(name), force));
                assert!(message.contains("reads") && message.contains("--record"), "{name}: {message}");
            }
        }
        assert_eq!(text(Outputs::apart_from([at("in.mcap")]).file("--record", &at("new/out.mcap"), false)), "");
        let part = Outputs::apart_from([at("in.mcap.part")]).file("--record", &at("in.mcap"), true);
        assert!(text(part).contains("reads"));
    }

    #[test]
    fn what_is_there_is_replaced_only_by_force_and_only_a_file() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        std::fs::write(at("a"), "").unwrap();
        let none = || Outputs::default();
        assert!(text(none().file("--out", &at("a"), false)).ends_with("is there already; --force replaces it"));
        assert_eq!(text(none().file("--out", &at("a"), true)), "");
        assert_eq!(text(none().replaced("--out", &at("a"))), "");
        for force in [false, true] {
            assert!(text(none().file("--out", dir.path(), force)).ends_with("is a directory; --out takes a file"));
        }
        assert!(text(none().replaced("--out", &at("a/b/c"))).contains("a is not a directory"));
        let twice = none().file("--record", &at("b"), false).and_then(|o| o.log("--metrics", &at("./b"), false));
        assert!(text(twice).contains("--record and --metrics name one file"));
        #[cfg(unix)]
        {
            assert_eq!(text(none().log("--metrics", Path::new("/dev/null"), false)), "");
            assert!(text(none().file("--record", Path::new("/dev/null"), true)).contains("not a regular file"));
        }
    }

    #[test]
    fn no_input_is_among_the_files_of_a_directory() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        std::fs::create_dir(at("bmode")).unwrap();
        for name in ["frame.json", "station.toml", "bmode/1.png"] {
            std::fs::write(at(name), "").unwrap();
        }
        let names = ["frame.json", "bmode/*.png"];
        let check = |input: &str| text(Outputs::apart_from([at(input)]).within("--out", dir.path(), &names));
        assert_eq!(check("station.toml"), "");
        assert!(check("frame.json").contains("must name another place"));
        assert!(check("bmode/1.png").contains("must name another place"));
        let file = Outputs::default().within("--out", &at("frame.json"), &names);
        assert!(text(file).ends_with("is a file; --out takes a directory"));
    }
}
