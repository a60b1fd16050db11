//! Tests of the obstetric phantom's meshes, sizes, fit and file.

#![allow(clippy::unwrap_used, clippy::panic)]

use std::collections::HashMap;
use std::sync::OnceLock;

use glam::{DVec3, Vec3};
use insonify::anatomy::Mesh;
use insonify::anatomy::export::write_glb;
use insonify::anatomy::sdf::{Bounds, Solid};
use insonify::phantom::{
    Biometry, Body, FETUS_TRIANGLES, Lie, MOTHER_TRIANGLES, Organ, Parameters, PhantomError, PhantomOptions,
    PhantomSurface, build, cached, landmarks, organs,
};
use rayon::prelude::*;

/// Scale that is small enough to be fast; fine parts are then at their coarsest.
const SMALL: f64 = 0.3;

fn at_scale(scale: f64) -> PhantomOptions {
    PhantomOptions { scale, ..PhantomOptions::default() }
}

fn full() -> &'static [PhantomSurface] {
    static FULL: OnceLock<Vec<PhantomSurface>> = OnceLock::new();
    FULL.get_or_init(|| build(&PhantomOptions::default(), &|_| {}).unwrap())
}

fn small() -> &'static [PhantomSurface] {
    static SMALL_ONE: OnceLock<Vec<PhantomSurface>> = OnceLock::new();
    SMALL_ONE.get_or_init(|| build(&at_scale(SMALL), &|_| {}).unwrap())
}

fn organ_of(name: &str) -> Organ {
    organs(&Parameters::default()).into_iter().find(|o| o.name == name).unwrap()
}

fn mesh_of(name: &str) -> &'static Mesh {
    &full().iter().find(|s| s.name == name).unwrap().mesh
}

/// Number of directed edges that don't have exactly one opposite edge.
fn faulty_edges(mesh: &Mesh) -> usize {
    let mut edges: HashMap<[u32; 2], u32> = HashMap::new();
    for &[a, b, c] in &mesh.triangles {
        for edge in [[a, b], [b, c], [c, a]] {
            *edges.entry(edge).or_default() += 1;
        }
    }
    edges.iter().filter(|&(&[a, b], &count)| count != 1 || edges.get(&[b, a]) != Some(&1)).count()
}

/// Parameters of phantoms at the limits of their ranges.
fn extremes() -> Vec<Parameters> {
    let plain = Parameters::default();
    let lies = [Lie::Cephalic, Lie::Breech, Lie::TransverseHeadLeft, Lie::TransverseHeadRight];
    let mut all = vec![plain];
    for (n, fat) in [5.0, 20.0, 30.0, 45.0, 60.0, 60.0].into_iter().enumerate() {
        let weeks = [16.0, 19.5, 26.4, 34.0, 16.0, 34.0][n];
        let fluid = [50.0, 140.0, 250.0][n % 3];
        all.push(Parameters {
            gestational_weeks: weeks,
            maternal_fat_mm: fat,
            fluid_index_mm: fluid,
            lie: lies[n % 4],
            seed: 0x9e37_79b9 * n as u64,
            ..plain
        });
    }
    all
}

/// Smallest distance of `solid` on the sides of the box `room`, mm, and its position. It is sampled about every
/// `step_mm`.
fn least_distance_mm(solid: &Solid, room: Bounds, step_mm: f32) -> (f32, Vec3) {
    let size = room.size();
    let side = |axis: usize, end: usize| {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let [across, along] = [u, v].map(|i| (size[i] / step_mm).ceil() as u32);
        (0..=across).into_par_iter().flat_map_iter(move |i| {
            (0..=along).map(move |j| {
                let mut p = [room.min, room.max][end];
                p[u] = room.min[u] + size[u] * i as f32 / across as f32;
                p[v] = room.min[v] + size[v] * j as f32 / along as f32;
                (solid.distance_mm(p), p)
            })
        })
    };
    let nearer = |a: (f32, Vec3), b: (f32, Vec3)| if b.0 < a.0 { b } else { a };
    let far = || (f32::INFINITY, Vec3::ZERO);
    (0..6).map(|n| side(n / 2, n % 2).reduce(far, nearer)).fold(far(), nearer)
}

#[test]
fn no_solid_extends_out_of_its_box() {
    let mut out = Vec::new();
    for parameters in extremes() {
        for organ in organs(&parameters) {
            // The grid extends two and a half cells further: at its end, a surface would be cut open.
            let (least_mm, at) = least_distance_mm(&organ.solid, organ.solid.bounds().grown(1.5), 2.0);
            if least_mm <= 0.0 {
                out.push(format!("{} is {least_mm} mm at {at}: {parameters:?}", organ.name));
            }
        }
    }
    assert!(out.is_empty(), "{}", out.join("\n"));
}

