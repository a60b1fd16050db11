//! Host time.

use std::sync::OnceLock;
use std::time::{Duration, Instant, SystemTime};

/// Current time, ns since 1970 (UTC): the wall clock at the first call plus the monotonic time since. Later changes of
/// the wall clock have no effect.
pub fn host_time_ns() -> u64 {
    static START: OnceLock<(u64, Instant)> = OnceLock::new();
    let (wall_ns, start) = START.get_or_init(|| {
        let wall = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        (nanoseconds(wall), Instant::now())
    });
    wall_ns.saturating_add(nanoseconds(start.elapsed()))
}

/// Duration in ns; a u64 covers 584 years.
pub(super) fn nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}
