//! The phantom over its range of parameters: sizes on the mesh, landmarks on the organs, clearance of the fetus.

#![allow(clippy::unwrap_used)]

use glam::{DVec3, Vec3};
use insonify_core::anatomy::ray::intersect;
use insonify_core::anatomy::sdf::Solid;
use rayon::prelude::*;

use super::meshing::mesh;
use super::*;

fn at_weeks(weeks: f64) -> Parameters {
    Parameters { gestational_weeks: weeks, ..Parameters::default() }
}

fn fetus(parameters: &Parameters) -> Vec<Organ> {
    fetus::organs(&Attitude::of(parameters))
}

fn solid(organs: &[Organ], name: &str) -> Solid {
    organs.iter().find(|o| o.name == name).unwrap().solid.clone()
}

/// Distance from `from` along the unit `direction` to the first crossing with `mesh`, mm.
pub(super) fn cast(mesh: &insonify_core::anatomy::Mesh, from: Vec3, direction: Vec3) -> f32 {
    let (from, direction) = (from.as_dvec3(), direction.as_dvec3());
    let hits = mesh.corners_mm().filter_map(|corners| intersect(corners, 0.0, from, direction));
    hits.map(|(t, _)| t).filter(|&t| t > 0.0).fold(f64::INFINITY, f64::min) as f32
}

fn circumference(mesh: &insonify_core::anatomy::Mesh, centre: Vec3, u: Vec3, v: Vec3) -> f32 {
    const RAYS: usize = 120;
    let points: Vec<Vec3> = (0..RAYS)
        .map(|i| {
            let (sin, cos) = (std::f32::consts::TAU * i as f32 / RAYS as f32).sin_cos();
            let direction = u * cos + v * sin;
            centre + direction * cast(mesh, centre, direction)
        })
        .collect();
    (0..RAYS).map(|i| points[i].distance(points[(i + 1) % RAYS])).sum()
}

#[track_caller]
fn assert_within(what: &str, weeks: f64, measured: f32, expected: f32, tolerance: f32) {
    let off = (measured / expected - 1.0).abs();
    assert!(off <= tolerance, "{what} at {weeks} weeks: {measured:.2} mm, expected {expected:.2} mm");
}

#[test]
fn meshes_have_the_tabulated_sizes() {
    for weeks in [16.0, 22.0, 28.0, 34.0] {
        let parameters = at_weeks(weeks);
        let (organs, l, b) = (fetus(&parameters), landmarks(&parameters), Biometry::at_weeks(weeks));
        let cell = b.trunk_scale();
        let [skull, inner, cerebellum, skin, bones] =
            ["skull", "subarachnoid_space", "cerebellum", "fetal_skin", "long_bones"]
                .map(|name| mesh(&solid(&organs, name), cell * if name == "fetal_skin" { 2.0 } else { 1.0 }));
        let left = l.fetus_left;
        let near = cast(&skull, l.head_centre_mm, left);
        let far = cast(&inner, l.head_centre_mm, -left);
        assert_within("biparietal diameter", weeks, near + far, b.biparietal_mm, 0.02);
        assert_within("its callipers", weeks, l.biparietal_mm[0].distance(l.biparietal_mm[1]), near + far, 0.02);
        let long = cast(&skull, l.head_centre_mm, l.head_face) + cast(&skull, l.head_centre_mm, -l.head_face);
        assert_within("occipitofrontal diameter", weeks, long, b.occipitofrontal_mm, 0.02);
        let head = circumference(&skull, l.head_centre_mm, l.head_face, left);
        assert_within("head circumference", weeks, head, b.head_circumference_mm, 0.02);
        let across = l.abdomen_cranial.cross(l.abdomen_ventral);
        let abdomen = circumference(&skin, l.abdomen_centre_mm, l.abdomen_ventral, across);
        assert_within("abdominal circumference", weeks, abdomen, b.abdominal_circumference_mm, 0.02);
        let width = |p: &Vec3| (*p - l.head_centre_mm).dot(left);
        let (low, high) =
            cerebellum.vertices_mm.iter().map(width).fold((f32::MAX, f32::MIN), |(a, b), x| (a.min(x), b.max(x)));
        assert_within("cerebellum", weeks, high - low, b.cerebellum_mm, 0.03);
        for (tips, expected) in [
            (l.left_femur_mm, b.femur_mm),
            (l.right_femur_mm, b.femur_mm),
            (l.humeri_mm[0], b.humerus_mm),
            (l.tibiae_mm[1], b.tibia_mm),
        ] {
            let axis = (tips[1] - tips[0]).normalize();
            let reach = 3.0 * b.leg_scale();
            let along = bones.vertices_mm.iter().filter_map(|&v| {
                let t = (v - tips[0]).dot(axis);
                let aside = (v - tips[0] - axis * t).length();
                (aside < 1.6 * b.arm_scale().min(b.leg_scale()) && t > -reach && t < expected + reach).then_some(t)
            });
            let (low, high) = along.fold((f32::MAX, f32::MIN), |(a, b), t| (a.min(t), b.max(t)));
            assert_within("long bone", weeks, high - low, expected, 0.02);
        }
    }
}

