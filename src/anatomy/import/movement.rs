//! Reads the motion in `extras.motion` of the glTF scene.

use serde_json::Value;

use super::document::File;
use super::walk::chosen_scene;
use crate::anatomy::{Motion, SceneError};

/// Motion of the scene, checked against the names of its surfaces; empty if the file has none.
pub(super) fn motion<'a>(file: &File, surfaces: impl Iterator<Item = &'a str> + Clone) -> Result<Motion, SceneError> {
    let extras = chosen_scene(file).and_then(|scene| scene.extras().clone());
    // Extras may be any JSON; a value that is not an object has none of our keys.
    let extras: Option<Value> = extras.and_then(|raw| serde_json::from_str(raw.get()).ok());
    let Some(value) = extras.as_ref().and_then(|extras| extras.get("motion")) else { return Ok(Motion::default()) };
    let wrong = |reason: String| SceneError::BadMotion { path: file.path.clone(), reason };
    let motion: Motion = serde_json::from_value(value.clone()).map_err(|e| wrong(e.to_string()))?;
    motion.validate(surfaces).map_err(|e| wrong(e.to_string()))?;
    Ok(motion)
}
