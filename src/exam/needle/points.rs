//! Points of a needle exercise: 100, less the deductions of each criterion. The weights are assumed. `docs/needle.md`
//! has the same table.

use serde::Serialize;

use super::exercise::Approach;
use crate::names::named;

/// Explanation of the points, in one sentence.
pub(crate) const POINTS: &str =
    "100 points, less the deductions; the weights are assumed, and docs/needle.md has them all.";

/// Points for reaching the target.
const TARGET: f64 = 30.0;
/// Points for a visible tip.
const VISIBLE: f64 = 20.0;
/// Points lost by a wrong entry, and by each puncture of a forbidden surface.
const ENTRY: f64 = 10.0;
const FORBIDDEN: f64 = 20.0;
/// Points lost by each pass after the first, and by all passes together.
const PASS: f64 = 5.0;
const PASSES: f64 = 10.0;

/// Criterion of the points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Criterion {
    /// The target was reached.
    Target,
    /// Distance between the deepest position of the last pass and the target.
    FinalDistance,
    /// Time from the entry to the target.
    Time,
    /// Share of time with the tip visible; out-of-plane, whether it was visible at the end.
    Visible,
    /// Angle between the shaft and the image plane.
    Approach,
    /// Straightness of the tip's path.
    Straightness,
    /// Number of passes.
    Passes,
    /// Largest excursion of the tip from the line of entry and target.
    Sideways,
    /// Place of the entry.
    Entry,
    /// Punctures of forbidden surfaces.
    Forbidden,
}

named!(Criterion {
    Target = "target",
    FinalDistance = "final distance",
    Time = "time",
    Visible = "tip visible",
    Approach = "approach",
    Straightness = "straightness",
    Passes = "passes",
    Sideways = "sideways sweep",
    Entry = "entry",
    Forbidden = "forbidden puncture",
});

/// Points lost by one criterion.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Deduction {
    /// Criterion.
    pub criterion: Criterion,
    /// Points lost, above 0.
    pub points: f64,
    /// Value that lost them, in words.
    pub reason: String,
}

/// Values on which the points depend.
#[derive(Debug, Clone, Copy)]
pub(super) struct Values {
    pub(super) approach: Approach,
    /// Time that earns all points, s.
    pub(super) allowed_s: f64,
    pub(super) time_to_target_s: Option<f64>,
    pub(super) final_mm: f64,
    pub(super) visible: f64,
    /// Whether the tip was visible at the end of the last pass.
    pub(super) visible_at_end: bool,
    pub(super) angle_deg: Option<f64>,
    pub(super) straightness: f64,
    pub(super) passes: usize,
    pub(super) sideways_mm: f64,
    /// Whether the entry was where the exercise wants it.
    pub(super) right_entry: bool,
    /// Number of punctures of forbidden surfaces.
    pub(super) forbidden: usize,
}

/// Deductions for these values; criteria without a loss are left out.
pub(super) fn deductions(v: &Values) -> Vec<Deduction> {
    let mut all = Vec::new();
    let mut lose = |criterion, points: f64, reason: String| {
        if points > 0.0 {
            all.push(Deduction { criterion, points, reason });
        }
    };
    match v.time_to_target_s {
        None => {
            lose(Criterion::Target, TARGET, "the target was not reached".to_owned());
            lose(Criterion::Time, 10.0, "the target was not reached".to_owned());
        }
        Some(s) => {
            let reason = format!("{s:.1} s from entry to target; all points up to {:.0} s", v.allowed_s);
            lose(Criterion::Time, 10.0 * lost(s, v.allowed_s, 3.0 * v.allowed_s), reason);
        }
    }
    let reason = format!("the last pass ended {:.1} mm from the target", v.final_mm);
    lose(Criterion::FinalDistance, 10.0 * lost(v.final_mm, 0.0, 10.0), reason);
    if v.approach == Approach::OutOfPlane {
        let points = if v.visible_at_end { 0.0 } else { VISIBLE };
        lose(Criterion::Visible, points, "the tip was not visible at the end of the last pass".to_owned());
    } else {
        let reason = format!("the tip was visible for {:.0} % of the time; all points from 80 %", 100.0 * v.visible);
        lose(Criterion::Visible, VISIBLE * lost(v.visible, 0.8, 0.2), reason);
    }
    let angle = v.angle_deg.map_or_else(|| "no image".to_owned(), |deg| format!("{deg:.1}° to the image plane"));
    match v.approach {
        Approach::InPlane => {
            let part = v.angle_deg.map_or(1.0, |deg| lost(deg, 3.0, 15.0));
            lose(Criterion::Approach, 10.0 * part, format!("{angle}; in-plane, all points up to 3°"));
        }
        Approach::OutOfPlane => {
            let part = v.angle_deg.map_or(1.0, |deg| lost(deg, 30.0, 10.0));
            lose(Criterion::Approach, 10.0 * part, format!("{angle}; out-of-plane, all points from 30°"));
        }
        Approach::Any => {}
    }
    let reason = format!("straightness {:.2}; all points from 0.95", v.straightness);
    lose(Criterion::Straightness, 5.0 * lost(v.straightness, 0.95, 0.6), reason);
    let more = v.passes.saturating_sub(1) as f64;
    lose(Criterion::Passes, (PASS * more).min(PASSES), format!("{} passes", v.passes));
    let reason = format!("{:.1} mm off the line from entry to target; all points up to 3 mm", v.sideways_mm);
    lose(Criterion::Sideways, 5.0 * lost(v.sideways_mm, 3.0, 15.0), reason);
    if !v.right_entry {
        lose(Criterion::Entry, ENTRY, "the needle entered at another place than the exercise asks".to_owned());
    }
    let reason = format!("{} into surfaces that the exercise forbids", crate::names::counted(v.forbidden, "puncture"));
    lose(Criterion::Forbidden, FORBIDDEN * v.forbidden as f64, reason);
    all
}

