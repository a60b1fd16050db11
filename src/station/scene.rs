//! `[scene]`: source of the scanned surfaces.

use std::path::Path;

use super::keys::of_table;
use super::values::Values;
use super::{SceneSource, StationError};
use crate::phantom::{Lie, PhantomOptions, PlacentaSite, Wall};

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
    let mut options = PhantomOptions::default();
    values.set("phantom_scale", &mut options.scale);
    let p = &mut options.parameters;
    values.set("phantom_weeks", &mut p.gestational_weeks);
    values.set("phantom_roll_deg", &mut p.roll_deg);
    values.set("phantom_flexion", &mut p.flexion);
    values.set("phantom_fluid_index_mm", &mut p.fluid_index_mm);
    p.wall = values.text("phantom_wall").and_then(Wall::named).unwrap_or(p.wall);
    p.recti_lens = values.boolean("phantom_recti_lens").unwrap_or(p.recti_lens);
    p.maternal_fat_mm = p.wall.fat_mm();
    values.set("phantom_fat_mm", &mut p.maternal_fat_mm);
    p.lie = values.text("phantom_lie").and_then(Lie::named).unwrap_or(p.lie);
    p.placenta = values.text("phantom_placenta").and_then(PlacentaSite::named).unwrap_or(p.placenta);
    p.seed = values.integer("phantom_seed").map_or(p.seed, u64::from);
    options
}
