//! Selection of one sender at a datagram port; datagrams of other senders are left out.

use std::net::SocketAddr;
use std::time::Duration;

/// Silence of the current sender after which another sender replaces it.
const TAKEOVER: Duration = Duration::from_secs(2);

/// Number of further ports at the current sender's address, seen since its last datagram, that shows a sender with a
/// new port for each datagram. Its ports are then ignored.
const CHANGING_PORTS: usize = 3;

/// Verdict on a datagram.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sender {
    /// The datagram is from the tracker.
    Used,
    /// The datagram is from the tracker, whose address has changed.
    Changed {
        /// Sender until now.
        from: SocketAddr,
    },
    /// The datagram is from another sender.
    Other {
        /// Sender in use.
        used: SocketAddr,
    },
}

/// Decides which datagrams are used: those of the first sender, as long as it sends.
///
/// A sender is an address with a port. Some senders open a new socket for each datagram, which changes the port every
/// time. Such a sender is recognised by its ports, and from then on only its address counts.
#[derive(Debug, Default)]
pub(super) struct SenderLock {
    used: Option<(SocketAddr, Duration)>,
    /// Whether ports are ignored.
    by_address: bool,
    /// Other ports of the same address since the last datagram of the current sender.
    ports: Vec<u16>,
}

impl SenderLock {
    /// Judges a datagram from `from` that arrived at `now`.
    pub(super) fn judge(&mut self, from: SocketAddr, now: Duration) -> Sender {
        let Some((used, at)) = &mut self.used else {
            self.used = Some((from, now));
            return Sender::Used;
        };
        let same_address = used.ip() == from.ip();
        if *used == from || (self.by_address && same_address) {
            *at = now;
            self.ports.clear();
            return Sender::Used;
        }
        if same_address && !self.ports.contains(&from.port()) {
            self.ports.push(from.port());
            if self.ports.len() >= CHANGING_PORTS {
                self.by_address = true;
                *at = now;
                self.ports.clear();
                return Sender::Used;
            }
        }
        if now.saturating_sub(*at) >= TAKEOVER {
            let before = std::mem::replace(used, from);
            *at = now;
            self.by_address = false;
            self.ports.clear();
            return Sender::Changed { from: before };
        }
        Sender::Other { used: *used }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn verdicts(datagrams: &[(&str, u64)]) -> Vec<Sender> {
        let mut lock = SenderLock::default();
        datagrams.iter().map(|(from, ms)| lock.judge(from.parse().unwrap(), Duration::from_millis(*ms))).collect()
    }

    #[test]
    fn the_first_sender_is_used_while_it_sends() {
        let (a, b) = ("10.0.0.1:4000", "10.0.0.2:4000");
        let used = a.parse().unwrap();
        let found = verdicts(&[(a, 0), (b, 10), (a, 1500), (b, 3000), (b, 3499), (b, 3500), (a, 3510)]);
        let other = Sender::Other { used };
        assert_eq!(found[..5], [Sender::Used, other, Sender::Used, other, other]);
        assert_eq!(found[5..], [Sender::Changed { from: used }, Sender::Other { used: b.parse().unwrap() }]);
    }

    #[test]
    fn two_programs_on_one_computer_are_two_senders() {
        let (a, b) = ("127.0.0.1:4000", "127.0.0.1:4001");
        let found: Vec<_> =
            (0..100).flat_map(|i| [(a, i * 20), (b, i * 20 + 1), (b, i * 20 + 2), (b, i * 20 + 3)]).collect();
        let used = verdicts(&found).iter().filter(|verdict| **verdict == Sender::Used).count();
        assert_eq!(used, 100);
    }

    #[test]
    fn a_sender_may_open_a_socket_for_each_datagram() {
        let sent: Vec<String> = (0..50).map(|i| format!("10.0.0.1:{}", 40_000 + i)).collect();
        let sent: Vec<(&str, u64)> = sent.iter().zip(0..).map(|(from, i)| (from.as_str(), i * 20)).collect();
        let found = verdicts(&sent);
        assert!(found[3..].iter().all(|verdict| *verdict == Sender::Used), "{found:?}");
        let restarted = verdicts(&[("10.0.0.1:5", 0), ("10.0.0.1:6", 5000), ("10.0.0.1:6", 5010)]);
        assert_eq!(restarted[1..], [Sender::Changed { from: "10.0.0.1:5".parse().unwrap() }, Sender::Used]);
    }
}
