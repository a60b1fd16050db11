//! Generated exam sessions: a hand that searches, finds, holds and leaves standard planes.
//!
//! For each plane the hand travels to its neighbourhood, sliding on the skin or lifting off. It approaches the plane
//! by tilting, rocking, rotating and sliding, holds it, measures, and leaves. The rest of the session is a survey:
//! slow sweeps from plane to plane. Pressure varies continuously and tremor is added. A novice who runs out of time
//! holds the image that he has.
//!
//! The recording's `truth.plane` events give the hand's intention: `{"plane": "head", "phase": "search" | "hold" |
//! "leave"}`, and `{"phase": "survey"}`. Calipers are placed at the end of each hold. The event [`EXAM_EVENT`] names
//! the planes.

use std::path::Path;

use glam::{DQuat, DVec3};
use serde_json::json;

use super::hand::{Hand, Off, Skill};
use super::{ExamError, START_TIME_NS, encode, on_skin};
use crate::anatomy::Skin;
use crate::anatomy::planes::{Caliper, StandardPlane, View};
use crate::pose::freehand::{Tremor, Waypoint, minimum_jerk, view_at};
use crate::pose::{Pose, TimedPose, rotation_vector};
use crate::random::SplitMix64;
use crate::recording::{CaliperEvent, EXAM_EVENT, Event};

/// Pose rate, Hz.
pub const RATE_HZ: u32 = 60;

/// Name of the events with the hand's intention.
pub const TRUTH_EVENT: &str = "truth.plane";

/// Default duration per plane, s.
pub const PLANE_S: f64 = 15.0;

/// Shortest time for a plane in addition to its hold, s: travel and two corrections.
const SEARCH_LEAST_S: f64 = 5.0;

/// Speed of travel on the skin, mm/s, and shortest duration of a travel, s.
const TRAVEL_MM_S: f64 = 60.0;
const TRAVEL_LEAST_S: f64 = 1.2;

/// Height of a lift, mm, and its duration in each direction, s.
const LIFT_MM: f64 = 15.0;
const LIFT_S: f64 = 0.4;

/// Smallest distance of the beam's central line from the edge of the body, mm; larger than the tremor.
const MARGIN_MM: f64 = 5.0;

/// Number of times that an error which puts the probe off the body is halved before it is set to 0.
const HALVINGS: usize = 6;

/// Settings of a generated session.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Seed of every random choice.
    pub seed: u64,
    /// Length, s.
    pub duration_s: f64,
    /// Skill of the hand.
    pub skill: Skill,
}

/// A session.
#[derive(Debug, Clone, PartialEq)]
pub struct Session {
    /// `scene_from_probe` at [`RATE_HZ`].
    pub poses: Vec<TimedPose>,
    /// Intentions and measurements of the hand, in the order of time.
    pub events: Vec<Event>,
}

impl Session {
    /// Writes the session as a recording of tracker bytes, with poses in the frame of `scene`; deterministic.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &Path, scene: &str) -> Result<(), ExamError> {
        encode(path, scene, &self.poses, &[], &self.events)
    }
}

/// Makes a session in which a hand searches for `planes` on `skin`, in the given order; deterministic.
///
/// # Errors
/// The duration is too short, or there is no skin between a plane's centre and the probe.
pub fn make(planes: &[&StandardPlane], skin: &Skin, settings: &Settings) -> Result<Session, ExamError> {
    let hand = settings.skill.hand();
    let least_s = hand.hold_s.1 + SEARCH_LEAST_S;
    let share_s = settings.duration_s / planes.len().max(1) as f64;
    if share_s.is_nan() || share_s < least_s {
        let (duration_s, planes) = (settings.duration_s, planes.len());
        return Err(ExamError::TooShort { duration_s, planes, least_s });
    }
    let mut plan = Plan::new(hand, settings.seed, skin);
    let names: Vec<&str> = planes.iter().map(|plane| plane.name.as_str()).collect();
    plan.phases.push((0.0, Event::new(0, EXAM_EVENT).with(json!(names))));
    let mut bases = Vec::with_capacity(planes.len());
    for (number, plane) in (1..).zip(planes) {
        let pick = (plan.random.unit() * plane.views.len() as f64) as usize;
        let Some(view) = plane.views.get(pick.min(plane.views.len().saturating_sub(1))) else { continue };
        let pose = view.pose_on(skin, 0.0).ok_or_else(|| ExamError::OutOfReach {
            plane: plane.name.clone(),
            centre_mm: view.centre_mm,
            direction: view.to_probe,
        })?;
        let base = Base { pose, depth_mm: pose.position_mm.distance(view.centre_mm) };
        plan.visit(plane, view, base, share_s * f64::from(number));
        bases.push(base);
    }
    plan.survey(&bases, settings.duration_s);
    plan.session(settings)
}

/// Ideal pose for a view, with the face on the skin.
#[derive(Clone, Copy)]
struct Base {
    pose: Pose,
    /// Distance from the face to the view's centre, mm.
    depth_mm: f64,
}

