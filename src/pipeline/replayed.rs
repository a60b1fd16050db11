//! A recorded session without a clock: what a live one knew at a time, the same however fast it is asked.

use glam::DVec3;
use serde_json::Value;

use super::recorded::{SETTINGS_EVENT, settings_after, settings_value};
use crate::pose::{Estimate, Estimator, Measurement, Reading};
use crate::render::{Quality, RenderSettings};
use crate::sink::live::LiveSettings;
use crate::tracker::recording::{DISCONNECTED_EVENT, Event};
use crate::transducer::Probe;

/// A puck is known to rest from so long before its first measurement on, ns.
const REST_NS: u64 = 1_000_000;

/// The poses of a recording's measurements, by the estimator of a live session.
#[derive(Debug, Clone)]
pub struct ReplayedPoses {
    estimator: Estimator,
    measurements: Vec<Measurement>,
    next: usize,
    /// When the tracker was gone, ns since 1970 (UTC).
    disconnected: Vec<u64>,
    next_disconnected: usize,
}

impl ReplayedPoses {
    /// Of `measurements` that ascend in host time, and of what `events` tell of the tracker.
    pub fn new(mut estimator: Estimator, measurements: Vec<Measurement>, events: &[Event]) -> Self {
        let gone = events.iter().filter(|event| event.name == DISCONNECTED_EVENT);
        let mut disconnected: Vec<u64> = gone.map(|event| event.host_time_ns).collect();
        disconnected.sort_unstable();
        // As when its device is opened: it says nothing before it is moved.
        if let Some(first @ Measurement { reading: Reading::Rates { .. }, .. }) = measurements.first() {
            let reading = Reading::Rates { translation: DVec3::ZERO, rotation: DVec3::ZERO };
            let host_time_ns = first.host_time_ns.saturating_sub(REST_NS);
            estimator.push(&Measurement { host_time_ns, device_time_us: None, sequence: None, reading });
        }
        Self { estimator, measurements, next: 0, disconnected, next_disconnected: 0 }
    }

