//! Names of the variants of fieldless enums.

/// Gives an enum `ALL`, `NAMES`, `name` and `named` from one table of variants and names.
macro_rules! named {
    ($type:ident { $($variant:ident = $name:literal),+ $(,)? }) => {
        impl $type {
            /// All variants, in order.
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$variant),+];

            /// Names of all variants, in the same order.
            pub const NAMES: &'static [&'static str] = &[$($name),+];

            /// Name in files, on the command line and in messages.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name),+
                }
            }

            /// Variant with this name.
            pub fn named(name: &str) -> Option<Self> {
                Self::ALL.into_iter().find(|variant| variant.name() == name)
            }
        }
    };
}

pub(crate) use named;
