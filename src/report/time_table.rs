//! Table of frame times: percentiles of each stage.

use std::fmt;

use serde::Serialize;

use crate::render::FrameTimes;
use crate::statistics::{nearest_rank, sorted};

/// Name of the stage that holds a frame's time outside the passes.
pub const OVERHEAD: &str = "upload, submit, read back";

/// Names of the parts of [`OVERHEAD`] on the processor, if a device makes the frames: recording the passes,
/// submitting them, and copying the frame.
pub const HOST_STAGES: [&str; 3] = ["of it: record", "of it: submit", "of it: copy out"];

/// Name of the stage for whole frames.
pub const WHOLE_FRAME: &str = "whole frame";

/// Name of the stage for the scene's motion before each frame. Whole frames do not include it.
pub const MOTION: &str = "motion";

/// Name of the stage for a generator's runs. Whole frames do not include them.
pub const GENERATOR: &str = "generator, on top";

/// Times of many frames, all with the same passes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TimeTable {
    /// Stages in the order of their first appearance, each with its times, ms.
    stages: Vec<(&'static str, Vec<f64>)>,
    whole_ms: Vec<f64>,
    motion_ms: Vec<f64>,
    generator_ms: Vec<f64>,
}

/// Percentiles of one stage.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StageTime {
    /// Name: a pass, [`OVERHEAD`], one of [`HOST_STAGES`], [`WHOLE_FRAME`], [`MOTION`] or [`GENERATOR`].
    pub stage: &'static str,
    /// Number of times.
    pub count: usize,
    /// Median, ms.
    pub p50_ms: f64,
    /// 95th percentile, ms.
    pub p95_ms: f64,
    /// Longest time, ms.
    pub max_ms: f64,
}

impl TimeTable {
    /// Adds the times of a frame.
    pub fn push(&mut self, times: &FrameTimes) {
        if !times.passes.is_empty() {
            let passes_ms: f64 = times.passes.iter().map(|p| p.ms).sum();
            self.stage(OVERHEAD).push((times.total_ms - passes_ms).max(0.0));
            if let Some(device) = times.device {
                for (stage, ms) in HOST_STAGES.into_iter().zip([device.record_ms, device.submit_ms, device.copy_ms]) {
                    self.stage(stage).push(ms);
                }
            }
        }
        for pass in &times.passes {
            self.stage(pass.name).push(pass.ms);
        }
        self.whole_ms.push(times.total_ms);
        if times.motion_ms > 0.0 {
            self.motion_ms.push(times.motion_ms);
        }
    }

    /// Adds the time of a run of a generator.
    pub fn push_generator(&mut self, ms: f64) {
        self.generator_ms.push(ms);
    }

    /// Number of frames added.
    pub fn frames(&self) -> usize {
        self.whole_ms.len()
    }

    /// Percentiles of each stage: the passes in order, the overhead, whole frames, the motion before them, and a
    /// generator's runs. Empty without frames.
    pub fn stages(&self) -> Vec<StageTime> {
        let stages = || self.stages.iter().map(|(name, times)| (*name, times));
        let of_host = |name: &str| name == OVERHEAD || HOST_STAGES.contains(&name);
        let passes = stages().filter(move |(name, _)| !of_host(name));
        let overhead = stages().filter(move |(name, _)| of_host(name));
        passes
            .chain(overhead)
            .chain([(WHOLE_FRAME, &self.whole_ms), (MOTION, &self.motion_ms), (GENERATOR, &self.generator_ms)])
            .filter_map(|(stage, times)| {
                let times = sorted(times.iter().copied());
                let percentile = |part| nearest_rank(&times, part);
                let (p50_ms, p95_ms) = (percentile(0.5)?, percentile(0.95)?);
                Some(StageTime { stage, count: times.len(), p50_ms, p95_ms, max_ms: *times.last()? })
            })
            .collect()
    }

    fn stage(&mut self, name: &'static str) -> &mut Vec<f64> {
        let index = self.stages.iter().position(|(n, _)| *n == name).unwrap_or_else(|| {
            self.stages.push((name, Vec::new()));
            self.stages.len() - 1
        });
        &mut self.stages[index].1
    }
}

/// Several tables next to each other with headings, as text: one line per stage, median and 95th percentile in ms.
pub struct SideBySide<'a>(pub &'a [(&'a str, &'a TimeTable)]);

