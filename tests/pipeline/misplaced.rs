//! A probe where no hand can hold it is reported on the frames, in the status, the summary and the recording.

use glam::Vec3;
use insonify::anatomy::analytic::cuboid;
use insonify::anatomy::export::{LabelledSurface, write_glb};
use insonify::transducer::Misplacement;
use insonify::transducer::placement::{Cause, Fault};

use super::program::insonify;
use super::*;

const DEEP: Misplacement = Misplacement { fault: Fault::Deep { depth_mm: 83.4 }, likely: Some(Cause::Metres) };

fn contact(misplaced: Option<Misplacement>) -> Contact {
    Contact { part: 1.0, press_mm: Some(83.4), shift_mm: 0.0, misplaced }
}

#[test]
fn a_probe_deep_in_the_body_for_seconds_is_told_everywhere_until_it_is_right() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let heard = Arc::<Heard>::default();
    // From 1 s to 6 s, and for a moment at 8 s.
    let wrong = |now: Duration| (SECOND..6 * SECOND).contains(&now) || (8 * SECOND..9 * SECOND).contains(&now);
    let touch: Arc<Touch> = Arc::new(move |now| Some(contact(wrong(now).then_some(DEEP))));
    let mut told = Vec::new();
    let observer = Some(heard.clone() as Arc<dyn Observer>);
    let session = Session { contact: touch, observer, sinks: vec![logger(&log)], ..Session::new(&clock, moving) };
    let summary = session.run_watched(|status| told.push((status.elapsed_s, status.misplaced)));

    let noticed: Vec<f64> = seen(&log)
        .iter()
        .filter(|frame| frame.notice.as_deref().is_some_and(|notice| notice.contains("83 mm deep in the body")))
        .map(|frame| frame.presented.as_secs_f64())
        .collect();
    let (first, last) = (noticed[0], noticed[noticed.len() - 1]);
    assert!((3.0..3.2).contains(&first) && (6.9..7.1).contains(&last), "{first} {last}");
    assert!(noticed.len() > 70, "it stays on the frames: {}", noticed.len());
    let frames = summary.misplaced.deep as f64 / 20.0;
    assert!((frames - 4.0).abs() < 0.3, "{frames} s");
    assert_eq!((summary.misplaced.looks_out, summary.misplaced.latest), (0, Some(DEEP)));
    let text = summary.to_string();
    assert!(text.contains("frames deep in the body") && text.contains("times 1000"), "{text}");
    assert!(told.iter().all(|(at, found)| found.is_some() == (3.1..7.01).contains(at)), "{told:?}");
    let events: Vec<String> = heard.0.lock().unwrap().events.iter().map(|(_, text)| text.clone()).collect();
    let of_poses: Vec<&String> = events.iter().filter(|text| text.starts_with("pose:")).collect();
    assert_eq!(of_poses.len(), 2, "{events:?}");
    assert!(of_poses[0].contains("positions in metres") && of_poses[1].contains("can hold it"), "{events:?}");
}

#[test]
fn a_probe_that_never_touches_the_skin_is_told_once() {
    let _guard = beside_others();
    let run = |contact: Option<f64>, touches_at: Duration| {
        let (clock, log, heard) = (clock(), Log::default(), Arc::<Heard>::default());
        let touch: Arc<Touch> = Arc::new(move |now: Duration| {
            let part = if now >= touches_at { 1.0 } else { contact? };
            Some(Contact { part, press_mm: None, shift_mm: 0.0, misplaced: None })
        });
        let poses = |now: Duration| tracked(now, 0.3 * now.as_secs_f64().sin().abs());
        let observer = Some(heard.clone() as Arc<dyn Observer>);
        let limits = Limits { duration: Some(30 * SECOND), frames: None };
        let sinks = vec![logger(&log)];
        let summary = Session { contact: touch, observer, sinks, limits, ..Session::new(&clock, poses) }.run();
        let noticed = |notice: &Option<String>| notice.as_deref().is_some_and(|text| text.contains("not touched"));
        let times: Vec<f64> =
            seen(&log).iter().filter(|f| noticed(&f.notice)).map(|f| f.presented.as_secs_f64()).collect();
        let events = heard.0.lock().unwrap().events.iter().filter(|(_, text)| text.starts_with("pose:")).count();
        (summary, times, events)
    };
    let never = 100 * SECOND;
    let (summary, times, events) = run(Some(0.0), never);
    assert_eq!(events, 1);
    assert!((20.0..20.2).contains(&times[0]) && (24.8..25.2).contains(&times[times.len() - 1]), "{times:?}");
    let text = summary.to_string();
    assert!(text.contains("in 20 s of good poses: it is 300 mm from it and moved within 0.3 mm"), "{text}");
    // A touch after that is in the summary's favour, one before it leaves nothing to tell.
    let (summary, times, _) = run(Some(0.0), 27 * SECOND);
    assert!(summary.misplaced.untouched.is_none() && !times.is_empty());
    let (summary, times, events) = run(Some(0.0), 3 * SECOND);
    assert!(summary.misplaced.untouched.is_none() && times.is_empty() && events == 0);
    // A scene without skin.
    let (summary, times, events) = run(None, never);
    assert!(summary.misplaced.untouched.is_none() && times.is_empty() && events == 0);
}

