//! glTF extensions: extensions of appearance are ignored; extensions of geometry are refused with advice.

use gltf::Semantic;
use gltf::accessor::DataType;
use gltf::json::Root;
use gltf::json::validation::Checked;

/// Prefixes of extensions that change only materials, lights or metadata.
const HARMLESS: [&str; 8] = [
    "KHR_materials_",
    "KHR_texture_",
    "KHR_lights_",
    "KHR_xmp",
    "EXT_texture_",
    "EXT_lights_",
    "MSFT_texture_",
    "ADOBE_materials_",
];

/// Whether the extension `name` leaves surfaces unchanged.
pub(super) fn is_harmless(name: &str) -> bool {
    HARMLESS.iter().any(|prefix| name.starts_with(prefix))
}

/// Message for a file that requires `name`: the reason and a remedy.
pub(super) fn refused(name: &str) -> String {
    format!("it requires the extension `{name}`, which is not read: {}", remedy(name))
}

/// Remedy for the extension `name`, which concerns geometry.
fn remedy(name: &str) -> &'static str {
    match name {
        "KHR_draco_mesh_compression" => {
            "export without compression (Blender: untick Data > Compression; glTF-Transform: `gltf-transform copy`)"
        }
        "EXT_meshopt_compression" | "KHR_meshopt_compression" => {
            "export without it (gltfpack: leave out -c and -cc; glTF-Transform: `gltf-transform copy`)"
        }
        "KHR_mesh_quantization" => {
            "export positions as 32-bit floats (gltfpack: -noq; glTF-Transform: `gltf-transform dequantize`)"
        }
        "EXT_mesh_gpu_instancing" => "export each instance as a node of its own",
        _ => "export without it",
    }
}

/// Message for positions stored as integers.
pub(super) fn quantised(accessor: usize, found: DataType) -> String {
    let remedy = remedy("KHR_mesh_quantization");
    format!("accessor {accessor}: its positions are {found:?}; only F32 is read: {remedy}")
}

/// Message for positions or indices without data. It names the extension that stores them elsewhere, if the file uses
/// one.
pub(super) fn no_data(root: &Root) -> Option<String> {
    // For other attributes, an accessor without data is legally all zeros.
    let of_shape = root.meshes.iter().flat_map(|mesh| &mesh.primitives).flat_map(|primitive| {
        let positions = primitive.attributes.get(&Checked::Valid(Semantic::Positions));
        positions.into_iter().chain(&primitive.indices).map(|index| index.value())
    });
    let has_none = |i: &usize| root.accessors.get(*i).is_some_and(|a| a.buffer_view.is_none() && a.sparse.is_none());
    let accessor = of_shape.filter(has_none).min()?;
    let name = root.extensions_used.iter().find(|name| !is_harmless(name))?;
    Some(format!("accessor {accessor} has no data; the file uses the extension `{name}`: {}", remedy(name)))
}
