//! Extensions of glTF: those of looks do no harm, those of geometry are refused with what to do.

use gltf::Semantic;
use gltf::accessor::DataType;
use gltf::json::Root;
use gltf::json::validation::Checked;

/// Extensions that change materials, lights or metadata alone, by how their names begin.
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

/// Whether surfaces are the same without the extension.
pub(super) fn is_harmless(name: &str) -> bool {
    HARMLESS.iter().any(|prefix| name.starts_with(prefix))
}

/// Why a file that requires `name` is not read, and what to do.
pub(super) fn refused(name: &str) -> String {
    format!("it requires the extension `{name}`, which is not read: {}", remedy(name))
}

/// How to write the same scene without an extension of geometry.
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

/// Why positions that are whole numbers are not read.
pub(super) fn quantised(accessor: usize, found: DataType) -> String {
    let remedy = remedy("KHR_mesh_quantization");
    format!("accessor {accessor}: its positions are {found:?}; only F32 is read: {remedy}")
}

/// Why positions or indices without bytes are not read: the extension that keeps them elsewhere, if the file uses one.
pub(super) fn no_data(root: &Root) -> Option<String> {
    // Elsewhere, an accessor without data is legally one of zeros.
    let of_shape = root.meshes.iter().flat_map(|mesh| &mesh.primitives).flat_map(|primitive| {
        let positions = primitive.attributes.get(&Checked::Valid(Semantic::Positions));
        positions.into_iter().chain(&primitive.indices).map(|index| index.value())
    });
    let has_none = |i: &usize| root.accessors.get(*i).is_some_and(|a| a.buffer_view.is_none() && a.sparse.is_none());
    let accessor = of_shape.filter(has_none).min()?;
    let name = root.extensions_used.iter().find(|name| !is_harmless(name))?;
    Some(format!("accessor {accessor} has no data; the file uses the extension `{name}`: {}", remedy(name)))
}
