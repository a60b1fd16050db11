//! A glTF file and its buffers.

use std::io;
use std::path::{Path, PathBuf};
use std::str::Utf8Error;

use data_url::DataUrl;
use gltf::{Document, Gltf, buffer};
use percent_encoding::percent_decode_str;

use super::extensions;
use crate::anatomy::SceneError;
use crate::files::{self, FileError, FileKind};

/// Length of the shortest binary glTF, bytes: its own header and the header of its first chunk.
const GLB_MIN: usize = 20;

/// A validated glTF document and the bytes of its buffers, none shorter than declared.
pub(super) struct File {
    pub(super) path: PathBuf,
    pub(super) document: Document,
    pub(super) buffers: Vec<Vec<u8>>,
}

impl File {
    pub(super) fn read(path: &Path) -> Result<Self, SceneError> {
        let bytes = files::read(path, FileKind::Scene).map_err(FileError::at("read the scene", path))?;
        let format = |reason: String| SceneError::Format { path: path.to_owned(), reason };
        check_header(&bytes).map_err(format)?;
        let Gltf { document, mut blob } =
            Gltf::from_slice_without_validation(&bytes).map_err(|e| format(e.to_string()))?;
        drop(bytes);
        let document = validate(document).map_err(format)?;
        let buffers = document.buffers().map(|b| read_buffer(path, &b, &mut blob)).collect::<Result<Vec<_>, _>>()?;
        Ok(Self { path: path.to_owned(), document, buffers })
    }

    /// Format error with this file's path.
    pub(super) fn format_error(&self, reason: impl Into<String>) -> SceneError {
        SceneError::Format { path: self.path.clone(), reason: reason.into() }
    }
}

/// Checks the header of a binary glTF for properties that the glTF crate takes for granted.
fn check_header(bytes: &[u8]) -> Result<(), String> {
    if bytes.is_empty() {
        return Err("it is empty".to_owned());
    }
    if !bytes.starts_with(b"glTF") {
        return Ok(());
    }
    let declared = bytes.get(8..12).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
    match declared.map(|d| d as usize) {
        Some(length) if length < GLB_MIN => Err(format!("byte 8: its header gives a length of {length} bytes")),
        Some(length) if bytes.len() >= length => Ok(()),
        Some(length) => Err(format!("truncated: its header promises {length} bytes, there are {}", bytes.len())),
        None => Err(format!("truncated: it ends after {} bytes, inside its header", bytes.len())),
    }
}

/// Checks that the document's references are within bounds.
fn validate(document: Document) -> Result<Document, String> {
    let mut root = document.into_json();
    root.extensions_required.retain(|name| !extensions::is_harmless(name));
    if let Some(name) = root.extensions_required.first() {
        return Err(extensions::refused(name));
    }
    if let Some(reason) = extensions::no_data(&root) {
        return Err(reason);
    }
    // The glTF crate's own validation accesses a primitive's positions before it checks that they exist.
    let primitives = root.meshes.iter().enumerate().flat_map(|(m, mesh)| mesh.primitives.iter().map(move |p| (m, p)));
    for (mesh, primitive) in primitives {
        if let Some(index) = primitive.attributes.values().find(|index| index.value() >= root.accessors.len()) {
            let (index, count) = (index.value(), root.accessors.len());
            return Err(format!("mesh {mesh} refers to accessor {index} of {count}"));
        }
    }
    Document::from_json(root).map_err(|e| e.to_string())
}

/// Path of the buffer `uri` of the scene at `path`; the buffer must be in the scene's folder.
fn buffer_file(path: &Path, uri: &str) -> io::Result<PathBuf> {
    let not_text = |e: Utf8Error| io::Error::new(io::ErrorKind::InvalidData, format!("its name is not UTF-8: {e}"));
    let name = percent_decode_str(uri).decode_utf8().map_err(not_text)?;
    files::inside(path.parent().unwrap_or(Path::new("")), &name)
}

/// Files of the scene at `path`: the file itself and, for a `.gltf`, its buffers. Buffers are left out if the `.gltf`
/// cannot be read.
pub fn files_of(path: &Path) -> Vec<PathBuf> {
    let mut found = vec![path.to_owned()];
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("gltf"))
        && let Ok(bytes) = files::read(path, FileKind::Scene)
        && let Ok(Gltf { document, .. }) = Gltf::from_slice_without_validation(&bytes)
    {
        found.extend(document.buffers().filter_map(|buffer| match buffer.source() {
            buffer::Source::Uri(uri) if !uri.contains(':') => buffer_file(path, uri).ok(),
            _ => None,
        }));
    }
    found
}

fn read_buffer(path: &Path, buffer: &buffer::Buffer<'_>, blob: &mut Option<Vec<u8>>) -> Result<Vec<u8>, SceneError> {
    let index = buffer.index();
    let format = |reason: String| SceneError::Format { path: path.to_owned(), reason };
    let bytes = match buffer.source() {
        buffer::Source::Bin if index == 0 => {
            blob.take().ok_or_else(|| format("buffer 0 has no uri, and the file no binary chunk".to_owned()))?
        }
        buffer::Source::Bin => return Err(format(format!("buffer {index} has no uri"))),
        buffer::Source::Uri(uri) if uri.starts_with("data:") => {
            let url = DataUrl::process(uri).map_err(|e| format(format!("buffer {index}: {e}")))?;
            url.decode_to_vec().map_err(|e| format(format!("buffer {index}: its data: URI is not base64: {e}")))?.0
        }
        buffer::Source::Uri(uri) if uri.contains(':') => {
            return Err(format(format!("buffer {index} is at `{uri}`; only relative files and data: URIs are read")));
        }
        buffer::Source::Uri(uri) => {
            let bytes = buffer_file(path, uri).and_then(|file| files::read(&file, FileKind::Scene));
            bytes.map_err(|source| SceneError::Buffer { path: path.to_owned(), buffer: uri.into(), source })?
        }
    };
    if bytes.len() < buffer.length() {
        let (needed, found) = (buffer.length(), bytes.len());
        return Err(format(format!("truncated: buffer {index} should hold {needed} bytes, it holds {found}")));
    }
    Ok(bytes)
}
