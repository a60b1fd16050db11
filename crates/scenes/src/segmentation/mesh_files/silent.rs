//! Tests of files that other programs silently misread: they are read correctly, or refused with the reason.

use insonify_core::anatomy::Mesh;

use super::placing::{MeshAxes, Unit};
use super::{MeshFile, MeshFileError, decode};

fn read(name: &str, bytes: impl AsRef<[u8]>) -> Result<MeshFile, MeshFileError> {
    decode(bytes.as_ref(), name.as_ref())
}

#[track_caller]
fn refused(name: &str, bytes: impl AsRef<[u8]>, words: &[&str]) {
    let message = read(name, bytes).unwrap_err().to_string();
    for word in words {
        assert!(message.contains(word), "`{word}` is missing: {message}");
    }
}

fn volume(file: &MeshFile, index: usize) -> f64 {
    let named = &file.meshes[index];
    let vertices_mm = named.vertices.iter().map(|v| v.as_vec3()).collect();
    Mesh { vertices_mm, triangles: named.triangles.clone() }.signed_volume_mm3()
}

/// Names of each mesh and of its parts.
fn names(file: &MeshFile) -> Vec<(&str, Vec<&str>)> {
    file.meshes.iter().map(|m| (m.name.as_str(), m.parts.iter().map(|part| part.name.as_str()).collect())).collect()
}

/// Faces of a box in OBJ: numbers of its corners, counted from 1.
const FACES: [[u32; 4]; 6] = [[1, 2, 4, 3], [5, 7, 8, 6], [1, 5, 6, 2], [3, 4, 8, 7], [1, 3, 7, 5], [2, 6, 8, 4]];

/// OBJ lines of the corners of a box of 80 × 60 × 50 that begins at `x`.
fn corners(x: f64) -> String {
    let corner = |n: usize| {
        let [a, b, c] = [n >> 2 & 1, n >> 1 & 1, n & 1].map(|bit| bit as f64);
        format!("v {} {} {}\n", x + 80.0 * a, 60.0 * b, 50.0 * c)
    };
    (0..8).map(corner).collect()
}

fn faces(first: u32) -> String {
    FACES.iter().map(|f| format!("f {} {} {} {}\n", f[0] + first, f[1] + first, f[2] + first, f[3] + first)).collect()
}

/// Volume of the box.
const BOX: f64 = 240_000.0;

#[test]
fn comments_and_names_of_obj_that_end_in_a_backslash_do_not_swallow_a_line() {
    let body = format!("{}{}", corners(0.0), faces(0));
    for start in ["# made in C:\\work\\\n", "mtllib C:\\work\\\n", "o liver\\\n", "g a\\\n", "usemtl a\\\n", "\u{feff}"]
    {
        let file = read("a.obj", format!("{start}{body}")).unwrap();
        assert!((volume(&file, 0) - BOX).abs() < 1.0, "{start}: {}", volume(&file, 0));
    }
    let joined = body.replacen("f 1 2 4 3", "f 1 \\\r\n 2 4 \\\r\n 3 # the first", 1);
    assert!((volume(&read("a.obj", &joined).unwrap(), 0) - BOX).abs() < 1.0);
    assert!((volume(&read("a.obj", joined.replace("\r\n", "\n").replace('\n', "\r")).unwrap(), 0) - BOX).abs() < 1.0);
    refused("a.obj", body.replacen("v 0 0 50\n", "v 0 0 50 \\\n", 1), &["line 3", "`v` is not a coordinate"]);
    refused("a.obj", body.replacen("f 1 2 4 3\n", "f 1 2 4 3 \\\n", 1), &["`f` names no vertex"]);
}

#[test]
fn statements_of_obj_that_would_be_lost_are_refused() {
    let body = format!("{}{}", corners(0.0), faces(0));
    refused("a.obj", format!("{body}vertex 1 2 3\n"), &["line 15", "`vertex` is no statement"]);
    refused("a.obj", format!("{body}surf 0 1 0 1 1 2\n"), &["free-form"]);
    refused("a.obj", format!("{body}call other.obj\n"), &["includes another file"]);
    refused("a.obj", "v 1,5 2,5 3,5\n", &["line 1", "`1,5` has a decimal comma", "English"]);
    refused("a.obj", "v 1 2\n", &["a vertex of 2 coordinates"]);
    refused("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 -4\n", &["line 4", "`-4` names no vertex: there are 3"]);
    refused("a.obj", b"\xff\xfev\0 \0", &["UTF-16"]);
    let coloured = body.replacen("v 0 0 50\n", "v 0 0 50 1.0 0.5 0.2 # first\n", 1);
    assert!((volume(&read("a.obj", coloured).unwrap(), 0) - BOX).abs() < 1.0);
}

