//! Builder of glTF files for tests.

use std::path::PathBuf;

use insonify::anatomy::import::{Finding, load_with_findings};
use insonify::anatomy::{Mesh, Scene, SceneError, TissueTable};
use serde_json::{Value, json};
use tempfile::TempDir;

pub(crate) const U8: u32 = 5121;
pub(crate) const U16: u32 = 5123;
pub(crate) const U32: u32 = 5125;
pub(crate) const F32: u32 = 5126;

/// Corners of a tetrahedron whose edges along the axes are 10 mm, in metres.
pub(crate) const TETRAHEDRON: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [0.01, 0.0, 0.0], [0.0, 0.01, 0.0], [0.0, 0.0, 0.01]];
pub(crate) const TETRAHEDRON_FACES: [u32; 12] = [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3];
/// Volume of the tetrahedron, mm³.
pub(crate) const TETRAHEDRON_MM3: f64 = 1000.0 / 6.0;

/// A glTF document and its binary buffer.
pub(crate) struct Builder {
    pub(crate) root: Value,
    pub(crate) bin: Vec<u8>,
}

impl Builder {
    /// An empty document.
    pub(crate) fn empty() -> Self {
        let root = json!({"asset": {"version": "2.0"}, "nodes": [], "meshes": [], "materials": [], "accessors": [],
            "bufferViews": []});
        Self { root, bin: Vec::new() }
    }

    /// A document with the tetrahedron as a surface of liver.
    pub(crate) fn tetrahedron() -> Self {
        let mut b = Self::empty();
        let positions = b.positions(&TETRAHEDRON);
        let indices = b.indices(&TETRAHEDRON_FACES, U16);
        let mesh = b.mesh(&[json!({"attributes": {"POSITION": positions}, "indices": indices})]);
        b.node(json!({"name": "organ", "mesh": mesh, "extras": {"tissue": "liver"}}));
        b
    }

    pub(crate) fn push(&mut self, list: &str, value: Value) -> usize {
        let list = self.root[list].as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    /// Adds a buffer view of `bytes`; returns its index.
    pub(crate) fn view(&mut self, bytes: &[u8]) -> usize {
        let view = json!({"buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len()});
        self.bin.extend(bytes);
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        self.push("bufferViews", view)
    }

    pub(crate) fn positions(&mut self, metres: &[[f32; 3]]) -> usize {
        let bytes: Vec<u8> = metres.iter().flatten().flat_map(|c| c.to_le_bytes()).collect();
        let view = self.view(&bytes);
        self.push("accessors", positions_json(view, metres.len()))
    }

    pub(crate) fn indices(&mut self, indices: &[u32], component: u32) -> usize {
        let bytes: Vec<u8> = match component {
            U8 => indices.iter().map(|&i| i as u8).collect(),
            U16 => indices.iter().flat_map(|&i| (i as u16).to_le_bytes()).collect(),
            _ => indices.iter().flat_map(|&i| i.to_le_bytes()).collect(),
        };
        let view = self.view(&bytes);
        self.push("accessors", indices_json(view, component, indices.len()))
    }

    pub(crate) fn mesh(&mut self, primitives: &[Value]) -> usize {
        self.push("meshes", json!({"primitives": primitives}))
    }

    pub(crate) fn node(&mut self, node: Value) -> usize {
        self.push("nodes", node)
    }

    /// JSON of the document, whose buffer is at `uri` or else in the binary chunk.
    pub(crate) fn json(&self, uri: Option<&str>) -> Vec<u8> {
        let mut root = self.root.clone();
        // glTF lists must not be empty.
        root.as_object_mut().unwrap().retain(|_, v| v.as_array().is_none_or(|list| !list.is_empty()));
        if !self.bin.is_empty() {
            root["buffers"] = json!([{"byteLength": self.bin.len()}]);
        }
        if let Some(uri) = uri {
            root["buffers"][0]["uri"] = json!(uri);
        }
        serde_json::to_vec(&root).unwrap()
    }

    pub(crate) fn glb(&self) -> Vec<u8> {
        let mut json = self.json(None);
        json.resize(json.len().next_multiple_of(4), b' ');
        let chunk = |kind: &[u8], data: &[u8]| [&(data.len() as u32).to_le_bytes(), kind, data].concat();
        let chunks = [chunk(b"JSON", &json), chunk(b"BIN\0", &self.bin)].concat();
        [b"glTF", &2u32.to_le_bytes()[..], &(chunks.len() as u32 + 12).to_le_bytes(), &chunks].concat()
    }

    /// The document read as a .glb: the scene, and findings about it.
    pub(crate) fn load(&self) -> Result<(Scene, Vec<Finding>), SceneError> {
        load_bytes("scene.glb", &self.glb())
    }

    /// Mesh of the only surface.
    pub(crate) fn load_mesh(&self) -> Mesh {
        let (scene, findings) = self.load().unwrap();
        assert_eq!((scene.surfaces.len(), findings.as_slice()), (1, [].as_slice()));
        scene.surfaces.into_iter().next().unwrap().mesh
    }
}

pub(crate) fn positions_json(view: usize, count: usize) -> Value {
    json!({"bufferView": view, "componentType": F32, "type": "VEC3", "count": count,
        "min": [-1.0, -1.0, -1.0], "max": [1.0, 1.0, 1.0]})
}

pub(crate) fn indices_json(view: usize, component: u32, count: usize) -> Value {
    json!({"bufferView": view, "componentType": component, "type": "SCALAR", "count": count})
}

/// Reads a file of `bytes` called `name`.
pub(crate) fn load_bytes(name: &str, bytes: &[u8]) -> Result<(Scene, Vec<Finding>), SceneError> {
    let (_dir, path) = file(name, bytes);
    load_with_findings(&path, &TissueTable::builtin().unwrap(), 0)
}

/// A file of `bytes` in a temporary directory, which exists as long as the first result.
pub(crate) fn file(name: &str, bytes: &[u8]) -> (TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    (dir, path)
}
