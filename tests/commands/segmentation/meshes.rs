//! Scenes from meshes that include a body, or surfaces that were exported twice.

use glam::Vec3;
use insonify::anatomy::{Mesh, analytic};
use insonify::segmentation::classes::ClassTable;
use insonify::segmentation::from_labels::Options;
use insonify::segmentation::from_meshes::{OrganMesh, surfaces};
use insonify::segmentation::repair::{ActionKind, RepairSettings, repair};

fn ball(radius: f32) -> Mesh {
    analytic::sphere(Vec3::new(30.0, -20.0, 400.0), radius, 5)
}

#[test]
fn a_body_of_a_mesh_has_skin_and_fat_of_their_thickness() {
    let table = ClassTable::builtin("total-v2").unwrap();
    let organ =
        |name: &str, mesh: Mesh| OrganMesh { name: name.to_owned(), class: table.named(name).unwrap().clone(), mesh };
    let options = Options { skin_mm: 2.0, fat_mm: 12.0, ..Options::default() };
    let (made, _) = surfaces(vec![organ("body", ball(100.0)), organ("liver", ball(40.0))], &options);
    let radius = |name: &str| {
        let volume = made.iter().find(|s| s.name == name).unwrap().mesh.signed_volume_mm3();
        (volume * 0.75 / std::f64::consts::PI).cbrt()
    };
    for (name, expected) in [("skin", 100.0), ("fat", 98.0), ("fascia", 86.0), ("soft_tissue", 85.0), ("liver", 40.0)] {
        assert!((radius(name) - expected).abs() < 1.0, "{name}: {} mm", radius(name));
    }
}

#[test]
fn an_organ_that_reaches_out_of_the_body_is_told() {
    let table = ClassTable::builtin("total-v2").unwrap();
    let organ =
        |name: &str, mesh: Mesh| OrganMesh { name: name.to_owned(), class: table.named(name).unwrap().clone(), mesh };
    let moved = |mm: f32| analytic::sphere(Vec3::new(30.0 + mm, -20.0, 400.0), 20.0, 4);
    let organs = |mm: f32| vec![organ("body", ball(60.0)), organ("liver", ball(30.0)), organ("spleen", moved(mm))];
    let (_, remarks) = surfaces(organs(35.0), &Options::default());
    assert!(matches!(&remarks[..], [one] if one.starts_with("where organs overlap")), "{remarks:?}");
    let (_, remarks) = surfaces(organs(60.0), &Options::default());
    let says = "organs reach out of the body: `spleen` with ";
    assert!(remarks.len() == 1 && remarks[0].starts_with(says), "{remarks:?}");
}

#[test]
fn a_layer_that_the_body_makes_itself_is_left_out_and_said() {
    let table = ClassTable::builtin("total-v2").unwrap();
    let organ =
        |name: &str, mesh: Mesh| OrganMesh { name: name.to_owned(), class: table.named(name).unwrap().clone(), mesh };
    let organs = || vec![organ("liver", ball(40.0)), organ("subcutaneous_fat", ball(90.0))];
    let (made, remarks) = surfaces([organs(), vec![organ("body", ball(100.0))]].concat(), &Options::default());
    assert_eq!(remarks, ["`subcutaneous_fat` is left out: the body makes its own layers"]);
    assert!(made.iter().all(|made| made.name != "subcutaneous_fat"));
    let (made, remarks) = surfaces(organs(), &Options::default());
    assert!(made.iter().any(|made| made.name == "subcutaneous_fat") && !remarks[0].contains("left out"), "{remarks:?}");
}

#[test]
fn a_surface_that_is_there_twice_becomes_one_and_a_wall_keeps_its_cavity() {
    let exact = f64::from(60.0f32).powi(3) * 4.0 / 3.0 * std::f64::consts::PI;
    let twice = analytic::joined([ball(60.0), ball(59.7)]);
    let (mesh, report) = repair("liver", twice, &RepairSettings::default());
    assert_eq!(report.count(ActionKind::Doubled), 1, "{report}");
    assert!((mesh.signed_volume_mm3() / exact - 1.0).abs() < 0.01);
    let (mesh, report) = repair("bladder", analytic::joined([ball(60.0), ball(50.0)]), &RepairSettings::default());
    assert_eq!((report.count(ActionKind::Doubled), report.count(ActionKind::Cavity)), (0, 1), "{report}");
    assert!((mesh.signed_volume_mm3() / exact - (1.0 - (50.0f64 / 60.0).powi(3))).abs() < 0.01);
}
