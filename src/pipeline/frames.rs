//! Frames that are used again once nobody holds them.

use std::sync::Arc;

/// Items that are made once and used again and again. It belongs to the one stage that fills them.
pub struct Pool<T> {
    items: Vec<Arc<T>>,
    limit: usize,
    make: Box<dyn Fn() -> T + Send>,
}

impl<T> Pool<T> {
    /// An empty pool that makes at most `limit` items by `make`.
    pub fn new(limit: usize, make: impl Fn() -> T + Send + 'static) -> Self {
        Self { items: Vec::with_capacity(limit), limit, make: Box::new(make) }
    }

    /// Fills an item that nobody holds, made anew if need be. None if `limit` items are held elsewhere; then `fill` is
    /// not called.
    pub fn fill<R>(&mut self, fill: impl FnOnce(&mut T) -> R) -> Option<(Arc<T>, R)> {
        let index = match self.items.iter().position(|item| Arc::strong_count(item) == 1) {
            Some(index) => index,
            None if self.items.len() < self.limit => {
                self.items.push(Arc::new((self.make)()));
                self.items.len() - 1
            }
            None => return None,
        };
        let item = self.items.get_mut(index)?;
        let result = fill(Arc::get_mut(item)?);
        Some((item.clone(), result))
    }

    /// Items made so far.
    pub fn made(&self) -> usize {
        self.items.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_are_used_again_once_all_have_dropped_them() {
        let mut pool = Pool::<Vec<u8>>::new(2, Vec::new);
        let (a, ()) = pool.fill(|v| v.push(1)).unwrap();
        let also_a = a.clone();
        let (b, ()) = pool.fill(|v| v.push(2)).unwrap();
        assert!(pool.fill(|_| ()).is_none(), "both are held");
        drop(a);
        assert!(pool.fill(|_| ()).is_none(), "a sink still holds the first");
        drop(also_a);
        let (c, ()) = pool.fill(|v| v.push(3)).unwrap();
        assert_eq!((&*b, &*c, pool.made()), (&vec![2], &vec![1, 3], 2));
    }
}
