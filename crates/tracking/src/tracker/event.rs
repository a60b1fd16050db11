//! Events of a tracker session, and their texts.

use std::fmt;
use std::net::SocketAddr;
use std::time::Duration;

use super::DecodeError;
use super::damage::Damage;
use super::irregularity::Irregularity;
use super::sensor::{NeedleSensor, ProbeSensor, SensorName, how_to_choose, meant, meant_tool};

/// Event of a session.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum TrackerEvent {
    /// The port is open.
    Connected {
        /// Name of the port.
        port: String,
    },
    /// The port could not be opened, or was lost.
    Disconnected {
        /// Cause.
        reason: String,
        /// Time until the next attempt.
        retry: Duration,
    },
    /// No record arrived within the silence limit. The device is restarted: first on the open port, then on a reopened
    /// port, with a reset if its driver supports it. Mocks, recordings and datagram sources are not restarted.
    Silent {
        /// Duration of the silence.
        for_: Duration,
        /// Number of restarts since the last record, including this one.
        attempt: u32,
        /// Likely cause and remedy; `None` once records have arrived.
        cause: Option<String>,
    },
    /// Bytes that are not a record, or an error reported by the device. They are counted and reported by
    /// [`TrackerEvent::Damaged`].
    DecodeError(DecodeError),
    /// Damaged pieces of the last seconds, at most every five seconds.
    Damaged(Damage),
    /// Records of another sensor arrive and are left out. Reported once per sensor and connection.
    OtherSensor {
        /// Sensor whose records are left out.
        sensor: SensorName,
        /// Sensor that is the probe; `None` before its first record.
        used: Option<SensorName>,
    },
    /// The only tool heard so far is taken as the probe.
    OnlyTool {
        /// The tool.
        tool: SensorName,
    },
    /// Several sensors send records and none was chosen, so no record is used.
    Undecided {
        /// Sensors heard so far.
        heard: Vec<SensorName>,
    },
    /// Other sensors are heard, but the probe is not.
    ProbeMissing {
        /// The probe.
        wanted: ProbeSensor,
        /// Time since the probe's last record.
        for_: Duration,
        /// Sensors heard so far.
        heard: Vec<SensorName>,
    },
    /// Other sensors are heard, but the needle was never heard.
    NeedleMissing {
        /// The needle.
        wanted: NeedleSensor,
        /// Time since the port was opened.
        for_: Duration,
        /// Sensors heard so far.
        heard: Vec<SensorName>,
    },
    /// Datagrams of a second sender arrive and are left out.
    OtherSender {
        /// Sender whose datagrams are left out.
        other: SocketAddr,
        /// Sender whose datagrams are used.
        used: SocketAddr,
        /// Number of datagrams left out so far, of all senders.
        left_out: u64,
    },
    /// The sender in use fell silent, and another sender replaced it.
    SenderChanged {
        /// Sender until now.
        from: SocketAddr,
        /// New sender.
        to: SocketAddr,
    },
    /// Counter, clock or positions do not fit one device.
    Irregular(Irregularity),
    /// The recording ended, which ends the session.
    Ended,
}

impl fmt::Display for TrackerEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let seconds = |time: &Duration| time.as_secs_f64();
        match self {
            Self::Connected { port } => write!(f, "connected to {port}"),
            Self::Disconnected { reason, retry } => write!(f, "{reason}; trying again in {:.2} s", seconds(retry)),
            Self::Silent { for_, attempt, cause } => {
                write!(f, "no record for {:.1} s (attempt {attempt} to wake the tracker)", seconds(for_))?;
                cause.as_ref().map_or(Ok(()), |cause| write!(f, ": {cause}"))
            }
            Self::DecodeError(error) => write!(f, "{error}"),
            Self::Damaged(damage) => write!(f, "{damage}"),
            Self::OtherSensor { sensor, used } => {
                write!(f, "{sensor} also sends records, which are left out")?;
                used.as_ref().map_or(Ok(()), |used| write!(f, "; {used} is the probe"))
            }
            Self::OnlyTool { tool } => {
                let how = how_to_choose(std::slice::from_ref(tool));
                write!(f, "{tool} is the only one heard so far and is taken as the probe; to be sure, {how}")
            }
            Self::Undecided { heard } => {
                let (list, how) = (SensorName::listed(heard), how_to_choose(heard));
                write!(f, "several sensors are heard and none is chosen, so no pose is used: {list}; {how}")
            }
            Self::ProbeMissing { wanted, for_, heard } => {
                let list = SensorName::listed(heard);
                write!(f, "the probe ({wanted}) is not heard for {:.1} s; heard are {list}", seconds(for_))?;
                meant(wanted, heard).map_or(Ok(()), |name| write!(f, " (did you mean `{}`?)", name.escape_debug()))
            }
            Self::NeedleMissing { wanted, for_, heard } => {
                let list = SensorName::listed(heard);
                write!(f, "the needle ({wanted}) is not heard for {:.1} s; heard are {list}", seconds(for_))?;
                let NeedleSensor::Tool(tool) = wanted else { return Ok(()) };
                meant_tool(tool, heard).map_or(Ok(()), |name| write!(f, " (did you mean `{}`?)", name.escape_debug()))
            }
            Self::OtherSender { other, used, left_out } => write!(
                f,
                "datagrams of a second sender, {other}, are left out ({left_out} so far): {used} was heard first and is the \
                 tracker; stop one of them, or give each a port of its own (`[tracker] address`, `--address`)"
            ),
            Self::SenderChanged { from, to } => {
                write!(f, "{from} sends no more; datagrams of {to} are used from now on")
            }
            Self::Irregular(irregularity) => write!(f, "{irregularity}"),
            Self::Ended => write!(f, "the recording is at its end"),
        }
    }
}
