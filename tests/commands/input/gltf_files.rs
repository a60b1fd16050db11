//! Tests of the conventions of valid glTF files.

use insonify::anatomy::import::{FindingKind, load_with_findings, mesh_of_arrays};
use insonify::anatomy::{Mesh, Scene, TissueTable};
use insonify::glam::Vec3;
use serde_json::json;

use crate::input::builder::*;

fn corners(mesh: &Mesh) -> Vec<[[f32; 3]; 3]> {
    mesh.corners_mm().map(|t| t.map(|v| v.to_array())).collect()
}

fn assert_tetrahedron(mesh: &Mesh) {
    assert_eq!((mesh.vertices_mm.len(), mesh.triangles.len(), mesh.unpaired_edges()), (4, 4, 0));
    assert!((mesh.signed_volume_mm3() - TETRAHEDRON_MM3).abs() < 1e-3, "{}", mesh.signed_volume_mm3());
}

fn tissue_names(scene: &Scene) -> Vec<&str> {
    scene.surfaces.iter().map(|s| scene.tissues.names()[s.tissue].as_str()).collect()
}

#[test]
fn indices_of_any_width_or_none_give_the_same_triangles() {
    let expected = corners(&Builder::tetrahedron().load_mesh());
    for component in [U8, U16, U32] {
        let mut b = Builder::tetrahedron();
        let indices = b.indices(&TETRAHEDRON_FACES, component);
        b.root["meshes"][0]["primitives"][0]["indices"] = json!(indices);
        let mesh = b.load_mesh();
        assert_tetrahedron(&mesh);
        assert_eq!(corners(&mesh), expected);
    }
    let mut b = Builder::tetrahedron();
    let positions = b.positions(&TETRAHEDRON_FACES.map(|i| TETRAHEDRON[i as usize]));
    b.root["meshes"][0]["primitives"][0] = json!({"attributes": {"POSITION": positions}});
    let mesh = b.load_mesh();
    assert_tetrahedron(&mesh);
    assert_eq!(corners(&mesh), expected);
}