#[test]
fn every_surface_is_closed_and_faces_outward() {
    // Thick fat has the longest lobules.
    let thick = Parameters { maternal_fat_mm: 30.0, gestational_weeks: 26.4, ..Parameters::default() };
    let thick = build(&PhantomOptions { scale: 0.5, parameters: thick }, &|_| {}).unwrap();
    for surface in full().iter().chain(small()).chain(&thick) {
        assert!(!surface.mesh.triangles.is_empty(), "{} is empty", surface.name);
        assert_eq!(faulty_edges(&surface.mesh), 0, "{} is open", surface.name);
        assert!(surface.mesh.signed_volume_mm3() > 0.0, "{} is inside out", surface.name);
    }
}

#[test]
fn vertices_are_on_the_modelled_surfaces() {
    let solids: HashMap<&str, Organ> = organs(&Parameters::default()).into_iter().map(|o| (o.name, o)).collect();
    for surface in full() {
        let solid = &solids[surface.name.as_str()].solid;
        let off = surface.mesh.vertices_mm.iter().filter(|&&v| solid.distance_mm(v).abs() > 0.02).count();
        assert!(off <= 4.max(surface.mesh.vertices_mm.len() / 500), "{off} vertices of {} are off", surface.name);
    }
}

#[test]
fn volumes_of_meshes_match_solids_at_both_scales() {
    let mut off = Vec::new();
    assert_eq!(full().len(), small().len());
    for (fine, coarse) in full().iter().zip(small()) {
        assert_eq!(fine.name, coarse.name);
        let (a, b) = (fine.mesh.signed_volume_mm3(), coarse.mesh.signed_volume_mm3());
        // Coarse meshes cut corners, mostly where an organ is about a cell thick.
        if !(0.55..1.15).contains(&(b / a)) {
            off.push(format!("{}: {a:.0} mm³ fine, {b:.0} mm³ coarse", fine.name));
        }
    }
    assert!(off.is_empty(), "{off:?}");
}

#[test]
fn budgets_are_met() {
    let fetal: HashMap<&str, Body> = organs(&Parameters::default()).iter().map(|o| (o.name, o.body)).collect();
    for (surfaces, scale) in [(full(), 1.0), (small(), SMALL)] {
        for (body, budget) in [(Body::Fetus, FETUS_TRIANGLES), (Body::Mother, MOTHER_TRIANGLES)] {
            let own = surfaces.iter().filter(|s| fetal[s.name.as_str()] == body);
            let count: usize = own.map(|s| s.mesh.triangles.len()).sum();
            let ratio = count as f64 / (budget as f64 * scale);
            assert!((0.98..=1.02).contains(&ratio), "{body:?} at {scale}: {count} triangles, {ratio:.3} of the budget");
        }
    }
}

#[test]
fn surfaces_fit_a_scene() {
    let surfaces = full();
    assert!(surfaces.len() <= 160, "{} surfaces", surfaces.len());
    let mut names: Vec<&str> = surfaces.iter().map(|s| s.name.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), surfaces.len(), "names are unique");
    assert!(surfaces.is_sorted_by_key(|s| s.priority));
}

#[test]
fn two_builds_give_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let [a, b] = ["a.glb", "b.glb"].map(|name| folder.path().join(name));
    write_glb(small(), &a).unwrap();
    write_glb(&build(&at_scale(SMALL), &|_| {}).unwrap(), &b).unwrap();
    assert!(std::fs::read(a).unwrap() == std::fs::read(b).unwrap());
}

#[test]
fn the_cache_builds_once() {
    let folder = tempfile::tempdir().unwrap();
    let inner = folder.path().join("new/folder");
    let steps = std::sync::atomic::AtomicUsize::new(0);
    let count = |p: insonify::phantom::Progress| {
        assert!(p.done >= 1 && p.done <= p.total);
        steps.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
    };
    let first = cached(&inner, &at_scale(SMALL), &count).unwrap();
    let after_first = steps.load(std::sync::atomic::Ordering::Relaxed);
    assert_eq!(after_first, 2 * full().len());
    assert_eq!(cached(&inner, &at_scale(SMALL), &count).unwrap(), first);
    assert_eq!(steps.load(std::sync::atomic::Ordering::Relaxed), after_first, "the second call builds nothing");
    assert_eq!(std::fs::read_dir(&inner).unwrap().count(), 1);
    assert!(gltf::Gltf::open(first).is_ok());
}

#[test]
fn scales_that_cannot_be_built_are_refused() {
    for scale in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e9] {
        assert!(matches!(build(&at_scale(scale), &|_| {}), Err(PhantomError::Scale { .. })));
    }
    let Err(PhantomError::ScaleTooSmall { least, .. }) = build(&at_scale(0.02), &|_| {}) else {
        panic!("fine parts need more")
    };
    assert!(least > 0.02 && least < SMALL, "least scale {least}");
}