impl fmt::Display for SideBySide<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let tables: Vec<_> = self.0.iter().map(|(_, table)| table.stages()).collect();
        let mut names: Vec<&str> = Vec::new();
        let [record, submit, copy] = HOST_STAGES;
        let last = [OVERHEAD, record, submit, copy, WHOLE_FRAME, MOTION, GENERATOR];
        for stage in tables.iter().flatten().map(|s| s.stage).filter(|stage| !last.contains(stage)) {
            if !names.contains(&stage) {
                names.push(stage);
            }
        }
        names.extend(last);
        let width = names.iter().map(|n| n.len()).max().unwrap_or(0);
        let cell_widths: Vec<usize> = self.0.iter().map(|(heading, _)| 9.max(heading.len() + 4)).collect();
        write!(f, "{:width$}", "ms")?;
        for ((heading, _), cell) in self.0.iter().zip(&cell_widths) {
            write!(f, "  {:>cell$} {:>cell$}", format!("{heading} p50"), format!("{heading} p95"))?;
        }
        for name in names {
            let cells: Vec<_> = tables.iter().map(|t| t.iter().find(|s| s.stage == name)).collect();
            if cells.iter().all(Option::is_none) {
                continue;
            }
            write!(f, "\n{name:width$}")?;
            for (stage, cell) in cells.into_iter().zip(&cell_widths) {
                match stage {
                    Some(s) => write!(f, "  {:>cell$.2} {:>cell$.2}", s.p50_ms, s.p95_ms)?,
                    None => write!(f, "  {:>cell$} {:>cell$}", "-", "-")?,
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(total_ms: f64, passes: &[(&'static str, f64)]) -> FrameTimes {
        let mut times = FrameTimes { total_ms, ..FrameTimes::default() };
        passes.iter().for_each(|&(name, ms)| times.add(name, ms));
        times
    }

    #[test]
    fn stages_add_up_to_whole_frames() {
        let mut table = TimeTable::default();
        for _ in 0..3 {
            table.push(&times(20.0, &[("trace", 5.0), ("march", 11.0)]));
        }
        let stages = table.stages();
        let names: Vec<_> = stages.iter().map(|s| s.stage).collect();
        assert_eq!(names, ["trace", "march", OVERHEAD, WHOLE_FRAME]);
        assert_eq!(stages[2].p50_ms, 4.0);
        let sum: f64 = stages[..3].iter().map(|s| s.p50_ms).sum();
        assert_eq!(sum, stages[3].p50_ms);
        assert!(stages.iter().all(|s| s.count == 3));
    }

    #[test]
    fn runs_of_one_pass_add_up_within_a_frame() {
        let mut table = TimeTable::default();
        table.push(&times(20.0, &[("trace", 5.0), ("march", 2.0), ("trace", 6.0), ("march", 1.0)]));
        let stages: Vec<_> = table.stages().iter().map(|s| (s.stage, s.count, s.p50_ms)).collect();
        assert_eq!(stages, [("trace", 1, 11.0), ("march", 1, 3.0), (OVERHEAD, 1, 6.0), (WHOLE_FRAME, 1, 20.0)]);
    }

    #[test]
    fn motion_has_a_row_of_its_own_where_the_scene_moves() {
        let mut table = TimeTable::default();
        table.push(&FrameTimes { motion_ms: 3.0, ..times(20.0, &[("trace", 5.0)]) });
        table.push(&times(22.0, &[("trace", 5.0)]));
        let stages: Vec<_> = table.stages().iter().map(|s| (s.stage, s.count, s.max_ms)).collect();
        assert_eq!(stages[2..], [(WHOLE_FRAME, 2, 22.0), (MOTION, 1, 3.0)]);
    }

    #[test]
    fn devices_without_timestamps_still_have_whole_frames() {
        let mut table = TimeTable::default();
        table.push(&times(20.0, &[]));
        assert_eq!(table.stages().len(), 1);
        assert!(TimeTable::default().stages().is_empty());
    }

    #[test]
    fn tables_with_different_passes_stand_side_by_side() {
        let (mut low, mut high) = (TimeTable::default(), TimeTable::default());
        low.push(&times(20.0, &[("trace", 5.0)]));
        high.push(&times(60.0, &[("trace", 25.0), ("layers", 4.0)]));
        let text = SideBySide(&[("LQ", &low), ("HQ", &high)]).to_string();
        let layers = text.lines().find(|l| l.starts_with("layers")).unwrap();
        assert_eq!(layers.split_whitespace().collect::<Vec<_>>(), ["layers", "-", "-", "4.00", "4.00"]);
        assert!(text.lines().last().unwrap().starts_with(WHOLE_FRAME));
        assert!(text.lines().next().unwrap().contains("HQ p95"));
    }

    #[test]
    fn runs_of_a_generator_have_a_row_of_their_own_below_whole_frames() {
        let (mut low, mut high) = (TimeTable::default(), TimeTable::default());
        low.push(&times(20.0, &[("trace", 5.0)]));
        high.push(&times(60.0, &[("trace", 25.0)]));
        (1..=20).for_each(|ms| low.push_generator(f64::from(ms)));
        let stages = low.stages();
        let [.., whole, runs] = &stages[..] else { panic!("{stages:?}") };
        assert_eq!((whole.stage, whole.p50_ms), (WHOLE_FRAME, 20.0));
        assert_eq!((runs.stage, runs.count, runs.p50_ms, runs.p95_ms), (GENERATOR, 20, 10.0, 19.0));
        let text = SideBySide(&[("LQ", &low), ("HQ of 9 angles", &high)]).to_string();
        let row = text.lines().last().unwrap();
        assert_eq!(row.split_whitespace().skip(3).collect::<Vec<_>>(), ["10.00", "19.00", "-", "-"]);
        assert!(row.starts_with(GENERATOR) && text.lines().all(|line| line.len() == row.len()), "{text}");
    }
}
