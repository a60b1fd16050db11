//! Classes of a table: anatomical meaning and tissue of a label.

use std::fmt;

use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};

use insonify_core::names::{is_printable, printable};

use crate::segmentation::part_kinds::PART_KINDS;

/// Use of a label.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// An organ with a surface of its own.
    #[default]
    Organ,
    /// The whole body or a part of it; its outline is the outer surface of the skin.
    Body,
    /// The skin.
    Skin,
    /// The layer of fat under the skin.
    Fat,
    /// Not part of the scene.
    Ignore,
}

/// Layer of the shell inside an organ's surface.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wall {
    /// Tissue of the layer.
    pub tissue: String,
    /// Thickness, mm.
    pub mm: f64,
    /// Name of a layer that no label shows, such as a capsule. Named layers can be left out.
    pub part: Option<String>,
}

/// Most layers of a wall: their priorities lie between those of the organ and of its gas.
const LAYERS_MAX: usize = 5;

/// Reads the layers of a wall: one layer as a table of keys, or a list of layers.
struct Layers;

impl<'de> Visitor<'de> for Layers {
    type Value = Vec<Wall>;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a layer, as { tissue = \"muscle\", mm = 2.0 }, or a list of layers")
    }

    fn visit_map<A: MapAccess<'de>>(self, keys: A) -> Result<Vec<Wall>, A::Error> {
        Wall::deserialize(MapAccessDeserializer::new(keys)).map(|wall| vec![wall])
    }

    fn visit_seq<A: SeqAccess<'de>>(self, layers: A) -> Result<Vec<Wall>, A::Error> {
        Vec::deserialize(SeqAccessDeserializer::new(layers))
    }
}

fn layers<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Wall>, D::Error> {
    deserializer.deserialize_any(Layers)
}

/// Gas in the upper part of a lumen.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gas {
    /// Tissue of the gas.
    pub tissue: String,
    /// Share of the lumen's volume, from 0 to 1.
    pub share: f64,
}

/// Class: anatomical meaning and tissue of a label.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Class {
    /// Name of the class.
    pub name: String,
    /// Label number in label maps without names.
    pub value: Option<u16>,
    /// Tissue; for hollow organs, the tissue of the lumen. `None` only for ignored classes.
    pub tissue: Option<String>,
    /// Priority: where organs overlap, the highest wins. `None` only for ignored classes.
    pub priority: Option<i32>,
    /// Use of the label.
    #[serde(default)]
    pub role: Role,
    /// Other names of the class.
    #[serde(default)]
    pub aliases: Vec<String>,
    /// Layers of the shell just inside the surface, the outermost first.
    #[serde(default, deserialize_with = "layers")]
    pub wall: Vec<Wall>,
    /// Gas in the lumen.
    pub gas: Option<Gas>,
    /// Group to which the class belongs in pictures.
    pub group: Option<String>,
    /// Name of the organ, if the user added the class by mapping a name to an organ.
    #[serde(skip)]
    pub organ: Option<String>,
}

/// Accepted priorities of classes.
const PRIORITIES: std::ops::RangeInclusive<i32> = 10..=99;

/// Accepted wall thicknesses, mm.
const WALLS_MM: std::ops::RangeInclusive<f64> = 0.1..=20.0;

impl Class {
    /// A class that isn't part of the scene.
    pub(super) fn ignored(name: &str) -> Self {
        Self { role: Role::Ignore, tissue: None, priority: None, ..Self::of_tissue(name, "") }
    }

    /// An organ of one tissue.
    pub(super) fn of_tissue(name: &str, tissue: &str) -> Self {
        Self {
            name: name.to_owned(),
            value: None,
            tissue: Some(tissue.to_owned()),
            priority: Some(50),
            role: Role::Organ,
            aliases: Vec::new(),
            wall: Vec::new(),
            gas: None,
            group: None,
            organ: None,
        }
    }

