//! Plausibility of human organs: their volumes and relative positions.
//!
//! [`check_organs`] compares the organs of a patient with `assets/organs.toml` and with a list of relations such as
//! "the spleen lies to the left of the liver". A finding is impossible or unlikely. Children and disease cause
//! unlikely findings at most. An organ that the scan cuts off never counts as too small.

mod fact;
mod relations;
mod volumes;

use std::collections::BTreeMap;

pub use fact::OrganFact;
use relations::{Direction, Vote, medial_cysts, votes};
use volumes::{Range, range_of};

/// Severity of a finding: impossible in a human, or unusual.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Certainty {
    /// No human has such an organ.
    Impossible,
    /// Few humans have such an organ.
    Unlikely,
}

/// Property of an organ that a finding is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Aspect {
    /// Volume of one organ.
    Volume,
    /// Volumes of all organs together: a wrong unit of length.
    Scale,
    /// Position along the left–right axis.
    Side,
    /// Position along the front–back or the head–feet axis.
    Position,
}

/// An organ that differs from the usual.
#[derive(Debug, Clone, PartialEq)]
pub struct OrganFinding {
    /// Severity.
    pub certainty: Certainty,
    /// Property.
    pub aspect: Aspect,
    /// Name of the organ; the first one if several differ.
    pub organ: String,
    /// Description, with the values found and the usual values.
    pub what: String,
    /// Strength of the evidence that names or positions of organs are wrong: about 1 for an unlikely finding, more for
    /// an impossible one.
    pub strain: f64,
}

/// [`OrganFinding::strain`] of an impossible volume.
const IMPOSSIBLE_STRAIN: f64 = 8.0;

/// [`OrganFinding::strain`] of a cyst at an unusual position.
const CYST_STRAIN: f64 = 1.5;

/// Fraction of an organ's smallest usual volume below which the organ counts as a fragment. The position of a fragment
/// means nothing.
const FRAGMENT_SHARE: f64 = 0.1;

/// Volume below which an organ counts as a fragment if its usual volumes are unknown, ml.
const FRAGMENT_ML: f64 = 0.2;

/// The unit of length counts as wrong if every organ is below this fraction of its smallest usual volume. The second
/// fraction suffices for at least `SEVERAL` organs that are at least the fraction `MOST` of all. Neither newborns nor
/// disease have so many organs that small.
const OTHER_UNIT_SHARE: f64 = 0.05;
const OTHER_UNIT_SHARE_OF_SEVERAL: f64 = 0.33;
const SEVERAL: usize = 3;
const MOST: f64 = 0.75;

/// Smallest usual volume, ml, of the organs that give evidence on the unit. Smaller organs may be hollow and empty.
const TELLING_ML: f64 = 10.0;

/// Findings about the organs of one patient, impossible ones first.
pub fn check_organs(facts: &[OrganFact]) -> Vec<OrganFinding> {
    let mut findings: Vec<OrganFinding> = facts.iter().filter_map(volume).collect();
    findings.extend(scale(facts));
    let whole: Vec<OrganFact> = facts.iter().filter(|fact| !is_fragment(fact)).cloned().collect();
    findings.extend(positions(&votes(&whole)));
    findings.extend(medial_cysts(&whole).into_iter().map(|(organ, words)| OrganFinding {
        certainty: Certainty::Unlikely,
        aspect: Aspect::Position,
        organ,
        what: format!("{words}, which is unusual"),
        strain: CYST_STRAIN,
    }));
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

/// A volume in words, in whole millilitres from 10 ml on.
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

/// Finding about a wrong unit of length. It needs two or more whole organs, all or most of them many times too small,
/// and no other organ of usual size. Small organs are ignored: a full gallbladder in a wrong unit looks like an empty
/// gallbladder.
fn scale(facts: &[OrganFact]) -> Option<OrganFinding> {
    let is_usual = |fact: &OrganFact, range: &Range| {
        let [least, _] = range.usual_ml;
        fact.volume_ml >= least && (least >= TELLING_ML || (fact.is_cut && least > 0.0))
    };
    if facts.iter().any(|fact| range_of(&fact.name).is_some_and(|range| is_usual(fact, range))) {
        return None;
    }
    let whole = facts.iter().filter(|fact| !fact.is_cut).filter_map(|fact| Some((fact, range_of(&fact.name)?)));
    let known: Vec<_> = whole.filter(|(_, range)| !range.is_often_cut && range.usual_ml[0] >= TELLING_ML).collect();
    let below = |share: f64| -> Vec<(&OrganFact, &Range)> {
        known.iter().filter(|(fact, range)| fact.volume_ml < share * range.usual_ml[0]).copied().collect()
    };
    let (count, small) = (known.len(), below(OTHER_UNIT_SHARE_OF_SEVERAL));
    let is_most = small.len() >= SEVERAL && small.len() as f64 >= MOST * count as f64;
    let [(first, range), ..] = small[..] else { return None };
    (is_most || (count >= 2 && below(OTHER_UNIT_SHARE).len() == count)).then(|| {
        let name = &first.name;
        let (found, usual) = (ml(first.volume_ml), ml(range.usual_ml[0]));
        let of = if small.len() == count { "all".to_owned() } else { format!("{} of", small.len()) };
        let what = format!(
            "{of} {count} whole organs are far too small for a human: `{name}` has {found} instead of {usual} or more"
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

/// Findings about positions. If most relations along one axis are contradicted, the axis is reversed, which is
/// impossible in a human. A single contradicted relation is unlikely.
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
