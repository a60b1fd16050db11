//! Simulated hands that do an exercise with probe and needle.
//!
//! One hand holds the probe over the target, the other one advances the needle from the entry to the target. An expert
//! keeps the needle in the image and reaches the target in one pass. A novice trembles, lets the probe slip, misses, draws
//! the needle back and tries again. The numbers are assumed.

use std::cmp::Ordering;

use glam::{DQuat, DVec3};
use thiserror::Error;

use super::exercise::{Approach, Exercise, Region};
use super::sample::Sample;
use crate::anatomy::{Bounds, Bvh, BvhError, Scene, Skin};
use crate::exam::hand::Skill;
use crate::needle::Needle;
use crate::pose::freehand::{Tremor, minimum_jerk};
use crate::pose::{Pose, rotation_vector};
use crate::random::SplitMix64;
use crate::transducer::Probe;

/// Pose rate, Hz.
pub const RATE_HZ: u32 = 60;

/// Distance of the tip from the skin at the start, mm, and duration of that rest, s.
const START_MM: f64 = 15.0;
const START_S: f64 = 1.0;
/// Duration of the last rest, in the target, s.
const END_S: f64 = 2.0;
/// Part of the way to the target to which a needle is drawn back between two passes.
const DRAWN_BACK: f64 = 0.35;

/// Depth of the probe's face in the skin, mm.
const PRESS_MM: f64 = 2.0;

/// Smallest angle between needle and beam by approach, degrees, and room between face and needle, mm.
const IN_PLANE_DEG: f64 = 40.0;
const OUT_OF_PLANE_DEG: f64 = 35.0;
const ROOM_MM: f64 = 5.0;
/// Largest of these angles, degrees.
const ANGLE_MAX_DEG: f64 = 70.0;

/// Number of points that are tried to find one inside a surface, and largest number of those whose distances from the
/// surface are compared.
const TRIED: u32 = 20_000;
const COMPARED: usize = 64;
/// Distance from the surface that is deep enough, mm.
const DEEP_MM: f64 = 6.0;

/// Error in planning an exercise.
#[derive(Debug, Error)]
pub enum HandError {
    /// No point was found inside the target's surface.
    #[error("no point is found inside the surface `{surface}`, the target of the exercise; it must be closed")]
    NoInside {
        /// Name of the surface.
        surface: String,
    },
    /// A line from the target hits no skin.
    #[error("no skin is found from the target at {from_mm} mm along {direction}, where the {what} would be")]
    NoSkin {
        /// Position of the target, mm.
        from_mm: DVec3,
        /// Unit direction of the line.
        direction: DVec3,
        /// `probe` or `needle`.
        what: &'static str,
    },
    /// The scene has no tree.
    #[error(transparent)]
    Scene(#[from] BvhError),
}

/// Parameters of the two hands.
#[derive(Debug, Clone, Copy)]
struct Hands {
    /// Smallest and greatest number of passes.
    passes: (u32, u32),
    /// Distance by which a pass before the last one misses the target, mm.
    miss_mm: (f64, f64),
    /// Largest distance from the aim after the last pass, mm.
    rest_mm: f64,
    /// Mean speed of the needle, mm/s.
    speed_mm_s: f64,
    /// Shortest and longest pause, s.
    look_s: (f64, f64),
    /// Tremor, relative to [`TREMOR_MM`](crate::pose::freehand::TREMOR_MM).
    tremor: f64,
    /// Amplitude of the probe's slips across the image plane, mm, and about its long axis, degrees.
    slip_mm: f64,
    slip_deg: f64,
}

impl Hands {
    fn of(skill: Skill) -> Self {
        let (tremor, speed_mm_s) = (skill.hand().tremor, 10.0);
        match skill {
            Skill::Novice => Self {
                passes: (2, 3),
                miss_mm: (6.0, 12.0),
                rest_mm: 1.5,
                speed_mm_s: 5.0,
                look_s: (0.8, 2.0),
                tremor,
                slip_mm: 5.0,
                slip_deg: 9.0,
            },
            Skill::Trained => Self {
                passes: (1, 2),
                miss_mm: (3.0, 6.0),
                rest_mm: 0.8,
                speed_mm_s,
                look_s: (0.4, 1.0),
                tremor,
                slip_mm: 1.2,
                slip_deg: 3.0,
            },
            Skill::Expert => Self {
                passes: (1, 1),
                miss_mm: (0.0, 0.0),
                rest_mm: 0.3,
                speed_mm_s,
                look_s: (0.2, 0.5),
                tremor,
                slip_mm: 0.2,
                slip_deg: 0.5,
            },
        }
    }
}

/// Plan of an exercise: aim, entry, and pose of the probe.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plan {
    /// Point of the target at which the needle aims, in the scene, mm.
    pub aim_mm: DVec3,
    /// Point of the skin at which the needle enters, in the scene, mm.
    pub entry_mm: DVec3,
    /// `scene_from_probe` that shows the aim, and with the approach in-plane the whole way.
    pub probe: Pose,
    /// Whether the needle crosses the image plane.
    pub out_of_plane: bool,
}

