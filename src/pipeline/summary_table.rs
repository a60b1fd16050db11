//! Summary of a session as a text table.

use std::fmt;

use super::needle_stage::in_words;
use super::{MisplacedSummary, Percentiles, Summary, TrackerSummary};

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let s = self;
        write!(f, "session            {:.1} s, {} frames", s.elapsed_s, s.presented)?;
        if let (Some(first_s), Some(last_s), 2..) = (s.first_frame_s, s.last_frame_s, s.presented) {
            write!(f, ": {:.1} a second from {first_s:.1} s to {last_s:.1} s", s.frames_per_s)?;
        }
        writeln!(f)?;
        let [generated, held, raw] = s.by_source;
        let ratio = 100.0 * s.generated_ratio;
        writeln!(f, "pictures           {ratio:.1} % generated ({generated} own, {held} held), {raw} raw")?;
        let [good, held, stuck, stale, lost] = s.by_tracking;
        writeln!(f, "poses              {good} good, {held} held, {stuck} stuck, {stale} stale, {lost} lost")?;
        if let Some(latest) = &s.misplaced.latest {
            let MisplacedSummary { deep, looks_out, .. } = s.misplaced;
            writeln!(f, "placement          {deep} frames deep in the body, {looks_out} looking out of it: {latest}")?;
        }
        if let Some(untouched) = &s.misplaced.untouched {
            writeln!(f, "contact            {untouched}")?;
        }
        if let Some(tracker) = &s.tracker {
            tracker_row(f, tracker)?;
        }
        if let Some(needle) = &s.needle {
            writeln!(f, "needle             {}", in_words(needle))?;
        }
        writeln!(f, "\nms                       p50      p95      p99      max")?;
        row(f, "pose to present", s.pose_to_present)?;
        row(f, "motion to present", s.motion_to_present)?;
        row(f, "jump to present", s.jump_to_present)?;
        row(f, "sample to present", s.sample_to_present)?;
        row(f, "render", s.render)?;
        row(f, "inference", s.inference)?;
        writeln!(
            f,
            "\"to present\" ends when the displays have the picture. Left out: the tracker before its first byte here,\n\
             the lag of the filter, network and screen. Held poses count in sample to present, render and inference."
        )?;
        writeln!(f, "\ndrops              of {} frames begun", s.produced)?;
        for (cause, count) in &s.drops {
            writeln!(f, "  {count:>8}  {cause}")?;
        }
        writeln!(f, "  {:>8}  ticks without a frame, of {}", s.missed_ticks, s.ticks)?;
        if let Some(p) = &s.points {
            let (begun, ended, lowered, raised) = (&p.begun, &p.ended, p.lowered, p.raised);
            write!(
                f,
                "quality            {begun} to {ended} for {:.0} ms: lowered {lowered}, raised {raised}",
                p.limit_ms
            )?;
            writeln!(f, ", refused {}{}", p.refused, if p.by_hand { ", then set by hand" } else { "" })?;
            for change in &p.changes {
                writeln!(f, "  {:>7.1} s        {}: {}", change.time_s, change.to, change.reason)?;
            }
        }
        if let Some(g) = &s.generator {
            let (done, late, dropped, failed) = (g.done, g.late, g.dropped, g.failed);
            let (hung, given_up) = (g.hung, g.given_up);
            writeln!(
                f,
                "generator          {done} done ({late} late), {dropped} dropped, {failed} failed, {hung} hung ({given_up} given up)"
            )?;
        }
        if let Some(reason) = s.points.as_ref().and_then(|points| points.generator_reason.as_deref()) {
            writeln!(f, "  at the start     {reason}")?;
        }
        for sink in &s.sinks {
            let (taken, dropped, failed) = (sink.taken, sink.dropped, sink.failed);
            write!(f, "sink {:<13} {taken} taken, {dropped} dropped, {failed} failed", sink.name)?;
            writeln!(f, "{}", if sink.stuck { ", did not come back" } else { "" })?;
        }
        if s.device_losses > 0 {
            writeln!(f, "device             lost {} times, built anew {} times", s.device_losses, s.device_rebuilt)?;
        }
        match s.memory_bytes {
            Some(bytes) => write!(f, "memory             {} MiB", bytes >> 20),
            None => write!(f, "memory             unknown"),
        }
    }
}

/// The tracker's line, and its last fault.
fn tracker_row(f: &mut fmt::Formatter<'_>, tracker: &TrackerSummary) -> fmt::Result {
    let TrackerSummary { records, damaged, needle_records, other_sensors, other_senders, interruptions, last_fault } =
        tracker;
    write!(f, "tracker            {records} records, {damaged} damaged pieces")?;
    let counted = [
        (needle_records, "records of the needle"),
        (other_sensors, "records of other sensors"),
        (other_senders, "datagrams of other senders"),
        (interruptions, "interruptions"),
    ];
    for (count, what) in counted.into_iter().filter(|(count, _)| **count > 0) {
        write!(f, ", {count} {what}")?;
    }
    writeln!(f)?;
    last_fault.as_ref().map_or(Ok(()), |fault| writeln!(f, "  the last fault   {fault}"))
}

fn row(f: &mut fmt::Formatter<'_>, name: &str, percentiles: Option<Percentiles>) -> fmt::Result {
    let Some(p) = percentiles else { return Ok(()) };
    writeln!(f, "{name:<18} {:>8.1} {:>8.1} {:>8.1} {:>8.1}", p.p50_ms, p.p95_ms, p.p99_ms, p.max_ms)
}
