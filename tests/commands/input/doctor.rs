//! Tests of the scene check on scenes with one defect each. It names the defect with its surface and position. Sound
//! scenes have no findings.

use glam::{DVec3, Vec3};
use insonify::anatomy::analytic::{cuboid, joined, sphere};
use insonify::anatomy::doctor::{Defect, DoctorReport, Finding, Settings, Severity, examine};
use insonify::anatomy::import::FindingKind;
use insonify::anatomy::{Mesh, TissueTable};
use insonify::pose::Pose;
use serde_json::json;

use crate::input::builder::*;

/// A scene of surfaces, each with name, tissue, priority and mesh; coordinates in mm.
fn scene(surfaces: &[(&str, &str, i32, &Mesh)]) -> Builder {
    let mut b = Builder::empty();
    for (name, tissue, priority, mesh) in surfaces {
        let metres: Vec<_> = mesh.vertices_mm.iter().map(|v| (*v / 1000.0).to_array()).collect();
        let indices: Vec<u32> = mesh.triangles.iter().flatten().copied().collect();
        let (positions, indices) = (b.positions(&metres), b.indices(&indices, U32));
        let mesh = b.mesh(&[json!({"attributes": {"POSITION": positions}, "indices": indices})]);
        b.node(json!({"name": name, "mesh": mesh, "extras": {"tissue": tissue, "priority": priority}}));
    }
    b
}

fn examined(b: &Builder) -> DoctorReport {
    examined_from(b, None)
}

fn examined_from(b: &Builder, start: Option<(Pose, f64)>) -> DoctorReport {
    let (_dir, path) = file("scene.glb", &b.glb());
    let tissues = TissueTable::builtin().unwrap();
    examine(&path, &Settings { tissues: &tissues, own_tissues: &[], background: None, start }, &|_, _| {}).unwrap()
}

/// The only finding of a report, which must be `defect`.
fn only(report: &DoctorReport, defect: Defect) -> Finding {
    let found: Vec<_> = report.findings.iter().map(|f| (f.defect, f.to_string())).collect();
    assert_eq!(found.len(), 1, "{defect:?}: {found:?}");
    assert_eq!(found[0].0, defect, "{found:?}");
    let finding = report.findings[0].clone();
    assert!(!finding.remedy.is_empty() && finding.severity == defect.severity() || defect == Defect::NonManifold);
    finding
}

/// Finding on `mesh`, the defective surface `organ` next to a sound ball.
fn of_organ(mesh: &Mesh, defect: Defect) -> Finding {
    let sound = sphere(Vec3::new(200.0, 0.0, 0.0), 20.0, 2);
    let report = examined(&scene(&[("sound", "kidney", 0, &sound), ("organ", "liver", 0, mesh)]));
    let finding = only(&report, defect);
    assert_eq!((finding.surface.as_deref(), finding.tissue.as_deref()), (Some("organ"), Some("liver")));
    finding
}

fn ball() -> Mesh {
    sphere(Vec3::new(10.0, 20.0, 30.0), 20.0, 3)
}

fn near(finding: &Finding, place: [f32; 3], within_mm: f32) {
    let at = Vec3::from(finding.regions[0].at_mm);
    assert!(at.distance(place.into()) <= within_mm, "{finding}");
}

/// The mesh without the triangles whose three corners are all within `radius_mm` of the point `at`.
fn holed(mesh: &Mesh, at: Vec3, radius_mm: f32) -> Mesh {
    let mut mesh = mesh.clone();
    let vertices = mesh.vertices_mm.clone();
    mesh.triangles.retain(|t| !t.iter().all(|&i| vertices[i as usize].distance(at) < radius_mm));
    mesh
}

