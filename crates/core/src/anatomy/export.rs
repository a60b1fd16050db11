//! Export of surfaces as a binary glTF file.

use std::io::Write;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use thiserror::Error;

use super::{Axes, Mesh, Motion};
use crate::files::FileError;

/// A surface with the name of its tissue, for export.
#[derive(Debug, Clone, PartialEq)]
pub struct LabelledSurface {
    /// Name of the glTF node.
    pub name: String,
    /// Name of its tissue in the tissue table.
    pub tissue: String,
    /// Priority: where closed surfaces overlap, the surface of highest priority is the medium.
    pub priority: i32,
    /// The surface, scene frame, mm.
    pub mesh: Mesh,
}

/// Errors in writing a scene.
#[derive(Debug, Error)]
pub enum ExportError {
    /// Failure to serialise the JSON part, or to write the file.
    #[error(transparent)]
    File(#[from] FileError),
    /// More bytes than the format's 32-bit lengths can express.
    #[error("{path} would hold {bytes} bytes; a .glb file holds less than 4 GiB")]
    TooLarge {
        /// Path of the file.
        path: PathBuf,
        /// Bytes of vertices and indices.
        bytes: usize,
    },
}

const FLOAT: u32 = 5126;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// Writes `surfaces` to `path` as a .glb, in metres: one node per surface with `extras.tissue` and `extras.priority`,
/// and a material named after the tissue. Equal surfaces give equal bytes.
///
/// The file is written under a temporary name in the same folder and then renamed, so it is never incomplete.
///
/// # Errors
/// The file cannot be written, or would exceed the format's 4 GiB.
pub fn write_glb(surfaces: &[LabelledSurface], path: &Path) -> Result<(), ExportError> {
    write_moving_glb(surfaces, &Motion::default(), path)
}

/// Writes `surfaces` like [`write_glb`], with the motion in `extras.motion` of the glTF scene.
///
/// # Errors
/// As [`write_glb`].
pub fn write_moving_glb(surfaces: &[LabelledSurface], motion: &Motion, path: &Path) -> Result<(), ExportError> {
    write_scene_glb(surfaces, &SceneExtras { motion: motion.clone(), ..SceneExtras::default() }, path)
}

/// Extras of a glTF scene.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SceneExtras {
    /// Motion of the surfaces (`extras.motion`).
    pub motion: Motion,
    /// Meaning of the axes (`extras.axes`).
    pub axes: Axes,
    /// Origin of the scene (`extras.source`).
    pub source: Option<String>,
}

/// Writes `surfaces` like [`write_glb`], with `extras` as the extras of the glTF scene.
///
/// # Errors
/// As [`write_glb`].
pub fn write_scene_glb(surfaces: &[LabelledSurface], extras: &SceneExtras, path: &Path) -> Result<(), ExportError> {
    let mut values = serde_json::Map::new();
    if !extras.motion.is_empty() {
        values.insert("motion".to_owned(), json!(extras.motion));
    }
    if extras.axes != Axes::default() {
        values.insert("axes".to_owned(), json!(extras.axes.name()));
    }
    if let Some(source) = &extras.source {
        values.insert("source".to_owned(), json!(source));
    }
    write_with_extras(surfaces, (!values.is_empty()).then_some(Value::Object(values)), path)
}

fn write_with_extras(surfaces: &[LabelledSurface], extras: Option<Value>, path: &Path) -> Result<(), ExportError> {
    let io = FileError::at("write", path);
    let mut binary = Vec::new();
    let mut document = Document::default();
    for surface in surfaces {
        document.add(surface, &mut binary);
    }
    let mut text = serde_json::to_vec(&document.finish(extras, binary.len()))
        .map_err(|error| FileError::at("form the JSON of", path)(error.into()))?;
    text.resize(text.len().next_multiple_of(4), b' ');

    let total = 12 + 8 + text.len() + 8 + binary.len();
    let lengths = [total, text.len(), binary.len()].map(u32::try_from);
    let [Ok(total), Ok(text_length), Ok(binary_length)] = lengths else {
        return Err(ExportError::TooLarge { path: path.to_owned(), bytes: binary.len() });
    };
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    // Temporary files are private by default; this one becomes an ordinary file.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.prefix(".insonify-").suffix(".glb").tempfile_in(folder).map_err(io)?;
    let header = [*b"glTF", 2u32.to_le_bytes(), total.to_le_bytes(), text_length.to_le_bytes(), *b"JSON"];
    let binary_header = [binary_length.to_le_bytes(), *b"BIN\0"];
    for bytes in [header.as_flattened(), &text, binary_header.as_flattened(), &binary] {
        file.write_all(bytes).map_err(io)?;
    }
    file.persist(path).map_err(|e| io(e.error))?;
    Ok(())
}