/// Distance from `from` along `direction` to the first crossing with `mesh`, mm.
fn cast(mesh: &Mesh, from: Vec3, direction: Vec3) -> f64 {
    let (o, d) = (from.as_dvec3(), direction.as_dvec3().normalize());
    let hit = |[a, b, c]: [Vec3; 3]| {
        let (a, b, c) = (a.as_dvec3(), b.as_dvec3(), c.as_dvec3());
        let (e, f) = (b - a, c - a);
        let h = d.cross(f);
        let det = e.dot(h);
        if det.abs() < 1e-12 {
            return None;
        }
        let s: DVec3 = o - a;
        let u = s.dot(h) / det;
        let q = s.cross(e);
        let v = d.dot(q) / det;
        let t = f.dot(q) / det;
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 1e-9).then_some(t)
    };
    mesh.corners_mm().filter_map(hit).fold(f64::INFINITY, f64::min)
}

/// Circumference, mm, of the outline that rays from `centre` in the plane of `u` and `v` hit first.
fn circumference(mesh: &Mesh, centre: Vec3, u: Vec3, v: Vec3) -> f64 {
    const RAYS: usize = 180;
    let points: Vec<DVec3> = (0..RAYS)
        .map(|i| {
            let (sin, cos) = (std::f32::consts::TAU * i as f32 / RAYS as f32).sin_cos();
            let direction = u * cos + v * sin;
            centre.as_dvec3() + direction.as_dvec3() * cast(mesh, centre, direction)
        })
        .collect();
    (0..RAYS).map(|i| points[i].distance(points[(i + 1) % RAYS])).sum()
}

#[track_caller]
fn assert_within(what: &str, measured: f64, expected: f64, tolerance: f64) {
    let off = (measured / expected - 1.0).abs();
    assert!(off <= tolerance, "{what}: {measured:.2} mm, expected {expected:.2} mm");
}

#[test]
fn the_head_has_the_sizes_of_22_weeks() {
    let l = landmarks(&Parameters::default());
    let biometry = Biometry::default();
    let (skull, inner) = (mesh_of("skull"), mesh_of("subarachnoid_space"));
    // Outer table on the near side to the inner table on the far side.
    let near = cast(skull, l.head_centre_mm, l.fetus_left);
    let far = cast(inner, l.head_centre_mm, -l.fetus_left);
    assert_within("biparietal diameter", near + far, 54.0, 0.03);
    let long = cast(skull, l.head_centre_mm, l.head_face) + cast(skull, l.head_centre_mm, -l.head_face);
    assert_within("occipitofrontal diameter", long, f64::from(biometry.occipitofrontal_mm), 0.03);
    let head = circumference(skull, l.head_centre_mm, l.head_face, l.fetus_left);
    assert_within("head circumference", head, 200.0, 0.04);
}

#[test]
fn the_abdomen_has_the_size_of_22_weeks() {
    let l = landmarks(&Parameters::default());
    let across = l.abdomen_cranial.cross(l.abdomen_ventral);
    let around = circumference(mesh_of("fetal_skin"), l.abdomen_centre_mm, l.abdomen_ventral, across);
    assert_within("abdominal circumference", around, 175.0, 0.03);
}

#[test]
fn the_femurs_have_the_length_of_22_weeks() {
    let l = landmarks(&Parameters::default());
    let bones = mesh_of("long_bones");
    for [hip, knee] in [l.left_femur_mm, l.right_femur_mm] {
        let axis = (knee - hip).normalize();
        // Vertices about the shaft's line, up to a margin past the tips that no other bone reaches.
        let along = bones.vertices_mm.iter().filter_map(|&v| {
            let t = (v - hip).dot(axis);
            let aside = (v - hip - axis * t).length();
            (aside < 4.0 && t > -3.0 && t < hip.distance(knee) + 3.0).then_some(f64::from(t))
        });
        let (low, high) = along.fold((f64::MAX, f64::MIN), |(lo, hi), t| (lo.min(t), hi.max(t)));
        assert_within("femur", high - low, 39.0, 0.03);
    }
}

#[test]
fn the_fetus_floats_freely_in_the_cavity() {
    let (cavity, placenta) = (organ_of("amniotic_cavity"), organ_of("placenta"));
    for &v in &mesh_of("fetal_skin").vertices_mm {
        let to_wall = -cavity.solid.distance_mm(v);
        assert!(to_wall > 1.0, "{to_wall:.2} mm to the uterine wall at {v}");
        let to_placenta = placenta.solid.distance_mm(v);
        assert!(to_placenta > 0.5, "{to_placenta:.2} mm to the placenta at {v}");
    }
}