#[test]
fn sound_scenes_have_no_findings() {
    let outer = cuboid(Vec3::splat(-50.0), Vec3::splat(50.0));
    // A shell: a cavity faces into itself. It contains an island.
    let mut cavity = sphere(Vec3::ZERO, 20.0, 3);
    cavity.flip();
    let shell = joined([sphere(Vec3::ZERO, 30.0, 3), cavity, sphere(Vec3::ZERO, 8.0, 2)]);
    let touching = cuboid(Vec3::new(50.0, -50.0, -50.0), Vec3::new(80.0, 50.0, 50.0));
    let report = examined(&scene(&[
        ("box", "muscle", 0, &outer),
        ("shell", "liver", 1, &shell),
        ("beside", "fat", 0, &touching),
        ("stone", "gallstone", 2, &sphere(Vec3::new(0.0, 0.0, 25.0), 3.0, 2)),
    ]));
    assert_eq!(report.findings, [], "{:#?}", report.findings);
    assert_eq!((report.surfaces, report.bounds_mm.unwrap()), (4, [[-50.0; 3], [80.0, 50.0, 50.0]]));
    let builtin = TissueTable::builtin().unwrap();
    for name in
        ["bone_plate", "gallbladder_stones", "lung_air", "qa_phantom", "slabs", "speckle_block", "vessel_needle"]
    {
        let path = format!("{}/assets/scenes/{name}.glb", env!("CARGO_MANIFEST_DIR"));
        let settings = Settings { tissues: &builtin, own_tissues: &[], background: None, start: None };
        let report = examine(path.as_ref(), &settings, &|_, _| {}).unwrap();
        assert_eq!(report.findings, [], "{name}");
    }
}

#[test]
fn a_hole_is_named_with_its_place_and_size() {
    let top = Vec3::new(10.0, 20.0, 50.0);
    let finding = of_organ(&holed(&ball(), top, 6.0), Defect::Open);
    near(&finding, [10.0, 20.0, 50.0], 2.0);
    assert!((5.0..20.0).contains(&finding.regions[0].size_mm), "{finding}");
    assert!(finding.to_string().starts_with("`organ` (liver): not closed: ") && finding.what.contains("about 1 holes"));
    let two = holed(&holed(&ball(), top, 6.0), Vec3::new(10.0, 20.0, 10.0), 9.0);
    let finding = of_organ(&two, Defect::Open);
    assert_eq!(finding.regions.len(), 2);
    near(&finding, [10.0, 20.0, 10.0], 2.0);
}

#[test]
fn rims_that_only_nearly_meet_are_not_welded() {
    // The upper half is displaced by a µm: seams of Blender and CAD programs.
    let mut mesh = ball();
    let count = mesh.vertices_mm.len() as u32;
    let copies: Vec<Vec3> = mesh.vertices_mm.iter().map(|v| *v + Vec3::splat(0.001)).collect();
    let above = |t: &[u32; 3]| t.iter().any(|&i| copies[i as usize].z > 30.5);
    for t in &mut mesh.triangles {
        if above(t) {
            *t = t.map(|i| i + count);
        }
    }
    mesh.vertices_mm.extend(&copies);
    let finding = of_organ(&mesh, Defect::Unwelded);
    near(&finding, [10.0, 20.0, 30.0], 4.0);
}

#[test]
fn edges_of_three_triangles_are_named() {
    let mut mesh = ball();
    let [a, b, _] = mesh.triangles[0];
    // A fin with front and back, so that only its root is non-manifold.
    let tip = mesh.vertices_mm.len() as u32;
    let at = mesh.vertices_mm[a as usize];
    mesh.vertices_mm.push(Vec3::new(10.0, 20.0, 30.0) + (at - Vec3::new(10.0, 20.0, 30.0)) * 1.3);
    mesh.triangles.push([a, b, tip]);
    let sound = sphere(Vec3::new(200.0, 0.0, 0.0), 20.0, 2);
    let report = examined(&scene(&[("sound", "kidney", 0, &sound), ("organ", "liver", 0, &mesh)]));
    let non_manifold = report.findings.iter().find(|f| f.defect == Defect::NonManifold).unwrap();
    assert_eq!((non_manifold.severity, non_manifold.surface.as_deref()), (Severity::Error, Some("organ")));
    assert!(Vec3::from(non_manifold.regions[0].at_mm).distance(at) < 6.0, "{non_manifold}");
    // Two boxes that share an edge have a clear inside.
    let two = joined([
        cuboid(Vec3::ZERO, Vec3::splat(10.0)),
        cuboid(Vec3::new(10.0, 10.0, 0.0), Vec3::new(20.0, 20.0, 10.0)),
    ]);
    let finding = of_organ(&two, Defect::NonManifold);
    assert_eq!(finding.severity, Severity::Warning);
    near(&finding, [10.0, 10.0, 5.0], 1e-3);
}

