//! Headers of NIfTI-1 and NIfTI-2 files.

use super::super::VolumeFault;

/// Length of a NIfTI-1 header, bytes.
pub(super) const BYTES_1: usize = 348;

/// Length of a NIfTI-2 header, bytes.
pub(super) const BYTES_2: usize = 540;

/// Header of either version, with the fields that the reader uses.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Header {
    /// Length of the header, bytes.
    pub bytes: u64,
    /// Byte order of header and voxels.
    pub big_endian: bool,
    /// Whether header and voxels are in the same file.
    pub single: bool,
    /// Sizes of the axes, from `dim[1]` on.
    pub sizes: Vec<u64>,
    /// Code of the stored type.
    pub datatype: i64,
    /// Sign of the third axis (qfac), then voxel spacings along the three axes.
    pub pixdim: [f64; 4],
    /// Offset of the voxels in their file, bytes.
    pub voxel_offset: f64,
    /// Slope and intercept that scale the stored values.
    pub scale: [f64; 2],
    /// Codes of the units of length and time (`xyzt_units`).
    pub units: i64,
    /// Code of the qform (method 2); 0 if there is none.
    pub qform_code: i64,
    /// Code of the sform (method 3); 0 if there is none.
    pub sform_code: i64,
    /// Components b, c, d of the qform's unit quaternion.
    pub quaternion: [f64; 3],
    /// Translation of the qform.
    pub offset: [f64; 3],
    /// Rows of the sform's affine.
    pub rows: [[f64; 4]; 3],
}

/// Version (1 or 2), and whether the bytes are big-endian, from the first four bytes: the header's length. `None` if
/// the length is not that of a NIfTI header.
pub(in super::super) fn version(start: &[u8]) -> Option<(u8, bool)> {
    let length: [u8; 4] = start.get(..4)?.try_into().ok()?;
    match (u32::from_le_bytes(length), u32::from_be_bytes(length)) {
        (348, _) => Some((1, false)),
        (_, 348) => Some((1, true)),
        (540, _) => Some((2, false)),
        (_, 540) => Some((2, true)),
        _ => None,
    }
}

/// A NIfTI-1 header of `BYTES_1` bytes.
pub(super) fn parse_1(bytes: &[u8], big_endian: bool) -> Result<Header, VolumeFault> {
    let fields = Fields { bytes, big_endian };
    let single = match bytes.get(344..348) {
        Some(b"n+1\0") => true,
        Some(b"ni1\0") => false,
        found => {
            return Err(VolumeFault::Header(format!(
                "not a NIfTI-1 header: its magic is `{}`",
                found.unwrap_or_default().escape_ascii()
            )));
        }
    };
    Ok(Header {
        bytes: BYTES_1 as u64,
        big_endian,
        single,
        sizes: sizes(fields.list(40, i16::from_le_bytes))?,
        datatype: fields.one(70, i16::from_le_bytes),
        pixdim: fields.list(76, f32::from_le_bytes),
        voxel_offset: fields.one(108, f32::from_le_bytes),
        scale: fields.list(112, f32::from_le_bytes),
        units: fields.one(123, u8::from_le_bytes),
        qform_code: fields.one(252, i16::from_le_bytes),
        sform_code: fields.one(254, i16::from_le_bytes),
        quaternion: fields.list(256, f32::from_le_bytes),
        offset: fields.list(268, f32::from_le_bytes),
        rows: [280, 296, 312].map(|at| fields.list(at, f32::from_le_bytes)),
    })
}

/// A NIfTI-2 header of `BYTES_2` bytes.
pub(super) fn parse_2(bytes: &[u8], big_endian: bool) -> Result<Header, VolumeFault> {
    let fields = Fields { bytes, big_endian };
    let single = match bytes.get(4..12) {
        Some(b"n+2\0\r\n\x1a\n") => true,
        Some(b"ni2\0\r\n\x1a\n") => false,
        found => return Err(VolumeFault::Header(format!("not a NIfTI-2 header: its magic is {found:?}"))),
    };
    Ok(Header {
        bytes: BYTES_2 as u64,
        big_endian,
        single,
        sizes: sizes(fields.list(16, i64::from_le_bytes))?,
        datatype: fields.one(12, i16::from_le_bytes),
        pixdim: fields.list(104, f64::from_le_bytes),
        voxel_offset: fields.one::<_, i64, 8>(168, i64::from_le_bytes) as f64,
        scale: fields.list(176, f64::from_le_bytes),
        units: fields.one(500, i32::from_le_bytes),
        qform_code: fields.one(344, i32::from_le_bytes),
        sform_code: fields.one(348, i32::from_le_bytes),
        quaternion: fields.list(352, f64::from_le_bytes),
        offset: fields.list(376, f64::from_le_bytes),
        rows: [400, 432, 464].map(|at| fields.list(at, f64::from_le_bytes)),
    })
}

fn sizes(dim: [i64; 8]) -> Result<Vec<u64>, VolumeFault> {
    let count = usize::try_from(dim[0]).ok().filter(|count| (1..=7).contains(count));
    let Some(count) = count else {
        return Err(VolumeFault::Header(format!("dim[0] is {}; it must lie in 1..=7", dim[0])));
    };
    let size = |(axis, size): (usize, &i64)| {
        u64::try_from(*size).map_err(|_| VolumeFault::Header(format!("dim[{}] is {size}", axis + 1)))
    };
    dim[1..=count].iter().enumerate().map(size).collect()
}

/// Reader of numbers at byte offsets. Numbers beyond the end are 0.
struct Fields<'a> {
    bytes: &'a [u8],
    big_endian: bool,
}

impl Fields<'_> {
    /// Number at the byte `at`; `read` converts little-endian bytes.
    fn one<T, U: From<T>, const BYTES: usize>(&self, at: usize, read: fn([u8; BYTES]) -> T) -> U {
        let mut array = self.bytes.get(at..).and_then(|rest| rest.first_chunk()).copied().unwrap_or([0; BYTES]);
        if self.big_endian {
            array.reverse();
        }
        read(array).into()
    }

    /// `N` consecutive numbers from the byte `at` on.
    fn list<T, U: From<T>, const BYTES: usize, const N: usize>(&self, at: usize, read: fn([u8; BYTES]) -> T) -> [U; N] {
        std::array::from_fn(|n| self.one(at + BYTES * n, read))
    }
}
