//! Size of the tracked files.

use std::path::Path;
use std::process::Command;

/// Largest size of a file without a stated reason, bytes.
pub(crate) const LARGEST: u64 = 1_000_000;

/// Files that may be larger, each with the reason.
pub(crate) const LISTED: [(&str, &str); 8] = [
    ("assets/generators/beam_m_rolling/beam_m_rolling.onnx", "the generator of live stations, part of the program"),
    ("assets/generators/beam_msa/beam_msa.onnx", "a shipped generator: its network has half a million weights"),
    ("assets/generators/fast_m/fast_m.onnx", "a shipped generator: its network has half a million weights"),
    ("assets/generators/fast_ms/fast_ms.onnx", "a shipped generator: its network has half a million weights"),
    ("assets/generators/fast_msa/fast_msa.onnx", "a shipped generator: its network has half a million weights"),
    ("docs/generators/best.png", "compares pictures grain by grain, without loss"),
    ("docs/generators/median.png", "compares pictures grain by grain, without loss"),
    ("docs/images/live.webp", "the README's film of a live station"),
];

/// Tracked files below `root`, with their sizes in bytes. Files whose deletion is not yet committed are left out.
pub(crate) fn tracked(root: &Path) -> std::io::Result<Vec<(String, u64)>> {
    let listed = Command::new("git").arg("-C").arg(root).args(["ls-files", "-z"]).output()?;
    let names = String::from_utf8_lossy(&listed.stdout).into_owned();
    let names = names.split('\0').filter(|name| !name.is_empty());
    Ok(names.filter_map(|name| Some((name.to_owned(), root.join(name).metadata().ok()?.len()))).collect())
}

/// Messages on files that are too large, and on unneeded entries of `listed`.
pub(crate) fn faults(files: &[(String, u64)], listed: &[(&str, &str)]) -> Vec<String> {
    let is_large = |name: &str| files.iter().any(|(file, bytes)| file == name && *bytes > LARGEST);
    let heavy = files.iter().filter(|(name, bytes)| *bytes > LARGEST && !listed.iter().any(|(known, _)| known == name));
    let heavy = heavy.map(|(name, bytes)| {
        format!("{name} has {bytes} bytes: make it smaller than {LARGEST}, or list it in tests/repository/documents/weight.rs with a reason")
    });
    let needless = listed.iter().filter(|(name, reason)| !is_large(name) || reason.is_empty());
    let needless =
        needless.map(|(name, _)| format!("{name} is listed in tests/repository/documents/weight.rs without a need"));
    heavy.chain(needless).collect()
}
