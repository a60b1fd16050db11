//! Checksums of stored files.

use sha2::{Digest, Sha256};

use crate::files::hex;

/// SHA-256 of `bytes`, as lower-case hexadecimal digits.
pub(super) fn sha256(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}
