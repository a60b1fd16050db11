//! Simulated tracker board: poses of a probe, and of a needle if wanted, on a schedule, encoded as [`ascii_line`]. Equal
//! settings give equal bytes at equal times.

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use bytes::Bytes;
use glam::{DQuat, DVec3};
use insonify_core::pose::Pose;
use insonify_core::pose::freehand::{Tremor, minimum_jerk};
use insonify_core::random::{bits, fraction};
use insonify_core::settings::settings;
use thiserror::Error;

use super::ascii_line;
use super::clock::nanoseconds;

/// Number of the needle's sensor. The probe's is 0.
pub const NEEDLE_SENSOR: u16 = 1;

/// Way of the mock's needle along its axis, mm: how far it is drawn back before an insertion.
const NEEDLE_BACK_MM: f64 = 40.0;

/// One insertion of the mock's needle, s: the needle goes in, stays, is drawn back, and waits outside.
const INSERTION_S: [f64; 4] = [8.0, 3.0, 5.0, 2.0];

/// Behaviour of the board during one part of the schedule.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Act {
    /// Slides and tilts smoothly: up to 20 mm and 15° about the centre.
    Move,
    /// Keeps its pose.
    Hold,
    /// [`Move`](Self::Move), offset by 30 to 60 mm and rotated by up to 60°: it starts and ends with a jump.
    Jump,
    /// Sends nothing; its counter and clock continue.
    Drop,
    /// [`Move`](Self::Move), with every third line damaged.
    Corrupt,
    /// The port disappears.
    Unplug,
}

insonify_core::names::named!(Act {
    Move = "move",
    Hold = "hold",
    Jump = "jump",
    Drop = "drop",
    Corrupt = "corrupt",
    Unplug = "unplug",
});

/// Acts and their durations, repeated endlessly. Written as `move 10, hold 2, jump 1`, in seconds.
#[derive(Debug, Clone, PartialEq)]
pub struct Schedule {
    acts: Vec<(Act, Duration)>,
}

/// A text that is not a valid schedule.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error(
    "`{text}` is no part of a schedule: expected `move`, `hold`, `jump`, `drop`, `corrupt` or `unplug` and its seconds in 0.01..=86400, as in `move 10, hold 2`"
)]
pub struct ScheduleError {
    /// The wrong part.
    pub text: String,
}

impl FromStr for Schedule {
    type Err = ScheduleError;

    fn from_str(text: &str) -> Result<Self, ScheduleError> {
        let act = |part: &str| {
            let (word, seconds) = part.trim().split_once(' ')?;
            let act = Act::named(word)?;
            let seconds = seconds.trim().parse::<f64>().ok().filter(|s| (0.01..=86_400.0).contains(s))?;
            Some((act, Duration::from_secs_f64(seconds)))
        };
        let acts: Result<_, _> = text
            .split(',')
            .map(|part| act(part).ok_or_else(|| ScheduleError { text: part.trim().to_owned() }))
            .collect();
        Ok(Self { acts: acts? })
    }
}

impl fmt::Display for Schedule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, (act, duration)) in self.acts.iter().enumerate() {
            write!(f, "{}{} {}", if i == 0 { "" } else { ", " }, act.name(), duration.as_secs_f64())?;
        }
        Ok(())
    }
}

impl Default for Schedule {
    /// Motion for 10 s, then a held pose for 2 s.
    fn default() -> Self {
        Self { acts: vec![(Act::Move, Duration::from_secs(10)), (Act::Hold, Duration::from_secs(2))] }
    }
}

settings! {
    /// Settings of the simulated board.
    #[derive(Debug, Clone, PartialEq)]
    pub struct Settings in "tracker" {
        /// Records per second of the mock.
        rate_hz: f64 = 60.0, "Hz", 1.0..=1000.0, Everything;

        /// Seed of the mock's motion and damage.
        seed: u32 = 0, "", 0.0..=4_294_967_295.0, Everything;
    }
    plain {
        /// Centre of the motion.
        around: Pose = Pose::IDENTITY, Everything;
        /// Sequence of acts.
        schedule: Schedule = Schedule::default(), Everything;
        /// Pose of the needle at the end of each insertion, with the tip as its origin and z along its shaft; `None`:
        /// the board has no needle.
        needle: Option<Pose> = None, Everything;
    }
}

/// Result of one tick of the board.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Tick {
    /// A line is sent, or one of the probe and one of the needle.
    Line(Bytes),
    /// Nothing is sent.
    Nothing,
    /// There is no port.
    Unplugged,
}

/// Simulated board, ticking at a steady rate from time 0.
#[derive(Debug, Clone)]
pub struct Board {
    settings: Settings,
    ticks: u64,
    /// Index of the current act in the schedule.
    act: usize,
    /// End of the current act.
    act_end: Duration,
    /// Number of acts begun so far.
    acts_begun: u64,
    /// Time spent in motion.
    moved: Duration,
    /// Tremor of the hand that holds the needle.
    tremor: Tremor,
}

