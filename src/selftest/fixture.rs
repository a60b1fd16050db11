//! Fixtures of `tests/truth/`, to which the checks' constants are held.

/// Value in column `wanted` of the row of a fixture whose columns hold the given numbers.
pub(super) fn fixture(text: &str, row: &[(&str, f64)], wanted: &str) -> f64 {
    let mut lines = text.lines().filter(|line| !line.starts_with('#')).map(|line| line.split(',').collect::<Vec<_>>());
    let head = lines.next().unwrap();
    let column = |name: &str| head.iter().position(|column| *column == name).unwrap();
    let number = |line: &[&str], name: &str| line[column(name)].parse::<f64>().unwrap();
    let found = lines.find(|line| row.iter().all(|&(name, value)| number(line, name) == value)).unwrap();
    number(&found, wanted)
}
