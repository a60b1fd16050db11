//! Tests of whole repairs.

mod cuts;

use glam::{DVec3, Vec3};
use insonify_core::anatomy::Mesh;
use insonify_core::anatomy::doctor::tree::Tree;
use insonify_core::anatomy::doctor::{Severity, findings};

use super::shapes::{Numbers, both, cuboid, cut, flipped, moved, sphere, tube, unwelded};
use super::{ActionKind, RemainingKind, RepairSettings, SurfaceRepair, repair};

/// Signed distance of a shape, mm: negative inside.
type Shape<'a> = &'a dyn Fn(DVec3) -> f64;

/// Points this near to the surface are not compared, mm, as the flat triangles of a mesh deviate that much from its
/// shape.
const NEAR_MM: f64 = 0.15;

/// Repairs a mesh. Checks that the result is closed and faces outward, has the given shape, moved no vertex farther
/// than allowed, and passes the scene check.
fn mended(mesh: Mesh, shape: Shape<'_>) -> (Mesh, SurfaceRepair) {
    let settings = RepairSettings::default();
    let (mesh, report) = repair("shape", mesh, &settings);
    check(&mesh, &report, shape);
    (mesh, report)
}

fn check(mesh: &Mesh, report: &SurfaceRepair, shape: Shape<'_>) {
    export(mesh);
    assert!(report.is_mended(), "{report}");
    assert_eq!(mesh.unpaired_edges(), 0, "{report}");
    assert!(mesh.signed_volume_mm3() > 0.0);
    assert!(report.largest_move_mm <= 0.5);
    let objections: Vec<_> = findings(mesh).into_iter().filter(|f| f.severity != Severity::Note).collect();
    assert!(objections.is_empty(), "{}\n{report}", objections[0]);
    assert_eq!(wrong_points(mesh, shape), 0, "{report}");
}

/// Number of random points inside either the mesh or the shape, but not both.
fn wrong_points(mesh: &Mesh, shape: Shape<'_>) -> usize {
    let tree = Tree::new(mesh).unwrap();
    let bounds = mesh.bounds_mm().unwrap().grown(2.0);
    let mut numbers = Numbers(7);
    let mut point = || {
        let at = Vec3::from_array(std::array::from_fn(|_| numbers.next() as f32));
        (bounds.min + at * bounds.size()).as_dvec3()
    };
    let points: Vec<DVec3> = (0..1000).map(|_| point()).collect();
    let compared = points.iter().filter(|p| shape(**p).abs() > NEAR_MM);
    compared.filter(|p| tree.holds(**p) != (shape(**p) < 0.0)).count()
}

/// Writes the mesh as an OFF file into the folder that REPAIR_OUT names, if set, for checks with other programs.
fn export(mesh: &Mesh) {
    let Ok(folder) = std::env::var("REPAIR_OUT") else { return };
    let thread = std::thread::current();
    let name = thread.name().unwrap_or("mesh").rsplit("::").next().unwrap_or("mesh").to_owned();
    let free = (0..).map(|i| format!("{folder}/{name}_{i}.off")).find(|path| !std::path::Path::new(path).exists());
    let mut text = format!("OFF\n{} {} 0\n", mesh.vertices_mm.len(), mesh.triangles.len());
    mesh.vertices_mm.iter().for_each(|v| text += &format!("{} {} {}\n", v.x, v.y, v.z));
    mesh.triangles.iter().for_each(|t| text += &format!("3 {} {} {}\n", t[0], t[1], t[2]));
    std::fs::write(free.unwrap(), text).unwrap();
}

fn ball(radius_mm: f64) -> impl Fn(DVec3) -> f64 {
    move |p| p.length() - radius_mm
}

fn half_space(normal: DVec3, offset_mm: f64) -> impl Fn(DVec3) -> f64 {
    move |p| normal.dot(p) - offset_mm
}

fn count(report: &SurfaceRepair, kind: ActionKind) -> usize {
    report.count(kind)
}

#[test]
fn a_sound_sphere_is_left_as_it_is() {
    let before = sphere(30.0, 3);
    let (after, report) = mended(before.clone(), &ball(30.0));
    assert_eq!(before, after);
    assert!(report.was_sound(), "{report}");
}

#[test]
fn a_surface_that_faces_inward_is_turned_over() {
    let (_, report) = mended(flipped(sphere(30.0, 3)), &|p| ball(30.0)(p) * 1.0);
    assert_eq!(count(&report, ActionKind::TurnedPart), 1, "{report}");
}

