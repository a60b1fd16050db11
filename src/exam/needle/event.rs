//! Events of the needle's tip in a session.

use std::fmt;

use glam::DVec3;
use serde::{Serialize, Serializer};

use crate::needle::TipEventKind;
use crate::recording::Event;

/// Start of the names of recorded events of the tip. The kind follows.
pub const TIP_EVENT: &str = "needle.";

/// Kind of an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum NeedleEventKind {
    /// The tip entered a surface.
    Entered,
    /// The tip entered a surface that it had left: a double puncture.
    ReEntered,
    /// The tip left a surface.
    Left,
    /// The tip reached the target, for the first time since it entered the body.
    TargetReached,
    /// The image has not shown the tip for [`SETTLED_S`](super::slice::SETTLED_S), although it is in tissue.
    OutOfSlice,
    /// The image has shown the tip again for [`SETTLED_S`](super::slice::SETTLED_S).
    InSlice,
}

crate::names::named!(NeedleEventKind {
    Entered = "entered",
    ReEntered = "re-entered",
    Left = "left",
    TargetReached = "target-reached",
    OutOfSlice = "out-of-slice",
    InSlice = "in-slice",
});

impl From<TipEventKind> for NeedleEventKind {
    fn from(kind: TipEventKind) -> Self {
        match kind {
            TipEventKind::Entered => Self::Entered,
            TipEventKind::ReEntered => Self::ReEntered,
            TipEventKind::Left => Self::Left,
        }
    }
}

impl NeedleEventKind {
    /// Whether the tip went into a surface.
    pub fn is_entry(self) -> bool {
        matches!(self, Self::Entered | Self::ReEntered)
    }
}

impl Serialize for NeedleEventKind {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// Event of the tip. [`Display`](fmt::Display) is a sentence about it, without time and place.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NeedleEvent {
    /// Time since the session's start, s.
    pub time_s: f64,
    /// Kind of the event.
    pub kind: NeedleEventKind,
    /// Name of the surface that was crossed; `None` for other events.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub surface: Option<String>,
    /// Name of its tissue.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tissue: Option<String>,
    /// Place of the tip in the scene, mm.
    pub position_mm: DVec3,
    /// Number of punctures of the surface so far.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub punctures: Option<u32>,
    /// Whether the exercise forbids the surface.
    pub forbidden: bool,
}

impl NeedleEvent {
    /// Event that crosses no surface.
    pub(super) fn of_tip(kind: NeedleEventKind, time_s: f64, position_mm: DVec3) -> Self {
        Self { time_s, kind, surface: None, tissue: None, position_mm, punctures: None, forbidden: false }
    }

    /// The event in a recording, at `host_time_ns`: `needle.KIND`, with the other fields as value.
    pub fn recorded(&self, host_time_ns: u64) -> Event {
        let mut value = serde_json::to_value(self).unwrap_or_default();
        if let Some(fields) = value.as_object_mut() {
            // They are the event's own time and name.
            fields.remove("time_s");
            fields.remove("kind");
        }
        Event::new(host_time_ns, format!("{TIP_EVENT}{}", self.kind.name())).with(value)
    }

    /// Whether the tip entered a surface that the exercise forbids.
    pub fn is_forbidden_puncture(&self) -> bool {
        self.forbidden && self.kind.is_entry()
    }
}

impl fmt::Display for NeedleEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let surface = self.surface.as_deref().unwrap_or_default();
        match self.kind {
            NeedleEventKind::TargetReached => write!(f, "target reached"),
            NeedleEventKind::OutOfSlice => write!(f, "the picture doesn't show the tip"),
            NeedleEventKind::InSlice => write!(f, "the picture shows the tip again"),
            kind if self.is_forbidden_puncture() => write!(f, "{} {surface}, which is forbidden", kind.name()),
            kind => write!(f, "{} {surface}", kind.name()),
        }
    }
}
