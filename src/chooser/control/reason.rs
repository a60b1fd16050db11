//! The reason why a session begins with a generator or without one.

use super::{Candidate, Load, PointController, ROOM};

impl PointController {
    /// Why the session began with a generator or without one. The text compares the chosen point with the best point of
    /// the other kind. `None` without generators.
    pub fn generator_reason(&self) -> Option<&str> {
        self.generator_reason.as_deref()
    }

    /// Computes [`Self::generator_reason`] for the present point, from the times measured at the start.
    pub(super) fn reason_now(&self) -> Option<String> {
        let point = self.point();
        let names = self.generators.join(", ");
        let head = match point.generator.and_then(|index| self.generators.get(index)) {
            Some(name) => format!("generator {name}"),
            None => "no generator".to_owned(),
        };
        let Some(other) = self.best_of_other_kind(&point) else {
            let none = || format!("{head}: this station makes no frames for {names}, or its time is not known");
            return (!names.is_empty()).then(none);
        };
        let limit_ms = self.limit_ms();
        let [this, that] = [&point, &other].map(|point| self.described(point));
        let why = if !self.fits(&point) {
            let than =
                if self.expected_ms(&point) <= self.expected_ms(&other) { "is faster" } else { "has less error" };
            format!("nothing keeps {limit_ms:.0} ms; {this} {than} than {that}")
        } else if self.fits(&other) {
            format!("{this} beats {that} within {limit_ms:.0} ms")
        } else {
            let over = self.over_limit(&other);
            format!("{this} keeps {limit_ms:.0} ms, {that} does not: {over}")
        };
        Some(format!("{head}: {why}"))
    }

    /// Best point with a generator if `point` has none, else best point without a generator. "Best" means the least
    /// error among points that fit; if none fits, the fastest point.
    fn best_of_other_kind(&self, point: &Candidate) -> Option<Candidate> {
        let by_error = || self.by_error().map(|index| &self.candidates[index]);
        let others = || by_error().filter(|other| other.generator.is_some() != point.generator.is_some());
        let fastest = || others().min_by(|a, b| self.expected_ms(a).total_cmp(&self.expected_ms(b)));
        others().find(|other| self.fits(other)).or_else(fastest).copied()
    }

    /// Whether the point keeps the budget by the rule of the choice at the start.
    fn fits(&self, point: &Candidate) -> bool {
        self.keeps(point, Load::START, self.budget.spread, ROOM)
    }

    /// Name of a point, with its time and error. With a fixed quality, errors are ranks and only generator runs have a
    /// time.
    fn described(&self, point: &Candidate) -> String {
        let (name, ms) = (self.name(point), self.expected_ms(point));
        match (self.chooses_quality(), point.generator) {
            (true, _) => format!("{name} ({ms:.0} ms, error {:.1})", point.error.at(self.speed())),
            (false, Some(_)) => format!("{name} ({ms:.0} ms a run)"),
            (false, None) => name,
        }
    }

    /// The budget that a point exceeds, and the point's 95th percentile of time.
    fn over_limit(&self, point: &Candidate) -> String {
        let (spread, limit_ms) = (self.budget.spread, self.limit_ms());
        let busy_ms = spread * self.expected_ms(point);
        if busy_ms > limit_ms {
            return format!("its 95th percentile is {busy_ms:.0} ms");
        }
        if busy_ms > ROOM * limit_ms {
            let percent = 100.0 * ROOM;
            return format!("its 95th percentile is {busy_ms:.0} ms, above {percent:.0} % of the budget");
        }
        format!("the 95th percentile of its runs is {:.0} ms of {:.0}", spread * point.run_ms, self.budget.run_ms)
    }
}
