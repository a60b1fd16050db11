//! Identity of a run's frames, hashed into the names of stored points.

use std::fmt::{self, Write};

use sha2::{Digest, Sha256};

use crate::anatomy::Scene;
use crate::files::hex;
use crate::station::Station;

/// Feeds text to a hash.
struct Sum(Sha256);

impl Write for Sum {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0.update(text.as_bytes());
        Ok(())
    }
}

/// Station without knobs and poses; the scene by its content, not its path.
pub(crate) fn of(station: &Station, scene: &Scene) -> String {
    let mut sum = Sum(Sha256::new());
    // Writing to a hash cannot fail.
    let _ = write!(sum, "{scene:?}");
    let sum = hex(&sum.0.finalize());
    let Station { background, motion, probe, settings, generator, tissues, .. } = station;
    format!("{sum} {background} {motion} {probe:?} {settings:?} {generator:?} {tissues:?}")
}