#[test]
fn what_is_told_of_a_probe_ends_when_its_tracking_is_lost() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let touch: Arc<Touch> = Arc::new(|_| Some(contact(Some(DEEP))));
    let poses = |now: Duration| if now < 3 * SECOND { moving(now) } else { Estimate::default() };
    Session { contact: touch, sinks: vec![logger(&log)], ..Session::new(&clock, poses) }.run();
    let frames = seen(&log);
    let noticed = |from: Duration, to: Duration, text: &str| {
        let within = frames.iter().filter(|frame| (from..to).contains(&frame.presented));
        within.filter(|frame| frame.notice.as_deref().is_some_and(|notice| notice.contains(text))).count()
    };
    assert!(noticed(2 * SECOND, 3 * SECOND, "83 mm deep in the body") > 15);
    // For five seconds the loss itself is told.
    assert!(noticed(3 * SECOND, 8 * SECOND, "tracking lost") > 90);
    assert_eq!(noticed(4 * SECOND, 10 * SECOND, "83 mm deep in the body"), 0);
}

#[test]
fn a_still_from_within_the_body_is_warned_of() {
    let _guard = beside_others();
    let directory = tempfile::tempdir().unwrap();
    let mesh = cuboid(Vec3::new(-150.0, -150.0, 0.0), Vec3::new(150.0, 150.0, 200.0));
    let body = LabelledSurface { name: "body".into(), tissue: "skin".into(), priority: 1, mesh };
    write_glb(&[body], &directory.path().join("scene.glb")).unwrap();
    let station = directory.path().join("station.toml");
    let tables =
        "[scene]\npath = 'scene.glb'\n[image]\nwidth = 160\nheight = 120\n[probe]\nscanlines = 32\nsamples = 256\n";
    std::fs::write(&station, tables).unwrap();
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/scenes/gallbladder_stones.glb");
    let slab = directory.path().join("slab.toml");
    std::fs::write(&slab, tables.replace("scene.glb", scene)).unwrap();
    let render_in = |station: &Path, pose: &str| {
        let out = directory.path().join("frame");
        let arguments = ["render", station.to_str().unwrap(), "--quality", "1x1", "--pose", pose, "--out"];
        let output = insonify(&arguments).arg(&out).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        let record: Value = serde_json::from_slice(&std::fs::read(out.join("frame.json")).unwrap()).unwrap();
        (String::from_utf8(output.stderr).unwrap(), record["contact"]["misplaced"].clone())
    };
    let render = |pose: &str| render_in(&station, pose);
    let (said, recorded) = render("0,0,100,1,0,0,0");
    assert!(said.contains("100 mm deep in the body") && said.contains("calibrate landmarks"), "{said}");
    assert_eq!(recorded["fault"], "deep");
    let (said, recorded) = render("0,0,6,0,1,0,0");
    assert!(said.contains("looks out of the body"), "{said}");
    assert_eq!(recorded["fault"], "looks_out");
    let (said, recorded) = render("0,0,6,1,0,0,0");
    assert!(!said.contains("pose:") && recorded.is_null(), "{said}");
    // A skin that is a slab over the body.
    let (said, recorded) = render_in(&slab, "0,0,60,1,0,0,0");
    assert!(said.contains("deep in the body") && recorded["fault"] == "deep", "{said}");
    assert_eq!(render_in(&slab, "0,0,6,0,1,0,0").1["fault"], "looks_out");
    assert!(render_in(&slab, "0,0,1,1,0,0,0").1.is_null());
}
