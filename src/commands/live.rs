//! Text output of live sessions: messages, status and unused measurements.

use insonify::names::counted;
use insonify::pipeline::{Limits, LiveStation, Parts, Pipeline, Status, Summary};
use insonify::pose::Counters;
use insonify::station::{SetupFinding, Station};

use super::status_line::StatusLine;
use super::{Classify, Failure, terminal};

/// Prints the session's messages for the user and removes them.
pub(crate) fn say(live: &mut LiveStation) {
    live.messages.drain(..).for_each(|message| eprintln!("{message}"));
}

/// Logs a fault in the station's set-up, with its remedy.
pub(crate) fn warn_of_setup(finding: &SetupFinding) {
    tracing::warn!("{}: {}", finding.what, finding.remedy);
}

/// Runs a session and prints its status. `each` receives every status as well.
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

/// Prints how many measurements of `tool` were not used, and why.
pub(crate) fn say_left_out(tool: &str, counters: &Counters) {
    let named = counters.named().filter(|(_, count)| *count > 0);
    let list: Vec<String> = named.filter_map(|(name, count)| left_out(name, count)).collect();
    if !list.is_empty() {
        terminal::say(&format!("{tool}: {}", list.join(", ")));
    }
}

/// Text for a count of unused measurements; `None` for the counts of all and of used measurements.
fn left_out(name: &str, count: u64) -> Option<String> {
    let (what, which) = match name {
        "measurements" | "used" => return None,
        "invalid" => ("record", "with an impossible pose"),
        "duplicates" => ("record", "received twice"),
        "out_of_order" => ("record", "received out of order"),
        "missing" => ("record", "missing by the device's counter"),
        "device_restarts" => ("restart", "of the device"),
        "clock_stalls" => ("record", "during which the device's clock stood still"),
        "time_not_rising" => ("record", "without a later time than the one before"),
        "time_outliers" => ("record", "whose time was off by more than 0.5 s"),
        "clock_jumps" => ("jump", "of this machine's clock"),
        "out_of_view" => ("report", "that the sensor is out of view"),
        "spikes" => ("record", "farther away than a hand can move"),
        "jumps" => ("jump", "of the probe that a second record confirmed"),
        "stuck" => ("time", "at which the sensor got stuck"),
        _ => ("count", name),
    };
    Some(format!("{} {which}", counted(usize::try_from(count).unwrap_or(usize::MAX), what)))
}

#[cfg(test)]
mod tests {
    use insonify::pose::TrackingState;
    use insonify::sink::live::FrameSource;

    use super::*;

    #[test]
    fn counts_of_measurements_are_words() {
        assert_eq!(left_out("time_outliers", 64).unwrap(), "64 records whose time was off by more than 0.5 s");
        assert_eq!(left_out("device_restarts", 1).unwrap(), "1 restart of the device");
        for name in Counters::NAMES {
            let words = left_out(name, 2);
            assert_eq!(words.is_none(), ["measurements", "used"].contains(&name), "{name}");
            assert!(words.is_none_or(|words| !words.contains('_') && !words.contains("counts")), "{name}");
        }
    }

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
