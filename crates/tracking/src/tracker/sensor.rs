//! Sensors of a stream, and the choice of the probe among them.

use std::fmt;

use super::openigtlink::NAME_LENGTH;

/// Name of one sensor in a tracker stream: a Polhemus station number, an NDI port handle or a tool name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SensorName {
    /// Number of the station or port handle. Named tools are numbered in the order of their first records.
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

impl SensorName {
    /// List of sensors for messages: tools by name, others by number.
    pub fn listed(heard: &[Self]) -> String {
        let all: Vec<String> = heard.iter().map(Self::to_string).collect();
        all.join(", ")
    }

    /// Key of `[tracker]` that chooses this sensor, and its value.
    pub(crate) fn key(&self) -> String {
        match &self.name {
            Some(name) => format!("tool = \"{}\"", name.escape_debug()),
            None => format!("sensor = {}", self.number),
        }
    }
}

/// Choice of the sensor that is the probe.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ProbeSensor {
    /// The only sensor received. As soon as a second sensor is received, no sensor is the probe.
    Only,
    /// The sensor with this number.
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

/// Choice of the sensor that is the needle's.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum NeedleSensor {
    /// The sensor with this number.
    Number(u16),
    /// The tool with this name.
    Tool(String),
}

impl fmt::Display for NeedleSensor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => write!(f, "sensor {number}"),
            Self::Tool(name) => write!(f, "tool `{}`", name.escape_debug()),
        }
    }
}

impl NeedleSensor {
    /// Whether the needle's sensor has the number `number`, of the tool `name` if the protocol has names.
    #[cfg(feature = "recordings")]
    pub(crate) fn is(&self, number: u16, name: Option<&str>) -> bool {
        match self {
            Self::Number(wanted) => *wanted == number,
            Self::Tool(tool) => name.is_some_and(|name| is_tool(tool, name)),
        }
    }

    /// Whether `probe` chooses the same sensor.
    pub fn is_chosen_by(&self, probe: &ProbeSensor) -> bool {
        match (self, probe) {
            (Self::Number(needle), ProbeSensor::Number(probe)) => needle == probe,
            (Self::Tool(needle), ProbeSensor::Tool(probe)) => on_wire(needle) == on_wire(probe),
            _ => false,
        }
    }
}

/// Part of a tool's name that the wire holds, bytes.
fn on_wire(tool: &str) -> &[u8] {
    &tool.as_bytes()[..tool.len().min(NAME_LENGTH)]
}

/// Whether `tool`, the user's choice, is the received tool `name`, which senders may truncate.
pub(super) fn is_tool(tool: &str, name: &str) -> bool {
    tool == name || (tool.len() > NAME_LENGTH && tool.as_bytes().get(..NAME_LENGTH) == Some(name.as_bytes()))
}

/// Name among `heard` that was likely intended by `wanted`: the only name that is equal except for case, punctuation
/// and `2` for `to`; else the only name that contains `wanted` or is a part of it; else the only name. `None` if
/// `wanted` itself was received.
pub(crate) fn meant<'a>(wanted: &ProbeSensor, heard: &'a [SensorName]) -> Option<&'a str> {
    let ProbeSensor::Tool(tool) = wanted else { return None };
    meant_tool(tool, heard)
}

/// [`meant`] for a tool's name.
pub(crate) fn meant_tool<'a>(tool: &str, heard: &'a [SensorName]) -> Option<&'a str> {
    let plain = |name: &str| -> String {
        let letters: String = name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect();
        letters.replace('2', "to")
    };
    let names: Vec<&str> = heard.iter().filter_map(|sensor| sensor.name.as_deref()).collect();
    if names.iter().any(|name| is_tool(tool, name)) {
        return None;
    }
    let tool = plain(tool);
    let only = |is_near: &dyn Fn(&str) -> bool| {
        let mut near = names.iter().copied().filter(|name| is_near(&plain(name)));
        near.next().filter(|_| near.next().is_none())
    };
    let same = only(&|name| name == tool);
    let part = || only(&|name| !name.is_empty() && !tool.is_empty() && (name.contains(&tool) || tool.contains(name)));
    same.or_else(part).or_else(|| only(&|_| true))
}

/// Advice with the settings and options that choose the probe among `heard`.
pub(crate) fn how_to_choose(heard: &[SensorName]) -> String {
    let Some(first) = heard.first() else { return "name the probe by `[tracker] tool` or `sensor`".to_owned() };
    let (what, option) = match &first.name {
        Some(name) => ("name the probe", format!("--tool {}", name.escape_debug())),
        None => ("give the probe's number", format!("--sensor {}", first.number)),
    };
    format!("{what}, as in `[tracker] {}` of the station file or `{option}`", first.key())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sensors_are_listed_and_chosen_by_the_name_or_number_that_they_have() {
        let named = SensorName { number: 0, name: Some("Probe".into()) };
        let numbered = SensorName { number: 3, name: None };
        assert_eq!(SensorName::listed(&[named.clone(), numbered.clone()]), "tool `Probe`, sensor 3");
        let how = how_to_choose(&[named]);
        assert_eq!(how, "name the probe, as in `[tracker] tool = \"Probe\"` of the station file or `--tool Probe`");
        let how = how_to_choose(&[numbered]);
        assert_eq!(how, "give the probe's number, as in `[tracker] sensor = 3` of the station file or `--sensor 3`");
    }

    #[test]
    fn the_tool_that_was_meant_is_found() {
        let heard = |names: &[&str]| -> Vec<SensorName> {
            let named = |(n, name): (usize, &&str)| SensorName { number: n as u16, name: Some((*name).to_owned()) };
            names.iter().enumerate().map(named).collect()
        };
        let all = heard(&["StylusToTracker", "ProbeToTracker", "ReferenceToTracker"]);
        let one = heard(&["NeedleToReference"]);
        for (wanted, heard, expected) in [
            ("probetotracker", &all, Some("ProbeToTracker")),
            ("Probe2Tracker", &all, Some("ProbeToTracker")),
            ("Probe", &all, Some("ProbeToTracker")),
            ("ProbeToTracker", &all, None),
            ("Tracker", &all, None),
            ("Table", &all, None),
            ("Table", &one, Some("NeedleToReference")),
        ] {
            assert_eq!(meant(&ProbeSensor::Tool(wanted.to_owned()), heard), expected, "{wanted}");
        }
        assert_eq!(meant(&ProbeSensor::Number(3), &one), None);
    }
}
