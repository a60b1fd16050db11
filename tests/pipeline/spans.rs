//! Tracing spans of the pipeline's stages: each carries the frame's number and times.

use std::collections::BTreeMap;

use tracing::field::{Field, Visit};
use tracing::span::{Attributes, Id, Record};
use tracing::subscriber::Interest;
use tracing::{Event, Metadata, Subscriber};

use super::*;

/// Values of a span's fields by their names.
type Fields = BTreeMap<&'static str, f64>;

/// Name and fields of each span, in the order in which spans start.
type Spans = Arc<Mutex<Vec<(&'static str, Fields)>>>;

/// Keeps every span of the library while `CAPTURES` is set; it stays installed for later tests.
struct Capture(Spans);

static CAPTURES: AtomicBool = AtomicBool::new(false);

struct Numbers<'a>(&'a mut Fields);

impl Visit for Numbers<'_> {
    fn record_debug(&mut self, _: &Field, _: &dyn std::fmt::Debug) {}

    fn record_f64(&mut self, field: &Field, value: f64) {
        self.0.insert(field.name(), value);
    }

    fn record_u64(&mut self, field: &Field, value: u64) {
        self.0.insert(field.name(), value as f64);
    }
}

impl Subscriber for Capture {
    fn register_callsite(&self, _: &'static Metadata<'static>) -> Interest {
        Interest::sometimes()
    }

    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        CAPTURES.load(Ordering::Relaxed) && metadata.target().starts_with("insonify") && metadata.is_span()
    }

    fn new_span(&self, span: &Attributes<'_>) -> Id {
        let mut spans = self.0.lock().unwrap();
        let mut fields = Fields::new();
        span.record(&mut Numbers(&mut fields));
        spans.push((span.metadata().name(), fields));
        Id::from_u64(spans.len() as u64)
    }

    fn record(&self, span: &Id, values: &Record<'_>) {
        let mut spans = self.0.lock().unwrap();
        values.record(&mut Numbers(&mut spans[span.into_u64() as usize - 1].1));
    }

    fn record_follows_from(&self, _: &Id, _: &Id) {}

    fn event(&self, _: &Event<'_>) {}

    fn enter(&self, _: &Id) {}

    fn exit(&self, _: &Id) {}
}

#[test]
fn each_stage_has_a_span_with_frame_number_and_times() {
    // Alone, because spans of other tests' sessions would be captured, too.
    let _guard = alone();
    let clock = clock();
    let generators = Some(generator(&clock, 10 * MS));
    let limits = Limits { duration: None, frames: Some(20) };
    let display = sink("display", |_| Ok(()));
    let session = Session { generators, limits, sinks: vec![display], ..Session::new(&clock, moving) };
    let spans = Spans::default();
    tracing::subscriber::set_global_default(Capture(spans.clone())).unwrap();
    CAPTURES.store(true, Ordering::Relaxed);
    session.run();
    CAPTURES.store(false, Ordering::Relaxed);

    let spans = std::mem::take(&mut *spans.lock().unwrap());
    let of = |name: &str| -> Vec<Fields> { spans.iter().filter(|s| s.0 == name).map(|s| s.1.clone()).collect() };
    let stages: [(&str, &[&str]); 6] = [
        ("sample", &["first_byte_ms", "sampled_ms"]),
        ("submit", &["submitted_ms"]),
        ("receive", &["submitted_ms", "rendered_ms"]),
        ("infer", &["started_ms", "ended_ms"]),
        ("present", &["sampled_ms", "rendered_ms", "presented_ms"]),
        ("sink", &["presented_ms", "taken_ms"]),
    ];
    for (stage, times) in stages {
        let found = of(stage);
        assert!(found.len() >= 19, "{stage}: {}", found.len());
        for (number, fields) in found.iter().take(19).enumerate() {
            assert_eq!(fields["frame"], number as f64, "{stage}");
            let times: Vec<f64> = times.iter().map(|name| fields[name]).collect();
            assert!(times.is_sorted() && times[0] <= times[times.len() - 1], "{stage}: {fields:?}");
        }
    }
    // 20 frames a second, 20 ms each.
    let third = &of("receive")[3];
    assert!((third["submitted_ms"], third["rendered_ms"]) == (150.0, 170.0), "{third:?}");
}
