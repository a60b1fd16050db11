//! Origin of the labels' names: names in the file, a class table's names for the numbers, or names of files.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use insonify_core::names::{listed, printable};
use thiserror::Error;

use super::classes::{ClassTable, OrganInName, Role, organ_in_name, stem};
use super::measure::Measure;
use super::volume::LabelMap;

/// Most labels in a message.
const LISTED_MAX: usize = 8;

/// Table of names for labels, and how it was chosen.
#[derive(Debug, Clone)]
pub struct NameTable {
    /// Classes, with the user's mappings.
    pub table: ClassTable,
    /// Name of the table, or path of its file.
    pub called: String,
    /// Whether the user chose the table. If so, it decides on numbers even if the file's name is an organ's.
    pub is_chosen: bool,
}

/// Origin of the labels' names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum NamesFrom {
    /// Names in the file.
    File {
        /// Part of the file that holds the names.
        part: &'static str,
    },
    /// Names in the file, and a table's numbers for labels without a name.
    Both {
        /// Part of the file that holds the names.
        part: &'static str,
        /// Labels without a name.
        numbers: Vec<u16>,
        /// Name of the table.
        table: String,
        /// Whether the user chose the table.
        is_chosen: bool,
    },
    /// Label numbers of a table.
    Numbers {
        /// Name of the table.
        table: String,
        /// Whether the user chose the table.
        is_chosen: bool,
    },
    /// Mappings by the user alone.
    Maps,
    /// The file's name, for its only label.
    FileName {
        /// Number of the label.
        value: u16,
        /// Name of the organ.
        organ: String,
    },
    /// Names of the files in a folder.
    Folder {
        /// Number of files that were read.
        files: usize,
        /// Words that were left out of all file names, or empty.
        without: String,
    },
}

impl NamesFrom {
    /// Whether labels without names were looked up in a table by number.
    pub fn has_numbers(&self) -> bool {
        matches!(self, Self::Numbers { .. } | Self::Both { .. })
    }

    /// The origin without details, as part of a sentence.
    pub fn short(&self) -> String {
        match self {
            Self::File { part } | Self::Both { part, .. } => format!("names of {part}"),
            Self::Numbers { table, .. } => format!("numbers of {table}"),
            Self::Maps => "the meanings of --map".to_owned(),
            Self::FileName { .. } => "the name of the file".to_owned(),
            Self::Folder { .. } => "the names of the files".to_owned(),
        }
    }
}

impl fmt::Display for NamesFrom {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File { part } => write!(f, "names from {part}"),
            Self::Both { part, numbers, table, is_chosen } => {
                let numbers = listed_values(numbers);
                let how = if *is_chosen { "as --names says" } else { "which is a guess: --map or --names chooses" };
                write!(f, "names from {part}; numbers without a name ({numbers}) by {table}, {how}")
            }
            Self::Numbers { table, is_chosen: true } => write!(f, "numbers by {table}, as --names says"),
            Self::Numbers { table, is_chosen: false } => {
                write!(f, "numbers by {table}: the file has no names, and --names chooses another table")
            }
            Self::Maps => write!(f, "meanings from --map"),
            Self::FileName { value, organ } => {
                write!(f, "`{organ}` by the name of the file: its one label, {value}, has no name")
            }
            Self::Folder { files, without } => {
                let files = insonify_core::names::counted(*files, "file");
                write!(f, "names from the names of {files}")?;
                if without.is_empty() { Ok(()) } else { write!(f, ", without `{without}`") }
            }
        }
    }
}

/// Labels that cannot be named.
#[derive(Debug, Error, PartialEq)]
pub enum NamingError {
    /// One label without a name, in a file whose name is no organ's.
    #[error(
        "{path} has one label, {value} ({ml:.1} ml), without a name, and the name of the file is no organ's{maybe}: say what it is \
         with --map {value}={example}, or by which table it is numbered with --names (as in --names total-v2); a folder of masks \
         is read by the names of its files"
    )]
    SingleLabel {
        /// Path of the label map.
        path: PathBuf,
        /// Number of the label.
        value: u16,
        /// Volume of the label, ml.
        ml: f64,
        /// Organs that the file's name may mean, as text to append, or empty.
        maybe: String,
        /// Organ for the example in the message.
        example: String,
    },
    /// A file name and a chosen table that contradict each other.
    #[error(
        "{path} is called `{organ}`, but its one label, {value}, is `{numbered}` by --names {table}: leave --names out to read it \
         by the file's name, or say what it is with --map {value}={organ}"
    )]
    Contradiction {
        /// Path of the label map.
        path: PathBuf,
        /// Number of the label.
        value: u16,
        /// Organ that the file's name stands for.
        organ: String,
        /// Class that the table gives to the label's number.
        numbered: String,
        /// Name of the table.
        table: String,
    },
    /// A file with one organ's name that holds several labels, one of which has no name.
    #[error(
        "{path} is called `{organ}`, but label {value} is one of several, and has no name: say what it is with --map {value}=ORGAN \
         (or =ignore), or by which table it is numbered with --names"
    )]
    UnnamedAmongSeveral {
        /// Path of the label map.
        path: PathBuf,
        /// Organ that the file's name stands for.
        organ: String,
        /// Number of the label.
        value: u16,
    },
    /// A file with one organ's name and several labels without names.
    #[error(
        "{path} is called `{organ}`, but has several labels without names ({values}): say what each is with --map {first}={organ} \
         and so on, or by which table they are numbered with --names"
    )]
    SeveralLabels {
        /// Path of the label map.
        path: PathBuf,
        /// Organ that the file's name stands for.
        organ: String,
        /// The first labels without a name, as text.
        values: String,
        /// The first label without a name.
        first: u16,
    },
}

