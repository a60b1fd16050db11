//! Poses as `foxglove.PoseInFrame` in JSON, for generic viewers of MCAP files.

use std::fmt::Write;

use glam::{DQuat, DVec3};
use insonify_core::pose::{Pose, TrackingState};
use serde::Deserialize;

use super::SessionPose;

/// Name of the schema.
pub(super) const SCHEMA_NAME: &str = "foxglove.PoseInFrame";

/// JSON schema of a message: <https://docs.foxglove.dev/docs/visualization/message-schemas/pose-in-frame> plus `state`.
pub(super) const SCHEMA: &str = r#"{
  "title": "foxglove.PoseInFrame",
  "description": "scene_from_probe as the session used it",
  "type": "object",
  "properties": {
    "timestamp": {"type": "object", "title": "time", "properties": {"sec": {"type": "integer", "minimum": 0}, "nsec": {"type": "integer", "minimum": 0, "maximum": 999999999}}},
    "frame_id": {"type": "string", "description": "Frame of reference"},
    "pose": {
      "title": "foxglove.Pose", "type": "object",
      "properties": {
        "position": {"title": "foxglove.Vector3", "description": "m", "type": "object", "properties": {"x": {"type": "number"}, "y": {"type": "number"}, "z": {"type": "number"}}},
        "orientation": {"title": "foxglove.Quaternion", "type": "object", "properties": {"x": {"type": "number"}, "y": {"type": "number"}, "z": {"type": "number"}, "w": {"type": "number"}}}
      }
    },
    "state": {"type": "string", "enum": ["good", "held", "stuck", "stale", "lost"], "description": "How far the pose could be trusted"}
  }
}"#;

/// JSON schema of a message about the needle.
pub(super) fn needle_schema() -> String {
    SCHEMA.replace("scene_from_probe", "scene_from_needle")
}

/// Writes a message into `out`, replacing its content.
pub(super) fn encode(pose: &SessionPose, out: &mut String) {
    out.clear();
    let (seconds, ns) = (pose.host_time_ns / 1_000_000_000, pose.host_time_ns % 1_000_000_000);
    let (p, q) = (pose.pose.position_mm * 1e-3, pose.pose.orientation);
    let state = pose.state.name();
    // Writing to a string cannot fail. `Display` of a finite f64 is valid JSON and parses to the same number.
    let _ = write!(
        out,
        r#"{{"timestamp":{{"sec":{seconds},"nsec":{ns}}},"frame_id":"scene","pose":{{"position":{{"x":{},"y":{},"z":{}}},"orientation":{{"x":{},"y":{},"z":{},"w":{}}}}},"state":"{state}"}}"#,
        p.x, p.y, p.z, q.x, q.y, q.z, q.w
    );
}

/// Parses a message.
pub(super) fn decode(host_time_ns: u64, json: &[u8]) -> Result<SessionPose, String> {
    #[derive(Deserialize)]
    struct Message {
        pose: Wire,
        state: String,
    }
    #[derive(Deserialize)]
    struct Wire {
        position: Vector3,
        orientation: Quaternion,
    }
    #[derive(Deserialize)]
    struct Vector3 {
        x: f64,
        y: f64,
        z: f64,
    }
    #[derive(Deserialize)]
    struct Quaternion {
        x: f64,
        y: f64,
        z: f64,
        w: f64,
    }
    let message: Message = serde_json::from_slice(json).map_err(|error| error.to_string())?;
    let Wire { position: p, orientation: q } = message.pose;
    let (position_mm, orientation) = (DVec3::new(p.x, p.y, p.z) * 1e3, DQuat::from_xyzw(q.x, q.y, q.z, q.w));
    let pose = Pose::new(position_mm, orientation).map_err(|error| error.to_string())?;
    let state = TrackingState::named(&message.state)
        .ok_or_else(|| format!("state `{}` is none of good, held, stuck, stale, lost", message.state.escape_debug()))?;
    Ok(SessionPose { host_time_ns, pose, state })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_is_encoded_and_decoded() {
        let pose = Pose::from_components([1.25, -80.5, 1e-7, 0.5, 0.5, -0.5, 0.5]).unwrap();
        let mut text = "left over".to_owned();
        for state in TrackingState::ALL {
            let name = state.name();
            let sent = SessionPose { host_time_ns: 1_790_000_000_000_000_007, pose, state };
            encode(&sent, &mut text);
            let json: serde_json::Value = serde_json::from_str(&text).unwrap();
            assert_eq!((&json["timestamp"]["nsec"], &json["state"]), (&7.into(), &name.into()));
            assert_eq!(json["pose"]["position"]["y"], -0.0805);
            let back = decode(sent.host_time_ns, text.as_bytes()).unwrap();
            assert_eq!((back.host_time_ns, back.state), (sent.host_time_ns, state));
            assert!(back.pose.position_mm.distance(pose.position_mm) < 1e-12);
            assert!(back.pose.orientation.angle_between(pose.orientation) < 1e-7);
        }
    }

    #[test]
    fn the_schema_is_json_and_names_every_state() {
        let schema: serde_json::Value = serde_json::from_str(SCHEMA).unwrap();
        let states = TrackingState::ALL.map(TrackingState::name);
        assert_eq!(schema["properties"]["state"]["enum"], serde_json::json!(states));
        let schema: serde_json::Value = serde_json::from_str(&needle_schema()).unwrap();
        assert_eq!(schema["description"], "scene_from_needle as the session used it");
    }

    #[test]
    fn malformed_poses_are_errors() {
        for (json, message) in [
            ("{}", "missing field `pose`"),
            (
                r#"{"pose":{"position":{"x":0,"y":0,"z":0},"orientation":{"x":0,"y":0,"z":0,"w":2}},"state":"good"}"#,
                "norm 2",
            ),
            (
                r#"{"pose":{"position":{"x":0,"y":0,"z":0},"orientation":{"x":0,"y":0,"z":0,"w":1}},"state":"fine"}"#,
                "`fine`",
            ),
        ] {
            let error = decode(0, json.as_bytes()).unwrap_err();
            assert!(error.contains(message), "{error}");
        }
    }
}