#[test]
fn callipers_end_on_the_structures_they_measure() {
    for weeks in [16.0, 22.0, 34.0] {
        let parameters = Parameters { seed: 3, ..at_weeks(weeks) };
        let (organs, l) = (fetus(&parameters), landmarks(&parameters));
        let on = |name: &str, points: &[Vec3]| {
            let solid = solid(&organs, name);
            for &p in points {
                let off = solid.distance_mm(p);
                assert!(off.abs() < 0.9, "{p}: {off:.2} mm off {name} at {weeks} weeks");
            }
        };
        on("skull", &[l.biparietal_mm[0], l.occipitofrontal_mm[0], l.occipitofrontal_mm[1]]);
        on("subarachnoid_space", &[l.biparietal_mm[1], l.cisterna_magna_mm[1]]);
        on("cerebellum", &l.cerebellum_mm);
        on("eyes", &l.eye_borders_mm);
        on("ventricles", &[l.atria_mm[0][1], l.atria_mm[1][1]]);
        on("fetal_skin", &[l.nose_tip_mm, l.chin_mm, l.abdomen_axes_mm[1], l.cord_insertion_mm]);
        on("kidneys", &[l.kidneys_mm[0][1], l.kidneys_mm[1][2]]);
        on("long_bones", &[l.humeri_mm[0][0], l.humeri_mm[1][1], l.tibiae_mm[0][0], l.left_femur_mm[1]]);
        let within = |name: &str, points: &[Vec3]| {
            let solid = solid(&organs, name);
            assert!(points.iter().all(|&p| solid.distance_mm(p) < 0.0), "outside {name} at {weeks} weeks");
        };
        within("ventricles", &[l.cavum_mm]);
        within("heart_chambers", &l.heart_chambers_mm);
        within("heart", &[l.heart_crux_mm]);
        within("fetal_vessels", &[l.aorta_mm[0], l.aorta_mm[1], l.portal_sinus_mm]);
        within("vertebrae", l.ossification_centres_mm.as_flattened());
        within("stomach", &[l.stomach_mm]);
        within("fetal_bladder", &[l.fetal_bladder_mm]);
        assert!(l.atria_mm[0][0].distance(l.atria_mm[0][1]) < 10.0);
    }
}

#[test]
fn the_fetus_fits_the_cavity() {
    let mut cases = Vec::new();
    for (i, weeks) in [16.0, 22.0, 28.0, 34.0].into_iter().enumerate() {
        for (k, lie) in Lie::ALL.into_iter().enumerate() {
            for (m, roll_deg) in [0.0, 90.0, -90.0, 180.0].into_iter().enumerate() {
                // Each flexion and each fluid index occurs with every age, with every lie and with every roll.
                let turn = i + 2 * k + m;
                cases.push(Parameters {
                    gestational_weeks: weeks,
                    lie,
                    roll_deg,
                    flexion: [0.0, 0.5, 1.0][turn % 3],
                    fluid_index_mm: [50.0, 140.0, 80.0, 250.0][(turn / 2) % 4],
                    placenta: [PlacentaSite::Anterior, PlacentaSite::Posterior, PlacentaSite::Left][(turn + k) % 3],
                    seed: turn as u64,
                    ..Parameters::default()
                });
            }
        }
    }
    let faults: Vec<String> = cases
        .par_iter()
        .filter_map(|parameters| {
            let skin = solid(&fetus(parameters), "fetal_skin");
            let cavity = mother::cavity(parameters);
            let skin = mesh(&skin, 4.0 * Biometry::at_weeks(parameters.gestational_weeks).trunk_scale());
            let least = skin.vertices_mm.iter().map(|&v| -cavity.distance_mm(v)).fold(f32::MAX, f32::min);
            (least < 0.3).then(|| format!("{least:.2} mm of fluid: {parameters:?}"))
        })
        .collect();
    assert!(faults.is_empty(), "{} of {}: {faults:#?}", faults.len(), cases.len());
}

#[test]
fn the_phantoms_belly_is_at_its_landmark() {
    let skin = skin(&Parameters::default());
    let top = landmarks(&Parameters::default()).belly_top_mm.as_dvec3();
    let exit = skin.exit(DVec3::ZERO, DVec3::Z).unwrap();
    assert!(exit.distance(top) < 0.5, "{exit}");
    assert_eq!(skin.exit(top + DVec3::Z * 5.0, DVec3::Z), None, "starts outside");
}