impl Board {
    /// A board at its start.
    pub fn new(settings: Settings) -> Self {
        let act_end = settings.schedule.acts.first().map_or(Duration::MAX, |(_, duration)| *duration);
        let tremor = Tremor::new(u64::from(settings.seed));
        Self { settings, ticks: 0, act: 0, act_end, acts_begun: 1, moved: Duration::ZERO, tremor }
    }

    /// Time of the next tick since the board's start.
    pub fn next_at(&self) -> Duration {
        Duration::from_nanos(nanoseconds(self.period()).saturating_mul(self.ticks))
    }

    /// Advances by one tick.
    pub fn tick(&mut self) -> Tick {
        let at = self.next_at();
        while at >= self.act_end && !self.settings.schedule.acts.is_empty() {
            self.act = (self.act + 1) % self.settings.schedule.acts.len();
            self.act_end += self.settings.schedule.acts[self.act].1;
            self.acts_begun += 1;
        }
        let act = self.settings.schedule.acts.get(self.act).map_or(Act::Move, |(act, _)| *act);
        // The counter on the wire wraps.
        let sequence = self.ticks as u32;
        self.ticks += 1;
        if !matches!(act, Act::Hold) {
            self.moved += self.period();
        }
        match act {
            Act::Drop => return Tick::Nothing,
            Act::Unplug => return Tick::Unplugged,
            Act::Move | Act::Hold | Act::Jump | Act::Corrupt => {}
        }
        let device_time_us = u64::try_from(at.as_micros()).unwrap_or(u64::MAX);
        let mut line = ascii_line::encode(sequence, device_time_us, &self.pose(act)).into_bytes();
        if act == Act::Corrupt && sequence.is_multiple_of(3) {
            let hash = bits(u64::from(self.settings.seed) ^ u64::from(sequence) << 32);
            let at = hash as usize % line.len();
            line[at] ^= 1 << (hash >> 32 & 7);
        }
        if let Some(inserted) = self.settings.needle {
            let pose = self.needle(&inserted);
            line.extend(ascii_line::encode_of(NEEDLE_SENSOR, sequence, device_time_us, &pose).into_bytes());
        }
        Tick::Line(line.into())
    }

    fn period(&self) -> Duration {
        Duration::from_secs_f64(1.0 / self.settings.rate_hz.clamp(1.0, 1000.0))
    }

    /// Pose of the needle, which is `inserted` at the end of each insertion.
    fn needle(&self, inserted: &Pose) -> Pose {
        let [goes_in, stays, comes_back, waits] = INSERTION_S;
        let moved_s = self.moved.as_secs_f64();
        let at = moved_s % (goes_in + stays + comes_back + waits);
        let depth = minimum_jerk(at / goes_in) - minimum_jerk((at - goes_in - stays) / comes_back);
        let (shift_mm, turn) = self.tremor.at(moved_s);
        *inserted * Pose { position_mm: shift_mm - NEEDLE_BACK_MM * (1.0 - depth) * DVec3::Z, orientation: turn }
    }

    fn pose(&self, act: Act) -> Pose {
        let t = self.moved.as_secs_f64();
        let seed = u64::from(self.settings.seed) << 8;
        let wave = |axis: u64, hz: f64| (std::f64::consts::TAU * (hz * t + fraction(bits(seed + axis)))).sin();
        let mut offset_mm = DVec3::new(
            14.0 * wave(0, 0.11) + 3.0 * wave(1, 0.43),
            8.0 * wave(2, 0.07) + 2.0 * wave(3, 0.37),
            1.5 * wave(4, 0.19),
        );
        let degrees = DVec3::new(8.0 * wave(5, 0.13), 9.0 * wave(6, 0.09) + 2.0 * wave(7, 0.31), 6.0 * wave(8, 0.05));
        let mut turn = DQuat::from_scaled_axis(degrees * std::f64::consts::PI / 180.0);
        if act == Act::Jump {
            let random = |i: u64| fraction(bits(seed ^ self.acts_begun << 16 ^ i));
            let angle = std::f64::consts::TAU * random(100);
            offset_mm += DVec3::new(angle.cos(), angle.sin(), 0.0) * (30.0 + 30.0 * random(101));
            turn *= DQuat::from_rotation_z((2.0 * random(102) - 1.0) * std::f64::consts::FRAC_PI_3);
        }
        let around = &self.settings.around;
        Pose {
            position_mm: around.position_mm + around.orientation * offset_mm,
            orientation: (around.orientation * turn).normalize(),
        }
    }
}

#[cfg(test)]
mod tests {
    use bytes::BytesMut;
    use insonify_core::pose::Reading;

    use super::*;
    use crate::tracker::Protocol;

    fn settings(schedule: &str) -> Settings {
        let around = Pose { position_mm: DVec3::new(10.0, 20.0, 30.0), orientation: DQuat::from_rotation_x(1.0) };
        Settings { around, rate_hz: 100.0, seed: 7, schedule: schedule.parse().unwrap(), needle: None }
    }

    fn ticks(settings: &Settings, count: usize) -> Vec<Tick> {
        let mut board = Board::new(settings.clone());
        (0..count).map(|_| board.tick()).collect()
    }

