//! NIfTI-1 and NIfTI-2 files.
//!
//! The crate `nifti` is not used: it reads no NIfTI-2, its reader of extensions allocates lengths that it hasn't
//! verified, and its qform panics on some headers.

mod header;
mod names;
mod placement;

use self::header::Header;
pub(super) use self::{header::version, names::byte};
use super::super::numbers::Number;
use super::raw::{Layers, RawVolume};
use super::samples::Samples;
use super::source::{MAX_BYTES, Source, room_for, voxel_count, within};
use super::{ReadOptions, VolumeFault};

/// Largest number of bytes of the header's extensions.
const MAX_EXTENSION_BYTES: u64 = 64 << 20;

/// Volume in `bytes`, a decompressed `.nii` or `.hdr` file. For `.hdr`, `voxels` is the content of the voxel file.
///
/// # Errors
/// A header that can't be used, or missing bytes.
pub fn decode_nifti(bytes: &[u8], voxels: Option<&[u8]>, options: ReadOptions) -> Result<RawVolume, VolumeFault> {
    let mut source = Source::plain(bytes, bytes.len() as u64);
    read_nifti(&mut source, voxels.map(|voxels| Source::plain(voxels, voxels.len() as u64)), options)
}

/// Volume whose header is at the start of `source`. The voxels follow in `source`, or are in `voxels`.
pub(super) fn read_nifti(
    source: &mut Source<'_>,
    voxels: Option<Source<'_>>,
    options: ReadOptions,
) -> Result<RawVolume, VolumeFault> {
    let mut bytes = source.take(header::BYTES_1 as u64, "the NIfTI header")?;
    let header = match version(&bytes) {
        Some((2, big_endian)) => {
            bytes.extend(source.take((header::BYTES_2 - header::BYTES_1) as u64, "the NIfTI-2 header")?);
            header::parse_2(&bytes, big_endian)?
        }
        Some((_, big_endian)) => header::parse_1(&bytes, big_endian)?,
        None => return Err(VolumeFault::Header("sizeof_hdr is neither 348 (NIfTI-1) nor 540 (NIfTI-2)".to_owned())),
    };
    let size = volume_size(&header.sizes)?;
    let kind = sample_type(header.datatype)?;
    let (lps_from_voxel, remarks) = placement::placement(&header, size, options)?;
    let count = voxel_count(&size)?;
    let expected = count as u64 * kind.size() as u64;
    within(expected, MAX_BYTES, "the size of the voxels in bytes")?;
    room_for(count as u64, kind.size() as u64)?;
    let offset = voxel_offset(&header)?;
    let (extensions, data) = match voxels {
        Some(mut voxels) => {
            let extensions = source.rest(MAX_EXTENSION_BYTES, "the size of the header's extensions in bytes")?;
            voxels.skip(offset, "the space before the voxels")?;
            (extensions, voxels.take(expected, "the voxels")?)
        }
        None if header.single => {
            let extensions = source.take(offset - header.bytes, "the header's extensions")?;
            let data = source.take(expected, "the voxels")?;
            // This read verifies the checksum of gzip data. Bytes after the voxels are ignored, as in nibabel.
            source.has_more()?;
            (extensions, data)
        }
        None => {
            let what = "a NIfTI header without its .img file".to_owned();
            return Err(VolumeFault::Unsupported { what, remedy: "give the two files the same name in one folder" });
        }
    };
    let [slope, intercept] = header.scale;
    let intercept = if intercept.is_finite() { intercept } else { 0.0 };
    let scaled = slope.is_finite() && slope != 0.0 && [slope, intercept] != [1.0, 0.0];
    Ok(RawVolume {
        size: size.map(|size| size as usize),
        lps_from_voxel,
        samples: Samples {
            kind,
            big_endian: header.big_endian,
            bytes: data,
            scale: scaled.then_some([slope, intercept]),
        },
        layers: Layers::ONE,
        segments: names::segments(&extensions, header.big_endian)?,
        remarks,
    })
}

/// Sizes of the three axes of space. Any other axis must have size 1.
fn volume_size(sizes: &[u64]) -> Result<[u64; 3], VolumeFault> {
    let size = |axis: usize| sizes.get(axis).copied().unwrap_or(1);
    if sizes.iter().skip(3).any(|size| *size > 1) {
        let what = format!("a volume of {} axes (sizes {sizes:?})", sizes.len());
        return Err(VolumeFault::Unsupported { what, remedy: "save one of its 3-D volumes as a file of its own" });
    }
    Ok([size(0), size(1), size(2)])
}

fn sample_type(code: i64) -> Result<Number, VolumeFault> {
    Ok(match code {
        2 => Number::U8,
        4 => Number::I16,
        8 => Number::I32,
        16 => Number::F32,
        64 => Number::F64,
        256 => Number::I8,
        512 => Number::U16,
        768 => Number::U32,
        1024 => Number::I64,
        1280 => Number::U64,
        _ => {
            let what = match code {
                1 => "single bits (datatype 1)".to_owned(),
                32 | 1792 | 2048 => format!("complex numbers (datatype {code})"),
                128 | 2304 => format!("colours (datatype {code})"),
                1536 => "128-bit numbers (datatype 1536)".to_owned(),
                _ => return Err(VolumeFault::Header(format!("datatype is {code}, which NIfTI doesn't define"))),
            };
            return Err(VolumeFault::Unsupported { what, remedy: "save the volume as integers, or as 32-bit floats" });
        }
    })
}

/// Offset of the voxels in their file, bytes. If header and voxels are in one file, the offset is at least the end of
/// the header and of the four bytes that flag extensions.
fn voxel_offset(header: &Header) -> Result<u64, VolumeFault> {
    let least = if header.single { header.bytes + 4 } else { 0 };
    let offset = header.voxel_offset;
    // Some writers leave the offset 0.
    if header.single && offset == 0.0 {
        return Ok(least);
    }
    if !(least as f64..=MAX_EXTENSION_BYTES as f64).contains(&offset) || offset.fract() != 0.0 {
        let reason = format!("vox_offset is {offset}; it must be a whole number from {least} to {MAX_EXTENSION_BYTES}");
        return Err(VolumeFault::Header(reason));
    }
    Ok(offset as u64)
}

#[cfg(test)]
mod tests;
