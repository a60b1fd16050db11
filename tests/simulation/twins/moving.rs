//! Tests of scenes that move: every pass matches its twin at any time, a scene at rest is unchanged, and speckle moves
//! with its tissue.

use glam::{DVec3, Vec3};
use insonify::anatomy::motion::{Drift, Field, Rhythm, Shape};
use insonify::anatomy::{Motion, Scene, analytic};
use insonify::pose::Pose;
use insonify::render::{Choice, Effect, Frame, ShaderSet};
use insonify::transducer::ProbeKind;

use crate::twins::across::assert_alike;
use crate::twins::compare::{PASSES, compare};
use crate::twins::compare_motion::MOTION_PASSES;
use crate::twins::reconfigure::untimed;
use crate::twins::scenes::{Case, RENDERED, nested, part, probe, scene, settings};

/// Scene time of full systole, during a movement of the limb, s.
pub(crate) const TIME_S: f64 = 0.6;

/// The nested case with a beating kidney and cyst, and a swinging bone.
pub(crate) fn beating() -> Case {
    let mut case = nested();
    let field = |name: &str, surfaces: &[&str], shape, rhythm| Field {
        name: name.into(),
        surfaces: surfaces.iter().map(|&s| s.into()).collect(),
        shape,
        rhythm,
    };
    let (centre_mm, axis) = (Vec3::new(6.0, 0.0, 45.0), Vec3::new(0.2, 0.4, 1.0));
    let beat = Shape::Beat { centre_mm, axis, radius_mm: 16.0, squeeze: 0.3, shorten: 0.2 };
    let (joint_mm, end_mm) = (Vec3::new(-14.0, -30.0, 33.0), Vec3::new(-14.0, 40.0, 33.0));
    let swing = Shape::Swing { joint_mm, end_mm, axis: Vec3::X, radius_mm: 10.0, angle_deg: 12.0 };
    case.scene.motion = Motion {
        fields: vec![
            field("heart", &["kidney", "cyst"], beat, Rhythm::Heart { beats_per_min: 120.0 }),
            field("limb", &["bone"], swing, Rhythm::Twitch { every_s: 1.0, lasts_s: 0.5, seed: 4 }),
        ],
        drift: None,
    };
    case
}

/// The case [`beating`] within breathing fat.
fn breathing() -> Case {
    let mut case = beating();
    let names = case.scene.surfaces.iter().map(|surface| surface.name.clone());
    let surfaces = names.filter(|name| !["kidney", "cyst", "bone"].contains(&name.as_str())).collect();
    let shape = Shape::Breath {
        centre_mm: Vec3::new(0.0, 0.0, 40.0),
        axis: Vec3::X,
        half_length_mm: 60.0,
        radius_mm: 50.0,
        widen: 0.05,
        shift_mm: 6.0,
    };
    let rhythm = Rhythm::Breath { breaths_per_min: 60.0, bout_s: 1.0, pause_s: 0.0, seed: 0 };
    case.scene.motion.fields.push(Field { name: "breath".into(), surfaces, shape, rhythm });
    case
}

#[test]
fn every_pass_is_its_twin_while_the_scene_moves() {
    let case = breathing();
    let mut renderer = case.renderer(&ShaderSet::default());
    for time_s in [TIME_S, 0.97, 0.05] {
        renderer.set_time_s(time_s);
        let snapshot = renderer.snapshot(&case.pose).unwrap();
        let moved = snapshot.inputs.triangles.iter().filter(|t| t.displacement_mm.length() > 0.5).count();
        assert!(moved > 100 || time_s != TIME_S, "{moved} triangles moved");
        let wrong: Vec<_> = PASSES.iter().filter_map(|pass| compare(pass, &snapshot).err()).collect();
        assert!(wrong.is_empty(), "at {time_s} s: {wrong:#?}");
    }
    // The host moves its triangles and trees itself.
    let mut renderer = case.host_renderer();
    renderer.set_time_s(TIME_S);
    let snapshot = renderer.snapshot(&case.pose).unwrap();
    let wrong: Vec<_> = MOTION_PASSES.iter().filter_map(|pass| compare(pass, &snapshot).err()).collect();
    assert!(wrong.is_empty(), "on the host: {wrong:#?}");
    let mut damaged = ShaderSet::default();
    assert!(damaged.replace("trace", "vec3<f32>(0.0), displacements[chosen].xyz", "vec3<f32>(0.0), vec3<f32>(0.0)"));
    let mut renderer = case.renderer(&damaged);
    renderer.set_time_s(TIME_S);
    let snapshot = renderer.snapshot(&case.pose).unwrap();
    assert!(compare("trace", &snapshot).is_err(), "speckle that stays behind is not caught");
}

