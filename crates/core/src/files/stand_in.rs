//! Stand-ins: pointers and web pages that were stored under the name of the file that they replace.

use std::io::{self, ErrorKind, Read, Seek};

/// Number of bytes at the start of a file that [`stand_in`] examines.
const STAND_IN_BYTES: usize = 512;

/// Cause and remedy if a file's first bytes belong to a stand-in: a pointer of Git LFS or git-annex, or a web page that
/// was saved instead of the file. The phrase is to follow the file's name: "it is a Git LFS pointer...". No file that
/// this program reads starts like a stand-in.
fn stand_in(start: &[u8]) -> Option<&'static str> {
    let start = &start[..start.len().min(STAND_IN_BYTES)];
    let start = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(start).trim_ascii_start();
    let opens = |word: &str| start.get(..word.len()).is_some_and(|s| s.eq_ignore_ascii_case(word.as_bytes()));
    let has = |word: &str| start.windows(word.len()).any(|s| s.eq_ignore_ascii_case(word.as_bytes()));
    let is_xml = opens("<?xml");
    if opens("version https://git-lfs.github.com/spec/") || opens("version http://git-media.io/") {
        Some("it is a Git LFS pointer, not the file itself; run `git lfs pull` in its folder")
    } else if opens("/annex/objects/") {
        Some("it is a git-annex pointer, not the file itself; run `git annex get` in its folder")
    } else if opens("<!doctype html") || opens("<html") || opens("<head") || (is_xml && has("<html")) {
        Some("it is a web page (HTML), not the file itself; download the raw file")
    } else if (opens("<error>") || is_xml) && has("<error>") && has("<code>") {
        Some("it is a server's error message (XML), not the file itself; download the file again")
    } else {
        None
    }
}

/// First bytes of a file, from which its kind is recognised. The reading position returns to the start.
///
/// # Errors
/// A file that cannot be read.
pub(super) fn start_of(file: &mut (impl Read + Seek)) -> io::Result<Vec<u8>> {
    let mut start = Vec::with_capacity(STAND_IN_BYTES);
    file.by_ref().take(STAND_IN_BYTES as u64).read_to_end(&mut start)?;
    file.rewind()?;
    Ok(start)
}

/// Refuses a file that starts like a stand-in.
///
/// # Errors
/// A stand-in, with its remedy.
pub(super) fn refuse_stand_in(start: &[u8]) -> io::Result<()> {
    stand_in(start).map_or(Ok(()), |cause| Err(io::Error::new(ErrorKind::InvalidData, cause)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stand_ins_are_named_with_their_remedy() {
        let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n";
        for (start, says) in [
            (pointer, "git lfs pull"),
            ("/annex/objects/MD5E-s12--a.nii.gz\n", "git annex get"),
            ("<!DOCTYPE html>\n<html><head>", "download the raw file"),
            ("\u{feff}\r\n <!doctype HTML>", "download the raw file"),
            ("<HTML lang=\"en\">", "download the raw file"),
            ("<?xml version=\"1.0\"?>\n<html xmlns=\"http://www.w3.org/1999/xhtml\">", "download the raw file"),
            ("<?xml version=\"1.0\"?>\n<Error><Code>AccessDenied</Code>", "error message"),
            ("<Error><Code>NoSuchKey</Code>", "error message"),
        ] {
            assert!(stand_in(start.as_bytes()).is_some_and(|cause| cause.contains(says)), "{start}");
        }
    }

    #[test]
    fn files_of_known_kinds_are_none() {
        for start in [
            "",
            "version = 1\n",
            "solid liver\n",
            "# a page about <html>\nv 0 0 0\n",
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\">",
            "<VTKFile type=\"PolyData\">",
            "{\"asset\": {\"version\": \"2.0\"}}",
            "NRRD0004\n",
            "[tracker]\n",
        ] {
            assert_eq!(stand_in(start.as_bytes()), None, "{start}");
        }
    }
}