#[test]
fn wrong_orientation_is_named_for_surfaces_parts_and_triangles() {
    let mut inward = ball();
    inward.flip();
    of_organ(&inward, Defect::Inverted);

    let mut other = sphere(Vec3::new(80.0, 0.0, 0.0), 10.0, 2);
    other.flip();
    let finding = of_organ(&joined([ball(), other]), Defect::MixedOrientation);
    near(&finding, [80.0, 0.0, 0.0], 1.0);

    let inside = joined([ball(), sphere(Vec3::new(10.0, 20.0, 35.0), 5.0, 2)]);
    near(&of_organ(&inside, Defect::NestedPart), [10.0, 20.0, 35.0], 1.0);

    let mut turned = ball();
    let at = turned.vertices_mm[turned.triangles[7][0] as usize];
    turned.triangles[7].swap(0, 1);
    near(&of_organ(&turned, Defect::MixedOrientation), at.to_array(), 6.0);
}

#[test]
fn zero_area_triangles_copies_and_sheets_are_named() {
    let mut mesh = ball();
    let [a, b, _] = mesh.triangles[5];
    mesh.triangles.push([a, b, b]);
    let finding = of_organ(&mesh, Defect::Degenerate);
    near(&finding, mesh.vertices_mm[a as usize].to_array(), 6.0);

    let mut twice = ball();
    twice.triangles.push(twice.triangles[9]);
    let at = twice.vertices_mm[twice.triangles[9][0] as usize];
    near(&of_organ(&twice, Defect::Duplicate), at.to_array(), 6.0);

    // The same face front and back.
    let mut card = cuboid(Vec3::ZERO, Vec3::splat(10.0));
    card.triangles.truncate(2);
    let mut back = card.clone();
    back.flip();
    of_organ(&joined([card, back]), Defect::ThinSheet);
    let thin = cuboid(Vec3::ZERO, Vec3::new(40.0, 40.0, 0.0005));
    let finding = of_organ(&thin, Defect::ThinSheet);
    near(&finding, [20.0, 20.0, 0.0], 10.0);
}

#[test]
fn slivers_are_noted() {
    let mut mesh = cuboid(Vec3::ZERO, Vec3::splat(20.0));
    // A needle along an edge: the edge's two triangles and the needle's two stay closed.
    let [a, b, c] = mesh.triangles[0];
    let at = |i: u32| mesh.vertices_mm[i as usize];
    let middle = 0.5 * (at(a) + at(b)) + (at(c) - 0.5 * (at(a) + at(b))).normalize() * 2e-5;
    let new = mesh.vertices_mm.len() as u32;
    mesh.vertices_mm.push(middle);
    mesh.triangles[0] = [a, b, new];
    mesh.triangles.extend([[b, c, new], [c, a, new]]);
    let finding = of_organ(&mesh, Defect::Sliver);
    assert_eq!(finding.severity, Severity::Note);
}

