//! Guesses of axes from the relative positions of organs.

use std::fmt;

use glam::DVec3;
use insonify_core::names::counted;

use super::{Guess, MeshAxes, words};
use crate::segmentation::mesh_files::{FileHints, NamedMesh};

/// Unit directions in LPS.
pub(super) const LEFT: DVec3 = DVec3::X;
pub(super) const POSTERIOR: DVec3 = DVec3::Y;
pub(super) const CRANIAL: DVec3 = DVec3::Z;

/// Pairs of organs by words of their names. In nearly everybody, the first organ lies in the given direction (LPS) from
/// the second.
const EXPECTED_DIRECTIONS: [(&str, DVec3, &str); 16] = [
    ("spleen", LEFT, "liver"),
    ("stomach", LEFT, "liver"),
    ("spleen", LEFT, "gallbladder"),
    ("lung", CRANIAL, "liver"),
    ("heart", CRANIAL, "liver"),
    ("heart", CRANIAL, "kidney"),
    ("lung", CRANIAL, "kidney"),
    ("liver", CRANIAL, "bladder"),
    ("kidney", CRANIAL, "bladder"),
    ("brain", CRANIAL, "heart"),
    ("vertebra", POSTERIOR, "liver"),
    ("vertebrae", POSTERIOR, "liver"),
    ("spine", POSTERIOR, "liver"),
    ("vertebrae", POSTERIOR, "heart"),
    ("kidney", POSTERIOR, "stomach"),
    ("heart", POSTERIOR, "sternum"),
];

/// Smallest cosine of the angle between found and expected direction that confirms axes. Below its negative, the
/// position contradicts them.
const ALONG: f64 = 0.35;

/// Better axes, if more positions of organs contradict `axes` than support them, and a clause that names the
/// contradiction. No position contradicts the better axes; `None` if there are no such axes.
pub fn contradiction(axes: MeshAxes, meshes: &[NamedMesh]) -> Option<(MeshAxes, String)> {
    let evidence = evidence(meshes);
    let count = |axes: MeshAxes, sign: i64| evidence.iter().filter(|e| e.sign(axes) == sign).count();
    let against = evidence.iter().find(|e| e.sign(axes) < 0)?;
    if count(axes, -1) <= count(axes, 1) {
        return None;
    }
    let fits = |other: &MeshAxes| count(*other, -1) == 0 && count(*other, 1) >= count(axes, -1);
    let other = MeshAxes::ALL.into_iter().find(fits)?;
    let contradicting = counted(count(axes, -1), "place");
    let text = format!(
        "in a body {against}; with {axes} it is the other way round ({contradicting} contradict), {other} fits"
    );
    Some((other, text))
}

/// Guesses the axes of meshes from the file's statements, or from the relative positions of organs.
pub fn guess_axes(hints: &FileHints, meshes: &[NamedMesh]) -> Guess<MeshAxes> {
    if let Some(reason) = hints.unclear_axes.clone() {
        let likely = guess_axes(&FileHints::default(), meshes).value;
        return Guess { value: likely, reason, certain: false };
    }
    if hints.of_format {
        let guess = guess_axes(&FileHints::default(), meshes);
        if guess.certain {
            return guess;
        }
    }
    if let Some(value) = hints.axes {
        let said = hints.said.clone().unwrap_or_default();
        return Guess { value, reason: format!("the file says `{said}`"), certain: true };
    }
    let evidence = evidence(meshes);
    let scored = |axes: MeshAxes| -> (i64, usize) {
        let signs = evidence.iter().map(|e| e.sign(axes));
        (signs.clone().sum(), signs.filter(|sign| *sign < 0).count())
    };
    let mut ranks = MeshAxes::ALL.map(|axes| (scored(axes), axes));
    ranks.sort_by_key(|((score, _), _)| std::cmp::Reverse(*score));
    let [((best, against), value), ((second, _), other), _] = ranks;
    let mut supports = evidence.iter().filter(|e| e.sign(value) > 0);
    let Some(first) = supports.next() else {
        let reason = "neither the file nor its mesh names indicate the axes; most programs write LPS".to_owned();
        return Guess { value: MeshAxes::Lps, reason, certain: false };
    };
    let mut reason = first.to_string();
    // A second pair of organs in another direction supports the guess.
    if let Some(next) = evidence.iter().find(|e| e.sign(value) > 0 && e.direction != first.direction) {
        reason += &format!(", and {next}");
    }
    if best == second {
        reason += &format!("; that fits {other} as well");
    }
    let is_clear = best > second && against == 0;
    if best > second && against > 0 {
        reason += &format!("; {against} other places contradict");
    }
    Guess { value, reason: format!("with {value}, {reason}"), certain: is_clear }
}