#[test]
fn faces_turned_at_random_are_made_to_agree() {
    let mut mesh = sphere(30.0, 4);
    let mut numbers = Numbers(3);
    mesh.triangles.iter_mut().filter(|_| numbers.next() < 0.5).for_each(|t| t.swap(1, 2));
    let (_, report) = mended(mesh, &ball(30.0));
    assert!(count(&report, ActionKind::Turned) > 2000, "{report}");
}

#[test]
fn doubled_sheets_become_one_whichever_way_the_copies_face() {
    let one = sphere(30.0, 3);
    for copy in [one.clone(), flipped(one.clone())] {
        let (after, report) = mended(both(&one, &copy), &|p| ball(30.0)(p));
        assert_eq!((after.triangles.len(), count(&report, ActionKind::Duplicate)), (1280, 1280), "{report}");
    }
    // The same with an open cut.
    let half = cut(&one, DVec3::Z, 5.0);
    let shape = |p: DVec3| ball(30.0)(p).max(p.z - 5.0);
    mended(both(&half, &flipped(half.clone())), &|p| shape(p) * 1.0);
}

#[test]
fn a_copy_that_is_displaced_by_rounding_is_joined() {
    let one = sphere(30.0, 3);
    let (after, _) = mended(both(&one, &moved(one.clone(), Vec3::splat(3e-5))), &|p| ball(30.0)(p));
    assert_eq!(after.triangles.len(), 1280);
}

#[test]
fn a_wall_between_joined_halves_is_removed() {
    // Two cuboids side by side. The wall between them is there twice, back to back.
    let halves = both(&cuboid(Vec3::X * -10.0, Vec3::splat(10.0), 6), &cuboid(Vec3::X * 10.0, Vec3::splat(10.0), 6));
    let shape = |p: DVec3| (p.abs() - DVec3::new(20.0, 10.0, 10.0)).max_element();
    let (_, report) = mended(halves.clone(), &shape);
    assert_eq!((count(&report, ActionKind::InnerWall), report.parts), (144, 1), "{report}");
    // The wall is there only once, so edges at its border have three triangles.
    let mut once = super::shapes::welded(halves);
    let at = once.vertices_mm.clone();
    let is_wall = |t: &[u32; 3]| t.iter().all(|v| at[*v as usize].x == 0.0);
    let mut walls = 0;
    once.triangles.retain(|t| {
        walls += usize::from(is_wall(t));
        !is_wall(t) || walls <= 72
    });
    let (_, report) = mended(once, &shape);
    assert_eq!((count(&report, ActionKind::Flat), report.parts), (1, 1), "{report}");
}

#[test]
fn seams_that_are_not_joined_are_joined() {
    let (_, report) = mended(unwelded(&sphere(30.0, 3)), &ball(30.0));
    assert_eq!(count(&report, ActionKind::Joined), 3 * 1280 - 642, "{report}");
    // Halves whose rims are 0.005 mm apart.
    let halves =
        both(&cut(&sphere(30.0, 3), DVec3::Z, 0.0), &moved(cut(&sphere(30.0, 3), -DVec3::Z, 0.0), Vec3::Z * 0.005));
    let (_, report) = mended(halves, &ball(30.0));
    assert!((0.004..0.0101).contains(&report.largest_move_mm), "{report}");
    assert_eq!(report.parts, 1);
}

#[test]
fn holes_of_one_five_and_fifty_triangles_are_filled() {
    for (size, tolerance_mm) in [(1, 0.0), (5, 0.3), (50, 2.0)] {
        let mut mesh = sphere(30.0, 4);
        let middle = mesh.corners_of(100)[0];
        let mut order: Vec<usize> = (0..mesh.triangles.len()).collect();
        let centre = |t: usize| mesh.corners_of(t as u32).iter().sum::<Vec3>() / 3.0;
        order.sort_by(|a, b| centre(*a).distance(middle).total_cmp(&centre(*b).distance(middle)));
        let gone: std::collections::HashSet<usize> = order[..size].iter().copied().collect();
        let mut at = 0..;
        mesh.triangles.retain(|_| !gone.contains(&at.next().unwrap()));
        // The fill is flatter than the sphere.
        let shape = |p: DVec3| {
            let d = ball(30.0)(p);
            if d.abs() < tolerance_mm && p.distance(middle.as_dvec3()) < 15.0 { 0.0 } else { d }
        };
        let (_, report) = mended(mesh, &shape);
        let holes = count(&report, ActionKind::SmallHole) + count(&report, ActionKind::Guess);
        assert_eq!(holes, 1, "{report}");
    }
}