#[test]
fn fetal_organs_are_under_the_skin() {
    let skin = organ_of("fetal_skin").solid;
    let fetal: HashMap<&str, Body> = organs(&Parameters::default()).iter().map(|o| (o.name, o.body)).collect();
    let own = full().iter().filter(|s| fetal[s.name.as_str()] == Body::Fetus && s.name != "fetal_skin");
    for surface in own {
        for &v in &surface.mesh.vertices_mm {
            let depth = -skin.distance_mm(v);
            assert!(depth > 0.0, "{} sticks out by {:.2} mm at {v}", surface.name, -depth);
        }
    }
}

#[test]
fn the_cord_runs_from_the_placenta_to_the_navel_and_touches_little_else() {
    let (cavity, placenta, skin) =
        (organ_of("amniotic_cavity").solid, organ_of("placenta").solid, organ_of("fetal_skin").solid);
    let cord = mesh_of("cord");
    let inside = |solid: &insonify::anatomy::sdf::Solid| {
        cord.vertices_mm.iter().filter(|&&v| solid.distance_mm(v) < 0.0).count() as f64 / cord.vertices_mm.len() as f64
    };
    assert!(cord.vertices_mm.iter().all(|&v| cavity.distance_mm(v) < 0.0), "the cord leaves the cavity");
    assert!((0.002..0.1).contains(&inside(&placenta)), "{} of the cord is in the placenta", inside(&placenta));
    assert!((0.002..0.1).contains(&inside(&skin)), "{} of the cord is in the fetus", inside(&skin));
    // The belly contains the cord, the limbs don't: every vertex inside is near the navel.
    let l = landmarks(&Parameters::default());
    for &v in cord.vertices_mm.iter().filter(|&&v| skin.distance_mm(v) < -1.5) {
        let reach = v.distance(l.abdomen_centre_mm);
        assert!(reach < 40.0, "the cord runs through the fetus at {v}");
    }
}

#[test]
fn the_media_at_the_landmarks_are_the_organs_they_name() {
    let l = landmarks(&Parameters::default());
    let mut organs = organs(&Parameters::default());
    organs.sort_by_key(|o| o.priority);
    let tissue = |p: Vec3| organs.iter().rev().find(|o| o.solid.distance_mm(p) < 0.0).map(|o| o.tissue);
    assert_eq!(tissue(l.stomach_mm), Some("amniotic_fluid"));
    assert_eq!(tissue(l.fetal_bladder_mm), Some("urine"));
    assert_eq!(tissue(l.maternal_bladder_mm), Some("urine"));
    assert_eq!(tissue(l.placenta_centre_mm), Some("placenta"));
    assert!(matches!(tissue(l.heart_centre_mm), Some("heart" | "blood")));
    assert_eq!(tissue(0.5 * (l.left_femur_mm[0] + l.left_femur_mm[1])), Some("bone_fetal"));
    // The uppermost vertebra touches the skull's base, which has priority there.
    let spine = l.spine_mm.map(tissue);
    assert!(matches!(spine[0], Some("bone_fetal" | "calvaria_fetal")), "{spine:?}");
    assert!(spine[1..].iter().all(|&t| t == Some("bone_fetal")), "{spine:?}");
    // From the centre of the head to its left: brain, fluid, skull, soft tissue, skin, amniotic fluid.
    let mut met: Vec<&str> = Vec::new();
    for step in 0..500 {
        let here = tissue(l.head_centre_mm + l.fetus_left * (6.0 + 0.08 * step as f32)).unwrap();
        if met.last() != Some(&here) {
            met.push(here);
        }
    }
    let from = met.iter().rposition(|&t| t == "brain").unwrap();
    let outward = ["brain", "csf", "calvaria_fetal", "soft_tissue", "skin", "amniotic_fluid"];
    assert_eq!(met[from..from + 6], outward);
    assert_eq!(tissue(l.belly_top_mm - Vec3::Z), Some("skin"));
    assert_eq!(tissue(l.belly_top_mm + Vec3::Z), None);
}

#[test]
fn the_fat_of_the_belly_has_the_requested_thickness() {
    let asked = insonify::phantom::Parameters::default().maternal_fat_mm;
    let (fat, fascia) = (mesh_of("subcutaneous_fat"), mesh_of("abdominal_fascia"));
    let normal = organ_of("abdominal_fascia").solid;
    for (x, y) in [(0.0, 0.0), (30.0, 20.0), (-40.0, -30.0)] {
        let above = Vec3::new(x, y, 300.0);
        let on_fascia = above - Vec3::Z * cast(fascia, above, Vec3::NEG_Z) as f32;
        assert_within("fat", cast(fat, on_fascia, normal.normal(on_fascia)), asked, 0.03);
    }
}
