//! Types of stored numbers.

/// Order of the bytes of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Order {
    Little,
    Big,
}

/// Type of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Number {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Number {
    /// Size in bytes.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// Whether values may have fractions.
    pub(super) fn is_float(self) -> bool {
        matches!(self, Self::F32 | Self::F64)
    }

    /// Value of a number stored in the first bytes; 0 if there are too few. Integers beyond 2^53 are rounded.
    pub(super) fn read(self, bytes: &[u8], order: Order) -> f64 {
        macro_rules! value {
            ($type:ty) => {{
                let array = bytes.first_chunk().copied().unwrap_or_default();
                let value = match order {
                    Order::Little => <$type>::from_le_bytes(array),
                    Order::Big => <$type>::from_be_bytes(array),
                };
                value as f64
            }};
        }
        match self {
            Self::I8 => value!(i8),
            Self::U8 => value!(u8),
            Self::I16 => value!(i16),
            Self::U16 => value!(u16),
            Self::I32 => value!(i32),
            Self::U32 => value!(u32),
            Self::I64 => value!(i64),
            Self::U64 => value!(u64),
            Self::F32 => value!(f32),
            Self::F64 => value!(f64),
        }
    }
}
