//! End of a session: stops its stages in order and makes the summary.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use super::{Pipeline, Stages, drops};
use crate::pipeline::clock::{Clock, lock, ms};
use crate::pipeline::metrics::{counted, memory_bytes};
use crate::pipeline::shutdown::{Joined, Part, Thread};
use crate::pipeline::sink_stage::SinkStage;
use crate::pipeline::summary::{GeneratorSummary, SinkSummary, Summary};
use crate::pipeline::tracker_watch::TrackerWatch;
use crate::sink::FrameLog;
use crate::sink::frame_log::LogEnd;

/// Longest wait for a part to end.
const PART_TIME: Duration = Duration::from_secs(3);

/// Polling period for the end of a part.
const ASK_PERIOD: Duration = Duration::from_millis(5);

impl Pipeline {
    /// Ends every part in order, with bounded waits, and returns the summary.
    pub(super) fn end(mut self) -> Summary {
        let reason = self.stop.reason().unwrap_or_default();
        tracing::info!("the session ends: {reason}");
        let mut stuck = Vec::new();
        // No frame begins after the request, so the session's duration excludes the time that parts take to end.
        let ended_at = self.stop.requested_at().unwrap_or_else(|| self.clock.now());
        let elapsed_s = ended_at.saturating_sub(self.started_at).as_secs_f64();
        end_parts(&self.clock, &mut self.before, &mut stuck);
        let Stages { render, generate, needle, presenter, sinks } = self.stages;
        // `join` notes a panic or a hang in `stuck`.
        let _ = join(&self.clock, render, &mut stuck);
        let needle = needle.map(|stage| {
            let name = stage.thread.name().to_owned();
            let (summary, joined) = stage.join(self.clock.now().saturating_add(PART_TIME));
            // `judge` notes a panic or a hang in `stuck`.
            let _ = judge(&name, joined, &mut stuck);
            summary
        });
        // A stuck renderer did not close its slots.
        self.to_generator.iter().for_each(|slot| slot.close());
        if let Some(generator) = &self.generator {
            generator.terminate();
        }
        let generator_stuck =
            generate.is_some_and(|thread| join(&self.clock, thread, &mut stuck).is_err_and(|left| left));
        self.to_presenter.close();
        let log = join(&self.clock, presenter, &mut stuck).ok().flatten();
        sinks.iter().for_each(SinkStage::close);
        let until = self.clock.now().saturating_add(self.finish);
        let mut sinks: Vec<_> = sinks.into_iter().map(|sink| sink.join(until)).collect();
        sinks.extend(log.map(|log| log_summary(log, self.finish)));
        for sink in sinks.iter().filter(|sink| sink.stuck) {
            self.events.warn(format!("{} doesn't come back and is left behind", sink.name));
        }
        stuck.extend(sinks.iter().filter(|sink| sink.stuck).map(|sink| sink.name.clone()));
        end_parts(&self.clock, &mut self.after, &mut stuck);

        if let Some(slot) = &self.to_generator {
            slot.clear();
        }
        let generator = self.generator.as_ref().zip(self.to_generator.as_ref()).map(|(link, slot)| {
            let counts = lock(&link.state).counts.clone();
            GeneratorSummary {
                offered: slot.offered(),
                dropped: counts.dropped + slot.dropped(),
                stuck: generator_stuck,
                ..counts
            }
        });
        self.to_presenter.clear();
        let metrics = &self.metrics;
        let mut drops = BTreeMap::from(drops(metrics, &self.to_presenter));
        metrics.shown(|shown| {
            if !stuck.is_empty() {
                let known = shown.presented + drops.values().sum::<u64>();
                drops.insert("left in a stuck stage", counted(&metrics.produced).saturating_sub(known));
            }
            let since_start_s = |time: Duration| time.saturating_sub(self.started_at).as_secs_f64();
            let span_s = shown.first.map_or(0.0, |first| (shown.last - first).as_secs_f64());
            let intervals = shown.presented.saturating_sub(1) as f64;
            let generated = shown.by_source[0] + shown.by_source[1];
            Summary {
                elapsed_s,
                start_ms: ms(self.started_at),
                first_frame_s: shown.first.map(since_start_s),
                last_frame_s: shown.first.map(|_| since_start_s(shown.last)),
                produced: counted(&metrics.produced),
                presented: shown.presented,
                drops,
                ticks: counted(&metrics.produced) + counted(&metrics.missed_ticks),
                missed_ticks: counted(&metrics.missed_ticks),
                frames_per_s: if span_s > 0.0 { intervals / span_s } else { 0.0 },
                generated_ratio: if shown.presented > 0 { generated as f64 / shown.presented as f64 } else { 0.0 },
                by_source: shown.by_source,
                by_tracking: shown.by_tracking,
                misplaced: shown.misplaced,
                pose_to_present: shown.pose_to_present.percentiles(),
                motion_to_present: shown.motion_to_present.percentiles(),
                jump_to_present: shown.jump_to_present.percentiles(),
                sample_to_present: shown.sample_to_present.percentiles(),
                render: shown.render.percentiles(),
                inference: shown.inference.percentiles(),
                device_losses: counted(&metrics.losses),
                device_rebuilt: counted(&metrics.rebuilt),
                controls: counted(&metrics.controls),
                controls_refused: counted(&metrics.refused),
                points: metrics.points(),
                tracker: self.tracker.as_ref().map(TrackerWatch::totals),
                generator,
                needle,
                sinks,
                stuck,
                memory_bytes: memory_bytes(),
            }
        })
    }
}
/// Waits for a stage to end and returns its result. The error is true if the stage is stuck, false if it panicked.
fn join<T>(clock: &Arc<dyn Clock>, thread: Thread<T>, stuck: &mut Vec<String>) -> Result<T, bool> {
    let name = thread.name().to_owned();
    let until = clock.now().saturating_add(PART_TIME);
    judge(&name, thread.join(until), stuck)
}

