//! [`settings!`]: turns one block per setting into a field, its default, and its [`Setting`].

use super::{Change, Setting, SettingsError, Stored};

/// A struct whose fields are settings.
pub trait SettingsGroup {
    /// Settings of the group itself, without nested groups.
    fn settings() -> &'static [Setting]
    where
        Self: Sized;

    /// Setting of the group itself called `key`; `None` if there is none.
    fn setting(key: &str) -> Option<&'static Setting>
    where
        Self: Sized,
    {
        Self::settings().iter().find(|setting| setting.key == key)
    }

    /// Storage of the value of a setting of this group or of a nested one; `None` for an unknown key.
    fn stored(&self, key: &str) -> Option<&dyn Stored>;

    /// Mutable storage of the value of a setting of this group or of a nested one; `None` for an unknown key.
    fn stored_mut(&mut self, key: &str) -> Option<&mut dyn Stored>;

    /// Checks every value against its range, nested groups first.
    ///
    /// # Errors
    /// The first value outside its range, NaN included.
    fn validate(&self) -> Result<(), SettingsError>;

    /// Work that is needed before the next frame if these values change to those of `other`.
    fn change_to(&self, other: &Self) -> Change
    where
        Self: Sized;
}

/// Checks the values of a group's own settings, without nested groups.
///
/// # Errors
/// The first value outside its range.
pub fn check_own<G: SettingsGroup>(group: &G) -> Result<(), SettingsError> {
    let mut own = G::settings().iter().filter_map(|setting| Some((setting, group.stored(setting.key)?)));
    own.try_for_each(|(setting, stored)| setting.check_stored(stored))
}

/// Defines a struct of settings.
///
/// Each block of `struct` is one setting: documentation, field, type, default, unit, range, `Change`, and an optional
/// control on live displays. `nested` holds groups within the group. `plain` holds fields that have no single station
/// key, each with its `Change`. `uniforms NAME` also defines a struct of the group's own settings, as the 32-bit words
/// that the rendering passes read.
#[macro_export]
macro_rules! settings {
    (
        $(#[$meta:meta])*
        pub struct $name:ident in $table:literal $(, uniforms $uniforms:ident)? {
            $(
                #[doc = $doc:literal]
                $field:ident: $type:ty = $default:expr, $unit:literal, $range:expr, $change:ident $(, $control:expr)?;
            )*
        }
        $(nested { $( $(#[$nested_meta:meta])* $nested:ident: $nested_type:ty, )* })?
        $(plain { $( $(#[$plain_meta:meta])* $plain:ident: $plain_type:ty = $plain_default:expr, $plain_change:ident; )* })?
    ) => {
        $(#[$meta])*
        pub struct $name {
            $($( $(#[$nested_meta])* pub $nested: $nested_type, )*)?
            $($( $(#[$plain_meta])* pub $plain: $plain_type, )*)?
            $(
                #[doc = $doc]
                #[doc = concat!("\n\nRange: ", stringify!($range), " ", $unit)]
                pub $field: $type,
            )*
        }

        $crate::settings!(@uniforms $name [$($uniforms)?] $($doc $field: $type,)*);

        impl Default for $name {
            fn default() -> Self {
                Self {
                    $($( $nested: Default::default(), )*)?
                    $($( $plain: $plain_default, )*)?
                    $( $field: $default, )*
                }
            }
        }

        impl $crate::settings::SettingsGroup for $name {
            fn settings() -> &'static [$crate::settings::Setting] {
                use $crate::settings::{Change, Setting, Stored};
                static SETTINGS: std::sync::LazyLock<Vec<Setting>> = std::sync::LazyLock::new(|| {
                    vec![$({
                        let range: std::ops::RangeInclusive<f64> = $range;
                        let default: $type = $default;
                        Setting {
                            path: concat!($table, ".", stringify!($field)),
                            table: $table,
                            key: stringify!($field),
                            unit: $unit,
                            kind: Stored::kind(&default),
                            min: *range.start(),
                            max: *range.end(),
                            default: Stored::get(&default, 0),
                            doc: $doc.trim_ascii(),
                            change: Change::$change,
                            control: $crate::settings!(@control $($control)?),
                        }
                    }),*]
                });
                &SETTINGS
            }

            fn stored(&self, key: &str) -> Option<&dyn $crate::settings::Stored> {
                match key {
                    $( stringify!($field) => Some(&self.$field), )*
                    _ => None$($( .or_else(|| self.$nested.stored(key)) )*)?,
                }
            }

            fn stored_mut(&mut self, key: &str) -> Option<&mut dyn $crate::settings::Stored> {
                match key {
                    $( stringify!($field) => Some(&mut self.$field), )*
                    _ => None$($( .or_else(|| self.$nested.stored_mut(key)) )*)?,
                }
            }

            fn validate(&self) -> Result<(), $crate::settings::SettingsError> {
                $($( self.$nested.validate()?; )*)?
                $crate::settings::check_own(self)
            }

            fn change_to(&self, other: &Self) -> $crate::settings::Change {
                use $crate::settings::Change;
                let fields = [
                    Change::Nothing,
                    $( if self.$field == other.$field { Change::Nothing } else { Change::$change }, )*
                    $($( self.$nested.change_to(&other.$nested), )*)?
                    $($( if self.$plain == other.$plain { Change::Nothing } else { Change::$plain_change }, )*)?
                ];
                fields.into_iter().max().unwrap_or(Change::Nothing)
            }
        }
    };
    (@uniforms $name:ident [] $($rest:tt)*) => {};
    (@uniforms $name:ident [$uniforms:ident] $($doc:literal $field:ident: $type:ty,)*) => {
        #[doc = concat!("[`", stringify!($name), "`] as words of 32 bits, in the order of their blocks.")]
        #[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
        #[repr(C)]
        pub struct $uniforms {
            $(
                #[doc = $doc]
                pub $field: <$type as $crate::settings::Uniform>::Words,
            )*
        }

        impl From<&$name> for $uniforms {
            fn from(settings: &$name) -> Self {
                use $crate::settings::Uniform;
                Self { $( $field: settings.$field.words(), )* }
            }
        }
    };
    (@control) => { None };
    (@control $control:expr) => { Some($control) };
}
pub use settings;
