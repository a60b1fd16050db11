//! Settings that watchers of the session make by hand: generated pictures on and off, and a fixed quality.

use super::{Candidate, Load, PointChange, PointController, RETRY_S, ROOM, SUDDEN};
use crate::pose::BySpeed;
use crate::render::FrameQuality;

impl PointController {
    /// Sets whether watchers want generated pictures. If not, only operating points without a generator are
    /// chosen.
    pub(crate) fn allow_generators(&mut self, generate: bool) {
        self.asked = (self.asked || !self.generate) && generate;
        self.generate = generate;
    }

    /// Changes to the best point without a generator.
    pub(super) fn switch_off(&mut self, now_s: f64) -> Option<PointChange> {
        self.uncounted(|this| this.leave(now_s, "generated pictures are switched off".to_owned()))
    }

    /// Changes at once to the best point, if it has a generator.
    pub(super) fn switch_on(&mut self, now_s: f64) -> Option<PointChange> {
        let load = self.load(SUDDEN).unwrap_or(Load::START);
        let to = self.best(now_s, load, self.spread(SUDDEN), ROOM)?;
        self.candidates[to].generator?;
        let reason = "generated pictures are switched on".to_owned();
        self.uncounted(|this| Some(this.go(now_s, to, true, reason)))
    }

    /// Makes a change that doesn't count against the limit of changes per minute.
    pub(super) fn uncounted(&mut self, change: impl FnOnce(&mut Self) -> Option<PointChange>) -> Option<PointChange> {
        let changes = self.changes;
        let change = change(self);
        self.changes = changes;
        change
    }

    /// Keeps `quality`, which a watcher set, from now on; only the generator is still controlled. If the quality was
    /// fixed before, all its generators stay, else only the present one. Returns whether any generator is left.
    pub fn hold(&mut self, now_s: f64, quality: FrameQuality) -> bool {
        self.by_hand = true;
        let at_work = self.point().generator;
        let all = self.budget.frame_ms.is_none();
        let mut kept: Vec<Candidate> = Vec::new();
        for candidate in self.candidates.iter().filter(|c| c.generator.is_some() && (all || c.generator == at_work)) {
            if kept.iter().all(|known| known.generator != candidate.generator) {
                kept.push(Candidate { quality, render_ms: 0.0, ..*candidate });
            }
        }
        if kept.is_empty() {
            return false;
        }
        // The raw frame ranks last at any speed.
        let error = BySpeed::all(f64::MAX);
        kept.push(Candidate { quality, generator: None, error, render_ms: 0.0, run_ms: 0.0 });
        self.current = kept.iter().position(|candidate| candidate.generator == at_work).unwrap_or(kept.len() - 1);
        self.before = self.current;
        self.blocked_until = vec![f64::NEG_INFINITY; kept.len()];
        self.retry_s = vec![RETRY_S[0]; kept.len()];
        self.candidates = kept;
        self.sort();
        self.budget.frame_ms = None;
        self.rest(now_s);
        true
    }
}
