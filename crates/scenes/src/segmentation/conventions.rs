//! Plausibility of labels: comparison with human anatomy, for the class table that was used and for all other tables. A
//! class table gives each label number an organ.
//!
//! The strain of a table is the sum of the evidence against it: label numbers that it lacks, and organs of unusual
//! volume or position.

use std::collections::BTreeMap;
use std::path::PathBuf;

use glam::DAffine3;
use insonify_core::anatomy::organs::{Aspect, Certainty, OrganFact, OrganFinding, check_organs};
use insonify_core::names::listed;
use thiserror::Error;

use super::classes::{Class, ClassTable, Role};
use super::measure::Measure;
use super::naming::{NameTable, NamesFrom};
use super::volume::LabelMap;

/// Most findings in a message.
const LISTED_MAX: usize = 4;

/// Strain of a label number that the table lacks, and of a number whose class has no known volume.
const UNKNOWN_STRAIN: f64 = 5.0;
const UNTOLD_STRAIN: f64 = 0.5;

/// Conditions under which another table is likelier than the one used. Its strain is lower than that of the table used
/// by at least `LIKELIER_BY`, and at most `LIKELIER_SHARE` of it. It is also at most 1 plus `FITS_EACH` per label.
const LIKELIER_BY: f64 = 1.0;
const LIKELIER_SHARE: f64 = 0.5;
const FITS_EACH: f64 = 0.35;

/// Largest difference in strain between two tables that count as equally good: the strain of one class of unknown
/// volume, which is no evidence.
const ALIKE: f64 = UNTOLD_STRAIN;

/// Number of labels up to which tables can't be told apart for certain. With so few labels, another table fits as well
/// if its strain is larger by at most `AS_LIKELY_BY`.
const FEW_LABELS: usize = 3;
const AS_LIKELY_BY: f64 = 1.0;

/// Tables whose classes are layers of the whole body, and the smallest volume, ml, of such a layer.
const BODY_TABLES: [&str; 2] = ["body", "tissue-types"];
const BODY_ML: f64 = 3000.0;

/// Findings about the labels of a map.
#[derive(Debug, Clone, PartialEq)]
pub struct Plausibility {
    /// Findings about organs, impossible ones first.
    pub findings: Vec<OrganFinding>,
    /// Label numbers that the table lacks.
    pub unknown: Vec<u16>,
    /// Names of built-in tables that fit the label numbers better, the best first.
    pub likelier: Vec<&'static str>,
    /// Names of built-in tables that give the numbers other meanings and fit about as well, the best first. Empty for
    /// maps of more than three labels.
    pub as_likely: Vec<&'static str>,
}

/// Error for labels that are impossible in a human, or that another table fits better.
#[derive(Debug, Error)]
#[error(
    "{path}: read by {names}, the labels {verdict}: {findings}.{hints} --allow-implausible makes the scene all the same"
)]
pub struct ImplausibleError {
    /// Path of the label map.
    pub path: PathBuf,
    /// Origin of the names.
    pub names: String,
    /// Judgement of the labels, to follow "the labels".
    pub verdict: &'static str,
    /// The first findings.
    pub findings: String,
    /// Likely causes and ways out, each with a space before it.
    pub hints: String,
}

/// Compares the labels with the volumes and positions of organs in humans.
pub fn plausibility(
    labels: &LabelMap,
    measures: &BTreeMap<(usize, u16), Measure>,
    names: &NameTable,
    from: &NamesFrom,
) -> Plausibility {
    let table = &names.table;
    let (mut facts, mut numbered, mut unknown) = (Facts::default(), Vec::new(), Vec::new());
    for segment in &labels.segments {
        let Some(measure) = measures.get(&(segment.layer, segment.value)) else { continue };
        let is_numbered =
            segment.name.is_none() && segment.terminology.is_none() && table.numbered_by_user(segment.value).is_none();
        let class = table.class_of(segment);
        match class {
            Some(class) => facts.add(class, measure),
            None if is_numbered => unknown.push(segment.value),
            None => {}
        }
        if is_numbered {
            numbered.push((segment.value, measure));
        }
    }
    let findings = check_organs(&facts.0);
    let others = if from.has_numbers() { OtherTables::of(names, &numbered) } else { OtherTables::default() };
    Plausibility { findings, unknown, likelier: others.likelier, as_likely: others.as_likely }
}

