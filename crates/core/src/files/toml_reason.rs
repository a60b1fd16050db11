//! Messages about invalid TOML.

/// Message of a TOML error in `text`, with advice if a path in double quotes has backslashes.
pub fn toml_reason(text: &str, error: &toml::de::Error) -> String {
    let reason = error.to_string().trim().to_owned();
    let Some(line) = error.span().and_then(|span| line_at(text, span.start)) else { return reason };
    // A line within an array has no key.
    let (key, value) = line.split_once('=').filter(|(key, _)| !key.contains('"')).unwrap_or(("", line));
    let Some(text) = text_with_backslash(value) else { return reason };
    let is_whole = value.trim_start().strip_prefix('"').is_some_and(|rest| rest.starts_with(text));
    let key = key.trim();
    let advice = if is_whole && !key.is_empty() { backslashes(key, text) } else { other_quotes("", text) };
    format!("{reason}\n{advice}")
}

/// Advice about the key `key`, whose value `text` has backslashes within double quotes.
pub fn backslashes(key: &str, text: &str) -> String {
    other_quotes(&format!("{key} = "), text)
}

/// Advice about a text with backslashes within double quotes. `before` precedes the text in the corrected line.
fn other_quotes(before: &str, text: &str) -> String {
    let text: String = text.chars().take(80).collect();
    format!(
        "a backslash in double quotes begins an escape: write `{before}'{text}'` in single quotes, or `{before}\"{}\"` with \
         forward slashes",
        text.replace('\\', "/")
    )
}

fn line_at(text: &str, at: usize) -> Option<&str> {
    let start = text.get(..at)?.rfind('\n').map_or(0, |end| end + 1);
    text.get(start..)?.lines().next()
}

/// The first text within double quotes that has a backslash, before any comment; `None` if there is none. The next
/// quote ends the text, since paths contain no quotes.
fn text_with_backslash(value: &str) -> Option<&str> {
    let mut rest = value;
    loop {
        let start = rest.find(['"', '\'', '#'])?;
        let (quote, inside) = (rest[start..].chars().next()?, &rest[start + 1..]);
        if quote == '#' {
            return None;
        }
        let (text, after) = inside.split_once(quote).unwrap_or((inside.trim_end(), ""));
        if quote == '"' && text.contains('\\') {
            return Some(text);
        }
        rest = after;
    }
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
        let path = ("path = 'C:\\Users\\me\\belly.glb'", "path = \"C:/Users/me/belly.glb\"");
        let alone = ("'D:\\models\\a.onnx'", "\"D:/models/a.onnx\"");
        for (text, (single, forward)) in [
            ("path = \"C:\\Users\\me\\belly.glb\"", path),
            ("path = \"C:\\Users\\me\\belly.glb\" # the \"scene\"", path),
            ("path = \"C:\\Users\\me\\belly.glb", path),
            ("models = [\"D:\\models\\a.onnx\"]", alone),
            ("models = [\"a.onnx\", \"D:\\models\\a.onnx\", \"E:\\models\\b.onnx\"] # both", alone),
            ("models = [\n  \"D:\\models\\a.onnx\",\n]", alone),
            ("model = { path = \"D:\\models\\a.onnx\" }", alone),
        ] {
            let found = reason(text);
            let advice = found.lines().last().unwrap();
            let expected = format!(
                "a backslash in double quotes begins an escape: write `{single}` in single quotes, or `{forward}` with forward slashes"
            );
            assert_eq!(advice, expected, "{text}");
        }
        for text in ["[scene\npath = \"a\\\\b\"", "a = 'C:\\x' 3", "a = \"b\" 3 # \"C:\\x\""] {
            assert!(!reason(text).contains("single quotes"), "{text}");
        }
    }
}
