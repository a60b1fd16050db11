//! Message buffers that are used again once every client has sent them.

use std::sync::Arc;

use bytes::Bytes;

/// Buffers handed out as [`Bytes`]; one is free again when all clones of its `Bytes` are dropped.
#[derive(Debug, Default)]
pub(super) struct Pool {
    buffers: Vec<Arc<Vec<u8>>>,
}

struct Owner(Arc<Vec<u8>>);

impl AsRef<[u8]> for Owner {
    fn as_ref(&self) -> &[u8] {
        &self.0
    }
}

impl Pool {
    /// Lets `write` fill a free buffer. There are never more buffers than were in use at once.
    pub(super) fn fill(&mut self, write: impl FnOnce(&mut Vec<u8>)) -> Bytes {
        for buffer in &mut self.buffers {
            if let Some(free) = Arc::get_mut(buffer) {
                write(free);
                return Bytes::from_owner(Owner(buffer.clone()));
            }
        }
        let mut bytes = Vec::new();
        write(&mut bytes);
        let buffer = Arc::new(bytes);
        self.buffers.push(buffer.clone());
        Bytes::from_owner(Owner(buffer))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buffers_are_used_again_when_nobody_holds_them() {
        let mut pool = Pool::default();
        let write = |n: u8| {
            move |out: &mut Vec<u8>| {
                out.clear();
                out.extend_from_slice(&[n; 100]);
            }
        };
        let first = pool.fill(write(1));
        let second = pool.fill(write(2));
        let at = first.as_ptr();
        let clone = first.clone();
        drop(first);
        assert_ne!(pool.fill(write(3)).as_ptr(), at);
        assert_eq!((clone[0], second[0]), (1, 2));
        drop(clone);
        for n in 0..50 {
            assert_eq!(pool.fill(write(n))[99], n);
        }
        assert_eq!(pool.buffers.len(), 3);
    }
}