#[test]
fn parts_that_intersect_are_named() {
    let two = joined([ball(), sphere(Vec3::new(35.0, 20.0, 30.0), 15.0, 3)]);
    let sound = sphere(Vec3::new(200.0, 0.0, 0.0), 20.0, 2);
    let report = examined(&scene(&[("sound", "kidney", 0, &sound), ("organ", "liver", 0, &two)]));
    let finding = only(&report, Defect::SelfIntersection);
    assert_eq!(finding.surface.as_deref(), Some("organ"));
    let ring = finding.regions[0];
    // The spheres meet in a circle of 23 mm at x = 26 mm.
    assert!((ring.at_mm[0] - 26.0).abs() < 1.5 && (20.0..40.0).contains(&ring.size_mm), "{finding}");
}

#[test]
fn unusable_coordinates_are_named() {
    let nan = |value: f32| {
        let mut mesh = ball();
        mesh.vertices_mm[3].y = value;
        of_organ(&mesh, Defect::BadCoordinates)
    };
    assert!(nan(f32::NAN).what.contains("vertex 3 is ["));
    assert!(nan(200_000.0).what.contains("vertex 3 is ["), "one stray vertex is no wrong unit");
    assert!(nan(f32::INFINITY).what.contains("1 vertices are not finite"));
}

#[test]
fn wrong_units_and_distant_scenes_are_named() {
    let scaled = |factor: f32, by: Vec3| {
        let mut mesh = ball();
        mesh.vertices_mm.iter_mut().for_each(|v| *v = *v * factor + by);
        examined(&scene(&[("organ", "liver", 0, &mesh)]))
    };
    assert_eq!(scaled(1.0, Vec3::ZERO).findings, []);
    for (factor, words) in [
        (1000.0, "m across: 1000 times too large"),
        (0.001, "mm across: 1000 times too small"),
        (1e6, "km across"),
        (1e-6, "mm across"),
    ] {
        let what = only(&scaled(factor, Vec3::ZERO), Defect::WrongUnit).what;
        // A factor of 1000 is named where it would help.
        assert!(what.contains(words) && what.contains("1000 times") == words.contains("1000 times"), "{what}");
    }
    let finding = only(&scaled(1.0, Vec3::new(5000.0, 0.0, 0.0)), Defect::FarFromOrigin);
    assert!((finding.regions[0].at_mm[0] - 5010.0).abs() < 1.0);
    assert!(finding.what.contains("mm from the origin"), "{finding}");
}

#[test]
fn missing_and_misspelt_tissues_are_named() {
    let sound = ball();
    let mut b = scene(&[("organ", "livr", 0, &sound)]);
    let finding = only(&examined(&b), Defect::UnknownTissue);
    assert!(finding.what.contains("`livr` (did you mean `liver`?)") && finding.surface.as_deref() == Some("organ"));
    b.root["nodes"][0]["extras"] = json!({});
    assert_eq!(only(&examined(&b), Defect::NoTissue).surface.as_deref(), Some("organ"));
    let (_dir, path) = file("scene.glb", &scene(&[("organ", "liver", 0, &sound)]).glb());
    let tissues = TissueTable::builtin().unwrap();
    let settings = Settings { tissues: &tissues, own_tissues: &["steel".to_owned()], background: None, start: None };
    let report = examine(&path, &settings, &|_, _| {}).unwrap();
    assert!(only(&report, Defect::UnusedTissue).what.contains("`steel`"));
}

#[test]
fn overlaps_of_equal_priority_and_hidden_surfaces_are_named() {
    let (low, high) = (cuboid(Vec3::ZERO, Vec3::splat(40.0)), cuboid(Vec3::splat(20.0), Vec3::splat(60.0)));
    let finding = only(&examined(&scene(&[("a", "liver", 3, &low), ("b", "fat", 3, &high)])), Defect::PriorityTie);
    assert!(finding.surface.as_deref() == Some("a") && finding.what.contains("overlaps `b`"), "{finding}");
    near(&finding, [30.0; 3], 12.0);
    assert_eq!(examined(&scene(&[("a", "liver", 3, &low), ("b", "fat", 4, &high)])).findings, []);
    assert_eq!(examined(&scene(&[("a", "liver", 3, &low), ("b", "liver", 3, &high)])).findings, []);

    let inner = sphere(Vec3::splat(20.0), 5.0, 2);
    let report = examined(&scene(&[("cyst", "bile", 1, &inner), ("body", "liver", 2, &low)]));
    let finding = only(&report, Defect::Hidden);
    assert!(finding.surface.as_deref() == Some("cyst") && finding.what.contains("behind `body`"), "{finding}");
    near(&finding, [20.0; 3], 0.1);
    assert_eq!(examined(&scene(&[("cyst", "bile", 2, &inner), ("body", "liver", 1, &low)])).findings, []);
}

