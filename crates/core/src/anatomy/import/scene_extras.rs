//! Motion and axes of a scene: `extras.motion` and `extras.axes` of the glTF scene.

use serde_json::Value;

use super::document::File;
use super::walk::chosen_scene;
use crate::anatomy::{Axes, Motion, SceneError};

/// Value of `key` in the extras of the glTF scene.
fn extra(file: &File, key: &str) -> Option<Value> {
    let extras = chosen_scene(file).and_then(|scene| scene.extras().clone())?;
    // Extras may be any JSON; a value that is not an object has none of our keys.
    let extras: Value = serde_json::from_str(extras.get()).ok()?;
    extras.get(key).cloned()
}

/// Motion of the scene, checked against the names of its surfaces; empty if the file has none.
pub(super) fn motion<'a>(file: &File, surfaces: impl Iterator<Item = &'a str> + Clone) -> Result<Motion, SceneError> {
    let Some(value) = extra(file, "motion") else { return Ok(Motion::default()) };
    let wrong = |reason: String| SceneError::BadMotion { path: file.path.clone(), reason };
    let motion: Motion = serde_json::from_value(value).map_err(|e| wrong(e.to_string()))?;
    motion.validate(surfaces).map_err(|e| wrong(e.to_string()))?;
    Ok(motion)
}

/// Origin of the scene, if the file states it.
pub(super) fn source(file: &File) -> Option<String> {
    extra(file, "source")?.as_str().map(str::to_owned)
}

/// Axes of the scene; z is the depth if the file has none.
pub(super) fn axes(file: &File) -> Result<Axes, SceneError> {
    let Some(value) = extra(file, "axes") else { return Ok(Axes::default()) };
    let axes = value.as_str().and_then(Axes::named);
    axes.ok_or_else(|| SceneError::BadAxes { path: file.path.clone(), value: value.to_string() })
}
