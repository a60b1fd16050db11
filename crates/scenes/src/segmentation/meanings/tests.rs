//! Tests of meanings: of a file, of its meshes, of their parts.

use std::path::Path;

use glam::DVec3;

use super::super::classes::Role;
use super::*;

/// A mesh with one triangle for each part; the parts lie apart or touch.
fn mesh(name: &str, parts: &[&str], touching: bool) -> NamedMesh {
    let step = if touching { 0 } else { 3 };
    let triangle = |n: usize| [0, 1, 2].map(|corner| (n * step + corner) as u32);
    let count = parts.len().max(1);
    let vertices = (0..3 * count).map(|i| DVec3::new(i as f64, (i * i) as f64, 0.0)).collect();
    let part = |(n, part): (usize, &&str)| MeshPart { name: (*part).to_owned(), triangles: n..n + 1 };
    NamedMesh {
        name: name.to_owned(),
        vertices,
        triangles: (0..count).map(triangle).collect(),
        parts: parts.iter().enumerate().map(part).collect(),
    }
}

fn assignments(words: &[&str]) -> Vec<Assignment> {
    words.iter().map(|word| Assignment::parse(word, |path| path == Path::new("a.obj")).unwrap()).collect()
}

/// Names of the meshes and of their classes, or the error.
fn meant(meshes: &[NamedMesh], words: &[&str]) -> Result<Vec<(String, String)>, String> {
    let table = ClassTable::builtin("total-v2").unwrap();
    let found = meanings(&table, Path::new("a.obj"), meshes.to_vec(), &assignments(words));
    let pair = |meant: Meant| (meant.mesh.name, meant.class.name);
    found.map(|all| all.into_iter().map(pair).collect()).map_err(|e| e.to_string())
}

#[track_caller]
fn is_meant(meshes: &[NamedMesh], words: &[&str], expected: &[(&str, &str)]) {
    let found = meant(meshes, words).unwrap();
    let found: Vec<_> = found.iter().map(|(mesh, class)| (mesh.as_str(), class.as_str())).collect();
    assert_eq!(found, expected);
}

#[track_caller]
fn is_refused(meshes: &[NamedMesh], words: &[&str], says: &[&str]) {
    let error = meant(meshes, words).unwrap_err();
    for text in says {
        assert!(error.contains(text), "`{text}` is missing: {error}");
    }
}

#[test]
fn arguments_name_a_file_a_mesh_and_a_meaning() {
    let is_file = |path: &Path| ["a.obj", "b#1=2.obj", "b"].iter().any(|name| path == Path::new(name));
    let parse = |word: &str| Assignment::parse(word, is_file);
    let of = |file: &str, mesh: Option<&str>, meaning: Option<&str>| Assignment {
        file: file.into(),
        mesh: mesh.map(str::to_owned),
        meaning: meaning.map(str::to_owned),
    };
    for (word, expected) in [
        ("a.obj", of("a.obj", None, None)),
        ("a.obj=liver", of("a.obj", None, Some("liver"))),
        ("a.obj#grp0= liver", of("a.obj", Some("grp0"), Some("liver"))),
        ("a.obj#x#y=z=liver", of("a.obj", Some("x#y=z"), Some("liver"))),
        ("b#1=2.obj", of("b#1=2.obj", None, None)),
        ("b#1=2.obj=liver", of("b#1=2.obj", None, Some("liver"))),
        ("b#1=2.obj#3=liver", of("b#1=2.obj", Some("3"), Some("liver"))),
        ("gone.stl#1=liver", of("gone.stl", Some("1"), Some("liver"))),
    ] {
        assert_eq!(parse(word).unwrap(), expected, "{word}");
    }
    assert!(parse("a.obj#grp0").unwrap_err().to_string().contains("a.obj#grp0=liver"));
    for word in ["a.obj=", "a.obj#=liver", "a.obj#x="] {
        assert!(matches!(parse(word), Err(MeaningError::Empty { .. })), "{word}");
    }
}