#[test]
fn strips_and_fans_are_wound_as_gltf_prescribes() {
    let mut b = Builder::tetrahedron();
    let indices = b.indices(&[1, 0, 2, 3, 1, 0], U8);
    b.root["meshes"][0]["primitives"][0]["indices"] = json!(indices);
    b.root["meshes"][0]["primitives"][0]["mode"] = json!(5);
    assert_tetrahedron(&b.load_mesh());

    let mut b = Builder::tetrahedron();
    let indices = b.indices(&[0, 1, 3, 2], U8);
    b.root["meshes"][0]["primitives"][0]["indices"] = json!(indices);
    b.root["meshes"][0]["primitives"][0]["mode"] = json!(6);
    let (scene, findings) = b.load().unwrap();
    assert_eq!(findings[0].kind, FindingKind::Open { edges: 4 });
    let [x, y, z, o] = [[10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [0.0, 0.0, 10.0], [0.0, 0.0, 0.0]];
    assert_eq!(corners(&scene.surfaces[0].mesh), [[x, z, o], [z, y, o]]);
}

#[test]
fn interleaved_and_sparse_accessors_are_read() {
    // Positions behind 4 foreign bytes, 20 bytes apart.
    let mut b = Builder::tetrahedron();
    let row = |p: &[f32; 3]| [&[7; 4], bytemuck::bytes_of(p), &[9; 4]].concat();
    let view = b.view(&TETRAHEDRON.iter().flat_map(row).collect::<Vec<_>>());
    b.root["bufferViews"][view]["byteStride"] = json!(20);
    let mut accessor = positions_json(view, 4);
    accessor["byteOffset"] = json!(4);
    let positions = b.push("accessors", accessor);
    b.root["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(positions);
    assert_tetrahedron(&b.load_mesh());

    // Zeros except for three sparse vertices; then the tetrahedron with its last vertex ten times as high.
    for (backed, volume) in [(false, TETRAHEDRON_MM3), (true, 10.0 * TETRAHEDRON_MM3)] {
        let mut b = Builder::tetrahedron();
        let (which, values) =
            if backed { (vec![3u8], vec![[0.0, 0.0, 0.1f32]]) } else { (vec![1, 2, 3], TETRAHEDRON[1..].to_vec()) };
        let (indices, values) = (b.view(&which), b.view(bytemuck::cast_slice(&values)));
        let mut accessor = b.root["accessors"][0].clone();
        if !backed {
            accessor.as_object_mut().unwrap().remove("bufferView");
        }
        accessor["sparse"] = json!({"count": which.len(), "indices": {"bufferView": indices, "componentType": U8},
            "values": {"bufferView": values}});
        let positions = b.push("accessors", accessor);
        b.root["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(positions);
        let mesh = b.load_mesh();
        assert!((mesh.signed_volume_mm3() / volume - 1.0).abs() < 1e-5, "{}", mesh.signed_volume_mm3());
    }
}

#[test]
fn node_transforms_are_chained_and_mirrors_stay_outward() {
    let mut b = Builder::tetrahedron();
    let half = std::f32::consts::FRAC_1_SQRT_2;
    b.root["nodes"][0]["rotation"] = json!([0.0, 0.0, half, half]);
    b.root["nodes"][0]["translation"] = json!([0.1, 0.0, 0.0]);
    b.node(json!({"children": [0], "scale": [1.0, 2.0, -3.0]}));
    // Column-major: x ↦ x + 1 m.
    b.node(json!({"children": [1], "matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 1,0,0,1]}));
    let mesh = b.load_mesh();
    assert_eq!(mesh.unpaired_edges(), 0);
    assert!((mesh.signed_volume_mm3() / (6.0 * TETRAHEDRON_MM3) - 1.0).abs() < 1e-3);
    let bounds = mesh.bounds_mm().unwrap();
    // Rotated by 90° about z: x → y, y → −x.
    for (found, expected) in [(bounds.min, [1090.0, 0.0, -30.0]), (bounds.max, [1100.0, 20.0, 0.0])] {
        assert!((found - glam::Vec3::from(expected)).length() < 1e-3, "{found}");
    }
}

#[test]
fn tissue_comes_from_extras_then_ancestors_then_material() {
    let mut b = Builder::tetrahedron();
    let material = b.push("materials", json!({"name": "kidney"}));
    b.root["meshes"][0]["primitives"][0]["material"] = json!(material);
    b.root["nodes"] = json!([
        {"name": "own", "mesh": 0, "extras": {"tissue": "brain", "colour": 3}},
        {"name": "inherits", "mesh": 0, "extras": {"priority": 7.0}},
        {"name": "parent", "children": [0, 1], "extras": {"tissue": "heart", "priority": -2}},
        {"name": "material", "mesh": 0, "extras": "no object"},
    ]);
    let (scene, _) = b.load().unwrap();
    let names: Vec<_> = scene.surfaces.iter().map(|s| (s.name.as_str(), s.priority)).collect();
    assert_eq!(names, [("own", -2), ("material", 0), ("inherits", 7)], "ascending in priority");
    assert_eq!(tissue_names(&scene), ["brain", "kidney", "heart"]);
}

#[test]
fn each_primitive_of_a_node_is_a_surface_and_uses_part_of_shared_vertices() {
    let mut b = Builder::empty();
    let far = TETRAHEDRON.map(|[x, y, z]| [x + 1.0, y, z]);
    let positions = b.positions(&[TETRAHEDRON, far].concat());
    let [near, far] = [0, 4].map(|offset| b.indices(&TETRAHEDRON_FACES.map(|i| i + offset), U16));
    let [liver, brain] = ["liver", "brain"].map(|name| b.push("materials", json!({"name": name})));
    let primitive =
        |indices, material| json!({"attributes": {"POSITION": positions}, "indices": indices, "material": material});
    let mesh = b.mesh(&[primitive(near, liver), primitive(far, brain)]);
    b.node(json!({"name": "two", "mesh": mesh}));
    let (scene, findings) = b.load().unwrap();
    assert!(findings.is_empty());
    assert_eq!((scene.surfaces[0].name.as_str(), scene.surfaces[1].name.as_str()), ("two/0", "two/1"));
    assert_eq!(tissue_names(&scene), ["liver", "brain"]);
    scene.surfaces.iter().for_each(|s| assert_eq!(s.mesh.vertices_mm.len(), 4));
    assert!(scene.surfaces[1].mesh.bounds_mm().unwrap().min.x > 999.0);
}

#[test]
fn the_default_scene_is_used_then_the_first_then_all_roots() {
    let mut b = Builder::tetrahedron();
    b.root["nodes"] =
        json!(["liver", "brain"].map(|tissue| json!({"name": tissue, "mesh": 0, "extras": {"tissue": tissue}})));
    assert_eq!(tissue_names(&b.load().unwrap().0), ["liver", "brain"]);
    b.root["scenes"] = json!([{"nodes": [0]}, {"nodes": [1]}]);
    assert_eq!(tissue_names(&b.load().unwrap().0), ["liver"]);
    b.root["scene"] = json!(1);
    assert_eq!(tissue_names(&b.load().unwrap().0), ["brain"]);
}

#[test]
fn gltf_with_external_and_embedded_buffers() {
    let b = Builder::tetrahedron();
    let (dir, path) = file("scene.gltf", &b.json(Some("my%20data.bin")));
    std::fs::write(dir.path().join("my data.bin"), &b.bin).unwrap();
    let table = TissueTable::builtin().unwrap();
    let (scene, _) = load_with_findings(&path, &table, 0).unwrap();
    assert_tetrahedron(&scene.surfaces[0].mesh);

    let hex = b.bin.iter().map(|byte| format!("%{byte:02x}")).collect::<String>();
    let base64 = base64(&b.bin);
    for uri in [format!("data:application/octet-stream;base64,{base64}"), format!("data:,{hex}")] {
        let (scene, _) = load_bytes("scene.gltf", &b.json(Some(&uri))).unwrap();
        assert_tetrahedron(&scene.surfaces[0].mesh);
    }
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for chunk in bytes.chunks(3) {
        let word = chunk.iter().fold(0u32, |w, &b| (w << 8) | u32::from(b)) << (8 * (3 - chunk.len()));
        for digit in 0..4 {
            let symbol = DIGITS[(word >> (18 - 6 * digit)) as usize & 63];
            text.push(if digit > chunk.len() { '=' } else { symbol as char });
        }
    }
    text
}

#[test]
fn mended_and_skipped_content_is_reported() {
    let with_indices = |indices: &[u32]| {
        let mut b = Builder::tetrahedron();
        let indices = b.indices(indices, U16);
        b.root["meshes"][0]["primitives"][0]["indices"] = json!(indices);
        b
    };
    let degenerate = with_indices(&[&TETRAHEDRON_FACES[..], &[1, 1, 2], &[3, 3, 3]].concat());
    let (scene, findings) = degenerate.load().unwrap();
    assert_tetrahedron(&scene.surfaces[0].mesh);
    assert_eq!(findings[0].kind, FindingKind::Degenerate { triangles: 2 });
    assert_eq!(findings[0].to_string(), "surface `organ`: dropped 2 triangles without area");

    let mut reversed = TETRAHEDRON_FACES;
    reversed.chunks_mut(3).for_each(|t| t.swap(0, 1));
    let (scene, findings) = with_indices(&reversed).load().unwrap();
    assert_tetrahedron(&scene.surfaces[0].mesh);
    assert_eq!(findings[0].kind, FindingKind::InsideOut);

    let (scene, findings) = with_indices(&TETRAHEDRON_FACES[..11]).load().unwrap();
    assert_eq!(scene.triangle_count(), 3);
    let kinds: Vec<_> = findings.iter().map(|f| f.kind).collect();
    assert_eq!(kinds, [FindingKind::LeftOver { indices: 2 }, FindingKind::Open { edges: 3 }]);

    let mut lines = Builder::tetrahedron();
    lines.root["meshes"][0]["primitives"]
        .as_array_mut()
        .unwrap()
        .push(json!({"attributes": {"POSITION": 0}, "mode": 1}));
    let (scene, findings) = lines.load().unwrap();
    assert_eq!((scene.surfaces.len(), findings[0].kind), (1, FindingKind::NotTriangles));
    assert_eq!(findings[0].surface, "organ/1");
}

#[test]
fn arrays_are_mended_as_files_are() {
    let mesh = Builder::tetrahedron().load_mesh();
    let reversed: Vec<[u32; 3]> = mesh.triangles.iter().map(|&[a, b, c]| [b, a, c]).chain([[0, 0, 1]]).collect();
    let (mended, findings) = mesh_of_arrays("organ", mesh.vertices_mm.clone(), reversed).unwrap();
    assert_tetrahedron(&mended);
    let kinds: Vec<_> = findings.iter().map(|f| f.kind).collect();
    assert_eq!(kinds, [FindingKind::Degenerate { triangles: 1 }, FindingKind::InsideOut]);
    assert_eq!(findings[0].surface, "organ");

    let refused = |vertices: Vec<Vec3>, triangles: &[[u32; 3]]| {
        mesh_of_arrays("organ", vertices, triangles.to_vec()).unwrap_err().to_string()
    };
    let beyond = refused(mesh.vertices_mm.clone(), &[[0, 1, 2], [1, 4, 2]]);
    assert_eq!(beyond, "triangle 1 of surface `organ` names vertex 4; the surface has 4 vertices");
    for wrong in [f32::NAN, f32::INFINITY, -2e5] {
        let mut vertices = mesh.vertices_mm.clone();
        vertices[2].y = wrong;
        let said = refused(vertices.clone(), &mesh.triangles);
        assert!(said.starts_with("vertex 2 of surface `organ` of the arrays"), "{said}");
        // A vertex of no triangle doesn't matter.
        assert!(mesh_of_arrays("organ", vertices, vec![[0, 1, 3]]).is_ok());
    }
}
