//! The host's processor, by name.

use insonify_core::instructions::Instructions;

/// Name of the processor from `/proc/cpuinfo`; without one, its architecture.
pub fn processor_name() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let line = text.lines().find(|line| line.starts_with("model name"));
    let name = line.and_then(|line| line.split_once(':')).map(|(_, name)| name.trim().to_owned());
    name.unwrap_or_else(|| std::env::consts::ARCH.to_owned())
}

/// Threads and widest instruction set of the host renderer.
pub(crate) fn description() -> String {
    let threads = rayon::current_num_threads();
    let plural = if threads == 1 { "" } else { "s" };
    format!("insonify host, {threads} thread{plural}, {}", instructions())
}

fn instructions() -> &'static str {
    match Instructions::widest() {
        Instructions::Portable => std::env::consts::ARCH,
        wider => wider.name(),
    }
}
