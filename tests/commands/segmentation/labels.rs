//! Scenes from label maps of known shapes, in every orientation and both formats.

use std::collections::HashMap;

use glam::{DQuat, DVec3};
use insonify::anatomy::doctor::{self, Severity, examine};
use insonify::anatomy::export::{LabelledSurface, write_glb};
use insonify::anatomy::{Mesh, TissueTable};
use insonify::segmentation::classes::{ClassTable, Unmapped};
use insonify::segmentation::from_labels::{Inputs, Made, Options, Outcome, make};
use insonify::segmentation::gather::gather;
use insonify::segmentation::measure::measure;
use insonify::segmentation::shape::Shape;
use insonify::segmentation::volume::{LabelMap, ReadOptions, read_labels};

use super::files::{Volume, written};
use super::shapes::{MAPS, VOXEL_MM, volume};

/// Inputs of a scene from a label map alone, and segments without a class.
fn gathered(labels: LabelMap, table: &ClassTable) -> (Inputs, Vec<Unmapped>) {
    let measures = measure(&labels);
    gather(labels, &measures, table, None, None, false, false).unwrap()
}

/// Surfaces made from a label map whose numbers have the meanings [`MAPS`].
pub(crate) fn made(bytes: &[u8], name: &str, triangles: usize) -> Outcome {
    let folder = tempfile::tempdir().unwrap();
    let path = written(folder.path(), name, bytes);
    let mut table = ClassTable::builtin("total-v2").unwrap();
    MAPS.iter().for_each(|map| table.add(map).unwrap());
    let labels = read_labels(path.as_ref(), ReadOptions::default()).unwrap();
    let (inputs, unmapped) = gathered(labels, &table);
    assert!(unmapped.is_empty());
    make(inputs, &Options { triangles, ..Options::default() }, &|_, _| ())
}

fn organs(outcome: &Outcome) -> Vec<&Made> {
    outcome.surfaces.iter().filter(|s| s.voxels_mm3.is_some() && s.segment.is_some()).collect()
}

/// Number of parts, whose triangles are connected over edges, and number of edges that don't have just two triangles.
fn parts_and_bad_edges(mesh: &Mesh) -> (usize, usize) {
    let mut edges: HashMap<[u32; 2], Vec<u32>> = HashMap::new();
    for (n, &[a, b, c]) in (0..).zip(&mesh.triangles) {
        for [i, j] in [[a, b], [b, c], [c, a]] {
            edges.entry([i.min(j), i.max(j)]).or_default().push(n);
        }
    }
    let bad = edges.values().filter(|triangles| triangles.len() != 2).count();
    let mut part: Vec<usize> = (0..mesh.triangles.len()).collect();
    fn root(part: &mut [usize], mut n: usize) -> usize {
        while part[n] != n {
            part[n] = part[part[n]];
            n = part[n];
        }
        n
    }
    for triangles in edges.values() {
        let (a, b) = (root(&mut part, triangles[0] as usize), root(&mut part, triangles[triangles.len() - 1] as usize));
        part[a] = b;
    }
    let roots = (0..part.len()).filter(|&n| part[n] == n).count();
    (roots, bad)
}

/// Volume (mm³) and centroid of the voxels with a label.
fn of_voxels(volume: &Volume, label: u8) -> (f64, DVec3) {
    let at: Vec<DVec3> =
        (0..volume.labels.len()).filter(|&i| volume.labels[i] == label).map(|i| volume.place(i)).collect();
    let sum: DVec3 = at.iter().sum();
    (at.len() as f64 * VOXEL_MM.powi(3), sum / at.len() as f64)
}

