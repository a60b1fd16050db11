//! Meanings of meshes: the organ or tissue of each mesh of a file.
//!
//! A meaning is given for a file with one mesh (`FILE=MEANING`), for one mesh or part among several
//! (`FILE#NAME=MEANING`), or for all meshes without another one (`FILE#*=MEANING`). Otherwise the name of a mesh is
//! its meaning. A mesh whose parts name several organs becomes several meshes.

mod error;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

pub use error::MeaningError;
use insonify_core::suggest::did_you_mean;

use super::classes::{Class, ClassError, ClassTable};
use super::mesh_files::{MeshPart, NamedMesh};

/// Most names in a message.
const LISTED_MAX: usize = 6;

/// Name that stands for all meshes of a file.
const ALL: &str = "*";

/// Argument that names a file and, optionally, a mesh and a meaning: `FILE`, `FILE=MEANING` or `FILE#NAME=MEANING`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Assignment {
    /// Path of the file.
    pub file: PathBuf,
    /// Name of a mesh or part; `*` for all meshes without another meaning. `None` for the file as a whole.
    pub mesh: Option<String>,
    /// Organ, tissue or `ignore`.
    pub meaning: Option<String>,
}

/// A mesh with its class.
#[derive(Debug, Clone, PartialEq)]
pub struct Meant {
    /// Class of the mesh.
    pub class: Class,
    /// The mesh, or a part of a mesh as a mesh of its own.
    pub mesh: NamedMesh,
}

impl Assignment {
    /// Reads an argument. As file names may contain `=` and `#`, `is_file` tells whether a path is a file.
    ///
    /// # Errors
    /// A mesh without a meaning; an empty name or meaning.
    pub fn parse(word: &str, is_file: impl Fn(&Path) -> bool) -> Result<Self, MeaningError> {
        let is_file = |text: &str| is_file(Path::new(text));
        let empty = || MeaningError::Empty { word: word.to_owned() };
        if is_file(word) {
            return Ok(Self { file: word.into(), mesh: None, meaning: None });
        }
        let split = |text: &str| -> Option<(String, String)> {
            let known = text.rmatch_indices('#').find(|(at, _)| is_file(&text[..*at])).map(|(at, _)| at);
            let at = known.or_else(|| text.find('#').filter(|_| !is_file(text)))?;
            Some((text[..at].to_owned(), text[at + 1..].to_owned()))
        };
        let Some((left, meaning)) = word.rsplit_once('=') else {
            return match split(word) {
                Some(_) => Err(MeaningError::NoMeaning { word: word.to_owned() }),
                None => Ok(Self { file: word.into(), mesh: None, meaning: None }),
            };
        };
        let meaning = Some(meaning.trim().to_owned()).filter(|meaning| !meaning.is_empty()).ok_or_else(empty)?;
        let (file, mesh) = match split(left).filter(|_| !is_file(left)) {
            Some((_, name)) if name.trim().is_empty() => return Err(empty()),
            Some((file, name)) => (file, Some(name)),
            None => (left.to_owned(), None),
        };
        Ok(Self { file: file.into(), mesh, meaning: Some(meaning) })
    }

    /// Text of the argument as given, for messages.
    fn word(&self) -> String {
        let mesh = self.mesh.as_ref().map(|mesh| format!("#{mesh}")).unwrap_or_default();
        let meaning = self.meaning.as_ref().map(|meaning| format!("={meaning}")).unwrap_or_default();
        format!("{}{mesh}{meaning}", self.file.display())
    }
}

