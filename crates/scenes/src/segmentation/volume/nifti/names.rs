//! Names and colours of labels in NIfTI extensions, as Caret and TotalSegmentator write them.

use super::super::label_names::LabelNames;
use super::super::{Segment, VolumeFault};

/// Size of the head of an extension, bytes: its length and its code.
const HEAD_BYTES: usize = 8;

/// Segments in the label tables of the extensions. `bytes` starts after the header.
///
/// Caret's extensions have code 30, TotalSegmentator's have code 0. The content decides whether there is a label table.
///
/// # Errors
/// A label table that isn't well-formed XML, or that names a label twice.
pub(super) fn segments(bytes: &[u8], big_endian: bool) -> Result<Vec<Segment>, VolumeFault> {
    let Some((&[flag, _, _, _], mut rest)) = bytes.split_first_chunk::<4>() else { return Ok(Vec::new()) };
    if flag == 0 {
        return Ok(Vec::new());
    }
    while let Some(length) = rest.first_chunk::<4>() {
        let length = if big_endian { u32::from_be_bytes(*length) } else { u32::from_le_bytes(*length) } as usize;
        // Bytes that aren't a valid extension are padding.
        if length < HEAD_BYTES || length > rest.len() {
            break;
        }
        let (extension, after) = rest.split_at(length);
        let content = &extension[HEAD_BYTES..];
        if let Ok(text) = std::str::from_utf8(content)
            && text.contains("<CaretExtension")
        {
            return label_table(text);
        }
        if content.windows(15).any(|part| part == b"<CaretExtension") {
            return Err(VolumeFault::Header("the label names in the Caret extension aren't UTF-8".to_owned()));
        }
        rest = after;
    }
    Ok(Vec::new())
}

fn label_table(text: &str) -> Result<Vec<Segment>, VolumeFault> {
    let text = text.trim_matches(|c: char| c == '\0' || c.is_whitespace());
    let parsed = roxmltree::Document::parse(text);
    let document = parsed.map_err(|error| {
        VolumeFault::Header(format!("the label names in the Caret extension aren't well-formed XML: {error}"))
    })?;
    let table = document.descendants().find(|node| node.has_tag_name("LabelTable"));
    let labels = table.into_iter().flat_map(|table| table.children()).filter(|node| node.has_tag_name("Label"));
    let mut names = LabelNames::default();
    for label in labels {
        let Some(value) = label.attribute("Key").and_then(|key| key.trim().parse::<u16>().ok()) else { continue };
        // A label's name may be several pieces of text and CDATA.
        let name: String = label.children().filter_map(|part| part.text()).collect();
        let name = name.trim();
        if value == 0 || name.is_empty() {
            continue;
        }
        let channel = |key| label.attribute(key).and_then(|share| share.trim().parse::<f64>().ok());
        let colour = match ["Red", "Green", "Blue"].map(channel) {
            [Some(red), Some(green), Some(blue)] => Some([red, green, blue].map(byte)),
            _ => None,
        };
        names.add(Segment { layer: 0, value, name: Some(name.to_owned()), colour, terminology: None })?;
    }
    Ok(names.segments())
}

/// Conversion of a share, 0..=1, to a byte, 0..=255.
pub(in super::super) fn byte(share: f64) -> u8 {
    (share * 255.0).round().clamp(0.0, 255.0) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn extension(code: i32, content: &str) -> Vec<u8> {
        let length = (HEAD_BYTES + content.len()).next_multiple_of(16);
        let mut bytes = i32::try_from(length).unwrap().to_le_bytes().to_vec();
        bytes.extend(code.to_le_bytes());
        bytes.extend(content.as_bytes());
        bytes.resize(length, 0);
        bytes
    }

    fn read(extensions: &[Vec<u8>]) -> Result<Vec<Segment>, VolumeFault> {
        segments(&[vec![1, 0, 0, 0], extensions.concat()].concat(), false)
    }

    const TABLE: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?> <CaretExtension>  <Date><![CDATA[2013]]></Date>\
        <VolumeInformation Index=\"0\"><LabelTable>\
        <Label Key=\"0\" Red=\"0\" Green=\"0\" Blue=\"0\" Alpha=\"0\"><![CDATA[???]]></Label>\
        <Label Key=\"5\" Red=\"0.5019607843137255\" Green=\"1.0\" Blue=\"0\" Alpha=\"1\"><![CDATA[liver]]></Label>\n\
        <Label Key=\"70000\"><![CDATA[beyond]]></Label>\
        <Label Key=\"7\">A &amp; B &#x3b1;</Label>\
        </LabelTable></VolumeInformation></CaretExtension>\n    ";

    #[test]
    fn names_and_colours_are_read_whatever_the_code() {
        for code in [0, 30] {
            let found = read(&[extension(6, "a comment"), extension(code, TABLE)]).unwrap();
            let named: Vec<_> = found.iter().map(|s| (s.value, s.name.as_deref().unwrap(), s.colour)).collect();
            assert_eq!(named, [(5, "liver", Some([128, 255, 0])), (7, "A & B α", None)]);
        }
    }

    #[test]
    fn two_names_of_one_label_are_refused() {
        let twice = |name: &str| TABLE.replace("Key=\"7\">A &amp; B &#x3b1;", &format!("Key=\"5\">{name}"));
        let error = read(&[extension(0, &twice("spleen"))]).unwrap_err().to_string();
        assert!(error.contains("label 5 of layer 0 is called `liver` and `spleen`"), "{error}");
        assert_eq!(read(&[extension(0, &twice("liver"))]).unwrap().len(), 1);
    }

    #[test]
    fn no_extension_gives_no_names() {
        assert_eq!(segments(&[0; 4], false).unwrap(), []);
        assert_eq!(segments(&[], false).unwrap(), []);
        assert_eq!(read(&[extension(6, "a comment")]).unwrap(), []);
    }

    #[test]
    fn broken_xml_is_an_error_with_its_place() {
        let error = read(&[extension(0, &TABLE.replace("</LabelTable>", ""))]).unwrap_err().to_string();
        assert!(error.contains("Caret extension") && error.contains(" at "), "{error}");
    }

    #[test]
    fn a_document_type_is_refused() {
        let bomb = "<!DOCTYPE a [<!ENTITY b \"c\">]><CaretExtension>&b;</CaretExtension>";
        assert!(read(&[extension(0, bomb)]).is_err());
    }

    #[test]
    fn deep_nesting_does_not_exhaust_the_stack() {
        let deep = format!("<CaretExtension>{}{}</CaretExtension>", "<a>".repeat(200_000), "</a>".repeat(200_000));
        let _ = read(&[extension(0, &deep)]);
    }
}