#[derive(Default)]
struct Document {
    nodes: Vec<Value>,
    meshes: Vec<Value>,
    accessors: Vec<Value>,
    views: Vec<Value>,
    materials: Vec<String>,
}

impl Document {
    fn add(&mut self, surface: &LabelledSurface, binary: &mut Vec<u8>) {
        let metres: Vec<[f32; 3]> = surface.mesh.vertices_mm.iter().map(|v| (*v / 1000.0).to_array()).collect();
        // glTF has no accessor of zero length: an empty surface becomes a node without a mesh.
        if metres.is_empty() || surface.mesh.triangles.is_empty() {
            self.nodes.push(json!({ "name": surface.name, "extras": extras(surface) }));
            return;
        }
        let fold = |f: fn(f32, f32) -> f32| {
            metres.iter().skip(1).fold(metres[0], |a, v| std::array::from_fn(|i| f(a[i], v[i])))
        };
        let positions = json!({
            "bufferView": self.views.len(), "componentType": FLOAT, "count": metres.len(), "type": "VEC3",
            "min": fold(f32::min), "max": fold(f32::max),
        });
        self.add_view(binary, ARRAY_BUFFER, metres.iter().flatten().flat_map(|x| x.to_le_bytes()));

        let indices = surface.mesh.triangles.iter().flatten();
        // glTF reserves the highest 16-bit index for restarting primitives.
        let short = metres.len() <= usize::from(u16::MAX);
        let accessor = json!({
            "bufferView": self.views.len(), "componentType": if short { UNSIGNED_SHORT } else { UNSIGNED_INT },
            "count": 3 * surface.mesh.triangles.len(), "type": "SCALAR",
        });
        let width = if short { 2 } else { 4 };
        self.add_view(binary, ELEMENT_ARRAY_BUFFER, indices.flat_map(|i| i.to_le_bytes().into_iter().take(width)));
        let known = self.materials.iter().position(|m| *m == surface.tissue);
        let material = known.unwrap_or_else(|| {
            self.materials.push(surface.tissue.clone());
            self.materials.len() - 1
        });
        self.nodes.push(json!({ "name": surface.name, "mesh": self.meshes.len(), "extras": extras(surface) }));
        self.meshes.push(json!({ "name": surface.name, "primitives": [{
            "attributes": { "POSITION": self.accessors.len() }, "indices": self.accessors.len() + 1,
            "material": material, "mode": 4,
        }]}));
        self.accessors.extend([positions, accessor]);
    }

    fn add_view(&mut self, binary: &mut Vec<u8>, target: u32, bytes: impl Iterator<Item = u8>) {
        let start = binary.len();
        binary.extend(bytes);
        self.views.push(json!({
            "buffer": 0, "byteOffset": start, "byteLength": binary.len() - start, "target": target,
        }));
        binary.resize(binary.len().next_multiple_of(4), 0);
    }

    fn finish(self, extras: Option<Value>, bytes: usize) -> Value {
        let materials: Vec<Value> = self.materials.iter().map(|name| material(name)).collect();
        let roots: Vec<usize> = (0..self.nodes.len()).collect();
        let scene = match extras {
            None => json!({ "nodes": roots }),
            Some(extras) => json!({ "nodes": roots, "extras": extras }),
        };
        json!({
            "asset": { "version": "2.0", "generator": concat!("insonify ", env!("CARGO_PKG_VERSION")) },
            "scene": 0,
            "scenes": [scene],
            "nodes": self.nodes,
            "meshes": self.meshes,
            "materials": materials,
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{ "byteLength": bytes }],
        })
    }
}

fn extras(surface: &LabelledSurface) -> Value {
    json!({ "tissue": surface.tissue, "priority": surface.priority })
}

fn material(tissue: &str) -> Value {
    let [r, g, b, a] = tissue_colour(tissue).map(|c| f64::from(c) / 255.0);
    json!({
        "name": tissue,
        "alphaMode": if a < 1.0 { "BLEND" } else { "OPAQUE" },
        "pbrMetallicRoughness": { "baseColorFactor": [r, g, b, a], "metallicFactor": 0.0, "roughnessFactor": 0.8 },
    })
}

