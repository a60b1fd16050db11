//! Simulated hands: operators of different skill who search for a plane.
//!
//! A search is a chain of submovements. Each aims at the plane, and leaves a part of the error or overshoots it
//! (Woodworth, Psychol Rev Monogr 3, 1899; Meyer et al., Psychol Rev 95:340, 1988). Skilled hands correct all errors
//! at once and finely; novices correct one error at a time and coarsely. The numbers are assumed: chosen so that an
//! expert finds every plane, a trained hand most planes, and a novice about half of them.

use std::str::FromStr;

use glam::{DQuat, DVec3, EulerRot};

use crate::pose::Pose;
use crate::random::SplitMix64;

/// Skill of an operator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Skill {
    /// A novice in the first weeks of training.
    Novice,
    /// A trained operator, who scans alone and carefully.
    Trained,
    /// An expert with years of practice.
    #[default]
    Expert,
}

crate::names::named!(Skill { Novice = "novice", Trained = "trained", Expert = "expert" });

impl Skill {
    /// Parameters of a hand with that skill.
    pub fn hand(self) -> Hand {
        match self {
            Self::Novice => Hand {
                start: Deviation { tilt_deg: 16.0, rock_deg: 14.0, rotate_deg: 28.0, slide_mm: 22.0 },
                rest: Deviation { tilt_deg: 3.0, rock_deg: 8.0, rotate_deg: 6.0, slide_mm: 4.0 },
                left_over: (-0.6, 0.75),
                corrects: 0.5,
                move_s: (0.7, 1.8),
                look_s: (0.4, 1.4),
                hold_s: (2.0, 4.0),
                tremor: 1.5,
                drift: 0.8,
                press_mm: 2.5,
                press_change_mm: 1.6,
                lift_chance: 0.6,
            },
            Self::Trained => Hand {
                start: Deviation { tilt_deg: 13.0, rock_deg: 11.0, rotate_deg: 22.0, slide_mm: 18.0 },
                rest: Deviation { tilt_deg: 1.2, rock_deg: 4.0, rotate_deg: 2.5, slide_mm: 1.5 },
                left_over: (-0.3, 0.4),
                corrects: 0.8,
                move_s: (0.6, 1.2),
                look_s: (0.3, 0.9),
                hold_s: (2.5, 4.0),
                tremor: 0.9,
                drift: 0.5,
                press_mm: 2.5,
                press_change_mm: 0.8,
                lift_chance: 0.3,
            },
            Self::Expert => Hand {
                start: Deviation { tilt_deg: 11.0, rock_deg: 9.0, rotate_deg: 18.0, slide_mm: 14.0 },
                rest: Deviation { tilt_deg: 0.4, rock_deg: 2.0, rotate_deg: 1.0, slide_mm: 0.5 },
                left_over: (-0.15, 0.2),
                corrects: 1.0,
                move_s: (0.5, 0.9),
                look_s: (0.2, 0.5),
                hold_s: (2.5, 4.0),
                tremor: 0.5,
                drift: 0.2,
                press_mm: 2.5,
                press_change_mm: 0.4,
                lift_chance: 0.1,
            },
        }
    }
}

impl FromStr for Skill {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::named(text).ok_or_else(|| format!("expected one of {}", Self::NAMES.join(", ")))
    }
}

/// Sizes of a hand's errors, one for each kind of movement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deviation {
    /// Tilt (fanning) about the probe's lateral axis, degrees.
    pub tilt_deg: f64,
    /// Rock in the image plane, degrees.
    pub rock_deg: f64,
    /// Rotation about the probe's long axis, degrees.
    pub rotate_deg: f64,
    /// Slide on the skin in each direction, mm.
    pub slide_mm: f64,
}

