//! Choice of operating points (quality and generator) under a time budget.

use super::*;

/// Operating points without a generator: rays, layers, and image error.
const RAW: [(u32, u32, f64); 5] = [(1, 1, 20.0), (1, 3, 16.0), (2, 3, 15.0), (4, 3, 14.0), (8, 3, 13.0)];

/// Rendering time of a frame, ms: 9 at 1x1, 12 at 1x3, 16 at 2x3, 24 at 4x3, 40 at 8x3.
fn cost_ms(quality: FrameQuality) -> f64 {
    7.9 + 1.34 * f64::from(quality.paths())
}

fn raw(&(rays, layers, error): &(u32, u32, f64)) -> Candidate {
    let quality = FrameQuality::new(rays, layers);
    let render_ms = cost_ms(quality);
    Candidate { quality, generator: None, error: BySpeed::all(error), render_ms, run_ms: 0.0 }
}

/// A session with a budget of 40 ms per frame, whose frames take twice as long from 20 s to 60 s.
fn budgeted(clock: &Arc<dyn Clock>, heard: &Arc<Heard>, points: PointController) -> Session {
    let extra: Arc<Extra> = Arc::new(move |now, point| {
        let slow = if (20 * SECOND..60 * SECOND).contains(&now) { 2.0 } else { 1.0 };
        Duration::from_secs_f64(1e-3 * slow * cost_ms(point))
    });
    let limits = Limits { duration: Some(120 * SECOND), frames: None };
    let observer = Some(heard.clone() as Arc<dyn Observer>);
    Session { service: Duration::ZERO, extra, points: Some(points), observer, limits, ..Session::new(clock, moving) }
}

fn controller(candidates: Vec<Candidate>, generators: &[&str]) -> PointController {
    let budget = FrameBudget { frame_ms: Some(40.0), run_ms: 1000.0, apart: false, spread: 1.1 };
    let names = generators.iter().map(|name| (*name).to_owned()).collect();
    PointController::new(candidates, names, budget).unwrap()
}

/// Events about the quality, each with its time in whole seconds.
fn said_of_quality(heard: &Heard) -> Vec<(u64, String)> {
    let heard = heard.0.lock().unwrap();
    let said = heard.events.iter().filter_map(|(at, text)| Some((*at, text.strip_prefix("quality: ")?)));
    said.map(|(at, text)| ((at - START_NS) / 1_000_000_000, text.to_owned())).collect()
}

#[test]
fn the_point_follows_what_the_machine_affords() {
    let _guard = beside_others();
    let (clock, log, heard) = (clock(), Log::default(), Arc::<Heard>::default());
    let points = controller(RAW.iter().map(raw).collect(), &[]);
    let summary = Session { sinks: vec![logger(&log)], ..budgeted(&clock, &heard, points) }.run();
    let said = said_of_quality(&heard);
    let texts: Vec<&str> = said.iter().map(|(_, text)| text.as_str()).collect();
    let expected = [
        "4x3 -> 2x3: frames take 48 ms of 40, 2.0 times as long as at the start",
        "2x3 -> 4x3: it is expected to take 24 ms of 40",
    ];
    assert_eq!(texts, expected);
    assert!((20..23).contains(&said[0].0) && (66..71).contains(&said[1].0), "{said:?}");
    let points = summary.points.unwrap();
    assert_eq!((points.begun.as_str(), points.ended.as_str(), points.error), ("4x3", "4x3", Some(14.0)));
    assert_eq!((points.lowered, points.raised, points.refused, points.by_hand), (1, 1, 0, false));
    assert_eq!(points.changes.iter().map(|change| change.to.as_str()).collect::<Vec<_>>(), ["2x3", "4x3"]);
    assert_eq!(heard.0.lock().unwrap().settings, 3, "at the start, and at each change");
    let frames = seen(&log);
    assert_eq!(frames.len(), 2400, "no frame is lost to a change");
    let late = |from: u64, to: u64, ms: u32| {
        let within = |f: &&Seen| (SECOND * from as u32..SECOND * to as u32).contains(&f.presented);
        frames.iter().filter(within).filter(|f| f.age > ms * MS).count()
    };
    assert_eq!([late(0, 20, 24), late(24, 60, 32), late(61, 66, 16), late(71, 120, 24)], [0; 4]);
}

#[test]
fn generators_come_and_go_with_the_load() {
    let _guard = beside_others();
    let (clock, log, heard) = (clock(), Log::default(), Arc::<Heard>::default());
    let quality = FrameQuality::LQ;
    let generated = Candidate { quality, generator: Some(0), error: BySpeed::all(5.0), render_ms: 9.24, run_ms: 20.0 };
    let points = controller(RAW.iter().map(raw).chain([generated]).collect(), &["fake"]);
    let clock_of_run = clock.clone();
    let work = move |frame: &Frame, out: &mut Vec<u8>| {
        let slow = if (20 * SECOND..60 * SECOND).contains(&clock_of_run.now()) { 3 } else { 1 };
        clock_of_run.sleep_until(clock_of_run.now() + slow * 20 * MS);
        out.resize(frame.bmode.len(), 200);
        Ok(())
    };
    let generators = Some(translate(work));
    let summary = Session { generators, sinks: vec![logger(&log)], ..budgeted(&clock, &heard, points) }.run();
    let said = said_of_quality(&heard);
    assert!(said[0].1.starts_with("1x1 + fake -> ") && said[0].0 <= 23, "{said:?}");
    assert!(said.last().unwrap().1.contains("-> 1x1 + fake: it is expected to take"), "{said:?}");
    assert!(said.len() <= 4, "{said:?}");
    assert_eq!(summary.points.unwrap().ended, "1x1 + fake");
    let frames = seen(&log);
    let generated = |from: u32, to: u32| {
        let within: Vec<_> = frames.iter().filter(|f| (from * SECOND..to * SECOND).contains(&f.presented)).collect();
        within.iter().filter(|f| f.source == FrameSource::Generated).count() as f64 / within.len() as f64
    };
    let parts = [generated(2, 20), generated(25, 60), generated(95, 120)];
    assert!(parts[0] > 0.95 && parts[1] < 0.05 && parts[2] > 0.95, "{parts:?} {said:?}");
}

