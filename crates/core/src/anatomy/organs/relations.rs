//! Relative positions of organs.

use std::fmt;

use glam::DVec3;

use super::fact::{OrganFact, matches};

/// Direction from the second organ of a relation to the first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Direction {
    /// To the patient's left.
    Left,
    /// Towards the patient's back.
    Back,
    /// Towards the patient's head.
    Up,
}

impl Direction {
    fn of(self, v: DVec3) -> f64 {
        match self {
            Self::Left => v.x,
            Self::Back => v.y,
            Self::Up => v.z,
        }
    }

    /// Wording of a position in this direction, and wording of a position in the opposite direction.
    fn words(self) -> [&'static str; 2] {
        match self {
            Self::Left => ["to the left of", "to the right of"],
            Self::Back => ["behind", "in front of"],
            Self::Up => ["above", "below"],
        }
    }
}

/// Organs that count as one in a relation: their common name in messages, and patterns of their names.
type Group = (&'static str, &'static [&'static str]);

const SPINE: Group = ("the spine", &["vertebrae_*", "sacrum", "spinal_cord"]);
const KIDNEYS: Group = ("the kidneys", &["kidney_left", "kidney_right", "kidney"]);
const LUNGS: Group = ("the lungs", &["lung_*", "lung"]);
const BACK: Group = ("the muscles of the back", &["autochthon_*"]);
const BUTTOCKS: Group = ("the gluteal muscles", &["gluteus_maximus_*"]);
const LEGS: Group = ("the hips and legs", &["hip_*", "femur_*"]);
const HEAD: Group = ("the head", &["brain", "skull"]);
const LIVER: Group = ("the liver", &["liver"]);
const SPLEEN: Group = ("the spleen", &["spleen"]);
const STOMACH: Group = ("the stomach", &["stomach"]);
const GALLBLADDER: Group = ("the gallbladder", &["gallbladder"]);
const PANCREAS: Group = ("the pancreas", &["pancreas"]);
const HEART: Group = ("the heart", &["heart", "heart_ventricle_*", "heart_myocardium"]);
const AORTA: Group = ("the aorta", &["aorta"]);
const VENA_CAVA: Group = ("the vena cava", &["inferior_vena_cava"]);
const BLADDER: Group = ("the bladder", &["urinary_bladder", "prostate"]);
const STERNUM: Group = ("the sternum", &["sternum"]);
const TRACHEA: Group = ("the trachea", &["trachea"]);
const THYROID: Group = ("the thyroid", &["thyroid_gland"]);
const LEFT_KIDNEY: Group = ("the left kidney", &["kidney_left"]);
const RIGHT_KIDNEY: Group = ("the right kidney", &["kidney_right"]);
const BODY: Group = ("the body", &["body", "body_trunc", "skin"]);

/// Groups whose common names are plurals.
const PLURAL: [&str; 5] = [KIDNEYS.0, LUNGS.0, BACK.0, BUTTOCKS.0, LEGS.0];

/// Weights of certain and of likely relations.
const CERTAIN: u32 = 2;
const LIKELY: u32 = 1;

/// Relations between organs. In nearly everybody, the first organ lies in this direction from the second. The last two
/// values are the smallest distance that counts as evidence, mm, and the weight.
const RELATIONS: [(Group, Direction, Group, f64, u32); 53] = [
    (SPLEEN, Direction::Left, LIVER, 20.0, CERTAIN),
    (SPLEEN, Direction::Left, GALLBLADDER, 15.0, CERTAIN),
    (SPLEEN, Direction::Left, SPINE, 15.0, CERTAIN),
    (SPLEEN, Direction::Left, RIGHT_KIDNEY, 20.0, CERTAIN),
    (SPLEEN, Direction::Left, AORTA, 15.0, CERTAIN),
    (STOMACH, Direction::Left, LIVER, 15.0, CERTAIN),
    (STOMACH, Direction::Left, GALLBLADDER, 20.0, LIKELY),
    (SPINE, Direction::Left, LIVER, 15.0, CERTAIN),
    (SPINE, Direction::Left, GALLBLADDER, 15.0, LIKELY),
    (AORTA, Direction::Left, LIVER, 15.0, CERTAIN),
    (AORTA, Direction::Left, VENA_CAVA, 8.0, LIKELY),
    (LEFT_KIDNEY, Direction::Left, LIVER, 20.0, CERTAIN),
    (BODY, Direction::Left, LIVER, 10.0, LIKELY),
    (HEART, Direction::Left, LIVER, 15.0, LIKELY),
    (SPINE, Direction::Back, LIVER, 15.0, CERTAIN),
    (SPINE, Direction::Back, STOMACH, 15.0, CERTAIN),
    (SPINE, Direction::Back, HEART, 15.0, CERTAIN),
    (SPINE, Direction::Back, BLADDER, 20.0, CERTAIN),
    (SPINE, Direction::Back, STERNUM, 25.0, CERTAIN),
    (SPINE, Direction::Back, PANCREAS, 10.0, CERTAIN),
    (SPINE, Direction::Back, GALLBLADDER, 20.0, CERTAIN),
    (SPINE, Direction::Back, AORTA, 8.0, LIKELY),
    (SPINE, Direction::Back, BODY, 10.0, LIKELY),
    (BACK, Direction::Back, LIVER, 15.0, CERTAIN),
    (BACK, Direction::Back, AORTA, 15.0, CERTAIN),
    (BACK, Direction::Back, KIDNEYS, 10.0, LIKELY),
    (BUTTOCKS, Direction::Back, BLADDER, 15.0, CERTAIN),
    (HEART, Direction::Back, STERNUM, 8.0, CERTAIN),
    (KIDNEYS, Direction::Back, STOMACH, 20.0, LIKELY),
    (KIDNEYS, Direction::Back, GALLBLADDER, 20.0, LIKELY),
    (KIDNEYS, Direction::Back, LIVER, 15.0, LIKELY),
    (LIVER, Direction::Up, BLADDER, 30.0, CERTAIN),
    (SPLEEN, Direction::Up, BLADDER, 30.0, CERTAIN),
    (STOMACH, Direction::Up, BLADDER, 20.0, CERTAIN),
    (PANCREAS, Direction::Up, BLADDER, 30.0, CERTAIN),
    (KIDNEYS, Direction::Up, BLADDER, 20.0, CERTAIN),
    (HEART, Direction::Up, BLADDER, 30.0, CERTAIN),
    (LUNGS, Direction::Up, BLADDER, 30.0, CERTAIN),
    (LUNGS, Direction::Up, KIDNEYS, 20.0, CERTAIN),
    (LUNGS, Direction::Up, LIVER, 20.0, LIKELY),
    (HEART, Direction::Up, LIVER, 20.0, CERTAIN),
    (HEART, Direction::Up, KIDNEYS, 20.0, CERTAIN),
    (HEAD, Direction::Up, HEART, 40.0, CERTAIN),
    (HEAD, Direction::Up, LUNGS, 40.0, CERTAIN),
    (HEAD, Direction::Up, LIVER, 60.0, CERTAIN),
    (HEAD, Direction::Up, SPINE, 20.0, CERTAIN),
    (TRACHEA, Direction::Up, LIVER, 30.0, CERTAIN),
    (TRACHEA, Direction::Up, SPLEEN, 30.0, CERTAIN),
    (TRACHEA, Direction::Up, KIDNEYS, 30.0, CERTAIN),
    (THYROID, Direction::Up, HEART, 30.0, CERTAIN),
    (THYROID, Direction::Up, LIVER, 40.0, CERTAIN),
    (LIVER, Direction::Up, LEGS, 30.0, CERTAIN),
    (KIDNEYS, Direction::Up, LEGS, 30.0, CERTAIN),
];

/// Smallest distance between a left and a right organ along the left-right axis that counts as evidence, mm.
const PAIR_MM: f64 = 10.0;

/// Sections of the spine: first letter of their vertebrae, and number of vertebrae above the section. The second
/// constant is the smallest difference in height that counts as evidence, mm.
const VERTEBRAE: [(char, u32); 4] = [('c', 0), ('t', 7), ('l', 19), ('s', 24)];
const VERTEBRAE_MM: f64 = 10.0;

/// Two organs whose relative position is known, and the position found.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Vote {
    /// Direction from the second organ in which the first should lie.
    pub(super) direction: Direction,
    /// Whether the names of the organs differ only in left and right.
    pub(super) is_pair: bool,
    /// Name of the first organ.
    pub(super) first: String,
    second: String,
    /// Distance of the first organ from the second along `direction`, mm; negative on the wrong side.
    found_mm: f64,
    /// Strength of the evidence.
    pub(super) weight: u32,
}

impl Vote {
    /// Whether the organs lie as in nearly everybody.
    pub(super) fn is_as_expected(&self) -> bool {
        self.found_mm > 0.0
    }
}

impl fmt::Display for Vote {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [along, against] = self.direction.words();
        let words = if self.is_as_expected() { along } else { against };
        let verb = if PLURAL.contains(&self.first.as_str()) { "lie" } else { "lies" };
        write!(f, "{} {verb} {:.0} mm {words} {}", self.first, self.found_mm.abs(), self.second)
    }
}

