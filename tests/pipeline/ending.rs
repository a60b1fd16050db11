//! The end of a session, whatever its parts are doing.

use super::*;

/// Notes the order in which parts end.
struct Noted {
    name: &'static str,
    order: Arc<Mutex<Vec<&'static str>>>,
    ends: bool,
}

impl Part for Noted {
    fn name(&self) -> &str {
        self.name
    }

    fn stop(&mut self) {
        self.order.lock().unwrap().push(self.name);
    }

    fn has_ended(&mut self) -> bool {
        self.ends
    }
}

#[test]
fn every_state_ends_in_order_and_in_time() {
    let _guard = beside_others();
    type Prepare = fn(Session) -> Session;
    let hang: Prepare = |session| {
        let clock = session.clock.clone();
        let work = move |_: &Frame, _: &mut Vec<u8>| {
            clock.sleep_until(NEVER);
            Ok(())
        };
        Session { generators: Some(translate(work)), ..session }
    };
    let states: [(&str, Prepare, &[&str]); 7] = [
        ("plain", |s| s, &[]),
        ("no pose yet", |s| Session { poses: Box::new(Poses(|_| Estimate::default())), ..s }, &[]),
        ("generating", |s| Session { generators: Some(generator(&s.clock, 90 * MS)), ..s }, &[]),
        ("generator hangs", hang, &["generator"]),
        ("no device", |s| Session { faults: Arc::new(|_| true), build_failures: u32::MAX, ..s }, &[]),
        ("device hangs", |s| Session { service: Duration::from_secs(1 << 30), ..s }, &["renderer"]),
        ("slow device", |s| Session { service: 700 * MS, ..s }, &[]),
    ];
    for (name, prepare, stuck) in states {
        for stop_at in [Duration::ZERO, MS, 33 * MS, 70 * MS, 2345 * MS] {
            let (clock, order) = (clock(), Arc::<Mutex<Vec<_>>>::default());
            let part = |name, ends| -> Box<dyn Part> { Box::new(Noted { name, order: order.clone(), ends }) };
            let order_of = order.clone();
            let last = sink("last", move |_| {
                order_of.lock().unwrap().push("frame");
                Ok(())
            });
            let session = Session {
                limits: Limits { duration: Some(stop_at), frames: None },
                before: vec![part("tracker", true)],
                after: vec![part("recorder", true)],
                sinks: vec![last],
                ..Session::new(&clock, moving)
            };
            let summary = prepare(session).run();
            assert!(clock.now() <= stop_at + 5 * SECOND, "{name} at {stop_at:?}: {:?}", clock.now());
            assert!(summary.stuck.iter().all(|s| stuck.contains(&s.as_str())), "{name}: {:?}", summary.stuck);
            let order = order.lock().unwrap();
            assert_eq!(order.last(), Some(&"recorder"), "{name}: the recorder hears all");
            assert!(order.contains(&"tracker"));
        }
    }
}

#[test]
fn a_part_that_does_not_end_is_left_behind() {
    let _guard = beside_others();
    let clock = clock();
    let part: Box<dyn Part> = Box::new(Noted { name: "tracker", order: Arc::default(), ends: false });
    let summary = Session { before: vec![part], ..Session::new(&clock, moving) }.run();
    assert_eq!(summary.stuck, ["tracker"]);
    assert!(clock.now() < 14 * SECOND);
}