#[test]
fn groups_and_materials_of_an_object_are_its_parts() {
    let two = |before: &str, between: &str| {
        format!("{}{}{before}{}{between}{}", corners(0.0), corners(200.0), faces(0), faces(8))
    };
    let file = read("a.obj", two("o abdomen\nusemtl liver\n", "usemtl right_kidney\n")).unwrap();
    assert_eq!(names(&file), [("abdomen", vec!["liver", "right_kidney"])]);
    assert!(!file.meshes[0].is_one_surface());
    let split = file.meshes[0].clone().split(|part| part.name.clone());
    let sizes: Vec<_> = split.iter().map(|m| (m.name.as_str(), m.vertices.len(), m.triangles.len())).collect();
    assert_eq!(sizes, [("liver", 8, 12), ("right_kidney", 8, 12)]);
    // Groups of an object take precedence over its materials; groups without objects are meshes.
    let file = read("a.obj", two("o abdomen\ng liver\nusemtl a\n", "g kidney\nusemtl b\n")).unwrap();
    assert_eq!(names(&file), [("abdomen", vec!["liver", "kidney"])]);
    let file = read("a.obj", two("g liver\no box\n", "g kidney\no box.001\n")).unwrap();
    assert_eq!(names(&file), [("box", vec![""]), ("box.001", vec![""])]);
    let file = read("a.obj", two("g grp0\nusemtl mtl0\n", "g grp1\nusemtl mtl1\n")).unwrap();
    assert_eq!(names(&file), [("grp0", vec!["mtl0"]), ("grp1", vec!["mtl1"])]);
    // Two objects of one name are two meshes, unless they share a vertex.
    let file = read("a.obj", two("o Mesh\n", "o Mesh\n")).unwrap();
    assert_eq!(names(&file), [("Mesh", vec![""]), ("Mesh_2", vec![""])]);
    let again = format!("{}o a\nf 1 2 4 3\no b\nf 5 7 8 6\no a\nf 1 5 6 2\n", corners(0.0));
    assert_eq!(names(&read("a.obj", again).unwrap()), [("a", vec![""]), ("b", vec![""])]);
    // Faces of two materials that share vertices form one surface.
    let painted = format!("{}o a\nusemtl x\nf 1 2 4 3\nf 5 7 8 6\nusemtl y\nf 1 5 6 2\n", corners(0.0));
    assert!(read("a.obj", painted).unwrap().meshes[0].is_one_surface());
}

#[test]
fn names_are_cleaned_of_what_no_line_can_show() {
    let text = format!("o li\u{1b}[31mver\u{202e}\u{0}\nusemtl a\tb\n{}{}", corners(0.0), faces(0));
    assert_eq!(names(&read("a.obj", text).unwrap()), [("li [31mver", vec!["a b"])]);
    let file = read("a\n[pose]\n.obj", format!("{}{}", corners(0.0), faces(0))).unwrap();
    assert_eq!(file.meshes[0].name, "a [pose]");
    let file = read("a.stl", stl("\u{7}")).unwrap();
    assert_eq!(file.meshes[0].name, "a");
}

/// A tetrahedron of volume 1/6 as text STL.
fn stl(name: &str) -> String {
    let at = ["0 0 0", "1 0 0", "0 1 0", "0 0 1"];
    let facet = |[a, b, c]: [usize; 3]| {
        let [a, b, c] = [at[a], at[b], at[c]];
        format!("facet normal 0 0 0\nouter loop\nvertex {a}\nvertex {b}\nvertex {c}\nendloop\nendfacet\n")
    };
    let facets: String = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]].map(facet).concat();
    format!("solid {name}\n{facets}endsolid {name}\n")
}

