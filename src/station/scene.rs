//! `[scene]`: source of the surfaces that are scanned.

use std::path::Path;

use super::keys::of_table;
use super::values::Values;
use super::{SceneSource, StationError};
use crate::phantom::PhantomOptions;
use crate::settings::SceneSettings;

pub(super) fn source(values: &Values, dir: &Path) -> Result<SceneSource, StationError> {
    match (values.text("path"), values.text("phantom")) {
        (Some(_), Some(_)) => Err(StationError::NotApplicable {
            key: "scene.phantom".to_owned(),
            reason: "`scene.path` is given, too; give one of the two".to_owned(),
        }),
        (Some(path), None) => {
            values.refuse(&["phantom_scale"], "it scales a generated phantom; `scene.path` names a file")?;
            let of_phantom: Vec<_> =
                of_table("scene").map(|doc| doc.key).filter(|key| key.starts_with("phantom_")).collect();
            values.refuse(&of_phantom, "it describes a generated phantom; `scene.path` names a file")?;
            Ok(SceneSource::File(dir.join(path)))
        }
        (None, Some(_)) => Ok(SceneSource::ObstetricPhantom(phantom(values))),
        (None, None) => Err(StationError::Missing {
            key: "scene.path".to_owned(),
            needed: "give a glTF file, or `phantom = \"obstetric\"` in `[scene]`".to_owned(),
        }),
    }
}

fn phantom(values: &Values) -> PhantomOptions {
    let mut options = PhantomOptions::from(&settings(values));
    values.set("phantom_fat_mm", &mut options.parameters.maternal_fat_mm);
    options
}

/// Settings from checked values.
pub(super) fn settings(values: &Values) -> SceneSettings {
    values.group()
}
