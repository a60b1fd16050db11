//! Link between two stages that holds only the newest item.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use super::clock::{Clock, Signal, lock};

/// Outcome of waiting for an item.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Taken<T> {
    /// An item.
    Item(T),
    /// No item before the timeout.
    TimedOut,
    /// The slot is closed: no item will come.
    Closed,
}

/// Holds the newest item between two threads. Replaced items and items put in after closing are counted as dropped.
/// Putting and taking allocate nothing.
#[derive(Debug)]
pub(crate) struct Slot<T> {
    name: String,
    clock: Arc<dyn Clock>,
    /// Notified at each change. Slots on which one thread waits together share one signal.
    signal: Arc<Signal>,
    inner: Mutex<Inner<T>>,
    offered: AtomicU64,
    dropped: AtomicU64,
}

#[derive(Debug)]
struct Inner<T> {
    item: Option<T>,
    closed: bool,
}

impl<T> Slot<T> {
    /// An empty slot whose drops are counted under `name`.
    pub(crate) fn new(name: impl Into<String>, clock: &Arc<dyn Clock>) -> Self {
        Self::with_signal(name, clock, &Arc::default())
    }

    /// An empty slot that notifies `signal`.
    pub(crate) fn with_signal(name: impl Into<String>, clock: &Arc<dyn Clock>, signal: &Arc<Signal>) -> Self {
        Self {
            name: name.into(),
            clock: clock.clone(),
            signal: signal.clone(),
            inner: Mutex::new(Inner { item: None, closed: false }),
            offered: AtomicU64::new(0),
            dropped: AtomicU64::new(0),
        }
    }

    /// Name of the link.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Puts an item in. Returns false if it replaced another item, or was dropped because the slot is closed.
    pub(crate) fn put(&self, item: T) -> bool {
        self.offered.fetch_add(1, Ordering::Relaxed);
        let mut inner = lock(&self.inner);
        let dropped = if inner.closed { Some(item) } else { inner.item.replace(item) };
        drop(inner);
        if dropped.is_some() {
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
        self.clock.notify(&self.signal);
        dropped.is_none()
    }

    /// Takes the current item, if any. An item put in before closing can still be taken.
    pub(crate) fn try_take(&self) -> Taken<T> {
        let mut inner = lock(&self.inner);
        match inner.item.take() {
            Some(item) => Taken::Item(item),
            None if inner.closed => Taken::Closed,
            None => Taken::TimedOut,
        }
    }

    /// Waits for an item, `until` at the latest.
    pub(crate) fn take(&self, until: Duration) -> Taken<T> {
        loop {
            let seen = self.signal.generation();
            match self.try_take() {
                Taken::TimedOut if self.clock.now() < until => self.clock.wait(&self.signal, seen, until),
                taken => return taken,
            }
        }
    }

    /// Closes the slot to new items and wakes all waiting threads.
    pub(crate) fn close(&self) {
        lock(&self.inner).closed = true;
        self.clock.notify(&self.signal);
    }

    /// Wakes all waiting threads without an item; they check again whether one is expected.
    pub(super) fn wake(&self) {
        self.clock.notify(&self.signal);
    }

    /// Drops the current item, if any, and counts it.
    pub(crate) fn clear(&self) {
        let item = lock(&self.inner).item.take();
        if item.is_some() {
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Number of items put in or refused.
    pub(crate) fn offered(&self) -> u64 {
        self.offered.load(Ordering::Relaxed)
    }

    /// Number of items dropped.
    pub(crate) fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::super::clock::{NEVER, SystemClock};
    use super::*;

    fn slot() -> Slot<u32> {
        Slot::new("test", &(Arc::new(SystemClock::new()) as Arc<dyn Clock>))
    }

    #[test]
    fn the_newest_wins_and_the_others_are_counted() {
        let slot = slot();
        assert!(slot.put(1));
        assert!(!slot.put(2));
        assert!(!slot.put(3));
        assert_eq!(slot.take(NEVER), Taken::Item(3));
        assert_eq!(slot.take(Duration::ZERO), Taken::TimedOut);
        assert_eq!((slot.offered(), slot.dropped()), (3, 2));
    }

    #[test]
    fn a_closed_slot_gives_what_it_has_and_takes_nothing() {
        let slot = slot();
        slot.put(1);
        slot.close();
        assert!(!slot.put(2));
        assert_eq!(slot.take(NEVER), Taken::Item(1));
        assert_eq!(slot.take(NEVER), Taken::Closed);
        assert_eq!((slot.offered(), slot.dropped()), (2, 1));
    }

    #[test]
    fn between_threads_items_ascend_and_none_is_lost_uncounted() {
        let slot = Arc::new(slot());
        let producer = slot.clone();
        let thread = std::thread::spawn(move || {
            for i in 1..=20_000 {
                producer.put(i);
            }
            producer.close();
        });
        let (mut last, mut taken) = (0, 0);
        while let Taken::Item(item) = slot.take(NEVER) {
            assert!(item > last, "{item} after {last}");
            last = item;
            taken += 1;
        }
        thread.join().unwrap();
        assert_eq!(last, 20_000, "the last one always arrives");
        assert_eq!(taken + slot.dropped(), slot.offered());
    }
}