/// Built-in tables that fit the label numbers better than the one used, and those that fit about as well. In both lists
/// the best comes first.
#[derive(Default)]
struct OtherTables {
    likelier: Vec<&'static str>,
    as_likely: Vec<&'static str>,
}

impl OtherTables {
    fn of(names: &NameTable, numbered: &[(u16, &Measure)]) -> Self {
        let used = strain(&names.table, numbered).unwrap_or(f64::INFINITY);
        let most = (LIKELIER_SHARE * used).min(1.0 + FITS_EACH * numbered.len() as f64).min(used - LIKELIER_BY);
        let largest_ml = numbered.iter().map(|(_, measure)| measure.volume_ml).fold(0.0, f64::max);
        let candidates = ClassTable::builtin_names()
            .filter(|name| *name != names.called && (largest_ml > BODY_ML || !BODY_TABLES.contains(name)));
        let mut strained: Vec<(f64, &'static str, ClassTable)> = candidates
            .filter_map(|name| Some((name, ClassTable::numbers_of(name)?)))
            .filter_map(|(name, table)| Some((strain(&table, numbered)?, name, table)))
            .collect();
        strained.sort_by(|a, b| a.0.total_cmp(&b.0));
        let best = strained.first().map_or(0.0, |(best, ..)| *best);
        let fitting = strained.iter().filter(|(other, ..)| best <= most && *other <= best + ALIKE);
        let likelier: Vec<&'static str> = fitting.map(|(_, name, _)| *name).collect();
        if names.is_chosen || numbered.len() > FEW_LABELS || !used.is_finite() || !likelier.is_empty() {
            return Self { likelier, as_likely: Vec::new() };
        }
        let name_by = |table: &ClassTable, value: u16| table.numbered(value).map(|class| class.name.clone());
        let differs = |table: &ClassTable| {
            numbered.iter().any(|(value, _)| name_by(table, *value) != name_by(&names.table, *value))
        };
        let alike = strained.iter().filter(|(other, _, table)| *other <= used + AS_LIKELY_BY && differs(table));
        Self { likelier, as_likely: alike.map(|(_, name, _)| *name).collect() }
    }
}

/// Volume and position of each organ. Labels of the same organ are merged.
#[derive(Default)]
struct Facts(Vec<OrganFact>);

impl Facts {
    fn add(&mut self, class: &Class, measure: &Measure) {
        if matches!(class.role, Role::Ignore) {
            return;
        }
        let new = measure.fact(class.organ_name());
        match self.0.iter_mut().find(|fact| fact.name == new.name) {
            Some(fact) => {
                let ml = fact.volume_ml + new.volume_ml;
                fact.centre_mm = (fact.centre_mm * fact.volume_ml + new.centre_mm * new.volume_ml) / ml;
                (fact.volume_ml, fact.is_cut) = (ml, fact.is_cut || new.is_cut);
            }
            None => self.0.push(new),
        }
    }
}

/// Strain of `table` for the numbered labels; `None` if the table would make an organ impossible.
fn strain(table: &ClassTable, numbered: &[(u16, &Measure)]) -> Option<f64> {
    let (mut facts, mut strain) = (Facts::default(), 0.0);
    for (value, measure) in numbered {
        match table.numbered(*value) {
            Some(class) => {
                facts.add(class, measure);
                strain += if class.role == Role::Organ && !is_told(class) { UNTOLD_STRAIN } else { 0.0 };
            }
            None => strain += UNKNOWN_STRAIN,
        }
    }
    let findings = check_organs(&facts.0);
    let is_possible = findings.iter().all(|finding| finding.certainty != Certainty::Impossible);
    is_possible.then(|| strain + findings.iter().map(|finding| finding.strain).sum::<f64>())
}

/// Whether the usual volume of the class's organ is known.
fn is_told(class: &Class) -> bool {
    insonify_core::anatomy::organs::is_known(class.organ_name())
}

impl Plausibility {
    /// Refuses impossible labels. Refuses label numbers that another table fits better, unless the user chose the
    /// table.
    ///
    /// # Errors
    /// Impossible volumes or positions; numbers of another table.
    pub fn check(&self, labels: &LabelMap, names: &NameTable, from: &NamesFrom) -> Result<(), ImplausibleError> {
        let is_impossible = self.findings.iter().any(|finding| finding.certainty == Certainty::Impossible);
        if !is_impossible && (self.likelier.is_empty() || names.is_chosen) {
            return Ok(());
        }
        Err(ImplausibleError {
            path: labels.path.clone(),
            names: from.short(),
            verdict: if is_impossible { "are not those of a human" } else { "are unlikely" },
            findings: self.listed(&names.called),
            hints: self.hints(labels, from),
        })
    }