#[test]
fn a_large_hole_that_is_not_planar_is_a_guess_with_its_size() {
    let mut mesh = tube(20.0, 40.0, 64, 32);
    let at = mesh.vertices_mm.clone();
    mesh.triangles.retain(|t| !t.iter().all(|v| at[*v as usize].x > 5.0 && at[*v as usize].z.abs() < 15.0));
    let shape = |p: DVec3| {
        let d = (p.truncate().length() - 20.0).max(p.z.abs() - 40.0);
        if p.x > 4.0 && p.z.abs() < 16.0 { 0.0 } else { d }
    };
    let (_, report) = mended(mesh, &shape);
    assert_eq!(count(&report, ActionKind::Guess), 1, "{report}");
    let guess = report.actions.iter().find(|action| action.kind == ActionKind::Guess).unwrap();
    assert!((40.0..60.0).contains(&guess.regions[0].size_mm), "{report}");
}

#[test]
fn copies_of_single_triangles_are_removed() {
    let mut mesh = sphere(30.0, 3);
    mesh.triangles.extend_from_within(10..60);
    let (_, report) = mended(mesh, &|p| ball(30.0)(p));
    assert_eq!(count(&report, ActionKind::Duplicate), 50, "{report}");
}

#[test]
fn corners_on_the_edges_of_others_are_joined_to_them() {
    // The top of this cuboid is a single square. Its other sides have 4 × 4 squares, so the top's rim has corners on
    // the long edges.
    let mut mesh = cuboid(Vec3::ZERO, Vec3::splat(10.0), 4);
    let at = mesh.vertices_mm.clone();
    mesh.triangles.retain(|t| !t.iter().all(|v| at[*v as usize].z == 10.0));
    let top = [[-10.0, -10.0], [10.0, -10.0], [10.0, 10.0], [-10.0, 10.0]].map(|[x, y]| Vec3::new(x, y, 10.0));
    let mesh = both(&mesh, &Mesh { vertices_mm: top.to_vec(), triangles: vec![[0, 1, 2], [0, 2, 3]] });
    let shape = |p: DVec3| p.abs().max_element() - 10.0;
    let (_, report) = mended(mesh, &shape);
    assert_eq!(report.parts, 1, "{report}");
}

#[test]
fn a_cavity_stays_a_cavity_and_an_inner_part_becomes_one() {
    let shape = |p: DVec3| ball(30.0)(p).max(-ball(12.0)(p));
    let (_, report) = mended(both(&sphere(30.0, 4), &flipped(sphere(12.0, 3))), &shape);
    assert!(report.was_sound(), "{report}");
    let (_, report) = mended(both(&sphere(30.0, 4), &sphere(12.0, 3)), &shape);
    assert_eq!(count(&report, ActionKind::Cavity), 1, "{report}");
    // Everything is inside out, so the inner sphere was a cavity already.
    let (_, report) = mended(flipped(both(&sphere(30.0, 4), &flipped(sphere(12.0, 3)))), &shape);
    assert_eq!((count(&report, ActionKind::TurnedPart), count(&report, ActionKind::Cavity)), (2, 0), "{report}");
}

#[test]
fn overlapping_parts_become_one() {
    let off = Vec3::new(13.0, 4.0, 2.0);
    let parts = both(&moved(sphere(20.0, 4), off), &flipped(moved(sphere(20.0, 4), -off)));
    let shape = |p: DVec3| (p - off.as_dvec3()).length().min((p + off.as_dvec3()).length()) - 20.0;
    let (_, report) = mended(parts, &shape);
    assert_eq!((report.parts, count(&report, ActionKind::TurnedPart)), (1, 1), "{report}");
    assert!(count(&report, ActionKind::LeftOut) > 100, "{report}");
}

