//! Unit and axes of meshes: the possible values, and guesses.
//!
//! Guesses follow the file's statements, or else the names of organs: their sizes tell the unit, their relative
//! positions the axes. A guess that is not certain should be confirmed by the user.

mod axes;

use std::fmt;

use glam::DVec3;

pub use super::frame::{MeshAxes, Unit};
use super::{FileHints, NamedMesh};
pub use axes::{contradiction, guess_axes};

/// A guessed value, with the reason.
#[derive(Debug, Clone, PartialEq)]
pub struct Guess<T> {
    /// The most likely value.
    pub value: T,
    /// Reason for the guess, as a clause.
    pub reason: String,
    /// Whether the evidence is clear. If not, the user should confirm the value.
    pub certain: bool,
}

impl<T: fmt::Display> fmt::Display for Guess<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}: {}", self.value, if self.certain { "" } else { " (not certain)" }, self.reason)
    }
}

/// Usual range of the longest side of an organ in adults, mm, by a word of the organ's name. The ranges allow for cut
/// organs and for small or large patients.
const LENGTHS_MM: [(&str, f64, f64); 24] = [
    ("liver", 110.0, 330.0),
    ("kidney", 70.0, 180.0),
    ("spleen", 60.0, 220.0),
    ("heart", 75.0, 200.0),
    ("bladder", 35.0, 200.0),
    ("gallbladder", 25.0, 140.0),
    ("stomach", 80.0, 350.0),
    ("pancreas", 70.0, 260.0),
    ("aorta", 90.0, 600.0),
    ("lung", 130.0, 380.0),
    ("rib", 50.0, 400.0),
    ("vertebra", 25.0, 130.0),
    ("vertebrae", 25.0, 130.0),
    ("spine", 150.0, 800.0),
    ("sternum", 80.0, 260.0),
    ("femur", 150.0, 560.0),
    ("hip", 120.0, 320.0),
    ("brain", 110.0, 220.0),
    ("prostate", 22.0, 100.0),
    ("uterus", 40.0, 180.0),
    ("thyroid", 25.0, 110.0),
    ("colon", 150.0, 600.0),
    ("skin", 150.0, 2100.0),
    ("body", 150.0, 2100.0),
];

/// Guesses the unit of meshes from the file's statements, else from the sizes of organs, else from the size of all
/// meshes.
pub fn guess_unit(hints: &FileHints, meshes: &[NamedMesh]) -> Guess<Unit> {
    let said = hints.said.clone().unwrap_or_default();
    if let Some(reason) = hints.unclear_unit.clone() {
        let likely = by_organs(meshes).unwrap_or_else(|| by_size(meshes)).value;
        return Guess { value: hints.unit.unwrap_or(likely), reason, certain: false };
    }
    if hints.of_format
        && let Some(guess) = by_organs(meshes).filter(|guess| guess.certain)
    {
        return guess;
    }
    if let Some(value) = hints.unit {
        return Guess { value, reason: format!("the file says `{said}`"), certain: true };
    }
    if hints.axes.is_some() {
        return Guess { value: Unit::Mm, reason: format!("files with `{said}` are in mm"), certain: true };
    }
    by_organs(meshes).unwrap_or_else(|| by_size(meshes))
}

/// Unit in which most organs have their usual size; `None` if no mesh has an organ's name, or no unit fits.
fn by_organs(meshes: &[NamedMesh]) -> Option<Guess<Unit>> {
    let known: Vec<(&NamedMesh, f64, f64, f64)> = meshes
        .iter()
        .filter_map(|mesh| {
            let words = words(&mesh.name);
            let (_, least, most) = LENGTHS_MM.iter().find(|(word, _, _)| words.iter().any(|w| w == word))?;
            Some((mesh, longest_side([mesh])?, *least, *most))
        })
        .collect();
    let fits =
        |unit: Unit| known.iter().filter(move |(_, side, least, most)| (*least..=*most).contains(&(side * unit.mm())));
    let mut votes = Unit::ALL.map(|unit| (fits(unit).count(), unit));
    votes.sort_by_key(|(count, _)| std::cmp::Reverse(*count));
    let [(best, value), (second, other), ..] = votes;
    let (mesh, side, ..) = fits(value).next()?;
    let reason = if value == Unit::In {
        format!("`{}` is {side:.3} long, which is usual in inches; in cm, that of a small child", mesh.name)
    } else if best == second {
        format!("`{}` is {side:.3} long, which is usual in {value}, and possible in {other}", mesh.name)
    } else if known.len() == 1 {
        format!("`{}` is {side:.3} long, which is usual in {value}", mesh.name)
    } else {
        format!(
            "{best} of {} known organs have their usual size in {value}; `{}` is {side:.3} long",
            known.len(),
            mesh.name
        )
    };
    // Inches are never certain: an adult's coordinates in inches look like a child's coordinates in cm.
    let certain = value != Unit::In && 2 * second < best && 3 * best >= 2 * known.len();
    Some(Guess { value, reason, certain })
}

