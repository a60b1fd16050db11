//! Organs in the names of files, for tools that write one mask per organ.

use std::path::Path;

use super::ClassTable;
use super::key::words;

/// Suffixes of the files from which volumes are read, longest first.
pub const VOLUME_SUFFIXES: [&str; 7] = [".seg.nrrd", ".nii.gz", ".hdr.gz", ".nrrd", ".nhdr", ".nii", ".hdr"];

/// Suffix of a file of voxels whose header is in another file.
const VOXELS_SUFFIX: &str = ".img.gz";

/// Words that say nothing about the organ.
const NEUTRAL: [&str; 34] = [
    "mask",
    "masks",
    "seg",
    "segs",
    "segmentation",
    "segmentations",
    "label",
    "labels",
    "labelmap",
    "roi",
    "gt",
    "ground",
    "truth",
    "groundtruth",
    "manual",
    "auto",
    "pred",
    "prediction",
    "predicted",
    "output",
    "out",
    "result",
    "final",
    "binary",
    "ct",
    "cta",
    "mr",
    "mri",
    "totalsegmentator",
    "total",
    "ts",
    "nnunet",
    "resampled",
    "cropped",
];

/// Words that precede the number of a patient or scan.
const NUMBERED: [&str; 17] = [
    "case", "pat", "patient", "sub", "subject", "study", "series", "ses", "scan", "exam", "vol", "volume", "img",
    "image", "id", "no", "bdmap",
];

/// Words that change the meaning of an organ's name. They are never left out, even if all file names share them.
const MEANING: [&str; 55] = [
    "tumor",
    "tumors",
    "tumour",
    "tumours",
    "lesion",
    "lesions",
    "cancer",
    "cyst",
    "cysts",
    "vessel",
    "vessels",
    "vein",
    "veins",
    "artery",
    "arteries",
    "wall",
    "fat",
    "stone",
    "stones",
    "segment",
    "lobe",
    "left",
    "right",
    "abscess",
    "metastasis",
    "metastases",
    "nodule",
    "nodules",
    "mass",
    "masses",
    "edema",
    "oedema",
    "hematoma",
    "haematoma",
    "necrosis",
    "calcification",
    "calcifications",
    "thrombus",
    "lumen",
    "cortex",
    "medulla",
    "contour",
    "edge",
    "boundary",
    "margin",
    "gtv",
    "ctv",
    "ptv",
    "upper",
    "lower",
    "middle",
    "anterior",
    "posterior",
    "proximal",
    "distal",
];

/// Organ that a file's name stands for.
#[derive(Debug, Clone, PartialEq)]
pub enum OrganInName {
    /// Name of the organ's class; the other words of the file's name say nothing about organs.
    Is(String),
    /// Names of the classes that the file's name may mean.
    Maybe(Vec<String>),
    /// No organ.
    No,
}

/// Name of a volume file without its folder and suffixes.
pub fn stem(path: &Path) -> String {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let lower = name.to_ascii_lowercase();
    let mut suffixes = VOLUME_SUFFIXES.into_iter().chain([VOXELS_SUFFIX]);
    let suffix = suffixes.find(|suffix| lower.ends_with(suffix) && lower.len() > suffix.len());
    suffix.map_or(name.clone(), |suffix| name[..name.len() - suffix.len()].to_owned())
}

/// Words, in lower case, that the names of all files of a folder share.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct CommonWords {
    /// Words at the start of each name.
    pub start: Vec<String>,
    /// Words at the end of each name.
    pub end: Vec<String>,
}

/// Words that all names share at their start and at their end. The search stops at words that change the meaning of an
/// organ's name.
pub fn common_words(stems: &[String]) -> CommonWords {
    let all: Vec<Vec<String>> = stems.iter().map(|stem| words(stem)).collect();
    let [first, _, ..] = &all[..] else { return CommonWords::default() };
    let shortest = all.iter().map(Vec::len).min().unwrap_or(0);
    let may_go = |word: &String| !MEANING.contains(&word.as_str());
    let at_start = (0..shortest).take_while(|&n| may_go(&first[n]) && all.iter().all(|w| w[n] == first[n])).count();
    let last = |words: &Vec<String>, n: usize| words.len().checked_sub(n + 1).map(|at| words[at].clone());
    let is_last = |n: &usize| {
        let word = last(first, *n);
        word.as_ref().is_some_and(may_go) && all.iter().all(|words| last(words, *n) == word)
    };
    let at_end = (0..shortest).take_while(is_last).count();
    // Each name keeps at least one word.
    if at_start + at_end >= shortest {
        return CommonWords::default();
    }
    CommonWords { start: first[..at_start].to_vec(), end: first[first.len() - at_end..].to_vec() }
}

/// Organ that the file name `stem`, without suffixes, stands for. `common` are the words that the names of all files of
/// its folder share; `None` for a lone file.
pub fn organ_in_name(stem: &str, table: &ClassTable, common: Option<&CommonWords>) -> OrganInName {
    let words = words(stem);
    if let (Some(class), Some(_)) = (table.named(stem), common) {
        return OrganInName::Is(class.name.clone());
    }
    let found = organ_in(&words, table);
    match (found, common.map(|common| [common.start.len(), common.end.len()])) {
        (OrganInName::Is(name), _) => OrganInName::Is(name),
        (_, Some([start, end])) if start + end > 0 && start + end < words.len() => {
            organ_in(&words[start..words.len() - end], table)
        }
        (found, _) => found,
    }
}

