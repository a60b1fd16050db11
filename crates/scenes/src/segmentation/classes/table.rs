//! Tables of classes, built in and from files, and look-up by name and number.

use std::collections::HashMap;
use std::path::Path;
use std::sync::LazyLock;

use insonify_core::anatomy::TissueTable;
use insonify_core::files::{self, FileKind};
use insonify_core::names::{is_printable, printable};
use insonify_core::suggest::did_you_mean;
use serde::Deserialize;

use super::key::key;
use super::{Class, ClassError};

/// Names and texts of the built-in tables. If several tables have a class of one name, the first table's class counts.
const BUILTIN: [(&str, &str); 14] = [
    ("total-v2", include_str!("../../../assets/labels/total-v2.toml")),
    ("total-v1", include_str!("../../../assets/labels/total-v1.toml")),
    ("total-mr", include_str!("../../../assets/labels/total-mr.toml")),
    ("tissue-types", include_str!("../../../assets/labels/tissue-types.toml")),
    ("body", include_str!("../../../assets/labels/body.toml")),
    ("freesurfer", include_str!("../../../assets/labels/freesurfer.toml")),
    ("btcv", include_str!("../../../assets/labels/btcv.toml")),
    ("amos", include_str!("../../../assets/labels/amos.toml")),
    ("flare22", include_str!("../../../assets/labels/flare22.toml")),
    ("abdomenct-1k", include_str!("../../../assets/labels/abdomenct-1k.toml")),
    ("word", include_str!("../../../assets/labels/word.toml")),
    ("chaos-mr", include_str!("../../../assets/labels/chaos-mr.toml")),
    ("lits", include_str!("../../../assets/labels/lits.toml")),
    ("kits", include_str!("../../../assets/labels/kits.toml")),
];

/// Number of complete tables, which are the first of [`BUILTIN`]. Their classes state all properties.
const WHOLE: usize = 6;

/// Classes of the complete tables, by the keys of their names and aliases. Classes of the other tables state only a
/// name and a number.
static KNOWN: LazyLock<HashMap<String, Class>> = LazyLock::new(|| {
    let mut known = HashMap::new();
    for (_, text) in &BUILTIN[..WHOLE] {
        for class in toml::from_str::<File>(text).map(|file| file.class).unwrap_or_default() {
            for spelling in std::iter::once(&class.name).chain(&class.aliases) {
                known.entry(key(spelling)).or_insert_with(|| class.clone());
            }
        }
    }
    known
});

/// Names of the built-in tissues.
static TISSUES: LazyLock<TissueTable> = LazyLock::new(|| TissueTable::builtin().unwrap_or_default());

/// Class table: classes by name and by label number.
#[derive(Debug, Clone, Default)]
pub struct ClassTable {
    classes: Vec<Class>,
    by_key: HashMap<String, usize>,
    by_value: HashMap<u16, usize>,
    by_added_value: HashMap<u16, usize>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    class: Vec<Class>,
}

