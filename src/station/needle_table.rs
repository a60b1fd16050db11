//! `[needle]`: the second tracked tool.

use glam::DVec3;

use super::StationError;
use super::values::Values;
use crate::pose::Pose;
use crate::settings::NeedleSettings;
use crate::tracker::{NeedleSensor, Settings, Transport, TransportKind, mock};

/// Tip of a mock's needle in the probe frame, mm, unless the station says where it is.
const MOCK_TIP_MM: DVec3 = DVec3::new(0.0, 0.0, 40.0);

/// Direction of a mock's needle in the probe frame: in the image plane, down from the left.
const MOCK_DIRECTION: DVec3 = DVec3::new(1.0, 0.0, 1.0);

/// Needle of a station.
#[derive(Debug, Default)]
pub(super) struct NeedleTable {
    /// Gauge, length, bevel and kind.
    pub(super) settings: NeedleSettings,
    /// Fixed `scene_from_needle`; `None` unless the station gives one.
    pub(super) pose: Option<Pose>,
}

/// Reads `[needle]`, and sets the needle's sensor in `tracker`. A mock's needle moves near the needle's pose, or in front
/// of the probe at `probe`.
pub(super) fn needle(
    values: &Values,
    tracker: &mut Settings,
    probe: Option<Pose>,
) -> Result<NeedleTable, StationError> {
    let is_fixed = values.has("position_mm") || values.has("quaternion");
    let pose =
        is_fixed.then(|| values.pose("position_mm", "quaternion")).transpose().map_err(StationError::NeedlePose)?;
    tracker.device.needle = sensor(values, tracker, is_fixed)?;
    if let Transport::Mock(mock) = &mut tracker.transport {
        let in_front = Pose::looking(MOCK_TIP_MM, MOCK_DIRECTION, DVec3::X);
        mock.needle = Some(pose.unwrap_or_else(|| probe.unwrap_or(Pose::IDENTITY) * in_front));
    }
    Ok(NeedleTable { settings: values.group(), pose })
}

/// Sensor of the needle. `None` if nothing tracks it, because it stands at a fixed pose, or if a recording names it.
fn sensor(values: &Values, tracker: &Settings, is_fixed: bool) -> Result<Option<NeedleSensor>, StationError> {
    let protocol = tracker.protocol;
    let kind = tracker.transport.kind();
    match kind {
        TransportKind::None => {
            let reason = "`tracker.transport` is \"none\"; without a tracker the needle stands at `position_mm` and \
                          `quaternion`";
            values.refuse(&["sensor", "tool"], reason)?;
            return if is_fixed {
                Ok(None)
            } else {
                Err(missing("position_mm", "without a tracker, where the tip is"))
            };
        }
        TransportKind::Mock => {
            let reason = format!("the mock's needle is sensor {}", mock::NEEDLE_SENSOR);
            values.refuse(&["sensor", "tool"], &reason)?;
            return Ok(Some(NeedleSensor::Number(mock::NEEDLE_SENSOR)));
        }
        _ => {}
    }
    if values.has("tool") {
        values.refuse(&["sensor"], "`needle.tool` chooses the needle by its name")?;
    }
    let number = values.integer("sensor").and_then(|number| u16::try_from(number).ok());
    let tool = values.text("tool").map(|tool| NeedleSensor::Tool(tool.to_owned()));
    let chosen = tool.or(number.map(NeedleSensor::Number));
    if kind != TransportKind::Recording {
        let (name, numbers) = (protocol.name(), protocol.sensor_numbers());
        if numbers.start() == numbers.end() {
            let reason = format!(
                "`tracker.protocol` is \"{name}\", which has one sensor, the probe's; the needle stands at `position_mm` \
                 and `quaternion`"
            );
            values.refuse(&["sensor", "tool"], &reason)?;
            return if is_fixed { Ok(None) } else { Err(missing("position_mm", "where the tip is")) };
        }
        if protocol.has_names() {
            values.refuse(&["sensor"], &format!("`{name}` numbers its tools by arrival; name the needle by `tool`"))?;
        } else {
            values.refuse(&["tool"], &format!("`{name}` has sensors with numbers; `needle.sensor` chooses one"))?;
        }
        if let Some(number) = number.filter(|number| !numbers.contains(number)) {
            let reason = format!("it is {number}, and sensors of `{name}` have the numbers {numbers:?}");
            return Err(StationError::Text { key: "needle.sensor".to_owned(), reason });
        }
        if chosen.is_none() && !is_fixed {
            let (key, of) = if protocol.has_names() { ("tool", "tools") } else { ("sensor", "sensors") };
            let needed =
                format!("which of the tracker's {of} is the needle's, or `position_mm` of one that stands still");
            return Err(missing(key, &needed));
        }
    }
    // A recording names its own sensors, unless the station does.
    let is_live = kind != TransportKind::Recording;
    let probe = if is_live { tracker.stream(None).sensor } else { tracker.device.probe() };
    if let Some((needle, _)) = chosen.as_ref().zip(probe).filter(|(needle, probe)| needle.is_chosen_by(probe)) {
        return Err(both_on_one(needle, tracker));
    }
    Ok(chosen)
}