/// Words that the name of a mesh may have besides the organ's name if the mesh is the whole organ.
const QUALIFIERS: [&str; 12] = ["left", "right", "l", "r", "lt", "rt", "t", "c", "s", "urinary", "structure", "of"];

/// Sizes of the meshes that are named after a whole organ, with coordinates in `unit`. Lobes and lesions are left out.
pub fn organ_sizes<'m>(meshes: &'m [NamedMesh], unit: Unit) -> Vec<OrganSize<'m>> {
    let of = |mesh: &'m NamedMesh| {
        let name = mesh.name.as_str();
        let words = words(name);
        let (organ, least, most) = LENGTHS_MM.iter().find(|(word, _, _)| words.iter().any(|w| w == word))?;
        if !words.iter().all(|word| word == organ || QUALIFIERS.contains(&word.as_str())) {
            return None;
        }
        let length_mm = longest_side([mesh])? * unit.mm();
        let ratio = (least / length_mm).max(length_mm / most).max(1.0);
        Some(OrganSize { name, length_mm, usual_mm: [*least, *most], ratio })
    };
    meshes.iter().filter_map(of).collect()
}

/// Size of a mesh that is an organ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrganSize<'m> {
    /// Name of the mesh.
    pub name: &'m str,
    /// Longest side, mm.
    pub length_mm: f64,
    /// Usual range of the length, mm.
    pub usual_mm: [f64; 2],
    /// Factor by which the length is below or above its usual range; 1 within the range.
    pub ratio: f64,
}

impl fmt::Display for OrganSize<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, length_mm, usual_mm: [least, most], .. } = self;
        let digits = usize::from(*length_mm < 10.0);
        write!(f, "`{name}` is {length_mm:.digits$} mm long; {least} to {most} mm are usual")
    }
}

/// Guesses the unit from the size of all meshes together.
fn by_size(meshes: &[NamedMesh]) -> Guess<Unit> {
    let size = longest_side(meshes).unwrap_or(0.0);
    let many = meshes.len() > 2;
    let (value, certain, why) = match size {
        ..0.05 => (Unit::M, false, "too small for a body in any unit"),
        ..1.0 => (Unit::M, true, "the size of organs or a body in m"),
        ..2.5 => (Unit::M, many, "the size of a body in m; in cm, that of a piece of a vessel"),
        ..60.0 if many => (Unit::Cm, false, "the size of a body in cm; in mm, that of something small"),
        ..60.0 => (Unit::Mm, false, "the size of something small in mm; in cm, that of organs or a body"),
        ..210.0 if many => (Unit::Mm, false, "the size of some organs in mm; in cm, that of a body"),
        ..2500.0 => (Unit::Mm, true, "the size of organs or a body in mm"),
        _ => (Unit::Mm, false, "too large for a body in any unit"),
    };
    Guess { value, reason: format!("all together are {size:.3} long, {why}"), certain }
}

/// Longest side of the bounding box of some meshes, in the file's unit; `None` without vertices.
fn longest_side<'m>(meshes: impl IntoIterator<Item = &'m NamedMesh>) -> Option<f64> {
    let points = meshes.into_iter().flat_map(|mesh| &mesh.vertices);
    let (min, max) = points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), p| (min.min(*p), max.max(*p)));
    min.is_finite().then(|| (max - min).max_element())
}

