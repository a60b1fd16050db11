//! Estimation of the probe's pose at display time from the measurements of a live tracker.

use super::clock_regression::{ClockRegression, Timing};
use super::counters::Counters;
use super::jump_gate::{Gate, JumpGate};
use super::one_euro::{Motion, OneEuro};
use super::prediction::{horizon_s, predict};
use super::rates::RateIntegrator;
use super::ring::PoseRing;
use super::settings::Settings;
use super::speed::Speed;
use super::stream_order::{StreamOrder, StreamPosition};
use super::stuck::StuckWatch;
use super::tracking::{TrackingClock, TrackingState};
use super::{Measurement, Pose, QUATERNION_NORM_TOLERANCE, Reading, TimedPose};

/// Number of poses in the history: one second at 60 poses per second, for displays that lag.
const HISTORY: usize = 64;

/// Gap between measurements after which the filter restarts, s.
const FILTER_GAP_S: f64 = 0.5;

/// Largest decrease of `now` between two samples that counts as jitter, ns. A larger one means a clock set back.
const NOW_JITTER_NS: u64 = 20_000_000;

/// Estimate of the probe's pose at a display time. It accompanies its frame from rendering to display.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Estimate {
    /// Filtered and predicted pose; `None` before the first measurement and while tracking is lost.
    pub scene_from_probe: Option<Pose>,
    /// Tracking state of the pose.
    pub state: TrackingState,
    /// Arrival of the newest measurement's first byte, ns since 1970 (UTC); `None` without a tracker.
    pub first_byte_ns: Option<u64>,
    /// Number of measurements so far that became poses.
    pub measurements: u64,
    /// Latest [`Jump`] of the session; `None` before the first one.
    pub jump: Option<Jump>,
    /// Time by which the pose is predicted beyond the newest measurement, ms.
    pub predicted_ms: f64,
    /// Speed of the probe at the newest measurement; `None` if that measurement is too old to describe the current
    /// motion.
    pub speed: Option<Speed>,
}

/// A displacement farther than a hand moves in the elapsed time, confirmed by a second measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Jump {
    /// Number of the jump in the session, from 1.
    pub number: u64,
    /// First-byte arrival of the measurement that was held back until the next one confirmed it, ns since 1970 (UTC).
    pub first_byte_ns: u64,
}

/// Estimator of poses from the measurements of one sensor.
///
/// Measurements are pushed as they arrive; [`sample`](Self::sample) estimates the pose at any time. Both take times of
/// the host's clock, ns since 1970 (UTC). Nothing is allocated after [`new`](Self::new), and no input makes it panic.
#[derive(Debug, Clone)]
pub struct Estimator {
    settings: Settings,
    order: StreamOrder,
    clock: ClockRegression,
    gate: JumpGate,
    filter: OneEuro,
    rates: RateIntegrator,
    stuck: StuckWatch,
    tracking: TrackingClock,
    history: PoseRing,
    counters: Counters,
    /// Motion at the newest measurement.
    motion: Option<Motion>,
    /// Regressed time and arrival time of the newest measurement, ns.
    newest: Option<(u64, u64)>,
    /// Arrival time of the latest spike, ns.
    spike_ns: u64,
    jump: Option<Jump>,
    /// `now` of the last call of `sample`, ns.
    last_now_ns: Option<u64>,
}

impl Estimator {
    /// An estimator without measurements.
    pub fn new(settings: Settings) -> Self {
        let filter = &settings.filter;
        Self {
            order: StreamOrder::default(),
            clock: ClockRegression::default(),
            gate: JumpGate::new(filter.max_speed_mm_s, filter.max_speed_deg_s),
            filter: OneEuro::new(settings.filter),
            rates: RateIntegrator::new(settings.initial_pose, filter.puck_mm_s, filter.puck_deg_s),
            stuck: StuckWatch::new(filter.stuck_ms),
            tracking: TrackingClock::new(filter.held_ms, filter.stale_ms, filter.lost_ms),
            history: PoseRing::new(HISTORY),
            counters: Counters::default(),
            motion: None,
            newest: None,
            spike_ns: 0,
            jump: None,
            last_now_ns: None,
            settings,
        }
    }

