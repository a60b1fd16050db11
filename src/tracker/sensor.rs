//! Sensors of a stream, and the choice of the one that is the probe.

use std::fmt;

/// A sensor of a stream: a station, a port handle, or a named tool.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SensorName {
    /// Number of the station or port handle. Named tools are numbered in the order in which they are heard.
    pub number: u16,
    /// Name, if the protocol has names.
    pub name: Option<String>,
}

impl fmt::Display for SensorName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.name {
            // Names come from the network: control characters must not reach a terminal.
            Some(name) => write!(f, "tool `{}`", name.escape_debug()),
            None => write!(f, "sensor {}", self.number),
        }
    }
}

/// Sensor of a stream that is the probe.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ProbeSensor {
    /// The only one heard. As soon as a second one is heard, no sensor is the probe.
    Only,
    /// The one with this number.
    Number(u16),
    /// The tool with this name.
    Tool(String),
}

impl fmt::Display for ProbeSensor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Only => write!(f, "the only sensor"),
            Self::Number(number) => write!(f, "sensor {number}"),
            Self::Tool(name) => write!(f, "tool `{}`", name.escape_debug()),
        }
    }
}

/// List of sensors for messages: tools by name, others by number.
pub(crate) fn listed(heard: &[SensorName]) -> String {
    let all: Vec<String> = heard.iter().map(SensorName::to_string).collect();
    all.join(", ")
}

/// Advice that names the keys and options that choose the probe among `heard`.
pub(crate) fn how_to_choose(heard: &[SensorName]) -> String {
    match heard.first() {
        Some(SensorName { name: Some(name), .. }) => {
            let name = name.escape_debug();
            format!("name the probe, as in `[tracker] tool = \"{name}\"` of the station file or `--tool {name}`")
        }
        Some(SensorName { number, .. }) => {
            format!(
                "give the probe's number, as in `[tracker] sensor = {number}` of the station file or `--sensor {number}`"
            )
        }
        None => "name the probe by `[tracker] tool` or `sensor`".to_owned(),
    }
}
