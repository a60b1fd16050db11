//! OBJ files.

use std::collections::{HashMap, HashSet};

use glam::DVec3;

use super::Parsed;
use super::draft::Draft;
use super::error::Fault;
use super::scanner::{finite, lines, not_a, text};

/// OBJ statements that are ignored, as they define no polygon: normals, texture, materials, display, parameters of
/// curves.
const SKIPPED: [&str; 34] = [
    "vt",
    "vn",
    "vp",
    "vc",
    "s",
    "mtllib",
    "maplib",
    "usemap",
    "mg",
    "lod",
    "bevel",
    "c_interp",
    "d_interp",
    "shadow_obj",
    "trace_obj",
    "ctech",
    "stech",
    "res",
    "cstype",
    "deg",
    "bmat",
    "step",
    "curv",
    "curv2",
    "parm",
    "trim",
    "hole",
    "scrv",
    "sp",
    "end",
    "con",
    "cdp",
    "cdc",
    "bsm",
];

/// Statements of free-form surfaces.
const FREE_FORM: [&str; 3] = ["surf", "bzp", "bsp"];

/// Meshes of the file: one for each object, else for each group. Their parts are the groups of an object, else the
/// materials. Normals and texture coordinates are ignored.
pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, Fault> {
    let mut reader = Reader::default();
    let mut joined: Vec<u8> = Vec::new();
    let mut last = 1;
    for (number, line) in lines(bytes) {
        last = number;
        let line = line.trim_ascii();
        // A backslash joins a line of numbers to the next line. Comments and names may end in a backslash, as Windows
        // paths do.
        let is_text = joined.is_empty() && is_text(line);
        if let Some(start) = line.strip_suffix(b"\\").filter(|_| !is_text) {
            joined.extend_from_slice(start);
            joined.push(b' ');
        } else if joined.is_empty() {
            reader.line(line, number)?;
        } else {
            joined.extend_from_slice(line);
            reader.line(&std::mem::take(&mut joined), number)?;
        }
    }
    reader.line(&joined, last)?;
    Ok(reader.finish())
}

/// Whether a line is a comment, or a statement whose name extends to the end of the line.
fn is_text(line: &[u8]) -> bool {
    let word = line.split(u8::is_ascii_whitespace).next().unwrap_or_default();
    word.starts_with(b"#") || matches!(word, b"o" | b"g" | b"usemtl" | b"mtllib" | b"usemap" | b"maplib")
}

/// Object, group and material of a face. `object` is the object's number, since two may share a name.
#[derive(Debug, Clone, Default, PartialEq, Eq, Hash)]
struct Key {
    object: usize,
    group: String,
    material: String,
}

#[derive(Default)]
struct Reader {
    parsed: Parsed,
    /// Faces of each key, in the order of the keys' first faces.
    faces: Vec<(Key, Draft)>,
    index_of: HashMap<Key, usize>,
    /// Names of the objects. Object n, counted from 1, has entry n − 1; faces before the first object have number 0.
    objects: Vec<String>,
    now: Key,
    /// Index of the current key in `faces`; `None` between a change of key and the next face.
    present: Option<usize>,
}

impl Reader {
    fn line(&mut self, line: &[u8], number: usize) -> Result<(), Fault> {
        let is_word = |word: &&[u8]| !word.is_empty();
        let mut words = line.split(u8::is_ascii_whitespace).filter(is_word);
        let Some(word) = words.next() else { return Ok(()) };
        // A comment may follow numbers.
        let words = words.take_while(|word| !word.starts_with(b"#"));
        let rest = || String::from_utf8_lossy(line.get(word.len()..).unwrap_or_default()).trim().to_owned();
        match word {
            b"v" => self.vertex(words).map_err(|reason| Fault::line(number, reason))?,
            b"f" | b"fo" => self.face(words).map_err(|reason| Fault::line(number, reason))?,
            b"o" => {
                self.objects.push(rest());
                (self.now.object, self.present) = (self.objects.len(), None);
            }
            b"g" => (self.now.group, self.present) = (without_placeholder(rest()), None),
            b"usemtl" => (self.now.material, self.present) = (without_placeholder(rest()), None),
            b"p" | b"l" => self.parsed.others += 1,
            b"call" | b"csh" => {
                let reason =
                    format!("`{}` includes another file, which is not followed: export all in one file", text(word));
                return Err(Fault::line(number, reason));
            }
            _ if word.starts_with(b"#") => self.parsed.hints.take(&String::from_utf8_lossy(line)),
            _ => {
                let word = text(word);
                if FREE_FORM.contains(&word.as_str()) {
                    let reason = format!("`{word}` is a free-form surface: convert it to a mesh of polygons");
                    return Err(Fault::line(number, reason));
                }
                if !SKIPPED.contains(&word.as_str()) {
                    let reason = format!("`{word}` is no statement of an OBJ file: export the mesh again");
                    return Err(Fault::line(number, reason));
                }
            }
        }
        Ok(())
    }

