//! Serialisation of vectors and poses as arrays.

/// A vector as `[x, y, z]`.
pub(super) mod vector {
    use glam::DVec3;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(in super::super) fn serialize<S: Serializer>(v: &DVec3, serializer: S) -> Result<S::Ok, S::Error> {
        v.to_array().serialize(serializer)
    }

    pub(in super::super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<DVec3, D::Error> {
        Ok(DVec3::from_array(Deserialize::deserialize(deserializer)?))
    }
}

/// Vectors as `[[x, y, z], ...]`.
pub(super) mod vectors {
    use glam::DVec3;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(in super::super) fn serialize<S: Serializer>(all: &[DVec3], serializer: S) -> Result<S::Ok, S::Error> {
        all.iter().map(DVec3::to_array).collect::<Vec<_>>().serialize(serializer)
    }

    pub(in super::super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<DVec3>, D::Error> {
        let all: Vec<[f64; 3]> = Deserialize::deserialize(deserializer)?;
        Ok(all.into_iter().map(DVec3::from_array).collect())
    }
}

/// A pose as `[x, y, z, qw, qx, qy, qz]`.
pub(super) mod optional_pose {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use crate::pose::Pose;

    pub(in super::super) fn serialize<S: Serializer>(pose: &Option<Pose>, serializer: S) -> Result<S::Ok, S::Error> {
        pose.as_ref().map(Pose::components).serialize(serializer)
    }

    pub(in super::super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Pose>, D::Error> {
        let components: Option<[f64; 7]> = Deserialize::deserialize(deserializer)?;
        components.map(|c| Pose::from_components(c).map_err(serde::de::Error::custom)).transpose()
    }
}
