//! Replay of a recorded session without a clock: the poses and settings of the live session at any time.

use glam::DVec3;
use serde_json::Value;

use super::recorded::{SETTINGS_EVENT, settings_after};
use crate::needle::NeedleEstimate;
use crate::pose::{Estimate, Estimator, Measurement, Reading};
use crate::recording::{DISCONNECTED_EVENT, Event};
use crate::settings::{LiveSettings, SettingsGroup as _, live_settings};

/// Time between the assumed rest of a hand-held puck (a 3D mouse) and its first measurement, ns.
const REST_NS: u64 = 1_000_000;

/// Measurement of zero rates, for a puck at rest, which sends nothing itself.
pub(super) fn at_rest(host_time_ns: u64) -> Measurement {
    let reading = Reading::Rates { translation: DVec3::ZERO, rotation: DVec3::ZERO };
    Measurement { host_time_ns, device_time_us: None, sequence: None, reading }
}

/// Poses of a recording: its measurements, filtered by the estimator of live sessions.
#[derive(Debug, Clone)]
pub struct ReplayedPoses {
    estimator: Estimator,
    measurements: Vec<Measurement>,
    next: usize,
    /// Times at which the tracker disconnected, ns since 1970 (UTC), ascending.
    disconnected: Vec<u64>,
    next_disconnected: usize,
}

impl ReplayedPoses {
    /// A replay of `measurements`, in ascending host time. `events` tells when the tracker disconnected.
    pub fn new(mut estimator: Estimator, measurements: Vec<Measurement>, events: &[Event]) -> Self {
        let gone = events.iter().filter(|event| event.name == DISCONNECTED_EVENT);
        let mut disconnected: Vec<u64> = gone.map(|event| event.host_time_ns).collect();
        disconnected.sort_unstable();
        // A puck sends nothing until it is moved. A live session assumes the same when it opens one.
        if let Some(first @ Measurement { reading: Reading::Rates { .. }, .. }) = measurements.first() {
            estimator.push(&at_rest(first.host_time_ns.saturating_sub(REST_NS)));
        }
        Self { estimator, measurements, next: 0, disconnected, next_disconnected: 0 }
    }

    /// Estimate of a live session at `time_ns` for a frame that is shown immediately. Times must not decrease between
    /// calls.
    pub fn at(&mut self, time_ns: u64) -> Estimate {
        loop {
            let measured = self.measurements.get(self.next).filter(|m| m.host_time_ns <= time_ns);
            let gone = self.disconnected.get(self.next_disconnected).filter(|t| **t <= time_ns);
            match (measured, gone) {
                (Some(measurement), gone) if gone.is_none_or(|gone| measurement.host_time_ns <= *gone) => {
                    self.estimator.push(measurement);
                    self.next += 1;
                }
                (_, Some(_)) => {
                    self.estimator.disconnected();
                    self.next_disconnected += 1;
                }
                _ => break,
            }
        }
        self.estimator.sample(time_ns, time_ns)
    }
}

/// Needle of a recording: the measurements of its sensor, filtered by the estimator of live sessions.
#[derive(Debug, Clone)]
pub struct ReplayedNeedle {
    /// Poses of the needle, from an estimator with the needle's mounting in place of the probe's.
    pub poses: ReplayedPoses,
    /// Whether the sensor's mounting says to which side the bevel faces.
    pub bevel_known: bool,
}

impl ReplayedNeedle {
    /// The needle of a live session at `time_ns`, as [`ReplayedPoses::at`].
    pub fn at(&mut self, time_ns: u64) -> NeedleEstimate {
        NeedleEstimate::of(&self.poses.at(time_ns), self.bevel_known)
    }
}

/// Settings of a recorded session, from its events.
#[derive(Debug, Clone)]
pub(crate) struct ReplayedControls {
    /// Settings of the replay's station.
    begin: LiveSettings,
    live: LiveSettings,
    /// Settings and the time from which they apply, ns since 1970 (UTC), ascending.
    changes: Vec<(u64, LiveSettings)>,
    next: usize,
    /// Settings at the start, if the session recorded them.
    first: Option<LiveSettings>,
    refused: Vec<String>,
}

/// A setting whose initial value differs between a recorded session and its replay.
#[derive(Debug, Clone, PartialEq)]
pub struct OtherSetting {
    /// Key without its table.
    pub key: String,
    /// Value in the recorded session.
    pub recorded: Value,
    /// Value in the replay.
    pub here: Value,
}