#[test]
fn two_boxes_that_share_a_face_become_one_of_both_volumes() {
    // Their common face is divided along different diagonals.
    let half = Vec3::new(30.0, 30.0, 30.0);
    let mut left = cuboid(Vec3::X * -30.0, half, 1);
    let right = cuboid(Vec3::X * 30.0, half, 1);
    let at = left.vertices_mm.clone();
    let shared: Vec<usize> =
        (0..left.triangles.len()).filter(|&t| left.triangles[t].iter().all(|&v| at[v as usize].x == 0.0)).collect();
    let [first, second] = shared[..] else { panic!("{shared:?}") };
    let [s, t] = [left.triangles[first], left.triangles[second]];
    let apart = |of: [u32; 3], from: [u32; 3]| {
        let is_new = |v: &u32| from.iter().all(|w| at[*v as usize] != at[*w as usize]);
        (0..3).find(|&n| is_new(&of[n])).unwrap()
    };
    let (n, m) = (apart(s, t), apart(t, s));
    left.triangles[first] = [s[n], s[(n + 1) % 3], t[m]];
    left.triangles[second] = [t[m], t[(m + 1) % 3], s[n]];
    let shape = |p: DVec3| (p.abs() - DVec3::new(60.0, 30.0, 30.0)).max_element();
    let (mesh, report) = mended(both(&left, &right), &shape);
    assert!((mesh.signed_volume_mm3() - 432e3).abs() < 1.0, "{report}");
    assert_eq!(report.parts, 1, "{report}");
}

#[test]
fn parts_that_touch_along_an_edge_are_separated() {
    let pair = both(
        &cuboid(Vec3::new(-10.0, -10.0, 0.0), Vec3::splat(10.0), 5),
        &cuboid(Vec3::new(10.0, 10.0, 0.0), Vec3::splat(10.0), 5),
    );
    let shape = |p: DVec3| {
        let off = DVec3::new(10.0, 10.0, 0.0);
        (p - off).abs().max_element().min((p + off).abs().max_element()) - 10.0
    };
    let (_, report) = mended(pair, &shape);
    assert!(report.count(ActionKind::Remeshed) > 0, "{report}");
}

#[test]
fn an_edge_that_touches_itself_in_the_middle_of_a_part_is_separated() {
    // Voxels at a diagonal, joined by others: a single part with an edge of four triangles.
    let cells = [[0, 0, 0], [1, 1, 0], [0, 0, 1], [1, 1, 1], [1, 0, 1], [0, 0, -1], [1, 1, -1], [1, 0, -1]];
    let mut mesh = Mesh::default();
    for [x, y, z] in cells {
        let centre = Vec3::new(x as f32, y as f32, z as f32) * 4.0;
        mesh = both(&mesh, &cuboid(centre, Vec3::splat(2.0), 1));
    }
    let inside = |p: DVec3| {
        let distance =
            |[x, y, z]: &[i32; 3]| (p - DVec3::new(*x as f64, *y as f64, *z as f64) * 4.0).abs().max_element() - 2.0;
        cells.iter().map(distance).fold(f64::INFINITY, f64::min)
    };
    let (_, report) = mended(mesh, &inside);
    assert!(report.count(ActionKind::Remeshed) > 0, "{report}");
}

#[test]
fn fragments_and_flat_pieces_are_removed() {
    let fragments = both(&moved(sphere(0.5, 1), Vec3::X * 50.0), &moved(sphere(0.4, 1), Vec3::Y * 50.0));
    let mut sheet = tube(5.0, 5.0, 4, 1);
    sheet.triangles.truncate(2);
    let mesh = both(&both(&sphere(30.0, 4), &fragments), &moved(sheet, Vec3::Z * 60.0));
    let (_, report) = mended(mesh, &ball(30.0));
    assert_eq!((count(&report, ActionKind::Crumb), report.parts), (2, 1), "{report}");
}

#[test]
fn a_dent_that_passes_through_the_far_side_is_cut_off_there() {
    // The cap above 20 mm is pushed through the bottom: what it reaches beyond is inside out.
    let mut mesh = sphere(30.0, 5);
    for v in mesh.vertices_mm.iter_mut().filter(|v| v.z > 20.0) {
        // Off the vertices of the bottom, which lie just below those of the top.
        *v = Vec3::new(v.x + 0.13, v.y + 0.07, 20.0 - 5.5 * (v.z - 20.0));
    }
    let before = insonify_core::anatomy::doctor::crossing::pairs(&Tree::new(&mesh).unwrap()).len();
    assert!(before > 50, "{before}");
    let shape = |p: DVec3| {
        let radius_squared = p.truncate().length_squared();
        let dent = 20.0 - 5.5 * ((900.0 - radius_squared).max(0.0).sqrt() - 20.0);
        let cut = if radius_squared < 500.0 { p.z - dent } else { p.z - 20.0 };
        let distance = ball(30.0)(p).max(cut);
        // Near the dent's steep wall, the height says little about the distance.
        if (p.truncate().length() - 500f64.sqrt()).abs() < 3.0 || cut.abs() < 1.5 { 0.0 } else { distance }
    };
    let (after, report) = mended(mesh, &shape);
    assert!(count(&report, ActionKind::LeftOut) > 50, "{report}");
    let farthest = after.vertices_mm.iter().map(|v| v.length()).fold(0.0, f32::max);
    assert!(farthest < 30.5, "{farthest} {report}");
}

