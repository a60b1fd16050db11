//! The log of frames under load.

use std::io::Write;

use super::*;

/// A writer that is slow.
struct Slow(Arc<Mutex<Vec<u8>>>);

impl Write for Slow {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        std::thread::sleep(Duration::from_micros(500));
        let taken = bytes.len().min(256);
        self.0.lock().unwrap().extend_from_slice(&bytes[..taken]);
        Ok(taken)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

#[test]
fn no_line_is_lost_on_a_slow_disk_and_frames_that_wait_are_counted() {
    let _guard = beside_others();
    let clock = clock();
    let written = Arc::<Mutex<Vec<u8>>>::default();
    let log = FrameLog::to_writer(Slow(written.clone()), Path::new("frames.jsonl"), 4096).unwrap();
    let heard = Arc::<Heard>::default();
    let observer = Some(heard.clone() as Arc<dyn Observer>);
    // On simulated time frames come far faster than the writer takes them.
    let limits = Limits { duration: None, frames: Some(1000) };
    let summary = Session { log: Some(log), observer, limits, ..Session::new(&clock, moving) }.run();
    let metrics = summary.sinks.iter().find(|sink| sink.name == "metrics").unwrap();
    assert_eq!((metrics.offered, metrics.taken, metrics.failed), (1000, 1000, 0));
    assert!(metrics.waited > 20, "{metrics:?}");
    let said = &heard.0.lock().unwrap().events;
    assert_eq!(said.iter().filter(|(_, text)| text.starts_with("metrics: the disk is slower")).count(), 1, "{said:?}");
    let text = String::from_utf8(std::mem::take(&mut written.lock().unwrap())).unwrap();
    let number = |line: &str| serde_json::from_str::<Value>(line).unwrap()["number"].as_u64().unwrap();
    assert_eq!(text.lines().map(number).collect::<Vec<_>>(), (0..1000).collect::<Vec<_>>());
}