#[test]
fn skipped_and_refused_content_is_listed_completely() {
    let mut b = scene(&[("organ", "liver", 0, &ball()), ("wire", "steel", 0, &ball()), ("bad", "fat", 0, &ball())]);
    b.root["meshes"][1]["primitives"][0]["mode"] = json!(1);
    b.root["nodes"][2]["extras"] = json!({"tissue": 3, "priority": "high"});
    let flat = b.positions(&[[0.0; 3]; 3]);
    let mesh = b.mesh(&[json!({"attributes": {"POSITION": flat}})]);
    b.node(json!({"name": "point", "mesh": mesh, "extras": {"tissue": "fat"}}));
    let index = b.indices(&[0, 1, 99_999], U32);
    let mesh = b.mesh(&[json!({"attributes": {"POSITION": flat}, "indices": index})]);
    b.node(json!({"name": "beyond", "mesh": mesh, "extras": {"tissue": "fat"}}));
    let report = examined(&b);
    let defects: Vec<_> = report.findings.iter().map(|f| f.defect).collect();
    for defect in [Defect::NotTriangles, Defect::Refused, Defect::NoTissue, Defect::Empty, Defect::Unreadable] {
        assert!(defects.contains(&defect), "{defect:?} in {:#?}", report.findings);
    }
    assert_eq!(defects.iter().filter(|d| **d == Defect::Refused).count(), 2);
    assert!(report.findings.is_sorted_by_key(|f| f.severity), "the worst first");
    assert_eq!(report.count(Severity::Error), 4, "{:#?}", report.findings);

    let mut b = Builder::empty();
    b.node(json!({"name": "nothing"}));
    only(&examined(&b), Defect::EmptyScene);
    let mut many = Builder::tetrahedron();
    let node = |i: usize| json!({"mesh": 0, "extras": {"tissue": "liver"}, "translation": [0.005 * i as f64, 0, 0]});
    many.root["nodes"] = (0..257).map(node).collect();
    only(&examined(&many), Defect::TooManySurfaces);
}

#[test]
fn the_probes_start_in_bone_or_far_away_is_named() {
    let bone = scene(&[("rib", "bone_adult", 0, &ball())]);
    let at = |x: f64| {
        let pose = Pose { position_mm: DVec3::new(x, 20.0, 30.0), orientation: glam::DQuat::IDENTITY };
        Some((pose, 150.0))
    };
    assert_eq!(examined_from(&bone, at(-20.0)).findings, []);
    let finding = only(&examined_from(&bone, at(10.0)), Defect::StartsInside);
    assert!(finding.surface.as_deref() == Some("rib") && finding.what.contains("bone"));
    assert!(only(&examined_from(&bone, at(-400.0)), Defect::StartsFar).what.contains("390 mm from the scene"));
}

#[test]
fn a_start_in_a_gas_background_is_named() {
    let (_dir, path) = file("scene.glb", &scene(&[("organ", "liver", 0, &ball())]).glb());
    let tissues = TissueTable::builtin().unwrap();
    let pose = Pose { position_mm: DVec3::new(-30.0, 20.0, 30.0), orientation: glam::DQuat::IDENTITY };
    let in_background = |name: &str| {
        let (background, start) = (tissues.index_of(name), Some((pose, 150.0)));
        assert!(background.is_some());
        examine(&path, &Settings { tissues: &tissues, own_tissues: &[], background, start }, &|_, _| {}).unwrap()
    };
    let finding = only(&in_background("air"), Defect::StartsInside);
    assert!(finding.surface.is_none() && finding.what.contains("the background `air`, which is gas"), "{finding}");
    assert_eq!(in_background("gel").findings, []);
}