/// The meshes of `file` with their classes. A class follows from an assignment, else from the mesh's own name.
///
/// # Errors
/// A name that the file lacks, two meanings of one mesh, one meaning for several meshes, or a mesh without a meaning.
pub fn meanings(
    table: &ClassTable,
    file: &Path,
    meshes: Vec<NamedMesh>,
    given: &[Assignment],
) -> Result<Vec<Meant>, MeaningError> {
    let mut reader = Meanings::of(table, file, &meshes);
    for assignment in given {
        reader.assign(assignment, &meshes)?;
    }
    let mut meant = Vec::new();
    for (index, mesh) in meshes.into_iter().enumerate() {
        reader.add(index, mesh, &mut meant)?;
    }
    if let Some((first, own)) = reader.unknown.first() {
        let (first, nearest, file) = (first.clone(), reader.near(own), file.to_owned());
        if !reader.is_several {
            return Err(MeaningError::Unknown { file, name: first, nearest });
        }
        let names: Vec<String> = reader.unknown.iter().map(|(name, _)| format!("`{name}`")).collect();
        let verb = if names.len() == 1 { "is no known organ" } else { "are no known organs" };
        return Err(MeaningError::UnknownOfSeveral { file, names: listed(&names), verb, first, nearest });
    }
    Ok(meant)
}

/// State of [`meanings`] for one file.
struct Meanings<'a> {
    table: &'a ClassTable,
    file: &'a Path,
    /// Whether the file has several meshes, or one mesh whose parts get meanings of their own.
    is_several: bool,
    /// Names of the meshes.
    names: Vec<String>,
    /// Assignments by mesh and part: the part's index is `None` for a whole mesh.
    of_target: BTreeMap<(usize, Option<usize>), &'a Assignment>,
    /// Assignment to the file as a whole.
    of_file: Option<&'a Assignment>,
    /// Assignment to all meshes without another one (`*`).
    of_rest: Option<&'a Assignment>,
    /// Number of parts with each name.
    parts_called: BTreeMap<String, usize>,
    /// Meshes and parts without a meaning: name for messages, and name in the file.
    unknown: Vec<(String, String)>,
}

impl<'a> Meanings<'a> {
    fn of(table: &'a ClassTable, file: &'a Path, meshes: &[NamedMesh]) -> Self {
        let mut parts_called = BTreeMap::new();
        for part in meshes.iter().flat_map(|mesh| &mesh.parts) {
            *parts_called.entry(part.name.clone()).or_default() += 1;
        }
        Self {
            table,
            file,
            is_several: meshes.len() > 1,
            names: meshes.iter().map(|mesh| mesh.name.clone()).collect(),
            of_target: BTreeMap::new(),
            of_file: None,
            of_rest: None,
            parts_called,
            unknown: Vec::new(),
        }
    }

    /// Records an assignment under the mesh or part that it names.
    fn assign(&mut self, assignment: &'a Assignment, meshes: &[NamedMesh]) -> Result<(), MeaningError> {
        let twice = |name: String| MeaningError::Twice { file: self.file.to_owned(), name };
        let earlier = match assignment.mesh.as_deref() {
            None => self.of_file.replace(assignment),
            Some(ALL) => self.of_rest.replace(assignment),
            Some(name) => {
                let (index, part) = self.target(name, meshes)?;
                // A mesh can't have a meaning if one of its parts has one, and vice versa.
                let other = |(i, p): &(usize, Option<usize>)| *i == index && p.is_some() != part.is_some();
                if self.of_target.keys().any(other) {
                    return Err(twice(name.to_owned()));
                }
                self.of_target.insert((index, part), assignment)
            }
        };
        let both = self.of_file.is_some() && self.of_rest.is_some();
        match (earlier, &assignment.mesh) {
            (None, _) if !both => Ok(()),
            (_, Some(name)) if name != ALL => Err(twice(name.clone())),
            _ => Err(twice(self.file.display().to_string())),
        }
    }

