//! Plausibility of human organs: their volumes and relative positions.
//!
//! [`check_organs`] compares the organs of a patient with `assets/organs.toml` and with a list of relations such as "the
//! spleen lies to the left of the liver". A finding is impossible or unlikely. Children and disease give unlikely
//! findings at most; an organ that the scan cuts is never too small.

mod fact;
mod relations;
mod volumes;

use std::collections::BTreeMap;

pub use fact::OrganFact;
use relations::{Direction, Vote, votes};
use volumes::{Range, range_of};

/// Severity of a finding: impossible in a human, or unusual.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Certainty {
    /// No human has it.
    Impossible,
    /// Few humans have it.
    Unlikely,
}

/// Property of an organ that a finding is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Aspect {
    /// Volume of one organ.
    Volume,
    /// Volumes of all organs.
    Scale,
    /// Left and right.
    Side,
    /// Front and back, or head and feet.
    Position,
}

/// An organ that differs from what is usual.
#[derive(Debug, Clone, PartialEq)]
pub struct OrganFinding {
    /// Severity.
    pub certainty: Certainty,
    /// Property.
    pub aspect: Aspect,
    /// Name of the organ; the first one where several differ.
    pub organ: String,
    /// Description, with the values found and the usual ones.
    pub what: String,
    /// Evidence against the names or the position of the organs: about 1 for an unlikely finding, more for an impossible one.
    pub strain: f64,
}

/// Strain of an impossible volume.
const IMPOSSIBLE_STRAIN: f64 = 8.0;

/// Share of its least usual volume below which an organ is a fragment. The position of a fragment means nothing.
const FRAGMENT_SHARE: f64 = 0.1;

/// Volume below which an organ without a known range is a fragment, ml.
const FRAGMENT_ML: f64 = 0.2;

/// If all organs have less than this share of their least usual volume, the unit of length is wrong.
const OTHER_UNIT_SHARE: f64 = 0.05;

/// Least usual volume that an organ must have to tell the unit, ml: hollow organs may be empty.
const TELLING_ML: f64 = 10.0;

/// Findings about the organs of one patient, impossible ones first.
pub fn check_organs(facts: &[OrganFact]) -> Vec<OrganFinding> {
    let mut findings: Vec<OrganFinding> = facts.iter().filter_map(volume).collect();
    findings.extend(scale(facts));
    let whole: Vec<OrganFact> = facts.iter().filter(|fact| !is_fragment(fact)).cloned().collect();
    findings.extend(positions(&votes(&whole)));
    findings.sort_by_key(|finding| finding.certainty);
    findings
}

/// Whether the volumes of an organ called `name` are known.
pub fn is_known(name: &str) -> bool {
    range_of(name).is_some()
}

fn is_fragment(fact: &OrganFact) -> bool {
    fact.volume_ml < range_of(&fact.name).map_or(FRAGMENT_ML, |range| FRAGMENT_SHARE * range.usual_ml[0])
}

/// A volume in words: whole millilitres from 10 ml on.
fn ml(volume_ml: f64) -> String {
    if volume_ml < 10.0 {
        format!("{volume_ml:.1} ml")
    } else {
        format!("{} ml", crate::names::thousands(volume_ml.round() as usize))
    }
}

fn volume(fact: &OrganFact) -> Option<OrganFinding> {
    let range = range_of(&fact.name)?;
    let Range { usual_ml: [least, usual], most_ml, is_often_cut } = *range;
    let found = fact.volume_ml;
    let (certainty, bound) = if let Some(most_ml) = most_ml.filter(|&most_ml| found > most_ml) {
        (Certainty::Impossible, format!("no human's has more than {}", ml(most_ml)))
    } else if found > usual {
        (Certainty::Unlikely, format!("more than {} is unusual", ml(usual)))
    } else if found < least && !fact.is_cut && !is_often_cut {
        (Certainty::Unlikely, format!("less than {} is unusual", ml(least)))
    } else {
        return None;
    };
    let ratio = if found < least { least / found.max(1e-3) } else { found / usual };
    let strain = match certainty {
        Certainty::Impossible => IMPOSSIBLE_STRAIN,
        Certainty::Unlikely => 1.0 + ratio.max(1.0).ln().min(3.0),
    };
    let what = format!("`{}` has {}: {bound}", fact.name, ml(found));
    Some(OrganFinding { certainty, aspect: Aspect::Volume, organ: fact.name.clone(), what, strain })
}