#[test]
fn radial_noise_with_two_ragged_holes_is_closed() {
    let mut mesh = sphere(50.0, 5);
    let mut numbers = Numbers(9);
    let at: Vec<f64> = (0..mesh.vertices_mm.len()).map(|_| 0.2 * (numbers.next() - 0.5)).collect();
    mesh.vertices_mm.iter_mut().zip(at).for_each(|(v, by)| *v *= 1.0 + by as f32 / 50.0);
    let places = mesh.vertices_mm.clone();
    let is_gone = |v: Vec3| v.distance(Vec3::X * 50.0) < 2.0 || v.distance(Vec3::Y * -50.0) < 2.0;
    mesh.triangles.retain(|t| !t.iter().any(|&v| is_gone(places[v as usize])));
    let (_, report) = mended(mesh, &|p| if ball(50.0)(p).abs() < 0.3 { 0.0 } else { ball(50.0)(p) });
    assert_eq!(count(&report, ActionKind::SmallHole), 2, "{report}");
}

#[test]
fn a_part_thinner_than_the_voxels_is_said_to_be_lost() {
    // The ball has a hole, so all is remeshed; the plate of 0.02 mm lies between the voxels.
    let mut mesh = sphere(50.0, 4);
    mesh.triangles.truncate(mesh.triangles.len() - 1);
    let plate = moved(cuboid(Vec3::ZERO, Vec3::new(40.0, 40.0, 0.01), 4), Vec3::Z * 70.3);
    let (_, report) = repair("s", both(&mesh, &plate), &RepairSettings::default());
    let lost = report.remaining.iter().find(|left| left.kind == RemainingKind::Lost);
    assert!(lost.is_some_and(|lost| lost.count >= 2 * 2 * 16), "{report}");
}

