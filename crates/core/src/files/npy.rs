//! NumPy arrays (.npy).

use std::io::{self, ErrorKind};

use npyz::NpyFile;

/// Largest size of a header, bytes: enough for a structured type with many fields.
const HEAD_BYTES_MAX: usize = 1 << 20;

/// Largest number of opening brackets in a header.
const BRACKETS_MAX: usize = 256;

/// Parses the array in `bytes`. Its header must not announce more values than there are bytes.
///
/// # Errors
/// Bytes that are not an array, a header that ends beyond them or is longer than 1 MiB, and a shape with more values
/// than bytes.
pub fn npy(bytes: &[u8]) -> io::Result<NpyFile<&[u8]>> {
    let refused = |reason: String| Err(io::Error::new(ErrorKind::InvalidData, reason));
    let length = match (bytes.get(6), bytes.get(8..12)) {
        (Some(1), Some(&[a, b, _, _])) => usize::from(u16::from_le_bytes([a, b])),
        (Some(_), Some(&[a, b, c, d])) => u32::from_le_bytes([a, b, c, d]) as usize,
        _ => return refused("it is no NumPy array (.npy), or cut short".to_owned()),
    };
    let head = bytes.get(8..).unwrap_or_default();
    if length > HEAD_BYTES_MAX || length > head.len() {
        return refused(format!("its header promises {length} bytes, and {} follow; it is damaged", head.len()));
    }
    let text = String::from_utf8_lossy(&head[..(length + 4).min(head.len())]).replace('"', "'");
    // The crate's reader recurses into brackets, so too many would overflow the stack.
    if text.matches(['(', '[', '{']).count() > BRACKETS_MAX {
        return refused(format!("its header has more than {BRACKETS_MAX} brackets; it is damaged"));
    }
    if let Some((_, rest)) = text.split_once("'shape'")
        && let Some((_, rest)) = rest.split_once(['(', '['])
        && let Some((sizes, _)) = rest.split_once([')', ']'])
    {
        let numbers = sizes.split(',').map(str::trim).filter(|number| !number.is_empty());
        let product = numbers.map(|n| n.parse().ok()).try_fold(1u64, |product, n| product.checked_mul(n?));
        if product.is_none_or(|product| product > bytes.len() as u64) {
            return refused(format!("it has {} bytes, too few for the shape ({sizes}); it is cut short", bytes.len()));
        }
    }
    NpyFile::new(bytes)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn array(version: u8, length: u32, shape: &str) -> Vec<u8> {
        let text = format!("{{'descr': '|u1', 'fortran_order': False, 'shape': ({shape}), }}\n");
        let mut bytes = b"\x93NUMPY".to_vec();
        bytes.extend([version, 0]);
        let length = if length == 0 { text.len() as u32 } else { length };
        match version {
            1 => bytes.extend((length as u16).to_le_bytes()),
            _ => bytes.extend(length.to_le_bytes()),
        }
        bytes.extend(text.bytes());
        bytes.extend([7; 6]);
        bytes
    }

    #[test]
    fn headers_that_promise_too_much_are_refused_before_memory_is_taken() {
        for version in [1, 2] {
            let bytes = array(version, 0, "2, 3");
            assert_eq!(npy(&bytes).unwrap().into_vec::<u8>().unwrap(), [7; 6]);
        }
        let says = |bytes: &[u8]| npy(bytes).err().map(|error| error.to_string()).unwrap_or_default();
        assert!(says(&array(2, u32::MAX, "2, 3")).contains("promises 4294967295 bytes"));
        assert!(says(&array(1, 0, "4294967296, 4294967296")).contains("too few for the shape"));
        assert!(says(&array(1, 0, "1000000,")).contains("too few for the shape (1000000,)"));
        let nested = array(2, 0, &"(".repeat(100_000));
        assert!(says(&nested).contains("more than 256 brackets"));
        assert!(says(b"\x93NUM").contains("cut short"));
    }

    proptest! {
        #[test]
        fn changed_bytes_do_not_panic(
            version in 0_u8..4,
            changes in prop::collection::vec((0_usize..100, any::<u8>()), 0..6),
            shape in "[0-9, -]{0,24}",
            cut in 0_usize..60,
        ) {
            let mut bytes = array(version, 0, &shape);
            for (at, value) in changes {
                let at = at % bytes.len();
                bytes[at] = value;
            }
            bytes.truncate(bytes.len().saturating_sub(cut));
            if let Ok(file) = npy(&bytes) {
                let _ = file.into_vec::<u8>();
            }
        }
    }
}
