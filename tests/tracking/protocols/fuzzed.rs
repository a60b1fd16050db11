//! Tests with the kept inputs and seeds of fuzzing: `tests/fuzzed/TARGET/*`.

use std::path::Path;

#[allow(dead_code, unreachable_pub)]
#[path = "../../../fuzz/bodies.rs"]
mod bodies;

#[test]
fn kept_inputs_keep_their_promises() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzzed");
    let mut kept = 0;
    for target in bodies::TARGETS {
        for seed in (target.seeds)() {
            (target.body)(&seed);
        }
        for entry in std::fs::read_dir(folder.join(target.name)).into_iter().flatten() {
            let path = entry.unwrap().path();
            println!("{}", path.display());
            (target.body)(&std::fs::read(&path).unwrap());
            kept += 1;
        }
    }
    assert!(kept >= 20, "{kept} inputs in {}", folder.display());
}