impl Plan {
    /// Plan of `exercise` in `scene`. The probe's axis is parallel to that of `start`, a pose on the body.
    ///
    /// # Errors
    /// The target has no inside, or there is no skin above it.
    pub fn of(exercise: &Exercise, scene: &Scene, probe: &Probe, start: &Pose) -> Result<Self, HandError> {
        let skin = Skin::of_scene(scene)?;
        let aim_mm = match &exercise.target {
            Region::Ball { centre_mm, .. } => *centre_mm,
            Region::Surface(name) => inside(scene, &exercise.target, name, start)?,
        };
        let on_skin = |direction: DVec3, what| {
            let from_mm = aim_mm;
            skin.exit(from_mm, direction).ok_or(HandError::NoSkin { from_mm, direction, what })
        };
        let axis = start.transform_vector(DVec3::Z);
        let face_mm = on_skin(-axis, "probe")?;
        let out_of_plane = exercise.approach == Approach::OutOfPlane;
        let aside = start.transform_vector(if out_of_plane { DVec3::NEG_Y } else { DVec3::NEG_X });
        let direction = match &exercise.entry {
            Some(Region::Ball { centre_mm, .. }) => (*centre_mm - aim_mm).normalize_or(-axis),
            _ => {
                let (least_deg, half_mm) =
                    if out_of_plane { (OUT_OF_PLANE_DEG, 0.0) } else { (IN_PLANE_DEG, half_face_mm(probe)) };
                let beside = ((half_mm + ROOM_MM) / face_mm.distance(aim_mm).max(1.0)).atan();
                let angle = beside.clamp(least_deg.to_radians(), ANGLE_MAX_DEG.to_radians());
                aside * angle.sin() - axis * angle.cos()
            }
        };
        let entry_mm = on_skin(direction, "needle")?;
        // The needle comes from the probe's −x side, or across the image plane from its −y side.
        let from_side = -(entry_mm - aim_mm).reject_from_normalized(axis).normalize_or(-aside);
        let lateral = if out_of_plane { from_side.cross(axis) } else { from_side };
        let mut probe = Pose::looking(face_mm + axis * PRESS_MM, axis, lateral);
        probe.orientation = probe.orientation.normalize();
        Ok(Self { aim_mm, entry_mm, probe, out_of_plane })
    }

    /// Session of a hand of this skill, at [`RATE_HZ`]; deterministic.
    pub fn session(&self, skill: Skill, seed: u64) -> HandSession {
        let hands = Hands::of(skill);
        let mut random = SplitMix64::new(seed ^ 0x4eed_1e00);
        let stops = stops(self, &hands, &mut random);
        let (of_probe, of_needle) = (Tremor::new(seed), Tremor::new(seed.wrapping_add(1)));
        let slips = Slips { hands, phases: [(); 4].map(|()| random.unit()) };
        let end_s = stops.last().map_or(0.0, |stop| stop.leave_s);
        let count = (end_s * f64::from(RATE_HZ)) as u64;
        let sample = |i: u64| {
            let time_s = i as f64 / f64::from(RATE_HZ);
            let (part, aim_mm) = at(&stops, time_s);
            let (shift_mm, turn) = of_needle.at(time_s);
            let along = (aim_mm - self.entry_mm).normalize_or(DVec3::Z);
            let tip_mm = self.entry_mm + part * (aim_mm - self.entry_mm) + hands.tremor * shift_mm;
            let turn = DQuat::from_scaled_axis(hands.tremor * rotation_vector(turn));
            let orientation = (turn * DQuat::from_rotation_arc(DVec3::Z, along)).normalize();
            let needle = Needle { scene_from_needle: Pose { position_mm: tip_mm, orientation }, bevel_known: true };
            let held = slips.of(&self.probe, time_s, of_probe.at(time_s));
            Sample { time_s, probe: Some(held), needle: Some(needle) }
        };
        HandSession { samples: (0..=count).map(sample).collect(), phases: phases(&stops) }
    }
}