fn organ_in(words: &[String], table: &ClassTable) -> OrganInName {
    // The longest run of words that is the name of a class counts.
    for length in (1..=words.len()).rev() {
        let runs = words.windows(length).enumerate();
        let named: Vec<(usize, &str)> = runs
            .filter(|(_, run)| run.iter().any(|word| is_telling(word)))
            .filter_map(|(at, run)| Some((at, table.named(&run.join("_"))?.name.as_str())))
            .collect();
        let [(at, name), others @ ..] = &named[..] else { continue };
        let mut rest = words[..*at].iter().chain(&words[at + length..]);
        if others.is_empty() && rest.all(|word| is_neutral(word)) {
            return OrganInName::Is((*name).to_owned());
        }
        return OrganInName::Maybe(named.iter().map(|(_, name)| (*name).to_owned()).collect());
    }
    OrganInName::No
}

/// Whether a word may name an organ. Short words don't count: `T1` and `S1` also number patients and scans.
fn is_telling(word: &str) -> bool {
    word.len() >= 3 && word.chars().all(char::is_alphabetic)
}

fn is_neutral(word: &str) -> bool {
    let letters = word.trim_matches(|c: char| c.is_ascii_digit());
    let has_digits = letters.len() < word.len();
    let numbers = has_digits && (letters.len() < 2 || NUMBERED.contains(&letters));
    numbers || NEUTRAL.contains(&word) || NUMBERED.contains(&word)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lone(name: &str) -> OrganInName {
        let table = ClassTable::builtin("total-v2").unwrap();
        organ_in_name(&stem(Path::new(name)), &table, None)
    }

    #[test]
    fn files_are_organs_if_all_their_words_say_so() {
        let is = |name: &str| OrganInName::Is(name.to_owned());
        for (file, class) in [
            ("liver.nii.gz", "liver"),
            ("a/b/Kidney Left.nrrd", "kidney_left"),
            ("case01_liver.nii.gz", "liver"),
            ("case_01_liver_mask.nii", "liver"),
            ("s0011_kidney_left.nii.gz", "kidney_left"),
            ("kidney_r.seg.nrrd", "kidney_right"),
            ("CT-0012-vertebrae_L1-seg.nii.gz", "vertebrae_L1"),
            ("IVC.nii.gz", "inferior_vena_cava"),
            ("rib_left_11.nii.gz", "rib_left_11"),
        ] {
            assert_eq!(lone(file), is(class), "{file}");
        }
    }

    #[test]
    fn other_words_make_a_name_a_guess_or_nothing() {
        let maybe = |names: &[&str]| OrganInName::Maybe(names.iter().map(|n| (*n).to_owned()).collect());
        for (file, names) in [
            ("liver_metastasis.nii.gz", &["liver"][..]),
            ("smith_liver.nii.gz", &["liver"]),
            ("liver_segment_4.nii.gz", &["liver"]),
            ("liver_seg4.nii.gz", &["liver"]),
            ("liver_spleen.nii.gz", &["liver", "spleen"]),
            ("right_of_the_stomach.nii.gz", &["stomach"]),
        ] {
            assert_eq!(lone(file), maybe(names), "{file}");
        }
        for file in ["T1.nii.gz", "S1.nii.gz", "s_1.nii", "labels.nii.gz", "total.nii.gz", ".nii.gz", "001.nrrd"] {
            assert_eq!(lone(file), OrganInName::No, "{file}");
        }
    }

    #[test]
    fn words_that_all_files_share_are_left_out_unless_they_mean_something() {
        let table = ClassTable::builtin("total-v2").unwrap();
        let of = |stems: &[&str]| -> Vec<OrganInName> {
            let stems: Vec<String> = stems.iter().map(|s| (*s).to_owned()).collect();
            let common = common_words(&stems);
            stems.iter().map(|stem| organ_in_name(stem, &table, Some(&common))).collect()
        };
        let is = |name: &str| OrganInName::Is(name.to_owned());
        assert_eq!(of(&["smith_liver_new", "smith_spleen_new"]), [is("liver"), is("spleen")]);
        assert_eq!(of(&["kidney_left", "kidney_right"]), [is("kidney_left"), is("kidney_right")]);
        assert_eq!(of(&["L1", "L2"]), [is("vertebrae_L1"), is("vertebrae_L2")]);
        assert_eq!(of(&["caseLiver", "caseSpleen"]), [is("liver"), is("spleen")]);
        for names in [
            ["lesion_stomach", "lesion_spleen"],
            ["spleen_metastasis", "pancreas_metastasis"],
            ["liver_edge_case1", "spleen_edge_case1"],
            ["upper_liver", "upper_spleen"],
        ] {
            assert!(!of(&names).iter().any(|found| matches!(found, OrganInName::Is(_))), "{names:?}");
        }
        let stems = ["Dr_SmithLiver_new", "Dr_SmithSpleen_new"].map(str::to_owned);
        let owned = |words: &[&str]| words.iter().map(|word| (*word).to_owned()).collect::<Vec<_>>();
        assert_eq!(common_words(&stems), CommonWords { start: owned(&["dr", "smith"]), end: owned(&["new"]) });
    }
}