/// Plan of the hand's movements.
struct Plan<'a> {
    skin: &'a Skin,
    hand: Hand,
    random: SplitMix64,
    waypoints: Vec<Waypoint>,
    /// Start and end of each interval off the skin, s.
    lifts: Vec<(f64, f64)>,
    /// Times of events, s, and the events.
    phases: Vec<(f64, Event)>,
    /// Times at which calipers are placed, s, and the calipers.
    calipers: Vec<(f64, Caliper)>,
    now_s: f64,
    /// Last position of the face, mm.
    contact_mm: DVec3,
}

impl<'a> Plan<'a> {
    fn new(hand: Hand, seed: u64, skin: &'a Skin) -> Self {
        let random = SplitMix64::new(seed ^ 0x5e55_1011);
        let (waypoints, lifts, phases, calipers) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Self { skin, hand, random, waypoints, lifts, phases, calipers, now_s: 0.0, contact_mm: DVec3::ZERO }
    }

    fn within(&mut self, (least, most): (f64, f64)) -> f64 {
        self.random.between(least, most)
    }

    /// The deviation `off`, halved until the probe is on the body.
    fn on_body(&self, base: &Base, off: &Off) -> Off {
        let inside = |off: &Off, closed: bool| {
            let pose = off.of(&base.pose);
            let up = pose.orientation * DVec3::NEG_Z;
            [DVec3::ZERO, DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y].into_iter().all(|aside| {
                let from_mm = pose.transform_point(DVec3::Z * base.depth_mm + aside * MARGIN_MM);
                self.skin.exit(from_mm, up).is_some() && (!closed || self.skin.exit(from_mm, -up).is_some())
            })
        };
        // Points between two points inside the body are inside, too. If the body is open below, only its upper side is
        // tested.
        let closed = inside(&Off::default(), true);
        let mut less = *off;
        for _ in 0..HALVINGS {
            if inside(&less, closed) {
                return less;
            }
            less = Off::default().plus(&less, 0.5);
        }
        Off::default()
    }

    /// Keeps the hand at the deviation `off` from `base` for `stay_s`. Returns the deviation, reduced so that it
    /// stays on the body.
    fn stay(&mut self, base: &Base, off: &Off, stay_s: f64) -> Off {
        let off = self.on_body(base, off);
        let pose = off.of(&base.pose);
        let target_mm = pose.transform_point(DVec3::Z * base.depth_mm);
        self.contact_mm = pose.position_mm;
        let (arrive_s, leave_s) = (self.now_s, self.now_s + stay_s);
        self.waypoints.push(Waypoint { arrive_s, leave_s, target_mm, orientation: pose.orientation });
        self.now_s = leave_s;
        off
    }

    fn phase(&mut self, value: serde_json::Value) {
        self.phases.push((self.now_s, Event::new(0, TRUTH_EVENT).with(value)));
    }

    /// Moves to the neighbourhood of `base`, lifting off or sliding.
    fn travel(&mut self, base: &Base) {
        let Some(last) = self.waypoints.last() else {
            // Before the first plane the probe is put down on the skin.
            self.lifts.push((-LIFT_S, LIFT_S));
            return;
        };
        // The path around an abdomen is longer than the chord.
        let way_mm = 1.3 * self.contact_mm.distance(base.pose.position_mm);
        let turn_deg = last.orientation.angle_between(base.pose.orientation).to_degrees();
        // Degrees and mm count alike: the hand turns at 60 degrees per second.
        let travel_s = (way_mm.max(turn_deg) / TRAVEL_MM_S).max(TRAVEL_LEAST_S);
        if self.random.unit() < self.hand.lift_chance {
            self.lifts.push((self.now_s, self.now_s + travel_s.max(2.0 * LIFT_S)));
        }
        self.now_s += travel_s;
    }

    /// Travels to a view of `plane`, searches it and holds it, all before `deadline_s`.
    fn visit(&mut self, plane: &StandardPlane, view: &View, base: Base, deadline_s: f64) {
        let phase = |phase: &str| json!({ "plane": plane.name, "phase": phase });
        self.phase(phase("search"));
        self.travel(&base);
        let hold_s = self.within(self.hand.hold_s);
        let hand = self.hand;
        let mut off = Off::draw_away(&hand.start, &mut self.random);
        loop {
            let look_s = self.within(hand.look_s);
            off = self.stay(&base, &off, look_s);
            let move_s = self.within(hand.move_s);
            let next_s = move_s + hand.look_s.1 + hold_s + LIFT_S;
            if off.is_within(&hand.rest) || self.now_s + next_s > deadline_s {
                break;
            }
            off = off.corrected(&hand, &mut self.random);
            self.now_s += move_s;
        }
        self.phase(phase("hold"));
        let drift = Off::draw(&hand.rest, &mut self.random);
        let drifted = off.plus(&drift, hand.drift);
        // During the hold the hand drifts slowly between these two deviations.
        self.now_s += hold_s;
        let end_s = self.now_s;
        self.stay(&base, &drifted, 0.0);
        self.calipers.extend(view.calipers.iter().map(|caliper| (end_s - 0.2, caliper.clone())));
        self.phase(phase("leave"));
    }

