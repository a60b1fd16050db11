//! Files that are not valid scenes give an error with the fault and its position, never a panic.

use std::path::Path;

use insonify::anatomy::{SceneError, TissueTable, import};
use proptest::prelude::*;
use serde_json::{Value, json};

use crate::input::builder::*;

/// Error message for `bytes`, without the file's directory.
fn message(name: &str, bytes: &[u8]) -> String {
    let (dir, path) = file(name, bytes);
    let error = import::load(&path, &TissueTable::builtin().unwrap(), 0).unwrap_err();
    error.to_string().replace(&format!("{}/", dir.path().display()), "")
}

/// Error message for the tetrahedron after `change`.
fn message_after(change: impl FnOnce(&mut Builder)) -> String {
    let mut b = Builder::tetrahedron();
    change(&mut b);
    message("a.glb", &b.glb())
}

#[test]
fn missing_files_and_other_formats_are_refused() {
    let table = TissueTable::builtin().unwrap();
    let load = |path: &Path| import::load(path, &table, 0).unwrap_err().to_string();
    assert!(load(Path::new("/no/such.glb")).starts_with("cannot read the scene /no/such.glb: No such file"));
    assert!(load(tempfile::tempdir().unwrap().path()).contains("not a regular file"));
    assert_eq!(message("a.glb", b""), "a.glb is not a whole glTF file: it is empty");
    assert!(message("a.glb", b"solid cube").contains("a.glb is not a whole glTF file"));
    assert!(message("a.glb", b"glTF\x02\0\0\0\x04\0\0\0aaaaaaaaaaaaaaa").contains("byte 8"));
}

#[test]
fn truncated_files_are_refused() {
    let glb = Builder::tetrahedron().glb();
    for length in 1..glb.len() {
        assert!(matches!(load_bytes("a.glb", &glb[..length]), Err(SceneError::Format { .. })), "{length} bytes");
    }
    let text = message("a.glb", &glb[..glb.len() - 7]);
    let (promised, found) = (glb.len(), glb.len() - 7);
    assert!(text.contains(&format!("truncated: its header promises {promised} bytes, there are {found}")), "{text}");
    let text = message_after(|b| b.bin.truncate(50));
    assert!(text.contains("reaches past its buffer"), "{text}");
}

#[test]
fn unreadable_buffers_are_refused() {
    let b = Builder::tetrahedron();
    let message = |uri| message("a.gltf", &b.json(uri));
    assert!(message(Some("none.bin")).starts_with("cannot read none.bin, a buffer of the scene a.gltf: No such file"));
    assert!(message(Some("/dev/zero")).contains("leads out of the folder"));
    assert!(message(Some("a.gltf")).len() > 10);
    assert!(message(Some("https://example.org/a.bin")).contains("only relative files and data: URIs are read"));
    assert!(message(Some("data:;base64,AAAA")).contains("buffer 0 should hold 72 bytes, it holds 3"));
    assert!(message(Some("data:;base64,A*A")).contains("not base64"));
    assert!(message(None).contains("buffer 0 has no uri, and the file no binary chunk"));
}

#[test]
fn accessors_out_of_bounds_or_of_another_shape_are_refused() {
    let accessor = |i: usize, key: &'static str, value: Value| {
        message_after(|b| {
            b.root["accessors"][i][key] = value;
        })
    };
    for (text, part) in [
        (accessor(0, "count", json!(5)), "surface `organ`: accessor 0: 5 elements of 12 bytes from byte 0 reach past"),
        (accessor(0, "count", json!(0)), "accessor 0: it has no elements"),
        (accessor(0, "count", json!(u64::MAX)), "accessor 0: 18446744073709551615 elements"),
        (accessor(1, "count", json!(13)), "accessor 1: 13 elements of 2 bytes"),
        (accessor(0, "byteOffset", json!(u64::MAX)), "accessor 0"),
        (accessor(0, "type", json!("VEC2")), "its elements are Vec2 of F32; expected Vec3"),
        (
            accessor(0, "componentType", json!(U16)),
            "surface `organ`: accessor 0: its positions are U16; only F32 is read",
        ),
        (accessor(1, "componentType", json!(F32)), "its elements are Scalar of F32"),
        (
            message_after(|b| b.root["bufferViews"][0]["byteStride"] = json!(8)),
            "a stride of 8 bytes for elements of 12",
        ),
        (message_after(|b| b.root["bufferViews"][0]["byteLength"] = json!(1000)), "reaches past its buffer"),
        (message_after(|b| b.bin[48..50].copy_from_slice(&[4, 0])), "surface `organ`: index 4 of 4 vertices"),
    ] {
        assert!(text.contains(part), "{text}");
    }
}