fn listed_values(values: &[u16]) -> String {
    let words: Vec<String> = values.iter().map(u16::to_string).collect();
    listed(&words, LISTED_MAX, ", ")
}

/// Name of the part of the file at `path` that holds the labels' names, for messages.
fn part(path: &Path) -> &'static str {
    let name = path.file_name().map(|name| name.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    if name.ends_with(".nrrd") || name.ends_with(".nhdr") {
        "the file's segments"
    } else {
        "the file's label extension"
    }
}

/// Finds the origin of the names of a map's labels. If the map's only label has no name, and the file is named after an
/// organ, the label gets that name.
///
/// # Errors
/// One label without a name in a file whose name is no organ's; a file's name that contradicts its labels.
pub fn name_labels(
    labels: &mut LabelMap,
    measures: &BTreeMap<(usize, u16), Measure>,
    names: &NameTable,
) -> Result<NamesFrom, NamingError> {
    let NameTable { table, called, is_chosen } = names;
    let has_voxels = |layer: usize, value: u16| measures.contains_key(&(layer, value));
    let present: Vec<usize> = (0..labels.segments.len())
        .filter(|&i| has_voxels(labels.segments[i].layer, labels.segments[i].value))
        .collect();
    let unnamed = |i: &&usize| {
        let segment = &labels.segments[**i];
        segment.name.is_none() && segment.terminology.is_none() && table.numbered_by_user(segment.value).is_none()
    };
    let unnamed: Vec<usize> = present.iter().filter(unnamed).copied().collect();
    let has_names =
        present.iter().any(|&i| labels.segments[i].name.is_some() || labels.segments[i].terminology.is_some());
    let mut numbers: Vec<u16> = unnamed.iter().map(|&i| labels.segments[i].value).collect();
    numbers.sort_unstable();
    let (part, path) = (part(&labels.path), &labels.path);
    if has_names {
        return Ok(match numbers.is_empty() {
            true => NamesFrom::File { part },
            false => NamesFrom::Both { part, numbers, table: called.clone(), is_chosen: *is_chosen },
        });
    }
    let by_table = NamesFrom::Numbers { table: called.clone(), is_chosen: *is_chosen };
    let in_name = organ_in_name(&stem(path), table, None);
    match (&unnamed[..], in_name) {
        ([], _) if present.is_empty() => Ok(by_table),
        ([], _) => Ok(NamesFrom::Maps),
        (&[only], OrganInName::Is(organ))
            if present.len() > 1 && table.named(&organ).is_some_and(|class| class.role == Role::Organ) =>
        {
            let value = labels.segments[only].value;
            if *is_chosen {
                Ok(by_table)
            } else {
                Err(NamingError::UnnamedAmongSeveral { path: path.clone(), organ, value })
            }
        }
        (&[only], OrganInName::Is(organ)) => {
            let value = labels.segments[only].value;
            if let Some(class) = table.numbered(value).filter(|class| *is_chosen && class.name != organ) {
                let (numbered, table) = (class.name.clone(), called.clone());
                return Err(NamingError::Contradiction { path: path.clone(), value, organ, numbered, table });
            }
            labels.segments[only].name = Some(organ.clone());
            Ok(NamesFrom::FileName { value, organ })
        }
        (&[only], in_name) if !is_chosen => {
            let segment = &labels.segments[only];
            let ml = measures.get(&(segment.layer, segment.value)).map_or(0.0, |measure| measure.volume_ml);
            let maybe = match in_name {
                OrganInName::Maybe(names) => names,
                _ => Vec::new(),
            };
            let example = maybe.first().cloned().unwrap_or_else(|| "liver".to_owned());
            let quoted: Vec<String> = maybe.iter().map(|name| format!("`{}`", printable(name))).collect();
            let maybe =
                if quoted.is_empty() { String::new() } else { format!(" for certain ({}?)", quoted.join(", ")) };
            Err(NamingError::SingleLabel { path: path.clone(), value: segment.value, ml, maybe, example })
        }
        (several, OrganInName::Is(organ))
            if several.len() > 1
                && !is_chosen
                && table.named(&organ).is_some_and(|class| class.role == Role::Organ) =>
        {
            let first = numbers.first().copied().unwrap_or(1);
            Err(NamingError::SeveralLabels { path: path.clone(), organ, values: listed_values(&numbers), first })
        }
        _ => Ok(by_table),
    }
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::super::measure::measure;
    use super::super::volume::Segment;
    use super::*;

    fn map(path: &str, labels: &[u16], named: &[(u16, &str)]) -> LabelMap {
        let segment = |value: u16, name: Option<&str>| Segment {
            layer: 0,
            value,
            name: name.map(str::to_owned),
            colour: None,
            terminology: None,
        };
        let mut segments: Vec<Segment> = named.iter().map(|(value, name)| segment(*value, Some(name))).collect();
        for &value in labels.iter().filter(|value| **value != 0) {
            if !segments.iter().any(|s| s.value == value) {
                segments.push(segment(value, None));
            }
        }
        let size = [labels.len(), 1, 1];
        LabelMap {
            path: path.into(),
            size,
            lps_from_voxel: DAffine3::IDENTITY,
            layers: vec![labels.to_vec()],
            segments,
            remarks: Vec::new(),
        }
    }

    fn named(map: &mut LabelMap, is_chosen: bool, maps: &[&str]) -> Result<NamesFrom, NamingError> {
        let mut table = ClassTable::builtin("total-v2").unwrap();
        maps.iter().for_each(|map| table.add(map).unwrap());
        let measures = measure(map);
        name_labels(map, &measures, &NameTable { table, called: "total-v2".into(), is_chosen })
    }

    #[test]
    fn a_lone_label_is_the_organ_of_its_files_name() {
        let mut mask = map("a/case01_liver.nii.gz", &[0, 1, 1], &[]);
        let from = named(&mut mask, false, &[]).unwrap();
        assert_eq!(from, NamesFrom::FileName { value: 1, organ: "liver".into() });
        assert_eq!(mask.segments[0].name.as_deref(), Some("liver"));
        assert!(from.to_string().contains("`liver` by the name of the file"), "{from}");
        // The file's name agrees with the number in the table.
        assert!(named(&mut map("spleen.nii", &[1], &[]), true, &[]).is_ok());
        let error = named(&mut map("liver.nii", &[1], &[]), true, &[]).unwrap_err().to_string();
        assert!(error.contains("is called `liver`") && error.contains("`spleen` by --names total-v2"), "{error}");
        assert_eq!(named(&mut map("liver.nii", &[1], &[]), true, &["1=liver"]), Ok(NamesFrom::Maps));
    }

    #[test]
    fn a_lone_label_in_another_file_is_refused_with_ways_out() {
        let error = named(&mut map("a.nii", &[0, 1], &[]), false, &[]).unwrap_err().to_string();
        for word in ["a.nii", "one label, 1", "--map 1=liver", "--names", "folder"] {
            assert!(error.contains(word), "{word}: {error}");
        }
        let error = named(&mut map("smith_spleen.nii", &[0, 7], &[]), false, &[]).unwrap_err().to_string();
        assert!(error.contains("for certain (`spleen`?)") && error.contains("--map 7=spleen"), "{error}");
        let chosen = NamesFrom::Numbers { table: "total-v2".into(), is_chosen: true };
        assert_eq!(named(&mut map("a.nii", &[1], &[]), true, &[]), Ok(chosen));
        assert_eq!(named(&mut map("a.nii", &[1, 2], &[]), false, &["1=liver", "2=ignore"]), Ok(NamesFrom::Maps));
        // A map that contains only background has its own error elsewhere.
        assert!(named(&mut map("a.nii", &[0, 0], &[]), false, &[]).is_ok());
    }

    #[test]
    fn several_labels_are_read_by_a_table_and_it_is_said() {
        let from = named(&mut map("a.nii", &[1, 2], &[]), false, &[]).unwrap();
        assert!(from.to_string().starts_with("numbers by total-v2: the file has no names"), "{from}");
        let from = named(&mut map("a.nrrd", &[1, 2], &[(1, "liver"), (2, "spleen")]), false, &[]).unwrap();
        assert_eq!(from.to_string(), "names from the file's segments");
        let from = named(&mut map("a.nii", &[1, 7, 2], &[(1, "liver"), (2, "spleen")]), false, &[]).unwrap();
        assert!(
            from.to_string().contains("extension; numbers without a name (7) by total-v2, which is a guess"),
            "{from}"
        );
        let from = named(&mut map("a.nii", &[1, 7], &[(1, "liver")]), true, &[]).unwrap();
        assert!(from.to_string().ends_with("numbers without a name (7) by total-v2, as --names says"), "{from}");
        let error = named(&mut map("liver.nii", &[1, 2], &[]), false, &[]).unwrap_err().to_string();
        assert!(error.contains("several labels without names (1, 2)") && error.contains("--map 1=liver"), "{error}");
        assert!(named(&mut map("liver.nii", &[1, 2], &[]), true, &[]).is_ok());
        let error = named(&mut map("liver_case.nii", &[1, 2], &[]), false, &["1=liver"]).unwrap_err().to_string();
        assert!(error.contains("label 2 is one of several") && error.contains("--map 2=ORGAN"), "{error}");
        let chosen = NamesFrom::Numbers { table: "total-v2".into(), is_chosen: true };
        assert_eq!(named(&mut map("liver_case.nii", &[1, 2], &[]), true, &["1=liver"]), Ok(chosen));
    }
}