    /// Estimate of a live session at `time_ns` for a frame that is shown at once. Times must not fall from call to call.
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

/// What was set in a recorded session, by its events.
#[derive(Debug, Clone)]
pub struct ReplayedControls {
    probe: Probe,
    settings: RenderSettings,
    live: LiveSettings,
    /// What holds from a time on, ns since 1970 (UTC), ascending.
    changes: Vec<(u64, LiveSettings)>,
    next: usize,
    /// What the session itself said that it began with.
    first: Option<LiveSettings>,
    refused: Vec<String>,
}

/// A setting that a recorded session began with and that its replay has otherwise.
#[derive(Debug, Clone, PartialEq)]
pub struct OtherSetting {
    /// Its name in the recording's events.
    pub key: String,
    /// Value in the recorded session.
    pub recorded: Value,
    /// Value here.
    pub here: Value,
}

/// Names of settings that change no rendered picture.
const NOT_RENDERED: [&str; 2] = ["frozen", "enhance"];

impl ReplayedControls {
    /// Of a session that began with `probe` and `settings`; `events` may tell of others at its start already.
    pub fn new(probe: &Probe, settings: &RenderSettings, events: &[Event]) -> Self {
        let begin = super::controls::live_settings(probe, settings, false, false);
        let (probe, settings) = (*probe, *settings);
        let (changes, refused) = (Vec::new(), Vec::new());
        let mut replayed = Self { probe, settings, live: begin, changes, next: 0, first: None, refused };
        let mut events: Vec<&Event> = events.iter().collect();
        events.sort_by_key(|event| event.host_time_ns);
        let mut last = begin;
        for event in events {
            let Some(changed) = settings_after(event, &last) else { continue };
            let changed = changed.and_then(|live| replayed.apply(&live).map(|_| live));
            if let (None, Ok(live)) = (replayed.first, &changed)
                && names_all(event, &begin)
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

    /// What the session began with other than `probe` and `settings` say; nothing where its recording does not tell.
    pub fn others_at_start(&self) -> Vec<OtherSetting> {
        let Some(first) = &self.first else { return Vec::new() };
        let here = super::controls::live_settings(&self.probe, &self.settings, false, false);
        let (Value::Object(first), Value::Object(mut here)) = (settings_value(first), settings_value(&here)) else {
            return Vec::new();
        };
        let others = first.into_iter().filter_map(|(key, recorded)| {
            let here = here.remove(&key)?;
            let differs = !NOT_RENDERED.contains(&&*key) && !is_same(&recorded, &here);
            differs.then_some(OtherSetting { key, recorded, here })
        });
        others.collect()
    }

    /// How often anything was set.
    pub fn changes(&self) -> usize {
        self.changes.len()
    }

    /// Events that set nothing, since what they say cannot be: why.
    pub fn refused(&self) -> &[String] {
        &self.refused
    }

    /// The settings at `time_ns`. Times must not fall from call to call.
    pub fn at(&mut self, time_ns: u64) -> LiveSettings {
        while let Some((_, live)) = self.changes.get(self.next).filter(|(from, _)| *from <= time_ns) {
            self.live = *live;
            self.next += 1;
        }
        self.live
    }

    /// What a renderer needs for `live`.
    ///
    /// # Errors
    /// The first value out of range.
    pub fn apply(&self, live: &LiveSettings) -> Result<(Probe, RenderSettings), String> {
        let probe = Probe { depth_mm: live.depth_mm, focus_mm: live.focus_mm, ..self.probe };
        let quality = Quality { rays: live.rays, layers: live.layers, ..self.settings.quality };
        let settings = RenderSettings { image: live.image, quality, ..self.settings };
        settings.validate().map_err(|error| error.to_string())?;
        probe.validate().map_err(|error| error.to_string())?;
        Ok((probe, settings))
    }
}

/// Whether `event` holds every setting, as a session says them at its start.
fn names_all(event: &Event, settings: &LiveSettings) -> bool {
    let named = event.value.as_ref().and_then(Value::as_object).filter(|_| event.name == SETTINGS_EVENT);
    let all = settings_value(settings);
    named.is_some_and(|named| all.as_object().is_some_and(|all| all.keys().all(|key| named.contains_key(key))))
}

/// Whether two settings are one: reading a number may cost its last bit.
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
        // What comes later is not there, and the poses are the same.
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
    fn what_was_set_holds_from_its_time_on_and_nonsense_is_refused() {
        let (probe, settings) = (Probe::default(), RenderSettings::default());
        let event = |ms: u64, name: &str, value: serde_json::Value| Event::new(START + ms * MS, name).with(value);
        let begin = super::super::controls::live_settings(&probe, &settings, false, false);
        let louder = LiveSettings { frozen: true, depth_mm: 90.0, rays: 4, ..begin };
        let events = [
            event(300, "settings", settings_value(&louder)),
            event(100, "gain_db", 6.0.into()),
            event(150, "gain_db", 1e9.into()),
            event(160, "rays", "many".into()),
            event(170, "tgc_sliders_db", serde_json::json!([1, 2, 3])),
            event(200, "first view", 7.into()),
        ];
        let mut controls = ReplayedControls::new(&probe, &settings, &events);
        assert_eq!((controls.changes(), controls.refused().len()), (2, 3), "{:?}", controls.refused());
        assert!(controls.refused()[0].contains("image.gain_db") && controls.refused()[1].contains("rays"));
        assert_eq!(controls.at(START), begin);
        let at_100 = controls.at(START + 100 * MS);
        assert_eq!((at_100.image.gain_db, at_100.depth_mm), (6.0, begin.depth_mm));
        let last = controls.at(START + 299 * MS);
        assert_eq!(last, at_100);
        let last = controls.at(START + 300 * MS);
        assert_eq!(last, louder);
        let (probe, settings) = controls.apply(&last).unwrap();
        assert_eq!((probe.depth_mm, settings.quality.rays, settings.quality.seed), (90.0, 4, 0));
    }

    #[test]
    fn what_a_session_began_with_is_compared_with_its_station() {
        let (probe, settings) = (Probe::default(), RenderSettings::default());
        let begin = super::super::controls::live_settings(&probe, &settings, false, true);
        let others = |events: &[Event]| ReplayedControls::new(&probe, &settings, events).others_at_start();
        let event = |ms: u64, live: &LiveSettings| Event::new(START + ms * MS, "settings").with(settings_value(live));
        let mut other = LiveSettings { depth_mm: 90.0, ..begin };
        other.image.tgc_sliders_db[3] = 2.5;
        // One that changes a single setting is no start; later ones aren't, either.
        let single = Event::new(START, "settings").with(serde_json::json!({"gain_db": 6.0}));
        assert_eq!(others(&[single, event(1, &begin), event(2, &other)]), []);
        let mut keys: Vec<String> = others(&[event(1, &other), event(2, &begin)]).into_iter().map(|o| o.key).collect();
        keys.sort_unstable();
        assert_eq!(keys, ["depth_mm", "tgc_sliders_db"]);
        let found = others(&[event(1, &other)]);
        let depth = found.iter().find(|other| other.key == "depth_mm").unwrap();
        assert_eq!((depth.recorded.as_f64(), depth.here.as_f64()), (Some(90.0), Some(probe.depth_mm)));
    }
}