/// Points that are left of 100, at least 0.
pub(super) fn points(deductions: &[Deduction]) -> f64 {
    (100.0 - deductions.iter().map(|deduction| deduction.points).sum::<f64>()).max(0.0)
}

/// Part of the points that is lost: 0 up to `full`, 1 from `none` on, linear between them. `none` may be the smaller one.
fn lost(value: f64, full: f64, none: f64) -> f64 {
    ((value - full) / (none - full)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERFECT: Values = Values {
        approach: Approach::InPlane,
        allowed_s: 60.0,
        time_to_target_s: Some(40.0),
        final_mm: 0.0,
        visible: 0.9,
        visible_at_end: true,
        angle_deg: Some(2.0),
        straightness: 0.97,
        passes: 1,
        sideways_mm: 2.0,
        right_entry: true,
        forbidden: 0,
    };

    #[test]
    fn a_perfect_puncture_has_all_points_and_each_fault_its_name() {
        assert_eq!(deductions(&PERFECT), []);
        assert_eq!(points(&[]), 100.0);
        let one = |values: Values| {
            let found = deductions(&values);
            assert_eq!(found.len(), 1, "{found:?}");
            (found[0].criterion, found[0].points)
        };
        assert_eq!(one(Values { time_to_target_s: Some(120.0), ..PERFECT }), (Criterion::Time, 5.0));
        assert_eq!(one(Values { final_mm: 20.0, ..PERFECT }), (Criterion::FinalDistance, 10.0));
        assert_eq!(one(Values { visible: 0.1, ..PERFECT }), (Criterion::Visible, 20.0));
        assert_eq!(one(Values { angle_deg: None, ..PERFECT }), (Criterion::Approach, 10.0));
        let across = Values { approach: Approach::OutOfPlane, ..PERFECT };
        assert_eq!(one(Values { angle_deg: Some(20.0), ..across }), (Criterion::Approach, 5.0));
        let across = Values { angle_deg: Some(60.0), visible: 0.05, ..across };
        assert_eq!(deductions(&across), []);
        assert_eq!(one(Values { visible_at_end: false, ..across }), (Criterion::Visible, 20.0));
        assert_eq!(deductions(&Values { angle_deg: Some(60.0), approach: Approach::Any, ..PERFECT }), []);
        assert_eq!(one(Values { straightness: 0.5, ..PERFECT }), (Criterion::Straightness, 5.0));
        assert_eq!(one(Values { passes: 2, ..PERFECT }), (Criterion::Passes, 5.0));
        assert_eq!(one(Values { passes: 9, ..PERFECT }), (Criterion::Passes, 10.0));
        assert_eq!(one(Values { sideways_mm: 9.0, ..PERFECT }), (Criterion::Sideways, 2.5));
        assert_eq!(one(Values { right_entry: false, ..PERFECT }), (Criterion::Entry, 10.0));
        assert_eq!(one(Values { forbidden: 2, ..PERFECT }), (Criterion::Forbidden, 40.0));
    }

    #[test]
    fn the_weights_add_up_to_100_without_entry_and_forbidden_punctures() {
        let worst = Values {
            time_to_target_s: None,
            final_mm: 50.0,
            visible: 0.0,
            angle_deg: Some(90.0),
            straightness: 0.1,
            passes: 5,
            sideways_mm: 40.0,
            ..PERFECT
        };
        let all = deductions(&worst);
        assert_eq!(all.iter().map(|deduction| deduction.points).sum::<f64>(), 100.0);
        assert_eq!(points(&deductions(&Values { forbidden: 3, ..worst })), 0.0);
        let document = include_str!("../../../docs/needle.md");
        for Deduction { criterion, points, .. } in all {
            let row = format!("| {} | {points:.0} |", criterion.name());
            assert!(document.contains(&row), "docs/needle.md lacks {row}");
        }
    }
}
