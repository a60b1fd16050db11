//! Names of the variants of fieldless enums, and counts in words.

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

/// A whole number with thousands separators.
pub fn thousands(n: usize) -> String {
    if n < 1000 { n.to_string() } else { format!("{},{:03}", thousands(n / 1000), n % 1000) }
}

/// A count with its noun, as `1 error` or `3 errors`.
pub fn counted(n: usize, name: &str) -> String {
    format!("{} {name}{}", thousands(n), if n == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thousands_are_apart() {
        assert_eq!([0, 999, 1000, 675_012, 1_234_567].map(thousands), ["0", "999", "1,000", "675,012", "1,234,567"]);
        assert_eq!([1, 2000].map(|n| counted(n, "error")), ["1 error", "2,000 errors"]);
    }
}