#[track_caller]
fn check(outcome: &Outcome, volume: &Volume, what: &str) {
    let organs = organs(outcome);
    assert_eq!(organs.len(), 6, "{what}");
    for (label, map) in (1u8..).zip(MAPS) {
        let name = map.split_once('=').unwrap().1;
        let organ = organs.iter().find(|o| o.name == name).unwrap();
        let shape = Shape::of(&organ.mesh).unwrap();
        let (voxels_mm3, centroid_mm) = of_voxels(volume, label);
        let off = shape.volume_mm3 / voxels_mm3 - 1.0;
        assert!(off.abs() < 0.01, "{what}: {name} is off by {:.2} %", 100.0 * off);
        let away = shape.centre_mm.distance(centroid_mm);
        assert!(away < 0.25 * VOXEL_MM, "{what}: {name} lies {away:.2} mm away");
    }
    for surface in &outcome.surfaces {
        let (parts, bad) = parts_and_bad_edges(&surface.mesh);
        // The liver has the gallstone's cavity.
        let expected = if surface.name.starts_with("liver") { 2 } else { 1 };
        assert_eq!(
            (parts, bad),
            (expected, 0),
            "{what}: {} in {} triangles",
            surface.name,
            surface.mesh.triangles.len()
        );
        assert!(surface.mesh.signed_volume_mm3() > 0.0, "{what}: {}", surface.name);
    }
}

#[test]
fn one_patient_in_every_orientation_and_format_gives_one_scene() {
    let straight = volume(DQuat::IDENTITY);
    let first = made(&straight.nifti(), "a.nii", 120_000);
    check(&first, &straight, "NIfTI along the axes");
    for (what, order, reversed) in [
        ("RAS", [0, 1, 2], [true, true, false]),
        ("PIR", [1, 2, 0], [false, true, true]),
        ("SLA", [2, 0, 1], [false, false, true]),
    ] {
        let turned = straight.turned(order, reversed);
        for (format, bytes) in [("nii", turned.nifti()), ("nrrd", turned.nrrd())] {
            let again = made(&bytes, &format!("a.{format}"), 120_000);
            assert_eq!(again.surfaces.len(), first.surfaces.len());
            for (a, b) in first.surfaces.iter().zip(&again.surfaces) {
                assert_eq!((&a.name, &a.mesh.triangles), (&b.name, &b.mesh.triangles), "{what}, {format}");
                let far = a.mesh.vertices_mm.iter().zip(&b.mesh.vertices_mm).map(|(p, q)| p.distance(*q));
                assert!(far.fold(0.0, f32::max) < 1e-3, "{what}, {format}: {}", a.name);
            }
        }
    }
}

#[test]
fn an_oblique_grid_gives_the_same_organs() {
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.21, -0.16, 0.27);
    let oblique = volume(turn);
    let outcome = made(&oblique.nrrd(), "a.nrrd", 120_000);
    check(&outcome, &oblique, "oblique");
    let straight = made(&volume(DQuat::IDENTITY).nifti(), "a.nii", 120_000);
    for organ in organs(&straight).iter().filter(|o| o.name != "muscle") {
        let twin = organs(&outcome).into_iter().find(|o| o.name == organ.name).unwrap();
        let (a, b) = (Shape::of(&organ.mesh).unwrap(), Shape::of(&twin.mesh).unwrap());
        let away = a.centre_mm.distance(b.centre_mm);
        assert!(away < 0.5 * VOXEL_MM, "{}: {away:.2} mm", organ.name);
        assert!((a.volume_mm3 / b.volume_mm3 - 1.0).abs() < 0.03, "{}", organ.name);
    }
}

#[test]
fn few_triangles_keep_the_thin_tube_whole_and_the_doctor_content() {
    for triangles in [20_000, 200_000] {
        let outcome = made(&volume(DQuat::IDENTITY).nifti(), "a.nii", triangles);
        check(&outcome, &volume(DQuat::IDENTITY), &format!("{triangles} triangles"));
        let count: usize = outcome.surfaces.iter().map(|s| s.mesh.triangles.len()).sum();
        assert!(count <= triangles * 11 / 10, "{count} triangles of {triangles}");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.glb");
        let labelled = |s: Made| LabelledSurface { name: s.name, tissue: s.tissue, priority: s.priority, mesh: s.mesh };
        let surfaces: Vec<LabelledSurface> = outcome.surfaces.into_iter().map(labelled).collect();
        write_glb(&surfaces, &path).unwrap();
        let tissues = TissueTable::builtin().unwrap();
        let settings = doctor::Settings { tissues: &tissues, own_tissues: &[], background: None, start: None };
        let report = examine(&path, &settings, &|_, _| ()).unwrap();
        let worse: Vec<_> = report.findings.iter().filter(|f| f.severity != Severity::Note).collect();
        assert!(worse.is_empty(), "{worse:#?}");
    }
}

