//! Poses of a sensor from a recording or a table.

use std::path::Path;

use insonify::files::FileKind;
use insonify::pose::{Pose, csv};
use insonify::recording;

use super::super::{Classify, Failure, input};

/// First bytes of a recording in the MCAP format.
const MCAP_MAGIC: &[u8] = b"\x89MCAP";

/// Reads the poses `tracker_from_sensor` from a recording (.mcap) or a table.
pub(super) fn read(path: &Path) -> Result<Vec<Pose>, Failure> {
    if input::starts_with(path, MCAP_MAGIC, "the poses")? {
        let (poses, summary) = recording::poses(path)?;
        summary.warn_of_damage(path);
        return Ok(poses.into_iter().map(|p| p.pose).collect());
    }
    let found = csv::poses(&input::text(path, FileKind::Table, "the poses")?).input_of(path)?;
    found.notes.iter().for_each(|note| tracing::warn!("{}: {note}", path.display()));
    Ok(found.values)
}