    /// Sweeps from plane to plane until `end_s`, then lifts the probe off.
    fn survey(&mut self, bases: &[Base], end_s: f64) {
        if self.now_s + 2.0 < end_s {
            self.phase(json!({ "phase": "survey" }));
        }
        // Leaves at least the duration of a travel, to avoid rushed movements.
        while let Some(base) = (!bases.is_empty() && self.now_s + 4.0 < end_s)
            .then(|| bases[(self.random.unit() * bases.len() as f64) as usize % bases.len()])
        {
            self.travel(&base);
            let mut off = Off::draw_away(&self.hand.start, &mut self.random);
            for _ in 0..3 {
                let look_s = self.within(self.hand.look_s);
                off = self.stay(&base, &off, look_s);
                off = off.plus(&Off::draw_away(&self.hand.start, &mut self.random), 0.7);
                self.now_s += 1.5 * self.hand.move_s.1;
            }
        }
        self.lifts.push((end_s - LIFT_S, end_s + LIFT_S));
    }

    /// Depth of the face in the skin, mm; negative when off the skin.
    fn press_mm(&self, phases: &[f64; 3], time_s: f64) -> f64 {
        // Breathing, shifting of weight, and finger movement.
        let slow: f64 = [(0.11, 0.5), (0.27, 0.35), (0.73, 0.15)]
            .into_iter()
            .zip(phases)
            .map(|((hz, part), phase)| part * (std::f64::consts::TAU * (hz * time_s + phase)).sin())
            .sum();
        let press = self.hand.press_mm + self.hand.press_change_mm * slow;
        let lift = |&(from_s, to_s): &(f64, f64)| {
            minimum_jerk((time_s - from_s) / LIFT_S) * minimum_jerk((to_s - time_s) / LIFT_S)
        };
        let lifted = self.lifts.iter().map(lift).fold(0.0, f64::max);
        press + lifted * (-LIFT_MM - press)
    }

    /// Poses and events of the planned movements.
    fn session(mut self, settings: &Settings) -> Result<Session, ExamError> {
        let tremor = Tremor::new(settings.seed);
        let press_phases = std::array::from_fn(|_| self.random.unit());
        let strength = self.hand.tremor;
        let count = (settings.duration_s * f64::from(RATE_HZ)).floor() as u64;
        let pose = |i: u64| {
            let time_s = i as f64 / f64::from(RATE_HZ);
            let (target_mm, orientation) = view_at(&self.waypoints, time_s).unwrap_or_default();
            let (shift, turn) = tremor.at(time_s);
            let (shift, turn) = (strength * shift, DQuat::from_scaled_axis(strength * rotation_vector(turn)));
            let orientation = (orientation * turn).normalize();
            let press_mm = self.press_mm(&press_phases, time_s);
            let device_time_us = i * 1_000_000 / u64::from(RATE_HZ);
            on_skin(device_time_us, (target_mm, orientation), shift, press_mm, |from, along| {
                self.skin.exit(from, along)
            })
        };
        let poses: Vec<TimedPose> = (0..=count).map(pose).collect::<Result<_, ExamError>>()?;
        let at = |time_s: f64| START_TIME_NS + (time_s * 1e9).round() as u64;
        let mut events: Vec<Event> = Vec::new();
        for (time_s, event) in std::mem::take(&mut self.phases) {
            events.push(Event { host_time_ns: at(time_s), ..event });
        }
        for (time_s, caliper) in std::mem::take(&mut self.calipers) {
            let index = ((time_s * f64::from(RATE_HZ)) as usize).min(poses.len() - 1);
            let placed = self.placed(&caliper, &poses[index].pose);
            events.push(placed.event(at(time_s)));
        }
        events.sort_by_key(|event| event.host_time_ns);
        Ok(Session { poses, events })
    }

    /// `caliper` as the hand places it in the image at `pose`: near its true points, with errors that depend on the
    /// hand's skill.
    fn placed(&mut self, caliper: &Caliper, pose: &Pose) -> CaliperEvent {
        let spread_mm = 0.3 + 0.3 * self.hand.rest.slide_mm;
        let probe_from_scene = pose.inverse();
        let mut point = |p: &DVec3| {
            let local = probe_from_scene.transform_point(*p);
            // Rounded to 0.1 mm, as on scanners.
            let mut coordinate = |x: f64| (10.0 * (x + spread_mm * (2.0 * self.random.unit() - 1.0))).round() / 10.0;
            [coordinate(local.x), coordinate(local.z)]
        };
        let points_mm = caliper.points_mm.iter().map(&mut point).collect();
        CaliperEvent { measure: caliper.name.clone(), points_mm }
    }
}

/// Shuffles `planes` by `seed` (Fisher–Yates).
pub fn shuffle(planes: &mut [&StandardPlane], seed: u64) {
    let mut random = SplitMix64::new(seed ^ 0x0005_4ff1);
    for last in (1..planes.len()).rev() {
        let other = (random.unit() * (last + 1) as f64) as usize;
        planes.swap(last, other.min(last));
    }
}
