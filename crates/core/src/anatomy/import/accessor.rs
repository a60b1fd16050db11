//! Checks before reading an accessor: the glTF crate trusts counts, offsets and types.

use gltf::Accessor;
use gltf::accessor::{DataType, Dimensions, sparse};
use gltf::buffer::View;

/// Largest number of elements of an accessor without a buffer view (all zero except its sparse ones).
const UNBACKED_MAX: usize = 1 << 24;

/// Number of elements of `accessor`; 0 if it announces more than its buffer can hold, which [`check`] refuses.
pub(super) fn elements(accessor: &Accessor<'_>, buffers: &[Vec<u8>]) -> u64 {
    let held = |view: View<'_>| buffers.get(view.buffer().index()).map_or(0, Vec::len);
    let most = accessor.view().map_or(UNBACKED_MAX, held);
    if accessor.count() > most { 0 } else { accessor.count() as u64 }
}

/// Checks that `accessor` has elements of the given shape and of one of `types`, all within `buffers`.
pub(super) fn check(
    accessor: &Accessor<'_>,
    dimensions: Dimensions,
    types: &[DataType],
    buffers: &[Vec<u8>],
) -> Result<(), String> {
    checked(accessor, dimensions, types, buffers).map_err(|reason| format!("accessor {}: {reason}", accessor.index()))
}

fn checked(
    accessor: &Accessor<'_>,
    dimensions: Dimensions,
    types: &[DataType],
    buffers: &[Vec<u8>],
) -> Result<(), String> {
    let (found, data_type) = (accessor.dimensions(), accessor.data_type());
    if found != dimensions || !types.contains(&data_type) {
        return Err(format!("its elements are {found:?} of {data_type:?}; expected {dimensions:?} of {types:?}"));
    }
    let (count, size) = (accessor.count(), accessor.size());
    if count == 0 {
        return Err("it has no elements".to_owned());
    }
    match accessor.view() {
        Some(view) => {
            span(&view, accessor.offset(), count, size, buffers)?;
        }
        None if count > UNBACKED_MAX => {
            return Err(format!("{count} elements without a buffer view; at most {UNBACKED_MAX} are read"));
        }
        None => {}
    }
    accessor.sparse().map_or(Ok(()), |sparse| check_sparse(&sparse, count, size, buffers))
}

fn check_sparse(sparse: &sparse::Sparse<'_>, count: usize, size: usize, buffers: &[Vec<u8>]) -> Result<(), String> {
    let (indices, values, substituted) = (sparse.indices(), sparse.values(), sparse.count());
    if substituted == 0 || substituted > count {
        return Err(format!("{substituted} sparse elements of {count}"));
    }
    span(&values.view(), values.offset(), substituted, size, buffers)?;
    let width = indices.index_type().size();
    let bytes = span(&indices.view(), indices.offset(), substituted, width, buffers)?;
    let stride = indices.view().stride().unwrap_or(width);
    let mut next = 0;
    for item in bytes.chunks(stride) {
        let little_endian = item.iter().take(width).rev();
        let index = little_endian.fold(0_usize, |value, &byte| (value << 8) | usize::from(byte));
        if index < next || index >= count {
            return Err(format!("sparse index {index}; they must ascend and lie below {count}"));
        }
        next = index + 1;
    }
    Ok(())
}

/// Bytes of `view` that hold `count` elements of `size` bytes from `offset` on.
fn span<'b>(
    view: &View<'_>,
    offset: usize,
    count: usize,
    size: usize,
    buffers: &'b [Vec<u8>],
) -> Result<&'b [u8], String> {
    let stride = view.stride().unwrap_or(size);
    if stride < size {
        return Err(format!("a stride of {stride} bytes for elements of {size}"));
    }
    let length = stride.checked_mul(count - 1).and_then(|l| l.checked_add(size));
    let end = length.and_then(|l| l.checked_add(offset));
    let view_end = view.offset().checked_add(view.length());
    let bytes = view_end.and_then(|end| buffers.get(view.buffer().index())?.get(view.offset()..end));
    let bytes = bytes.ok_or_else(|| format!("buffer view {} reaches past its buffer", view.index()))?;
    end.and_then(|end| bytes.get(offset..end)).ok_or_else(|| {
        let (index, held) = (view.index(), bytes.len());
        format!("{count} elements of {size} bytes from byte {offset} reach past buffer view {index} of {held} bytes")
    })
}