/// Result of a stage that was joined, with errors as in [`join`].
fn judge<T>(name: &str, joined: Joined<T>, stuck: &mut Vec<String>) -> Result<T, bool> {
    match joined {
        Joined::Done(result) => Ok(result),
        Joined::Panicked => {
            tracing::error!("the thread `{name}` panicked");
            stuck.push(format!("{name} (panicked)"));
            Err(false)
        }
        Joined::Stuck => {
            tracing::warn!("the thread `{name}` doesn't come back and is left behind");
            stuck.push(name.to_owned());
            Err(true)
        }
    }
}

/// Stops parts and waits for each, at most [`PART_TIME`].
fn end_parts(clock: &Arc<dyn Clock>, parts: &mut Vec<Box<dyn Part>>, stuck: &mut Vec<String>) {
    parts.iter_mut().for_each(|part| part.stop());
    for mut part in parts.drain(..) {
        let until = clock.now().saturating_add(PART_TIME);
        loop {
            if part.has_ended() {
                break;
            }
            if clock.now() >= until {
                tracing::warn!("`{}` doesn't come back and is left behind", part.name());
                stuck.push(part.name().to_owned());
                break;
            }
            clock.sleep_until(clock.now().saturating_add(ASK_PERIOD));
        }
    }
}

/// Completes the log of frames within `patience`, and returns its summary.
fn log_summary(log: FrameLog, patience: Duration) -> SinkSummary {
    let (counts, end) = log.finish(patience);
    SinkSummary {
        name: "metrics".to_owned(),
        offered: counts.pushed,
        taken: counts.pushed - counts.failed,
        waited: counts.waited,
        failed: counts.failed,
        stuck: matches!(end, LogEnd::Stuck),
        error: match end {
            LogEnd::Complete if counts.failed > 0 => {
                Some("metrics: lines are missing, the file cannot be written".to_owned())
            }
            LogEnd::Complete => None,
            LogEnd::Failed(error) => Some(format!("metrics: {error}")),
            LogEnd::Stuck => Some("metrics: the disk did not take all lines in time".to_owned()),
        },
        ..SinkSummary::default()
    }
}
