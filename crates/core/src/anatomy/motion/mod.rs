//! Motion in a scene: heartbeat, fetal and maternal breathing, limb movements.
//!
//! A [`Field`] is a smooth displacement of named surfaces ([`Shape`]) with a [`Rhythm`]. Positions are a pure function
//! of time; at time 0 the scene is as in its file. A scene file stores its motion as JSON in `extras.motion` of its
//! glTF scene, with lengths in mm of the scene frame.

mod rhythm;
mod shape;

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

pub use rhythm::Rhythm;
pub use shape::Shape;
pub use shape::{ATRIA, FADE, OUTER_WALL};

/// Largest number of fields. The static tree and one tree per field are children of one BVH node, which has eight
/// slots.
pub const FIELDS_MAX: usize = 7;

/// Motion of a scene.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Motion {
    /// Displacement fields, at most [`FIELDS_MAX`]; the displacements of overlapping fields add up.
    #[serde(default)]
    pub fields: Vec<Field>,
    /// Movement of the whole scene under the probe, for example by the mother's breathing; `None` if it does not move.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drift: Option<Drift>,
}

/// Displacement of some surfaces.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Field {
    /// Name, for messages and for disabling the field.
    pub name: String,
    /// Names of the surfaces that the field moves; a `*` at the end matches any suffix.
    pub surfaces: Vec<String>,
    /// Spatial form of the displacement.
    pub shape: Shape,
    /// Course of the displacement in time.
    pub rhythm: Rhythm,
}

/// A movement of the whole scene.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drift {
    /// Displacement of the scene at the amount 1 of `rhythm`, scene frame, mm; at most 50 mm long.
    pub way_mm: Vec3,
    /// Course of the movement in time.
    pub rhythm: Rhythm,
}

/// Errors in a scene's motion.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum MotionError {
    /// Too many fields: one BVH node can't join all their trees.
    #[error("{count} motion fields; at most {FIELDS_MAX} are traced: join those that move the same way")]
    TooMany {
        /// Number of fields found.
        count: usize,
    },
    /// A value outside its range.
    #[error("`{key}` of motion `{field}` is {value}; it must be {right}")]
    Value {
        /// Name of the field.
        field: String,
        /// Key of the value.
        key: &'static str,
        /// Value found.
        value: f64,
        /// Accepted values.
        right: &'static str,
    },
    /// A field that moves no surface.
    #[error("motion `{field}` names no surface of the scene: {surfaces:?}")]
    NoSurface {
        /// Name of the field.
        field: String,
        /// Surface names that the field lists.
        surfaces: Vec<String>,
    },
}

impl Motion {
    /// Whether there is no motion.
    pub fn is_empty(&self) -> bool {
        self.fields.is_empty() && self.drift.is_none()
    }

    /// Whether a surface of this name ever moves relative to the others.
    pub fn moves(&self, surface: &str) -> bool {
        self.mask_of(surface) != 0
    }

