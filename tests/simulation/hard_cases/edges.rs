//! Hard cases of rays through edges and vertices, and of coplanar and touching surfaces.

use glam::{DQuat, DVec3, Quat, Vec3};
use insonify::anatomy::{Scene, Tissue, analytic};
use insonify::pose::Pose;
use insonify::render::ShaderSet;
use insonify::render::twin::Path;
use insonify::selftest::bench::{Bench, at, linear, silent, small};

use super::common::{ROUNDING, Tolerance, holds, patched, renderer, row, vector};
use insonify::random::SplitMix64;

fn ball() -> Scene {
    let mut bench = Bench::new(silent(1540.0, 1.5));
    let inner = bench.tissue(silent(1540.0, 1.6));
    bench.add(inner, 1, analytic::sphere(Vec3::new(1.3, -2.1, 0.7), 30.0, 3));
    bench.scene().unwrap()
}

/// Poses whose only ray passes through an edge point or a vertex of the ball.
fn aimed(scene: &Scene) -> Vec<Pose> {
    let mut random = SplitMix64::new(11);
    let mesh = &scene.surfaces[0].mesh;
    (0..400)
        .map(|i| {
            let [a, b, _] = mesh.triangles[(random.unit() * mesh.triangles.len() as f64) as usize];
            let [a, b] = [a, b].map(|v| mesh.vertices_mm[v as usize].as_dvec3());
            let target = if i % 4 == 0 { a } else { a.lerp(b, random.unit()) };
            let centre = DVec3::new(1.3, -2.1, 0.7);
            // Towards the inside, up to 60° off the normal.
            let inward = (centre - target).normalize();
            let direction = (inward + 0.9 * vector(&mut random)).normalize();
            let from = target - direction * random.between(40.0, 250.0);
            Pose::looking(from, direction, vector(&mut random))
        })
        .collect()
}

/// Number of wrong rays. A right one enters and leaves the ball, and ends outside it.
fn wrong(shaders: &ShaderSet) -> usize {
    let scene = ball();
    let mut renderer = renderer(&scene, &linear(1, 0.5, 16, 400.0), &small(1, 1), shaders);
    let wrong = |pose: &Pose| {
        let snapshot = renderer.snapshot(pose).unwrap();
        let tissues: Vec<_> = snapshot.sections.runs.iter().map(|run| run.last().map(|r| r.tissue)).collect();
        // Two changes of medium, and all rays that reach the far side are outside.
        snapshot.paths[0].segments.len() != 3 || tissues.iter().any(|t| *t != Some(0))
    };
    aimed(&scene)
        .iter()
        .filter({
            let mut wrong = wrong;
            move |pose| wrong(pose)
        })
        .count()
}

#[test]
fn rays_through_shared_edges_are_never_lost() {
    let tolerance = "let tolerance = w2.w * (abs(t0) + 100.0);";
    let mut naive = patched("trace", tolerance, "let tolerance = 0.0;");
    assert!(naive.replace("section", tolerance, "let tolerance = 0.0;"));
    let (naive, shipped) = (wrong(&naive), wrong(&ShaderSet::default()));
    assert!(naive > 0, "the naive test is not hard enough");
    assert_eq!(shipped, 0);
    row(
        "rays through edges and vertices of a closed ball",
        format!("{naive} of 400 slip through or stay inside"),
        "edges are moved outward by 2·10⁻⁷ of the distance plus 100 mm; hits within 1 µm count as coincident",
        "none".to_owned(),
    );
}

/// A box, or two that share a face, rotated so that no face is in a coordinate plane. The tissue of box i has
/// scatterers of mean i + 1 and density 0, by which segments of paths identify their medium.
fn boxes(count: usize, turned: Quat) -> Scene {
    let mut bench = Bench::new(silent(1540.0, 1.5));
    for (i, impedance) in [1.6, 1.7].into_iter().take(count).enumerate() {
        let tissue = bench.tissue(Tissue { scatterer_mean: i as f64 + 1.0, ..silent(1540.0, impedance) });
        let centre = turned * Vec3::new(0.0, 0.0, 20.0 + 20.0 * i as f32);
        bench.add(tissue, 1, analytic::plate(centre, Vec3::new(60.0, 60.0, 20.0), turned));
    }
    bench.scene().unwrap()
}

