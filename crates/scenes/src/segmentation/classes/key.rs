//! Comparison of anatomical names as different tools write them.

/// Words that are ignored in comparisons, as in "Structure of liver".
const FILLERS: [&str; 5] = ["structure", "of", "the", "and", "entire"];

/// Ordinals, from the first.
const ORDINALS: [&str; 12] = [
    "first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth", "tenth", "eleventh",
    "twelfth",
];

/// Key for comparing names: names of the same meaning have the same key. It consists of the words in alphabetical
/// order, without case, punctuation, plural and fillers.
///
/// `kidney_right`, `Right kidney`, `kidneyRight`, `Kidney, R` and `Structure of right kidney` have one key.
pub(super) fn key(name: &str) -> String {
    let mut words: Vec<String> = words(name).into_iter().filter_map(|word| canonical(&word)).collect();
    words.sort_unstable();
    words.dedup();
    words.join(" ")
}

/// Words of a name, in lower case: runs of letters and digits. An upper-case letter after a lower-case one starts a new
/// word.
pub(super) fn words(name: &str) -> Vec<String> {
    let (mut words, mut word, mut after_lower) = (Vec::new(), String::new(), false);
    for c in name.chars() {
        if !c.is_alphanumeric() || (c.is_uppercase() && after_lower) {
            words.push(std::mem::take(&mut word));
        }
        if c.is_alphanumeric() {
            word.extend(c.to_lowercase());
        }
        after_lower = c.is_lowercase();
    }
    words.push(word);
    words.retain(|word| !word.is_empty());
    words
}

fn canonical(word: &str) -> Option<String> {
    if FILLERS.contains(&word) {
        return None;
    }
    if let Some(number) = ORDINALS.iter().position(|ordinal| *ordinal == word) {
        return Some((number + 1).to_string());
    }
    let known = match word {
        "r" | "rt" => "right",
        "l" | "lt" => "left",
        "vertebrae" => "vertebra",
        _ => word,
    };
    let digits = known.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    if !digits.is_empty() && matches!(&known[digits.len()..], "st" | "nd" | "rd" | "th") {
        return Some(digits.to_owned());
    }
    // Plurals in -s. A singular such as pancreas loses its -s, too, but does so in both names that are compared.
    let singular = known.strip_suffix('s').filter(|rest| rest.len() >= 3 && !rest.ends_with(['s', 'u', 'i']));
    Some(singular.unwrap_or(known).to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spellings_of_one_name_have_one_key() {
        for name in [
            "kidney_right",
            "Right kidney",
            "RIGHT-KIDNEY",
            "kidneyRight",
            "Kidney, Right",
            "Kidney R",
            "Structure of right kidney",
            " kidneys (right) ",
        ] {
            assert_eq!(key(name), "kidney right", "{name}");
        }
        assert_eq!(key("First rib, Left"), key("rib_left_1"));
        assert_eq!(key("left 1st rib"), key("rib_left_1"));
        assert_eq!(key("T12 vertebra"), key("vertebrae_T12"));
        assert_eq!(key("lungs"), key("lung"));
    }

    #[test]
    fn different_names_have_different_keys() {
        assert_ne!(key("kidney_right"), key("kidney_left"));
        assert_ne!(key("rib_left_1"), key("rib_left_11"));
        assert_ne!(key("Segment_1"), key("Segment_2"));
        assert_eq!(key(" -_ "), "");
        assert_eq!(key("gluteus"), "gluteus");
        assert_eq!(key("肝臓"), "肝臓");
    }
}
