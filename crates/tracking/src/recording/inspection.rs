//! Complete information on a recording's content, for people and as JSON.

use std::fmt;
use std::path::Path;

use insonify_core::settings::mark::clean;
use serde::Serialize;

use super::{
    Event, MarkReport, Marks, RecordedSensor, RecordedTools, RecordingReport, RecordingSummary, SessionSettings, Timing,
};

/// Content of a recording. [`Display`](fmt::Display) formats it as a text table.
#[derive(Debug, Clone, Serialize)]
pub struct Inspection<'a> {
    #[serde(flatten)]
    recording: RecordingReport<'a>,
    protocol: &'static str,
    start_time_ns: u64,
    sensor: Option<u16>,
    /// Name of the probe's tool, if the protocol names tools.
    tool: Option<&'a str>,
    sensors: &'a [RecordedSensor],
    messages: u64,
    bytes: u64,
    poses: usize,
    without_pose: u64,
    session_poses: u64,
    /// The needle's sensor and poses; `None` without a tracked needle.
    #[serde(skip_serializing_if = "Option::is_none")]
    needle: Option<NeedleInspection<'a>>,
    timing: Option<&'a Timing>,
    damage: &'a [String],
    events: &'a [Event],
    /// Final state of the marks on pictures.
    marks: Vec<MarkReport>,
    /// Reasons for which events of marks could not be read.
    marks_refused: Vec<String>,
    settings: Option<&'a SessionSettings>,
    #[serde(skip)]
    summary: &'a RecordingSummary,
}

/// Poses of the needle in a recording.
#[derive(Debug, Clone, Serialize)]
struct NeedleInspection<'a> {
    sensor: Option<u16>,
    /// Name of the needle's tool, if the protocol names tools.
    tool: Option<&'a str>,
    records: u64,
    poses: usize,
    session_poses: u64,
}

impl<'a> NeedleInspection<'a> {
    /// Poses of the needle in `tools`; `None` without a tracked needle.
    fn of(tools: &'a RecordedTools) -> Option<Self> {
        let RecordingSummary { info, needle, needle_records: records, needle_session_poses: session_poses, .. } =
            &tools.summary;
        (info.needle.is_some() || *records > 0 || *session_poses > 0).then(|| Self {
            sensor: needle.as_ref().map(|sensor| sensor.number),
            tool: needle.as_ref().and_then(|sensor| sensor.name.as_deref()),
            records: *records,
            poses: tools.needle.measured.len(),
            session_poses: *session_poses,
        })
    }
}

impl<'a> Inspection<'a> {
    /// Content of the recording at `path`, from the result of [`read_tools`](super::read_tools).
    pub fn new(path: &Path, tools: &'a RecordedTools) -> Self {
        let (poses, summary) = (&tools.probe.measured, &tools.summary);
        let (start_ns, marks) = (summary.info.start_time_ns, Marks::of(&summary.events));
        Self {
            recording: RecordingReport::new(path, summary),
            protocol: summary.info.protocol.name(),
            start_time_ns: summary.info.start_time_ns,
            sensor: summary.sensor.as_ref().map(|sensor| sensor.number),
            tool: summary.sensor.as_ref().and_then(|sensor| sensor.name.as_deref()),
            sensors: &summary.sensors,
            messages: summary.messages,
            bytes: summary.bytes,
            poses: poses.len(),
            without_pose: summary.without_pose,
            session_poses: summary.session_poses,
            needle: NeedleInspection::of(tools),
            timing: summary.timing.as_ref(),
            damage: &summary.damage.damaged_first,
            events: &summary.events,
            marks: marks.all.iter().map(|mark| MarkReport::new(mark, start_ns)).collect(),
            marks_refused: marks.refused.into_iter().map(|(_, reason)| reason).collect(),
            settings: summary.settings.as_ref(),
            summary,
        }
    }
}

/// Ends a line about poses with the number of those that the session used.
fn used(f: &mut fmt::Formatter<'_>, poses: u64) -> fmt::Result {
    match poses {
        0 => writeln!(f),
        used => writeln!(f, ", and {used} that the session used"),
    }
}

fn or_none(text: &str) -> &str {
    if text.is_empty() { "not given" } else { text }
}

impl fmt::Display for Inspection<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}: {}", self.recording.path, self.summary)?;
        writeln!(f, "protocol   {}", self.protocol)?;
        writeln!(f, "device     {}", or_none(self.recording.device))?;
        writeln!(f, "scene      {}", or_none(self.recording.scene))?;
        if let Some(sensor) = &self.summary.sensor {
            match &sensor.name {
                Some(name) => writeln!(f, "tool       {}", name.escape_debug())?,
                None => writeln!(f, "sensor     {}", sensor.number)?,
            }
        }
        if self.sensors.len() > 1 {
            self.sensors.iter().try_for_each(|sensor| writeln!(f, "heard      {sensor}"))?;
        }
        write!(f, "poses      {}", self.poses)?;
        used(f, self.session_poses)?;
        if let Some(NeedleInspection { poses, session_poses, .. }) = &self.needle {
            match (&self.summary.needle, &self.summary.info.needle) {
                (Some(sensor), _) => write!(f, "needle     {sensor}: {poses} poses")?,
                (None, Some(wanted)) => write!(f, "needle     {wanted}: not heard")?,
                (None, None) => write!(f, "needle     {poses} poses")?,
            }
            used(f, *session_poses)?;
        }
        if let Some(Timing { rate_hz, p50_ms, p95_ms, max_ms, jitter_ms, gap_count, gaps }) = self.timing {
            let what = if self.poses > 0 { "poses" } else { "records" };
            writeln!(f, "rate       {rate_hz:.2} {what} a second")?;
            write!(f, "interval   p50 {p50_ms:.2} ms, p95 {p95_ms:.2} ms, max {max_ms:.2} ms; ")?;
            writeln!(f, "jitter {jitter_ms:.3} ms\ngaps       {gap_count} of more than 250 ms")?;
            gaps.iter().try_for_each(|gap| writeln!(f, "           at {:.2} s for {:.2} s", gap.at_s, gap.length_s))?;
        }
        if let Some(SessionSettings { version, seed, adapter, station_path, station }) = self.settings {
            writeln!(f, "made by    insonify {version}, seed {seed}\nadapter    {}", or_none(adapter))?;
            let (path, bytes) = (or_none(station_path), station.len());
            writeln!(f, "station    {path} ({bytes} bytes; --station prints it)")?;
        }
        if !self.marks.is_empty() || !self.marks_refused.is_empty() {
            writeln!(f, "marks      {}", self.marks.len())?;
        }
        self.marks.iter().try_for_each(|mark| writeln!(f, "  {mark}"))?;
        self.marks_refused.iter().try_for_each(|reason| writeln!(f, "  not read: {reason}"))?;
        writeln!(f, "events     {}", self.events.len())?;
        for event in self.events {
            let seconds = (i128::from(event.host_time_ns) - i128::from(self.start_time_ns)) as f64 * 1e-9;
            let value = event.value.as_ref().map_or_else(String::new, |value| format!(" = {value}"));
            writeln!(f, "  {seconds:9.3} s  {}{value}", clean(&event.name))?;
        }
        Ok(())
    }
}