/// Two meshes whose relative position in the body is known.
struct Evidence<'m> {
    first: &'m str,
    second: &'m str,
    /// Expected direction from the second mesh to the first, LPS.
    direction: DVec3,
    /// Direction from the second mesh to the first in the file, as a unit vector in the file's axes.
    found: DVec3,
}

impl Evidence<'_> {
    /// 1 if the relative position is as expected with these axes, −1 if it is the opposite, else 0.
    fn sign(&self, axes: MeshAxes) -> i64 {
        let cosine = self.direction.dot(axes.lps_from_file() * self.found);
        i64::from(cosine > ALONG) - i64::from(cosine < -ALONG)
    }
}

impl fmt::Display for Evidence<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let relation = match self.direction {
            LEFT => "to the left of",
            POSTERIOR => "behind",
            _ => "above",
        };
        write!(f, "`{}` is {relation} `{}`", self.first, self.second)
    }
}

fn evidence(meshes: &[NamedMesh]) -> Vec<Evidence<'_>> {
    let named: Vec<(Vec<String>, DVec3, &str)> =
        meshes.iter().map(|mesh| (words(&mesh.name), centre(mesh), mesh.name.as_str())).collect();
    let between = |first: usize, second: usize, direction: DVec3| {
        let ((_, from, second), (_, to, first)) = (&named[second], &named[first]);
        Some(Evidence { first, second, direction, found: (*to - *from).try_normalize()? })
    };
    let mut found = Vec::new();
    for (left, right) in pairs(&named) {
        found.extend(between(left, right, LEFT));
    }
    // If an organ has several meshes, as the lungs do, the mean of their centres counts.
    let having =
        |word: &str| -> Vec<usize> { (0..named.len()).filter(|&i| named[i].0.iter().any(|w| w == word)).collect() };
    let middle = |of: &[usize]| of.iter().map(|&i| named[i].1).sum::<DVec3>() / of.len() as f64;
    for (word, direction, other) in EXPECTED_DIRECTIONS {
        let (first, second) = (having(word), having(other));
        if let ([a, ..], [b, ..]) = (&first[..], &second[..])
            && let Some(found_direction) = (middle(&first) - middle(&second)).try_normalize()
        {
            let (first, second) = (named[*a].2, named[*b].2);
            found.push(Evidence { first, second, direction, found: found_direction });
        }
    }
    found
}

/// Pairs of meshes (left, right) whose names differ only in the side, as indices.
fn pairs(named: &[(Vec<String>, DVec3, &str)]) -> Vec<(usize, usize)> {
    let without = |words: &[String], side: [&str; 2]| -> Option<Vec<String>> {
        let mut rest = words.to_vec();
        let at = rest.iter().position(|word| side.contains(&word.as_str()))?;
        rest.remove(at);
        Some(rest)
    };
    let mut found = Vec::new();
    for (left, (words, ..)) in named.iter().enumerate() {
        let Some(rest) = without(words, ["left", "l"]) else { continue };
        let other = named.iter().position(|(words, ..)| without(words, ["right", "r"]).as_ref() == Some(&rest));
        found.extend(other.map(|right| (left, right)));
    }
    found
}

/// Centre of a mesh's bounding box.
fn centre(mesh: &NamedMesh) -> DVec3 {
    let bounds =
        mesh.vertices.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), p| (min.min(*p), max.max(*p)));
    if mesh.vertices.is_empty() { DVec3::ZERO } else { 0.5 * (bounds.0 + bounds.1) }
}