/// A finding if there are two whole organs or more, all are many times too small, and no other organ has a usual size.
fn scale(facts: &[OrganFact]) -> Option<OrganFinding> {
    let is_usual = |least: f64, found: f64| least > 0.0 && found >= least;
    if facts.iter().any(|fact| range_of(&fact.name).is_some_and(|r| is_usual(r.usual_ml[0], fact.volume_ml))) {
        return None;
    }
    let whole = facts.iter().filter(|fact| !fact.is_cut).filter_map(|fact| Some((fact, range_of(&fact.name)?)));
    let known: Vec<_> = whole.filter(|(_, range)| !range.is_often_cut && range.usual_ml[0] >= TELLING_ML).collect();
    let is_tiny = |(fact, range): &(&OrganFact, &Range)| fact.volume_ml < OTHER_UNIT_SHARE * range.usual_ml[0];
    let [(first, range), _, ..] = known[..] else { return None };
    known.iter().all(is_tiny).then(|| {
        let (name, count) = (&first.name, known.len());
        let (found, usual) = (ml(first.volume_ml), ml(range.usual_ml[0]));
        let what = format!(
            "all {count} whole organs are far too small for a human: `{name}` has {found} instead of {usual} or more"
        );
        OrganFinding {
            certainty: Certainty::Impossible,
            aspect: Aspect::Scale,
            organ: name.clone(),
            what,
            strain: IMPOSSIBLE_STRAIN,
        }
    })
}

/// Findings about positions. If most relations along one axis are contradicted, that axis is reversed, which is impossible.
/// A single contradicted relation is unlikely.
fn positions(votes: &[Vote]) -> Vec<OrganFinding> {
    let mut findings = Vec::new();
    let mut groups: BTreeMap<(Direction, bool), Vec<&Vote>> = BTreeMap::new();
    votes.iter().for_each(|vote| groups.entry((vote.direction, vote.is_pair)).or_default().push(vote));
    for ((direction, is_pair), votes) in &groups {
        let weight = |expected: bool| -> u32 {
            votes.iter().filter(|vote| vote.is_as_expected() == expected).map(|vote| vote.weight).sum()
        };
        let wrong: Vec<&&Vote> = votes.iter().filter(|vote| !vote.is_as_expected()).collect();
        let Some(first) = wrong.iter().max_by_key(|vote| vote.weight) else { continue };
        let aspect = if *direction == Direction::Left { Aspect::Side } else { Aspect::Position };
        let finding = |certainty, what, strain, organ: &str| {
            let organ = organ.trim_matches('`').to_owned();
            OrganFinding { certainty, aspect, organ, what, strain }
        };
        if weight(false) >= 2 && weight(false) > 2 * weight(true) {
            let more = match wrong.len() - 1 {
                0 => String::new(),
                more => format!(", and {} more", crate::names::counted(more, "such pair")),
            };
            let exchanged = match (direction, is_pair) {
                (Direction::Left, true) => "the names of left and right are exchanged",
                (Direction::Left, false) => "left and right are exchanged",
                (Direction::Back, _) => "front and back are exchanged",
                (Direction::Up, _) => "head and feet are exchanged",
            };
            let what = format!("{exchanged}: {first}{more}");
            let strain = 1.5 * f64::from(weight(false));
            findings.push(finding(Certainty::Impossible, what, strain, &first.first));
            continue;
        }
        for vote in wrong {
            let what = format!("{vote}, which is unusual");
            findings.push(finding(Certainty::Unlikely, what, 1.5 * f64::from(vote.weight), &vote.first));
        }
    }
    findings
}

#[cfg(test)]
mod tests;
