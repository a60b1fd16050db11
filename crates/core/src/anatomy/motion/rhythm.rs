//! Rhythms of motion: pure functions of time, which makes replays reproducible.

use std::f64::consts::{PI, TAU};

use serde::{Deserialize, Serialize};

use crate::random;

/// Fraction of the heart's cycle, at its start, in which the ventricles contract (Wiggers diagram, about 40 % at fetal
/// rates).
const SYSTOLE: f64 = 0.4;
/// Fraction of the cycle, at its end, in which the atria contract.
const ATRIAL_KICK: f64 = 0.18;
/// Ratio of the smallest to the largest depth of a fetal breath (assumed).
const SHALLOWEST: f64 = 0.4;

/// Course of a movement in time. At time 0 everything is at rest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Rhythm {
    /// Continuous heartbeat. The first amount is the contraction of the ventricles. The second is the contraction of
    /// the atria, which comes earlier.
    Heart {
        /// Beats per minute, 20 to 300.
        beats_per_min: f64,
    },
    /// Breaths in bouts with pauses between; continuous without a pause.
    Breath {
        /// Breaths per minute, 4 to 120.
        breaths_per_min: f64,
        /// Length of a bout, s.
        bout_s: f64,
        /// Pause between two bouts, s.
        pause_s: f64,
        /// Seed for the depth of each breath.
        seed: u64,
    },
    /// Single movements at pseudo-random times, each out and back.
    Twitch {
        /// Interval that contains one movement, s.
        every_s: f64,
        /// Duration of a movement, s; less than half of `every_s`.
        lasts_s: f64,
        /// Seed for the times and sizes of the movements.
        seed: u64,
    },
}

impl Rhythm {
    /// Amounts of the movement at `time_s`, each in 0..=1; 0 is the rest position. The second amount is 0 except for
    /// hearts.
    pub fn at(&self, time_s: f64) -> [f64; 2] {
        // Non-finite and negative times count as 0, at which everything rests.
        let time_s = if time_s.is_finite() { time_s.max(0.0) } else { 0.0 };
        match *self {
            Self::Heart { beats_per_min } => {
                let phase = (time_s * beats_per_min / 60.0).fract();
                let ventricles = if phase < SYSTOLE { (PI * phase / SYSTOLE).sin().powi(2) } else { 0.0 };
                let kick = (phase - (1.0 - ATRIAL_KICK)) / ATRIAL_KICK;
                [ventricles, if kick > 0.0 { (PI * kick).sin().powi(2) } else { 0.0 }]
            }
            Self::Breath { breaths_per_min, bout_s, pause_s, seed } => {
                let (into, bout) = if pause_s > 0.0 {
                    let cycle_s = bout_s + pause_s;
                    // The pause comes first: everything is at rest at time 0.
                    (time_s % cycle_s - pause_s, (time_s / cycle_s) as u64)
                } else {
                    (time_s, 0)
                };
                let breaths = into * breaths_per_min / 60.0;
                // A bout has whole breaths only.
                let whole = if pause_s > 0.0 { (bout_s * breaths_per_min / 60.0).floor() } else { f64::INFINITY };
                if breaths < 0.0 || breaths >= whole {
                    return [0.0; 2];
                }
                let depth = if pause_s > 0.0 {
                    SHALLOWEST + (1.0 - SHALLOWEST) * random::at(seed, bout.wrapping_shl(16) | breaths as u64)
                } else {
                    1.0
                };
                [depth * 0.5 * (1.0 - (TAU * breaths.fract()).cos()), 0.0]
            }
            Self::Twitch { every_s, lasts_s, seed } => {
                let span = (time_s / every_s).floor();
                let index = span as u64;
                let start_s = random::at(seed, index.wrapping_mul(2)) * (every_s - lasts_s);
                let t = (time_s - span * every_s - start_s) / lasts_s;
                if !(0.0..1.0).contains(&t) {
                    return [0.0; 2];
                }
                let size = 0.3 + 0.7 * random::at(seed, index.wrapping_mul(2).wrapping_add(1));
                // The movement is fast on the way out and slow on the way back.
                let t = t.powf(0.7);
                [size * (PI * t).sin().powi(2), 0.0]
            }
        }
    }