/// Display colour of `tissue`, RGBA.
pub fn tissue_colour(tissue: &str) -> [u8; 4] {
    match tissue {
        "skin" => [224, 172, 140, 110],
        "fat" => [242, 214, 120, 110],
        "fascia" => [230, 226, 214, 130],
        "muscle" => [168, 60, 52, 160],
        "soft_tissue_maternal" => [196, 128, 112, 110],
        "uterus_wall" => [186, 92, 100, 130],
        "septum" => [250, 236, 190, 160],
        "peritoneum" => [240, 232, 220, 130],
        "cervical_mucosa" => [206, 124, 132, 255],
        "placental_plate" => [226, 150, 170, 255],
        "placental_bed" => [112, 44, 66, 255],
        "amnion" => [222, 222, 240, 90],
        "cervix" => [160, 72, 88, 255],
        "amniotic_fluid" | "amniotic_fluid_vernix" => [92, 150, 214, 70],
        "water" | "gel" => [120, 180, 220, 70],
        "urine" => [222, 202, 72, 160],
        "csf" => [110, 196, 226, 160],
        "blood" => [190, 24, 36, 255],
        "placenta" => [142, 44, 74, 255],
        "cord_jelly" => [214, 208, 222, 160],
        "vessel_wall" => [214, 132, 132, 255],
        "brain" => [214, 176, 176, 255],
        "brain_deep" => [176, 138, 152, 255],
        "cerebellum" => [206, 150, 120, 255],
        "cerebellar_vermis" => [232, 176, 120, 255],
        "renal_medulla" => [104, 40, 44, 255],
        "choroid_plexus" => [196, 96, 130, 255],
        "falx" => [238, 232, 208, 255],
        "liver" => [130, 52, 40, 255],
        "kidney" | "renal_cortex" => [150, 66, 56, 255],
        "renal_sinus" => [236, 214, 150, 255],
        "pancreas" => [206, 160, 96, 255],
        "thyroid" => [170, 80, 76, 255],
        "prostate" => [178, 120, 104, 255],
        "capsule" | "pericardium" | "valve" => [226, 216, 200, 255],
        "submucosa" => [224, 186, 150, 255],
        "mucosa" => [186, 88, 92, 255],
        "portal_tract" => [222, 160, 190, 255],
        "spleen" => [112, 40, 64, 255],
        "heart" => [176, 56, 60, 255],
        "bowel" => [198, 142, 116, 255],
        "lung_fetal" => [226, 160, 166, 255],
        "lung_aerated" | "air" => [40, 44, 60, 255],
        "cartilage" => [188, 214, 220, 255],
        "bone_adult" => [236, 228, 206, 255],
        "bone_fetal" | "calvaria_fetal" => [250, 246, 232, 255],
        "soft_tissue" => [218, 148, 128, 160],
        _ => [160, 160, 160, 255],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn a_written_file_reads_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.glb");
        let mesh = Mesh {
            vertices_mm: vec![Vec3::ZERO, Vec3::X * 10.0, Vec3::Y * 10.0, Vec3::Z * 10.0],
            triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
        };
        let surface = LabelledSurface { name: "a".into(), tissue: "brain".into(), priority: 7, mesh };
        let empty = LabelledSurface { name: "b".into(), mesh: Mesh::default(), ..surface.clone() };
        write_glb(&[surface, empty], &path).unwrap();
        let glb = gltf::Gltf::open(&path).unwrap();
        let node = glb.nodes().next().unwrap();
        let extras: Value = serde_json::from_str(node.extras().as_ref().unwrap().get()).unwrap();
        assert_eq!(extras, json!({ "tissue": "brain", "priority": 7 }));
        let primitive = node.mesh().unwrap().primitives().next().unwrap();
        assert_eq!(primitive.material().name(), Some("brain"));
        let blob = glb.blob.clone().unwrap();
        let reader = primitive.reader(|_| Some(&blob));
        let positions: Vec<_> = reader.read_positions().unwrap().collect();
        assert_eq!(positions[1], [0.01, 0.0, 0.0]);
        let indices: Vec<_> = reader.read_indices().unwrap().into_u32().collect();
        assert_eq!(indices, [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file is left");
    }

    #[test]
    fn a_missing_folder_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        assert!(matches!(write_glb(&[], &folder.path().join("no/t.glb")), Err(ExportError::File(_))));
    }
}
