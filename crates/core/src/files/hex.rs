//! Hexadecimal text.

/// Lower-case hexadecimal digits of bytes, as in written checksums.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