/// Session of simulated hands.
#[derive(Debug, Clone, PartialEq)]
pub struct HandSession {
    /// Poses of probe and needle, in ascending time.
    pub samples: Vec<Sample>,
    /// What the hand with the needle does, in order.
    pub phases: Vec<Phase>,
}

/// Part of a pass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Phase {
    /// Start, s.
    pub time_s: f64,
    /// Number of the pass, from 1.
    pub pass: u32,
    /// `aim` (between two passes), `advance`, `rest` (at the end of the pass) or `withdraw`.
    pub name: &'static str,
}

/// Half of the width of the probe's face, mm.
fn half_face_mm(probe: &Probe) -> f64 {
    probe.face_radius_mm().map_or_else(|| probe.half_extent(), |radius_mm| radius_mm * probe.half_extent().sin())
}

/// Point well inside the surface `name`, near the axis of a probe at `start`.
fn inside(scene: &Scene, target: &Region, name: &str, start: &Pose) -> Result<DVec3, HandError> {
    let bvh = Bvh::build(scene)?;
    let of_target = || scene.surfaces.iter().filter(|surface| target.is_surface(&surface.name));
    let corners: Vec<_> = of_target().flat_map(|surface| surface.mesh.corners_mm()).collect();
    let border = Skin::of_triangles(corners.iter().copied())?;
    let bounds = Bounds::of(corners.into_iter().flatten()).ok_or(BvhError::Empty)?;
    let (low, size) = (bounds.min.as_dvec3(), (bounds.max - bounds.min).as_dvec3());
    let mut random = SplitMix64::new(1);
    let is_target = |point: &DVec3| {
        let windings = bvh.windings(*point, scene.surfaces.len());
        let medium = windings.iter().rposition(|winding| *winding != 0);
        medium.and_then(|index| scene.surfaces.get(index)).is_some_and(|surface| target.is_surface(&surface.name))
    };
    let aside_mm = |point: &DVec3| start.inverse().transform_point(*point).truncate().length();
    let tried = (0..TRIED).map(|_| low + size * DVec3::new(random.unit(), random.unit(), random.unit()));
    let mut candidates: Vec<DVec3> = tried.filter(is_target).collect();
    candidates.sort_by(|a, b| aside_mm(a).total_cmp(&aside_mm(b)));
    candidates.truncate(COMPARED);
    let merit = |point: &DVec3| border.distance_mm(*point).min(DEEP_MM) - 0.2 * aside_mm(point);
    let best = candidates.into_iter().max_by(|a, b| merit(a).total_cmp(&merit(b)));
    best.ok_or_else(|| HandError::NoInside { surface: name.to_owned() })
}

/// Position at which the needle rests for a while.
#[derive(Debug, Clone, Copy)]
struct Stop {
    arrive_s: f64,
    leave_s: f64,
    /// Part of the way from the entry to the aim; negative before the skin.
    part: f64,
    aim_mm: DVec3,
}

/// Samples of an exercise done by a hand of this skill; deterministic. `start` is as in [`Plan::of`].
///
/// # Errors
/// Errors of [`Plan::of`].
pub fn samples(
    exercise: &Exercise,
    scene: &Scene,
    probe: &Probe,
    start: &Pose,
    skill: Skill,
    seed: u64,
) -> Result<Vec<Sample>, HandError> {
    Ok(Plan::of(exercise, scene, probe, start)?.session(skill, seed).samples)
}

