//! Detection of other programs that use the processor during a measurement. They make its times too long.

use std::time::Instant;

/// Number of cores that other programs may use without a warning.
const ALLOWED_CORES: f64 = 0.2;
/// Shortest measurement that is judged, s. The kernel counts in steps of 10 ms.
const SHORTEST_S: f64 = 0.5;

/// Processor times at one moment, in the kernel's ticks.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Ticks {
    /// Total time of all cores, idle or not.
    all: u64,
    /// Busy time of all cores, including the time that a hypervisor gave to other machines.
    busy: u64,
    /// Processor time that this process used.
    own: u64,
    /// Number of cores of the machine, even if this process may use only some of them.
    cores: usize,
}

/// Watch over other programs during a measurement.
#[derive(Debug)]
pub struct OtherLoad {
    began: Instant,
    /// Processor times at the start; none where the kernel doesn't report them.
    ticks: Option<Ticks>,
}

impl OtherLoad {
    /// Starts the watch.
    pub fn begin() -> Self {
        Self { began: Instant::now(), ticks: Ticks::now() }
    }

    /// Logs a warning if other programs have used much of the processor since the start.
    pub fn warn(&self) {
        if self.began.elapsed().as_secs_f64() < SHORTEST_S {
            return;
        }
        let Some((from, to)) = self.ticks.zip(Ticks::now()) else { return };
        if let Some(others) = from.others_until(to).filter(|others| *others > ALLOWED_CORES) {
            let cores = to.cores;
            tracing::warn!(
                "other programs used {others:.1} of {cores} cores meanwhile: times are longer than on an idle machine"
            );
        }
    }
}

impl Ticks {
    /// Processor times at this moment, from `/proc`; none on other systems.
    fn now() -> Option<Self> {
        let read = |path: &str| std::fs::read_to_string(path).ok();
        Self::parse(&read("/proc/stat")?, &read("/proc/self/stat")?)
    }

    fn parse(machine: &str, process: &str) -> Option<Self> {
        // Fields: user, nice, system, idle, iowait, irq, softirq, steal. The guests after them are included in user.
        let line = machine.lines().next()?.strip_prefix("cpu ")?;
        let times: Vec<u64> = line.split_whitespace().take(8).map(str::parse).collect::<Result<_, _>>().ok()?;
        let cores = machine.lines().skip(1).take_while(|line| line.starts_with("cpu")).count();
        let idle = times.get(3)? + times.get(4)?;
        let all = times.iter().sum::<u64>();
        // Fields after the name in parentheses start with the state; utime and stime are the 12th and 13th of them.
        let mut fields = process.rsplit_once(')')?.1.split_whitespace().skip(11);
        let mut next = || fields.next()?.parse::<u64>().ok();
        Some(Self { all, busy: all - idle, own: next()? + next()?, cores })
    }

    /// Number of cores that other programs used from this moment until `to`; none if no time has passed.
    fn others_until(self, to: Self) -> Option<f64> {
        let all = to.all.checked_sub(self.all).filter(|&all| all > 0)?;
        let others = to.busy.saturating_sub(self.busy).saturating_sub(to.own.saturating_sub(self.own));
        Some(others as f64 / all as f64 * to.cores as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PROCESS: &str = "4711 (a ) name) R 1 2 3 4 5 6 7 8 9 10 250 50 0 0 20 0 3 0 100 0 0";

    #[test]
    fn other_programs_are_what_is_busy_without_this_process() {
        let from = Ticks::parse("cpu  1000 0 500 8000 100 0 20 30 0 0\ncpu0 1 2 3\ncpu1 1 2 3\nintr 5 cpu\n", PROCESS)
            .unwrap();
        assert_eq!(from, Ticks { all: 9650, busy: 1550, own: 300, cores: 2 });
        // Of 400 ticks on two cores, 300 were busy, and 190 of these were our own.
        let to = Ticks { all: from.all + 400, busy: from.busy + 300, own: from.own + 190, ..from };
        assert!((from.others_until(to).unwrap() - 0.55).abs() < 1e-12);
        assert_eq!(from.others_until(from), None);
    }

    #[test]
    fn text_of_another_kind_tells_nothing() {
        for (machine, process) in [("", PROCESS), ("cpu  1 2", PROCESS), ("cpu  1 2 3 4 5 6 7 8", "4711 name")] {
            assert_eq!(Ticks::parse(machine, process), None);
        }
        assert_eq!(Ticks::now().is_some(), std::path::Path::new("/proc/stat").exists());
    }
}