/// Words of a name, in lower case. A plural `s` is dropped if the remaining word is a known organ.
fn words(name: &str) -> Vec<String> {
    let lower = name.to_lowercase();
    let split = lower.split(|c: char| !c.is_alphabetic()).filter(|word| !word.is_empty());
    split
        .map(|word| {
            let single = word.strip_suffix('s').unwrap_or(word);
            if LENGTHS_MM.iter().any(|(known, _, _)| *known == single) { single } else { word }.to_owned()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::axes::{CRANIAL, LEFT, POSTERIOR};
    use super::*;

    /// A mesh of two vertices, opposite corners of a cube with sides of `size` about a centre.
    fn organ(name: &str, centre: [f64; 3], size: f64) -> NamedMesh {
        let centre = DVec3::from_array(centre);
        let half = DVec3::splat(0.5 * size);
        let vertices = vec![centre - half, centre + half];
        NamedMesh { name: name.to_owned(), vertices, ..NamedMesh::default() }
    }

    /// Organs of an adult, LPS, mm.
    fn abdomen() -> Vec<NamedMesh> {
        vec![
            organ("liver", [-50.0, 0.0, 100.0], 200.0),
            organ("spleen", [90.0, 40.0, 110.0], 110.0),
            organ("kidney_left", [60.0, 60.0, 40.0], 110.0),
            organ("kidney_right", [-60.0, 60.0, 30.0], 110.0),
            organ("vertebrae_L1", [0.0, 90.0, 40.0], 80.0),
            organ("lung_upper_lobe_left", [70.0, 20.0, 280.0], 200.0),
        ]
    }

    fn placed(axes: MeshAxes, unit: Unit) -> Vec<NamedMesh> {
        let file_from_lps = axes.lps_from_file().transpose();
        let mut meshes = abdomen();
        for vertex in meshes.iter_mut().flat_map(|mesh| &mut mesh.vertices) {
            *vertex = file_from_lps * *vertex / unit.mm();
        }
        meshes
    }

    #[test]
    fn axes_are_rotations_and_their_names_are_unique() {
        for axes in MeshAxes::ALL {
            assert!((axes.lps_from_file().determinant() - 1.0).abs() < 1e-12);
            assert_eq!(MeshAxes::named(axes.name()), Some(axes));
        }
        let up = MeshAxes::YUp.lps_from_file();
        assert_eq!((up * DVec3::Y, up * DVec3::Z, up * DVec3::X), (CRANIAL, -POSTERIOR, LEFT));
        assert_eq!(MeshAxes::Ras.lps_from_file() * DVec3::Y, -POSTERIOR);
    }

    #[test]
    fn organs_tell_unit_and_axes() {
        let hints = FileHints::default();
        for axes in MeshAxes::ALL {
            for unit in [Unit::Mm, Unit::Cm, Unit::M] {
                let meshes = placed(axes, unit);
                let found = guess_unit(&hints, &meshes);
                assert_eq!((found.value, found.certain), (unit, true), "{found}");
                let found = guess_axes(&hints, &meshes);
                assert_eq!((found.value, found.certain), (axes, true), "{found}");
                assert!(found.reason.contains("`kidney_left` is to the left of `kidney_right`"), "{found}");
            }
        }
    }

    #[test]
    fn what_the_file_says_goes_before_what_organs_tell() {
        let meshes = placed(MeshAxes::Lps, Unit::M);
        let said = Some("3D Slicer output. SPACE=RAS".to_owned());
        let hints = FileHints { axes: Some(MeshAxes::Ras), said, ..FileHints::default() };
        let (unit, axes) = (guess_unit(&hints, &meshes), guess_axes(&hints, &meshes));
        assert_eq!((unit.value, axes.value), (Unit::Mm, MeshAxes::Ras));
        assert_eq!(axes.to_string(), "ras: the file says `3D Slicer output. SPACE=RAS`");
    }

    #[test]
    fn toss_ups_are_not_certain() {
        let hints = FileHints::default();
        let thing = |size: f64| vec![organ("thing", [0.0; 3], size)];
        let found: Vec<_> = [0.2, 12.0, 300.0, 9000.0].iter().map(|size| guess_unit(&hints, &thing(*size))).collect();
        let values: Vec<_> = found.iter().map(|guess| (guess.value, guess.certain)).collect();
        assert_eq!(values, [(Unit::M, true), (Unit::Mm, false), (Unit::Mm, true), (Unit::Mm, false)]);
        let axes = guess_axes(&hints, &thing(300.0));
        assert_eq!((axes.value, axes.certain), (MeshAxes::Lps, false));
        // Kidneys, which differ only in left and right, do not distinguish y up from LPS.
        let kidneys = [organ("Left Kidney", [60.0, 0.0, 0.0], 100.0), organ("Right Kidney", [-60.0, 0.0, 0.0], 100.0)];
        let axes = guess_axes(&hints, &kidneys);
        assert!(!axes.certain && axes.reason.contains("fits"), "{axes}");
        // A mirrored patient contradicts all axes.
        let mut mirrored = placed(MeshAxes::Lps, Unit::Mm);
        mirrored.iter_mut().flat_map(|mesh| &mut mesh.vertices).for_each(|v| v.x = -v.x);
        assert!(!guess_axes(&hints, &mirrored).certain);
    }

    #[test]
    fn inches_are_found_and_asked_about() {
        let found = guess_unit(&FileHints::default(), &placed(MeshAxes::Lps, Unit::In));
        assert_eq!((found.value, found.certain), (Unit::In, false));
        assert!(found.reason.contains("inches; in cm, that of a small child"), "{found}");
        let hints = FileHints { unit: Some(Unit::In), ..FileHints::default() };
        assert!(guess_unit(&hints, &placed(MeshAxes::Lps, Unit::In)).certain);
    }

    #[test]
    fn statements_that_are_unclear_and_bodies_in_cm_are_asked_about() {
        let unclear_unit = Some("the file says `units: mm` and `units: cm`".to_owned());
        let hints = FileHints { unit: Some(Unit::Mm), unclear_unit, ..FileHints::default() };
        let found = guess_unit(&hints, &placed(MeshAxes::Lps, Unit::Mm));
        assert_eq!((found.value, found.certain), (Unit::Mm, false), "{found}");
        let unclear_axes = Some("the file says `SPACE=LAS`, which is not read".to_owned());
        let hints = FileHints { unclear_axes, ..FileHints::default() };
        let found = guess_axes(&hints, &placed(MeshAxes::Ras, Unit::Mm));
        assert_eq!((found.value, found.certain), (MeshAxes::Ras, false), "{found}");
        let thing = |at: f64| organ("thing", [0.0, 0.0, at], 20.0);
        let found = guess_unit(&FileHints::default(), &[thing(0.0), thing(60.0), thing(150.0)]);
        assert_eq!((found.value, found.certain), (Unit::Mm, false), "{found}");
    }

    #[test]
    fn a_file_in_another_unit_has_organs_of_unusual_size() {
        let mut meshes = placed(MeshAxes::Lps, Unit::Mm);
        meshes[2].vertices.iter_mut().for_each(|v| *v /= 1000.0);
        meshes.push(organ("liver_tumour", [0.0; 3], 5.0));
        let found: Vec<_> = organ_sizes(&meshes, Unit::Mm).into_iter().filter(|organ| organ.ratio > 1.0).collect();
        assert_eq!(found.len(), 1);
        assert!(
            found[0].ratio > 100.0 && found[0].to_string().starts_with("`kidney_left` is 0.1 mm long; 70 to 180 mm")
        );
    }

    #[test]
    fn an_organ_alone_tells_the_unit() {
        let found = guess_unit(&FileHints::default(), &[organ("Kidneys.001", [0.0; 3], 11.0)]);
        assert_eq!((found.value, found.certain), (Unit::Cm, true));
        assert_eq!(found.reason, "`Kidneys.001` is 11.000 long, which is usual in cm");
        let aorta = guess_unit(&FileHints::default(), &[organ("gallbladder", [0.0; 3], 70.0)]);
        assert_eq!((aorta.value, aorta.certain), (Unit::Mm, true), "{aorta}");
    }
}
