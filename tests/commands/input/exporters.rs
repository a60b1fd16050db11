//! Tests of the conventions of other programs' exporters.

use insonify::anatomy::import::{FindingKind, load_with_findings};
use insonify::anatomy::{Scene, TissueTable};
use serde_json::{Value, json};

use crate::input::builder::*;

fn tissues_of(scene: &Scene) -> Vec<(&str, &str, i32)> {
    let names = scene.tissues.names();
    scene.surfaces.iter().map(|s| (s.name.as_str(), names[s.tissue].as_str(), s.priority)).collect()
}

#[test]
fn a_file_of_trimesh_is_read() {
    // Made by tests/data/scenes/make_trimesh_scene.py with trimesh 5.2.0.
    let path = format!("{}/tests/data/scenes/trimesh.glb", env!("CARGO_MANIFEST_DIR"));
    let (scene, findings) = load_with_findings(path.as_ref(), &TissueTable::builtin().unwrap(), 0).unwrap();
    assert_eq!(findings, []);
    // Metadata of a mesh become extras of the mesh, not of its node.
    let expected = [("organ", "liver", 0), ("stone", "gallstone", 1), ("mirrored", "gallstone", 1)];
    assert_eq!(tissues_of(&scene), expected);
    for (surface, (volume_mm3, x_mm)) in scene.surfaces.iter().zip([(0.0, 0.0), (192.0, 5.0), (192.0, -8.0)]) {
        assert_eq!(surface.mesh.unpaired_edges(), 0);
        let volume = surface.mesh.signed_volume_mm3();
        assert!(volume > 0.0 && (volume_mm3 == 0.0 || (volume - volume_mm3).abs() < 0.1), "{}: {volume}", surface.name);
        let bounds = surface.mesh.bounds_mm().unwrap();
        assert!((0.5 * (bounds.min.x + bounds.max.x) - x_mm).abs() < 1e-3, "{}", surface.name);
    }
}

/// A box as Blender writes it. Each face has its own vertices, positions and normals share a buffer, indices have 16
/// bits. The material is named after the tissue, and extras are custom properties.
fn blender(material: &str) -> Builder {
    let mut b = Builder::empty();
    let corners: Vec<[f32; 3]> =
        (0..8).map(|i| [i & 1, i >> 1 & 1, i >> 2 & 1].map(|c| if c == 1 { 0.01 } else { -0.01 })).collect();
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let (mut rows, mut indices) = (Vec::new(), Vec::new());
    for (face, base) in faces.iter().zip((0u32..).step_by(4)) {
        rows.extend(face.iter().flat_map(|&c: &usize| [corners[c], [0.0, 0.0, 1.0]]));
        indices.extend([0, 1, 2, 0, 2, 3].map(|i| base + i));
    }
    let view = b.view(bytemuck::cast_slice(&rows));
    b.root["bufferViews"][view]["byteStride"] = json!(24);
    b.root["bufferViews"][view]["target"] = json!(34962);
    let positions = b.push("accessors", positions_json(view, 24));
    let mut normals = positions_json(view, 24);
    normals["byteOffset"] = json!(12);
    let normals = b.push("accessors", normals);
    let indices = b.indices(&indices, U16);
    let material = b.push("materials", json!({"name": material, "doubleSided": true,
        "pbrMetallicRoughness": {"metallicFactor": 0}, "extensions": {"KHR_materials_specular": {"specularFactor": 0}}}));
    let primitive = json!({"attributes": {"POSITION": positions, "NORMAL": normals}, "indices": indices,
        "material": material});
    let mesh = b.push("meshes", json!({"name": "Cube.001", "primitives": [primitive]}));
    b.node(json!({"name": "Organ", "mesh": mesh, "extras": {"priority": 4.0, "cycles": {"x": 1}}}));
    b.root["extensionsUsed"] = json!(["KHR_materials_specular"]);
    b.root["scenes"] = json!([{"name": "Scene", "nodes": [0]}]);
    b.root["scene"] = json!(0);
    b
}

