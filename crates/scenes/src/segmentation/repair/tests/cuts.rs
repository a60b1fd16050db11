//! Tests of surfaces that were cut where a scan ended.

use glam::{DVec3, Vec3};
use insonify_core::anatomy::Mesh;

use super::{ball, count, half_space, mended, wrong_points};
use crate::segmentation::repair::shapes::{Numbers, both, cut, flipped, moved, sphere, tube};
use crate::segmentation::repair::{ActionKind, RepairSettings, repair};

#[test]
fn a_sphere_cut_straight_and_obliquely_gets_one_flat_cap() {
    for normal in [DVec3::X, DVec3::new(0.3, -0.8, 0.52).normalize()] {
        let shape = |p: DVec3| ball(30.0)(p).max(half_space(normal, 8.0)(p));
        let (_, report) = mended(cut(&sphere(30.0, 4), normal, 8.0), &shape);
        assert_eq!(count(&report, ActionKind::PlanarCap), 1, "{report}");
    }
}

#[test]
fn a_tube_cut_straight_and_obliquely_gets_two_flat_caps() {
    for normal in [DVec3::Z, DVec3::new(0.4, 0.2, 0.9).normalize()] {
        let open = cut(&cut(&tube(10.0, 60.0, 96, 40), normal, 25.0), -normal, 25.0);
        let shape = |p: DVec3| (p.truncate().length() - 10.0).max(normal.dot(p).abs() - 25.0);
        let (_, report) = mended(open, &shape);
        assert_eq!(count(&report, ActionKind::PlanarCap), 2, "{report}");
    }
}

#[test]
fn the_cut_of_a_vessel_with_a_wall_is_capped_by_a_ring() {
    let normal = DVec3::new(0.2, 0.1, 0.95).normalize();
    let wall = both(&tube(12.0, 60.0, 96, 40), &flipped(tube(8.0, 60.0, 64, 30)));
    let shape = |p: DVec3| {
        let r = p.truncate().length();
        (r - 12.0).max(8.0 - r).max(normal.dot(p).abs() - 20.0)
    };
    for wall in [wall, both(&tube(12.0, 60.0, 96, 40), &tube(8.0, 60.0, 64, 30))] {
        let open = cut(&cut(&wall, normal, 20.0), -normal, 20.0);
        let (_, report) = mended(open, &shape);
        assert_eq!((count(&report, ActionKind::PlanarCap), report.parts), (2, 1), "{report}");
    }
}

#[test]
fn several_rims_in_one_plane_are_one_cut() {
    let pair = both(&moved(sphere(15.0, 3), Vec3::X * 20.0), &moved(sphere(15.0, 3), Vec3::X * -20.0));
    let shape = |p: DVec3| {
        let off = DVec3::X * 20.0;
        (ball(15.0)(p - off)).min(ball(15.0)(p + off)).max(p.z - 3.0)
    };
    let (_, report) = mended(cut(&pair, DVec3::Z, 3.0), &shape);
    assert_eq!((count(&report, ActionKind::PlanarCap), report.parts), (1, 2), "{report}");
}

#[test]
fn a_sphere_at_the_edge_of_the_scan_is_closed_along_both_planes() {
    let open = cut(&cut(&sphere(30.0, 4), DVec3::X, 10.0), DVec3::Y, 5.0);
    let shape = |p: DVec3| ball(30.0)(p).max(p.x - 10.0).max(p.y - 5.0);
    let (_, report) = mended(open, &shape);
    assert_eq!(count(&report, ActionKind::PlanarCap), 2, "{report}");
}

#[test]
fn two_oblique_cuts_that_meet_are_a_guess_that_rounds_their_edge() {
    let [n, m] = [DVec3::new(0.8, 0.6, 0.0), DVec3::new(-0.3, 0.4, 0.5).normalize()];
    let open = cut(&cut(&sphere(30.0, 4), n, 10.0), m, 5.0);
    let shape = |p: DVec3| ball(30.0)(p).max(n.dot(p) - 10.0).max(m.dot(p) - 5.0);
    let (mesh, report) = repair("shape", open, &RepairSettings::default());
    assert_eq!((count(&report, ActionKind::Guess), report.remaining.len()), (1, 0), "{report}");
    // The fill is as a soap film.
    let wrong = wrong_points(&mesh, &shape);
    assert!((1..80).contains(&wrong), "{wrong} of 1000 points");
}