    /// Remarks on findings that are not errors, one line each.
    pub fn remarks(&self, names: &NameTable, is_allowed: bool) -> Vec<String> {
        let mut remarks = Vec::new();
        let is_impossible = self.findings.iter().any(|finding| finding.certainty == Certainty::Impossible);
        if is_impossible && is_allowed {
            remarks.push(format!("--allow-implausible: {}", self.listed(&names.called)));
        }
        if !self.likelier.is_empty() {
            remarks.push(format!(
                "the numbers fit --names {} better than {}",
                self.likelier.join(" or "),
                names.called
            ));
        }
        if !self.as_likely.is_empty() {
            let tables = self.as_likely.join(" or ");
            remarks.push(format!("the numbers fit --names {tables} as well: --names says which"));
        }
        remarks
    }

    fn listed(&self, table: &str) -> String {
        let mut words: Vec<String> = self.findings.iter().map(|finding| finding.what.clone()).collect();
        if !self.unknown.is_empty() {
            let numbers: Vec<String> = self.unknown.iter().take(LISTED_MAX).map(u16::to_string).collect();
            let more = if self.unknown.len() > LISTED_MAX { " and more" } else { "" };
            words.push(format!("{table} has no {}{more}", numbers.join(", ")));
        }
        listed(&words, LISTED_MAX, "; ")
    }

    fn hints(&self, labels: &LabelMap, from: &NamesFrom) -> String {
        let is_impossible =
            |aspect: Aspect| self.findings.iter().any(|f| f.certainty == Certainty::Impossible && f.aspect == aspect);
        let mut hints = String::new();
        if !self.likelier.is_empty() {
            hints += &format!(" The numbers fit --names {}: try that.", self.likelier.join(" or "));
        }
        // A table that fits better explains organs that lie too high or too low, but not organs on the wrong side.
        if is_impossible(Aspect::Side) || (is_impossible(Aspect::Position) && self.likelier.is_empty()) {
            hints += &format!(
                " Mirrored? The file's axes say that its voxels run to the patient's {}. Where that is wrong, save the \
                 segmentation again with the image's own axes; a patient with situs inversus is not wrong.",
                directions(labels.lps_from_voxel)
            );
        }
        if !self.likelier.is_empty() {
            return hints;
        }
        if is_impossible(Aspect::Volume) || is_impossible(Aspect::Scale) {
            let m = labels.lps_from_voxel.matrix3;
            let [a, b, c] = [m.x_axis, m.y_axis, m.z_axis].map(|axis| (axis.length() * 1e3).round() / 1e3);
            hints += &format!(" The file's voxels are {a} × {b} × {c} mm: is that their size?");
        }
        if from.has_numbers() && is_impossible(Aspect::Volume) {
            hints +=
                " No built-in table fits these numbers: --map NUMBER=ORGAN or --names FILE.toml says what they mean.";
        }
        hints
    }
}

/// Directions of the voxels' axes, in words.
fn directions(lps_from_voxel: DAffine3) -> String {
    let m = lps_from_voxel.matrix3;
    let word = |axis: glam::DVec3| {
        let of = axis.abs();
        match () {
            () if of.x >= of.y && of.x >= of.z => {
                if axis.x > 0.0 {
                    "left"
                } else {
                    "right"
                }
            }
            () if of.y >= of.z => {
                if axis.y > 0.0 {
                    "back"
                } else {
                    "front"
                }
            }
            () => {
                if axis.z > 0.0 {
                    "head"
                } else {
                    "feet"
                }
            }
        }
    };
    let [a, b, c] = [m.x_axis, m.y_axis, m.z_axis].map(word);
    format!("{a} (i), {b} (j) and {c} (k)")
}

#[cfg(test)]
mod tests;
