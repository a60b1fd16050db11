//! Messages about TOML that cannot be parsed.

/// Message of a TOML error in `text`, with the way out where a path has backslashes in double quotes.
pub fn toml_reason(text: &str, error: &toml::de::Error) -> String {
    let reason = error.to_string().trim().to_owned();
    let Some(line) = error.span().and_then(|span| line_at(text, span.start)) else { return reason };
    let Some((key, value)) = line.split_once('=').filter(|(_, value)| is_quoted_with_backslash(value)) else {
        return reason;
    };
    let key = key.trim();
    format!("{reason}\n{}", backslashes(if key.is_empty() { "the path" } else { key }, value.trim().trim_matches('"')))
}

/// Advice about a text with backslashes in double quotes: what `key` should be.
pub fn backslashes(key: &str, text: &str) -> String {
    let text: String = text.chars().take(80).collect();
    format!(
        "a backslash in double quotes begins an escape: write `{key} = '{text}'` in single quotes, or `{key} = \"{}\"` with forward slashes",
        text.replace('\\', "/")
    )
}

fn line_at(text: &str, at: usize) -> Option<&str> {
    let start = text.get(..at)?.rfind('\n').map_or(0, |end| end + 1);
    text.get(start..)?.lines().next()
}

fn is_quoted_with_backslash(value: &str) -> bool {
    value.trim_start().starts_with(['"', '[']) && value.contains('"') && value.contains('\\')
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reason(text: &str) -> String {
        toml_reason(text, &text.parse::<toml::Table>().unwrap_err())
    }

    #[test]
    fn backslashes_in_double_quotes_are_explained() {
        let found = reason("[scene]\npath = \"C:\\Users\\me\\belly.glb\"\n");
        assert!(found.starts_with("TOML parse error at line 2"), "{found}");
        assert!(found.ends_with(
            "write `path = 'C:\\Users\\me\\belly.glb'` in single quotes, or `path = \"C:/Users/me/belly.glb\"` with forward slashes"
        ), "{found}");
        assert!(reason("models = [\"D:\\models\\a.onnx\"]").contains("single quotes"));
        assert!(!reason("[scene\npath = \"a\\\\b\"").contains("single quotes"));
        assert!(!reason("a = 'C:\\x' 3").contains("single quotes"));
    }
}