    /// The class, with the properties of the known class of its name if it states only a name and a number. Other
    /// classes are unchanged.
    pub(super) fn completed<'a>(self, known: impl Fn(&str) -> Option<&'a Self>) -> Self {
        let states_none = self.tissue.is_none()
            && self.priority.is_none()
            && self.role == Role::Organ
            && self.wall.is_empty()
            && self.gas.is_none()
            && self.group.is_none()
            && self.aliases.is_empty();
        match known(&self.name).filter(|_| states_none) {
            Some(known) => Self { value: self.value, ..known.clone() },
            None => self,
        }
    }

    /// Leaves out the layers of the wall that are called as one of `parts`. Their thickness goes to the layer outside of
    /// them, or to the organ if there is none.
    pub(super) fn leave_out(&mut self, parts: &[String]) {
        let mut kept: Vec<Wall> = Vec::new();
        for wall in self.wall.drain(..) {
            if !wall.part.as_ref().is_some_and(|part| parts.contains(part)) {
                kept.push(wall);
            } else if let Some(outside) = kept.last_mut() {
                outside.mm += wall.mm;
            }
        }
        self.wall = kept;
    }

    /// Name of the organ that the class stands for: the mapping's organ if the user added the class, else its own name.
    pub fn organ_name(&self) -> &str {
        self.organ.as_deref().unwrap_or(&self.name)
    }

    /// Tissues of the class, its wall and its gas, each with its key in the table's file.
    pub(super) fn tissues(&self) -> impl Iterator<Item = (&'static str, &str)> {
        let own = self.tissue.as_deref().map(|tissue| ("tissue", tissue));
        let wall = self.wall.iter().map(|wall| ("wall.tissue", wall.tissue.as_str()));
        let gas = self.gas.as_ref().map(|gas| ("gas.tissue", gas.tissue.as_str()));
        own.into_iter().chain(wall).chain(gas)
    }

    /// Refuses a class with a missing value, or with a value outside its range. The error is a message about the first
    /// such value.
    pub(super) fn check(&self) -> Result<(), String> {
        let ignored = self.role == Role::Ignore;
        if self.name.trim().is_empty() {
            return Err("`name` is empty".to_owned());
        }
        if let Some(name) = std::iter::once(&self.name).chain(&self.aliases).find(|name| !is_printable(name)) {
            let shown = printable(name);
            return Err(format!("the name {name:?} has a line break or control character; write it as {shown:?}"));
        }
        if self.value == Some(0) {
            return Err("`value` is 0, which is the background".to_owned());
        }
        if self.tissue.is_none() && !ignored {
            return Err("`tissue` is missing; only classes with `role = \"ignore\"` have none".to_owned());
        }
        match self.priority {
            None if !ignored => return Err("`priority` is missing; it must lie in 10..=99".to_owned()),
            Some(priority) if !PRIORITIES.contains(&priority) => {
                return Err(format!("`priority` is {priority}; it must lie in 10..=99"));
            }
            _ => {}
        }
        if let Some(wall) = self.wall.iter().find(|wall| !WALLS_MM.contains(&wall.mm)) {
            return Err(format!("`wall.mm` is {}; it must lie in 0.1..=20", wall.mm));
        }
        let parts: Vec<&Wall> = self.wall.iter().filter(|layer| layer.part.is_some()).collect();
        let names = || PART_KINDS.iter().filter(|kind| kind.layer.is_some()).map(|kind| kind.name);
        if let Some(unknown) = parts.iter().filter_map(|l| l.part.as_deref()).find(|part| !names().any(|n| n == *part))
        {
            let known = names().collect::<Vec<_>>().join(", ");
            return Err(format!("`wall.part` is `{unknown}`; it must be one of {known}"));
        }
        if let Some(twice) = (1..parts.len()).find(|&n| parts[..n].iter().any(|l| l.tissue == parts[n].tissue)) {
            return Err(format!("`wall` has two layers with a `part` of the tissue `{}`", parts[twice].tissue));
        }
        if self.wall.len() > LAYERS_MAX {
            return Err(format!("`wall` has {} layers; at most {LAYERS_MAX} are possible", self.wall.len()));
        }
        if let Some(gas) = self.gas.as_ref().filter(|gas| !(0.0..=1.0).contains(&gas.share)) {
            return Err(format!("`gas.share` is {}; it must lie in 0..=1", gas.share));
        }
        Ok(())
    }
}
