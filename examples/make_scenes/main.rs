//! Writes the analytic scenes of `assets/scenes`: `cargo run --release --example make_scenes [DIRECTORY]`.

mod scenes;

use std::fs;
use std::path::{Path, PathBuf};

use insonify::anatomy::analytic::Part;
use scenes::SCENES;
use serde_json::{Value, json};

fn main() -> anyhow::Result<()> {
    let dir = std::env::args_os().nth(1).map_or_else(|| PathBuf::from("assets/scenes"), PathBuf::from);
    fs::create_dir_all(&dir)?;
    for (name, parts) in SCENES {
        write(&parts(), &dir.join(format!("{name}.glb")))?;
    }
    Ok(())
}

/// Writes `parts` as a binary glTF file in metres, with one node per part.
fn write(parts: &[Part], path: &Path) -> anyhow::Result<()> {
    let mut bin = Vec::new();
    let (mut accessors, mut views, mut meshes, mut nodes) = (vec![], vec![], vec![], vec![]);
    for (i, part) in parts.iter().enumerate() {
        let metres: Vec<_> = part.mesh.vertices_mm.iter().map(|v| (v.as_dvec3() / 1000.0).as_vec3()).collect();
        let (low, high) = metres.iter().fold((metres[0], metres[0]), |(l, h), &v| (l.min(v), h.max(v)));
        let mut view = |bytes: Vec<u8>, bin: &mut Vec<u8>| {
            views.push(json!({"buffer": 0, "byteOffset": bin.len(), "byteLength": bytes.len()}));
            bin.extend(bytes);
            bin.resize(bin.len().next_multiple_of(4), 0);
            views.len() - 1
        };
        let positions = view(metres.iter().flat_map(|v| v.to_array()).flat_map(f32::to_le_bytes).collect(), &mut bin);
        let corners = part.mesh.triangles.iter().flatten().map(|&i| u16::try_from(i));
        let corners = corners.collect::<Result<Vec<_>, _>>()?;
        let indices = view(corners.into_iter().flat_map(u16::to_le_bytes).collect(), &mut bin);
        accessors.push(json!({"bufferView": positions, "componentType": 5126, "type": "VEC3", "count": metres.len(),
            "min": low.to_array(), "max": high.to_array()}));
        accessors.push(json!({"bufferView": indices, "componentType": 5123, "type": "SCALAR",
            "count": 3 * part.mesh.triangles.len()}));
        meshes.push(json!({"primitives": [{"attributes": {"POSITION": 2 * i}, "indices": 2 * i + 1, "material": i}]}));
        nodes.push(json!({"name": part.name, "mesh": i,
            "extras": {"tissue": part.tissue, "priority": part.priority}}));
    }
    let materials: Vec<Value> = parts.iter().map(|part| json!({"name": part.tissue})).collect();
    let root = json!({"asset": {"version": "2.0", "generator": "insonify make_scenes"}, "scene": 0,
        "scenes": [{"nodes": (0..parts.len()).collect::<Vec<_>>()}], "nodes": nodes, "meshes": meshes,
        "materials": materials, "accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": bin.len()}]});
    let header = gltf::binary::Header { magic: *b"glTF", version: 2, length: 0 };
    let glb = gltf::Glb { header, json: serde_json::to_vec(&root)?.into(), bin: Some(bin.into()) };
    fs::write(path, glb.to_vec()?)?;
    Ok(())
}