#[test]
fn sparse_accessors_must_ascend_and_end() {
    let message = |indices: &[u8], count: u64| {
        message_after(|b| {
            let (view, values) = (b.view(indices), b.view(&[0; 24]));
            let accessor = &mut b.root["accessors"][0];
            accessor["count"] = json!(count);
            accessor.as_object_mut().unwrap().remove("bufferView");
            accessor["sparse"] = json!({"count": indices.len(), "values": {"bufferView": values},
                "indices": {"bufferView": view, "componentType": U8}});
        })
    };
    assert!(message(&[2, 1], 4).contains("sparse index 1; they must ascend and lie below 4"));
    assert!(message(&[1, 4], 4).contains("sparse index 4"));
    assert!(message(&[1, 2, 3], 4).contains("reach past buffer view"));
    assert!(message(&[1], 1 << 40).contains("1099511627776 elements without a buffer view"));
}

#[test]
fn unusable_surfaces_are_refused() {
    let text = message_after(|b| b.root["nodes"][0]["extras"] = json!({"tissue": "livr"}));
    assert_eq!(text, "surface `organ` of a.glb names the unknown tissue `livr` (did you mean `liver`?)");
    let text = message_after(|b| b.root["nodes"][0] = json!({"mesh": 0}));
    assert!(text.starts_with("surface `node 0` of a.glb has no tissue: give its node `extras.tissue`"), "{text}");
    let text = message_after(|b| b.root["nodes"][0]["extras"]["priority"] = json!(1.5));
    assert!(text.contains("`extras.priority` of node `organ` of a.glb is 1.5; it must be a whole number"), "{text}");
    let text = message_after(|b| b.root["nodes"][0]["extras"]["tissue"] = json!(["liver"]));
    assert!(text.contains("`extras.tissue` of node `organ` of a.glb is [\"liver\"]"), "{text}");
    let text = message_after(|b| b.bin[4..8].copy_from_slice(&f32::NAN.to_le_bytes()));
    assert!(text.contains("vertex 0 of surface `organ` of a.glb is [NaN, NaN, NaN] mm"), "{text}");
    let text = message_after(|b| b.root["nodes"][0]["scale"] = json!([1.0, 1.0, 1e5]));
    assert!(text.contains("vertex 3 of surface `organ`") && text.contains("within ±1e5 mm"), "{text}");
    let text = message_after(|b| b.root["nodes"][0]["scale"] = json!([0.0, 0.0, 0.0]));
    assert_eq!(text, "a.glb holds no triangles");
    let text = message_after(|b| b.root["nodes"][0].as_object_mut().unwrap().retain(|key, _| key == "name"));
    assert_eq!(text, "a.glb holds no triangles");
    let node = json!({"mesh": 0, "extras": {"tissue": "liver"}});
    let text = message_after(|b| b.root["nodes"] = json!(vec![node; 257]));
    assert!(text.starts_with("a.glb has 257 surfaces; at most 256 are traced"), "{text}");
}