#[test]
fn a_quality_that_is_set_by_hand_stays() {
    let _guard = beside_others();
    let (clock, heard) = (clock(), Arc::<Heard>::default());
    let (sender, controls) = tokio::sync::mpsc::channel(1);
    sender.try_send(Control::Set(vec![Assignment::new("rays", 8.0), Assignment::new("layers", 1.0)])).unwrap();
    let points = controller(RAW.iter().map(raw).collect(), &[]);
    let summary = Session { controls, ..budgeted(&clock, &heard, points) }.run();
    let said = said_of_quality(&heard);
    assert!(matches!(&said[..], [(0, text)] if text.contains("by hand")), "{said:?}");
    let points = summary.points.unwrap();
    assert_eq!((points.by_hand, points.lowered, points.raised), (true, 0, 0));
}

#[test]
fn a_quality_by_hand_brings_back_what_the_budget_lowered() {
    let _guard = beside_others();
    // One ray is what the lowered quality has, too.
    for rays in [1, 2] {
        brings_back_what_the_budget_lowered(rays);
    }
}

/// Checks a session whose budget lowers samples and aperture, and whose watcher then sets the number of rays.
fn brings_back_what_the_budget_lowered(rays: u32) {
    let (clock, heard) = (clock(), Arc::<Heard>::default());
    let (sender, controls) = tokio::sync::mpsc::channel(1);
    let cheap = FrameQuality { coarse: true, aperture: false, ..FrameQuality::LQ };
    let candidates = vec![raw(&(4, 3, 14.0)), Candidate { quality: cheap, ..raw(&(1, 1, 20.0)) }];
    let (log, watched) = (Log::default(), heard.clone());
    let viewer = sink("viewer", move |_| {
        let lowered = |heard: &Counted| {
            heard.last.as_ref().is_some_and(|live| FrameQuality::of(&live.render) == cheap) && heard.settings < 3
        };
        if lowered(&watched.0.lock().unwrap()) {
            let _ = sender.try_send(Control::Set(vec![Assignment::new("rays", rays.into())]));
        }
        Ok(())
    });
    let points = controller(candidates, &[]);
    let sinks = vec![viewer, logger(&log)];
    let summary = Session { controls, sinks, ..budgeted(&clock, &heard, points) }.run();
    let points = summary.points.unwrap();
    assert!(points.by_hand && points.lowered == 1, "{points:?}");
    let last = heard.0.lock().unwrap().last.map(|live| FrameQuality::of(&live.render));
    assert_eq!(last, Some(FrameQuality::new(rays, 1)), "{rays} rays");
}

#[test]
fn the_point_follows_the_speed_that_the_tracker_reports() {
    let _guard = beside_others();
    let (clock, heard) = (clock(), Arc::<Heard>::default());
    let of = |quality, error| Candidate { quality, generator: None, error, render_ms: 16.0, run_ms: 0.0 };
    let rolling = FrameQuality { angles: 9, ..FrameQuality::new(1, 3) };
    let candidates =
        vec![of(rolling, BySpeed::new([10.0, 16.0, 25.0])), of(FrameQuality::new(2, 3), BySpeed::all(18.0))];
    let points = controller(candidates, &[]);
    // Fast strokes from 30 s to 60 s, with pauses of a second, and slow motion before and after.
    let poses = |now: Duration| {
        let s = now.as_secs_f64();
        let fast = (30.0..60.0).contains(&s) && s % 4.0 < 3.0;
        let speed = Some(Speed { mm_s: if fast { 40.0 } else { 4.0 }, deg_s: 0.0 });
        Estimate { speed, ..tracked(now, 0.0) }
    };
    let extra: Arc<Extra> = Arc::new(|_, _| 16 * MS);
    let limits = Limits { duration: Some(90 * SECOND), frames: None };
    let observer = Some(heard.clone() as Arc<dyn Observer>);
    let session = Session { service: Duration::ZERO, extra, points: Some(points), ..Session::new(&clock, poses) };
    let summary = Session { observer, limits, ..session }.run();
    let said = said_of_quality(&heard);
    let [(away_s, away), (back_s, back)] = &said[..] else { panic!("{said:?}") };
    assert!((30..32).contains(away_s) && (60..63).contains(back_s), "{said:?}");
    assert_eq!(away, "1x3 of 9 angles -> 2x3: the probe moves fast: 18.0 grey levels off instead of 25.0");
    assert_eq!(back, "2x3 -> 1x3 of 9 angles: the probe moves slowly: 16.0 grey levels off instead of 18.0");
    assert_eq!(summary.points.unwrap().error, Some(16.0));
}
