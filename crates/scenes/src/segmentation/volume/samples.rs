//! Stored values of voxels: their types, byte orders and conversions.

use rayon::prelude::*;

use super::super::numbers::Number;

/// Stored values, with the linear function that scales them.
#[derive(Debug, Clone)]
pub(super) struct Samples {
    /// Type of the stored numbers.
    pub kind: Number,
    /// Whether the most significant byte comes first.
    pub big_endian: bool,
    /// Bytes of the values, one after the other; the last value is complete.
    pub bytes: Vec<u8>,
    /// Slope and intercept for scaling; `None` if values are used as they are stored.
    pub scale: Option<[f64; 2]>,
}

/// A value that isn't a label.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum BadLabel {
    /// A fraction, or a value of a float type outside the range.
    Image(f64),
    /// A whole number outside 0..=65535, as text.
    Range(String),
}

/// Largest distance of a scaled label from a whole number. It allows for a slope stored in 32 bits.
const SCALED_TOLERANCE: f64 = 1e-3;

/// Number of values per parallel task.
const CHUNK: usize = 1 << 16;

impl Samples {
    /// The values as labels, in their order.
    ///
    /// # Errors
    /// Index of the first value that isn't a whole number in 0..=65535, and the value.
    pub(super) fn labels(&self) -> Result<Vec<u16>, (usize, BadLabel)> {
        if let Some([slope, intercept]) = self.scale {
            return self.each(|value: Value| scaled_label(value.float() * slope + intercept));
        }
        self.each(Value::label)
    }

    /// The scaled values, in their order.
    pub(super) fn values(&self) -> Vec<f32> {
        let [slope, intercept] = self.scale.unwrap_or([1.0, 0.0]);
        let converted: Result<_, (usize, std::convert::Infallible)> =
            self.each(|value| Ok((value.float() * slope + intercept) as f32));
        match converted {
            Ok(values) => values,
            Err((_, never)) => match never {},
        }
    }

    /// Converts each value, in order. Fails with the index and error of the first value that can't be converted.
    fn each<T: Send + Default + Clone, E: Send>(
        &self,
        convert: impl Fn(Value) -> Result<T, E> + Sync,
    ) -> Result<Vec<T>, (usize, E)> {
        let (kind, big) = (self.kind, self.big_endian);
        match kind {
            Number::I8 => map(&self.bytes, |b: [u8; 1]| convert(Value::Signed(i8::from_le_bytes(b).into()))),
            Number::U8 => map(&self.bytes, |[b]: [u8; 1]| convert(Value::Unsigned(b.into()))),
            Number::I16 => map(&self.bytes, |b| convert(Value::Signed(i16::from_le_bytes(little(b, big)).into()))),
            Number::U16 => map(&self.bytes, |b| convert(Value::Unsigned(u16::from_le_bytes(little(b, big)).into()))),
            Number::I32 => map(&self.bytes, |b| convert(Value::Signed(i32::from_le_bytes(little(b, big)).into()))),
            Number::U32 => map(&self.bytes, |b| convert(Value::Unsigned(u32::from_le_bytes(little(b, big)).into()))),
            Number::I64 => map(&self.bytes, |b| convert(Value::Signed(i64::from_le_bytes(little(b, big))))),
            Number::U64 => map(&self.bytes, |b| convert(Value::Unsigned(u64::from_le_bytes(little(b, big))))),
            Number::F32 => map(&self.bytes, |b| convert(Value::Float(f32::from_le_bytes(little(b, big)).into()))),
            Number::F64 => map(&self.bytes, |b| convert(Value::Float(f64::from_le_bytes(little(b, big))))),
        }
    }
}

/// One stored value.
#[derive(Debug, Clone, Copy)]
enum Value {
    Signed(i64),
    Unsigned(u64),
    Float(f64),
}

impl Value {
    fn float(self) -> f64 {
        match self {
            Self::Signed(value) => value as f64,
            Self::Unsigned(value) => value as f64,
            Self::Float(value) => value,
        }
    }

    fn label(self) -> Result<u16, BadLabel> {
        match self {
            Self::Signed(value) => u16::try_from(value).map_err(|_| BadLabel::Range(value.to_string())),
            Self::Unsigned(value) => u16::try_from(value).map_err(|_| BadLabel::Range(value.to_string())),
            Self::Float(value) => whole(value).ok_or(BadLabel::Image(value)),
        }
    }
}