#[test]
fn a_file_of_several_meshes_needs_a_meaning_for_each() {
    let meshes = [mesh("grp0", &["mtl0"], true), mesh("grp1", &["mtl1"], true)];
    is_refused(&meshes, &["a.obj"], &["`grp0`, `grp1` are no known organs", "a.obj#grp0=liver", "a.obj#*=MEANING"]);
    is_refused(&meshes, &["a.obj=liver"], &["2 meshes (`grp0`, `grp1`)", "a.obj#grp0=liver", "a.obj#*=liver"]);
    let both = ["a.obj#grp0=liver", "a.obj#mtl1=kidney_right"];
    is_meant(&meshes, &both, &[("grp0", "liver"), ("grp1", "kidney_right")]);
    is_refused(&meshes, &both[..1], &["`grp1` is no known organ", "a.obj#grp1="]);
    is_refused(&meshes, &["a.obj#grp2=liver"], &["no mesh `grp2`", "did you mean `grp", "grp0, grp1, mtl0, mtl1"]);
    is_refused(&meshes, &["a.obj#grp0=liver", "a.obj#grp0=spleen"], &["two meanings for `grp0`"]);
    is_refused(&meshes, &["a.obj=liver", "a.obj#*=liver"], &["two meanings for `a.obj`"]);
    is_refused(
        &meshes,
        &["a.obj#grp0=livr", "a.obj#*=liver"],
        &["a.obj#grp0=livr", "neither an organ nor a tissue", "liver"],
    );
    // `*` stands for all other meshes. If all have one tissue or one organ, they keep their own names.
    is_meant(&meshes, &["a.obj#*=bone_adult"], &[("grp0", "grp0"), ("grp1", "grp1")]);
    is_meant(&meshes, &["a.obj#*=liver", "a.obj#grp1=spleen"], &[("grp0", "grp0"), ("grp1", "spleen")]);
    let table = ClassTable::builtin("total-v2").unwrap();
    let ignored = meanings(&table, Path::new("a.obj"), meshes.to_vec(), &assignments(&["a.obj#*=ignore"])).unwrap();
    assert!(ignored.len() == 2 && ignored.iter().all(|meant| meant.class.role == Role::Ignore), "{ignored:?}");
    // Each mesh keeps the meaning of its name; one meaning for both meshes is refused.
    let named = [mesh("Right Kidney", &[], true), mesh("liver", &[], true)];
    is_meant(&named, &["a.obj"], &[("Right Kidney", "kidney_right"), ("liver", "liver")]);
    is_refused(&named, &["a.obj=liver"], &["2 meshes"]);
}

#[test]
fn materials_that_name_organs_divide_an_object() {
    let of = |touching| [mesh("abdomen", &["liver", "right_kidney"], touching)];
    for touching in [true, false] {
        is_meant(&of(touching), &["a.obj"], &[("liver", "liver"), ("right_kidney", "kidney_right")]);
        is_refused(&of(touching), &["a.obj=liver"], &["2 meshes (`liver`, `right_kidney`)", "a.obj#liver=liver"]);
    }
    let parts = ["a.obj#liver=spleen", "a.obj#abdomen/right_kidney=kidney_left"];
    is_meant(&of(true), &parts, &[("liver", "spleen"), ("right_kidney", "kidney_left")]);
    is_meant(&of(true), &["a.obj#abdomen=spleen"], &[("abdomen", "spleen")]);
    is_refused(&of(true), &["a.obj#abdomen=spleen", "a.obj#liver=liver"], &["two meanings"]);
}

#[test]
fn unknown_materials_divide_only_what_is_apart() {
    let (one, apart) = ([mesh("thing", &["mtl0", "mtl1"], true)], [mesh("thing", &["mtl0", "mtl1"], false)]);
    is_meant(&one, &["a.obj=liver"], &[("thing", "liver")]);
    is_refused(&one, &["a.obj"], &["`thing` is no known organ", "FILE=MEANING"]);
    is_refused(&apart, &["a.obj=liver"], &["2 meshes (`mtl0`, `mtl1`)"]);
    is_refused(&apart, &["a.obj"], &["`mtl0`, `mtl1` are no known organs", "a.obj#mtl0="]);
    is_meant(&apart, &["a.obj#*=liver"], &[("thing", "thing")]);
    is_meant(&apart, &["a.obj#mtl0=liver", "a.obj#*=spleen"], &[("mtl0", "liver"), ("mtl1", "mtl1")]);
    // An object with an organ's name is that organ, whatever its materials are called.
    let bladder = [mesh("urinary_bladder", &["wall", "lumen"], false)];
    is_meant(&bladder, &["a.obj"], &[("urinary_bladder", "urinary_bladder")]);
    is_meant(&bladder, &["a.obj=spleen"], &[("urinary_bladder", "spleen")]);
    // The object's name doesn't decide if a part lies apart from the others and is another organ.
    let two = |touching| [mesh("liver", &["mat0", "gallbladder"], touching)];
    is_refused(&two(false), &["a.obj"], &["`mat0` is no known organ", "a.obj#mat0="]);
    is_refused(&two(false), &["a.obj=liver"], &["2 meshes (`mat0`, `gallbladder`)", "a.obj#mat0=liver"]);
    let both = [("mat0", "liver"), ("gallbladder", "gallbladder")];
    is_meant(&two(false), &["a.obj#mat0=liver"], &both);
    is_meant(&two(true), &["a.obj"], &[("liver", "liver")]);
    // The material alone may name the organ.
    is_meant(&[mesh("Mesh.001", &["liver"], true)], &["a.obj"], &[("Mesh.001", "liver")]);
    is_refused(&[mesh("Mesh.001", &["liver", "other"], false)], &["a.obj"], &["`other` is no known organ"]);
}

#[test]
fn parts_of_one_name_in_several_meshes_are_told_apart() {
    let meshes = [mesh("one", &["red", "blue"], true), mesh("two", &["red", "green"], true)];
    is_refused(&meshes, &["a.obj#red=liver"], &["a part of several meshes", "one/red, two/red"]);
    let words = ["a.obj#one/red=liver", "a.obj#blue=spleen", "a.obj#two=pancreas"];
    is_meant(&meshes, &words, &[("one/red", "liver"), ("blue", "spleen"), ("two", "pancreas")]);
}
