//! VTP files: VTK polydata as XML.

use glam::DVec3;
use roxmltree::{Document, Node};

use super::Parsed;
use super::cells::Cells;
use super::draft::Draft;
use super::error::{Fault, Position};
use super::scanner::{finite, not_a_number};
use super::vtk::not_polydata;
use super::vtp_data::{Encoding, Format};

pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, Fault> {
    // Appended data may be raw bytes, which XML doesn't allow, so they are cut off first.
    let start = find(bytes, b"<AppendedData").unwrap_or(bytes.len());
    let tail = &bytes[start..];
    let end = tail.iter().position(|b| *b == b'>').unwrap_or(0);
    let is_raw = find(&tail[..end], b"raw").is_some();
    let appended = tail[end..].iter().position(|b| *b == b'_').map_or(&[][..], |at| &tail[end + at + 1..]);
    let mut xml = String::from_utf8(bytes[..start].to_vec())
        .map_err(|e| Fault::byte(e.utf8_error().valid_up_to(), "the XML is not UTF-8"))?;
    if start < bytes.len() {
        xml += "</VTKFile>";
    }
    let document =
        Document::parse(&xml).map_err(|e| Fault::line(e.pos().row as usize, format!("not a whole XML file: {e}")))?;
    let root = document.root_element();
    let kind = root.attribute("type").unwrap_or_default();
    if !root.has_tag_name("VTKFile") || kind != "PolyData" {
        return Err(Fault::line(line(&root), not_polydata(kind)));
    }
    let format = Format::of(&root).map_err(|reason| Fault::line(line(&root), reason))?;
    let appended = if is_raw { Encoding::Raw(appended) } else { Encoding::Base64(appended) };
    let reader = Reader { format, appended };
    let mut parsed = Parsed::default();
    for array in root.descendants().filter(|n| n.has_tag_name("FieldData")).flat_map(|n| n.children()) {
        if array.attribute("type") == Some("String") {
            let text: String = reader.array(&array)?.into_iter().filter_map(|c| char::from_u32(c as u32)).collect();
            parsed.hints.take(&format!("{}={}", array.attribute("Name").unwrap_or_default(), text.trim_matches('\0')));
        }
    }
    let pieces: Vec<_> = root.descendants().filter(|n| n.has_tag_name("Piece")).collect();
    for (number, piece) in pieces.iter().enumerate() {
        // Several pieces become parts of one mesh.
        let part = (pieces.len() > 1).then(|| format!("piece {number}"));
        let mut draft = Draft { part, whole: Some(0), ..Draft::default() };
        reader.piece(piece, &mut parsed, &mut draft)?;
        parsed.drafts.push(draft);
    }
    Ok(parsed)
}

struct Reader<'a> {
    format: Format,
    /// Appended data, which follow the XML.
    appended: Encoding<'a>,
}

impl Reader<'_> {
    fn piece(&self, piece: &Node<'_, '_>, parsed: &mut Parsed, draft: &mut Draft) -> Result<(), Fault> {
        let child = |name: &str| piece.children().find(|n| n.has_tag_name(name));
        let count = |name: &str| piece.attribute(name).and_then(|n| n.trim().parse().ok()).unwrap_or(0usize);
        parsed.others += count("NumberOfLines") + count("NumberOfVerts");
        let Some(points) = child("Points").and_then(|n| n.children().find(|n| n.has_tag_name("DataArray"))) else {
            return Ok(());
        };
        let values = self.array(&points)?;
        let expected = count("NumberOfPoints");
        if values.len() != expected.saturating_mul(3) {
            let reason = format!("{} coordinates for {expected} points; there must be 3 for each", values.len());
            return Err(Fault::line(line(&points), reason));
        }
        let first = parsed.vertices.len();
        parsed.vertices.extend(values.as_chunks::<3>().0.iter().map(|at| DVec3::from_array(*at)));
        for (name, kind) in [("Polys", Cells::Polygons), ("Strips", Cells::Strips)] {
            let promised =
                piece.attribute(format!("NumberOf{name}").as_str()).map(|_| count(&format!("NumberOf{name}")));
            let Some(cells) = child(name) else { continue };
            let array = |name: &str| {
                let found = cells.children().find(|n| n.attribute("Name") == Some(name));
                found.map_or(Ok(Vec::new()), |n| self.array(&n))
            };
            let (corners, ends) = (array("connectivity")?, array("offsets")?);
            if let Some(promised) = promised.filter(|promised| *promised != ends.len()) {
                let reason = format!("{} cells in `{name}`, and {promised} are promised", ends.len());
                return Err(Fault::line(line(&cells), reason));
            }
            let mut own = Draft::default();
            kind.add_by_ends(&ends, &corners, &parsed.vertices[first..], &mut own)
                .map_err(|reason| Fault::line(line(&cells), reason))?;
            draft.triangles.extend(own.triangles.iter().map(|t| t.map(|vertex| vertex + first as u32)));
        }
        Ok(())
    }

    /// Values of a data array.
    fn array(&self, array: &Node<'_, '_>) -> Result<Vec<f64>, Fault> {
        let wrong = |reason: String| Fault { at: Position::Line(line(array)), reason };
        let name = array.attribute("Name").unwrap_or("without a name");
        let in_array = |reason: String| wrong(format!("the array `{name}`: {reason}"));
        let text = array.text().unwrap_or_default();
        let number = Format::number(array.attribute("type").unwrap_or_default());
        match array.attribute("format").unwrap_or("ascii") {
            "ascii" => {
                let parsed =
                    |word: &str| finite(word.as_bytes()).ok_or_else(|| in_array(not_a_number(word.as_bytes())));
                text.split_whitespace().map(parsed).collect()
            }
            "binary" => {
                let clean: Vec<u8> = text.bytes().filter(|b| !b.is_ascii_whitespace()).collect();
                self.format.values(Encoding::Base64(&clean), number).map_err(in_array)
            }
            "appended" => {
                let offset = array.attribute("offset").and_then(|offset| offset.trim().parse().ok());
                let from = offset.and_then(|offset| self.appended.from(offset));
                let from =
                    from.ok_or_else(|| in_array("truncated: its offset is beyond the appended data".to_owned()))?;
                self.format.values(from, number).map_err(in_array)
            }
            other => Err(in_array(format!("its format is `{other}`; it must be ascii, binary or appended"))),
        }
    }
}

/// Line of an element in the file, from 1.
fn line(node: &Node<'_, '_>) -> usize {
    node.document().text_pos_at(node.range().start).row as usize
}

fn find(bytes: &[u8], word: &[u8]) -> Option<usize> {
    bytes.windows(word.len()).position(|window| window == word)
}