#[test]
fn walls_gas_and_layers_nest() {
    let volume = Volume::of([60, 60, 50], glam::DAffine3::from_scale(DVec3::splat(2.0)), |p| {
        let from = |x: f64, y: f64, z: f64, r: f64| p.distance(DVec3::new(x, y, z)) < r;
        match () {
            () if from(40.0, 60.0, 50.0, 24.0) => 6,
            () if (p - DVec3::new(84.0, 60.0, p.z)).length() < 9.0 && p.z > 10.0 && p.z < 85.0 => 52,
            () => 0,
        }
    });
    let folder = tempfile::tempdir().unwrap();
    let path = written(folder.path(), "a.nii", &volume.nifti());
    let labels = read_labels(path.as_ref(), ReadOptions::default()).unwrap();
    let table = ClassTable::builtin("total-v2").unwrap();
    let (inputs, _) = gathered(labels, &table);
    let outcome = make(inputs, &Options::default(), &|_, _| ());
    let names: Vec<&str> = outcome.surfaces.iter().map(|s| s.name.as_str()).collect();
    let expected = [
        "skin",
        "fat",
        "fascia",
        "soft_tissue",
        "stomach_wall",
        "stomach_submucosa",
        "stomach_mucosa",
        "stomach",
        "stomach_gas",
        "aorta_wall",
        "aorta",
    ];
    assert_eq!(names, expected);
    let volume_of = |name: &str| outcome.surfaces.iter().find(|s| s.name == name).unwrap().mesh.signed_volume_mm3();
    for pair in [&expected[..5], &expected[4..9], &expected[9..]] {
        for names in pair.windows(2) {
            assert!(volume_of(names[0]) > volume_of(names[1]), "{names:?}");
        }
    }
    // A wall of 1.5 mm takes the lumen's radius from 9 to 7.5 mm; one of 4 mm takes the stomach's from 24 to 20 mm.
    let ratio = volume_of("aorta") / volume_of("aorta_wall");
    assert!((ratio / (7.5f64 / 9.0).powi(2) - 1.0).abs() < 0.05, "{ratio}");
    let ratio = volume_of("stomach") / volume_of("stomach_wall");
    assert!((ratio / (20.0f64 / 24.0).powi(3) - 1.0).abs() < 0.06, "{ratio}");
    // Its layers of 2, 1 and 1 mm.
    for (layer, radius_mm) in [("stomach_submucosa", 22.0f64), ("stomach_mucosa", 21.0)] {
        let ratio = volume_of(layer) / volume_of("stomach_wall");
        assert!((ratio / (radius_mm / 24.0).powi(3) - 1.0).abs() < 0.04, "{layer}: {ratio}");
    }
    // A wall as thick as the heart's, under the pericardium.
    let mut table = ClassTable::builtin("total-v2").unwrap();
    table.add("6=heart").unwrap();
    let labels = read_labels(path.as_ref(), ReadOptions::default()).unwrap();
    let (inputs, _) = gathered(labels, &table);
    let hearts = make(inputs, &Options::default(), &|_, _| ());
    let of = |name: &str| hearts.surfaces.iter().find(|s| s.name == name).unwrap().mesh.signed_volume_mm3();
    let ratio = of("heart") / of("heart_pericardium");
    assert!((ratio / (14.0f64 / 24.0).powi(3) - 1.0).abs() < 0.08, "{ratio}");
    let ratio = of("heart_wall") / of("heart_pericardium");
    assert!((ratio / (23.0f64 / 24.0).powi(3) - 1.0).abs() < 0.02, "{ratio}");
    let gas = outcome.surfaces.iter().find(|s| s.name == "stomach_gas").unwrap();
    let shape = Shape::of(&gas.mesh).unwrap();
    assert!(shape.centre_mm.y < 55.0, "gas lies in front: {:?}", shape.centre_mm);
}