#[test]
fn a_box_of_blender_is_read() {
    for material in ["liver", "liver.001", "liver.042", "liver.1000"] {
        let (scene, findings) = blender(material).load().unwrap();
        assert_eq!(findings, [], "{material}");
        assert_eq!(tissues_of(&scene), [("Organ", "liver", 4)]);
        let mesh = &scene.surfaces[0].mesh;
        assert_eq!((mesh.vertices_mm.len(), mesh.triangles.len(), mesh.unpaired_edges()), (8, 12, 0));
        assert!((mesh.signed_volume_mm3() - 8000.0).abs() < 0.1);
    }
    for material in ["liver.1", "liver.001.002", "liver.abc", "Material.001"] {
        assert!(blender(material).load().unwrap_err().to_string().contains("unknown tissue"), "{material}");
    }
}

#[test]
fn an_objects_data_does_not_apply_to_its_children() {
    // Blender: an object `skin` whose mesh has custom properties, with the child `rib`, which has only a material.
    let mut b = Builder::tetrahedron();
    let rib = json!({"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]});
    b.root["materials"] = json!([{"name": "bone_adult"}]);
    b.root["meshes"][0]["extras"] = json!({"tissue": "skin", "priority": 7});
    b.push("meshes", rib);
    b.root["nodes"] = json!([{"name": "skin", "mesh": 0, "children": [1]}, {"name": "rib", "mesh": 1}]);
    let mut found = b.load().map(|(scene, _)| scene).unwrap();
    found.surfaces.sort_by_key(|s| s.priority);
    assert_eq!(tissues_of(&found), [("rib", "bone_adult", 0), ("skin", "skin", 7)]);
    // Extras of the object itself apply.
    b.root["nodes"][0]["extras"] = json!({"tissue": "fat", "priority": 3});
    let (scene, _) = b.load().unwrap();
    assert_eq!(tissues_of(&scene), [("skin", "fat", 3), ("rib", "fat", 3)]);
}

#[test]
fn an_unused_accessor_of_zeros_is_not_blamed_on_an_extension() {
    let mut b = Builder::tetrahedron();
    let zeros = b.push("accessors", json!({"componentType": F32, "type": "VEC3", "count": 4}));
    b.root["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(zeros);
    b.root["extensionsUsed"] = json!(["ACME_looks"]);
    // The glTF crate reads no accessor without data.
    let error = b.load().unwrap_err().to_string();
    assert!(error.contains("accessors[2].bufferView: Missing data") && !error.contains("ACME_looks"), "{error}");
}

#[test]
fn extensions_of_appearance_are_ignored_and_those_of_geometry_refused_with_a_remedy() {
    let required = |name: &str| {
        let mut b = blender("liver");
        b.root["extensionsUsed"] = json!([name]);
        b.root["extensionsRequired"] = json!([name]);
        b.load().map(|_| ()).map_err(|e| e.to_string())
    };
    for harmless in ["KHR_materials_unlit", "KHR_texture_transform", "EXT_texture_webp", "KHR_lights_punctual"] {
        assert_eq!(required(harmless), Ok(()), "{harmless}");
    }
    for (name, remedy) in [
        ("KHR_draco_mesh_compression", "untick Data > Compression"),
        ("EXT_meshopt_compression", "gltfpack: leave out -c"),
        ("KHR_mesh_quantization", "-noq"),
        ("EXT_mesh_gpu_instancing", "each instance as a node"),
        ("ACME_secret", "export without it"),
    ] {
        let error = required(name).unwrap_err();
        assert!(error.contains(&format!("requires the extension `{name}`")) && error.contains(remedy), "{error}");
    }
}

#[test]
fn integer_positions_and_compressed_fallbacks_are_refused_with_a_remedy() {
    let mut b = Builder::tetrahedron();
    let bytes: Vec<u8> = TETRAHEDRON.iter().flatten().flat_map(|c| ((c * 3e6) as i16).to_le_bytes()).collect();
    let view = b.view(&bytes);
    let mut accessor: Value = positions_json(view, 4);
    (accessor["componentType"], accessor["normalized"]) = (json!(5122), json!(true));
    let positions = b.push("accessors", accessor);
    b.root["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(positions);
    let error = b.load().unwrap_err().to_string();
    assert!(
        error.contains("surface `organ`") && error.contains("positions are I16") && error.contains("-noq"),
        "{error}"
    );

    // Draco, used but not required, without a copy for readers without it.
    let mut b = Builder::tetrahedron();
    b.root["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    b.root["extensionsUsed"] = json!(["KHR_draco_mesh_compression"]);
    let error = b.load().unwrap_err().to_string();
    assert!(error.contains("accessor 0 has no data") && error.contains("KHR_draco_mesh_compression"), "{error}");
    assert!(error.contains("untick Data > Compression"), "{error}");
}

#[test]
fn meshes_outside_the_scene_are_reported() {
    let mut b = Builder::tetrahedron();
    b.root["nodes"] = json!(["liver", "brain"].map(|t| json!({"name": t, "mesh": 0, "extras": {"tissue": t}})));
    b.root["scenes"] = json!([{"nodes": [0]}, {"name": "spare", "nodes": [1]}]);
    let (scene, findings) = b.load().unwrap();
    assert_eq!(tissues_of(&scene), [("liver", "liver", 0)], "the first where none is named");
    assert_eq!((findings.len(), findings[0].kind), (1, FindingKind::NotInScene { nodes: 1 }));
    assert!(findings[0].to_string().contains("not in `scene 0`, the scene that is read"), "{}", findings[0]);
    b.root["scene"] = json!(1);
    let (scene, findings) = b.load().unwrap();
    assert_eq!((tissues_of(&scene), findings[0].surface.as_str()), (vec![("brain", "brain", 0)], "spare"));
}

#[test]
fn one_mesh_may_be_placed_many_times_without_names() {
    let mut b = Builder::tetrahedron();
    let at = |x: f64, mirror: f64| json!({"mesh": 0, "translation": [x, 0, 0], "scale": [mirror, 1, 1]});
    b.root["meshes"][0]["extras"] = json!({"tissue": "kidney", "priority": 2});
    b.root["nodes"] = json!([at(0.1, 1.0), at(-0.1, -1.0), {"name": "own", "mesh": 0, "extras": {"tissue": "fat"}},
        {"name": "group", "children": [0, 1, 2], "extras": {"tissue": "brain", "priority": 9}}]);
    let (scene, findings) = b.load().unwrap();
    assert_eq!(findings, []);
    assert_eq!(tissues_of(&scene), [("node 0", "kidney", 2), ("node 1", "kidney", 2), ("own", "fat", 2)]);
    for surface in &scene.surfaces {
        assert!((surface.mesh.signed_volume_mm3() - TETRAHEDRON_MM3).abs() < 0.01, "{} stays outward", surface.name);
    }
}

#[test]
fn a_matrix_and_its_components_give_the_same_placement() {
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let placed = |node: Value| {
        let mut b = Builder::tetrahedron();
        let own = b.root["nodes"][0].as_object_mut().unwrap();
        own.extend(node.as_object().unwrap().clone());
        b.load_mesh().bounds_mm().unwrap()
    };
    // Scaled, rotated by 90° about x (y → z, z → −y), moved.
    let parts = placed(json!({"scale": [2, 3, 1], "rotation": [half, 0, 0, half], "translation": [0.1, 0.2, 0.3]}));
    let matrix = placed(json!({"matrix": [2,0,0,0, 0,0,3,0, 0,-1,0,0, 0.1,0.2,0.3,1]}));
    assert!(parts.min.distance(matrix.min) < 1e-3 && parts.max.distance(matrix.max) < 1e-3, "{parts:?} {matrix:?}");
    assert!(parts.min.distance(glam::Vec3::new(100.0, 190.0, 300.0)) < 1e-3, "{parts:?}");
}