/// Votes of all relations between the organs that are far enough apart to count as evidence.
pub(super) fn votes(facts: &[OrganFact]) -> Vec<Vote> {
    let mut votes: Vec<Vote> = RELATIONS.iter().filter_map(|relation| related(relation, facts)).collect();
    votes.extend(pairs(facts));
    votes.extend(vertebrae(facts));
    votes
}

fn related(relation: &(Group, Direction, Group, f64, u32), facts: &[OrganFact]) -> Option<Vote> {
    let (first, direction, second, least_mm, weight) = *relation;
    let found_mm = direction.of(centre(first, facts)? - centre(second, facts)?);
    let (first, second) = (first.0.to_owned(), second.0.to_owned());
    let vote = Vote { direction, is_pair: false, first, second, found_mm, weight };
    (found_mm.abs() >= least_mm).then_some(vote)
}

/// Centre of mass of all organs of a group, mm; `None` if there are none.
fn centre((_, names): Group, facts: &[OrganFact]) -> Option<DVec3> {
    let of = facts.iter().filter(|fact| names.iter().any(|pattern| matches(pattern, &fact.name)));
    let sum = |(sum, ml): (DVec3, f64), fact: &OrganFact| (sum + fact.centre_mm * fact.volume_ml, ml + fact.volume_ml);
    let (sum, ml) = of.fold((DVec3::ZERO, 0.0), sum);
    (ml > 0.0).then(|| sum / ml)
}