    /// Checks every value, and that each field moves some of a scene's `surfaces`, given by name.
    ///
    /// # Errors
    /// The first invalid value, or the first field without a surface.
    pub fn validate<'a>(&self, surfaces: impl Iterator<Item = &'a str> + Clone) -> Result<(), MotionError> {
        if self.fields.len() > FIELDS_MAX {
            return Err(MotionError::TooMany { count: self.fields.len() });
        }
        for field in &self.fields {
            if let Some((key, value, right)) = field.shape.wrong().or(field.rhythm.wrong()) {
                return Err(MotionError::Value { field: field.name.clone(), key, value, right });
            }
            if !surfaces.clone().any(|name| field.moves(name)) {
                return Err(MotionError::NoSurface { field: field.name.clone(), surfaces: field.surfaces.clone() });
            }
        }
        if let Some(drift) = &self.drift {
            let length = drift.way_mm.length();
            let wrong = (!(0.0..=50.0).contains(&length)).then(|| ("way_mm", f64::from(length), "at most 50 mm long"));
            if let Some((key, value, right)) = wrong.or(drift.rhythm.wrong()) {
                return Err(MotionError::Value { field: "drift".to_owned(), key, value, right });
            }
        }
        Ok(())
    }

    /// Bit set of the fields that may move the surface `name`.
    pub(super) fn mask_of(&self, name: &str) -> u32 {
        self.fields.iter().enumerate().filter(|(_, f)| f.moves(name)).fold(0, |mask, (i, _)| mask | 1 << i)
    }

    /// Bit set of the fields in `mask` that ever move the point with the rest position `p`.
    pub(super) fn fields_at(&self, p: Vec3, mask: u32) -> u32 {
        // Two pairs of amounts suffice: a field fades out in space, so every amount moves the same points.
        let moves = |shape: &Shape| shape.moved(p, [1.0; 2]) != p || shape.moved(p, [0.5, 1.0]) != p;
        self.fields
            .iter()
            .enumerate()
            .filter(|(i, field)| mask & 1 << i != 0 && moves(&field.shape))
            .fold(0, |fields, (i, _)| fields | 1 << i)
    }

    /// Upper bound of the displacement of any point by the fields in a bit set, mm.
    pub(super) fn reach_mm(&self, fields: u32) -> f64 {
        let chosen = self.fields.iter().enumerate().filter(|(i, _)| fields & 1 << i != 0);
        chosen.map(|(_, field)| f64::from(field.shape.reach_mm())).sum()
    }

    /// Current position of the point with the rest position `p`, moved by the fields in the bit set `mask`.
    pub(super) fn moved(&self, p: Vec3, mask: u32, amounts: &[[f32; 2]]) -> Vec3 {
        let mut moved = p;
        for (i, field) in self.fields.iter().enumerate() {
            if mask & 1 << i != 0 {
                moved += field.shape.moved(p, amounts[i]) - p;
            }
        }
        moved
    }
}

impl Drift {
    /// Displacement of the scene at `time_s`, mm.
    pub(super) fn at(&self, time_s: f64) -> DVec3 {
        self.way_mm.as_dvec3() * self.rhythm.at(time_s)[0]
    }
}

impl Field {
    /// Amounts of the field's movement at `time_s`, each in 0..=1.
    pub(super) fn amounts(&self, time_s: f64) -> [f32; 2] {
        self.rhythm.at(time_s).map(|a| a as f32)
    }

    fn moves(&self, surface: &str) -> bool {
        self.surfaces.iter().any(|name| match name.strip_suffix('*') {
            Some(start) => surface.starts_with(start),
            None => surface == name,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn heart() -> Field {
        Field {
            name: "heart".into(),
            surfaces: vec!["heart*".into(), "left_atrium".into()],
            shape: Shape::Beat { centre_mm: Vec3::ZERO, axis: Vec3::X, radius_mm: 9.0, squeeze: 0.3, shorten: 0.2 },
            rhythm: Rhythm::Heart { beats_per_min: 140.0 },
        }
    }

    #[test]
    fn motion_is_unchanged_by_json() {
        let motion = Motion {
            fields: vec![heart()],
            drift: Some(Drift {
                way_mm: Vec3::new(0.0, -8.0, 0.0),
                rhythm: Rhythm::Breath { breaths_per_min: 15.0, bout_s: 1.0, pause_s: 0.0, seed: 0 },
            }),
        };
        let json = serde_json::to_string(&motion).unwrap();
        assert_eq!(serde_json::from_str::<Motion>(&json).unwrap(), motion);
        assert!(serde_json::from_str::<Motion>(r#"{"feilds": []}"#).is_err());
    }

    #[test]
    fn wrong_values_and_unknown_surfaces_are_named() {
        let names = ["skin", "heart_wall"];
        let motion = |field| Motion { fields: vec![field], drift: None };
        assert_eq!(motion(heart()).validate(names.into_iter()), Ok(()));
        let none = motion(heart()).validate(["skin"].into_iter()).unwrap_err();
        assert!(none.to_string().contains("left_atrium"), "{none}");
        let fast = Field { rhythm: Rhythm::Heart { beats_per_min: f64::NAN }, ..heart() };
        let error = motion(fast).validate(names.into_iter()).unwrap_err();
        assert!(error.to_string().contains("beats_per_min") && error.to_string().contains("20 to 300"), "{error}");
        let many = Motion { fields: vec![heart(); 8], drift: None };
        assert_eq!(many.validate(names.into_iter()), Err(MotionError::TooMany { count: 8 }));
    }
}