/// Phases of all passes. A pass advances to the end of the way (`part` 1), rests there, and withdraws.
fn phases(stops: &[Stop]) -> Vec<Phase> {
    let (mut phases, mut pass): (Vec<Phase>, u32) = (Vec::new(), 1);
    for pair in stops.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        match to.part.total_cmp(&from.part) {
            Ordering::Greater => phases.extend([
                Phase { time_s: from.leave_s, pass, name: "advance" },
                Phase { time_s: to.arrive_s, pass, name: "rest" },
            ]),
            Ordering::Less => {
                phases.push(Phase { time_s: from.leave_s, pass, name: "withdraw" });
                pass += 1;
                phases.push(Phase { time_s: to.arrive_s, pass, name: "aim" });
            }
            // The needle is turned to another aim.
            Ordering::Equal => {}
        }
    }
    phases
}

/// Stops of all passes.
fn stops(plan: &Plan, hands: &Hands, random: &mut SplitMix64) -> Vec<Stop> {
    let length_mm = plan.entry_mm.distance(plan.aim_mm).max(1.0);
    let (least, most) = hands.passes;
    let passes = least + (random.unit() * f64::from(most - least + 1)) as u32;
    let outside = -START_MM / length_mm;
    let mut stops: Vec<Stop> = Vec::new();
    let mut go = |part: f64, aim_mm: DVec3, look_s: f64| {
        let last = stops.last().copied();
        let arrive_s = last.map_or(0.0, |last| {
            let way_mm = (part - last.part).abs() * length_mm + last.aim_mm.distance(aim_mm);
            last.leave_s + (way_mm / hands.speed_mm_s).max(0.3)
        });
        stops.push(Stop { arrive_s, leave_s: arrive_s + look_s, part, aim_mm });
    };
    // A miss is mostly across the image plane, which the hand sees least; out-of-plane, it is to the side.
    let across = plan.probe.transform_vector(if plan.out_of_plane { DVec3::X } else { DVec3::Y });
    for pass in 1..=passes {
        let is_last = pass == passes;
        let (near, far) = if is_last { (0.0, hands.rest_mm) } else { hands.miss_mm };
        let side = if random.unit() < 0.5 { -1.0 } else { 1.0 };
        let aim_mm = plan.aim_mm + across * side * random.between(near, far);
        if pass == 1 {
            go(outside, aim_mm, START_S);
        } else {
            go(DRAWN_BACK, aim_mm, random.between(hands.look_s.0, hands.look_s.1));
        }
        go(1.0, aim_mm, if is_last { END_S } else { random.between(hands.look_s.0, hands.look_s.1) });
        if !is_last {
            go(DRAWN_BACK, aim_mm, random.between(hands.look_s.0, hands.look_s.1));
        }
    }
    stops
}

/// Part of the way and aim of the needle at a time.
fn at(stops: &[Stop], time_s: f64) -> (f64, DVec3) {
    let next = stops.partition_point(|stop| stop.arrive_s <= time_s);
    let Some(from) = next.checked_sub(1).and_then(|i| stops.get(i)) else { return (0.0, DVec3::ZERO) };
    let Some(to) = stops.get(next).filter(|_| time_s > from.leave_s) else { return (from.part, from.aim_mm) };
    let s = minimum_jerk((time_s - from.leave_s) / (to.arrive_s - from.leave_s));
    (from.part + s * (to.part - from.part), from.aim_mm.lerp(to.aim_mm, s))
}

/// Slow slips of the probe.
struct Slips {
    hands: Hands,
    phases: [f64; 4],
}

impl Slips {
    /// The probe as it is held at a time, with its tremor.
    fn of(&self, pose: &Pose, time_s: f64, (shift_mm, turn): (DVec3, DQuat)) -> Pose {
        let [a, b, c, d] = self.phases.map(|phase| std::f64::consts::TAU * phase);
        let wave = |first: f64, second: f64| 0.6 * (0.9 * time_s + first).sin() + 0.4 * (0.37 * time_s + second).sin();
        let slip_mm = DVec3::Y * self.hands.slip_mm * wave(a, b) + self.hands.tremor * shift_mm;
        let turned = DQuat::from_rotation_z((self.hands.slip_deg * wave(c, d)).to_radians());
        let trembling = DQuat::from_scaled_axis(self.hands.tremor * rotation_vector(turn));
        let orientation = (pose.orientation * turned * trembling).normalize();
        Pose { position_mm: pose.transform_point(slip_mm), orientation }
    }
}
