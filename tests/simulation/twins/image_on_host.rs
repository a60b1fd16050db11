//! Comparison of every pass on the host with its f64 twin. Damaged passes are detected, the number of threads changes
//! no frame, and frames in flight, new settings and maps behave as on a device.

use insonify::render::{Choice, Frame, ImageConstants, Quality, RenderSettings, ShaderSet, Snapshot, TestHooks, twin};
use insonify::settings::{ImageSettings, SettingsGroup};

use crate::twins::WITHOUT;
use crate::twins::compare::{PASSES, compare};
use crate::twins::moving::{TIME_S, beating};
use crate::twins::reconfigure::{CHANGES, changed, untimed};
use crate::twins::scenes::{Case, HOST, RENDERED, cases, nested};

fn snapshot(case: &Case) -> Snapshot {
    case.host_renderer().snapshot(&case.pose).unwrap()
}

fn frame(case: &Case) -> Frame {
    let mut frame = Frame::default();
    case.host_renderer().render(&case.pose, &mut frame).unwrap();
    untimed(frame)
}

#[test]
fn every_pass_of_the_host_is_its_twin() {
    let mut wrong = Vec::new();
    for case in cases() {
        println!("--- {}", case.name);
        let snapshot = snapshot(&case);
        assert_eq!(snapshot.overflows, 0, "{}", case.name);
        wrong.extend(PASSES.iter().filter_map(|pass| compare(pass, &snapshot).err()).map(|e| (case.name, e)));
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn without_some_effects_every_pass_of_the_host_is_its_twin() {
    let mut wrong = Vec::new();
    for group in WITHOUT {
        let mut case = nested();
        for &effect in group {
            case.settings.effects = case.settings.effects.with(effect, Choice::Off);
        }
        println!("--- without {group:?}");
        let snapshot = snapshot(&case);
        // Without interface echoes there is nothing to compare.
        let compared = |pass: &&&str| **pass != "echo" || !group.contains(&insonify::render::Effect::InterfaceEchoes);
        let wrong_here = PASSES.iter().filter(compared).filter_map(|pass| compare(pass, &snapshot).err());
        wrong.extend(wrong_here.map(|e| (group, e)));
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn at_another_value_of_each_image_setting_host_device_and_twin_agree() {
    let begun = frame(&nested());
    for setting in ImageSettings::settings() {
        let case = changed(setting);
        assert!(frame(&case) != begun, "{}: no pass of the host reads it", setting.path);
        for snapshot in [snapshot(&case), case.renderer(&ShaderSet::default()).snapshot(&case.pose).unwrap()] {
            for pass in ["detect", "scan_convert"] {
                assert_eq!(compare(pass, &snapshot).err().map(|e| format!("{e:?}")), None, "{}", setting.path);
            }
        }
    }
}

#[test]
fn a_damaged_pass_of_the_host_is_caught() {
    type Damage = fn(&mut ImageConstants);
    let damages: [(&str, &str, Damage); 13] = [
        ("one amplitude for all scatterers of a cell", "march", |c| c.scatterer_stride = 0),
        ("a sheet of scatterers too few", "march", |c| c.sheets_to_a_side = 0.5),
        ("obstacles hardly lose anything", "transmission", |c| c.loss_max_np = 0.1),
        ("the first obstacles hide nothing", "propagate", |c| (c.contrast_min, c.phase_min) = (0.5, 10.0)),
        ("no beam returns a power", "profiles", |c| c.unobstructed_min = 1.0e30),
        ("beams are never brighter than half", "visibility", |c| c.visible_max_np = -0.7),
        ("an interface is left out", "echo", |c| c.first_interface = 2),
        ("the beam without its flanks", "lateral", |c| c.least_weight = 0.05),
        ("the receiver adds too little", "receive", |c| c.added = 0.9),
        ("decibels of power as of amplitude", "detect", |c| c.db_a_doubling *= 2.0),
        ("two-way attenuation in the map", "section", |c| c.one_way = 1.0),
        ("another percentile", "percentile", |c| c.brightest_part = 0.05),
        ("segmentation off by one", "scan_convert", |c| c.first_number = 2),
    ];
    let case = nested();
    for (what, pass, damage) in damages {
        let mut hooks = TestHooks::default();
        damage(&mut hooks.image);
        let snapshot = case.renderer_on(&HOST, &hooks).snapshot(&case.pose).unwrap();
        assert!(compare(pass, &snapshot).is_err(), "{pass}: {what}");
    }
}

#[test]
fn from_pose_to_image_the_host_and_the_twins_show_the_same() {
    for case in cases() {
        let device = RENDERED.iter().find(|r| r.name == case.name).unwrap();
        let (host, twin) = (frame(&case), twin::frame(&device.snapshot.inputs));
        let inside: Vec<usize> = (0..twin.grey.len()).filter(|&i| host.mask[i] == 255).collect();
        let mut errors: Vec<f64> = inside.iter().map(|&i| (f64::from(host.bmode[i]) - twin.grey[i]).abs()).collect();
        errors.sort_by(f64::total_cmp);
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        let p99 = errors[errors.len() * 99 / 100];
        let other = inside.iter().filter(|&&i| host.segmentation[i] != twin.segmentation[i]).count();
        let level = inside.iter().map(|&i| (f64::from(host.attenuation[i]) - twin.attenuation[i]).abs());
        let level = level.sum::<f64>() / errors.len() as f64;
        println!("{}: grey off by {mean:.3}, p99 {p99:.2}; {other} pixels of another tissue; {level:.1e}", case.name);
        assert!(mean < 1.0 && p99 < 4.0, "{}: mean {mean}, p99 {p99}", case.name);
        assert!((other as f64) < 0.005 * inside.len() as f64, "{}: {other} pixels", case.name);
        assert!(level < 1.0e-3, "{}: {level}", case.name);
        // Nothing is shown outside the sector.
        let beside = (0..host.mask.len()).filter(|&i| host.mask[i] == 0);
        assert!(
            beside.into_iter().all(|i| host.bmode[i] == 0 && host.segmentation[i] == 0 && host.attenuation[i] == 0.0)
        );
        assert_eq!(host.lines.len(), device.frame.lines.len());
    }
}

#[test]
fn a_snapshot_of_the_host_is_its_frame() {
    for case in cases() {
        let (frame, snapshot) = (frame(&case), snapshot(&case));
        assert_eq!(frame.bmode, snapshot.bmode, "{}", case.name);
        assert_eq!(frame.segmentation, snapshot.segmentation, "{}", case.name);
        let levels: Vec<f64> = frame.attenuation.iter().map(|&a| a.into()).collect();
        assert_eq!(levels, snapshot.attenuation, "{}", case.name);
        let lines: Vec<_> = frame.lines.iter().map(|&[re, im]| glam::DVec2::new(re.into(), im.into())).collect();
        assert_eq!(lines, snapshot.lines, "{}", case.name);
    }
}

#[test]
fn frames_of_the_host_are_the_same_whatever_the_threads() {
    let case = nested();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| [frame(&case), frame(&case)])
    };
    let [first, again] = with(1);
    assert!(first == again);
    assert!(with(3) == [again, first]);
}

#[test]
fn a_host_that_was_configured_anew_is_one_built_so() {
    let start = nested();
    let begun = frame(&start);
    let mut renderer = start.host_renderer();
    let mut found = Frame::default();
    for (name, change) in CHANGES {
        let mut case = nested();
        change(&mut case.probe, &mut case.settings);
        let built = frame(&case);
        // A frame in flight keeps the settings of its submission.
        renderer.submit(&start.pose).unwrap();
        renderer.reconfigure(&case.probe, &case.settings).unwrap();
        renderer.submit(&case.pose).unwrap();
        renderer.reconfigure(&start.probe, &start.settings).unwrap();
        for expected in [&begun, &built] {
            renderer.receive(&mut found).unwrap();
            assert!(untimed(found.clone()) == *expected, "{name}");
        }
    }
}

#[test]
fn an_image_of_the_host_without_maps_is_the_image_with_them() {
    for case in cases() {
        let with = frame(&case);
        let mut renderer = case.host_renderer();
        let mut found = with.clone();
        for maps in [false, true] {
            renderer.set_maps(maps);
            renderer.submit(&case.pose).unwrap();
        }
        renderer.receive(&mut found).unwrap();
        assert!(found.segmentation.is_empty() && found.attenuation.is_empty(), "{}", case.name);
        assert_eq!(found.attenuation_p98, 0.0);
        assert!(found.times.passes.iter().all(|pass| !["section", "percentile"].contains(&pass.name)));
        assert!(found.bmode == with.bmode && found.lines == with.lines && found.mask == with.mask, "{}", case.name);
        renderer.receive(&mut found).unwrap();
        assert!(untimed(found) == with, "{}", case.name);
        let settings = RenderSettings { maps: false, lines: false, ..case.settings };
        let alone = frame(&Case { settings, ..case });
        assert!(alone.segmentation.is_empty() && alone.lines.is_empty() && alone.bmode == with.bmode);
    }
}

#[test]
fn the_host_shows_what_moves() {
    let case = beating();
    let mut renderer = case.host_renderer();
    for time_s in [TIME_S, 0.97, 0.05] {
        renderer.set_time_s(time_s);
        let snapshot = renderer.snapshot(&case.pose).unwrap();
        let wrong: Vec<_> = PASSES.iter().filter_map(|pass| compare(pass, &snapshot).err()).collect();
        assert!(wrong.is_empty(), "at {time_s} s: {wrong:#?}");
    }
}

#[test]
fn losses_of_any_strength_are_their_twins() {
    let mut wrong = Vec::new();
    for mut case in cases() {
        // Bone attenuates by more than 100 dB from one sample to the next.
        (case.probe.samples, case.probe.frequency_mhz) = (48.into(), 15.0);
        let snapshot = snapshot(&case);
        wrong.extend(
            ["trace", "march"].iter().filter_map(|pass| compare(pass, &snapshot).err()).map(|e| (case.name, e)),
        );
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn layers_in_turns_are_one_frame_of_the_host() {
    // More paths than a batch holds: 33 scanlines × 200 rays × 10 layers.
    let mut case = nested();
    case.probe.samples = 64.into();
    case.settings.quality = Quality { rays: 200, layers: 10, seed: 3 };
    let host = frame(&case);
    let mut device = Frame::default();
    case.renderer(&ShaderSet::default()).render(&case.pose, &mut device).unwrap();
    let other = host.bmode.iter().zip(&device.bmode).filter(|(a, b)| a.abs_diff(**b) > 1).count();
    assert!(other * 50 < host.bmode.len(), "{other} pixels");
    // As bright as a frame of a single batch; a missing batch would make it darker.
    case.settings.quality.rays = 40;
    let whole = frame(&case);
    let mean = |frame: &Frame| frame.bmode.iter().map(|&v| f64::from(v)).sum::<f64>() / frame.bmode.len() as f64;
    assert!((mean(&host) - mean(&whole)).abs() < 2.0, "{} and {}", mean(&host), mean(&whole));
}