#[test]
fn finely_meshed_parts_overlap_however_shallow_their_crossings() {
    let two = joined([sphere(Vec3::ZERO, 2.5, 5), sphere(Vec3::new(2.5, 0.1, 0.05), 2.5, 5)]);
    let finding = of_organ(&two, Defect::SelfIntersection);
    near(&finding, [1.25, 0.05, 0.025], 0.2);
    assert!((3.5..6.5).contains(&finding.regions[0].size_mm), "a ring of 4.3 mm: {finding}");
}

#[test]
fn zero_area_triangles_close_t_junctions() {
    let mut mesh = cuboid(Vec3::ZERO, Vec3::splat(20.0));
    let [a, b, c] = mesh.triangles[0];
    let middle = 0.5 * (mesh.vertices_mm[a as usize] + mesh.vertices_mm[b as usize]);
    let m = mesh.vertices_mm.len() as u32;
    mesh.vertices_mm.push(middle);
    mesh.triangles[0] = [a, m, c];
    mesh.triangles.push([m, b, c]);
    let junction = mesh.clone();
    mesh.triangles.push([a, b, m]);
    of_organ(&mesh, Defect::Degenerate);
    of_organ(&junction, Defect::Open);
    // Nor do they open a surface that is closed without them.
    let mut spare = cuboid(Vec3::ZERO, Vec3::splat(20.0));
    spare.vertices_mm.push(middle);
    spare.triangles.push([a, b, m]);
    of_organ(&spare, Defect::Degenerate);

    let kinds = |mesh: &Mesh| {
        let (scene, findings) = scene(&[("organ", "liver", 0, mesh)]).load().unwrap();
        let volume = scene.surfaces[0].mesh.signed_volume_mm3();
        assert!((volume - 8000.0).abs() < 0.1, "outward: {volume}");
        findings.into_iter().map(|f| f.kind).collect::<Vec<_>>()
    };
    let flat = FindingKind::Degenerate { triangles: 1 };
    assert_eq!((kinds(&mesh), kinds(&spare)), (vec![flat], vec![flat]));
    mesh.flip();
    assert_eq!(kinds(&mesh), [flat, FindingKind::InsideOut]);
}

#[test]
fn an_inverted_surface_is_examined_as_it_will_be_loaded() {
    let mut cyst = sphere(Vec3::splat(20.0), 5.0, 2);
    cyst.flip();
    let body = cuboid(Vec3::ZERO, Vec3::splat(40.0));
    let report = examined(&scene(&[("cyst", "bile", 1, &cyst), ("body", "liver", 2, &body)]));
    let found: Vec<_> = report.findings.iter().map(|f| (f.defect, f.surface.as_deref())).collect();
    assert_eq!(found, [(Defect::Inverted, Some("cyst")), (Defect::Hidden, Some("cyst"))]);
}

/// Report on a ball of liver that has one material above `from_z_mm` and another below.
fn of_two_materials(mesh: &Mesh, from_z_mm: f32) -> DoctorReport {
    let mut b = Builder::empty();
    let metres: Vec<_> = mesh.vertices_mm.iter().map(|v| (*v / 1000.0).to_array()).collect();
    let positions = b.positions(&metres);
    let is_above = |t: &&[u32; 3]| t.iter().all(|&i| mesh.vertices_mm[i as usize].z > from_z_mm);
    let (above, below): (Vec<_>, Vec<_>) = mesh.triangles.iter().partition(is_above);
    let primitives = [above, below].map(|triangles: Vec<&[u32; 3]>| {
        let indices: Vec<u32> = triangles.into_iter().flatten().copied().collect();
        let indices = b.indices(&indices, U32);
        json!({"attributes": {"POSITION": positions}, "indices": indices})
    });
    let mesh = b.mesh(&primitives);
    b.node(json!({"name": "organ", "mesh": mesh, "extras": {"tissue": "liver"}}));
    examined(&b)
}