fn whole(value: f64) -> Option<u16> {
    ((0.0..=65535.0).contains(&value) && value.fract() == 0.0).then_some(value as u16)
}

fn scaled_label(value: f64) -> Result<u16, BadLabel> {
    let rounded = value.round();
    let near = (value - rounded).abs() <= SCALED_TOLERANCE;
    // Adding zero turns -0 into 0.
    whole(rounded + 0.0).filter(|_| near).ok_or(BadLabel::Image(value))
}

fn little<const N: usize>(mut bytes: [u8; N], big_endian: bool) -> [u8; N] {
    if big_endian {
        bytes.reverse();
    }
    bytes
}

fn map<const N: usize, T: Send + Default + Clone, E: Send>(
    bytes: &[u8],
    convert: impl Fn([u8; N]) -> Result<T, E> + Sync,
) -> Result<Vec<T>, (usize, E)> {
    let (values, _) = bytes.as_chunks::<N>();
    let mut out = vec![T::default(); values.len()];
    let fill = |(chunk, (to, from)): (usize, (&mut [T], &[[u8; N]]))| {
        for (index, (to, from)) in to.iter_mut().zip(from).enumerate() {
            *to = convert(*from).map_err(|error| (chunk * CHUNK + index, error))?;
        }
        Ok(())
    };
    let pieces = out.par_chunks_mut(CHUNK).zip(values.par_chunks(CHUNK)).enumerate();
    // Threads may find several errors in any order; the error at the lowest index counts.
    let first = pieces.filter_map(|piece| fill(piece).err()).min_by_key(|(index, _)| *index);
    first.map_or(Ok(out), Err)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(kind: Number, big_endian: bool, bytes: Vec<u8>) -> Samples {
        Samples { kind, big_endian, bytes, scale: None }
    }

    #[test]
    fn every_type_and_byte_order_gives_the_same_labels() {
        let labels = [0_u8, 1, 2, 117];
        let encode = |kind: Number, value: u8| -> Vec<u8> {
            match kind {
                Number::I8 | Number::U8 => vec![value],
                Number::I16 | Number::U16 => i16::from(value).to_le_bytes().to_vec(),
                Number::I32 | Number::U32 => i32::from(value).to_le_bytes().to_vec(),
                Number::I64 | Number::U64 => i64::from(value).to_le_bytes().to_vec(),
                Number::F32 => f32::from(value).to_le_bytes().to_vec(),
                Number::F64 => f64::from(value).to_le_bytes().to_vec(),
            }
        };
        use Number::*;
        for kind in [I8, U8, I16, U16, I32, U32, I64, U64, F32, F64] {
            let little: Vec<_> = labels.iter().flat_map(|v| encode(kind, *v)).collect();
            let big: Vec<_> = labels.iter().flat_map(|v| encode(kind, *v).into_iter().rev()).collect();
            assert_eq!(samples(kind, false, little).labels(), Ok(vec![0, 1, 2, 117]), "{kind:?}");
            assert_eq!(samples(kind, true, big).labels(), Ok(vec![0, 1, 2, 117]), "{kind:?}");
        }
    }

    #[test]
    fn the_first_value_that_is_no_label_is_named() {
        let mut values = vec![5_i32; 300_000];
        values[200_000] = -1;
        values[100_000] = 65_536;
        let bytes = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let found = samples(Number::I32, false, bytes).labels();
        assert_eq!(found, Err((100_000, BadLabel::Range("65536".into()))));
        for value in [0.5_f64, -1.0, 65_536.0] {
            let found = samples(Number::F64, false, value.to_le_bytes().to_vec()).labels();
            assert_eq!(found, Err((0, BadLabel::Image(value))));
        }
        assert!(samples(Number::F64, false, f64::NAN.to_le_bytes().to_vec()).labels().is_err());
    }

    #[test]
    fn scaled_values_are_rounded_within_the_precision_of_the_slope() {
        let slope = f64::from(3.0_f32 / 255.0);
        let scaled = |bytes, scale| Samples { kind: Number::U8, big_endian: false, bytes, scale: Some(scale) };
        assert_eq!(scaled(vec![0, 85, 255], [slope, 0.0]).labels(), Ok(vec![0, 1, 3]));
        assert!(scaled(vec![1], [slope, 0.0]).labels().is_err());
        assert_eq!(scaled(vec![0, 10], [2.0, -1024.0]).values(), [-1024.0, -1004.0]);
    }
}
