//! Headers of NIfTI-1 and NIfTI-2 files.

use super::super::VolumeFault;

/// Length of a NIfTI-1 header, bytes.
pub(super) const BYTES_1: usize = 348;

/// Length of a NIfTI-2 header, bytes.
pub(super) const BYTES_2: usize = 540;

/// Fields of both versions that matter here.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Header {
    /// Length of the header, bytes.
    pub bytes: u64,
    /// Byte order of the header and of the voxels.
    pub big_endian: bool,
    /// Whether header and voxels are in one file.
    pub single: bool,
    /// Sizes of the axes, without `dim[0]`.
    pub sizes: Vec<u64>,
    /// Code of the stored type.
    pub datatype: i64,
    /// Sign of the third axis, then distances along the axes.
    pub pixdim: [f64; 4],
    /// Offset of the voxels in their file.
    pub voxel_offset: f64,
    /// Slope and intercept of stored values.
    pub scale: [f64; 2],
    /// Codes of the units of length and time.
    pub units: i64,
    /// Method 2: 0 if absent.
    pub qform_code: i64,
    /// Method 3: 0 if absent.
    pub sform_code: i64,
    /// b, c, d of the unit quaternion of method 2.
    pub quaternion: [f64; 3],
    /// Translation of method 2.
    pub offset: [f64; 3],
    /// Rows of the affine of method 3.
    pub rows: [[f64; 4]; 3],
}

/// Version by the first four bytes, the length of the header: 1 or 2, and whether the bytes are big-endian.
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
pub(super) fn parse_1(bytes: &[u8]) -> Result<Header, VolumeFault> {
    let parsed = ::nifti::NiftiHeader::from_reader(bytes);
    let header = parsed.map_err(|error| VolumeFault::Header(format!("not a NIfTI-1 header: {error}")))?;
    // The crate takes the byte order in which `dim[0]` is at most 7.
    let big_endian = header.endianness == ::nifti::Endianness::Big;
    if version(bytes) != Some((1, big_endian)) {
        let stored = if big_endian { header.dim[0].swap_bytes() } else { header.dim[0] };
        return Err(VolumeFault::Header(format!("dim[0] is {stored}; it must lie in 1..=7")));
    }
    // The crate reads these signed numbers as unsigned.
    let dim = header.dim.map(|size| i64::from(size.cast_signed()));
    let [qfac, x, y, z, ..] = header.pixdim.map(f64::from);
    Ok(Header {
        bytes: BYTES_1 as u64,
        big_endian,
        single: header.magic == *b"n+1\0",
        sizes: sizes(dim)?,
        datatype: header.datatype.into(),
        pixdim: [qfac, x, y, z],
        voxel_offset: header.vox_offset.into(),
        scale: [header.scl_slope.into(), header.scl_inter.into()],
        units: header.xyzt_units.into(),
        qform_code: header.qform_code.into(),
        sform_code: header.sform_code.into(),
        quaternion: [header.quatern_b, header.quatern_c, header.quatern_d].map(f64::from),
        offset: [header.quatern_x, header.quatern_y, header.quatern_z].map(f64::from),
        rows: [header.srow_x, header.srow_y, header.srow_z].map(|row| row.map(f64::from)),
    })
}

/// A NIfTI-2 header of `BYTES_2` bytes, which the crate `nifti` doesn't read.
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
        sizes: sizes(fields.list(16, Fields::i64))?,
        datatype: fields.i16(12).into(),
        pixdim: fields.list(104, Fields::f64),
        voxel_offset: fields.i64(168) as f64,
        scale: fields.list(176, Fields::f64),
        units: fields.i32(500).into(),
        qform_code: fields.i32(344).into(),
        sform_code: fields.i32(348).into(),
        quaternion: fields.list(352, Fields::f64),
        offset: fields.list(376, Fields::f64),
        rows: [400, 432, 464].map(|at| fields.list(at, Fields::f64)),
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

/// Numbers at byte offsets; 0 beyond the end.
struct Fields<'a> {
    bytes: &'a [u8],
    big_endian: bool,
}

impl Fields<'_> {
    fn array<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut array = self.bytes.get(at..at + N).and_then(|b| b.try_into().ok()).unwrap_or([0; N]);
        if self.big_endian {
            array.reverse();
        }
        array
    }

    fn i16(&self, at: usize) -> i16 {
        i16::from_le_bytes(self.array(at))
    }

    fn i32(&self, at: usize) -> i32 {
        i32::from_le_bytes(self.array(at))
    }

    fn i64(&self, at: usize) -> i64 {
        i64::from_le_bytes(self.array(at))
    }

    fn f64(&self, at: usize) -> f64 {
        f64::from_le_bytes(self.array(at))
    }

    /// `N` numbers of eight bytes each.
    fn list<T, const N: usize>(&self, at: usize, read: impl Fn(&Self, usize) -> T) -> [T; N] {
        std::array::from_fn(|n| read(self, at + 8 * n))
    }
}
