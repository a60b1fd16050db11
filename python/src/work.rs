//! Work outside the interpreter: a thread pool for this process, interruptible waits, and panics as errors.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::errors::{Failure, Kind};

/// Time between two checks for Ctrl-C.
const SIGNAL_POLL_INTERVAL: Duration = Duration::from_millis(50);

/// Thread pool of this process. A forked process has none of its parent's threads, so it gets a pool of its own.
fn pool() -> Result<Arc<ThreadPool>, Failure> {
    static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);
    let mut pool = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    match &*pool {
        Some((process, pool)) if *process == std::process::id() => Ok(pool.clone()),
        _ => {
            let threads = ThreadPoolBuilder::new().thread_name(|n| format!("insonify-{n}")).build();
            let made = threads.map_err(|e| Failure::new(Kind::Internal, format!("no threads can be started: {e}")))?;
            let made = Arc::new(made);
            // The parent's threads don't exist in this process, so joining them would wait forever.
            std::mem::forget(pool.replace((std::process::id(), made.clone())));
            Ok(made)
        }
    }
}

/// Runs `work` on the thread pool of this process. A panic becomes an error that asks the user to report it.
pub(crate) fn on_pool<T: Send>(work: impl FnOnce() -> Result<T, Failure> + Send) -> Result<T, Failure> {
    let pool = pool()?;
    catch_unwind(AssertUnwindSafe(|| pool.install(work))).unwrap_or_else(|panic| {
        let said = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
        let said = said.unwrap_or("no message");
        Err(Failure::new(Kind::Internal, format!("an error inside insonify, please report it: {said}")))
    })
}

/// Runs `work` on a thread of its own, without the interpreter's lock. Returns when it is done, or when a signal
/// raises an exception. After Ctrl-C the work continues in the background, and its result is dropped.
pub(crate) fn interruptibly<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T, Failure> + Send + 'static,
) -> PyResult<T> {
    let (sender, receiver) = mpsc::channel();
    let thread = std::thread::Builder::new().name("insonify".into()).spawn(move || {
        // After Ctrl-C there is no receiver.
        let _ = sender.send(work());
    });
    thread.map_err(|e| Failure::new(Kind::Internal, format!("no thread can be started: {e}")))?;
    Ok(wait(py, &Mutex::new(receiver))??)
}

/// Waits for a message without the interpreter's lock, and checks for signals meanwhile.
pub(crate) fn wait<T: Send>(py: Python<'_>, receiver: &Mutex<mpsc::Receiver<T>>) -> PyResult<T> {
    loop {
        let received =
            py.detach(|| receiver.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(SIGNAL_POLL_INTERVAL));
        match received {
            Ok(message) => return Ok(message),
            Err(RecvTimeoutError::Timeout) => py.check_signals()?,
            Err(RecvTimeoutError::Disconnected) => {
                return Err(Failure::new(Kind::Internal, "a thread of insonify ended early, please report it").into());
            }
        }
    }
}
