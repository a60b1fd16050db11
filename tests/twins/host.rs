//! The paths that the host follows against their f64 twin; that wrong ones are caught, and that no thread changes a frame.

use insonify::render::{Choice, Frame, FrameTimes, Quality, ShaderSet, Snapshot, TraceConstants};

use crate::WITHOUT;
use crate::compare::{PASSES, compare};
use crate::moving::{TIME_S, beating};
use crate::scenes::{Case, RENDERED, TRACED_BY_HOST, cases, nested};

/// The passes that the host does, and those that read what they wrote.
const COMPARED: [&str; 4] = ["locate", "trace", "march", "echo"];

fn snapshot(case: &Case, shaders: &ShaderSet) -> Snapshot {
    case.renderer_on(&TRACED_BY_HOST, shaders).snapshot(&case.pose).unwrap()
}

fn untimed(frame: Frame) -> Frame {
    Frame { times: FrameTimes::default(), ..frame }
}

#[test]
fn the_host_follows_paths_as_their_twin() {
    let mut wrong = Vec::new();
    for case in cases() {
        println!("--- {}", case.name);
        let snapshot = snapshot(&case, &ShaderSet::default());
        assert_eq!(snapshot.overflows, 0, "{}", case.name);
        wrong.extend(PASSES.iter().filter_map(|pass| compare(pass, &snapshot).err()).map(|e| (case.name, e)));
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn without_some_effects_the_host_follows_paths_as_their_twin() {
    let mut wrong = Vec::new();
    for group in WITHOUT {
        let mut case = nested();
        for &effect in group {
            case.settings.effects = case.settings.effects.with(effect, Choice::Off);
        }
        println!("--- without {group:?}");
        let snapshot = snapshot(&case, &ShaderSet::default());
        wrong.extend(COMPARED[..2].iter().filter_map(|pass| compare(pass, &snapshot).err()).map(|e| (group, e)));
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn the_host_follows_paths_through_what_moves() {
    let case = beating();
    let mut renderer = case.renderer_on(&TRACED_BY_HOST, &ShaderSet::default());
    for time_s in [TIME_S, 0.97, 0.05] {
        renderer.set_time_s(time_s);
        let snapshot = renderer.snapshot(&case.pose).unwrap();
        let wrong: Vec<_> = COMPARED.iter().filter_map(|pass| compare(pass, &snapshot).err()).collect();
        assert!(wrong.is_empty(), "at {time_s} s: {wrong:#?}");
    }
    // A frame in flight keeps its time.
    let mut frames = [Frame::default(), Frame::default()];
    for (frame, time_s) in frames.iter_mut().zip([TIME_S, 0.05]) {
        renderer.set_time_s(time_s);
        renderer.render(&case.pose, frame).unwrap();
    }
    for time_s in [TIME_S, 0.05] {
        renderer.set_time_s(time_s);
        renderer.submit(&case.pose).unwrap();
    }
    let mut found = Frame::default();
    for expected in frames {
        renderer.receive(&mut found).unwrap();
        assert!(untimed(found.clone()) == untimed(expected));
    }
}

#[test]
fn wrong_paths_of_the_host_are_caught() {
    type Damage = fn(&mut TraceConstants);
    let damages: [(&str, &str, Damage); 4] = [
        ("nothing behind the face is looked for", "locate", |c| c.reach = 0.0),
        ("reflections are left to their weight", "trace", |c| c.reflection_followed = 2.0),
        ("echoes are offset by another cell", "trace", |c| c.off_the_grid_mm = 0.07),
        ("rough surfaces return twice as much", "trace", |c| c.diffuse *= 2.0),
    ];
    let case = nested();
    for (what, pass, damage) in damages {
        let mut shaders = ShaderSet::default();
        damage(&mut shaders.host);
        assert!(compare(pass, &snapshot(&case, &shaders)).is_err(), "{pass}: {what}");
    }
}

#[test]
fn frames_are_the_same_whatever_the_threads() {
    let case = nested();
    let frame = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut renderer = case.renderer_on(&TRACED_BY_HOST, &ShaderSet::default());
            let mut frames = [Frame::default(), Frame::default()];
            for frame in &mut frames {
                renderer.render(&case.pose, frame).unwrap();
            }
            frames.map(untimed)
        })
    };
    let [first, again] = frame(1);
    assert!(first == again);
    assert!(frame(3) == [again, first]);
}

#[test]
fn frames_of_the_host_and_of_the_device_hardly_differ() {
    for case in cases() {
        let mut host = Frame::default();
        case.renderer_on(&TRACED_BY_HOST, &ShaderSet::default()).render(&case.pose, &mut host).unwrap();
        let device = &RENDERED.iter().find(|r| r.name == case.name).unwrap().frame;
        // Straight rays of the maps are the device's.
        assert!(host.segmentation == device.segmentation && host.attenuation == device.attenuation, "{}", case.name);
        let pairs = host.bmode.iter().zip(&device.bmode);
        let other = pairs.filter(|(a, b)| a.abs_diff(**b) > 1).count();
        println!("{}: {other} of {} pixels differ", case.name, host.bmode.len());
        assert!(other * 50 < host.bmode.len(), "{}: {other} pixels", case.name);
        // The pass is there with the host's time, and what it took in is not.
        assert_eq!(host.times.passes[0].name, "trace");
        assert!(host.times.passes[0].ms > 0.0 && host.times.passes.iter().all(|p| p.name != "locate"));
    }
}

#[test]
fn layers_in_turns_are_one_frame() {
    // More paths than a batch holds: 33 scanlines × 200 rays × 10 layers.
    let mut case = nested();
    case.probe.samples = 64;
    case.settings.quality = Quality { rays: 200, layers: 10, seed: 3 };
    let mut renderer = case.renderer_on(&TRACED_BY_HOST, &ShaderSet::default());
    assert!(renderer.snapshot(&case.pose).is_err(), "the layers fit into one batch");
    let mut frame = Frame::default();
    renderer.render(&case.pose, &mut frame).unwrap();
    let host = untimed(frame.clone());
    renderer.render(&case.pose, &mut frame).unwrap();
    assert!(untimed(frame.clone()) == host);
    // The device takes them in the same turns.
    case.renderer(&ShaderSet::default()).render(&case.pose, &mut frame).unwrap();
    let other = host.bmode.iter().zip(&frame.bmode).filter(|(a, b)| a.abs_diff(**b) > 1).count();
    assert!(other * 50 < host.bmode.len(), "{other} pixels");
}