    /// Adds a vertex. Weights and colours may follow its coordinates.
    fn vertex<'b>(&mut self, words: impl Iterator<Item = &'b [u8]>) -> Result<(), String> {
        let (mut at, mut count) = (DVec3::ZERO, 0);
        for word in words {
            let value = finite(word).ok_or_else(|| not_a("coordinate of a vertex", word))?;
            if count < 3 {
                at[count] = value;
            }
            count += 1;
        }
        if count < 3 {
            return Err(format!("a vertex of {count} coordinates; it must have 3"));
        }
        self.parsed.vertices.push(at);
        Ok(())
    }

    fn face<'b>(&mut self, words: impl Iterator<Item = &'b [u8]>) -> Result<(), String> {
        let corners = words.map(|word| self.corner(word)).collect::<Result<Vec<u32>, _>>()?;
        if corners.len() < 3 {
            return Err(format!("a face of {} corners; it must have 3 or more", corners.len()));
        }
        let index = self.present.unwrap_or_else(|| {
            let faces = &mut self.faces;
            *self.index_of.entry(self.now.clone()).or_insert_with_key(|key| {
                faces.push((key.clone(), Draft::default()));
                faces.len() - 1
            })
        });
        self.present = Some(index);
        self.faces[index].1.polygon(&corners, &self.parsed.vertices);
        Ok(())
    }

    /// Vertex index of a corner such as `7`, `7/1/3` or `-1//2`. Negative numbers count back from the last vertex read.
    fn corner(&self, word: &[u8]) -> Result<u32, String> {
        let count = self.parsed.vertices.len();
        let first = word.split(|b| *b == b'/').next().unwrap_or_default();
        let value: Option<i64> = str::from_utf8(first).ok().and_then(|word| word.parse().ok());
        let index = match value {
            Some(value) if value > 0 => Some(value - 1),
            Some(value) if value < 0 => (count as i64).checked_add(value),
            _ => None,
        };
        index
            .and_then(|index| u32::try_from(index).ok())
            .filter(|index| (*index as usize) < count)
            .ok_or_else(|| format!("`{}` names no vertex: there are {count} so far, counted from 1", text(word)))
    }

    /// Turns the faces into drafts. Faces of one object, or else of one group, become the parts of one mesh.
    fn finish(self) -> Parsed {
        let Self { mut parsed, faces, objects, .. } = self;
        let same = joined_objects(&objects, &faces);
        let mut groups_of: HashMap<usize, HashSet<&str>> = HashMap::new();
        for (key, _) in &faces {
            groups_of.entry(same[key.object]).or_default().insert(&key.group);
        }
        // The groups of an object become its parts if its faces are in several groups.
        let by_group: HashSet<usize> =
            groups_of.into_iter().filter(|(_, groups)| groups.len() > 1).map(|(object, _)| object).collect();
        let mut wholes: HashMap<(usize, String), usize> = HashMap::new();
        for (key, draft) in faces {
            let Key { object, group, material } = key;
            let object = same[object];
            let name = object.checked_sub(1).map(|index| objects[index].clone()).filter(|name| !name.is_empty());
            let (name, part, whole) = match name {
                Some(name) if by_group.contains(&object) => (name, group, (object, String::new())),
                Some(name) => (name, material, (object, String::new())),
                None => (group.clone(), material, (object, group)),
            };
            let count = wholes.len();
            let whole = *wholes.entry(whole).or_insert(count);
            parsed.drafts.push(Draft {
                part: Some(part),
                whole: Some(whole),
                ..Draft::named(name).with(draft.triangles)
            });
        }
        parsed
    }
}

/// For each object's number, the number of the earlier object that it continues, or its own. Objects of one name that
/// share a vertex are one object.
fn joined_objects(objects: &[String], faces: &[(Key, Draft)]) -> Vec<usize> {
    let mut same: Vec<usize> = (0..=objects.len()).collect();
    let mut by_name: HashMap<&str, Vec<usize>> = HashMap::new();
    for (index, name) in objects.iter().enumerate() {
        by_name.entry(name).or_default().push(index + 1);
    }
    let mut drafts_of: HashMap<usize, Vec<&Draft>> = HashMap::new();
    for (key, draft) in faces {
        drafts_of.entry(key.object).or_default().push(draft);
    }
    for numbers in by_name.into_values().filter(|numbers| numbers.len() > 1) {
        let mut object_of: HashMap<u32, usize> = HashMap::new();
        for &number in &numbers {
            let own = drafts_of.get(&number).into_iter().flatten();
            let vertices: Vec<u32> = own.flat_map(|draft| draft.triangles.iter().flatten().copied()).collect();
            if let Some(earlier) = vertices.iter().find_map(|vertex| object_of.get(vertex)) {
                same[number] = *earlier;
            }
            for vertex in vertices {
                object_of.entry(vertex).or_insert(same[number]);
            }
        }
    }
    same
}

/// `name`, or an empty text if it is a placeholder that programs write.
fn without_placeholder(name: String) -> String {
    let is_placeholder =
        ["default", "off", "(null)", "none", "null"].iter().any(|word| name.eq_ignore_ascii_case(word));
    if is_placeholder { String::new() } else { name }
}
