//! Submission of commands on a separate thread, since a driver may block in it. Software Vulkan makes the whole frame
//! there, and the driver of a stuck device may never return.

use std::io;
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

type Job = Box<dyn FnOnce() + Send>;

/// Handle of the submitting thread, which ends with the handle's last clone. Between jobs, the thread holds no handle
/// of the device.
#[derive(Debug, Clone)]
pub(super) struct Submitter(mpsc::Sender<Job>);

/// Reason why a job has no result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Missing {
    /// The job exceeded its time limit.
    Late,
    /// The thread ended by a panic.
    Gone,
}

impl Submitter {
    /// Starts the thread.
    ///
    /// # Errors
    /// The system can start no thread.
    pub(super) fn start() -> io::Result<Self> {
        let (sender, jobs) = mpsc::channel::<Job>();
        thread::Builder::new().name("gpu-submit".to_owned()).spawn(move || jobs.into_iter().for_each(|job| job()))?;
        Ok(Self(sender))
    }

    /// Runs `job` on the thread and returns its result. A late job keeps the thread blocked, and later jobs are late,
    /// too.
    ///
    /// # Errors
    /// No result within `limit`.
    pub(super) fn run<T: Send + 'static>(
        &self,
        limit: Duration,
        job: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Missing> {
        let (done, result) = mpsc::sync_channel(1);
        let job = Box::new(move || {
            // The receiver is gone if the job was late.
            let _ = done.send(job());
        });
        self.0.send(job).map_err(|_| Missing::Gone)?;
        result.recv_timeout(limit).map_err(|error| match error {
            mpsc::RecvTimeoutError::Timeout => Missing::Late,
            mpsc::RecvTimeoutError::Disconnected => Missing::Gone,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_job_that_blocks_is_left_behind() {
        let long = Duration::from_secs(60);
        let submitter = Submitter::start().unwrap();
        assert_eq!(submitter.run(long, || 7), Ok(7));
        let (go_on, blocked) = mpsc::channel::<()>();
        let stuck = submitter.run(Duration::from_millis(1), move || blocked.recv().is_ok());
        assert_eq!(stuck, Err(Missing::Late));
        assert_eq!(submitter.run(Duration::from_millis(1), || ()), Err(Missing::Late));
        go_on.send(()).unwrap();
        assert_eq!(submitter.run(long, || 8), Ok(8), "a driver that returns is used again");
    }
}