/// Votes of organs whose names differ only in left and right.
fn pairs(facts: &[OrganFact]) -> Vec<Vote> {
    let mut votes = Vec::new();
    for left in facts.iter().filter(|fact| fact.name.contains("left")) {
        let other = left.name.replacen("left", "right", 1);
        let Some(right) = facts.iter().find(|fact| fact.name == other) else { continue };
        let found_mm = Direction::Left.of(left.centre_mm - right.centre_mm);
        let is_vessel = ["artery", "vein", "vena"].iter().any(|word| left.name.contains(word));
        let weight = if is_vessel { LIKELY } else { CERTAIN };
        let (first, second) = (format!("`{}`", left.name), format!("`{other}`"));
        if found_mm.abs() >= PAIR_MM {
            votes.push(Vote { direction: Direction::Left, is_pair: true, first, second, found_mm, weight });
        }
    }
    votes
}

/// Distance from the centre of a kidney toward the middle of the body beyond which a cyst of the kidney is unusual,
/// mm.
const CYST_MEDIAL_MM: f64 = 40.0;

/// Kidney cysts near the middle of the body, where the vessels are: the name of each, and its position in words.
pub(super) fn medial_cysts(facts: &[OrganFact]) -> Vec<(String, String)> {
    let sides = [("kidney_cyst_left", LEFT_KIDNEY, 1.0, "right"), ("kidney_cyst_right", RIGHT_KIDNEY, -1.0, "left")];
    let medial = |(cyst, kidney, sign, toward): (&str, Group, f64, &str)| {
        let found = facts.iter().find(|fact| matches(cyst, &fact.name))?;
        let medial_mm = sign * (centre(kidney, facts)?.x - found.centre_mm.x);
        let words = format!("`{cyst}` lies {medial_mm:.0} mm to the {toward} of {}", kidney.0);
        (medial_mm > CYST_MEDIAL_MM).then(|| (found.name.clone(), words))
    };
    sides.into_iter().filter_map(medial).collect()
}

/// Vote on the heights of the uppermost and the lowest vertebra.
fn vertebrae(facts: &[OrganFact]) -> Option<Vote> {
    let rank = |fact: &OrganFact| {
        let name = fact.name.to_lowercase();
        let mut of = name.strip_prefix("vertebrae_")?.chars();
        let (_, base) = *VERTEBRAE.iter().find(|(letter, _)| of.clone().next() == Some(*letter))?;
        of.next();
        Some(base + of.as_str().parse::<u32>().ok()?)
    };
    let ranked: Vec<(u32, &OrganFact)> = facts.iter().filter_map(|fact| Some((rank(fact)?, fact))).collect();
    let (_, top) = ranked.iter().min_by_key(|(rank, _)| *rank)?;
    let (_, bottom) = ranked.iter().max_by_key(|(rank, _)| *rank)?;
    let found_mm = Direction::Up.of(top.centre_mm - bottom.centre_mm);
    let (first, second) = (format!("`{}`", top.name), format!("`{}`", bottom.name));
    let vote = Vote { direction: Direction::Up, is_pair: false, first, second, found_mm, weight: CERTAIN };
    (found_mm.abs() >= VERTEBRAE_MM).then_some(vote)
}
