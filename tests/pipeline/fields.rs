//! `docs/metrics.md` explains exactly the fields that a session writes.

use std::collections::BTreeSet;

use insonify::pipeline::WithStandingNeedle;

use super::*;

/// Names in the first column of the table below a heading of that document.
fn documented(heading: &str) -> BTreeSet<String> {
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/metrics.md")).unwrap();
    let section = text.split(&format!("## {heading}\n")).nth(1).unwrap().split("\n## ").next().unwrap();
    let cells = section.lines().filter(|line| line.starts_with("| `")).map(|line| line.split('|').nth(1).unwrap());
    cells.flat_map(|cell| cell.split(',')).map(|name| name.trim().trim_matches('`').to_owned()).collect()
}

fn keys(value: &Value) -> BTreeSet<String> {
    value.as_object().unwrap().keys().cloned().collect()
}

#[test]
fn the_documented_fields_are_those_that_are_written() {
    let _guard = beside_others();
    let clock = clock();
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("frames.jsonl");
    // With a controller of operating points a line has its point.
    let (generators, points) = (Some(generator(&clock, 10 * MS)), Some(with_generator()));
    let log = Some(FrameLog::create(&path).unwrap());
    // With a needle it has the needle, too.
    let needle = Some(Needle { scene_from_needle: pose(7.0), bevel_known: true });
    let poses = Box::new(WithStandingNeedle { poses: Poses(moving), needle });
    let summary = Session { poses, generators, points, log, ..Session::new(&clock, moving) }.run();
    let text = std::fs::read_to_string(&path).unwrap();
    let lines: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(!lines.is_empty());
    // Only a picture's line has its file (`program.rs`).
    let file = BTreeSet::from(["file".to_owned()]);
    for line in &lines {
        assert_eq!(keys(line).union(&file).cloned().collect::<BTreeSet<_>>(), documented("Lines of frames"));
    }
    assert_eq!(keys(&serde_json::to_value(&summary).unwrap()), documented("Line of the summary"));
}