#[test]
fn cyclic_nodes_and_invalid_transforms_are_refused() {
    let text = message_after(|b| {
        b.root["nodes"][0]["children"] = json!([0]);
        b.root["scenes"] = json!([{"nodes": [0]}]);
    });
    assert!(text.contains("node `organ` is reached twice"), "{text}");
    let text = message_after(|b| b.root["scenes"] = json!([{"nodes": [0, 0]}]));
    assert!(text.contains("node `organ` is reached twice"), "{text}");
    let text = message_after(|b| b.root["nodes"][0]["rotation"] = json!([0.0, 0.0, 0.0, 0.0]));
    assert!(text.contains("node `organ`: its rotation has norm 0; it must be a unit quaternion"), "{text}");
    let text = message_after(|b| b.root["nodes"][0]["matrix"] = json!(vec![0; 16]));
    assert!(text.contains("the last row of its matrix is not 0 0 0 1"), "{text}");
    let text = message_after(|b| b.root["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]));
    assert!(text.contains("KHR_draco_mesh_compression"), "{text}");
}

#[test]
fn a_long_chain_of_nodes_is_followed_to_its_end() {
    let mut b = Builder::tetrahedron();
    for child in 0..20_000 {
        b.node(json!({"children": [child]}));
    }
    assert_eq!(b.load_mesh().triangles.len(), 4);
}

/// A tetrahedron with a sparse and an interleaved accessor, so that flipped bytes hit those, too.
fn varied() -> Vec<u8> {
    let mut b = Builder::tetrahedron();
    let (indices, values) = (b.view(&[1, 3]), b.view(bytemuck::cast_slice(&[[0.02f32, 0.0, 0.0], [0.0, 0.0, 0.03]])));
    b.root["bufferViews"][0]["byteStride"] = json!(12);
    b.root["accessors"][0]["sparse"] = json!({"count": 2,
        "indices": {"bufferView": indices, "componentType": U8}, "values": {"bufferView": values}});
    b.node(json!({"mesh": 0, "extras": {"tissue": "brain", "priority": 3}, "scale": [1, -1, 2]}));
    b.glb()
}

#[test]
fn the_varied_file_is_valid() {
    assert_eq!(load_bytes("a.glb", &varied()).unwrap().0.surfaces.len(), 2);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4 * ProptestConfig::default().cases, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_bytes_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), prop_oneof![any::<u8>(), b'0'..=b'9']), 1..6),
        cut in prop::option::weighted(0.2, any::<prop::sample::Index>()),
    ) {
        let mut bytes = varied();
        for (at, value) in changes {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        if let Ok((scene, _)) = load_bytes("a.glb", &bytes) {
            for surface in &scene.surfaces {
                let vertices = surface.mesh.vertices_mm.len();
                prop_assert!(surface.mesh.triangles.iter().flatten().all(|&i| (i as usize) < vertices));
                prop_assert!(surface.mesh.vertices_mm.iter().all(|v| v.is_finite()));
            }
        }
    }

    #[test]
    fn no_number_in_the_document_panics(which in any::<prop::sample::Index>(), number in prop_oneof![
        Just(json!(-1)), Just(json!(0)), Just(json!(1)), Just(json!(255)), Just(json!(u32::MAX)), Just(json!(u64::MAX)),
        Just(json!(i64::MAX)), Just(json!(1e300)), Just(json!(0.5)), Just(json!(null)), Just(json!([])), Just(json!({})),
    ]) {
        let glb = varied();
        let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
        let mut root: Value = serde_json::from_slice(&glb[20..20 + length]).unwrap();
        let mut numbers = Vec::new();
        collect_numbers(&root, String::new(), &mut numbers);
        *root.pointer_mut(&numbers[which.index(numbers.len())]).unwrap() = number;
        let json = serde_json::to_vec(&root).unwrap();
        let chunk = [&(json.len() as u32).to_le_bytes(), &b"JSON"[..], &json].concat();
        let total = (12 + chunk.len() + glb.len() - 20 - length) as u32;
        let header = [b"glTF", &2u32.to_le_bytes()[..], &total.to_le_bytes()].concat();
        let _ = load_bytes("a.glb", &[&header, &chunk, &glb[20 + length..]].concat());
    }
}

fn collect_numbers(value: &Value, pointer: String, found: &mut Vec<String>) {
    match value {
        Value::Number(_) => found.push(pointer),
        Value::Array(list) => {
            list.iter().enumerate().for_each(|(i, v)| collect_numbers(v, format!("{pointer}/{i}"), found));
        }
        Value::Object(map) => map.iter().for_each(|(k, v)| collect_numbers(v, format!("{pointer}/{k}"), found)),
        _ => {}
    }
}