/// Number of wrong scanlines, and number of all. A right one passes through the background, each of `count` boxes in
/// turn, and the background again.
fn torn(count: usize, shaders: &ShaderSet) -> (usize, usize) {
    let media: Vec<f64> = (0..=count).map(|i| i as f64).chain([0.0]).collect();
    let (mut torn, mut all) = (0, 0);
    for turn in [0.11_f32, 0.23, 0.37] {
        let turned = Quat::from_euler(glam::EulerRot::XYZ, turn, 0.7 * turn, 1.3 * turn);
        let probe = linear(128, 0.25, 512, 80.0);
        let mut renderer = renderer(&boxes(count, turned), &probe, &small(1, 1), shaders);
        let pose = Pose { position_mm: DVec3::new(0.02, 0.03, 0.0), orientation: turned.as_dquat() };
        // Tilted, so that each ray meets the common face at a different angle.
        let lean = Pose { orientation: pose.orientation * DQuat::from_rotation_y(0.09), ..pose };
        for pose in [pose, lean] {
            let snapshot = renderer.snapshot(&pose).unwrap();
            let met = |path: &Path| path.segments.iter().map(|s| s.scatterer_mean).collect::<Vec<_>>();
            torn += snapshot.paths.iter().filter(|path| met(path) != media).count();
            all += snapshot.paths.len();
        }
    }
    (torn, all)
}

#[test]
fn touching_surfaces_are_one_interface() {
    // Each hit by itself: between two bodies that touch there is a film of the background, or of both.
    let naive = patched("trace", "crossing_t[end] <= limit", "false");
    assert_eq!(torn(1, &naive).0, 0, "a lone box needs no grouping");
    let (naive, all) = torn(2, &naive);
    let (shipped, _) = torn(2, &ShaderSet::default());
    println!("{naive} of {all}");
    assert!(naive > all / 20, "{naive} of {all}");
    assert_eq!(shipped, 0);
    row(
        "two bodies that share a turned face",
        format!("{naive} of {all} scanlines meet a fourth interface"),
        "hits within 1 µm count as coincident, crossed together and not met again",
        "none".to_owned(),
    );
}

#[test]
fn rays_along_walls_and_through_corners_match_the_twin() {
    let mut bench = Bench::new(silent(1540.0, 1.5));
    let body = bench.tissue(silent(1540.0, 1.6));
    bench.add(body, 1, analytic::cuboid(Vec3::new(-10.0, -10.0, 10.0), Vec3::new(10.0, 10.0, 30.0)));
    let scene = bench.scene().unwrap();
    let mut renderer = renderer(&scene, &linear(9, 1.25, 256, 60.0), &small(1, 1), &ShaderSet::default());
    // Within a pixel of a wall the tissue is ambiguous.
    let tie = Tolerance { grey: 25.0, other: 0.06 };
    // Rays in the wall itself are ambiguous: a third of the image along all of it, a sixth up to an edge. The rest is
    // not, except for a pixel's width about the wall.
    let (in_wall, up_to_edge) = (Tolerance { grey: 60.0, other: 0.37 }, Tolerance { grey: 60.0, other: 0.21 });
    // Through the diagonal of the faces, along a wall, along an edge, through corners at 45°.
    holds("through the diagonal", &mut renderer, &at(0.0, 0.0, 0.0), ROUNDING);
    holds("along a wall", &mut renderer, &at(0.0, 10.0, 0.0), in_wall);
    holds("along an edge", &mut renderer, &at(10.0, 10.0, 0.0), up_to_edge);
    let diagonal = Pose::looking(DVec3::new(-20.0, 0.0, 0.0), DVec3::new(1.0, 0.0, 1.0), DVec3::Y);
    holds("through edges at 45°", &mut renderer, &diagonal, tie);
    let corner = Pose::looking(DVec3::new(-20.0, -20.0, 0.0), DVec3::ONE, DVec3::X);
    holds("through corners", &mut renderer, &corner, tie);
    holds("from a face", &mut renderer, &at(0.0, 0.0, 10.0), tie);
    holds("from a corner", &mut renderer, &at(10.0, 10.0, 10.0), in_wall);
}