    /// Event counters so far.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Takes the next measurement. Unusable measurements are dropped and counted.
    ///
    /// A puck (a SpaceMouse) sends nothing at rest. Push zero [`Reading::Rates`] when its device is opened: the probe
    /// is then tracked from the initial pose on.
    pub fn push(&mut self, measurement: &Measurement) {
        self.counters.measurements += 1;
        if !is_valid(&measurement.reading) {
            self.counters.invalid += 1;
            return;
        }
        let ticks = match self.order.push(measurement) {
            StreamPosition::Duplicate => return self.counters.duplicates += 1,
            StreamPosition::Late => return self.counters.out_of_order += 1,
            StreamPosition::Restarted { ticks } => {
                self.counters.device_restarts += 1;
                self.clock.restart();
                ticks
            }
            StreamPosition::Next { ticks, missing, clock_stalled } => {
                self.counters.missing += u64::from(missing);
                self.counters.clock_stalls += u64::from(clock_stalled);
                ticks
            }
        };
        let time_ns = match self.clock.push(measurement.host_time_ns, ticks) {
            Timing::NotRising => return self.counters.time_not_rising += 1,
            Timing::Outlier => return self.counters.time_outliers += 1,
            Timing::At(time_ns) => time_ns,
            Timing::Jumped(time_ns) => {
                self.counters.clock_jumps += 1;
                // The age of earlier measurements is unknown on the new clock.
                self.newest = None;
                self.last_now_ns = None;
                self.history.clear();
                self.tracking.forget();
                time_ns
            }
        };
        if let Reading::OutOfView = measurement.reading {
            self.counters.out_of_view += 1;
            self.tracking.interrupted();
            return;
        }
        self.counters.stuck += u64::from(
            !matches!(measurement.reading, Reading::Rates { .. }) && self.stuck.push(&measurement.reading, time_ns),
        );
        // Time since the last used measurement, s; `None` for the first one and after a clock jump.
        let dt_s = self.newest.map(|(last_ns, _)| time_ns.saturating_sub(last_ns) as f64 * 1e-9);
        let Counters { spikes, jumps, .. } = self.counters;
        let motion = self.motion_of(&measurement.reading, time_ns, dt_s);
        if self.counters.spikes > spikes {
            self.spike_ns = measurement.host_time_ns;
        }
        if self.counters.jumps > jumps {
            self.jump = Some(Jump { number: self.counters.jumps, first_byte_ns: self.spike_ns });
        }
        let Some(motion) = motion else { return };
        self.counters.used += 1;
        self.motion = Some(motion);
        self.newest = Some((time_ns, measurement.host_time_ns));
        let device_time_us = measurement.device_time_us.unwrap_or(time_ns / 1000);
        self.history.push(TimedPose { host_time_ns: time_ns, device_time_us, pose: motion.pose });
        let resting = matches!(measurement.reading, Reading::Rates { .. }) && self.rates.is_resting();
        self.tracking.seen(time_ns, resting);
    }

    /// Records that the device is disconnected: a resting puck is no longer tracked, a deflected one counts as
    /// released.
    pub fn disconnected(&mut self) {
        self.tracking.interrupted();
        self.rates.release();
        if let Some(motion) = &mut self.motion {
            *motion = Motion::at_rest(motion.pose);
        }
    }