impl ReplayedControls {
    /// A replay of the settings in `events`, starting from `begin`.
    pub(crate) fn new(begin: LiveSettings, events: &[Event]) -> Self {
        let (changes, refused) = (Vec::new(), Vec::new());
        let mut replayed = Self { begin, live: begin, changes, next: 0, first: None, refused };
        let mut events: Vec<&Event> = events.iter().collect();
        events.sort_by_key(|event| event.host_time_ns);
        let mut last = begin;
        for event in events {
            let Some(changed) = settings_after(event, &last) else { continue };
            let changed = changed.and_then(|live| live.validate().map(|()| live).map_err(|error| error.to_string()));
            if let (None, Ok(live)) = (replayed.first, &changed)
                && names_most(event)
            {
                replayed.first = Some(*live);
            }
            match changed {
                Ok(live) if live != last => {
                    last = live;
                    replayed.changes.push((event.host_time_ns, live));
                }
                Ok(_) => {}
                Err(reason) => replayed.refused.push(format!("event `{}`: {reason}", event.name)),
            }
        }
        replayed
    }

    /// Picture settings whose initial values differ between the session and the replay; empty if the recording has no
    /// initial settings.
    pub(crate) fn others_at_start(&self) -> Vec<OtherSetting> {
        let Some(first) = &self.first else { return Vec::new() };
        let of_picture = live_settings().filter(|setting| setting.is_of_picture());
        let others = of_picture.filter_map(|setting| {
            let [recorded, here] =
                [first, &self.begin].map(|live| live.stored(setting.key).map(|at| setting.to_json(at)));
            let (recorded, here) = recorded.zip(here)?;
            let key = setting.key.to_owned();
            (!is_same(&recorded, &here)).then_some(OtherSetting { key, recorded, here })
        });
        others.collect()
    }

    /// Reasons why events were not applied.
    pub(crate) fn refused(&self) -> &[String] {
        &self.refused
    }

    /// The settings at `time_ns`. Times must not decrease between calls.
    pub(crate) fn at(&mut self, time_ns: u64) -> LiveSettings {
        while let Some((_, live)) = self.changes.get(self.next).filter(|(from, _)| *from <= time_ns) {
            self.live = *live;
            self.next += 1;
        }
        self.live
    }
}

/// Whether `event` names most of the live settings. A session records all of them at its start; an older version of
/// insonify may have had fewer.
fn names_most(event: &Event) -> bool {
    let named = event.value.as_ref().and_then(Value::as_object).filter(|_| event.name == SETTINGS_EVENT);
    let count = named.map_or(0, |named| live_settings().filter(|setting| named.contains_key(setting.key)).count());
    2 * count > live_settings().count()
}

