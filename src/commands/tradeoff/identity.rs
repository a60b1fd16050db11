//! Identity of a run's frames, as text for the names of kept points.

use std::fmt::{self, Write};

use insonify::anatomy::Scene;
use insonify::station::Station;
use sha2::{Digest, Sha256};

/// Feeds text to a hash.
struct Sum(Sha256);

impl Write for Sum {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0.update(text.as_bytes());
        Ok(())
    }
}

/// Station without knobs and poses; the scene by its content, not its path.
pub(super) fn of(station: &Station, scene: &Scene) -> String {
    let mut sum = Sum(Sha256::new());
    // A hash takes all.
    let _ = write!(sum, "{scene:?}");
    let sum: String = sum.0.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
    let Station { background, motion, probe, settings, generator, tissues, .. } = station;
    format!("{sum} {background} {motion} {probe:?} {settings:?} {generator:?} {tissues:?}")
}

/// The processor's name, where the system tells it in `/proc/cpuinfo`; else its architecture.
pub(super) fn processor() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let line = text.lines().find(|line| line.starts_with("model name"));
    let name = line.and_then(|line| line.split_once(':')).map(|(_, name)| name.trim().to_owned());
    name.unwrap_or_else(|| std::env::consts::ARCH.to_owned())
}