    /// First value outside its range: key, value and accepted values.
    pub(super) fn wrong(&self) -> Option<(&'static str, f64, &'static str)> {
        let check = |name, value: f64, low: f64, high: f64, right| {
            (!(low..=high).contains(&value)).then_some((name, value, right))
        };
        match *self {
            Self::Heart { beats_per_min } => check("beats_per_min", beats_per_min, 20.0, 300.0, "20 to 300"),
            Self::Breath { breaths_per_min, bout_s, pause_s, .. } => {
                check("breaths_per_min", breaths_per_min, 4.0, 120.0, "4 to 120")
                    .or(check("bout_s", bout_s, 0.5, 3600.0, "0.5 to 3600"))
                    .or(check("pause_s", pause_s, 0.0, 3600.0, "0 to 3600"))
            }
            Self::Twitch { every_s, lasts_s, .. } => check("every_s", every_s, 0.2, 3600.0, "0.2 to 3600").or(check(
                "lasts_s",
                lasts_s,
                0.05,
                0.5 * every_s,
                "0.05 to half of every_s",
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RHYTHMS: [Rhythm; 4] = [
        Rhythm::Heart { beats_per_min: 145.0 },
        Rhythm::Breath { breaths_per_min: 50.0, bout_s: 6.0, pause_s: 9.0, seed: 3 },
        Rhythm::Breath { breaths_per_min: 14.0, bout_s: 1.0, pause_s: 0.0, seed: 3 },
        Rhythm::Twitch { every_s: 7.0, lasts_s: 1.2, seed: 5 },
    ];

    #[test]
    fn every_rhythm_starts_at_rest_stays_in_range_and_is_continuous() {
        for rhythm in RHYTHMS {
            assert_eq!(rhythm.wrong(), None);
            assert_eq!(rhythm.at(0.0), [0.0; 2], "{rhythm:?}");
            assert_eq!(rhythm.at(f64::NAN), [0.0; 2]);
            let mut greatest = 0.0f64;
            for i in 0..60_000 {
                let (now, next) = (rhythm.at(f64::from(i) * 1e-3), rhythm.at(f64::from(i + 1) * 1e-3));
                for k in 0..2 {
                    assert!((0.0..=1.0).contains(&now[k]), "{rhythm:?} {i}");
                    assert!((next[k] - now[k]).abs() < 0.05, "{rhythm:?} jumps at {i} ms");
                }
                greatest = greatest.max(now[0]);
            }
            assert!(greatest > 0.5, "{rhythm:?} never moves: {greatest}");
        }
    }

    #[test]
    fn a_heart_beats_at_its_rate_with_the_atria_before_the_ventricles() {
        let rhythm = Rhythm::Heart { beats_per_min: 120.0 };
        let beats = (0..60_000).filter(|i| {
            let t = f64::from(*i) * 1e-3;
            rhythm.at(t)[0] < 0.4 && rhythm.at(t + 1e-3)[0] >= 0.4
        });
        assert_eq!(beats.count(), 120);
        assert!(rhythm.at(0.45)[1] > 0.5 && rhythm.at(0.45)[0] == 0.0);
        assert!(rhythm.at(0.6)[0] > 0.5 && rhythm.at(0.6)[1] == 0.0);
    }

    #[test]
    fn different_seeds_give_different_rhythms() {
        let twitch = |seed| Rhythm::Twitch { every_s: 5.0, lasts_s: 1.0, seed };
        let moves = |seed| (0..500).map(move |i| twitch(seed).at(f64::from(i) * 0.1)[0]).collect::<Vec<_>>();
        assert_eq!(moves(1), moves(1));
        assert_ne!(moves(1), moves(2));
    }
}
