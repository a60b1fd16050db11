//! STL files, binary and text.

use glam::DVec3;

use super::Parsed;
use super::draft::Draft;
use super::error::Fault;
use super::scanner::{Number, Order, Scanner, text};

/// Length of the header with the count of triangles, and of a triangle, bytes.
const HEADER: usize = 84;
const TRIANGLE: usize = 50;

/// Whether the file could be STL.
pub(super) fn is_text(bytes: &[u8]) -> bool {
    let start = &bytes[..bytes.len().min(2048)];
    let trimmed = start.trim_ascii_start();
    let starts = trimmed.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    let has = |word: &[u8]| start.windows(word.len()).any(|w| w.eq_ignore_ascii_case(word));
    // Binary files may begin with `solid`, too.
    starts && !is_binary(bytes) && (has(b"facet") || has(b"endsolid") || !start.contains(&0))
}

/// Whether the length is what a binary header promises.
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
    let mut scanner = Scanner { bytes, at: HEADER };
    let rest = scanner.take(count.saturating_mul(TRIANGLE), &format!("the {count} triangles that byte 80 promises"))?;
    let mut draft = Draft::default();
    for triangle in rest.chunks_exact(TRIANGLE) {
        let first = parsed.vertices.len() as u32;
        // A normal precedes the corners.
        for corner in triangle[12..48].chunks_exact(12) {
            let [x, y, z] = [0, 4, 8].map(|at| Number::F32.read(&corner[at..], Order::Little));
            parsed.vertices.push(DVec3::new(x, y, z));
        }
        draft.triangles.push([first, first + 1, first + 2]);
    }
    parsed.drafts.push(draft);
    Ok(parsed)
}

fn parse_text(bytes: &[u8]) -> Result<Parsed, Fault> {
    let mut parsed = Parsed::default();
    let mut draft: Option<Draft> = None;
    let mut corners: Vec<u32> = Vec::new();
    let mut in_facet = None;
    for (number, line) in (1..).zip(bytes.split(|b| *b == b'\n')) {
        let mut scanner = Scanner::new(line);
        let Some(word) = scanner.word() else { continue };
        match word.to_ascii_lowercase().as_slice() {
            b"solid" => {
                let name = String::from_utf8_lossy(line.trim_ascii_start().get(5..).unwrap_or_default());
                parsed.hints.take(&name);
                parsed.drafts.extend(draft.replace(Draft::named(solid_name(&name))));
            }
            b"vertex" => {
                let mut next = || scanner.number("a coordinate").map_err(|fault| Fault::line(number, fault.reason));
                let at = DVec3::new(next()?, next()?, next()?);
                corners.push(parsed.vertices.len() as u32);
                parsed.vertices.push(at);
            }
            b"facet" => in_facet = Some(number),
            b"endfacet" => {
                if corners.len() < 3 {
                    return Err(Fault::line(number, format!("a facet of {} vertices; it must have 3", corners.len())));
                }
                draft.get_or_insert_default().polygon(&corners, &parsed.vertices);
                corners.clear();
                in_facet = None;
            }
            b"outer" | b"endloop" | b"endsolid" | b"color" => {}
            _ => return Err(Fault::line(number, format!("`{}` is no word of a text STL file", text(word)))),
        }
    }
    if let Some(number) = in_facet {
        return Err(Fault::line(number, "truncated: the file ends inside this facet"));
    }
    parsed.drafts.extend(draft);
    Ok(parsed)
}

/// Name after `solid`, without what Slicer and others append.
fn solid_name(after: &str) -> String {
    let name = after.trim();
    if name.to_uppercase().contains("SPACE=") || name.to_lowercase().starts_with("ascii") {
        String::new()
    } else {
        name.to_owned()
    }
}
