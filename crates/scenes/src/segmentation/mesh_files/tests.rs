//! Tests of files that other programs wrote, and of damaged files.

use std::path::{Path, PathBuf};

use insonify_core::anatomy::Mesh;

use super::placing::{MeshAxes, Unit};
use super::{MeshFile, MeshFileError, read_meshes};

/// Folder of files that trimesh, meshio and VTK wrote; `make.py` in that folder makes them.
fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/segmentation/meshes").join(name)
}

fn read(name: &str) -> MeshFile {
    read_meshes(&data(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// Reads bytes as a file of this name.
fn read_bytes(name: &str, bytes: impl AsRef<[u8]>) -> Result<MeshFile, MeshFileError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    read_meshes(&path)
}

fn fault(name: &str, bytes: impl AsRef<[u8]>) -> String {
    read_bytes(name, bytes).unwrap_err().to_string()
}

/// Mesh of a file, with its coordinates taken as mm.
fn mesh(file: &MeshFile, index: usize) -> Mesh {
    let named = &file.meshes[index];
    let vertices_mm = named.vertices.iter().map(|v| v.as_vec3()).collect();
    Mesh { vertices_mm, triangles: named.triangles.clone() }
}

/// Checks for the closed sphere in the test files: 80 triangles about (100, 0, 30), radius 20.
fn is_ball(file: &MeshFile, index: usize, name: &str) {
    let ball = mesh(file, index);
    assert_eq!((ball.vertices_mm.len(), ball.triangles.len()), (42, 80), "{name}");
    assert_eq!(ball.unpaired_edges(), 0, "{name}");
    let volume = ball.signed_volume_mm3();
    assert!((29_000.0..31_000.0).contains(&volume), "{name}: {volume}");
    let bounds = ball.bounds_mm().unwrap();
    assert!((0.5 * (bounds.min + bounds.max)).distance(glam::Vec3::new(100.0, 0.0, 30.0)) < 1e-3, "{name}");
}

#[test]
fn files_of_other_programs_hold_the_sphere_they_were_given() {
    let files = [
        "trimesh_binary.stl",
        "trimesh_text.stl",
        "binary_solid.stl",
        "meshio.stl",
        "slicer.stl",
        "meshio.obj",
        "trimesh_binary.ply",
        "trimesh_text.ply",
        "meshio.ply",
        "slicer.ply",
        "vtk_old_text.vtk",
        "vtk_old_binary.vtk",
        "vtk_new_text.vtk",
        "vtk_new_binary.vtk",
        "vtk_strips.vtk",
        "vtk_text.vtp",
        "vtk_inline.vtp",
        "vtk_inline_zlib.vtp",
        "vtk_appended_base64.vtp",
        "vtk_appended_base64_zlib.vtp",
        "vtk_appended_raw.vtp",
        "vtk_appended_raw_zlib_big.vtp",
    ];
    for name in files {
        let file = read(name);
        assert_eq!(file.meshes.len(), 1, "{name}");
        is_ball(&file, 0, name);
        let stem = name.split('.').next().unwrap();
        assert!([stem, "exported by a tool that does not care"].contains(&file.meshes[0].name.as_str()), "{name}");
    }
}

#[test]
fn objects_of_scenes_keep_their_names() {
    for name in ["trimesh_scene.obj", "trimesh_scene.glb"] {
        let file = read(name);
        let names: Vec<_> = file.meshes.iter().map(|mesh| mesh.name.as_str()).collect();
        assert_eq!(names, ["liver", "spleen"], "{name}");
        is_ball(&file, 0, name);
        assert!((mesh(&file, 1).signed_volume_mm3() - 6000.0).abs() < 1.0);
    }
    assert!((mesh(&read("vtk_strips.vtp"), 0).signed_volume_mm3() - 6000.0).abs() < 1.0);
}

#[test]
fn files_say_their_axes_and_unit() {
    let axes = |name: &str| read(name).hints.axes;
    for name in ["slicer.stl", "slicer.ply", "vtk_new_text.vtk", "vtk_new_binary.vtk", "vtk_text.vtp"] {
        assert_eq!(axes(name), Some(MeshAxes::Lps), "{name}");
    }
    assert_eq!(axes("vtk_old_text.vtk"), Some(MeshAxes::Ras));
    assert_eq!(axes("trimesh_binary.stl"), None);
    let glb = read("trimesh_scene.glb").hints;
    assert_eq!((glb.axes, glb.unit), (Some(MeshAxes::YUp), Some(Unit::M)));
    let obj = read_bytes("a.obj", "# 3D Slicer output. SPACE=RAS\n# Units: cm\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        .unwrap();
    assert_eq!((obj.hints.axes, obj.hints.unit), (Some(MeshAxes::Ras), Some(Unit::Cm)));
}

#[test]
fn obj_faces_may_count_from_the_end_and_have_many_corners() {
    let text = "mtllib missing.mtl\r\nv 0 0 0\r\nv 2 0 0\r\nv 2 2 0\r\nv 0 2 0\r\nv 1 3 0\r\nusemtl skin\r\n\
                g left arm\r\nf -5/1/1 -4/2/1 -3//1 \\\r\n -1 -2\r\ng right\r\nf 1 2 3\r\ng left arm\r\nf 3 2 1\r\n";
    let file = read_bytes("a.obj", text).unwrap();
    let sizes: Vec<_> = file.meshes.iter().map(|m| (m.name.as_str(), m.triangles.len())).collect();
    assert_eq!(sizes, [("left arm", 4), ("right", 1)]);
    assert!(fault("a.obj", "v 0 0 0\nv 1 0 0\nf 1 2 3\n").contains("line 3: `3` names no vertex: there are 2"));
    assert!(fault("a.obj", "v 0 0 zero\n").contains("line 1: `zero` is not a coordinate"));
    assert!(fault("a.obj", "v 0 0 nan\n").contains("line 1: `nan` is not a coordinate"));
    assert!(fault("a.obj", "v 0 0 0\nv 1 0 0\nf 1 0 2\n").contains("line 3: `0` names no vertex"));
}

#[test]
fn a_text_stl_may_have_several_solids() {
    let facet = |z: f64| {
        format!("facet normal 0 0 1\nouter loop\nvertex 0 0 {z}\nvertex 1 0 {z}\nvertex 0 1 {z}\nendloop\nendfacet\n")
    };
    let text = format!(
        "solid liver\n{}endsolid liver\nsolid\n{}endsolid\nsolid liver\n{}endsolid\n",
        facet(0.0),
        facet(1.0),
        facet(2.0)
    );
    let file = read_bytes("organs.stl", &text).unwrap();
    let names: Vec<_> = file.meshes.iter().map(|mesh| mesh.name.as_str()).collect();
    assert_eq!(names, ["liver", "organs", "liver_2"]);
    let cut = &text[..text.len() - 20];
    let half = cut[..cut.rfind("vertex").unwrap()].to_owned();
    assert!(fault("a.stl", half).contains("truncated: the file ends inside this facet"));
    assert!(fault("a.stl", text.replace("vertex 1", "vertex one")).contains("line 5: `one` is not a number"));
}

#[test]
fn truncated_files_are_refused_with_their_place() {
    let names = [
        "trimesh_binary.stl",
        "trimesh_binary.ply",
        "slicer.ply",
        "meshio.ply",
        "vtk_new_text.vtk",
        "vtk_old_binary.vtk",
        "vtk_new_binary.vtk",
        "vtk_text.vtp",
        "vtk_inline_zlib.vtp",
        "vtk_appended_base64.vtp",
        "vtk_appended_base64_zlib.vtp",
        "vtk_appended_raw.vtp",
        "vtk_appended_raw_zlib_big.vtp",
        "trimesh_scene.glb",
        "trimesh_text.ply",
    ];
    for name in names {
        let bytes = std::fs::read(data(name)).unwrap();
        for part in [0.15, 0.4] {
            let cut = &bytes[..(bytes.len() as f64 * part) as usize];
            let message = fault(name, cut);
            let has_place = ["byte ", "line ", "truncated"].iter().any(|word| message.contains(word));
            assert!(message.contains(name) && has_place, "{name}: {message}");
        }
    }
}

#[test]
fn damaged_files_never_panic() {
    for entry in std::fs::read_dir(data("")).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        if !super::EXTENSIONS.iter().any(|extension| name.ends_with(extension)) {
            continue;
        }
        let bytes = std::fs::read(&path).unwrap();
        let mut seed = 1u64;
        for _ in 0..60 {
            let mut damaged = bytes.clone();
            for _ in 0..4 {
                seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                let at = (seed >> 33) as usize % damaged.len();
                damaged[at] = (seed >> 20) as u8;
            }
            let _ = read_bytes(&name, damaged);
        }
    }
}

#[test]
fn a_vertex_that_is_not_finite_is_named() {
    let mut bytes = std::fs::read(data("trimesh_binary.stl")).unwrap();
    bytes[84 + 12..84 + 16].copy_from_slice(&f32::NAN.to_le_bytes());
    let message = fault("a.stl", bytes);
    assert!(message.contains("vertex 0 (from 0) of `a` is [NaN"), "{message}");
}

#[test]
fn pictures_and_volumes_are_sent_to_label_maps() {
    for (name, bytes) in
        [("a.png", &b"\x89PNG\r\n"[..]), ("a.nii.gz", b"\x1f\x8b"), ("a.stl", b"NRRD0004\n"), ("a.mha", b"x")]
    {
        let message = fault(name, bytes);
        assert!(message.contains("from-labels"), "{message}");
    }
    assert!(matches!(read_bytes("a.doc", b"hello"), Err(MeshFileError::Unknown { .. })));
}

#[test]
fn files_without_triangles_are_refused() {
    let points = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n1 0 0\n";
    assert!(fault("a.ply", points).contains("has no triangles, only 2 points"));
    assert!(fault("a.obj", "v 0 0 0\nv 1 0 0\nl 1 2\n").contains("1 lines or points"));
    let message = read_meshes(&data("grid.vtk")).unwrap_err().to_string();
    assert!(message.contains("line 4") && message.contains("Extract Surface"), "{message}");
    assert!(fault("a.vtp", "<VTKFile type=\"ImageData\"></VTKFile>").contains("from-labels"));
    let empty = [&[b' '; 80][..], &[0; 4]].concat();
    assert!(matches!(read_bytes("a.stl", empty), Err(MeshFileError::NoTriangles { .. })));
    assert!(matches!(read_meshes(Path::new("/nowhere/a.stl")), Err(MeshFileError::File(_))));
}

#[test]
fn ply_strips_and_extra_properties_are_read() {
    let text = "ply\nformat ascii 1.0\ncomment made by hand\nelement vertex 4\nproperty uchar red\nproperty float z\nproperty float y\n\
                property float x\nproperty list uchar int near\nelement tristrips 1\nproperty list int int vertex_indices\n\
                element edge 1\nproperty int vertex1\nproperty int vertex2\nend_header\n\
                9 0 0 0 1 7\n9 0 0 1 0\n9 0 1 0 2 1 1\n9 0 1 1 0\n8 0 1 2 3 -1 2 1 0\n0 1\n";
    let file = read_bytes("a.ply", text).unwrap();
    assert_eq!(file.meshes[0].triangles.len(), 3);
    assert_eq!(file.meshes[0].vertices[1], glam::DVec3::X);
    let bad = text.replace("-1 2 1 0", "-1 2 1 9");
    let message = fault("a.ply", bad);
    assert!(message.contains("names vertex 9 of 4"), "{message}");
}

#[test]
fn counts_without_content_end_at_once() {
    let ply = "ply\nformat ascii 1.0\nelement nothing 1000000000000000\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    assert!(fault("a.ply", ply).contains("has no triangles"));
    let vtk = |rest: &str| format!("# vtk DataFile Version 5.1\n\nASCII\nDATASET POLYDATA\n{rest}");
    assert!(fault("a.vtk", vtk("METADATA")).contains("has no triangles"));
    assert!(fault("a.vtk", vtk("FIELD f 1\nname 1 99999999999999 string\n")).contains("truncated"));
    assert!(fault("a.vtk", vtk("POINTS 99999999999999 float\n1 2 3")).contains("truncated"));
    let vtp = "<VTKFile type=\"PolyData\"><PolyData><Piece NumberOfPoints=\"9999999999999999999\"><Points><DataArray type=\"Float32\">1</DataArray></Points></Piece></PolyData></VTKFile>";
    assert!(fault("a.vtp", vtp).contains("line 1"));
}

#[test]
fn a_metadata_section_is_skipped() {
    let text = "# vtk DataFile Version 5.1\nname\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n0 0 0 1 0 0 0 1 0\nMETADATA\nINFORMATION 1\n\
                NAME L2_NORM_RANGE LOCATION vtkDataArray\nDATA 2 0 1\n\nPOLYGONS 1 4\n3 0 1 2\n";
    assert_eq!(read_bytes("a.vtk", text).unwrap().meshes[0].triangles, [[0, 1, 2]]);
}