#[test]
fn an_object_of_two_materials_is_not_a_hole() {
    let found = |report: &DoctorReport| -> Vec<_> {
        report.findings.iter().map(|f| (f.defect, f.surface.clone().unwrap())).collect()
    };
    let (upper, lower) = ("organ/0".to_owned(), "organ/1".to_owned());
    let report = of_two_materials(&ball(), 30.0);
    let split = Defect::SplitByMaterial;
    assert_eq!(found(&report), [(split, upper.clone()), (split, lower.clone())], "{:#?}", report.findings);
    assert!(report.findings[0].remedy.contains("one material"));
    // With an additional hole in the lower half.
    let report = of_two_materials(&holed(&ball(), Vec3::new(10.0, 20.0, 10.0), 6.0), 30.0);
    assert_eq!(found(&report), [(split, upper), (Defect::Open, lower.clone()), (split, lower)]);
}

#[test]
fn a_slight_contact_of_two_surfaces_is_not_a_tie() {
    let a = sphere(Vec3::ZERO, 20.0, 4);
    let corners = a.triangles[0].map(|i| a.vertices_mm[i as usize]);
    let centroid = (corners[0] + corners[1] + corners[2]) / 3.0;
    // The other one is mirrored at a point 0.015 mm below the first's triangle: they overlap by 0.03 mm there.
    let point = centroid - centroid.normalize() * 0.015;
    let mut b = a.clone();
    b.vertices_mm.iter_mut().for_each(|v| *v = 2.0 * point - *v);
    b.flip();
    assert_eq!(examined(&scene(&[("a", "liver", 3, &a), ("b", "fat", 3, &b)])).findings, []);
}

#[test]
fn a_wall_between_joined_boxes_is_not_a_sheet() {
    let left = cuboid(Vec3::ZERO, Vec3::splat(10.0));
    let mut right = left.clone();
    right.vertices_mm.iter_mut().for_each(|v| v.x = 20.0 - v.x);
    right.flip();
    let finding = of_organ(&joined([left, right]), Defect::NonManifold);
    assert!(finding.severity == Severity::Warning && finding.what.contains("a wall between"), "{finding}");
    assert!(finding.remedy.contains("delete inner faces"));
    near(&finding, [10.0, 5.0, 5.0], 1e-3);
}

#[test]
fn crumbs_that_face_the_wrong_way_are_not_an_error() {
    let mut crumb = sphere(Vec3::new(10.0, 20.0, 60.0), 0.3, 1);
    crumb.flip();
    let inside = sphere(Vec3::new(10.0, 20.0, 30.0), 0.3, 1);
    for (crumb, defect) in [(crumb, Defect::MixedOrientation), (inside, Defect::NestedPart)] {
        let report = examined(&scene(&[("organ", "liver", 0, &joined([ball(), crumb]))]));
        let found: Vec<_> = report.findings.iter().map(|f| (f.defect, f.severity)).collect();
        assert_eq!(found, [(defect, Severity::Warning)], "{:?}", report.findings);
        assert!(report.findings[0].what.contains("crumbs"), "{}", report.findings[0]);
    }
}

#[test]
fn files_that_are_not_gltf_are_errors() {
    let (_dir, path) = file("scene.glb", b"glTF");
    let tissues = TissueTable::builtin().unwrap();
    let settings = Settings { tissues: &tissues, own_tissues: &[], background: None, start: None };
    assert!(examine(&path, &settings, &|_, _| {}).is_err());
}
