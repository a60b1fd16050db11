//! Poses from the transforms of a sequence.

use std::collections::BTreeSet;
use std::path::Path;

use glam::{DMat3, DVec3};
use insonify_core::pose::Pose;
use insonify_core::pose::table::quote;

use super::meta_image::{Field, Fields, Head};
use super::{InterchangeError, TrackedRow, finite};

/// Names of the transforms in a sequence's images.
pub fn transforms_of(head: &Head) -> BTreeSet<&str> {
    head.images.iter().flat_map(Fields::keys).map(String::as_str).filter(|key| key.ends_with("Transform")).collect()
}

/// One row per image, with the pose `transform` (for example `ProbeToTrackerTransform`). An image with a status other
/// than `OK` has no pose.
///
/// # Errors
/// An image lacks `Timestamp` or the transform, or its numbers are not a rigid transform.
pub fn tracked(head: &Head, transform: &str, path: &Path) -> Result<Vec<TrackedRow>, InterchangeError> {
    let status = format!("{transform}Status");
    let row = |(number, image): (usize, &Fields)| {
        let need = |key: &str| {
            image.get(key).ok_or_else(|| {
                let known: Vec<_> = transforms_of(head).into_iter().collect();
                let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
                let reason = format!("image {number} has no `{key}`; the sequence's transforms: {known}");
                InterchangeError::file(path, reason)
            })
        };
        let time = need("Timestamp")?;
        let position = time.position;
        let Some(time_s) = finite(&time.value) else {
            return Err(position.error(path, format!("`Timestamp` is {}; it must be seconds", quote(&time.value))));
        };
        let matrix = need(transform)?;
        let pose = match image.get(&status) {
            Some(status) if status.value != "OK" => None,
            _ => Some(rigid(matrix).map_err(|reason| matrix.position.error(path, format!("`{transform}`: {reason}")))?),
        };
        Ok(TrackedRow { time_s, pose, event: None, position })
    };
    head.images.iter().enumerate().map(row).collect()
}

/// Pose from the sixteen numbers of a matrix in row order.
fn rigid(field: &Field) -> Result<Pose, String> {
    let numbers: Option<Vec<f64>> = field.value.split_whitespace().map(finite).collect();
    let m: [f64; 16] = numbers
        .and_then(|numbers| numbers.try_into().ok())
        .ok_or_else(|| format!("{} is not sixteen numbers", quote(&field.value)))?;
    if m[12..] != [0.0, 0.0, 0.0, 1.0] {
        return Err(format!("its last row is {:?}; it must be 0 0 0 1", &m[12..]));
    }
    let rotation = DMat3::from_cols_array(&[m[0], m[4], m[8], m[1], m[5], m[9], m[2], m[6], m[10]]);
    Pose::from_matrix(rotation, DVec3::new(m[3], m[7], m[11])).map_err(|error| error.to_string())
}