#[test]
fn a_moebius_strip_is_said_to_have_one_side() {
    let (around, across) = (80u32, 4u32);
    let at = |i: u32, j: u32| {
        let turn = std::f32::consts::TAU * i as f32 / around as f32;
        let (radial, up) = ((0.5 * turn).cos(), (0.5 * turn).sin());
        let off = 10.0 * (j as f32 / across as f32 - 0.5);
        Vec3::new((40.0 + off * radial) * turn.cos(), (40.0 + off * radial) * turn.sin(), off * up)
    };
    let mut mesh = Mesh::default();
    for (i, j) in (0..around).flat_map(|i| (0..across).map(move |j| (i, j))) {
        let first = mesh.vertices_mm.len() as u32;
        mesh.vertices_mm.extend([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    let (_, report) = repair("strip", mesh, &RepairSettings::default());
    assert_eq!(report.remaining[0].kind, RemainingKind::OneSided, "{report}");
    assert!(!report.is_mended() && report.volume_mm3 < 1e3, "{report}");
}

#[test]
fn vertices_that_are_not_finite_or_do_not_exist_are_reported_and_their_holes_filled() {
    let mut mesh = sphere(30.0, 4);
    mesh.vertices_mm[50].y = f32::NAN;
    mesh.triangles.push([0, 1, 1_000_000]);
    let (mesh, report) = repair("s", mesh, &RepairSettings::default());
    assert_eq!(mesh.unpaired_edges(), 0);
    assert_eq!((report.remaining[0].kind, report.remaining[0].count), (RemainingKind::NotFinite, 2), "{report}");
}

#[test]
fn an_open_flat_sheet_and_an_empty_mesh_leave_nothing() {
    let sheet = Mesh { vertices_mm: vec![Vec3::ZERO, Vec3::X, Vec3::Y], triangles: vec![[0, 1, 2]] };
    let (mesh, report) = repair("sheet", sheet, &RepairSettings::default());
    assert!(mesh.triangles.is_empty() && mesh.vertices_mm.is_empty());
    assert_eq!(report.remaining[0].kind, RemainingKind::Nothing, "{report}");
    let (mesh, report) = repair("empty", Mesh::default(), &RepairSettings::default());
    assert!(mesh.triangles.is_empty() && !report.is_mended(), "{report}");
}

#[test]
fn a_repair_is_the_same_with_one_thread_and_repeated() {
    let mut mesh = both(&cut(&sphere(30.0, 4), DVec3::X, 8.0), &cuboid(Vec3::Y * 50.0, Vec3::splat(8.0), 8));
    let mut numbers = Numbers(11);
    mesh.triangles.retain(|_| numbers.next() > 0.05);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| repair("s", mesh.clone(), &RepairSettings::default()))
    };
    let (first, second) = (run(1), run(4));
    assert_eq!(first, second);
    let (again, report) = repair("s", first.0.clone(), &RepairSettings::default());
    assert!(report.is_mended());
    assert_eq!(again.triangles.len(), first.0.triangles.len(), "{report}");
}

mod random {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]

        #[test]
        fn spheres_with_random_triangles_deleted_are_closed(seed in any::<u64>(), share in 0.0..0.4f64, levels in 2..5u32) {
            let mut mesh = sphere(30.0, levels);
            let mut numbers = Numbers(seed);
            mesh.triangles.retain(|_| numbers.next() >= share);
            let (mesh, report) = repair("s", mesh, &RepairSettings::default());
            prop_assert_eq!(mesh.unpaired_edges(), 0);
            prop_assert!(mesh.signed_volume_mm3() > 0.0);
            prop_assert!(report.largest_move_mm <= 0.5);
            prop_assert!(report.is_mended(), "{report}");
        }

        #[test]
        fn any_triangles_end_closed(seed in any::<u64>(), vertices in 3..24usize, triangles in 1..80usize) {
            let mut numbers = Numbers(seed);
            let vertices_mm = (0..vertices).map(|_| Vec3::from_array(std::array::from_fn(|_| (numbers.next() * 4.0).round() as f32))).collect();
            let triangles = (0..triangles).map(|_| std::array::from_fn(|_| numbers.below(vertices) as u32)).collect();
            let (mesh, report) = repair("soup", Mesh { vertices_mm, triangles }, &RepairSettings::default());
            prop_assert_eq!(mesh.unpaired_edges(), 0, "{}", report);
            prop_assert!(report.largest_move_mm <= 0.5 + 1e-6, "{report}");
            if !mesh.triangles.is_empty() {
                let errors: Vec<_> = findings(&mesh).into_iter().filter(|f| f.severity == Severity::Error).collect();
                prop_assert!(errors.is_empty(), "{} {report}", errors[0]);
            }
        }

        #[test]
        fn spheres_with_random_holes_turns_and_copies_are_mended(seed in any::<u64>(), holes in 0..20usize) {
            let mut mesh = sphere(30.0, 4);
            let mut numbers = Numbers(seed);
            for _ in 0..holes {
                mesh.triangles.swap_remove(numbers.below(mesh.triangles.len()));
            }
            let copied = numbers.below(200);
            mesh.triangles.extend_from_within(..copied);
            for triangle in &mut mesh.triangles {
                if numbers.next() < 0.5 {
                    triangle.swap(0, 1);
                }
            }
            let mesh = if seed % 2 == 0 { unwelded(&mesh) } else { mesh };
            let shape = |p: DVec3| if ball(30.0)(p).abs() < 0.5 { 0.0 } else { ball(30.0)(p) };
            let (mesh, report) = repair("s", mesh, &RepairSettings::default());
            check(&mesh, &report, &shape);
        }
    }
}

#[test]
fn many_triangles_with_holes_and_turned_faces_are_repaired() {
    let mut mesh = unwelded(&cut(&sphere(100.0, 7), DVec3::X, 40.0));
    let mut numbers = Numbers(1);
    mesh.triangles.retain(|_| numbers.next() > 0.002);
    mesh.triangles.iter_mut().filter(|_| numbers.next() < 0.5).for_each(|t| t.swap(0, 1));
    assert!(mesh.triangles.len() > 100_000);
    let (mesh, report) = repair("s", mesh, &RepairSettings::default());
    assert!(report.is_mended() && mesh.unpaired_edges() == 0, "{report}");
    let tree = Tree::new(&mesh).unwrap();
    assert_eq!(insonify_core::anatomy::doctor::crossing::pairs(&tree).len(), 0);
}
