//! Lines of a table: separators, quotes and numbers.

use super::{Column, TableFault};

/// Words by which programs mark a missing number.
const NO_NUMBER: [&str; 11] =
    ["", "nan", "-nan", "nan(ind)", "-nan(ind)", "1.#qnan", "-1.#ind", "na", "n/a", "#n/a", "null"];

/// Separator of the fields of `line`: a tab or `;` that occurs at least twice, else `,`.
pub(super) fn separator(line: &str) -> char {
    let several = |c: char| line.matches(c).count() >= 2;
    ['\t', ';'].into_iter().find(|c| several(*c)).unwrap_or(',')
}

/// Fields of a line, without the quotes around them. A doubled quote within quotes is one quote.
pub(super) fn split(line: &str, separator: char) -> Result<Vec<String>, TableFault> {
    let mut fields = Vec::new();
    let mut rest = line;
    loop {
        let trimmed = rest.trim_start_matches(' ');
        let (field, after) = match trimmed.strip_prefix('"') {
            Some(quoted) => unquoted(quoted, separator)?,
            None => match rest.split_once(separator) {
                Some((field, after)) => (field.trim().to_owned(), Some(after)),
                None => (rest.trim().to_owned(), None),
            },
        };
        fields.push(field);
        match after {
            Some(after) => rest = after,
            None => return Ok(fields),
        }
    }
}

/// Content of a quoted field and the text after the separator that follows; `None` at the end of the line. `text`
/// starts after the field's opening quote.
fn unquoted(text: &str, separator: char) -> Result<(String, Option<&str>), TableFault> {
    let mut field = String::new();
    let mut chars = text.char_indices().peekable();
    while let Some((at, c)) = chars.next() {
        if c != '"' {
            field.push(c);
            continue;
        }
        if chars.next_if(|(_, next)| *next == '"').is_some() {
            field.push('"');
            continue;
        }
        let behind = text.get(at + 1..).unwrap_or_default();
        return match behind.split_once(separator) {
            Some((space, after)) if space.trim().is_empty() => Ok((field.trim().to_owned(), Some(after))),
            None if behind.trim().is_empty() => Ok((field.trim().to_owned(), None)),
            _ => Err(TableFault::Quote),
        };
    }
    Err(TableFault::Quote)
}

/// Whether a field is a number or resembles one, including numbers with a decimal comma.
pub(super) fn looks_numeric(field: &str) -> bool {
    let field = field.trim();
    let like = |c: char| c.is_ascii_digit() || "+-.,eE".contains(c);
    field.parse::<f64>().is_ok() || (field.contains(|c: char| c.is_ascii_digit()) && field.chars().all(like))
}

/// Whether a field is several fields separated by spaces: at least three numbers or column names.
pub(super) fn has_spaced_fields(field: &str) -> bool {
    let words: Vec<&str> = field.split_whitespace().collect();
    let known = words.iter().filter(|word| looks_numeric(word) || Column::of(word).is_known()).count();
    known >= 3 && 2 * known >= words.len()
}

/// Whether a field marks a missing number: it is empty, NaN or a program's word for it.
pub fn is_absent(field: &str) -> bool {
    let lower = field.trim().to_ascii_lowercase();
    NO_NUMBER.contains(&lower.as_str())
}

/// Parses the number in a field of the column `column`. NaN and infinity are accepted.
pub fn number(column: &str, field: &str) -> Result<f64, TableFault> {
    let field = field.trim();
    field.parse().map_err(|_| {
        let point = field.replace(',', ".");
        let hint = if field.matches(',').count() == 1 && point.parse::<f64>().is_ok() {
            format!(" with a decimal point instead of the decimal comma: {point}")
        } else if field.contains(',') {
            " with a decimal point and without separators of thousands".to_owned()
        } else if field.starts_with(|c: char| c.is_ascii_digit()) && field.ends_with(char::is_alphabetic) {
            "; a unit belongs into the column's name, as `x_mm` or `x_m`".to_owned()
        } else {
            String::new()
        };
        TableFault::Number { column: column.to_owned(), found: quote(field), hint }
    })
}

/// Parses the finite number in a field of the column `column`.
pub fn finite(column: &str, field: &str) -> Result<f64, TableFault> {
    let found = number(column, field)?;
    if found.is_finite() {
        return Ok(found);
    }
    let hint = " that is finite".to_owned();
    Err(TableFault::Number { column: column.to_owned(), found: quote(field), hint })
}

/// At most 32 characters of `text`, escaped and quoted, for an error message.
pub fn quote(text: &str) -> String {
    let short: String = text.chars().take(32).collect();
    let more = if short.len() < text.len() { "..." } else { "" };
    format!("`{}{more}`", short.escape_debug())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_split_at_their_separator() {
        assert_eq!(
            [separator("x,y,z"), separator("x;y;z"), separator("x\ty\tz"), separator("1,2,a;b")],
            [',', ';', '\t', ',']
        );
        let fields = |line: &str| split(line, ',').unwrap();
        assert_eq!(fields(r#" 1 ,"a, b" , "say ""hi""",,"#), ["1", "a, b", "say \"hi\"", "", ""]);
        assert_eq!(fields("").len(), 1);
        assert_eq!(split("1;2,5;é", ';').unwrap(), ["1", "2,5", "é"]);
        for wrong in [r#"1,"a"#, r#"1,"a"b,2"#] {
            assert_eq!(split(wrong, ','), Err(TableFault::Quote), "{wrong}");
        }
    }

    #[test]
    fn numbers_are_parsed_or_refused_with_the_way_out() {
        assert_eq!(number("x", " -2.5e1 "), Ok(-25.0));
        let message = |field: &str| number("x_mm", field).unwrap_err().to_string();
        assert_eq!(
            message("1,5"),
            "`x_mm` is `1,5`; it must be a decimal number with a decimal point instead of the decimal comma: 1.5"
        );
        assert!(message("1,234.5").contains("without separators of thousands"));
        assert!(message("12 mm").contains("belongs into the column's name"));
        assert_eq!(message("left"), "`x_mm` is `left`; it must be a decimal number");
        assert!(number("x", "nan").unwrap().is_nan());
        let refused = finite("x", "-inf").unwrap_err().to_string();
        assert_eq!(refused, "`x` is `-inf`; it must be a decimal number that is finite");
        assert_eq!((finite("x", "1e3"), finite("x", "nan").is_err()), (Ok(1000.0), true));
        assert!(["", " NaN", "-nan(ind)", "N/A"].into_iter().all(is_absent) && !is_absent("0"));
        assert!(["1", "-1,5", "nan", "1e3", ",5"].into_iter().all(looks_numeric));
        assert!(["1 2 3", "x y z name", "1,5 2 3 left side"].into_iter().all(has_spaced_fields));
        assert!(["x", "1 2", "landmarks of the belly"].into_iter().all(|field| !has_spaced_fields(field)));
        assert!(["", "x", "e", "q0", "1st", "-"].into_iter().all(|field| !looks_numeric(field)));
    }
}
