//! STL files, binary and text.

use glam::DVec3;
use insonify_core::names::counted;

use super::super::numbers::{Number, Order};
use super::Parsed;
use super::draft::Draft;
use super::error::Fault;
use super::scanner::{Scanner, finite, lines, not_a_number, text};

/// Sizes of the header with the count of triangles, and of a triangle, bytes.
const HEADER: usize = 84;
const TRIANGLE: usize = 50;

/// Whether the bytes could be a text STL file.
pub(super) fn is_text(bytes: &[u8]) -> bool {
    let start = &bytes[..bytes.len().min(2048)];
    let trimmed = start.trim_ascii_start();
    let starts = trimmed.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    let has = |word: &[u8]| start.windows(word.len()).any(|w| w.eq_ignore_ascii_case(word));
    // Binary files may begin with `solid`, too, so further words must follow.
    let has_words = (has(b"facet") && has(b"vertex")) || has(b"endsolid");
    starts && !is_binary(bytes) && (has_words || !start.contains(&0))
}

/// Whether the number of bytes matches the count of triangles in a binary header.
pub(super) fn is_binary(bytes: &[u8]) -> bool {
    count(bytes).is_some_and(|count| count > 0 && bytes.len() == HEADER.saturating_add(count.saturating_mul(TRIANGLE)))
}

fn count(bytes: &[u8]) -> Option<usize> {
    Some(u32::from_le_bytes(*bytes.get(80..HEADER)?.first_chunk()?) as usize)
}

pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, Fault> {
    if is_text(bytes) { parse_text(bytes) } else { parse_binary(bytes) }
}

fn parse_binary(bytes: &[u8]) -> Result<Parsed, Fault> {
    let Some(count) = count(bytes) else {
        return Err(Fault::byte(bytes.len(), "truncated: the header of a binary STL file has 84 bytes"));
    };
    let mut parsed = Parsed::default();
    parsed.hints.take(&String::from_utf8_lossy(&bytes[..80]));
    let mut scanner = Scanner::from(bytes, HEADER);
    let triangles =
        scanner.take(count.saturating_mul(TRIANGLE), &format!("the {count} triangles that byte 80 promises"))?;
    check_rest(count, &bytes[scanner.at..])?;
    let mut draft = Draft::default();
    for triangle in triangles.chunks_exact(TRIANGLE) {
        let first = parsed.vertices.len() as u32;
        // The first 12 bytes of a triangle are its normal.
        for corner in triangle[12..48].chunks_exact(12) {
            let [x, y, z] = [0, 4, 8].map(|at| Number::F32.read(&corner[at..], Order::Little));
            parsed.vertices.push(DVec3::new(x, y, z));
        }
        draft.triangles.push([first, first + 1, first + 2]);
    }
    parsed.drafts.push(draft);
    Ok(parsed)
}

/// Refuses bytes after the last triangle, except padding: the count of triangles is too low, or the file is damaged.
fn check_rest(count: usize, rest: &[u8]) -> Result<(), Fault> {
    if rest.iter().all(|b| *b == 0 || b.is_ascii_whitespace()) {
        return Ok(());
    }
    let (promised, left) = (counted(count, "triangle"), counted(rest.len(), "byte"));
    let reason = if rest.len().is_multiple_of(TRIANGLE) {
        let more = counted(rest.len() / TRIANGLE, "triangle");
        format!("the count is wrong: it promises {promised}, and {more} more follow; export the mesh again")
    } else {
        format!(
            "the count promises {promised}, and {left} more follow, which is no whole number of triangles; export the mesh again"
        )
    };
    Err(Fault::byte(80, reason))
}

fn parse_text(bytes: &[u8]) -> Result<Parsed, Fault> {
    let mut reader = TextReader::default();
    for (number, line) in lines(bytes) {
        reader.line(line, number)?;
    }
    if let Some(number) = reader.facet {
        return Err(Fault::line(number, "truncated: the file ends inside this facet"));
    }
    if let Some(number) = reader.solid {
        let reason =
            "truncated: this solid has no `endsolid`; export the mesh again, or add that line if nothing is missing";
        return Err(Fault::line(number, reason));
    }
    reader.parsed.drafts.extend(reader.draft);
    Ok(reader.parsed)
}

