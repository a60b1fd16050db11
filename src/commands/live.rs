//! Text of live sessions: messages, status and unused measurements.

use insonify::pipeline::{Limits, LiveStation, Parts, Pipeline, Status, Summary};
use insonify::pose::Counters;
use insonify::station::Station;

use super::status_line::StatusLine;
use super::{Classify, Failure, terminal};

/// Prints and forgets the sentences for the user.
pub(crate) fn say(live: &mut LiveStation) {
    live.messages.drain(..).for_each(|message| eprintln!("{message}"));
}

/// Runs a session and prints its status; `each` also receives every status.
pub(crate) fn run(
    station: &Station,
    limits: Limits,
    parts: Parts,
    mut each: impl FnMut(&Status),
) -> Result<Summary, Failure> {
    let mut line = StatusLine::new();
    let summary = Pipeline::run(&station.pipeline, limits, parts, |now| {
        line.set(now.elapsed_s, || status(now));
        each(now);
    });
    drop(line);
    summary.other()
}

fn status(status: &Status) -> String {
    let latency = status.latency_ms.map_or_else(|| "-".to_owned(), |ms| format!("{ms:.0} ms"));
    let rate = match status.silent_s {
        Some(silent_s) => format!("no frame for {silent_s:.0} s"),
        None => format!("{:5.1} frames/s", status.frames_per_s),
    };
    let frozen = if status.frozen { "  frozen" } else { "" };
    let placed = status.misplaced.map_or_else(String::new, |misplaced| format!("  ({})", misplaced.fault));
    let damaged = if status.damaged > 0 { format!("  tracker: {} damaged", status.damaged) } else { String::new() };
    format!(
        "{:7.1} s  {rate}  latency {latency}  pose {}{placed}  {}{frozen}  {} presented, {} dropped{damaged}",
        status.elapsed_s,
        status.tracking.name(),
        status.source.name(),
        status.presented,
        status.dropped,
    )
}

/// Prints the counts of tracker measurements that were not used.
pub(crate) fn say_left_out(counters: &Counters) {
    let named = counters.named().filter(|(name, count)| *count > 0 && !["measurements", "used"].contains(name));
    let list: Vec<String> = named.map(|(name, count)| format!("{name} {count}")).collect();
    if !list.is_empty() {
        terminal::say(&format!("tracker: {}", list.join(", ")));
    }
}

#[cfg(test)]
mod tests {
    use insonify::pose::TrackingState;
    use insonify::sink::live::FrameSource;

    use super::*;

    #[test]
    fn the_line_says_when_no_frame_came() {
        let mut now = Status {
            elapsed_s: 60.0,
            presented: 500,
            frames_per_s: 14.1,
            silent_s: None,
            latency_ms: None,
            tracking: TrackingState::Good,
            source: FrameSource::Raw,
            frozen: false,
            misplaced: None,
            dropped: 0,
            damaged: 0,
            notice: None,
        };
        assert!(status(&now).contains("14.1 frames/s"), "{}", status(&now));
        (now.frames_per_s, now.silent_s) = (0.0, Some(30.4));
        assert!(!status(&now).contains("damaged"));
        now.damaged = 7;
        assert!(status(&now).ends_with("tracker: 7 damaged"), "{}", status(&now));
        assert!(status(&now).contains("no frame for 30 s") && !status(&now).contains("frames/s"), "{}", status(&now));
    }
}