    /// Pose to show at `display_ns`, estimated from the measurements pushed so far, with the tracking state at
    /// `now_ns`.
    ///
    /// For a time after the newest measurement, the pose is predicted by at most
    /// [`FilterSettings::prediction_ms`](super::FilterSettings). For an earlier time, it is interpolated.
    pub fn sample(&mut self, now_ns: u64, display_ns: u64) -> Estimate {
        let now_ns = self.host_now(now_ns);
        let state = match self.tracking.at(now_ns) {
            state if state.is_live() && self.stuck.is_stuck() => TrackingState::Stuck,
            state => state,
        };
        let mut estimate = Estimate {
            scene_from_probe: None,
            state,
            first_byte_ns: self.newest.map(|(_, raw_ns)| raw_ns),
            measurements: self.counters.used,
            jump: self.jump,
            predicted_ms: 0.0,
            speed: None,
        };
        let (Some((newest_ns, _)), Some(motion)) = (self.newest, &self.motion) else { return estimate };
        if state == TrackingState::Lost {
            return estimate;
        }
        let horizon_s = horizon_s(newest_ns, display_ns, self.settings.filter.prediction_ms);
        let earlier = if display_ns < newest_ns { self.history.at(display_ns) } else { None };
        estimate.predicted_ms = horizon_s * 1e3;
        let speed = Speed::of(motion.velocity_mm_s, motion.angular_velocity_rad_s);
        estimate.speed = (state.is_live() || state == TrackingState::Stuck).then_some(speed);
        estimate.scene_from_probe = Some(earlier.unwrap_or_else(|| predict(motion, horizon_s)));
        estimate
    }

    /// Motion of the probe from a reading `dt_s` after the last one; `None` if the reading gives no pose or is a spike.
    fn motion_of(&mut self, reading: &Reading, time_ns: u64, dt_s: Option<f64>) -> Option<Motion> {
        let calibration = &self.settings.calibration;
        let pose = match *reading {
            Reading::Pose(tracker_from_sensor) => calibration.scene_from_probe(tracker_from_sensor),
            Reading::Orientation(orientation) => {
                let turned = calibration.scene_from_probe(Pose { orientation, ..Pose::IDENTITY });
                Pose { position_mm: self.settings.initial_pose.position_mm, ..turned }
            }
            Reading::Rates { translation, rotation } => {
                return Some(self.rates.push(translation, rotation, dt_s.unwrap_or(0.0)));
            }
            Reading::OutOfView => return None,
        };
        let Ok(pose) = Pose::new(pose.position_mm, pose.orientation) else {
            self.counters.invalid += 1;
            return None;
        };
        if dt_s.is_none_or(|dt_s| dt_s > FILTER_GAP_S) {
            self.gate.reset();
            self.filter.reset();
        }
        // In seconds since 1970, f64 resolves 0.2 µs.
        match self.gate.push(pose, time_ns as f64 * 1e-9) {
            Gate::Passed => {}
            Gate::Spike => {
                self.counters.spikes += 1;
                return None;
            }
            Gate::Jumped => {
                self.counters.jumps += 1;
                self.filter.reset();
            }
        }
        Some(self.filter.push(pose, dt_s.unwrap_or(0.0)))
    }

    /// `now_ns` on a non-decreasing clock. If the host's clock was set back, all stored times are moved back, too.
    fn host_now(&mut self, now_ns: u64) -> u64 {
        let last_ns = self.last_now_ns.unwrap_or(now_ns);
        let back_ns = last_ns.saturating_sub(now_ns);
        if back_ns > NOW_JITTER_NS {
            self.counters.clock_jumps += 1;
            self.jump =
                self.jump.map(|jump| Jump { first_byte_ns: jump.first_byte_ns.saturating_sub(back_ns), ..jump });
            self.clock.set_back(back_ns);
            self.tracking.set_back(back_ns);
            self.history.set_back(back_ns);
            self.gate.reset();
            self.newest = self.newest.map(|(a, b)| (a.saturating_sub(back_ns), b.saturating_sub(back_ns)));
            self.last_now_ns = Some(now_ns);
            return now_ns;
        }
        let now_ns = now_ns.max(last_ns);
        self.last_now_ns = Some(now_ns);
        now_ns
    }
}

fn is_valid(reading: &Reading) -> bool {
    let is_unit = |q: glam::DQuat| q.is_finite() && (q.length() - 1.0).abs() <= QUATERNION_NORM_TOLERANCE;
    match reading {
        Reading::Pose(pose) => Pose::new(pose.position_mm, pose.orientation).is_ok(),
        Reading::Orientation(orientation) => is_unit(*orientation),
        Reading::Rates { translation, rotation } => translation.is_finite() && rotation.is_finite(),
        Reading::OutOfView => true,
    }
}