fn both_on_one(needle: &NeedleSensor, tracker: &Settings) -> StationError {
    let key = match needle {
        NeedleSensor::Number(_) => "sensor",
        NeedleSensor::Tool(_) => "tool",
    };
    let by = if tracker.device.probe().is_some() { format!("`tracker.{key}`") } else { "default".to_owned() };
    let reason = format!("{needle} is the probe's already, by {by}; give each a {key} of its own");
    StationError::Text { key: format!("needle.{key}"), reason }
}

fn missing(key: &str, needed: &str) -> StationError {
    StationError::Missing { key: format!("needle.{key}"), needed: needed.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::NeedleKind;
    use crate::station::StationError;
    use crate::station::tests::parse;

    const LIBERTY: &str = "[tracker]\ntransport = \"serial\"\nprotocol = \"liberty\"\nport = \"/dev/null\"\n";
    const IGTL: &str = "[tracker]\ntransport = \"tcp\"\nprotocol = \"openigtlink\"\naddress = \"h:18944\"\n";
    const LINES: &str = "[tracker]\ntransport = \"tcp\"\nprotocol = \"ascii-line\"\naddress = \"h:1\"\n";
    const RECORDING: &str = "[tracker]\ntransport = \"recording\"\nrecording = \"a.mcap\"\n";

    fn sensor_of(tables: &str) -> Option<NeedleSensor> {
        parse(tables).unwrap().tracker.device.needle
    }

    #[test]
    fn a_needle_has_a_sensor_or_a_tool_of_its_own() {
        assert_eq!(sensor_of(&format!("{LIBERTY}[needle]\nsensor = 2")), Some(NeedleSensor::Number(2)));
        assert_eq!(sensor_of(&format!("{LIBERTY}sensor = 2\n[needle]\nsensor = 1")), Some(NeedleSensor::Number(1)));
        let tool = Some(NeedleSensor::Tool("Needle".to_owned()));
        assert_eq!(sensor_of(&format!("{IGTL}[needle]\ntool = \"Needle\"")), tool);
        assert_eq!(sensor_of(&format!("{LINES}[needle]\nsensor = 1")), Some(NeedleSensor::Number(1)));
        assert_eq!(sensor_of(&format!("{RECORDING}[needle]")), None, "the recording says it");
        assert_eq!(sensor_of(&format!("{RECORDING}[needle]\ntool = \"Needle\"")), tool);
        let station = parse(&format!("{LIBERTY}[needle]\nsensor = 2\ngauge = 20\nkind = \"etched\"")).unwrap();
        let needle = station.settings.needle.unwrap();
        assert_eq!((needle.gauge, needle.kind, needle.length_mm), (20, NeedleKind::Etched, 90.0));
        assert_eq!((station.standing_needle(), station.needle_pose), (None, None));
        let without = parse(LIBERTY).unwrap();
        assert!(without.settings.needle.is_none() && without.tracker.device.needle.is_none());
        assert!(without.needle_settings().unwrap().is_none());
    }

    #[test]
    fn a_needle_without_a_sensor_stands_still() {
        for tracker in ["", LIBERTY, "[tracker]\ntransport = \"hid\"\n"] {
            let station = parse(&format!("{tracker}[needle]\nposition_mm = [1, 2, 3]")).unwrap();
            assert_eq!(station.tracker.device.needle, None);
            let needle = station.standing_needle().unwrap();
            assert_eq!((needle.tip_mm(), needle.direction()), (DVec3::new(1.0, 2.0, 3.0), DVec3::Z));
        }
    }

    #[test]
    fn a_mock_moves_a_needle_to_its_pose_or_in_front_of_the_probe() {
        let mock = |tables: &str| {
            let station =
                parse(&format!("[pose]\nposition_mm = [0, 0, 100]\n[tracker]\ntransport = \"mock\"\n{tables}"));
            let tracker = station.unwrap().tracker;
            let Transport::Mock(mock) = tracker.transport else { panic!("no mock") };
            (mock.needle.map(|pose| pose.position_mm), tracker.device.needle)
        };
        assert_eq!(mock(""), (None, None));
        let sensor = Some(NeedleSensor::Number(mock::NEEDLE_SENSOR));
        assert_eq!(mock("[needle]"), (Some(DVec3::Z * 140.0), sensor.clone()));
        assert_eq!(mock("[needle]\nposition_mm = [5, 0, 30]"), (Some(DVec3::new(5.0, 0.0, 30.0)), sensor));
    }

    #[test]
    fn mistakes_are_named() {
        let both = "tool = \"Needle\"\nsensor = 2";
        let long = "NeedleToReferenceOfTheTable";
        for (tracker, needle, message) in [
            (LIBERTY, "sensor = 1", "`needle.sensor`: sensor 1 is the probe's already, by default; give each a sensor"),
            (&format!("{LIBERTY}sensor = 2\n"), "sensor = 2", "sensor 2 is the probe's already, by `tracker.sensor`"),
            (
                &format!("{IGTL}tool = \"{long}\"\n"),
                &format!("tool = \"{}\"", &long[..20]),
                "`needle.tool`: tool `NeedleTo",
            ),
            (LIBERTY, both, "`needle.sensor` does not apply: `needle.tool` chooses the needle by its name"),
            (LIBERTY, "tool = \"Needle\"", "`needle.tool` does not apply: `liberty` has sensors with numbers"),
            (IGTL, "sensor = 2", "`needle.sensor` does not apply: `openigtlink` numbers its tools by arrival"),
            (LIBERTY, "sensor = 17", "`needle.sensor`: it is 17, and sensors of `liberty` have the numbers 1..=16"),
            (LIBERTY, "gauge = 20", "`needle.sensor` is missing: which of the tracker's sensors is the needle's"),
            (IGTL, "gauge = 20", "`needle.tool` is missing: which of the tracker's tools is the needle's"),
            (LIBERTY, "sensor = 2\nlength_mm = 0", "`needle.length_mm` is 0; it must be a number in 10..=300"),
            (LIBERTY, "sensor = 2\ngauge = 13", "`needle.gauge` is 13; it must be a whole number in 14..=27"),
            (LIBERTY, "sensor = 2\nguage = 20", "unknown key `guage` in `[needle]` (did you mean `gauge`?)"),
            ("", "sensor = 2", "`needle.sensor` does not apply: `tracker.transport` is \"none\""),
            ("", "gauge = 20", "`needle.position_mm` is missing: without a tracker, where the tip is"),
            ("", "position_mm = [0, 0, 0]\nquaternion = [1, 1, 0, 0]", "[needle]: the pose's quaternion"),
            (
                "[tracker]\ntransport = \"hid\"\n",
                "sensor = 1",
                "`tracker.protocol` is \"spacemouse\", which has one sensor",
            ),
            ("[tracker]\ntransport = \"mock\"\n", "sensor = 2", "the mock's needle is sensor 1"),
        ] {
            let error = parse(&format!("{tracker}[needle]\n{needle}")).unwrap_err().to_string();
            assert!(error.contains(message), "{needle}: {error}");
        }
    }

    #[test]
    fn a_tracked_needle_needs_the_mounting_of_its_sensor() {
        let dir = tempfile::tempdir().unwrap();
        let settings = |tracker: &str, calibration: Option<&str>| {
            std::fs::write(dir.path().join("c.toml"), calibration.unwrap_or_default()).unwrap();
            let named = calibration.map_or("", |_| "[calibration]\npath = \"c.toml\"\n");
            let text = format!("[scene]\nphantom = \"obstetric\"\n{named}{tracker}");
            crate::station::Station::parse(&text, dir.path()).unwrap().needle_settings().map(Option::unwrap)
        };
        let liberty = format!("{LIBERTY}[needle]\nsensor = 2");
        let error = settings(&liberty, Some("version = 1\n")).unwrap_err();
        assert!(matches!(error, StationError::NeedleMount { calibration: Some(_) }));
        let text = error.to_string();
        assert!(
            text.contains("c.toml has no table `[needle]`") && text.contains("`insonify calibrate pivot --of needle`"),
            "{text}"
        );
        assert!(settings(&liberty, None).unwrap_err().to_string().contains("`[calibration] path` names no file"));
        let mounted = "version = 1\n[needle]\ntip_mm = [0, 120, 0]\naxis = [0, 1, 0]\n";
        let found = settings(&liberty, Some(mounted)).unwrap();
        let needle = found.settings.calibration.scene_from_probe(Pose::IDENTITY);
        assert!(needle.position_mm.distance(DVec3::Y * 120.0) < 1e-9 && !found.bevel_known);
        assert!(needle.transform_vector(DVec3::Z).distance(DVec3::Y) < 1e-9, "{needle:?}");
        let found = settings(&liberty, Some(&format!("{mounted}bevel = [-1, 0, 0]\n"))).unwrap();
        let needle = found.settings.calibration.scene_from_probe(Pose::IDENTITY);
        assert!(needle.transform_vector(DVec3::X).distance(-DVec3::X) < 1e-9 && found.bevel_known, "{needle:?}");
        let wrong = settings(&liberty, Some(&mounted.replace("axis = [0, 1, 0]", "axis = [0, 0, 0]"))).unwrap_err();
        assert!(wrong.to_string().contains("`needle.axis`"), "{wrong}");
        // The mock's sensor is the needle's frame.
        assert!(settings("[tracker]\ntransport = \"mock\"\n[needle]", None).unwrap().bevel_known);
        assert!(settings(&format!("{RECORDING}[needle]"), None).is_ok());
        assert!(settings(&format!("{RECORDING}[needle]"), Some("version = 1\n")).is_err());
    }
}
