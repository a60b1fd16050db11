//! Identifier and frame of a mark, within the value of its event.

use serde::Deserialize;
use serde_json::Value;

use insonify_core::pose::Pose;
use insonify_core::settings::mark::check_id;

/// Frame on which a mark was set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MarkedFrame {
    /// Number of the frame in its session.
    pub number: u64,
    /// Time of the frame's pose, ns since 1970 (UTC).
    pub time_ns: u64,
    /// `scene_from_probe`; `None` if the frame had no pose.
    pub pose: Option<Pose>,
}

/// Identifier and frame of a mark.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Marked {
    pub(super) id: Option<String>,
    pub(super) frame: Option<MarkedFrame>,
}

impl Marked {
    /// Removes the keys of a mark and the keys `others` from an event's value. Returns identifier and frame.
    pub(super) fn take(value: &mut Value, others: &[&str]) -> Result<Self, String> {
        #[derive(Deserialize)]
        struct Keys {
            id: Option<String>,
            frame: Option<u64>,
            frame_time_ns: Option<u64>,
            pose: Option<[f64; 7]>,
        }
        let Some(table) = value.as_object_mut() else { return Ok(Self::default()) };
        let own = ["id", "frame", "frame_time_ns", "pose"];
        let taken = own.iter().filter_map(|key| Some(((*key).to_owned(), table.remove(*key)?))).collect();
        others.iter().for_each(|key| drop(table.remove(*key)));
        let Keys { id, frame, frame_time_ns, pose } =
            serde_json::from_value(Value::Object(taken)).map_err(|e| format!("the frame of a mark: {e}"))?;
        if let Some(id) = &id {
            check_id(id).map_err(|e| e.to_string())?;
        }
        let pose = pose.map(Pose::from_components).transpose().map_err(|e| format!("the pose of a mark: {e}"))?;
        let alone = |given: &str, missing: &str| {
            format!("the frame of a mark: `{given}` is given without {missing}; a marked frame has both")
        };
        let frame = match (frame, frame_time_ns) {
            (Some(number), Some(time_ns)) => Some(MarkedFrame { number, time_ns, pose }),
            (Some(_), None) => return Err(alone("frame", "`frame_time_ns`")),
            (None, Some(_)) => return Err(alone("frame_time_ns", "`frame`")),
            (None, None) if pose.is_some() => return Err(alone("pose", "`frame` and `frame_time_ns`")),
            (None, None) => None,
        };
        Ok(Self { id, frame })
    }
}
