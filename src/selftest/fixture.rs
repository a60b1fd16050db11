//! Expected values of checks, from the tables of `tests/truth/`.

/// Value in column `wanted` of the row whose first columns are `key`. NaN if there is none, so that every check with it
/// fails.
pub(super) fn fixture(table: &str, key: &str, wanted: &str) -> f64 {
    let mut lines = table.lines().filter(|line| !line.starts_with('#'));
    let column = lines.next().and_then(|head| head.split(',').position(|column| column == wanted));
    let begins = |line: &&str| line.strip_prefix(key).is_some_and(|rest| rest.starts_with(','));
    let text = lines.find(begins).zip(column).and_then(|(line, column)| line.split(',').nth(column));
    // Adding 0 turns −0 into 0.
    text.and_then(|text| text.parse().ok()).map_or(f64::NAN, |value: f64| value + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_found_by_the_first_columns_and_its_name() {
        let table = "# A comment.\nkind,mm,db\na,1.5,-2.50\na,15,1\nb,1,-0.00\n";
        assert_eq!(fixture(table, "a,1.5", "db"), -2.5);
        assert!(fixture(table, "b,1", "db").is_sign_positive());
        for (key, wanted) in [("c,1.5", "db"), ("a,1", "db"), ("a,1.5", "dB"), ("a", "kind")] {
            assert!(fixture(table, key, wanted).is_nan(), "{key} {wanted}");
        }
    }
}
