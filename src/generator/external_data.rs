//! Detection of models whose weights lie in files other than the `.onnx` file.
//!
//! A tensor of an ONNX model may name another file that holds its values: field `external_data` of `TensorProto`
//! (onnx.proto). Exporters use this for large models, and PyTorch's exporter since version 2.6 for all models.

use std::path::Path;

use super::GeneratorError;

/// Largest nesting of messages that is read. Graphs inside control-flow operators nest.
const DEPTH_MAX: usize = 32;

/// Types of ONNX messages that contain tensors directly or through nested messages, and of the tensors themselves.
#[derive(Clone, Copy)]
enum Message {
    Model,
    Graph,
    SparseTensor,
    Node,
    Attribute,
    Function,
    Tensor,
}

impl Message {
    /// Type of the message in field `number`; `None` if the field contains no tensors.
    fn child(self, number: u64) -> Option<Self> {
        Some(match (self, number) {
            (Self::Model, 7) => Self::Graph,
            (Self::Model, 25) => Self::Function,
            (Self::Graph, 1) | (Self::Function, 7) => Self::Node,
            (Self::Graph, 5) | (Self::SparseTensor, 1 | 2) | (Self::Attribute, 5 | 10) => Self::Tensor,
            (Self::Graph, 15) | (Self::Attribute, 22 | 23) => Self::SparseTensor,
            (Self::Node, 5) => Self::Attribute,
            (Self::Attribute, 6 | 11) => Self::Graph,
            _ => return None,
        })
    }
}

/// Field numbers of `external_data` in a `TensorProto`, and of key and value in its entries.
const EXTERNAL_DATA: u64 = 13;
const KEY: u64 = 1;
const VALUE: u64 = 2;

/// Names of the other files with weights of `model`, the bytes of an `.onnx` file, without duplicates. Bytes that are
/// no protocol buffer give an empty list; ONNX Runtime refuses them.
fn external_files(model: &[u8]) -> Vec<String> {
    let mut files = Vec::new();
    visit(model, Message::Model, 0, &mut files);
    files
}

/// Refuses the model at `path` if its weights lie in other files, which the model's hash doesn't cover. ONNX Runtime
/// gets only the model's bytes, and would search for those files in the current folder.
pub(super) fn check_one_file(path: &Path, model: &[u8]) -> Result<(), GeneratorError> {
    let files = external_files(model);
    if files.is_empty() {
        return Ok(());
    }
    let names: Vec<String> = files.iter().map(|name| format!("`{}`", name.escape_debug())).collect();
    Err(GeneratorError::ExternalWeights { path: path.to_owned(), files: names.join(", ") })
}

fn visit(bytes: &[u8], message: Message, depth: usize, files: &mut Vec<String>) {
    for (number, content) in (Fields { rest: bytes }) {
        if let (Message::Tensor, EXTERNAL_DATA) = (message, number) {
            let text = |wanted| {
                let found = (Fields { rest: content }).find(|(number, _)| *number == wanted);
                found.map(|(_, bytes)| String::from_utf8_lossy(bytes).into_owned()).unwrap_or_default()
            };
            let file = text(VALUE);
            if text(KEY) == "location" && !files.contains(&file) {
                files.push(file);
            }
        } else if let Some(child) = message.child(number).filter(|_| depth < DEPTH_MAX) {
            visit(content, child, depth + 1, files);
        }
    }
}

/// Iterator over the length-delimited fields of a protocol buffer message. It ends with the message, or at the first
/// invalid field.
struct Fields<'a> {
    rest: &'a [u8],
}

impl<'a> Fields<'a> {
    fn varint(&mut self) -> Option<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let (&byte, rest) = self.rest.split_first()?;
            self.rest = rest;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(value);
            }
        }
        None
    }

    fn take(&mut self, count: u64) -> Option<&'a [u8]> {
        let (taken, rest) = self.rest.split_at_checked(usize::try_from(count).ok()?)?;
        self.rest = rest;
        Some(taken)
    }
}

impl<'a> Iterator for Fields<'a> {
    type Item = (u64, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let tag = self.varint()?;
            match tag & 7 {
                0 => self.varint().map(|_| ())?,
                1 => self.take(8).map(|_| ())?,
                2 => {
                    let count = self.varint()?;
                    return Some((tag >> 3, self.take(count)?));
                }
                5 => self.take(4).map(|_| ())?,
                _ => return None,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Encodes a length-delimited field of a message.
    fn field(number: u8, content: &[u8]) -> Vec<u8> {
        assert!(content.len() < 128 * 128);
        let tag = u16::from(number) << 3 | 2;
        let varint = |value: u16| {
            if value < 128 { vec![value as u8] } else { vec![value as u8 | 0x80, (value >> 7) as u8] }
        };
        [varint(tag), varint(content.len() as u16), content.to_vec()].concat()
    }

    fn entry(key: &str, value: &str) -> Vec<u8> {
        field(13, &[field(1, key.as_bytes()), field(2, value.as_bytes())].concat())
    }

    /// Encodes a tensor: its dimensions as a varint, its name, and the file with its values.
    fn tensor(file: &str) -> Vec<u8> {
        [vec![0x08, 0x80, 0x01], field(8, b"w"), entry("location", file), entry("offset", "0"), vec![0x70, 1]].concat()
    }

    #[test]
    fn files_of_initializers_constants_and_subgraphs_are_found_once() {
        let graph = field(5, &tensor("w.data"));
        assert_eq!(external_files(&field(7, &graph)), ["w.data"]);
        let constant = field(1, &field(5, &field(5, &tensor("constant.data"))));
        let branch = field(1, &field(5, &field(6, &graph)));
        let sparse = field(15, &field(1, &tensor("sparse.data")));
        let model = field(7, &[graph.clone(), graph, constant, branch, sparse].concat());
        assert_eq!(external_files(&model), ["w.data", "constant.data", "sparse.data"]);
        let function = field(25, &field(7, &field(5, &field(5, &tensor("function.data")))));
        assert_eq!(external_files(&function), ["function.data"]);
    }

    #[test]
    fn weights_within_the_file_and_metadata_called_location_are_not_external() {
        let inside = field(7, &field(5, &field(9, b"\x00\x01\x02\x03")));
        // `ModelProto.metadata_props` has entries of the same form, but names no files.
        let metadata = field(14, &[field(1, b"location"), field(2, b"Zurich")].concat());
        assert!(external_files(&[inside, metadata].concat()).is_empty());
    }

    proptest! {
        #[test]
        fn no_bytes_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
            external_files(&bytes);
            external_files(&field(7, &field(5, &bytes)));
        }
    }
}