/// Parameters of a simulated hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hand {
    /// Error at the start of a search.
    pub start: Deviation,
    /// Error at which the hand stops correcting, and holds the plane.
    pub rest: Deviation,
    /// Smallest and greatest fraction of an error that remains after a submovement; negative fractions overshoot.
    pub left_over: (f64, f64),
    /// Probability, 0..=1, that a submovement corrects a given kind of error.
    pub corrects: f64,
    /// Shortest and longest duration of a submovement, s.
    pub move_s: (f64, f64),
    /// Shortest and longest pause after a submovement, s.
    pub look_s: (f64, f64),
    /// Shortest and longest duration of a hold, s.
    pub hold_s: (f64, f64),
    /// Amplitude of the tremor, relative to [`TREMOR_MM`](crate::pose::freehand::TREMOR_MM).
    pub tremor: f64,
    /// Drift during a hold, relative to `rest`.
    pub drift: f64,
    /// Depth to which the face presses the skin, mm.
    pub press_mm: f64,
    /// Amplitude of the variation of that depth, mm.
    pub press_change_mm: f64,
    /// Probability, 0..=1, of lifting the probe off the skin on the way to the next plane.
    pub lift_chance: f64,
}

/// Deviation of a simulated probe pose from its ideal pose: rotation about the point of contact, and slide away from
/// it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Off {
    /// Tilt, rock and rotation (degrees), slide along the lateral and the elevational axis (mm).
    parts: [f64; 5],
}

impl Off {
    /// Random deviation, uniform up to 1.5 times `size`.
    pub(super) fn draw(size: &Deviation, random: &mut SplitMix64) -> Self {
        Self { parts: sizes(size).map(|s| s * 1.5 * (2.0 * random.unit() - 1.0)) }
    }

    /// Random deviation of 0.5 to 1.5 times `size` in either direction. A search starts with it, so it always starts
    /// off the plane.
    pub(super) fn draw_away(size: &Deviation, random: &mut SplitMix64) -> Self {
        let side = |random: &mut SplitMix64| if random.unit() < 0.5 { -1.0 } else { 1.0 };
        Self { parts: sizes(size).map(|s| s * side(random) * (0.5 + random.unit())) }
    }

    /// Whether every part is within 1.5 times `size`.
    pub(super) fn is_within(&self, size: &Deviation) -> bool {
        self.parts.iter().zip(sizes(size)).all(|(part, size)| part.abs() <= 1.5 * size)
    }

    /// Deviation after one submovement of `hand`.
    pub(super) fn corrected(&self, hand: &Hand, random: &mut SplitMix64) -> Self {
        let (least, most) = hand.left_over;
        let noise = Self::draw(&hand.rest, random);
        let mut parts = self.parts;
        for (part, noise) in parts.iter_mut().zip(noise.parts) {
            let left = random.between(least, most);
            if random.unit() < hand.corrects {
                *part *= left;
            }
            // No movement is exact, and each correction disturbs the other parts.
            *part += 0.5 * noise;
        }
        Self { parts }
    }

    /// Sum of `self` and `factor` times `other`.
    pub(super) fn plus(&self, other: &Self, factor: f64) -> Self {
        Self { parts: std::array::from_fn(|i| self.parts[i] + factor * other.parts[i]) }
    }

    /// Pose of a probe that deviates by `self` from `pose`.
    pub(super) fn of(&self, pose: &Pose) -> Pose {
        let [tilt, rock, rotate, lateral, elevational] = self.parts;
        let turn = DQuat::from_euler(EulerRot::XYZ, tilt.to_radians(), rock.to_radians(), rotate.to_radians());
        Pose {
            position_mm: pose.transform_point(DVec3::new(lateral, elevational, 0.0)),
            orientation: (pose.orientation * turn).normalize(),
        }
    }
}

/// Random pose around `pose`, uniform up to 1.5 times `size`.
pub(crate) fn wandered(pose: &Pose, size: &Deviation, random: &mut SplitMix64) -> Pose {
    Off::draw(size, random).of(pose)
}

fn sizes(e: &Deviation) -> [f64; 5] {
    [e.tilt_deg, e.rock_deg, e.rotate_deg, e.slide_mm, e.slide_mm]
}