impl ClassTable {
    /// Names of the built-in tables.
    pub fn builtin_names() -> impl Iterator<Item = &'static str> {
        BUILTIN.iter().map(|(name, _)| *name)
    }

    /// The built-in table called `name`, extended by the names of all other built-in tables.
    ///
    /// # Errors
    /// A name that no built-in table has.
    pub fn builtin(name: &str) -> Result<Self, ClassError> {
        let Some((_, text)) = BUILTIN.iter().find(|(known, _)| *known == name) else {
            let nearest = did_you_mean(name, Self::builtin_names());
            let known = Self::builtin_names().collect::<Vec<_>>().join(", ");
            return Err(ClassError::UnknownTable { name: name.to_owned(), nearest, known });
        };
        let mut table = Self::parse(name, text)?;
        table.add_builtin_names()?;
        Ok(table)
    }

    /// The built-in table called `name` without the names of other tables, for comparisons. `None` if no table has that
    /// name.
    pub fn numbers_of(name: &str) -> Option<Self> {
        let (_, text) = BUILTIN.iter().find(|(known, _)| *known == name)?;
        Self::parse(name, text).ok()
    }

    /// The table in the file at `path`, extended by names of built-in tables that it doesn't define. Label numbers are
    /// only those of the file.
    ///
    /// # Errors
    /// A file that can't be read, an unknown key, a wrong value, an unknown tissue, or a name or number given twice.
    pub fn load(path: &Path) -> Result<Self, ClassError> {
        let read = files::read_text(path, FileKind::Names);
        let text = read.map_err(|error| ClassError::Read { path: path.to_owned(), error })?;
        let mut table = Self::parse(&path.display().to_string(), &text)?;
        table.add_builtin_names()?;
        Ok(table)
    }

    /// The class called `name`; case, spaces, hyphens, order of words and plurals don't matter.
    pub fn named(&self, name: &str) -> Option<&Class> {
        self.by_key.get(&key(name)).map(|index| &self.classes[*index])
    }

    /// The class of the label number `value`; mappings by the user come first.
    pub fn numbered(&self, value: u16) -> Option<&Class> {
        self.numbered_by_user(value).or_else(|| self.by_value.get(&value).map(|index| &self.classes[*index]))
    }

    /// The class that a mapping by the user, such as `7=liver`, gave to the label number `value`.
    pub fn numbered_by_user(&self, value: u16) -> Option<&Class> {
        self.by_added_value.get(&value).map(|index| &self.classes[*index])
    }

    /// All classes: those of the table in its order, those of other built-in tables, then mappings.
    pub fn classes(&self) -> &[Class] {
        &self.classes
    }

    /// Up to three names of known classes that are most similar to `name`.
    pub fn nearest(&self, name: &str) -> Vec<String> {
        let wanted = key(name);
        let mut best: HashMap<usize, f64> = HashMap::new();
        for (known, index) in &self.by_key {
            let similarity = strsim::jaro_winkler(&wanted, known);
            best.entry(*index).and_modify(|best| *best = best.max(similarity)).or_insert(similarity);
        }
        let mut near: Vec<(usize, f64)> = best.into_iter().filter(|(_, similarity)| *similarity > 0.8).collect();
        near.sort_unstable_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        near.into_iter().take(3).map(|(index, _)| self.classes[index].name.clone()).collect()
    }

    /// Adds a mapping `NAME=TARGET`. `NAME` is a name or the number of a label. `TARGET` is a class, whose properties
    /// `NAME` gets; a tissue, which makes `NAME` an organ of that tissue; or `ignore`, which leaves `NAME` out of the
    /// scene. A mapping replaces earlier mappings and known classes of its name.
    ///
    /// # Errors
    /// A mapping of another form, or an unknown target.
    pub fn add(&mut self, mapping: &str) -> Result<(), ClassError> {
        let Some((name, target)) = mapping.rsplit_once('=').map(|(name, target)| (name.trim(), target.trim())) else {
            return Err(ClassError::Mapping { mapping: mapping.to_owned() });
        };
        let value = name.parse::<u16>().ok();
        if !is_printable(name) {
            return Err(ClassError::Unprintable { mapping: printable(mapping).into_owned() });
        }
        if key(name).is_empty() || target.is_empty() || value == Some(0) {
            return Err(ClassError::Mapping { mapping: mapping.to_owned() });
        }
        let class = if target.eq_ignore_ascii_case("ignore") {
            Class::ignored(name)
        } else if let Some(known) = self.named(target) {
            // The class of a mapped number keeps the name of the target; a mapped name stays as it is.
            let name = if value.is_some() { &known.name } else { name };
            let organ = Some(known.organ_name().to_owned());
            Class { name: name.to_owned(), value: None, aliases: Vec::new(), organ, ..known.clone() }
        } else if TISSUES.index_of(target).is_some() {
            Class::of_tissue(if value.is_some() { target } else { name }, target)
        } else {
            let known = self.classes.iter().map(|class| class.name.as_str());
            let nearest = did_you_mean(target, known.chain(TISSUES.names().iter().map(String::as_str)));
            return Err(ClassError::Target { mapping: mapping.to_owned(), target: target.to_owned(), nearest });
        };
        let index = self.classes.len();
        match value {
            Some(value) => drop(self.by_added_value.insert(value, index)),
            None => {
                // Keys and numbers of the old class of that name now refer to the new class.
                if let Some(old) = self.by_key.insert(key(name), index) {
                    let all = self.by_key.values_mut().chain(self.by_value.values_mut());
                    all.filter(|i| **i == old).for_each(|i| *i = index);
                }
            }
        }
        self.classes.push(class);
        Ok(())
    }

    /// Leaves out the layers of walls that are called as one of `parts`, such as `capsule`.
    pub fn leave_out(&mut self, parts: &[String]) {
        self.classes.iter_mut().for_each(|class| class.leave_out(parts));
    }

    fn parse(name: &str, text: &str) -> Result<Self, ClassError> {
        let parsed = toml::from_str::<File>(text);
        let file = parsed.map_err(|error| ClassError::Parse { table: name.to_owned(), error: Box::new(error) })?;
        let mut table = Self::default();
        for class in file.class {
            let class = class.completed(|name| KNOWN.get(&key(name)));
            let called = printable(&class.name).into_owned();
            let fault = |reason| ClassError::Class { table: name.to_owned(), class: called.clone(), reason };
            class.check().map_err(fault)?;
            for (key, tissue) in class.tissues() {
                if TISSUES.index_of(tissue).is_none() {
                    let nearest = did_you_mean(tissue, TISSUES.names().iter().map(String::as_str));
                    return Err(fault(format!("`{key}` is `{tissue}`, which is no tissue{nearest}")));
                }
            }
            let index = table.classes.len();
            if let Some(value) = class.value
                && let Some(other) = table.by_value.insert(value, index)
            {
                return Err(fault(format!("`value` {value} is that of `{}` as well", table.classes[other].name)));
            }
            for spelling in std::iter::once(&class.name).chain(&class.aliases) {
                if key(spelling).is_empty() {
                    return Err(fault(format!("the name `{spelling}` has no letter or digit that tells it apart")));
                }
                if let Some(other) = table.by_key.insert(key(spelling), index)
                    && other != index
                {
                    let other = &table.classes[other].name;
                    return Err(fault(format!("the name `{spelling}` is one of `{other}` as well")));
                }
            }
            table.classes.push(class);
        }
        Ok(table)
    }

    /// Adds the built-in tables' classes with names that aren't known yet, but not the label numbers of these classes.
    fn add_builtin_names(&mut self) -> Result<(), ClassError> {
        for (name, text) in BUILTIN {
            for class in Self::parse(name, text)?.classes {
                let spellings = std::iter::once(&class.name).chain(&class.aliases).map(|spelling| key(spelling));
                let new: Vec<String> = spellings.filter(|key| !self.by_key.contains_key(key)).collect();
                if !new.is_empty() {
                    self.by_key.extend(new.into_iter().map(|key| (key, self.classes.len())));
                    self.classes.push(Class { value: None, ..class });
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