    /// Index of the mesh called `name`; or index of a mesh, and that of its part called `name`.
    fn target(&self, name: &str, meshes: &[NamedMesh]) -> Result<(usize, Option<usize>), MeaningError> {
        if let Some(index) = meshes.iter().position(|mesh| mesh.name == name) {
            return Ok((index, None));
        }
        let parts = || meshes.iter().enumerate().flat_map(|(i, mesh)| (0..mesh.parts.len()).map(move |p| (i, p)));
        let part_name = |(i, p): (usize, usize)| (&meshes[i].name, &meshes[i].parts[p].name);
        let matches: Vec<_> = parts().filter(|at| part_name(*at).1 == name).collect();
        let whole = |(i, p): (usize, usize)| (i, Some(p).filter(|_| meshes[i].parts.len() > 1));
        let full = |at| {
            let (mesh, part) = part_name(at);
            format!("{mesh}/{part}")
        };
        if let Some(at) = parts().find(|at| full(*at) == name) {
            return Ok(whole(at));
        }
        match matches[..] {
            [at] => Ok(whole(at)),
            [] => {
                let mut known: Vec<String> = meshes.iter().map(|mesh| mesh.name.clone()).collect();
                known.extend(parts().map(|at| part_name(at).1.clone()).filter(|part| !part.is_empty()));
                let nearest = did_you_mean(name, known.iter().map(String::as_str));
                let (file, name) = (self.file.to_owned(), name.to_owned());
                Err(MeaningError::UnknownMesh { file, name, nearest, known: listed(&known) })
            }
            _ => {
                let candidates: Vec<String> = matches.iter().map(|at| full(*at)).collect();
                let (file, name) = (self.file.to_owned(), name.to_owned());
                Err(MeaningError::Ambiguous { file, name, candidates: listed(&candidates) })
            }
        }
    }

    /// Adds a mesh, or else its parts, to `meant` with their classes.
    fn add(&mut self, index: usize, mesh: NamedMesh, meant: &mut Vec<Meant>) -> Result<(), MeaningError> {
        if let Some(assignment) = self.of_target.get(&(index, None)) {
            let class = self.class(assignment, &mesh.name, true)?;
            meant.push(Meant { class, mesh });
            return Ok(());
        }
        let has_meant_parts = self.of_target.keys().any(|(i, _)| *i == index);
        let own = self.table.named(&mesh.name);
        let mut organs = self.organs_of_parts(&mesh);
        let is_apart = mesh.parts.len() > 1 && !mesh.is_one_surface();
        // If parts lie apart and name other organs than the mesh, the name of the mesh doesn't decide on the parts.
        if is_apart
            && let Some(own) = own
            && !organs.is_empty()
            && organs.iter().all(|organ| organ.name != own.name)
        {
            organs.push(own);
        }
        if let Some(assignment) = self.of_file.filter(|assignment| assignment.meaning.is_some()) {
            if self.is_several || has_meant_parts || organs.len() > 1 || (is_apart && own.is_none()) {
                return Err(self.several(assignment, &mesh));
            }
            let class = self.class(assignment, &mesh.name, true)?;
            meant.push(Meant { class, mesh });
            return Ok(());
        }
        if has_meant_parts {
            return self.add_parts(index, mesh, meant);
        }
        let class = match (self.of_rest, own, &organs[..]) {
            (Some(assignment), ..) => self.class(assignment, &mesh.name, false)?,
            (None, _, [_, _, ..]) => return self.add_parts(index, mesh, meant),
            (None, Some(class), _) => class.clone(),
            // In a connected surface, a single part that names an organ gives the whole mesh its meaning.
            (None, None, [class]) if !is_apart => (*class).clone(),
            (None, None, _) if is_apart => return self.add_parts(index, mesh, meant),
            (None, None, _) => {
                self.unknown.push((mesh.name.clone(), mesh.name));
                return Ok(());
            }
        };
        meant.push(Meant { class, mesh });
        Ok(())
    }

