//! Open connections in addition to the pages' WebSockets. A new connection beyond the limits closes the oldest
//! connection, so that silent peers keep no page out.

use std::net::IpAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio_util::sync::CancellationToken;

/// Largest number of connections of all peers together.
const CONNECTIONS_MAX: usize = 64;
/// Largest number of connections of one peer: several viewers may share an address.
const OF_PEER_MAX: usize = 32;

/// The open connections, oldest first.
#[derive(Debug, Default)]
pub(super) struct Connections(Mutex<Vec<Arc<Open>>>);

#[derive(Debug)]
struct Open {
    peer: IpAddr,
    displaced: CancellationToken,
}

/// An open connection, counted until it is dropped.
pub(super) struct Connection {
    all: Arc<Connections>,
    open: Arc<Open>,
}

impl Connections {
    fn open(&self) -> MutexGuard<'_, Vec<Arc<Open>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a connection of `peer`. If `peer` has too many connections, its oldest is closed. If all peers have too
    /// many together, the oldest of all is closed.
    pub(super) fn enter(self: &Arc<Self>, peer: IpAddr) -> Connection {
        let mut open = self.open();
        let of_peer = open.iter().filter(|other| other.peer == peer).count();
        let displaced = if of_peer >= OF_PEER_MAX {
            open.iter().position(|other| other.peer == peer)
        } else {
            (open.len() >= CONNECTIONS_MAX).then_some(0)
        };
        if let Some(index) = displaced {
            open.remove(index).displaced.cancel();
        }
        let entered = Arc::new(Open { peer, displaced: CancellationToken::new() });
        open.push(entered.clone());
        Connection { all: self.clone(), open: entered }
    }

    /// Number of open connections.
    #[cfg(test)]
    pub(super) fn count(&self) -> usize {
        self.open().len()
    }
}

impl Connection {
    /// Waits until a newer connection displaces this one.
    pub(super) async fn displaced(&self) {
        self.open.displaced.cancelled().await;
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        self.all.open().retain(|other| !Arc::ptr_eq(other, &self.open));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn peer(last: u8) -> IpAddr {
        [192, 168, 0, last].into()
    }

    fn displaced(connections: &[Connection]) -> Vec<usize> {
        let is_displaced = |(index, c): (usize, &Connection)| c.open.displaced.is_cancelled().then_some(index);
        connections.iter().enumerate().filter_map(is_displaced).collect()
    }

    #[test]
    fn a_peer_beyond_its_limit_displaces_its_own_oldest_connection() {
        let all = Arc::<Connections>::default();
        let mut open = vec![all.enter(peer(1))];
        open.extend((0..OF_PEER_MAX).map(|_| all.enter(peer(2))));
        assert!(displaced(&open).is_empty());
        open.push(all.enter(peer(2)));
        assert_eq!((displaced(&open), all.count()), (vec![1], OF_PEER_MAX + 1));
        open.remove(2);
        open.push(all.enter(peer(2)));
        assert_eq!(displaced(&open), [1], "one that has ended no longer counts");
    }

    #[test]
    fn many_peers_displace_the_oldest_of_all() {
        let all = Arc::<Connections>::default();
        let mut open: Vec<_> = (0..CONNECTIONS_MAX).map(|i| all.enter(peer(1 + (i / 16) as u8))).collect();
        open.push(all.enter(peer(9)));
        assert_eq!((displaced(&open), all.count()), (vec![0], CONNECTIONS_MAX));
        drop(open);
        assert_eq!(all.count(), 0);
    }
}
