//! Quality under a time budget.

use super::*;

/// A session with a budget of 40 ms. A frame takes 7.9 ms and 1.34 ms per path (4x3: 24, 2x3: 16, 8x3: 40.1), and twice
/// as much from 20 s to 60 s.
fn budgeted(clock: &Arc<dyn Clock>, heard: &Arc<Heard>) -> Session {
    let cost_ms = |point: QualityPoint| 7.9 + 1.34 * f64::from(point.paths());
    let climbed = climb::<()>(40.0, |point| Ok(Some(cost_ms(point)))).unwrap();
    let extra: Arc<Extra> = Arc::new(move |now, point| {
        let slow = if (20 * SECOND..60 * SECOND).contains(&now) { 2.0 } else { 1.0 };
        Duration::from_secs_f64(1e-3 * slow * cost_ms(point))
    });
    let limits = Limits { duration: Some(120 * SECOND), frames: None };
    let (quality, observer) = (Some(QualityBudget::new(&climbed)), Some(heard.clone() as Arc<dyn Observer>));
    Session { service: Duration::ZERO, extra, quality, observer, limits, ..Session::new(clock, moving) }
}

/// Events about the quality, with their times in whole seconds.
fn said_of_quality(heard: &Heard) -> Vec<(u64, String)> {
    let heard = heard.0.lock().unwrap();
    let said = heard.events.iter().filter_map(|(at, text)| Some((*at, text.strip_prefix("quality: ")?)));
    said.map(|(at, text)| ((at - START_NS) / 1_000_000_000, text.to_owned())).collect()
}

#[test]
fn quality_follows_what_the_machine_affords() {
    let _guard = beside_others();
    let (clock, log, heard) = (clock(), Log::default(), Arc::<Heard>::default());
    let summary = Session { sinks: vec![logger(&log)], ..budgeted(&clock, &heard) }.run();
    let said = said_of_quality(&heard);
    let texts: Vec<&str> = said.iter().map(|(_, text)| text.as_str()).collect();
    assert_eq!(texts, ["4x3 -> 2x3: frames take 48 ms of 40", "2x3 -> 4x3: frames take 16 ms of 40"]);
    assert!((23..30).contains(&said[0].0) && (70..80).contains(&said[1].0), "{said:?}");
    let (begun, ended) = ("4x3".to_owned(), "4x3".to_owned());
    let expected = QualitySummary { budget_ms: 40.0, begun, ended, lowered: 1, raised: 1, refused: 0, by_hand: false };
    assert_eq!(summary.quality, Some(expected));
    assert_eq!(heard.0.lock().unwrap().settings, 3, "at the start, and at each change");
    let frames = seen(&log);
    assert_eq!(frames.len(), 2400, "no frame is lost to a change");
    let late = |from: u64, to: u64, ms: u32| {
        let within = |f: &&Seen| (SECOND * from as u32..SECOND * to as u32).contains(&f.presented);
        frames.iter().filter(within).filter(|f| f.age > ms * MS).count()
    };
    assert_eq!([late(0, 20, 24), late(30, 60, 32), late(61, 70, 16), late(80, 120, 24)], [0; 4]);
}

#[test]
fn a_quality_that_is_set_by_hand_stays() {
    let _guard = beside_others();
    let (clock, heard) = (clock(), Arc::<Heard>::default());
    let (sender, controls) = tokio::sync::mpsc::channel(1);
    sender.try_send(Control::Set(vec![Assignment::new("rays", 8.0), Assignment::new("layers", 1.0)])).unwrap();
    let summary = Session { controls, ..budgeted(&clock, &heard) }.run();
    let said = said_of_quality(&heard);
    assert!(matches!(&said[..], [(0, text)] if text.contains("by hand")), "{said:?}");
    let quality = summary.quality.unwrap();
    assert_eq!((quality.by_hand, quality.lowered, quality.raised), (true, 0, 0));
}