    /// Adds the parts of a mesh to `meant`, as meshes of their own.
    fn add_parts(&mut self, index: usize, mesh: NamedMesh, meant: &mut Vec<Meant>) -> Result<(), MeaningError> {
        self.is_several = true;
        let names: Vec<(String, String)> =
            mesh.parts.iter().map(|part| (part.name.clone(), self.name_of_part(&mesh.name, part))).collect();
        let parts = mesh.split(|part| part.name.clone());
        for (number, (part, (own, full))) in parts.into_iter().zip(names).enumerate() {
            let class = match (self.of_target.get(&(index, Some(number))), self.of_rest) {
                (Some(assignment), _) => self.class(assignment, &full, true)?,
                (None, Some(assignment)) => self.class(assignment, &full, false)?,
                (None, None) => match self.table.named(&own) {
                    Some(class) => class.clone(),
                    None => {
                        self.unknown.push((full, own));
                        continue;
                    }
                },
            };
            meant.push(Meant { class, mesh: NamedMesh { name: full, ..part } });
        }
        Ok(())
    }

    /// Name of a part for messages: its own name, or `MESH/PART` if that is empty or several parts have it.
    fn name_of_part(&self, mesh: &str, part: &MeshPart) -> String {
        let is_unique = self.parts_called.get(&part.name).is_some_and(|count| *count == 1);
        if part.name.is_empty() || !is_unique { format!("{mesh}/{}", part.name) } else { part.name.clone() }
    }

    /// Organs that the parts of a mesh name, each once.
    fn organs_of_parts(&self, mesh: &NamedMesh) -> Vec<&'a Class> {
        let mut organs: Vec<&Class> = Vec::new();
        for class in mesh.parts.iter().filter_map(|part| self.table.named(&part.name)) {
            if organs.iter().all(|other| other.name != class.name) {
                organs.push(class);
            }
        }
        organs
    }

    /// Error: one meaning is given for a file of several meshes or parts.
    fn several(&self, assignment: &Assignment, mesh: &NamedMesh) -> MeaningError {
        let names = match &self.names[..] {
            [_] => mesh.parts.iter().map(|part| self.name_of_part(&mesh.name, part)).collect(),
            all => all.to_vec(),
        };
        let (first, count) = (names.first().cloned().unwrap_or_default(), names.len());
        let names: Vec<String> = names.into_iter().map(|name| format!("`{name}`")).collect();
        let meaning = assignment.meaning.clone().unwrap_or_default();
        MeaningError::Several { file: self.file.to_owned(), count, known: listed(&names), first, meaning }
    }

    /// Class that an assignment gives to the mesh `name`. The class is named after the organ if the assignment is for
    /// this mesh alone. Otherwise it has the mesh's name, so that several meshes of one meaning keep different names.
    fn class(&self, assignment: &Assignment, name: &str, is_alone: bool) -> Result<Class, MeaningError> {
        let meaning = assignment.meaning.as_deref().unwrap_or_default();
        if let Some(class) = self.table.named(meaning) {
            let name = if is_alone { class.name.clone() } else { name.to_owned() };
            return Ok(Class { name, ..class.clone() });
        }
        // The meaning is a tissue or `ignore`: it is added to the table as a mapping and looked up again.
        let mut table = self.table.clone();
        let added = table.add(&format!("{ADDED}={meaning}"));
        let nearest = match added {
            Ok(()) => match table.named(ADDED) {
                Some(class) => return Ok(Class { name: name.to_owned(), ..class.clone() }),
                None => String::new(),
            },
            Err(ClassError::Target { nearest, .. }) => nearest,
            Err(_) => String::new(),
        };
        Err(MeaningError::Target { word: assignment.word(), target: meaning.to_owned(), nearest })
    }

    /// Suggestion of organs with similar names, as text to append, or empty.
    fn near(&self, name: &str) -> String {
        let near = self.table.nearest(name);
        if near.is_empty() { String::new() } else { format!(" (did you mean {}?)", near.join(", ")) }
    }
}

/// Provisional name under which a meaning is added to the table.
const ADDED: &str = "mesh";

/// The first names, and the number of the remaining ones.
fn listed(names: &[String]) -> String {
    let shown = names.iter().take(LISTED_MAX).cloned().collect::<Vec<_>>().join(", ");
    match names.len().saturating_sub(LISTED_MAX) {
        0 => shown,
        more => format!("{shown} and {more} more"),
    }
}
