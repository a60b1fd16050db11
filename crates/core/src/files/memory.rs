//! Check for sufficient memory before the content of a file is loaded.

use thiserror::Error;

/// Request for more memory than is available.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("it needs about {} of memory, more than there is", size(*.bytes))]
pub struct NoMemory {
    /// Bytes needed.
    pub bytes: u64,
}

/// A number of bytes in words.
fn size(bytes: u64) -> String {
    let (unit, name) = if bytes < 1_000_000_000 { (1e6, "MB") } else { (1e9, "GB") };
    format!("{:.1} {name}", bytes as f64 / unit)
}

/// Checks that about `bytes` of memory are available. Without this check, a small file that expands to a lot of data
/// would end the program, since a failed allocation can't be caught.
///
/// # Errors
/// More than the system allows this process, or more than is free.
pub fn memory_for(bytes: u64) -> Result<(), NoMemory> {
    let refused = NoMemory { bytes };
    let length = usize::try_from(bytes).map_err(|_| refused)?;
    if available().is_some_and(|available| bytes > available) {
        return Err(refused);
    }
    // Reserving touches no page, so it costs nothing. It fails above the limits of the process.
    Vec::<u8>::new().try_reserve_exact(length).map_err(|_| refused)
}

/// Bytes of memory that are available without swapping; `None` if the system doesn't tell.
fn available() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let field = |name: &str| -> Option<u64> {
        let line = text.lines().find_map(|line| line.strip_prefix(name))?;
        line.split_whitespace().next()?.parse().ok()
    };
    Some((field("MemAvailable:")? + field("SwapFree:").unwrap_or(0)) << 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn impossible_amounts_are_refused_in_words() {
        assert_eq!(memory_for(1 << 20), Ok(()));
        let error = memory_for(1 << 50).unwrap_err();
        assert_eq!(error.to_string(), "it needs about 1125899.9 GB of memory, more than there is");
        assert!(memory_for(u64::MAX).is_err());
    }
}