    fn poses(ticks: &[Tick]) -> Vec<Pose> {
        let mut decoder = Protocol::AsciiLine.decoder();
        let mut poses = Vec::new();
        for tick in ticks {
            let Tick::Line(line) = tick else { continue };
            if let Ok(Some(record)) = decoder.decode(&mut BytesMut::from(&line[..]))
                && let Reading::Pose(pose) = record.reading
            {
                poses.push(pose);
            }
        }
        poses
    }

    fn steps(poses: &[Pose]) -> Vec<f64> {
        poses.windows(2).map(|w| w[0].position_mm.distance(w[1].position_mm)).collect()
    }

    #[test]
    fn the_board_moves_smoothly_holds_and_jumps() {
        let settings = settings("move 1, hold 0.5, jump 0.5, drop 0.25, unplug 0.25");
        let all = ticks(&settings, 500);
        assert_eq!(all, ticks(&settings, 500));
        let lost = |t: &Tick| matches!(t, Tick::Nothing | Tick::Unplugged);
        assert_eq!(all[200..225].iter().filter(|t| **t == Tick::Nothing).count(), 25);
        assert_eq!(all[225..250].iter().filter(|t| **t == Tick::Unplugged).count(), 25);
        assert!(!all[..200].iter().any(lost) && !all[250..450].iter().any(lost));
        let poses = poses(&all);
        let step = steps(&poses);
        assert!(step[..99].iter().all(|s| (1e-6..0.5).contains(s)), "moves");
        assert!(step[100..149].iter().all(|s| *s == 0.0), "holds");
        assert!(step[149] > 25.0 && step[199] > 25.0, "jumps: {} {}", step[149], step[199]);
        let far = poses[..150].iter().map(|p| p.position_mm.distance(settings.around.position_mm)).fold(0.0, f64::max);
        assert!(far < 21.0, "{far}");
        let turned = poses[..150].iter().map(|p| p.orientation.angle_between(settings.around.orientation));
        assert!(turned.fold(0.0, f64::max) < 16.0_f64.to_radians());
    }

    /// Poses of the probe and the needle in the lines of `ticks`.
    fn tools(ticks: &[Tick]) -> [Vec<Pose>; 2] {
        let (mut decoder, mut tools) = (Protocol::AsciiLine.decoder(), [Vec::new(), Vec::new()]);
        for tick in ticks {
            let Tick::Line(line) = tick else { continue };
            let mut line = BytesMut::from(&line[..]);
            while let Some(record) = decoder.decode(&mut line).unwrap() {
                let Reading::Pose(pose) = record.reading else { panic!("{record:?}") };
                tools[usize::from(record.sensor)].push(pose);
            }
        }
        tools
    }

    #[test]
    fn a_needle_goes_in_along_its_line_with_a_tremor() {
        let alone = settings("move 100");
        let inserted = Pose { position_mm: DVec3::new(5.0, 0.0, 40.0), orientation: DQuat::from_rotation_y(0.7) };
        let both = Settings { needle: Some(inserted), ..alone.clone() };
        let [probe, needle] = tools(&ticks(&both, 1801));
        assert_eq!(probe, poses(&ticks(&alone, 1801)), "the probe moves as without a needle");
        assert_eq!(needle, tools(&ticks(&both, 1801))[1]);
        assert_ne!(needle, tools(&ticks(&Settings { seed: 8, ..both }, 1801))[1]);
        let from_inserted = |pose: &Pose| inserted.inverse().transform_point(pose.position_mm);
        let way_mm: Vec<DVec3> = needle.iter().map(from_inserted).collect();
        let depth_at = |s: usize| way_mm[100 * s].z;
        assert!((depth_at(0) + 40.0).abs() < 2.0 && depth_at(9).abs() < 2.0 && (depth_at(17) + 40.0).abs() < 2.0);
        assert!(way_mm.iter().all(|p| p.truncate().length() < 3.0), "it stays near its line");
        assert!(steps(&needle).into_iter().fold(0.0, f64::max) < 0.5, "no jumps, at 100 Hz");
        let turned = needle.iter().map(|p| p.orientation.angle_between(inserted.orientation));
        assert!(turned.fold(0.0, f64::max) < 5.0_f64.to_radians());
    }

    #[test]
    fn seeds_differ_and_damage_is_detected() {
        let a = settings("move 1");
        let b = Settings { seed: 8, ..a.clone() };
        assert_ne!(ticks(&a, 3), ticks(&b, 3));
        let damaged = poses(&ticks(&settings("corrupt 3"), 300)).len();
        assert!((198..=205).contains(&damaged), "{damaged} of 300 are whole");
    }

    #[test]
    fn a_schedule_is_parsed_and_printed() {
        let text = "move 10, hold 2.5, jump 1, drop 0.5, corrupt 1, unplug 3";
        assert_eq!(text.parse::<Schedule>().unwrap().to_string(), text);
        for (wrong, part) in
            [("", ""), ("mve 1", "mve 1"), ("move 1, hold", "hold"), ("move -1", "move -1"), ("move 1,", "")]
        {
            assert_eq!(wrong.parse::<Schedule>(), Err(ScheduleError { text: part.into() }));
        }
    }
}
