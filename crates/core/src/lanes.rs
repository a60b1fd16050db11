//! Jobs on several lanes in parallel. A lane is a worker with threads and memory of its own. Results come in the order
//! of the jobs.

use std::any::Any;
use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::mpsc::{self, Receiver, Sender};
use std::sync::{Mutex, PoisonError};

use rayon::{ThreadPool, ThreadPoolBuilder};

/// Largest number of lanes: each needs the memory of a renderer.
pub const LANES_MAX: usize = 8;

/// Number of jobs per lane that are taken in advance.
const AHEAD: usize = 1;

/// Number of lanes for this process: one per thread, up to [`LANES_MAX`].
pub fn lane_count() -> usize {
    rayon::current_num_threads().clamp(1, LANES_MAX)
}

/// Number of threads for each of `lanes` lanes that share `threads`; at least one each.
fn threads_of(lanes: usize, threads: usize) -> impl Iterator<Item = usize> {
    (0..lanes).map(move |lane| (threads / lanes + usize::from(lane < threads % lanes)).max(1))
}

type Outcome<R, E> = Result<Result<R, E>, Box<dyn Any + Send>>;

/// Runs `jobs` on `lanes`, one job per lane at a time, and passes the results to `each` in the order of the jobs.
///
/// A lane works within threads of its own; a single lane works on the calling thread. `each` runs on the calling
/// thread and receives the number of the job with its result. The iterator `jobs` also runs on the calling thread, a
/// few jobs ahead of the lanes, which continue meanwhile.
///
/// # Errors
/// The first error in the order of the jobs: of taking a job, of doing it, or of `each`. Earlier results have been
/// passed to `each`. Later jobs are not begun; jobs already running are finished.
pub fn in_order<L: Send, J: Send, R: Send, E: Send>(
    lanes: &mut [L],
    jobs: impl IntoIterator<Item = Result<J, E>>,
    work: impl Fn(&mut L, J) -> Result<R, E> + Sync,
    mut each: impl FnMut(usize, R) -> Result<(), E>,
) -> Result<(), E> {
    let threads = rayon::current_num_threads();
    let pools: Result<Vec<ThreadPool>, _> = threads_of(lanes.len(), threads).map(pool).collect();
    let pools = match pools {
        Ok(pools) if lanes.len() > 1 => pools,
        // If the lanes' threads can't be started, the first lane does all jobs.
        _ => {
            let Some(lane) = lanes.first_mut() else { return Ok(()) };
            return jobs.into_iter().enumerate().try_for_each(|(number, job)| each(number, work(lane, job?)?));
        }
    };
    let ahead = lanes.len() * (1 + AHEAD);
    let (give, given) = mpsc::channel::<(usize, J)>();
    let (done, results) = mpsc::channel::<(usize, Outcome<R, E>)>();
    let (given, work) = (Mutex::new(given), &work);
    std::thread::scope(|scope| {
        for (lane, pool) in lanes.iter_mut().zip(&pools) {
            let (given, done) = (&given, done.clone());
            scope.spawn(move || run(lane, pool, given, work, &done));
        }
        drop(done);
        // Dropping `give`, however this scope is left, ends the lanes.
        let give = give;
        hand_out(jobs.into_iter(), ahead, &give, &results, &mut each)
    })
}

fn pool(threads: usize) -> Result<ThreadPool, rayon::ThreadPoolBuildError> {
    ThreadPoolBuilder::new().num_threads(threads).thread_name(|n| format!("insonify-lane-{n}")).build()
}

/// Does jobs on one lane until there are no more, or one fails.
fn run<L: Send, J: Send, R: Send, E: Send>(
    lane: &mut L,
    pool: &ThreadPool,
    given: &Mutex<Receiver<(usize, J)>>,
    work: &(impl Fn(&mut L, J) -> Result<R, E> + Sync),
    done: &Sender<(usize, Outcome<R, E>)>,
) {
    loop {
        let next = given.lock().unwrap_or_else(PoisonError::into_inner).recv();
        let Ok((number, job)) = next else { return };
        let outcome = catch_unwind(AssertUnwindSafe(|| pool.install(|| work(lane, job))));
        let failed = !matches!(outcome, Ok(Ok(_)));
        if done.send((number, outcome)).is_err() || failed {
            return;
        }
    }
}

/// Hands jobs to the lanes, at most `ahead` jobs beyond the last result that `each` has received.
fn hand_out<J, R, E>(
    mut jobs: impl Iterator<Item = Result<J, E>>,
    ahead: usize,
    give: &Sender<(usize, J)>,
    results: &Receiver<(usize, Outcome<R, E>)>,
    each: &mut impl FnMut(usize, R) -> Result<(), E>,
) -> Result<(), E> {
    let (mut taken, mut delivered) = (0, 0);
    let mut waiting: VecDeque<Option<Outcome<R, E>>> = VecDeque::new();
    // Error of a job that could not be taken. The results of the jobs before it are delivered first.
    let mut refused = None;
    let mut more = true;
    loop {
        while more && taken - delivered < ahead {
            match jobs.next() {
                Some(Ok(job)) => {
                    waiting.push_back(None);
                    // Sending fails only after all lanes have ended because of an error, which is delivered below.
                    more = give.send((taken, job)).is_ok();
                    taken += 1;
                }
                Some(Err(error)) => (more, refused) = (false, Some(error)),
                None => more = false,
            }
            // Results are also collected here, since making a job may take long.
            results.try_iter().for_each(|(number, outcome)| waiting[number - delivered] = Some(outcome));
            deliver(&mut waiting, &mut delivered, each)?;
        }
        if delivered == taken {
            return refused.map_or(Ok(()), Err);
        }
        let Ok((number, outcome)) = results.recv() else { return refused.map_or(Ok(()), Err) };
        waiting[number - delivered] = Some(outcome);
        deliver(&mut waiting, &mut delivered, each)?;
    }
}