#[test]
fn text_stl_is_whole_or_refused() {
    let text = stl("liver");
    let is_whole = |text: String| (volume(&read("a.stl", text).unwrap(), 0) - 1.0 / 6.0).abs() < 1e-9;
    assert!(is_whole(text.clone()) && is_whole(text.replace('\n', "\r")) && is_whole(text.replace('\n', "\r\n")));
    assert!(is_whole(text.replace("endloop", "end loop").replace("endfacet", "End Facet").to_uppercase()));
    refused("a.stl", text.replace("endsolid liver\n", ""), &["line 1", "no `endsolid`", "truncated"]);
    // The file is cut off between two facets, alone or with another solid after it.
    let cut = text[..text.rfind("facet normal").unwrap()].to_owned();
    refused("a.stl", &cut, &["line 1", "no `endsolid`"]);
    refused("a.stl", format!("{cut}{}", stl("kidney")), &["a solid begins", "line 1 has no `endsolid`"]);
    refused("a.stl", text.replacen("endfacet\n", "", 1), &["line 8", "line 2 has no `endfacet`"]);
    refused("a.stl", text.replacen("facet normal 0 0 0\n", "", 1), &["vertex outside a facet"]);
    refused("a.stl", format!("{text}facet normal 0 0 0\n"), &["facet outside `solid`"]);
    refused("a.stl", text.replacen("vertex 1 0 0", "vertex 1,5 0 0", 1), &["line 6", "decimal comma"]);
    refused("a.stl", text.replacen("vertex 1 0 0", "vertex 1 0 0 7", 1), &["line 6", "a vertex of 4 numbers"]);
    refused("a.stl", text.replacen("vertex 1 0 0", "vertex nan 0 0", 1), &["line 6", "`nan` is not a number"]);
    let both = read("a.stl", format!("{text}{}", stl("kidney"))).unwrap();
    assert_eq!(names(&both), [("liver", vec![]), ("kidney", vec![])]);
}