#[test]
fn a_sphere_at_the_corner_of_the_scan_is_closed_along_three_planes() {
    let open = cut(&cut(&cut(&sphere(30.0, 4), DVec3::X, 8.0), DVec3::Y, 5.0), DVec3::Z, 3.0);
    let shape = |p: DVec3| ball(30.0)(p).max(p.x - 8.0).max(p.y - 5.0).max(p.z - 3.0);
    let (_, report) = mended(open, &shape);
    assert_eq!(count(&report, ActionKind::PlanarCap), 3, "{report}");
}

/// The part of a sphere inside a box, open at the sides of the box, and its signed distance function.
fn boxed(min: DVec3, max: DVec3) -> (Mesh, impl Fn(DVec3) -> f64) {
    let mut mesh = sphere(30.0, 4);
    for axis in DVec3::AXES {
        mesh = cut(&cut(&mesh, axis, max.dot(axis)), -axis, -min.dot(axis));
    }
    (mesh, move |p: DVec3| ball(30.0)(p).max((p - max).max(min - p).max_element()))
}

#[test]
fn a_sphere_larger_than_the_scan_is_closed_along_all_sides_of_the_box() {
    // Of the sphere, eight patches at the corners of the box are left.
    let (mesh, shape) = boxed(DVec3::splat(-18.0), DVec3::splat(18.0));
    let (_, report) = mended(mesh, &shape);
    assert_eq!((count(&report, ActionKind::PlanarCap), report.parts), (6, 1), "{report}");
    assert_eq!(report.cuts.len(), 6);
    // The solid includes six corners of the box, but not two opposite ones, whichever way the surface faces.
    let (mut mesh, ball_in_box) = boxed(DVec3::splat(-18.0), DVec3::splat(18.0));
    let at = mesh.vertices_mm.clone();
    let is_opposite = |p: DVec3| p.min_element() > 0.0 || p.max_element() < 0.0;
    mesh.triangles.retain(|t| is_opposite(at[t[0] as usize].as_dvec3()));
    let shape = |p: DVec3| if is_opposite(p) { ball_in_box(p) } else { p.abs().max_element() - 18.0 };
    for mesh in [mesh.clone(), flipped(mesh)] {
        let (_, report) = mended(mesh, &shape);
        assert_eq!((count(&report, ActionKind::PlanarCap), report.parts), (6, 1), "{report}");
    }
    // Four sides of the box, with two of its corners, cut the sphere.
    let (mesh, shape) = boxed(DVec3::new(-15.0, -15.0, -40.0), DVec3::new(15.0, 40.0, 5.0));
    let (_, report) = mended(mesh, &shape);
    assert_eq!(report.parts, 1, "{report}");
}

#[test]
fn a_shell_at_the_edge_of_the_scan_is_closed_by_a_bent_ring() {
    let shell = both(&sphere(30.0, 4), &flipped(sphere(22.0, 4)));
    let open = cut(&cut(&shell, DVec3::X, 6.0), DVec3::Y, 4.0);
    let shape = |p: DVec3| ball(30.0)(p).max(-ball(22.0)(p)).max(p.x - 6.0).max(p.y - 4.0);
    let (_, report) = mended(open, &shape);
    assert_eq!((count(&report, ActionKind::PlanarCap), report.parts), (2, 1), "{report}");
}

#[test]
fn triangles_missing_beside_a_cut_leave_the_cap_flat() {
    for cuts in [vec![(DVec3::X, 8.0)], vec![(DVec3::X, 8.0), (DVec3::Y, 5.0)]] {
        let mut mesh = cuts.iter().fold(sphere(30.0, 5), |mesh, (normal, offset)| cut(&mesh, *normal, *offset));
        let mut numbers = Numbers(2);
        mesh.triangles.retain(|_| numbers.next() > 0.02);
        let shape = |p: DVec3| {
            let d = cuts.iter().fold(ball(30.0)(p), |d, (normal, offset)| d.max(half_space(*normal, *offset)(p)));
            // A notch in the rim is filled flatter than the sphere.
            if d.abs() < 0.5 { 0.0 } else { d }
        };
        let (_, report) = mended(mesh, &shape);
        assert_eq!(
            (count(&report, ActionKind::PlanarCap), count(&report, ActionKind::Guess)),
            (cuts.len(), 0),
            "{report}"
        );
    }
}