#[test]
fn damaged_motion_is_caught() {
    let case = breathing();
    let damages = [
        ("displace", "ATRIA * field.amounts.y", "0.0 * field.amounts.y", 0.97),
        ("displace", "field.axis * (field.form.z * inside)", "0.0 * field.axis", TIME_S),
        ("displace", "2.0 * half.y", "half.y", TIME_S),
        ("assemble", "let edge2 = c - a;", "let edge2 = c - b;", TIME_S),
        ("assemble", "* (1.0 / 3.0)", "* 0.5", TIME_S),
        ("refit", "let high = ceil(", "let high = floor(", TIME_S),
        ("refit", "all.high, max(a, max(b, c))", "all.high, max(a, b)", TIME_S),
    ];
    for (pass, from, to, time_s) in damages {
        let mut shaders = ShaderSet::default();
        assert!(shaders.replace(pass, from, to), "{pass} has no `{from}` to damage");
        let compared = [ShaderSet::default(), shaders].map(|shaders| {
            let mut renderer = case.renderer(&shaders);
            renderer.set_time_s(time_s);
            compare(pass, &renderer.snapshot(&case.pose).unwrap()).is_ok()
        });
        assert_eq!(compared, [true, false], "{pass} with `{to}`");
    }
}

#[test]
fn motion_does_not_depend_on_the_way() {
    let case = breathing();
    let mut frames = [Frame::default(), Frame::default()];
    for (frame, way) in frames.iter_mut().zip([&[TIME_S][..], &[0.3, 0.97, TIME_S]]) {
        let mut renderer = case.renderer(&ShaderSet::default());
        for &time_s in way {
            renderer.set_time_s(time_s);
            renderer.render(&case.pose, frame).unwrap();
        }
    }
    let [direct, on_a_way] = frames.map(untimed);
    assert!(direct == on_a_way);
}

#[test]
fn a_moved_scene_is_cut_as_one_that_was_built_there() {
    let case = beating();
    let mut renderer = case.renderer(&ShaderSet::default());
    let (mut frame, mut fresh) = (Frame::default(), Frame::default());
    for time_s in [TIME_S, 0.05] {
        renderer.set_time_s(time_s);
        renderer.render(&case.pose, &mut frame).unwrap();
        let displaced = case.scene.displaced(time_s);
        let there = Case { scene: Scene { motion: Motion::default(), ..displaced }, ..beating() };
        there.renderer(&ShaderSet::default()).render(&case.pose, &mut fresh).unwrap();
        // The device rounds its corners otherwise: an edge may lie in the pixel beside.
        let other = |i: &usize| {
            frame.segmentation[*i] != fresh.segmentation[*i]
                || (frame.attenuation[*i] - fresh.attenuation[*i]).abs() > 1.0e-3
        };
        let others = (0..frame.segmentation.len()).filter(other).count();
        assert!(others <= frame.segmentation.len() / 2000, "{others} pixels differ at {time_s} s");
    }
    // Back at rest, the frame is the one rendered without motion, by other pipelines.
    renderer.set_time_s(0.0);
    renderer.render(&case.pose, &mut frame).unwrap();
    let rest = RENDERED.iter().find(|r| r.name == case.name).unwrap();
    assert_alike(&frame, &rest.frame, "at rest");
}

#[test]
fn a_frame_in_flight_keeps_its_time() {
    let case = beating();
    let mut renderer = case.renderer(&ShaderSet::default());
    let mut frames = [Frame::default(), Frame::default(), Frame::default()];
    for (frame, time_s) in frames.iter_mut().zip([TIME_S, 0.05]) {
        renderer.set_time_s(time_s);
        renderer.render(&case.pose, frame).unwrap();
    }
    renderer.set_time_s(TIME_S);
    renderer.submit(&case.pose).unwrap();
    renderer.set_time_s(0.05);
    renderer.submit(&case.pose).unwrap();
    let [first, second, found] = &mut frames;
    for expected in [first, second] {
        renderer.receive(found).unwrap();
        assert!(found.bmode == expected.bmode && found.segmentation == expected.segmentation);
    }
}