/// A binary STL file with a header, a count, and `facets` facets of the tetrahedron, repeated if necessary.
fn binary(header: &[u8], count: u32, facets: usize) -> Vec<u8> {
    let mut bytes = header.to_vec();
    bytes.resize(80, b' ');
    bytes.extend(count.to_le_bytes());
    let at = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for [a, b, c] in [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]].into_iter().cycle().take(facets) {
        bytes.extend([0; 12]);
        bytes.extend([at[a], at[b], at[c]].iter().flatten().flat_map(|v| v.to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

#[test]
fn a_wrong_count_of_binary_stl_is_named() {
    let whole = binary(b"scan", 4, 4);
    assert_eq!(read("a.stl", &whole).unwrap().meshes[0].triangles.len(), 4);
    refused("a.stl", binary(b"scan", 0, 4), &["byte 80", "promises 0 triangles", "4 triangles more follow"]);
    refused("a.stl", binary(b"scan", 3, 4), &["byte 80", "promises 3 triangles", "1 triangle more"]);
    refused("a.stl", binary(b"scan", 5, 4), &["truncated", "5 triangles that byte 80 promises"]);
    refused("a.stl", [&whole[..], b"end"].concat(), &["byte 80", "3 bytes more follow"]);
    assert_eq!(read("a.stl", [&whole[..], &[0; 428]].concat()).unwrap().meshes[0].triangles.len(), 4);
    for header in [&b"solid a facet of"[..], b"solid"] {
        let file = read("a.stl", [&binary(header, 4, 4)[..], b"\n"].concat()).unwrap();
        assert_eq!(file.meshes[0].triangles.len(), 4);
        refused("a.stl", binary(header, 2, 4), &["promises 2 triangles"]);
    }
}

const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                   element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";

#[test]
fn lines_of_text_ply_hold_what_the_header_says() {
    for text in
        [PLY.to_owned(), PLY.replace('\n', "\r"), PLY.replace('\n', "\r\n"), PLY.replace("1 0 0\n", "1 0 0\n\n")]
    {
        assert_eq!(read("a.ply", text).unwrap().meshes[0].triangles, [[0, 1, 2]]);
    }
    refused("a.ply", PLY.replace("1 0 0\n", "1 0 0 255\n"), &["line 11", "more values than the header's properties"]);
    refused("a.ply", PLY.replace("1 0 0\n", "1 0\n"), &["line 11", "the line ends before `z`"]);
    refused("a.ply", PLY.replace("1 0 0\n", "1,5 0 0\n"), &["line 11", "decimal comma"]);
    refused("a.ply", format!("{PLY}3 0 1 2\n"), &["line 14", "a count of the header is too low"]);
    refused("a.ply", PLY.replace("face 1", "face 2"), &["truncated", "face 1 of 2"]);
    refused("a.ply", PLY.replace("3 0 1 2", "-3 0 1 2"), &["line 13", "length of -3"]);
}

#[test]
fn binary_ply_ends_after_its_elements() {
    let header = PLY.split("0 0 0\n").next().unwrap().replace("ascii", "binary_little_endian");
    let values = [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|v| v.to_le_bytes());
    let mut bytes = header.into_bytes();
    bytes.extend(values);
    bytes.push(3);
    bytes.extend([0i32, 1, 2].iter().flat_map(|v| v.to_le_bytes()));
    assert_eq!(read("a.ply", &bytes).unwrap().meshes[0].triangles, [[0, 1, 2]]);
    refused("a.ply", [&bytes[..], &[3; 13]].concat(), &["13 bytes follow the last element"]);
    let bare: Vec<u8> = bytes.iter().map(|b| if *b == b'\n' { b'\r' } else { *b }).collect();
    assert_eq!(read("a.ply", bare).unwrap().meshes[0].triangles, [[0, 1, 2]]);
}

#[test]
fn text_vtk_holds_as_many_cells_as_it_promises() {
    let text = "# vtk DataFile Version 3.0\nUNITS=cm SPACE=RAS\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n0 0 0 1 0 0 0 1 0\n\
                POLYGONS 1 4\n3 0 1 2\n";
    for text in [text.to_owned(), text.replace('\n', "\r")] {
        let file = read("a.vtk", text).unwrap();
        assert_eq!(file.meshes[0].triangles, [[0, 1, 2]]);
        assert_eq!((file.hints.axes, file.hints.unit), (Some(MeshAxes::Ras), Some(Unit::Cm)));
    }
    refused("a.vtk", text.replace("POLYGONS 1 4", "POLYGONS 2 4"), &["line 7", "1 cells, and 2 are promised"]);
    refused("a.vtk", text.replace("POLYGONS 1 4", "POLYGONS 1 3"), &["fewer corners"]);
    refused("a.vtk", format!("{text}3 0 1 2\n"), &["`3` is no section"]);
    refused("a.vtk", text.replace("0 0 0 1 0 0", "0 0 0 1,5 0 0"), &["line 6", "decimal comma"]);
    refused("a.vtk", &text[..text.len() - 3], &["truncated"]);
}

#[test]
fn offsets_of_vtk_lead_to_the_last_corner() {
    let text = |offsets: &str| {
        let count = offsets.split(' ').count();
        format!(
            "# vtk DataFile Version 5.1\nname\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n0 0 0 1 0 0 0 1 0\n\
             POLYGONS {count} 6\nOFFSETS vtktypeint64\n{offsets}\nCONNECTIVITY vtktypeint64\n0 1 2 2 1 0\n"
        )
    };
    assert_eq!(read("a.vtk", text("0 3 6")).unwrap().meshes[0].triangles.len(), 2);
    refused("a.vtk", text("0 3"), &["line 7", "the offsets end at 3 of 6 corners"]);
}

#[test]
fn pieces_of_a_vtp_are_parts_with_as_many_cells_as_promised() {
    let piece = |x: f64| {
        format!(
            "<Piece NumberOfPoints=\"3\" NumberOfPolys=\"1\"><Points><DataArray type=\"Float32\">{x} 0 0 {} 0 0 {x} 1 0\
             </DataArray></Points><Polys><DataArray type=\"Int32\" Name=\"connectivity\">0 1 2</DataArray>\
             <DataArray type=\"Int32\" Name=\"offsets\">3</DataArray></Polys></Piece>",
            x + 1.0
        )
    };
    let file =
        |pieces: &[String]| format!("<VTKFile type=\"PolyData\"><PolyData>{}</PolyData></VTKFile>", pieces.concat());
    let apart = read("a.vtp", file(&[piece(0.0), piece(9.0)])).unwrap();
    assert_eq!(names(&apart), [("a", vec!["piece 0", "piece 1"])]);
    assert!(!apart.meshes[0].is_one_surface());
    assert!(read("a.vtp", file(&[piece(0.0), piece(1.0)])).unwrap().meshes[0].is_one_surface());
    assert_eq!(names(&read("a.vtp", file(&[piece(0.0)])).unwrap()), [("a", vec![])]);
    let more = piece(0.0).replace("NumberOfPolys=\"1\"", "NumberOfPolys=\"2\"");
    refused("a.vtp", file(&[more]), &["1 cells in `Polys`, and 2 are promised"]);
    let longer = piece(0.0).replace("0 1 2</DataArray>", "0 1 2 2 1 0</DataArray>");
    refused("a.vtp", file(&[longer]), &["line 1", "the offsets end at 3 of 6 corners"]);
    refused("a.vtp", file(&[piece(0.0).replace("0 1 0", "0 1,5 0")]), &["line 1", "decimal comma"]);
}