/// Passes the results that are next in order to `each`. A panic of a job is resumed here, on the calling thread.
fn deliver<R, E>(
    waiting: &mut VecDeque<Option<Outcome<R, E>>>,
    delivered: &mut usize,
    each: &mut impl FnMut(usize, R) -> Result<(), E>,
) -> Result<(), E> {
    while let Some(Some(_)) = waiting.front() {
        let Some(Some(outcome)) = waiting.pop_front() else { break };
        let result = outcome.unwrap_or_else(|panic| resume_unwind(panic));
        let number = *delivered;
        *delivered += 1;
        each(number, result?)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::time::Duration;

    use super::*;

    /// Lanes of the tests: each is a counter of its jobs.
    fn lanes(count: usize) -> Vec<usize> {
        vec![0; count]
    }

    fn jobs(count: usize) -> impl Iterator<Item = Result<usize, String>> {
        (0..count).map(Ok)
    }

    #[test]
    fn results_come_in_order_whatever_the_jobs_take() {
        for count in 1..5 {
            let mut all = lanes(count);
            let mut seen = Vec::new();
            let work = |lane: &mut usize, job: usize| {
                *lane += 1;
                std::thread::sleep(Duration::from_micros(500 * ((job * 7) % 5) as u64));
                Ok(10 * job)
            };
            let each = |number, result| {
                seen.push((number, result));
                Ok(())
            };
            in_order(&mut all, jobs(23), work, each).unwrap();
            assert_eq!(seen, (0..23).map(|i| (i, 10 * i)).collect::<Vec<_>>());
            assert_eq!(all.iter().sum::<usize>(), 23);
        }
    }

    #[test]
    fn jobs_are_taken_only_a_few_ahead() {
        let (taken, delivered) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let most = AtomicUsize::new(0);
        let source = jobs(40).inspect(|_| {
            let open = taken.fetch_add(1, Ordering::SeqCst) + 1 - delivered.load(Ordering::SeqCst);
            most.fetch_max(open, Ordering::SeqCst);
        });
        let each = |_, _| {
            delivered.fetch_add(1, Ordering::SeqCst);
            Ok(())
        };
        in_order(&mut lanes(3), source, |_, job| Ok(job), each).unwrap();
        assert!(most.into_inner() <= 3 * (1 + AHEAD));
    }

    #[test]
    fn the_first_error_ends_it_after_the_results_before() {
        for count in [1, 3] {
            let mut seen = Vec::new();
            let work = |_: &mut usize, job: usize| if job % 10 == 7 { Err(format!("job {job}")) } else { Ok(job) };
            let failed = in_order(&mut lanes(count), jobs(100), work, |number, _| {
                seen.push(number);
                Ok(())
            });
            assert_eq!((failed, seen), (Err("job 7".to_owned()), (0..7).collect::<Vec<_>>()));
        }
    }

    #[test]
    fn a_job_that_cannot_be_taken_ends_it_after_the_results_before() {
        for count in [1, 3] {
            let source = jobs(5).chain([Err("no more".to_owned())]).chain(jobs(5));
            let mut seen = 0;
            let each = |_, _| {
                seen += 1;
                Ok(())
            };
            assert_eq!(in_order(&mut lanes(count), source, |_, job| Ok(job), each), Err("no more".to_owned()));
            assert_eq!(seen, 5);
        }
    }

    #[test]
    fn an_error_of_the_receiver_ends_it() {
        let begun = AtomicUsize::new(0);
        let work = |_: &mut usize, job| {
            begun.fetch_add(1, Ordering::SeqCst);
            Ok(job)
        };
        let each = |number, _| if number == 3 { Err("full".to_owned()) } else { Ok(()) };
        assert_eq!(in_order(&mut lanes(2), jobs(1000), work, each), Err("full".to_owned()));
        assert!(begun.into_inner() < 10);
    }

    #[test]
    fn a_panic_of_a_lane_goes_on_in_the_caller() {
        let work = |_: &mut usize, job: usize| if job == 4 { std::panic::panic_any("burst") } else { Ok(job) };
        let run = || in_order(&mut lanes(3), jobs(50), work, |_, _| Ok(()));
        let panic = catch_unwind(run).unwrap_err();
        assert_eq!(panic.downcast_ref::<&str>(), Some(&"burst"));
    }

    #[test]
    fn threads_are_shared_out() {
        assert_eq!(threads_of(2, 2).collect::<Vec<_>>(), [1, 1]);
        assert_eq!(threads_of(8, 19).sum::<usize>(), 19);
        assert_eq!(threads_of(3, 1).collect::<Vec<_>>(), [1, 1, 1]);
    }

    #[test]
    fn each_lane_has_its_own_threads() {
        let shared = ThreadPoolBuilder::new().num_threads(5).build().unwrap();
        let mut seen = Vec::new();
        let work = |_: &mut usize, _| Ok(rayon::current_num_threads());
        let each = |_, threads: usize| {
            seen.push(threads);
            Ok(())
        };
        shared.install(|| in_order(&mut lanes(2), jobs(8), work, each)).unwrap();
        assert!(seen.iter().all(|threads| [2, 3].contains(threads)), "{seen:?}");
    }
}
