//! Nearest known names, for error messages.

/// Question to append to an error: ` (did you mean `x`?)`, with the known name nearest to `name`; empty if none is
/// near.
pub fn did_you_mean<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let lower = name.to_lowercase();
    known
        .into_iter()
        .map(|k| (strsim::jaro_winkler(&lower, k), k))
        .filter(|(similarity, _)| *similarity > 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map_or_else(String::new, |(_, k)| format!(" (did you mean `{k}`?)"))
}

#[cfg(test)]
mod tests {
    use super::did_you_mean;

    #[test]
    fn near_names_are_suggested_and_far_ones_are_not() {
        assert_eq!(did_you_mean("Livr", ["kidney", "liver"]), " (did you mean `liver`?)");
        assert_eq!(did_you_mean("xyzzy", ["kidney", "liver"]), "");
        assert_eq!(did_you_mean("", ["kidney"]), "");
    }
}
