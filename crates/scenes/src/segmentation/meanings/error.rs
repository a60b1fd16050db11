//! Errors in the meanings of meshes.

use std::path::PathBuf;

/// Errors about meshes without a clear meaning.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MeaningError {
    /// A mesh that is named without a meaning.
    #[error("`{word}` names a mesh without its meaning: write FILE#NAME=MEANING, as in {word}=liver")]
    NoMeaning {
        /// Argument, as given.
        word: String,
    },
    /// An assignment without a name or a meaning.
    #[error("`{word}` must be FILE, FILE=MEANING or FILE#NAME=MEANING")]
    Empty {
        /// Argument, as given.
        word: String,
    },
    /// A meaning that is no known organ or tissue.
    #[error("`{word}`: `{target}` is neither an organ nor a tissue{nearest}")]
    Target {
        /// Argument, as given.
        word: String,
        /// Meaning, as given.
        target: String,
        /// Suggestion, as text to append, or empty.
        nearest: String,
    },
    /// A name that no mesh has.
    #[error("{file} has no mesh `{name}`{nearest}; it has {known}")]
    UnknownMesh {
        /// Path of the file.
        file: PathBuf,
        /// Name asked for.
        name: String,
        /// Suggestion, as text to append, or empty.
        nearest: String,
        /// Names of the file's meshes and parts.
        known: String,
    },
    /// A name that several parts of a file have.
    #[error("`{name}` of {file} is a part of several meshes: write {candidates}")]
    Ambiguous {
        /// Path of the file.
        file: PathBuf,
        /// Name asked for.
        name: String,
        /// Unambiguous names, `MESH/PART`.
        candidates: String,
    },
    /// A mesh with two meanings.
    #[error("{file} gets two meanings for `{name}`: give one")]
    Twice {
        /// Path of the file.
        file: PathBuf,
        /// Name of the mesh, or of the file.
        name: String,
    },
    /// One meaning for a file of several meshes.
    #[error(
        "{file} holds {count} meshes ({known}), and {meaning} is given for the file: give each its own as in \
         {file}#{first}={meaning}, or {file}#*={meaning} if all are {meaning}"
    )]
    Several {
        /// Path of the file.
        file: PathBuf,
        /// Number of meshes and parts.
        count: usize,
        /// Names of the meshes and parts.
        known: String,
        /// First name.
        first: String,
        /// Meaning, as given.
        meaning: String,
    },
    /// A file whose only mesh is no known organ.
    #[error("{file}: `{name}` is no known organ{nearest}: give its tissue or organ as FILE=MEANING")]
    Unknown {
        /// Path of the file.
        file: PathBuf,
        /// Name of the mesh.
        name: String,
        /// Suggestion, as text to append, or empty.
        nearest: String,
    },
    /// A file of several meshes, some of which are no known organs.
    #[error(
        "{file}: {names} {verb}{nearest}: give each its organ, tissue or `ignore` as FILE#NAME=MEANING, as \
         in {file}#{first}=liver, or {file}#*=MEANING for all, or export a file for each organ"
    )]
    UnknownOfSeveral {
        /// Path of the file.
        file: PathBuf,
        /// Names of the meshes.
        names: String,
        /// Verb that fits one name or several names.
        verb: &'static str,
        /// First name.
        first: String,
        /// Suggestion, as text to append, or empty.
        nearest: String,
    },
}