#[test]
fn a_drift_moves_the_scene_under_the_probe() {
    let mut case = nested();
    let rhythm = Rhythm::Breath { breaths_per_min: 30.0, bout_s: 1.0, pause_s: 0.0, seed: 0 };
    let way_mm = Vec3::new(1.0, -2.0, 4.0);
    case.scene.motion.drift = Some(Drift { way_mm, rhythm });
    // Each time has its own noise.
    case.settings.effects = case.settings.effects.with(Effect::Noise, Choice::Off);
    let mut renderer = case.renderer(&ShaderSet::default());
    let (mut drifted, mut other) = (Frame::default(), Frame::default());
    // The peak of a breath.
    renderer.set_time_s(1.0);
    renderer.render(&case.pose, &mut drifted).unwrap();
    renderer.set_time_s(0.0);
    let moved = Pose { position_mm: case.pose.position_mm - DVec3::new(1.0, -2.0, 4.0), ..case.pose };
    renderer.render(&moved, &mut other).unwrap();
    assert!(drifted.bmode == other.bmode);
    renderer.render(&case.pose, &mut other).unwrap();
    assert!(drifted.bmode != other.bmode);
}

/// Correlation of the grey levels in two windows of `size` pixels, at `at` in `a` and at `bt` in `b`.
fn correlation(a: &Frame, at: (usize, usize), b: &Frame, bt: (usize, usize), size: (usize, usize)) -> f64 {
    let width = a.width as usize;
    let window = |frame: &Frame, (x, y): (usize, usize)| -> Vec<f64> {
        let rows = frame.bmode.chunks_exact(width).skip(y).take(size.1);
        rows.flat_map(|row| row[x..x + size.0].to_vec()).map(f64::from).collect()
    };
    let (a, b) = (window(a, at), window(b, bt));
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let (ma, mb) = (mean(&a), mean(&b));
    let sum = |f: &dyn Fn(f64, f64) -> f64| a.iter().zip(&b).map(|(&x, &y)| f(x - ma, y - mb)).sum::<f64>();
    sum(&|x, y| x * y) / (sum(&|x, _| x * x) * sum(&|_, y| y * y)).sqrt()
}

#[test]
fn speckle_goes_with_its_tissue() {
    let mut scene = scene(vec![part("ball", "liver", 1, analytic::sphere(Vec3::new(0.0, 0.0, 30.0), 12.0, 4))], "gel");
    // A rotation about a distant joint is nearly a shift: 5 mm to the side.
    let (joint_mm, end_mm) = (Vec3::new(0.0, 0.0, -2000.0), Vec3::new(0.0, 0.0, 60.0));
    let shape = Shape::Swing { joint_mm, end_mm, axis: Vec3::Y, radius_mm: 40.0, angle_deg: 0.14 };
    let rhythm = Rhythm::Breath { breaths_per_min: 30.0, bout_s: 1.0, pause_s: 0.0, seed: 0 };
    scene.motion.fields = vec![Field { name: "turn".into(), surfaces: vec!["ball".into()], shape, rhythm }];
    let mut settings = settings((1, 1), 400);
    settings.image.height = 400;
    // At least one scanline per lattice cell; otherwise other scatterers would show after the shift.
    let probe = probe(ProbeKind::Linear { width_mm: 40.0 }, 50.0, 512, 1024);
    let pose = Pose::from_components([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]).unwrap();
    let case = Case { name: "ball", scene, probe, settings, pose };

    let frames = |shaders: &ShaderSet| {
        let mut renderer = case.renderer(shaders);
        let mut frames = [Frame::default(), Frame::default()];
        renderer.render(&pose, &mut frames[0]).unwrap();
        renderer.set_time_s(1.0);
        renderer.render(&pose, &mut frames[1]).unwrap();
        (frames, renderer.sector().pixel_mm)
    };
    let ([rest, moved], pixel_mm) = frames(&ShaderSet::default());
    let centroid = |frame: &Frame| {
        let ball =
            (0..frame.segmentation.len()).filter(|&i| frame.segmentation[i] == frame.segmentation[240 * 400 + 200]);
        let columns: Vec<f64> = ball.map(|i| (i % 400) as f64).collect();
        columns.iter().sum::<f64>() / columns.len() as f64
    };
    let shift = centroid(&moved) - centroid(&rest);
    assert!((shift * pixel_mm - 4.96).abs() < 0.15, "the ball moved by {} mm", shift * pixel_mm);

    let size = (50, 60);
    let (x, y) = (175, 210);
    let best = |moved: &Frame| {
        let shifted = (0..=80).map(|by| (correlation(&rest, (x, y), moved, (x + by - 10, y), size), by as f64 - 10.0));
        shifted.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap()
    };
    let (match_with, by) = best(&moved);
    assert!(match_with > 0.7 && (by - shift).abs() <= 2.0, "speckle moved by {by} pixels of {shift}: {match_with}");

    let mut behind = ShaderSet::default();
    assert!(behind.replace("trace", "vec3<f32>(0.0), displacements[chosen].xyz", "vec3<f32>(0.0), vec3<f32>(0.0)"));
    let (_, by) = best(&frames(&behind).0[1]);
    assert!(by.abs() <= 1.0, "without it speckle stays behind, here it moved by {by}");
}
