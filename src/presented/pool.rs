//! Pool of items that are reused once nobody holds them.

use std::sync::Arc;

/// Reusable items. The pool belongs to the thread that fills them.
#[derive(Debug)]
pub(crate) struct Pool<T> {
    items: Vec<Arc<T>>,
    limit: usize,
}

impl<T: Default> Pool<T> {
    /// An empty pool that makes at most `limit` items.
    pub(crate) fn new(limit: usize) -> Self {
        Self { items: Vec::new(), limit }
    }

    /// Fills a free item, which is created if necessary. Returns `None` without calling `fill` if all `limit` items
    /// are held elsewhere.
    pub(crate) fn fill<R>(&mut self, fill: impl FnOnce(&mut T) -> R) -> Option<(Arc<T>, R)> {
        let index = match self.items.iter().position(|item| Arc::strong_count(item) == 1) {
            Some(index) => index,
            None if self.items.len() < self.limit => {
                self.items.push(Arc::default());
                self.items.len() - 1
            }
            None => return None,
        };
        let item = self.items.get_mut(index)?;
        let result = fill(Arc::get_mut(item)?);
        Some((item.clone(), result))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_are_used_again_once_all_have_dropped_them() {
        let mut pool = Pool::<Vec<u8>>::new(2);
        let (a, ()) = pool.fill(|v| v.push(1)).unwrap();
        let also_a = a.clone();
        let (b, ()) = pool.fill(|v| v.push(2)).unwrap();
        assert!(pool.fill(|_| ()).is_none(), "both are held");
        drop(a);
        assert!(pool.fill(|_| ()).is_none(), "a sink still holds the first");
        drop(also_a);
        let (c, ()) = pool.fill(|v| v.push(3)).unwrap();
        assert_eq!((&*b, &*c, pool.items.len()), (&vec![2], &vec![1, 3], 2));
    }

    #[test]
    fn there_are_no_more_items_than_were_held_at_once() {
        let mut pool = Pool::<u8>::new(usize::MAX);
        let mut fill = |n: u8| pool.fill(|item| *item = n).unwrap().0;
        let (first, second) = (fill(1), fill(2));
        let clone = first.clone();
        drop(first);
        assert_eq!(*fill(3), 3);
        assert_eq!((*clone, *second), (1, 2));
        drop(clone);
        for n in 0..50 {
            assert_eq!(*fill(n), n);
        }
        assert_eq!(pool.items.len(), 3);
    }
}
