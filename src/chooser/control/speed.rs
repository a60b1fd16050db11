//! Choice of operating points by the speed at which the probe moves.

use super::predict::WORTH;
use super::{PointChange, PointController, RISE_S};
use crate::pose::{ProbeSpeed, Speed};

/// Times for which motion must be faster, or slower, before the class changes, s. Short pauses don't change it.
const FASTER_S: f64 = 0.4;
const SLOWER_S: f64 = 1.5;
/// Fraction of a speed limit below which motion must fall to count as slower.
const BELOW: f64 = 0.7;
/// Time after a change of the speed class during which the controller may switch to a point for the new class, s.
const MOVED_S: f64 = 10.0;

/// Class of the probe's speed. Short pauses, and speeds near a limit between classes, do not change it.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct SpeedWatch {
    class: ProbeSpeed,
    /// Class before the present one.
    before: ProbeSpeed,
    /// Class of the latest speeds, if it differs from the present one, and its start, s.
    next: Option<(ProbeSpeed, f64)>,
}

impl SpeedWatch {
    /// Records the speed at `now_s`; returns whether the class changed.
    fn push(&mut self, now_s: f64, speed: Speed) -> bool {
        let faster = speed.class(1.0);
        // Slower motion counts only below a fraction of the limit, so that speeds near the limit cause no changes.
        let found = if faster > self.class { faster } else { speed.class(BELOW).min(self.class) };
        if found == self.class {
            self.next = None;
            return false;
        }
        // Only the direction counts: a motion that passes both limits has lasted since it passed the first.
        let is_faster = found > self.class;
        let since = self.next.filter(|(next, _)| (*next > self.class) == is_faster).map_or(now_s, |(_, since)| since);
        self.next = Some((found, since));
        let lasts = now_s - since >= if is_faster { FASTER_S } else { SLOWER_S };
        if lasts {
            (self.before, self.class, self.next) = (self.class, found, None);
        }
        lasts
    }
}

impl PointController {
    /// Records the speed of the probe at `now_s`; points are chosen for its class.
    pub fn moves(&mut self, now_s: f64, speed: Speed) {
        if self.watch.push(now_s, speed) {
            self.moved_s = now_s;
            self.fits_since = None;
        }
    }

    /// Class of the probe's speed for which points are chosen.
    pub fn speed(&self) -> ProbeSpeed {
        self.watch.class
    }

    /// Indices of all candidates, by increasing error at the present speed.
    pub(super) fn by_error(&self) -> impl Iterator<Item = usize> + '_ {
        self.orders[self.speed() as usize].iter().copied()
    }

    /// Error of the candidate with this index at the present speed, grey levels.
    pub(super) fn error(&self, index: usize) -> f64 {
        self.candidates[index].error.at(self.speed())
    }

    /// Sorts the candidates by error, for each speed.
    pub(super) fn sort(&mut self) {
        let candidates = &self.candidates;
        self.orders = ProbeSpeed::ALL.map(|speed| {
            let mut order: Vec<usize> = (0..candidates.len()).collect();
            order.sort_by(|&a, &b| candidates[a].error.at(speed).total_cmp(&candidates[b].error.at(speed)));
            order
        });
    }

    /// Changes to a better point for the new speed, within [`MOVED_S`] seconds after the speed changed. The minimum
    /// interval between changes applies; the limit of changes per minute doesn't.
    pub(super) fn follow_speed(&mut self, now_s: f64) -> Option<PointChange> {
        if now_s - self.moved_s > MOVED_S || now_s - self.changed_s < RISE_S {
            return None;
        }
        let to = self.better(now_s)?;
        // A point that was also better at the previous speed fits because the load fell. That needs a slower `rise`.
        let error_before = |index: usize| self.candidates[index].error.at(self.watch.before);
        if error_before(to) < WORTH * error_before(self.current) {
            return None;
        }
        let moves = match self.speed() {
            ProbeSpeed::AtRest => "is at rest",
            ProbeSpeed::Slow => "moves slowly",
            ProbeSpeed::Fast => "moves fast",
        };
        let (from, to_error) = (self.error(self.current), self.error(to));
        let reason = format!("the probe {moves}: {to_error:.1} grey levels off instead of {from:.1}");
        self.uncounted(|this| Some(this.go(now_s, to, true, reason)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Speed classes of a probe that moves at `mm_s(tick)`, at each tick of 0.1 s.
    fn classes(ticks: u32, mm_s: impl Fn(u32) -> f64) -> Vec<ProbeSpeed> {
        let mut watch = SpeedWatch::default();
        let class = |tick| {
            watch.push(0.1 * f64::from(tick), Speed { mm_s: mm_s(tick), deg_s: 0.0 });
            watch.class
        };
        (0..ticks).map(class).collect()
    }

    fn changes(classes: &[ProbeSpeed]) -> usize {
        classes.windows(2).filter(|pair| pair[0] != pair[1]).count()
    }

    #[test]
    fn motion_counts_at_once_and_rest_once_it_lasts() {
        let found = classes(60, |tick| if (10..30).contains(&tick) { 30.0 } else { 0.0 });
        assert_eq!(found[13], ProbeSpeed::AtRest);
        assert!(found[14..44].iter().all(|class| *class == ProbeSpeed::Fast), "{found:?}");
        assert!(found[46..].iter().all(|class| *class == ProbeSpeed::AtRest), "{found:?}");
    }

    #[test]
    fn pauses_tremor_and_speeds_about_a_limit_change_nothing() {
        // Fast strokes of 1 s, with pauses of 1 s between them.
        let strokes = classes(300, |tick| if tick / 10 % 2 == 0 { 40.0 } else { 0.0 });
        assert_eq!(changes(&strokes), 1, "{strokes:?}");
        let tremor = classes(300, |tick| if tick % 5 == 0 { 20.0 } else { 1.0 });
        assert_eq!(changes(&tremor), 0);
        let about_the_limit = classes(300, |tick| 15.0 + 3.0 * (0.1 * f64::from(tick)).sin());
        assert!(changes(&about_the_limit) <= 2, "{about_the_limit:?}");
    }
}