/// State of the reader between the lines of a text file.
#[derive(Default)]
struct TextReader {
    parsed: Parsed,
    draft: Option<Draft>,
    /// Line number of the `solid` statement that has no end yet.
    solid: Option<usize>,
    /// Line number of the `facet` statement that has no end yet.
    facet: Option<usize>,
    /// Corners of the unfinished facet.
    corners: Vec<u32>,
}

impl TextReader {
    fn line(&mut self, line: &[u8], number: usize) -> Result<(), Fault> {
        let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        let Some(first) = words.next() else { return Ok(()) };
        let mut word = first.to_ascii_lowercase();
        // Some programs write `end loop`.
        if word == b"end" {
            word.extend(words.next().unwrap_or_default().to_ascii_lowercase());
        }
        match word.as_slice() {
            b"solid" => self.begin_solid(line, number)?,
            b"endsolid" => self.solid = None,
            b"facet" => self.begin_facet(number)?,
            b"vertex" => {
                if self.facet.is_none() {
                    return Err(Fault::line(number, "a vertex outside a facet; export the mesh again"));
                }
                let at = vertex(words).map_err(|reason| Fault::line(number, reason))?;
                self.corners.push(self.parsed.vertices.len() as u32);
                self.parsed.vertices.push(at);
            }
            b"endfacet" => {
                if self.corners.len() < 3 {
                    let count = self.corners.len();
                    return Err(Fault::line(number, format!("a facet of {count} vertices; it must have 3")));
                }
                self.draft.get_or_insert_default().polygon(&self.corners, &self.parsed.vertices);
                self.corners.clear();
                self.facet = None;
            }
            b"outer" | b"outerloop" | b"endloop" | b"color" => {}
            _ => return Err(Fault::line(number, format!("`{}` is no word of a text STL file", text(first)))),
        }
        Ok(())
    }

    fn begin_solid(&mut self, line: &[u8], number: usize) -> Result<(), Fault> {
        if let Some(open) = self.solid {
            let reason = format!("a solid begins, and that of line {open} has no `endsolid`; export the mesh again");
            return Err(Fault::line(number, reason));
        }
        let name = String::from_utf8_lossy(line.trim_ascii_start().get(5..).unwrap_or_default()).into_owned();
        self.parsed.hints.take(&name);
        self.parsed.drafts.extend(self.draft.replace(Draft::named(solid_name(&name))));
        self.solid = Some(number);
        Ok(())
    }

    fn begin_facet(&mut self, number: usize) -> Result<(), Fault> {
        if let Some(open) = self.facet {
            let reason = format!("a facet begins, and that of line {open} has no `endfacet`; export the mesh again");
            return Err(Fault::line(number, reason));
        }
        if self.solid.is_none() {
            return Err(Fault::line(number, "a facet outside `solid` and `endsolid`; export the mesh again"));
        }
        self.facet = Some(number);
        Ok(())
    }
}

/// Position of a vertex; there must be exactly three numbers.
fn vertex<'b>(words: impl Iterator<Item = &'b [u8]>) -> Result<DVec3, String> {
    let values =
        words.map(|word| finite(word).ok_or_else(|| format!("{}; there should be a coordinate", not_a_number(word))));
    let values = values.collect::<Result<Vec<f64>, String>>()?;
    match values[..] {
        [x, y, z] => Ok(DVec3::new(x, y, z)),
        _ => Err(format!("a vertex of {}; it must have 3", counted(values.len(), "number"))),
    }
}

/// Name after `solid`, without the text that 3D Slicer and other programs append.
fn solid_name(after: &str) -> String {
    let name = after.trim();
    if name.to_uppercase().contains("SPACE=") || name.to_lowercase().starts_with("ascii") {
        String::new()
    } else {
        name.to_owned()
    }
}