/// Whether two values are equal, within the rounding error of numbers read from text.
fn is_same(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Array(a), Value::Array(b)) => a.len() == b.len() && a.iter().zip(b).all(|(a, b)| is_same(a, b)),
        _ => match (a.as_f64(), b.as_f64()) {
            (Some(a), Some(b)) => (a - b).abs() <= 1e-9 * a.abs().max(b.abs()),
            _ => a == b,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::Settings;
    use crate::pose::{Pose, TrackingState};

    const MS: u64 = 1_000_000;
    const START: u64 = 1_790_000_000_000_000_000;

    fn measured(ms: u64, reading: Reading) -> Measurement {
        Measurement { host_time_ns: START + ms * MS, device_time_us: None, sequence: None, reading }
    }

    fn at_x(x: f64) -> Reading {
        Reading::Pose(Pose { position_mm: DVec3::X * x, ..Pose::IDENTITY })
    }

    fn replayed(measurements: Vec<Measurement>, events: &[Event]) -> ReplayedPoses {
        ReplayedPoses::new(Estimator::new(Settings::default()), measurements, events)
    }

    #[test]
    fn a_frame_knows_what_came_before_it_and_nothing_later() {
        let moving: Vec<_> = (0..100).map(|i| measured(i * 10, at_x(i as f64))).collect();
        let mut whole = replayed(moving.clone(), &[]);
        // Poses do not depend on later measurements.
        let mut cut = replayed(moving[..51].to_vec(), &[]);
        for ms in [0, 100, 333, 500] {
            assert_eq!(whole.at(START + ms * MS), cut.at(START + ms * MS), "{ms}");
        }
        let Estimate { scene_from_probe: pose, state, .. } = whole.at(START + 500 * MS);
        assert_eq!(state, TrackingState::Good);
        assert!((pose.unwrap().position_mm.x - 50.0).abs() < 3.0, "filtered, not far behind: {pose:?}");
        let late = cut.at(START + 9000 * MS);
        assert_eq!((late.scene_from_probe, late.state), (None, TrackingState::Lost));
    }

    #[test]
    fn a_tracker_that_was_gone_is_trusted_only_after_some_measurements() {
        let moving: Vec<_> = (0..20).map(|i| measured(i * 10, at_x(0.0))).collect();
        let gone = Event::new(START + 101 * MS, DISCONNECTED_EVENT);
        let mut poses = replayed(moving, &[gone]);
        let states = [100, 105, 110, 140].map(|ms| poses.at(START + ms * MS).state);
        assert_eq!(states, [TrackingState::Good, TrackingState::Held, TrackingState::Held, TrackingState::Good]);
    }

    #[test]
    fn a_puck_moves_the_probe() {
        let push = Reading::Rates { translation: DVec3::X, rotation: DVec3::ZERO };
        let mut poses = replayed((0..51).map(|i| measured(i * 20, push)).collect(), &[]);
        let x = poses.at(START + 1000 * MS).scene_from_probe.unwrap().position_mm.x;
        assert!((x - 80.0).abs() < 4.0, "a second at 80 mm/s: {x}");
    }

    #[test]
    fn settings_hold_from_their_time_on_and_nonsense_is_refused() {
        let event = |ms: u64, name: &str, value: serde_json::Value| Event::new(START + ms * MS, name).with(value);
        let begin = LiveSettings { generator: false, ..LiveSettings::default() };
        let mut louder = LiveSettings { frozen: true, ..begin };
        (louder.probe.depth_mm, louder.render.quality.rays) = (90.0, 4);
        let events = [
            event(300, "settings", louder.to_json().into()),
            event(100, "gain_db", 6.0.into()),
            event(150, "gain_db", 1e9.into()),
            event(160, "rays", "many".into()),
            event(170, "tgc_sliders_db", serde_json::json!([1, 2, 3])),
            event(200, "first view", 7.into()),
        ];
        let mut controls = ReplayedControls::new(begin, &events);
        assert_eq!((controls.changes.len(), controls.refused().len()), (2, 3), "{:?}", controls.refused());
        assert!(controls.refused()[0].contains("image.gain_db") && controls.refused()[1].contains("rays"));
        assert_eq!(controls.at(START), begin);
        let at_100 = controls.at(START + 100 * MS);
        assert_eq!((at_100.render.image.gain_db, at_100.probe), (6.0, begin.probe));
        assert_eq!(controls.at(START + 299 * MS), at_100);
        assert_eq!(controls.at(START + 300 * MS), louder);
    }

    #[test]
    fn settings_at_the_start_are_compared_with_the_station() {
        let begin = LiveSettings::default();
        let others = |events: &[Event]| ReplayedControls::new(begin, events).others_at_start();
        let event = |ms: u64, live: &LiveSettings| Event::new(START + ms * MS, "settings").with(live.to_json());
        let mut other = begin;
        (other.probe.depth_mm, other.render.image.tgc_sliders_db[3]) = (90.0, 2.5);
        // Neither an event with a single setting nor a later event gives the initial settings.
        let single = Event::new(START, "settings").with(serde_json::json!({"gain_db": 6.0}));
        assert_eq!(others(&[single, event(1, &begin), event(2, &other)]), []);
        let mut keys: Vec<String> = others(&[event(1, &other), event(2, &begin)]).into_iter().map(|o| o.key).collect();
        keys.sort_unstable();
        assert_eq!(keys, ["depth_mm", "tgc_sliders_db"]);
        let found = others(&[event(1, &other)]);
        let depth = found.iter().find(|other| other.key == "depth_mm").unwrap();
        assert_eq!((depth.recorded.as_f64(), depth.here.as_f64()), (Some(90.0), Some(150.0)));
    }

    #[test]
    fn a_recording_that_lacks_a_setting_of_today_still_tells_its_start() {
        let mut recorded = LiveSettings::default().to_json();
        recorded.remove("focus_mm");
        recorded.insert("gain_db".to_owned(), 12.0.into());
        let event = Event::new(START, "settings").with(recorded);
        let others = ReplayedControls::new(LiveSettings::default(), &[event]).others_at_start();
        assert_eq!(others.iter().map(|other| &*other.key).collect::<Vec<_>>(), ["gain_db"]);
    }
}
