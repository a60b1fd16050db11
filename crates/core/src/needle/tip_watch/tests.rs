use glam::Vec3;
use proptest::prelude::*;

use super::*;
use crate::anatomy::motion::{Field, Rhythm, Shape};
use crate::anatomy::{Mesh, TissueTable, analytic};
use TipEventKind::{Entered, Left, ReEntered};

fn scene(parts: Vec<(&'static str, i32, Mesh)>) -> Scene {
    let part = |(name, priority, mesh)| analytic::Part { name, tissue: "soft_tissue", priority, mesh };
    analytic::scene(parts.into_iter().map(part).collect(), &TissueTable::builtin().unwrap(), "gel").unwrap()
}

fn ball(x: f32, radius: f32) -> Mesh {
    analytic::sphere(Vec3::new(x, 0.0, 0.0), radius, 4)
}

fn block(low: [f32; 3], high: [f32; 3]) -> Mesh {
    analytic::cuboid(Vec3::from(low), Vec3::from(high))
}

fn at(x: f64) -> DVec3 {
    DVec3::new(x, 0.013, 0.017)
}

/// Events along x through these positions, 0.1 s apart: surface, kind, place and number of punctures.
fn along(watch: &mut TipWatch, xs: &[f64]) -> Vec<(usize, TipEventKind, f64, u32)> {
    let start_s = watch.last.map_or(0.0, |last| last.time_s + 0.1);
    let steps = xs.iter().enumerate().flat_map(|(i, &x)| watch.advance(start_s + 0.1 * i as f64, at(x)));
    steps
        .map(|event| (event.surface, event.kind, (event.position_mm.x * 10.0).round() / 10.0, event.punctures))
        .collect()
}

#[test]
fn one_long_step_gives_all_events_in_order_with_time_and_place() {
    let scene = scene(vec![("wall", 1, ball(0.0, 10.0)), ("blood", 2, ball(0.0, 8.0))]);
    let mut watch = TipWatch::new(&scene).unwrap();
    assert_eq!(watch.advance(5.0, at(-20.0)), []);
    let events = watch.advance(5.2, at(20.0));
    let found: Vec<_> = events.iter().map(|e| (e.surface, e.kind)).collect();
    assert_eq!(found, [(0, Entered), (1, Entered), (1, Left), (0, Left)], "the wall is not left for the blood");
    for (event, x) in events.iter().zip([-10.0, -8.0, 8.0, 10.0]) {
        assert!((event.position_mm.x - x).abs() < 0.05, "{event:?}");
        assert!((event.time_s - (5.0 + 0.2 * (event.position_mm.x + 20.0) / 40.0)).abs() < 1e-9, "{event:?}");
    }
    assert_eq!(watch.medium(), None);
    assert!(events.iter().all(|event| event.punctures == 1));
}

#[test]
fn small_steps_give_the_same_events_as_a_long_one() {
    let parts = || vec![("body", 1, block([-15.0; 3], [15.0; 3])), ("a", 2, ball(0.0, 5.0)), ("b", 3, ball(6.0, 4.0))];
    let xs: Vec<f64> = (0..=400).map(|i| -20.0 + 0.1 * f64::from(i)).collect();
    let fine = along(&mut TipWatch::new(&scene(parts())).unwrap(), &xs);
    let coarse = along(&mut TipWatch::new(&scene(parts())).unwrap(), &[-20.0, 20.0]);
    assert_eq!(fine, coarse);
    assert_eq!(fine.len(), 6, "{fine:?}");
}

#[test]
fn a_surface_hidden_by_a_higher_one_is_not_entered() {
    // The cover reaches beyond the organ on both sides.
    let parts = vec![("organ", 1, ball(0.0, 3.0)), ("cover", 2, ball(0.0, 6.0))];
    let mut watch = TipWatch::new(&scene(parts)).unwrap();
    assert_eq!(along(&mut watch, &[-10.0, 0.0]), [(1, Entered, -6.0, 1)]);
    assert_eq!(watch.medium(), Some(1));
    assert!(watch.is_inside(0) && watch.is_inside(1));
    assert_eq!(along(&mut watch, &[10.0]), [(1, Left, 6.0, 1)]);
    // An organ that comes out of its cover on one side is entered there.
    let mut watch = TipWatch::new(&scene(vec![("organ", 1, ball(0.0, 6.0)), ("cover", 2, ball(-5.0, 6.0))])).unwrap();
    let events = along(&mut watch, &[-20.0, 20.0]);
    assert_eq!(events, [(1, Entered, -11.0, 1), (1, Left, 1.0, 1), (0, Entered, 1.0, 1), (0, Left, 6.0, 1)]);
}

#[test]
fn a_return_is_a_double_puncture_but_tremor_at_the_border_is_not() {
    let mut watch = TipWatch::new(&scene(vec![("bowel", 1, ball(0.0, 5.0))])).unwrap();
    assert_eq!(along(&mut watch, &[-8.0, -4.0]), [(0, Entered, -5.0, 1)]);
    let border = along(&mut watch, &[-5.2, -4.9, -5.1, -4.8]);
    assert!(border.iter().all(|(_, kind, _, punctures)| *kind != ReEntered && *punctures == 1), "{border:?}");
    assert_eq!(border.len(), 4);
    assert_eq!(along(&mut watch, &[-7.0, -4.0]), [(0, Left, -5.0, 1), (0, ReEntered, -5.0, 2)]);
    // Out at the far side, and back in one step.
    assert_eq!(along(&mut watch, &[7.0, 0.0]), [(0, Left, 5.0, 2), (0, ReEntered, 5.0, 3)]);
}

#[test]
fn a_gap_a_loss_and_a_clock_that_goes_back_place_the_tip_without_events() {
    let mut watch = TipWatch::new(&scene(vec![("organ", 1, ball(0.0, 5.0))])).unwrap();
    watch.advance(0.0, at(-8.0));
    assert_eq!(watch.advance(GAP_S + 0.01, at(0.0)), []);
    assert_eq!(watch.medium(), Some(0));
    assert_eq!(watch.advance(0.1, at(8.0)), []);
    assert_eq!(watch.medium(), None);
    assert_eq!(watch.advance(0.2, DVec3::NAN), []);
    assert_eq!((watch.medium(), watch.is_inside(0)), (None, false));
    assert_eq!(watch.advance(0.3, at(0.0)), []);
    assert_eq!(watch.advance(0.4, at(8.0)).len(), 1);
    watch.lose();
    assert_eq!(watch.advance(0.5, at(0.0)), []);
}

#[test]
fn a_tip_on_a_surface_does_not_flicker() {
    let mut watch = TipWatch::new(&scene(vec![("cube", 1, block([0.0; 3], [10.0; 3]))])).unwrap();
    let mut steps = |points: &[[f64; 3]]| -> Vec<_> {
        let start_s = watch.last.map_or(0.0, |last| last.time_s);
        let all = points.iter().enumerate();
        all.flat_map(|(i, p)| watch.advance(start_s + 0.1 * (i + 1) as f64, DVec3::from(*p))).map(|e| e.kind).collect()
    };
    // Onto a face, along it, over its diagonal, and away: one puncture at most.
    let on_face =
        [[-3.0, 5.0, 5.0], [0.0, 5.0, 5.0], [0.0, 6.0, 6.0], [0.0, 2.0, 2.0], [0.0, 3.0, 5.0], [-3.0, 3.0, 5.0]];
    assert_eq!(steps(&on_face), [Entered, Left]);
    assert_eq!(steps(&[[-1.0, -1.0, -1.0]]), []);
    assert_eq!(steps(&[[5.0, 5.0, 5.0]]), [ReEntered], "through a corner of six triangles");
    assert_eq!(steps(&[[5.0, 15.0, 15.0]]), [Left], "through an edge");
    assert_eq!(steps(&[[5.0, -2.0, 12.0], [5.0, 8.0, 10.0], [5.0, 12.0, 10.0]]), [], "along the upper face");
    assert_eq!(steps(&[[5.0, 9.0, 9.0], [5.0, 10.0, 9.0], [5.0, 10.0, 4.0], [5.0, 9.0, 9.0]]).len(), 3);
}

#[test]
fn a_surface_that_moves_over_the_resting_tip_has_events() {
    let mut scene = scene(vec![("heart", 1, ball(0.0, 9.0))]);
    let (centre_mm, axis) = (Vec3::ZERO, Vec3::Z);
    let shape = Shape::Beat { centre_mm, axis, radius_mm: 9.0, squeeze: 0.3, shorten: 0.0 };
    let rhythm = Rhythm::Heart { beats_per_min: 60.0 };
    scene.motion.fields = vec![Field { name: "heart".into(), surfaces: vec!["heart".into()], shape, rhythm }];
    let mut watch = TipWatch::new(&scene).unwrap();
    let mut found = Vec::new();
    for i in 0..=20 {
        let time_s = 0.05 * f64::from(i);
        watch.set_scene_time_s(time_s);
        found.extend(watch.advance(time_s, at(8.7)));
    }
    let kinds: Vec<_> = found.iter().map(|event| event.kind).collect();
    assert_eq!(kinds, [Left, Entered], "the heart contracts once in a second: {found:?}");
    assert!(found.iter().all(|event| event.position_mm.distance(at(8.7)) < 0.01));
}

#[test]
fn a_tip_between_moving_surfaces_meets_each_where_it_is() {
    let mut scene = scene(vec![("heart", 1, ball(0.0, 9.0)), ("other", 1, ball(60.0, 9.0))]);
    let beat = |name: &str, x: f32| Field {
        name: name.into(),
        surfaces: vec![name.into()],
        shape: Shape::Beat {
            centre_mm: Vec3::new(x, 0.0, 0.0),
            axis: Vec3::Z,
            radius_mm: 9.0,
            squeeze: 0.3,
            shorten: 0.0,
        },
        rhythm: Rhythm::Heart { beats_per_min: 60.0 },
    };
    scene.motion.fields = vec![beat("heart", 0.0), beat("other", 60.0)];
    let mut watch = TipWatch::new(&scene).unwrap();
    let mut found = Vec::new();
    // To the other ball and back. Both contract once a second.
    for i in 0..=80 {
        let time_s = 0.05 * f64::from(i);
        let x = 60.0 * (1.0 - (time_s / 2.0 - 1.0).abs());
        watch.set_scene_time_s(time_s);
        for event in watch.advance(time_s, at(x)) {
            let centre_x = if event.surface == 0 { 0.0 } else { 60.0 };
            let field = &scene.motion.fields[event.surface];
            let border =
                field.shape.moved(Vec3::new(centre_x + 9.0, 0.0, 0.0), field.rhythm.at(time_s).map(|a| a as f32));
            let (radius_mm, from_centre_mm) =
                (f64::from(border.x - centre_x), event.position_mm.distance(at(centre_x.into())));
            assert!((from_centre_mm - radius_mm).abs() < 1.0, "{event:?}: {radius_mm} mm at {time_s} s");
            found.push(event);
        }
    }
    let kinds: Vec<_> = found.iter().map(|event| (event.surface, event.kind)).collect();
    assert_eq!(kinds, [(0, Left), (1, Entered), (1, Left), (0, ReEntered)], "{found:?}");
}

fn overlapping() -> Scene {
    scene(vec![
        ("block", 1, block([-12.0, -9.0, -7.0], [12.0, 9.0, 7.0])),
        ("ball", 2, ball(-6.0, 8.0)),
        ("other", 2, ball(5.0, 7.0)),
        ("core", 5, block([-3.0; 3], [3.0; 3])),
    ])
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: 400, ..ProptestConfig::default() })]

    #[test]
    fn crossings_of_segments_agree_with_the_insides_of_their_ends(
        points in prop::collection::vec(prop::array::uniform3(-16.0..16.0_f64), 2..6),
        // Coordinates on a grid hit edges and corners.
        rounded in any::<bool>(),
    ) {
        let mut watch = TipWatch::new(&overlapping()).unwrap();
        let mut entered = [false; 4];
        for (i, point) in points.iter().enumerate() {
            let point = DVec3::from_array(point.map(|x| if rounded { x.round() } else { x }));
            let time_s = 0.1 * i as f64;
            if let Some(last) = watch.last {
                // The hits alone lead to the right winding numbers, without a correction at the end.
                let mut alone = watch.clone();
                let position_mm = point + OFFSET_MM;
                alone.step(last, Place { time_s, position_mm }, &mut Vec::new());
                let windings: Vec<i32> = alone.surfaces.iter().map(|surface| surface.winding).collect();
                prop_assert_eq!(windings, watch.bvh.windings(position_mm, 4));
            }
            let is_first = watch.last.is_none();
            for event in watch.advance(time_s, point) {
                let inside = &mut entered[event.surface];
                prop_assert_eq!(*inside, event.kind == Left, "events alternate");
                *inside = !*inside;
            }
            if is_first {
                entered = std::array::from_fn(|surface| watch.is_inside(surface));
            }
            for (surface, entered) in entered.iter().enumerate() {
                prop_assert!(!entered || watch.is_inside(surface));
            }
            let medium = watch.medium();
            prop_assert!(medium.is_none_or(|medium| entered[medium]));
            // Analytic insides, where the point is not within the facets' error of a surface.
            let box_mm = (point.abs() - DVec3::new(12.0, 9.0, 7.0)).max_element();
            if box_mm.abs() > 0.01 {
                prop_assert_eq!(watch.is_inside(0), box_mm < 0.0);
            }
            let ball_mm = point.distance(DVec3::X * -6.0) - 8.0;
            if ball_mm.abs() > 0.05 {
                prop_assert_eq!(watch.is_inside(1), ball_mm < 0.0);
            }
        }
    }
}
