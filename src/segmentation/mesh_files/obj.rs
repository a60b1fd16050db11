//! OBJ files.

use std::collections::HashMap;

use glam::DVec3;

use super::Parsed;
use super::draft::Draft;
use super::error::Fault;
use super::scanner::{finite, text};

/// Meshes of the file: one for each object, else for each group. Materials, normals and texture coordinates are
/// ignored.
pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, Fault> {
    let mut reader = Reader::default();
    let mut joined: Vec<u8> = Vec::new();
    for (number, line) in (1..).zip(bytes.split(|b| *b == b'\n')) {
        let line = line.trim_ascii();
        // A backslash joins a line to the next.
        if let Some(start) = line.strip_suffix(b"\\") {
            joined.extend_from_slice(start);
            joined.push(b' ');
        } else if joined.is_empty() {
            reader.line(line, number)?;
        } else {
            joined.extend_from_slice(line);
            reader.line(&std::mem::take(&mut joined), number)?;
        }
    }
    reader.line(&joined, 0)?;
    Ok(reader.finish())
}

#[derive(Default)]
struct Reader {
    parsed: Parsed,
    /// Index of each draft, by object and group.
    draft_of: HashMap<(String, String), usize>,
    object: String,
    group: String,
    has_objects: bool,
    /// Draft that faces are added to.
    present: Option<usize>,
}

impl Reader {
    fn line(&mut self, line: &[u8], number: usize) -> Result<(), Fault> {
        let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        let rest = || String::from_utf8_lossy(line.get(1..).unwrap_or_default()).trim().to_owned();
        match words.next() {
            Some(b"v") => {
                let mut next = || {
                    let word = words.next().unwrap_or_default();
                    let wrong = || Fault::line(number, format!("`{}` is not a coordinate of a vertex", text(word)));
                    finite(word).ok_or_else(wrong)
                };
                self.parsed.vertices.push(DVec3::new(next()?, next()?, next()?));
            }
            Some(b"f") => {
                let corners = words.map(|word| self.corner(word, number)).collect::<Result<Vec<u32>, _>>()?;
                if corners.len() < 3 {
                    return Err(Fault::line(
                        number,
                        format!("a face of {} corners; it must have 3 or more", corners.len()),
                    ));
                }
                let draft = self.draft();
                self.parsed.drafts[draft].polygon(&corners, &self.parsed.vertices);
            }
            Some(b"o") => {
                (self.object, self.present, self.has_objects) = (rest(), None, true);
            }
            Some(b"g") => (self.group, self.present) = (rest(), None),
            Some(b"p" | b"l") => self.parsed.others += 1,
            Some(word) if word.starts_with(b"#") => self.parsed.hints.take(&String::from_utf8_lossy(line)),
            _ => {}
        }
        Ok(())
    }

    /// Vertex of a corner such as `7`, `7/1/3` or `-1//2`; the sign counts from the last vertex so far.
    fn corner(&self, word: &[u8], number: usize) -> Result<u32, Fault> {
        let count = self.parsed.vertices.len();
        let first = word.split(|b| *b == b'/').next().unwrap_or_default();
        let value: Option<i64> = str::from_utf8(first).ok().and_then(|word| word.parse().ok());
        let index = match value {
            Some(value) if value > 0 => Some(value - 1),
            Some(value) if value < 0 => Some(count as i64 + value),
            _ => None,
        };
        index.and_then(|index| u32::try_from(index).ok()).filter(|index| (*index as usize) < count).ok_or_else(|| {
            Fault::line(number, format!("`{}` names no vertex: there are {count} so far, counted from 1", text(word)))
        })
    }

    /// Draft of the present object and group.
    fn draft(&mut self) -> usize {
        if let Some(index) = self.present {
            return index;
        }
        let key = (self.object.clone(), if self.has_objects { String::new() } else { self.group.clone() });
        let drafts = &mut self.parsed.drafts;
        let index = *self.draft_of.entry(key).or_insert_with_key(|(object, group)| {
            let plain = matches!(group.as_str(), "default" | "off");
            drafts.push(Draft::named(if object.is_empty() && !plain { group.clone() } else { object.clone() }));
            drafts.len() - 1
        });
        self.present = Some(index);
        index
    }

    fn finish(self) -> Parsed {
        self.parsed
    }
}
